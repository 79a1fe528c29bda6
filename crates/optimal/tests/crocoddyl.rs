//! Comparison of all iterates with Crocoddyl's. `data/make_crocoddyl.py` wrote the reference numbers, with Crocoddyl
//! 3.2.1.
#![allow(non_snake_case)]

mod common;

use common::{limited_cartpole, limited_unicycle, straight};
use condyle_optimal::{DdpMethod, Fddp, Problem, Status};
use serde_json::Value;

/// Relative tolerance of costs. Two implementations with different rounding differ by about 1e-16 times the condition
/// number of the problem. With a warm start perturbed by 1e-12, Crocoddyl reproduces its own costs to 1e-11.
const COST: f64 = 1e-9;

/// Relative tolerance of states, of gains, and of differences of nearly equal numbers. These quantities are less well
/// determined near the optimum than the cost.
const DETAIL: f64 = 1e-6;

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|v| if v.is_array() { numbers(v) } else { vec![v.as_f64().unwrap()] })
        .collect()
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * (1.0 + b.abs())
}

/// Function that creates a problem from x̂₀, horizon, number of lanes and bounds on the controls.
type Build = fn(&[f64], usize, usize, Option<[Vec<f64>; 2]>) -> Problem;

/// Solves the problem `name` and compares all results. Each line search evaluates up to `lanes` step lengths in one
/// group.
fn compare(name: &str, build: Build, lanes: usize) {
    let data: Value = serde_json::from_str(include_str!("data/crocoddyl.json")).unwrap();
    let reference = &data["problems"][name];
    let (x0, horizon) = (numbers(&reference["x0"]), reference["horizon"].as_u64().unwrap() as usize);
    let bounds = reference["bounds"].as_array().map(|b| [numbers(&b[0]), numbers(&b[1])]);
    let mut problem = build(&x0, horizon, lanes, bounds);
    let xs = straight(&x0, &numbers(&reference["last_guess"]), horizon);
    let us = vec![0.0; problem.control_range(horizon).end];

    let mut solver = Fddp::new(&problem);
    solver.settings.project_warm_start = false; // Crocoddyl does not move a warm start into the bounds
    solver.settings.method = if reference["method"] == "ddp" { DdpMethod::Ddp } else { DdpMethod::Fddp };
    solver.settings.max_iterations = reference["max_iterations"].as_u64().unwrap() as usize;
    solver.settings.regularisation_start = reference["regularisation"].as_f64().unwrap();
    let solution = solver.solve(&mut problem, &xs, &us).unwrap();

    let trace = reference["trace"].as_array().unwrap();
    let (mut worst, mut worst_stop) = (0.0_f64, 0.0_f64);
    for (ours, theirs) in solution.trace.iter().zip(trace) {
        let [cost, gap, step, regularisation, stop, d1, d2, feasible] = numbers(theirs)[..] else { panic!() };
        worst = worst.max((ours.cost - cost).abs() / (1.0 + cost.abs()));
        worst_stop = worst_stop.max((ours.stop - stop).abs() / (1.0 + stop.abs()));
        let line = format!("{name}, iteration {}: {ours:?} against {theirs}", ours.iteration);
        assert_eq!(ours.step, step, "step: {line}");
        assert!(close(ours.regularisation, regularisation, 1e-12), "regularisation: {line}");
        assert_eq!(ours.feasible, feasible == 1.0, "feasible: {line}");
        assert!(close(ours.cost, cost, COST), "cost: {line}");
        assert!(close(ours.gap, gap, COST), "gap: {line}");
        for (ours, theirs) in [(ours.stop, stop), (ours.d1, d1), (ours.d2, d2)] {
            assert!(close(ours, theirs, COST), "{ours:e} against {theirs:e}: {line}");
        }
    }
    println!("{name}: cost differs by at most {worst:.1e}, stop by {worst_stop:.1e}");
    assert_eq!(solution.trace.len(), trace.len(), "{name}: number of iterations");
    assert_eq!(solution.status == Status::Converged, reference["converged"] == true, "{name}: {:?}", solution.status);

    let (u0, x_last) = (numbers(&reference["u0"]), numbers(&reference["x_last"]));
    assert!(solution.u(0).iter().zip(&u0).all(|(a, b)| close(*a, *b, DETAIL)), "{name}: {:?} {u0:?}", solution.u(0));
    assert!(solution.x(horizon).iter().zip(&x_last).all(|(a, b)| close(*a, *b, DETAIL)), "{name}");
    // Crocoddyl's gains are row-major and have the opposite sign; the gains of Condyle are column-major
    let K0 = numbers(&reference["K0"]);
    assert!(
        solution.K[0].transpose().iter().zip(&K0).all(|(a, b)| close(*a, -b, DETAIL)),
        "{name}: {} {K0:?}",
        solution.K[0]
    );
}

#[test]
fn unicycle_20() {
    compare("unicycle_20", limited_unicycle, 1);
}

#[test]
fn unicycle_200() {
    compare("unicycle_200", limited_unicycle, 1);
}

#[test]
fn unicycle_with_gaps() {
    compare("unicycle_gaps", limited_unicycle, 1);
}

#[test]
fn cartpole_swingup() {
    for lanes in [1, 4, 8] {
        compare("cartpole_swingup", limited_cartpole, lanes);
    }
}

#[test]
fn cartpole_with_gaps() {
    for lanes in [1, 4] {
        compare("cartpole_gaps", limited_cartpole, lanes);
    }
}

/// Compares a solve from a warm start far from any solution, with short steps and a regularisation that rises and
/// falls.
#[test]
fn cartpole_spinning() {
    for lanes in [1, 8] {
        compare("cartpole_spinning", limited_cartpole, lanes);
    }
}

#[test]
fn cartpole_with_a_large_regularisation() {
    compare("cartpole_regularised", limited_cartpole, 4);
}

#[test]
fn ddp() {
    compare("unicycle_ddp", limited_unicycle, 1);
    compare("cartpole_ddp", limited_cartpole, 1);
    for lanes in [1, 4] {
        compare("cartpole_ddp_falling", limited_cartpole, lanes);
    }
}

#[test]
fn box_fddp() {
    compare("unicycle_box_fddp", limited_unicycle, 1);
    compare("unicycle_box_gaps", limited_unicycle, 1);
    for lanes in [1, 4, 8] {
        compare("cartpole_box_fddp", limited_cartpole, lanes);
    }
}

#[test]
fn box_ddp() {
    compare("unicycle_box_ddp", limited_unicycle, 1);
    compare("cartpole_box_ddp", limited_cartpole, 4);
}
