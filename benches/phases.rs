//! Times the phases of an FDDP iteration, and prints the memory of a knot: `cargo bench -p condyle-benches --bench
//! phases [ROBOT ...]`. All times are medians over many solves, in µs per knot and iteration. The optimum's bits are
//! printed, so that two versions of the solver can be compared, and the bytes that a sweep reads from a knot.

use condyle::optimal::{Fddp, Solution};
use condyle::robots;
use condyle_benches::motions::motion;
use condyle_benches::{cart_pole, quadrotor};
use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

/// Number of FDDP iterations of a solve.
const ITERATIONS: usize = 5;
/// Number of timed solves.
const ROUNDS: usize = 41;
/// Numbers of knots. The matrices of the short horizon fit into a second-level cache of 2 MB.
const HORIZONS: [usize; 2] = [16, 100];

fn main() {
    let chosen: Vec<String> = std::env::args().skip(1).filter(|name| !name.starts_with('-')).collect();
    let robots = [
        ("cart_pole", cart_pole()),
        ("quadrotor", quadrotor()),
        ("arm7", robots::arm7()),
        ("quadruped", robots::quadruped()),
        ("humanoid", robots::humanoid()),
    ];
    println!("robot      knots  derivatives   sweep  rollout   total (µs)   bytes   optimum");
    for (name, robot) in robots.iter().filter(|(name, _)| chosen.is_empty() || chosen.iter().any(|one| one == name)) {
        for knots in HORIZONS {
            let (mut problem, xs, us) = motion(&Arc::new(robot.clone()), knots);
            let mut solver = Fddp::new(&problem);
            solver.settings.max_iterations = ITERATIONS;
            let mut rounds: Vec<[f64; 4]> = Vec::new();
            let mut optimum = 0;
            for _ in 0..=ROUNDS {
                let solution = black_box(solver.solve(&mut problem, &xs, &us).expect("a warm start that fits"));
                rounds.push(phases(solution, knots));
                optimum = solution.cost.to_bits();
            }
            let [derivatives, sweep, rollout, total] = [0, 1, 2, 3].map(|k| median(rounds[1..].iter().map(|r| r[k])));
            let bytes = solver.bytes_per_knot();
            println!(
                "{name:10} {knots:5} {derivatives:12.2} {sweep:7.2} {rollout:8.2} {total:7.2}      {bytes:7}   {optimum:016x}"
            );
        }
    }
}

/// Returns the durations of the phases in µs per knot and iteration: derivatives, sweep, rollout, and the whole solve.
fn phases(solution: &Solution, knots: usize) -> [f64; 4] {
    let count = (solution.trace.len() * knots) as f64;
    let timings = &solution.timings;
    [timings.calc_diff, timings.sweep, timings.rollout, timings.total]
        .map(|lasted: Duration| 1e6 * lasted.as_secs_f64() / count)
}

/// Returns the median.
fn median(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.collect();
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}
