//! Times ticks of whole-body control, for recorded robots that stand, walk and trot under pushes. The script
//! `wholebody.py` builds and runs this program, and programs of other solvers.
//!
//! ```text
//! cargo bench -p condyle-benches --bench wholebody_peers -- \
//!     [--ticks N] [--replays N] [--export FOLDER --window N] [ROBOT[=URDF] …]
//! ```
//!
//! A new controller replays each recording; each tick starts from the solution of the previous tick. The time of a tick
//! is the least time in all replays. The program prints one record per line. Run the program on one core: `taskset -c
//! 1`.

#[path = "../../crates/wholebody/tests/common/workload.rs"]
mod workload;

use condyle_wholebody::inspection::Program;
use condyle_wholebody::{Backend, Formulation, Friction, Settings, Status, WholeBodyController};
use serde_json::json;
use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;
use workload::{Robot, Tick, record};

/// Friction pyramid for comparisons, with four faces inside the friction cone.
const PYRAMID: Friction = Friction::Pyramid { sides: 4, inscribed: true };

struct Options {
    ticks: usize,
    replays: usize,
    export: Option<PathBuf>,
    window: usize,
    robots: Vec<String>,
}

impl Options {
    fn read() -> Result<Self, Box<dyn Error>> {
        let mut options = Self { ticks: 10_000, replays: 5, export: None, window: 1000, robots: Vec::new() };
        let mut arguments = std::env::args().skip(1).filter(|a| a != "--bench");
        while let Some(argument) = arguments.next() {
            let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
            match argument.as_str() {
                "--ticks" => options.ticks = value()?.parse()?,
                "--replays" => options.replays = value()?.parse()?,
                "--window" => options.window = value()?.parse()?,
                "--export" => options.export = Some(value()?.into()),
                robot => options.robots.push(robot.to_owned()),
            }
        }
        if options.robots.is_empty() {
            options.robots = ["humanoid", "quadruped"].map(str::to_owned).to_vec();
        }
        Ok(options)
    }
}

/// Returns a quantile of the sorted numbers: the given fraction of the numbers is below it.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted[(part * (sorted.len() - 1) as f64).round() as usize]
}

/// Returns the time (ms) of each tick in each replay. For each tick, `prepare` runs first, and then `call` is timed.
/// Each replay has a new controller.
fn replay(
    ticks: &[Tick],
    replays: usize,
    controller: impl Fn() -> WholeBodyController,
    prepare: impl Fn(&mut WholeBodyController, &Tick),
    mut call: impl FnMut(&mut WholeBodyController, &Tick),
) -> Vec<Vec<f64>> {
    (0..replays)
        .map(|_| {
            let mut controller = controller();
            let timed = |tick: &Tick| {
                prepare(&mut controller, tick);
                let start = Instant::now();
                call(&mut controller, tick);
                1e3 * start.elapsed().as_secs_f64()
            };
            ticks.iter().map(timed).collect()
        })
        .collect()
}

/// Returns p50, p99 and maximum over the ticks, where the time of a tick is the least time in all replays. Also returns
/// p99 of the times in all replays.
fn statistics(times: &[Vec<f64>]) -> serde_json::Value {
    let mut least: Vec<f64> =
        (0..times[0].len()).map(|k| times.iter().map(|t| t[k]).fold(f64::INFINITY, f64::min)).collect();
    let mut raw: Vec<f64> = times.concat();
    least.sort_by(f64::total_cmp);
    raw.sort_by(f64::total_cmp);
    json!({
        "p50_ms": quantile(&least, 0.5),
        "p99_ms": quantile(&least, 0.99),
        "max_ms": least[least.len() - 1],
        "raw_p99_ms": quantile(&raw, 0.99),
    })
}

fn print(robot: &Robot, motion: &str, what: serde_json::Value, times: &[Vec<f64>]) {
    let mut record = json!({
        "robot": robot.name, "workload": motion, "ticks": times[0].len(), "replays": times.len(), "ours": true,
    });
    for part in [what, statistics(times)] {
        let fields = part.as_object().expect("an object").clone();
        record.as_object_mut().expect("an object").extend(fields);
    }
    println!("{record}");
}

