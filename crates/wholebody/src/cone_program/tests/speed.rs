//! What a tick costs; not a test. `cargo test --release -p condyle-wholebody --lib speed -- --ignored --nocapture`

use super::walk::Walk;
use crate::cone_program::{Clarabel, Dense, InteriorPoint, Outcome, Settings, Solver, Start};
use std::time::Instant;

const TICKS: usize = 1000;

#[inline(never)]
fn cold_tick(solver: &mut dyn Solver, program: &crate::cone_program::ConeProgram) -> Outcome {
    solver.solve(program, Start::Cold)
}

#[inline(never)]
fn warm_tick(solver: &mut dyn Solver, program: &crate::cone_program::ConeProgram) -> Outcome {
    solver.solve(program, Start::Warm)
}

#[test]
#[ignore = "a measurement"]
fn ticks() {
    let ticks = std::env::var("TICKS").map_or(TICKS, |x| x.parse().unwrap());
    for (name, walk) in [("humanoid", Walk::humanoid(1)), ("quadruped", Walk::quadruped(1))] {
        let walk = walk.disturbed([0.05, 0.3]);
        let mut program = walk.program();
        let mut ours = InteriorPoint::new(program.capacity(), Settings::default());
        let mut clarabel = Clarabel::new(program.capacity(), Dense, Settings::default());
        for (backend, solver, start) in [
            ("interior point, cold", &mut ours as &mut dyn Solver, Start::Cold),
            ("interior point, warm", &mut InteriorPoint::new(program.capacity(), Settings::default()), Start::Warm),
            ("clarabel", &mut clarabel, Start::Cold),
        ] {
            if ticks < 100 && backend == "clarabel" {
                continue;
            }
            let (mut times, mut iterations) = (Vec::new(), 0);
            for tick in 0..ticks {
                walk.write(tick, &mut program);
                let before = Instant::now();
                let outcome =
                    if start == Start::Warm { warm_tick(solver, &program) } else { cold_tick(solver, &program) };
                times.push(before.elapsed().as_secs_f64() * 1e3);
                iterations += outcome.iterations;
            }
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((ticks - 1) as f64 * share) as usize];
            println!(
                "{name}, {backend}: p50 {:.4} ms, p99 {:.4} ms, {:.2} iterations",
                at(0.5),
                at(0.99),
                iterations as f64 / ticks as f64
            );
        }
    }
}
