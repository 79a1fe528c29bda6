//! `condyle budget`: measures whether a horizon fits into a period, for a robot on this machine.

mod chart;
mod clock;
mod dynamics;
mod solver;
mod text;

use crate::error::{Error, positive};
use crate::robot::{self, RobotArguments};
use crate::terminal::{say, say_json};
use crate::{limits, watch};
use clock::Effort;
use condyle::optimal::robot::Contact;
use condyle::{ContactConstraint, level};
use serde::Serialize;
pub(crate) use solver::held;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

/// Measure the computing time of horizons for a robot on this machine, and whether they fit into a period
#[derive(clap::Args)]
#[command(after_help = "Examples:
  condyle budget quadruped
  condyle budget panda.urdf --knots 100 --rate 100 --cores 2
  condyle budget anymal.urdf --root free --contacts LF_FOOT,RF_FOOT,LH_FOOT,RH_FOOT --knots 60 --rate 50
  condyle budget talos.urdf --root free --rigid-contacts left_sole_link,right_sole_link --json > budget.json

`cargo bench -p condyle-benches --bench horizon` measures the same for the embedded robots with criterion.

With --rate the exit status is 1 if an iteration, or as many as --iterations says, does not fit into the period; what
counts is p99, and the faster of one thread and all of them. In contact where contacts are given, else free.")]
pub(crate) struct Arguments {
    #[command(flatten)]
    robot: RobotArguments,
    /// Horizon lengths to measure, in knots
    #[arg(long, value_delimiter = ',', value_name = "N,…", default_value = "20,60,100,200")]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=100_000))]
    knots: Vec<u32>,
    /// Control rate (Hz); the iterations should fit into its period
    #[arg(long, value_name = "HZ", allow_negative_numbers = true)]
    rate: Option<f64>,
    /// Number of iterations per period
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    iterations: u32,
    /// Number of threads. Default: the number of cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    cores: Option<u32>,
    /// Frames in point contact with the world: feet, a tool
    #[arg(long, value_delimiter = ',', value_name = "FRAME,…")]
    contacts: Vec<String>,
    /// Frames in rigid contact with the world, which do not rotate: soles, a gripper
    #[arg(long, value_delimiter = ',', value_name = "FRAME,…")]
    rigid_contacts: Vec<String>,
    /// Maximum repetitions of a measurement. It ends after half a second, but not before five repetitions
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    repetitions: u32,
    /// Write JSON instead of text
    #[arg(long)]
    json: bool,
    /// Also write a plot of time over knots to this SVG file
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
}

/// Maximum duration of a measurement.
const TIME: Duration = Duration::from_millis(500);
/// Armature (kg m², kg) added to joints without inertia. Otherwise forward dynamics could not be measured.
const ARMATURE: f64 = 1e-2;

/// Report of `condyle budget`: all measurements and results.
#[derive(Serialize)]
struct Report {
    robot: String,
    nv: usize,
    level: String,
    cores: usize,
    /// Names of joints that received armature because they move no inertia.
    armature_added: Vec<String>,
    contacts: Vec<String>,
    horizons: Vec<dynamics::Row>,
    algorithms: Vec<dynamics::Row>,
    iterations: Vec<solver::Row>,
    verdicts: Vec<Verdict>,
}