/// Times each back end with cones and with pyramids, in the form of program that the back end uses. Also times the
/// assembly of the condensed program alone.
fn time(robot: &Robot, motion: &str, ticks: &[Tick], replays: usize) {
    for (friction, friction_name) in [(Friction::Cone, "cone"), (PYRAMID, "pyramid")] {
        let settings = Settings { friction, ..Robot::settings() };
        let assembly = replay(
            ticks,
            replays,
            || robot.controller(settings.clone()),
            |_, _| (),
            |controller, Tick { q, v, references }| controller.assemble(q, v, references),
        );
        let what = json!({"backend": "none", "part": "assembly", "friction": friction_name, "form": "condensed"});
        print(robot, motion, what, &assembly);
        for (backend, name) in [(Backend::InteriorPoint, "condyle"), (Backend::Clarabel, "clarabel")] {
            let (mut iterations, mut unsolved) = (0, 0);
            let settings = Settings { backend, ..settings.clone() };
            let times = replay(
                ticks,
                replays,
                || robot.controller(settings.clone()),
                |_, _| (),
                |controller, Tick { q, v, references }| {
                    let command = controller.step(q, v, references);
                    iterations += command.iterations;
                    unsolved += usize::from(command.status != Status::Solved);
                },
            );
            let solves = (ticks.len() * replays) as f64;
            let what = json!({
                "backend": name, "part": "tick", "friction": friction_name, "form": "condensed",
                "iterations": f64::from(iterations) / solves, "unsolved": unsolved / replays,
            });
            print(robot, motion, what, &times);
        }
    }
}

/// Times the solves of Condyle's back ends, with pyramids and without the assembly of the programs. Other solvers are
/// compared with these times.
fn time_solves(robot: &Robot, motion: &str, ticks: &[Tick], replays: usize) {
    for (backend, formulation, name, form_name) in [
        (Backend::InteriorPoint, Formulation::Full, "condyle", "full"),
        (Backend::InteriorPoint, Formulation::Condensed, "condyle", "condensed"),
        (Backend::Clarabel, Formulation::Full, "clarabel", "full"),
        (Backend::Clarabel, Formulation::Condensed, "clarabel", "condensed"),
    ] {
        let settings = Settings { friction: PYRAMID, backend, formulation, ..Robot::settings() };
        let times = replay(
            ticks,
            replays,
            || robot.controller(settings.clone()),
            |controller, Tick { q, v, references }| controller.assemble(q, v, references),
            |controller, _| controller.solve_assembled(),
        );
        let what = json!({"backend": name, "part": "solve", "friction": "pyramid", "form": form_name});
        print(robot, motion, what, &times);
    }
}

/// Writes the programs of consecutive ticks with pyramids, in both forms, and Condyle's optimum. Sizes are written as
/// JSON, one line for each tick. The other numbers are stored as 64-bit floating-point numbers: P, c, A, b, G, l, u of
/// the full form, then the same arrays of the condensed form, then Condyle's solutions in both forms. Matrices are
/// stored column by column.
fn export(robot: &Robot, motion: &str, ticks: &[Tick], folder: &Path) -> Result<(), Box<dyn Error>> {
    let settings = Settings { friction: PYRAMID, ..Robot::settings() };
    let mut controller = robot.controller(settings);
    let path = folder.join(format!("{}-{motion}", robot.name));
    let mut sizes = BufWriter::new(File::create(path.with_extension("sizes"))?);
    let mut numbers = BufWriter::new(File::create(path.with_extension("numbers"))?);
    for Tick { q, v, references } in ticks {
        controller.step(q, v, references).solved()?;
        let optimum = controller.optimum();
        let forms = [controller.program(q, v, references), controller.reduced_program(q, v, references)];
        let size = |p: &Program| json!([p.c.len(), p.b.len(), p.lower.len()]);
        writeln!(sizes, "{}", json!([size(&forms[0]), size(&forms[1])]))?;
        for Program { P, c, A, b, G, lower, upper, .. } in &forms {
            for part in [P.as_slice(), c.as_slice(), A.as_slice(), b.as_slice(), G.as_slice(), lower.as_slice()] {
                part.iter().try_for_each(|x| numbers.write_all(&x.to_le_bytes()))?;
            }
            upper.iter().try_for_each(|x| numbers.write_all(&x.to_le_bytes()))?;
        }
        optimum.x.iter().chain(&optimum.z).try_for_each(|x| numbers.write_all(&x.to_le_bytes()))?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let options = Options::read()?;
    for robot in &options.robots {
        let (name, urdf) = robot.split_once('=').map_or((robot.as_str(), None), |(name, path)| (name, Some(path)));
        let robot = Robot::new(name, urdf)?;
        for moves in [false, true] {
            let motion = if moves { robot.gait() } else { "stand" };
            let ticks = record(&robot, moves, options.ticks);
            if options.replays > 0 {
                time(&robot, motion, &ticks, options.replays);
            }
            if let Some(folder) = &options.export {
                let count = options.window.min(ticks.len());
                let window = &ticks[(ticks.len() - count) / 2..][..count];
                if options.replays > 0 {
                    time_solves(&robot, motion, window, options.replays);
                }
                export(&robot, motion, window, folder)?;
            }
        }
    }
    Ok(())
}
