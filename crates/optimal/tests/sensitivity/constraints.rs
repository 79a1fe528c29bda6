//! Derivatives of solutions with constraints, by the augmented Lagrangian and by the interior point.

use super::{DIFFERENCES, Family, Loss, check_within};
use condyle_dynamics::{Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Limit, Residual};
use condyle_optimal::{
    AugmentedLagrangian, ConstraintSettings, InteriorPoint, ParameterJacobian, Problem, Sensitivity,
    SensitivitySettings, Solution, Status,
};
use std::sync::Arc;

/// Tolerance for the interior point, whose active rows end at a distance of about 5e-7 from their bounds.
const NEAR: f64 = 2e-5;

/// Creates the problem of an arm that moves a tool to a point, with a limit on the velocity of its joints and an
/// equality at the end. The parameters are changes of the initial positions (7), of the limit, of the height of the
/// final point, and of a target.
fn arm(p: &[f64]) -> Problem {
    let model = Arc::new(robots::arm7());
    let x0: Vec<f64> =
        [0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2].iter().zip(p).map(|(x, dx)| x + dx).chain([0.0; 7]).collect();
    let rest = [0.1, 0.4, -0.2, 1.2, 0.3, 0.8, 0.2].into_iter().chain([0.0; 7]).collect();
    let costs = vec![
        Cost::new("rest", 0.1, Residual::State { reference: rest }, Activation::Quadratic),
        Cost::new("effort", 1e-2, Residual::Control { reference: vec![p[9]; 7] }, Activation::Quadratic),
    ];
    let place = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, -0.3, 0.6 + p[8]) };
    let speed = 1.2 + p[7];
    let bounds = |sign: f64| [vec![sign * f64::INFINITY; 7], vec![sign * speed; 7]].concat();
    let slow = Limit::new("slow", Residual::State { reference: vec![0.0; 14] }, bounds(-1.0), bounds(1.0));
    let knot = FreeDynamics::running(model.clone(), 0.05, costs).unwrap().with_limits(vec![slow]).unwrap();
    let end =
        FreeDynamics::terminal(model, vec![]).unwrap().with_limits(vec![Limit::equality("place", place)]).unwrap();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 15], Box::new(end)).unwrap()
}

fn interior_point(problem: &mut Problem, xs: &[f64], us: &[f64]) -> (Solution, InteriorPoint) {
    let mut solver = InteriorPoint::new(problem);
    (solver.settings.tolerance, solver.settings.max_iterations) = (5e-8, 500);
    solver.settings.second_order = true;
    let solution = solver.solve(problem, xs, us).unwrap().clone();
    assert_eq!(solution.status, Status::Converged, "{:?}", solver.outcome().worst);
    (solution, solver)
}

fn augmented_lagrangian(problem: &mut Problem, xs: &[f64], us: &[f64]) -> (Solution, AugmentedLagrangian) {
    let mut solver = AugmentedLagrangian::new(problem);
    solver.settings =
        ConstraintSettings { tolerance: 1e-9, tolerance_dual: 1e-10, max_solves: 200, ..ConstraintSettings::default() };
    (solver.inner.tolerance, solver.inner.max_iterations) = (1e-21, 500);
    let solution = solver.solve(problem, xs, us).unwrap().clone();
    let outcome = solver.outcome();
    assert_eq!(solution.status, Status::Converged, "{:e} {:e}", outcome.primal, outcome.dual);
    (solution, solver)
}

/// Solves the arm by the augmented Lagrangian, and linearises it.
pub(crate) fn solved() -> Vec<(Sensitivity, Vec<ParameterJacobian>)> {
    let mut problem = arm(&[0.0; 10]);
    let xs = problem.x0().repeat(16);
    let us = problem.quasi_static(&xs).unwrap();
    let (solution, solver) = augmented_lagrangian(&mut problem, &xs, &us);
    let settings = SensitivitySettings::default();
    vec![(Sensitivity::new(&mut problem, &solution, Some(solver.outcome()), settings).unwrap(), vec![])]
}

/// Checks both solvers, with active inequalities and equalities, against differences of solutions of the augmented
/// Lagrangian.
#[test]
fn an_arm_with_limits() {
    let mut problem = arm(&[0.0; 10]);
    let xs = problem.x0().repeat(16);
    let us = problem.quasi_static(&xs).unwrap();
    let (solution, solver) = interior_point(&mut problem, &xs, &us);
    let outcome = solver.outcome().clone();
    let (other, exact) = augmented_lagrangian(&mut problem, &solution.xs, &solution.us);
    let its_outcome = exact.outcome().clone();
    let loss = Loss::new(&problem, &other);
    let solve = |problem: &mut Problem, _: &Solution| {
        let solution = exact.clone().resume(problem).unwrap().clone(); // from the multipliers of the solution
        assert_eq!(solution.status, Status::Converged);
        solution
    };
    let mut scales = [50.0; 10];
    scales[8] = 25.0; // the motion depends strongly on the final height
    let numeric = Family { build: &arm, solve: &solve, scales: &scales }.differences(&other, &loss);
    for (name, solution, outcome, tolerance) in
        [("interior point", &solution, &outcome, NEAR), ("augmented Lagrangian", &other, &its_outcome, DIFFERENCES)]
    {
        let settings = SensitivitySettings::default();
        let mut sensitivity = Sensitivity::new(&mut problem, solution, Some(outcome), settings).unwrap();
        println!("{name}: {:?}", sensitivity.report());
        assert!(sensitivity.report().active_rows > 6 && sensitivity.report().strict_complementarity);
        let own = sensitivity.jacobian_of(&problem, 10, 1e-5, |p| Ok(arm(p))).unwrap();
        check_within(tolerance, &mut sensitivity, &own, &loss, &numeric, name);
        // the derivatives with respect to bounds need no parameter: the limit's bounds move by ±1
        let adjoint = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap();
        let expected = adjoint.gradient(&own)[7];
        let mut by_speed = 0.0;
        for (bounds, y) in adjoint.row_bounds[..15].iter().zip(&outcome.multipliers) {
            by_speed += bounds.iter().zip(y).map(|(bound, y)| bound * y.signum()).sum::<f64>();
        }
        assert!((by_speed - expected).abs() < 1e-8 * expected.abs(), "{by_speed} {expected}");
        assert_eq!(sensitivity.first_control_by_x0().unwrap().shape(), (7, 14));
    }
}
