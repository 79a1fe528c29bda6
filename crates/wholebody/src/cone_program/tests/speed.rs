//! What a tick costs; not a test.
//! `cargo test --release -p condyle-wholebody --lib speed -- --ignored --nocapture --test-threads 1`
//!
//! Under `valgrind --tool=callgrind --toggle-collect='*one_tick*'` with TICKS=20 it counts instructions.

use super::walk::Walk;
use crate::cone_program::{Clarabel, ConeProgram, Dense, InteriorPoint, Outcome, Settings, Solver, Start};
use std::time::Instant;

/// Ticks, but for another number in the environment's TICKS.
const TICKS: usize = 2000;
/// Each tick is replayed so many times, and the least time counts.
const REPLAYS: usize = 5;

#[inline(never)]
fn one_tick(solver: &mut dyn Solver, program: &ConeProgram, start: Start) -> (f64, Outcome) {
    let before = Instant::now();
    let outcome = solver.solve(program, start);
    (before.elapsed().as_secs_f64() * 1e6, outcome)
}

fn print(name: &str, mut times: Vec<f64>, iterations: &[u32]) {
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
    let (most, sum) = (iterations.iter().max().unwrap(), iterations.iter().sum::<u32>());
    println!(
        "{name}: p50 {:.1} µs, p99 {:.1} µs, max {:.1} µs; iterations {:.2}, at most {most}",
        at(0.5),
        at(0.99),
        at(1.0),
        f64::from(sum) / iterations.len() as f64
    );
}

fn number_of_ticks() -> Option<usize> {
    std::env::var("TICKS").ok().map(|x| x.parse().expect("TICKS: a number"))
}

fn measure(name: &str, walk: Walk, start: Start) {
    let walk = walk.disturbed([0.05, 0.3]);
    let mut program = walk.program();
    let mut solver = InteriorPoint::new(program.capacity(), Settings::default());
    let (mut times, mut iterations) = (Vec::new(), Vec::new());
    // Counted ticks are run once.
    let replays = if number_of_ticks().is_some() { 1 } else { REPLAYS };
    for tick in 0..number_of_ticks().unwrap_or(TICKS) {
        walk.write(tick, &mut program);
        let mut least = f64::INFINITY;
        for _ in 1..replays {
            least = least.min(one_tick(&mut solver.clone(), &program, start).0);
        }
        let (time, outcome) = one_tick(&mut solver, &program, start);
        if tick > 0 {
            times.push(least.min(time));
            iterations.push(outcome.iterations);
        }
    }
    print(&format!("{name}, interior point, {start:?}"), times, &iterations);
}

#[test]
#[ignore = "a measurement"]
fn humanoid_cold() {
    measure("humanoid", Walk::humanoid(1), Start::Cold);
}

#[test]
#[ignore = "a measurement"]
fn humanoid_warm() {
    measure("humanoid", Walk::humanoid(1), Start::Warm);
}

#[test]
#[ignore = "a measurement"]
fn quadruped_cold() {
    measure("quadruped", Walk::quadruped(1), Start::Cold);
}

#[test]
#[ignore = "a measurement"]
fn quadruped_warm() {
    measure("quadruped", Walk::quadruped(1), Start::Warm);
}

/// The pattern is dense: where the robot's is sparse, clarabel is faster than this.
#[test]
#[ignore = "a measurement"]
fn clarabel() {
    for (name, walk) in [("humanoid", Walk::humanoid(1)), ("quadruped", Walk::quadruped(1))] {
        let walk = walk.disturbed([0.05, 0.3]);
        let mut program = walk.program();
        let mut solver = Clarabel::new(program.capacity(), Dense, Settings::default());
        let (mut times, mut iterations) = (Vec::new(), Vec::new());
        for tick in 0..number_of_ticks().unwrap_or(TICKS / 10) {
            walk.write(tick, &mut program);
            let (time, outcome) = one_tick(&mut solver, &program, Start::Cold);
            times.push(time);
            iterations.push(outcome.iterations);
        }
        print(&format!("{name}, clarabel"), times, &iterations);
    }
}
