//! Rules of the augmented Lagrangian: when the penalty rises, when multipliers change, and when a solve has converged.

use super::starts::{HORIZON, WEAK, arm, clipped, control, exact};
use super::{ARM, quadratic};
use condyle_dynamics::robots;
use condyle_optimal::robot::{FreeDynamics, Limit, Residual};
use condyle_optimal::{AugmentedLagrangian, Problem, Status};
use std::sync::Arc;

/// Checks that a receding horizon without disturbances leaves the penalty as it is. Each tick makes few iterations, so
/// most inner solves end before they converge, with violated limits.
#[test]
fn the_penalty_rests_if_nothing_disturbs() {
    for iterations in [1, 2, 100] {
        let (mut problem, still) = arm(true, exact());
        let mut solver = AugmentedLagrangian::new(&problem);
        solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap();
        let penalty = solver.outcome().penalty;
        solver.inner.max_iterations = iterations;
        solver.settings.max_solves = 1;
        for tick in 0..30 {
            let next = solver.solution().x(1).to_vec();
            problem.shift(0).unwrap();
            solver.shift(&mut problem).unwrap();
            problem.set_x0(&next).unwrap();
            solver.resume(&mut problem).unwrap();
            assert!(solver.outcome().penalty <= penalty, "tick {tick}: {}", solver.outcome().penalty);
        }
    }
}

/// Checks that a fixed penalty converges by its multipliers alone.
#[test]
fn a_fixed_penalty_converges() {
    let (mut problem, still) = arm(true, exact());
    for penalty in [100.0, 1e4] {
        let mut solver = AugmentedLagrangian::new(&problem);
        (solver.settings.penalty_start, solver.settings.penalty_max) = (penalty, penalty);
        let status = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &clipped(&still, WEAK)).unwrap().status;
        assert_eq!((status, solver.outcome().penalty), (Status::Converged, penalty));
    }
}

/// Checks a problem whose states are so sensitive to controls (1e6) that the gradient without feedback is never small:
/// least effort, back to the initial state. The solution satisfies the terminal constraint in a rollout.
#[test]
fn a_sensitive_problem_converges() {
    let mut knot =
        FreeDynamics::running(Arc::new(robots::arm7()), 0.05, vec![quadratic("effort", 1e-3, control())]).unwrap();
    let still = knot.quasi_static(&ARM).repeat(HORIZON);
    let back = Limit::equality("back", Residual::State { reference: ARM.to_vec() });
    let end = FreeDynamics::terminal(Arc::new(robots::arm7()), vec![]).unwrap().with_limits(vec![back]).unwrap();
    let mut problem = Problem::new(ARM.to_vec(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end)).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    let solution = solver.solve(&mut problem, &ARM.repeat(HORIZON + 1), &still).unwrap().clone();
    assert_eq!(solution.status, Status::Converged);
    assert!(solver.outcome().primal <= 1e-6 && solver.outcome().cost < 0.01);
    let last = &problem.rollout(&solution.us).unwrap()[14 * HORIZON..];
    assert!(last.iter().zip(&ARM).all(|(x, goal)| (x - goal).abs() < 1e-5));
}
