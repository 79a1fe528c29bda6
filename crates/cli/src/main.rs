//! Program `condyle`: shows a robot's model, checks its numbers, measures computing times, plans motions, finds
//! postures, and lets robots walk in a simulation.

#![allow(non_snake_case)] // names of variables are symbols of the literature

mod additions;
mod apart;
mod budget;
mod check;
mod error;
mod findings;
mod gait;
#[cfg(feature = "generate")]
mod generate;
mod ik;
mod inspect;
mod limits;
mod lines;
mod met;
mod motion;
mod page;
mod plan;
mod posture;
mod reach;
mod record;
mod report;
mod robot;
mod scene;
mod shapes;
mod states;
mod task;
mod terminal;
mod visuals;
mod walk;
mod watch;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use std::process::ExitCode;

/// Rigid-body dynamics with exact derivatives, for MPC and DDP.
#[derive(Parser)]
#[command(version, arg_required_else_help = true, after_help = error::STATUSES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Inspect(inspect::Arguments),
    Budget(budget::Arguments),
    Check(check::Arguments),
    Plan(Box<plan::Arguments>),
    Ik(Box<ik::Arguments>),
    Walk(Box<walk::Arguments>),
    #[cfg(feature = "generate")]
    Generate(generate::Arguments),
    /// Write a robot's dynamics as code; only in programs built with the feature `generate`
    #[cfg(not(feature = "generate"))]
    #[command(hide = true, disable_help_flag = true)]
    Generate {
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Write a shell's completions to standard output
    #[command(after_help = "Example:\n  condyle completions bash > ~/.local/share/bash-completion/completions/condyle")]
    Completions {
        /// Shell for which completions are written
        shell: clap_complete::Shell,
    },
}

fn main() -> ExitCode {
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse(&error),
    };
    let result = match arguments.command {
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Budget(arguments) => budget::run(&arguments),
        Command::Check(arguments) => check::run(&arguments),
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Ik(arguments) => ik::run(&arguments),
        Command::Walk(arguments) => walk::run(&arguments),
        #[cfg(feature = "generate")]
        Command::Generate(arguments) => generate::run(&arguments),
        #[cfg(not(feature = "generate"))]
        Command::Generate { .. } => Err(error::Error::Feature { command: "generate" }),
        Command::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(shell, &mut Arguments::command(), "condyle", &mut script);
            terminal::say(&String::from_utf8_lossy(&script));
            Ok(())
        }
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            error.status()
        }
    }
}

/// Reports invalid command-line arguments in one line, with the most similar name if there is one. If the arguments
/// request help, prints the help.
fn refuse(error: &clap::Error) -> ExitCode {
    let text = error.render().to_string();
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => {
            terminal::say(&text);
            ExitCode::SUCCESS
        }
        ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            eprint!("{text}");
            ExitCode::from(2)
        }
        _ => {
            let lines = text.lines().map(str::trim).take_while(|line| !line.starts_with("Usage:"));
            let said: Vec<&str> = lines.filter(|line| !line.is_empty() && !line.starts_with("For more")).collect();
            eprintln!("{}", said.join("; ").replace("; tip: ", "; ").replace(":; ", ": "));
            ExitCode::from(2)
        }
    }
}