/// Result for a horizon: whether the iterations fit into the period, and which rate and number of knots would fit.
#[derive(Serialize)]
struct Verdict {
    knots: usize,
    name: &'static str,
    /// 99th percentile of the time of one iteration (s).
    iteration_s: f64,
    /// Highest rate (Hz) at which the requested iterations still fit into a period.
    highest_rate: f64,
    /// Period (s). This field and the following fields are `None` without `--rate`.
    period_s: Option<f64>,
    iterations_per_period: Option<u64>,
    /// Maximum number of knots that fits into the period, by linear regression of the measured times.
    largest_knots: Option<u64>,
    fits: Option<bool>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Error> {
    if let Some(rate) = arguments.rate {
        positive("rate", rate)?;
    }
    let found = robot::load(&arguments.robot.robot, &arguments.robot.options)?;
    if found.model.nv() == 0 {
        return Err(Error::Rigid);
    }
    let (model, armature_added) = robot::regular(found.model, ARMATURE)?;
    let points = robot::frames(&model, &arguments.contacts)?;
    let rigid = robot::frames(&model, &arguments.rigid_contacts)?;
    let name = |frame: usize| model.frames()[frame].name.clone();
    let contacts: Vec<Contact> = points
        .iter()
        .map(|&f| Contact::new(&name(f), solver::held(ContactConstraint::point(f))))
        .chain(rigid.iter().map(|&f| Contact::new(&name(f), solver::held(ContactConstraint::rigid(f)))))
        .collect();
    let cores =
        arguments.cores.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), |n| n as usize);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(cores)
        .build()
        .map_err(|error| Error::Option { option: "cores", what: error.to_string() })?;
    let effort = Effort { repetitions: arguments.repetitions as usize, time: TIME };
    let mut knots: Vec<usize> = arguments.knots.iter().map(|&n| n as usize).collect();
    knots.sort_unstable();
    knots.dedup();
    let most = knots.last().copied().unwrap_or(1);

    let mut bench = dynamics::Bench::new(&model, most, &pool, effort);
    let bar = watch::bar(2 + knots.len() as u64 * 2, "measuring");
    let mut horizons = Vec::new();
    for &n in &knots {
        horizons.push(bench.horizon(n));
        bar.inc(1);
    }
    let algorithms = bench.algorithms(nearest(&knots, 100));
    let model = Arc::new(model.clone());
    let iterate = solver::Bench { q: limits::start(&model), model: model.clone(), contacts, pool: &pool, effort };
    let mut iterations = Vec::new();
    // The linear regression needs two points. If only one horizon is given, measure half of this horizon, too.
    let half = (knots.len() == 1 && most > 1).then_some(most / 2);
    for in_contact in [false, true] {
        if !in_contact || !iterate.contacts.is_empty() {
            for &n in half.iter().chain(&knots) {
                iterations.push(iterate.iteration(n, in_contact)?);
                bar.inc(1);
            }
        }
    }
    bar.finish_and_clear();
    let verdicts = verdicts(&iterations, &knots, arguments);
    let report = Report {
        robot: found.source,
        nv: model.nv(),
        level: format!("{:?}", level::level()).to_lowercase(),
        cores,
        armature_added,
        contacts: iterate.contacts.iter().map(|c| c.name.clone()).collect(),
        horizons,
        algorithms,
        iterations,
        verdicts,
    };
    if let Some(path) = &arguments.plot {
        let write = |source| Error::Write { file: path.display().to_string(), source };
        std::fs::write(path, chart::svg(&report)).map_err(write)?;
    }
    if arguments.json {
        say_json(&report);
    } else {
        say(&report.text(arguments));
    }
    match report.verdicts.iter().find(|v| v.fits == Some(false)) {
        Some(v) => Err(Error::NegativeAnswer(format!(
            "over budget: {} knots take {:.3} ms for {} iterations {}, the period is {:.3} ms",
            v.knots,
            1e3 * v.iteration_s * f64::from(arguments.iterations),
            arguments.iterations,
            v.name,
            1e3 * v.period_s.unwrap_or(0.0)
        ))),
        None => Ok(()),
    }
}

/// Returns the number in the list that is nearest to `wanted`.
fn nearest(numbers: &[usize], wanted: usize) -> usize {
    numbers.iter().copied().min_by_key(|n| n.abs_diff(wanted)).unwrap_or(wanted)
}

/// Returns the result for each horizon. The results are for horizons in contact if the arguments name contacts,
/// otherwise for free horizons.
fn verdicts(iterations: &[solver::Row], knots: &[usize], arguments: &Arguments) -> Vec<Verdict> {
    let counted = iterations.last().map_or("free", |row| row.name);
    let rows: Vec<&solver::Row> = iterations.iter().filter(|row| row.name == counted).collect();
    let needed = f64::from(arguments.iterations);
    let period = arguments.rate.map(|rate| 1.0 / rate);
    let largest = period.map(|period| largest(&rows, period / needed));
    let verdict = |row: &&solver::Row| {
        let time = row.best().p99;
        Verdict {
            knots: row.knots,
            name: row.name,
            iteration_s: time,
            highest_rate: 1.0 / (needed * time),
            period_s: period,
            iterations_per_period: period.map(|period| (period / time) as u64),
            largest_knots: largest,
            fits: period.map(|period| needed * time <= period && row.finite),
        }
    };
    rows.iter().filter(|row| knots.contains(&row.knots)).map(verdict).collect()
}

/// Returns the maximum number N of knots for which an iteration takes at most `time`. The function fits the line a + b
/// N to the measured times, and minimises relative errors.
fn largest(rows: &[&solver::Row], time: f64) -> u64 {
    // Minimise Σ ((a + b N)/t − 1)² over the measured times t, by normal equations with the weights 1/t².
    let (mut w, mut wn, mut wnn, mut wt, mut wnt) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for row in rows {
        let (n, t) = (row.knots as f64, row.best().p99);
        let weight = 1.0 / (t * t);
        (w, wn, wnn) = (w + weight, wn + weight * n, wnn + weight * n * n);
        (wt, wnt) = (wt + weight * t, wnt + weight * n * t);
    }
    let det = w * wnn - wn * wn;
    let (a, b) = match det > 1e-12 * w * wnn {
        true => ((wt * wnn - wnt * wn) / det, (w * wnt - wn * wt) / det),
        false => (0.0, wnt / wnn),
    };
    // Measured times contain noise. If the fitted line falls or begins below 0, fit a line through 0 instead.
    let (a, b) = if a < 0.0 || b <= 0.0 { (0.0, wnt / wnn) } else { (a, b) };
    ((time - a) / b).max(0.0) as u64
}
