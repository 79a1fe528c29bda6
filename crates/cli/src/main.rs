//! The program `condyle`: plan a robot's motion, and see what it costs.

#![allow(non_snake_case)] // the names of the literature

mod page;
mod plan;
mod posture;
mod report;
mod scene;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Rigid-body dynamics with exact derivatives, for MPC and DDP.
#[derive(Parser)]
#[command(version, about, arg_required_else_help = true)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Plan(plan::Arguments),
}

fn main() -> ExitCode {
    let Command::Plan(arguments) = Arguments::parse().command;
    match plan::run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}
