//! `condyle check`: checks the results of the library's algorithms for a robot on this machine.

mod derivatives;
mod energy;
mod identities;
mod ledger;
mod ratio;

use crate::error::Error;
use crate::robot::{self, RobotArguments};
use crate::terminal::{Style, Table, heading, say, say_json, styled};
use ledger::Row;
use serde::Serialize;

/// Check identities, derivatives and energies of a robot at random states, each against an error bound
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle check robot.urdf
  condyle check talos.urdf --root free --states 10000 --seed 7
  condyle check humanoid --json | jq '.rows[] | select(.pass | not)'

Errors are relative to 1 + the largest number involved. If the inverse of the inertia matrix M is involved, an error of
100 ε times the condition number of M is allowed where this exceeds the bound. The exit status is 1 if a check fails.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    robot: RobotArguments,
    /// Number of random states for identities; derivatives use a fiftieth of them, at least five
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u32).range(1..=10_000_000))]
    states: u32,
    /// Seed of the random states
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Write JSON instead of text
    #[arg(long)]
    json: bool,
}

/// Armature (kg m², kg) added to joints without inertia. Otherwise forward dynamics could not be checked.
const ARMATURE: f64 = 1e-2;

#[derive(Serialize)]
struct Report {
    robot: String,
    nq: usize,
    nv: usize,
    states: u32,
    seed: u64,
    /// Names of joints that received armature because they move no inertia.
    armature_added: Vec<String>,
    pass: bool,
    rows: Vec<Row>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    let found = robot::load(&arguments.robot.robot, &arguments.robot.options)?;
    if found.model.nv() == 0 {
        return Err(Error::Rigid);
    }
    let (model, armature_added) = robot::regular(found.model, ARMATURE)?;
    let (states, seed) = (arguments.states as usize, arguments.seed);
    let few = (states / 50).max(5);
    let mut rows = identities::check(&model, states, seed);
    rows.extend(derivatives::check(&model, few, seed));
    rows.extend(ratio::check(&model, few, seed, ARMATURE)?);
    rows.extend(energy::check(&model, ARMATURE)?);
    let report = Report {
        robot: found.source,
        nq: model.nq(),
        nv: model.nv(),
        states: arguments.states,
        seed,
        armature_added,
        pass: rows.iter().all(|row| row.pass),
        rows,
    };
    if arguments.json {
        say_json(&report);
    } else {
        say(&report.text());
    }
    match report.rows.iter().filter(|row| !row.pass).count() {
        0 => Ok(()),
        n => Err(Error::NegativeAnswer(format!("{}: {n} of {} checks failed", report.robot, report.rows.len()))),
    }
}

impl Report {
    fn text(&self) -> String {
        let title = format!("{}  nq = {}, nv = {}, {} states", self.robot, self.nq, self.nv, self.states);
        let mut text = heading(&title);
        for joint in &self.armature_added {
            text += &format!("  joint `{joint}` moves nothing with inertia: checked with armature\n");
        }
        let mut table = Table::new(&["check", "equation", "error", "bound", "", "the bound is", ""]);
        for row in &self.rows {
            let verdict = if row.pass { styled(Style::Good, "pass") } else { styled(Style::Bad, "FAIL") };
            let bound = if row.bound.is_finite() { format!("{:.1e}", row.bound) } else { "by order".to_owned() };
            let error = if row.error.is_nan() { "not finite".to_owned() } else { format!("{:.1e}", row.error) };
            table.row(vec![
                row.name.to_owned(),
                row.equation.to_owned(),
                error,
                bound,
                verdict,
                row.because.to_owned(),
                row.note.clone(),
            ]);
        }
        text += &table.text();
        let passed = self.rows.iter().filter(|row| row.pass).count();
        let style = if self.pass { Style::Good } else { Style::Bad };
        text += &format!("\n{}\n", styled(style, &format!("{passed} of {} checks pass", self.rows.len())));
        text
    }
}
