//! Resumed solves whose start is lost, or whose last step was rejected.

use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle_optimal::{Fddp, Problem, Status};
use std::sync::Arc;
use std::time::Duration;

/// State of the arm at rest: positions, then velocities.
const REST: [f64; 14] = [0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
const HORIZON: usize = 15;
/// Bound on the costs in the closed loop. A solve from the quasi-static start costs less than 2 at each of the states.
const SANE: f64 = 20.0;

/// Creates the problem of an arm that reaches for a point. The problem allows any velocity at the end, so a rollout
/// that repeats the last control diverges.
fn reach(bound: f64) -> Problem {
    let arm = Arc::new(robots::arm7());
    let rest = Cost::new("rest", 0.1, Residual::State { reference: REST.to_vec() }, Activation::Quadratic);
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let target = Vec3::new(0.35, 0.2, 0.6);
    let place = Residual::FrameTranslation { frame: "tool".into(), target };
    let knot = FreeDynamics::running(arm.clone(), 0.05, vec![rest, effort]).unwrap();
    let knot = knot.with_bounds(vec![-bound; 7], vec![bound; 7]);
    let end = FreeDynamics::terminal(arm, vec![Cost::new("reach", 100.0, place, Activation::Quadratic)]).unwrap();
    Problem::new(REST.to_vec(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end)).unwrap()
}

fn start(problem: &mut Problem) -> (Vec<f64>, Vec<f64>) {
    let xs = REST.repeat(HORIZON + 1);
    let us = problem.quasi_static(&xs).unwrap();
    (xs, us)
}

#[test]
fn a_horizon_whose_end_runs_away_is_replaced() {
    for (bound, shifts) in [(40.0, 1), (87.0, 1), (f64::INFINITY, 1), (40.0, 2)] {
        let mut problem = reach(bound);
        let (xs, us) = start(&mut problem);
        let mut solver = Fddp::new(&problem);
        solver.solve(&mut problem, &xs, &us).unwrap();
        for tick in 0..15 {
            let x = solver.solution().x(shifts).to_vec();
            for _ in 0..shifts {
                problem.shift(0).unwrap();
                solver.shift(&mut problem).unwrap();
            }
            problem.set_x0(&x).unwrap();
            let found = solver.resume(&mut problem).unwrap();
            assert!(found.cost < SANE, "bound {bound}, {shifts} shifts, tick {tick}: {} {}", found.status, found.cost);
            assert!(found.us.iter().all(|u| u.abs() <= bound), "bound {bound}, tick {tick}");
        }
    }
}

/// Checks solves of one iteration each. Their steps are rejected until the regularisation is large enough.
#[test]
fn short_budgets_make_progress() {
    let mut problem = reach(20.0);
    let (xs, _) = start(&mut problem);
    let us = [20.0, -20.0].repeat(53)[..7 * HORIZON].to_vec();
    let mut solver = Fddp::new(&problem);
    solver.settings.time_budget = Some(Duration::from_nanos(1));
    let first = solver.solve(&mut problem, &xs, &us).unwrap().clone();
    let (mut last, mut refused) = (first, 0);
    for tick in 0..500 {
        let found = solver.resume(&mut problem).unwrap();
        assert!(found.status == Status::TimeLimit || tick > 0, "{}", found.status);
        let step = found.trace.last();
        if step.is_some_and(|step| step.accepted) || found.status != Status::TimeLimit {
            refused = 0;
        } else {
            refused += 1;
        }
        assert!(refused < 30, "tick {tick}: the same step is refused for ever: {step:?}");
        last = found.clone();
    }
    assert!(last.cost.is_finite() && last.gap < 1e-6, "{} {} {}", last.status, last.cost, last.gap);
}
