//! Adjoints of many solutions in SIMD lanes, compared with the adjoints one by one.

use super::{arm, constraints, error, first_solution, quadrotor, quadruped, solve_tightly};
use condyle_optimal::{Curvature, ParameterJacobian, Problem, Sensitivities, Sensitivity, SensitivitySettings};
use rand::RngExt;

/// Tolerance of the comparison, relative to the largest number: the sums have another order.
const ROUNDING: f64 = 1e-12;

/// Solves a problem and linearises it, with the derivatives with respect to parameters.
fn member(mut problem: Problem, bounded: bool, names: &[&str]) -> (Sensitivity, Vec<ParameterJacobian>) {
    let near = first_solution(&mut problem);
    let solution = if bounded { solve_tightly(&mut problem, &near.xs, &near.us, true) } else { near };
    let settings = SensitivitySettings { curvature: Curvature::GaussNewton, ..SensitivitySettings::default() };
    let sensitivity = Sensitivity::new(&mut problem, &solution, None, settings).unwrap();
    let named = |name: &&str| sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap();
    let jacobians = names.iter().map(named).collect();
    (sensitivity, jacobians)
}

/// Asserts that adjoints and gradients of a batch equal the ones of each sensitivity.
fn check(of: &mut [(Sensitivity, Vec<ParameterJacobian>)], [states, controls]: [usize; 2]) -> Sensitivities {
    let mut random = super::common::random();
    let mut numbers = |n: usize| -> Vec<f64> { (0..n).map(|_| random.random_range(-1.0..1.0)).collect() };
    let (by_states, by_controls) = (numbers(of.len() * states), numbers(of.len() * controls));
    let mut many = Sensitivities::new(of.iter().map(|(sensitivity, _)| sensitivity)).unwrap();
    many.adjoints(&numbers(of.len() * states), &numbers(of.len() * controls)).unwrap(); // nothing remains of this
    many.adjoints(&by_states, &by_controls).unwrap();
    assert_eq!(many.len(), of.len());
    for (i, (sensitivity, jacobians)) in of.iter_mut().enumerate() {
        let one = sensitivity.adjoint(&by_states[i * states..][..states], &by_controls[i * controls..][..controls]);
        let (one, ours) = (one.unwrap(), many.adjoint(i));
        let pairs = [
            (ours.states(), one.states()),
            (ours.controls(), one.controls()),
            (ours.costates(), one.costates()),
            (&ours.x0, &one.x0),
            (&ours.control_bounds, &one.control_bounds),
        ];
        for (k, (ours, one)) in pairs.into_iter().enumerate() {
            let worst = error(ours, one);
            assert!(worst < ROUNDING, "problem {i}, vector {k}: {worst:e}");
        }
        for jacobian in jacobians.iter() {
            let worst = error(&ours.gradient(jacobian), &one.gradient(jacobian));
            assert!(worst < ROUNDING, "problem {i}: {worst:e}");
        }
    }
    many
}

/// Checks arms with different initial states and targets, whose controls are at different bounds.
#[test]
fn arms_with_different_active_bounds() {
    let names = ["x0", "target/reach", "weight/reach", "duration"];
    let one = |k: usize| {
        let mut p = [0.0; 20];
        (p[1], p[14], p[15], p[19]) = (0.02 * k as f64, 0.03 * k as f64, -0.02 * k as f64, 2.0 * (k % 5) as f64);
        member(arm(&p), true, &names)
    };
    let mut all: Vec<_> = (0..11).map(one).collect();
    let active: Vec<usize> = all.iter().map(|(sensitivity, _)| sensitivity.report().active_controls).collect();
    println!("active controls: {active:?}");
    assert!(active.iter().any(|n| *n != active[0]));
    assert_eq!(check(&mut all, [16 * 14, 15 * 7]).in_lanes(), 11);
    check(&mut all[..1], [16 * 14, 15 * 7]);
}

/// Checks states that are no vector space, and knots with contacts.
#[test]
fn floating_bases() {
    let mut all: Vec<_> = (0..3)
        .map(|k| {
            let mut p = [0.0; 25];
            (p[4], p[12]) = (0.1 * k as f64, 0.1 * k as f64);
            member(quadrotor(&p), false, &["target/goal"])
        })
        .collect();
    assert_eq!(check(&mut all, [26 * 12, 25 * 4]).in_lanes(), 3);
    let mut all: Vec<_> = (0..3)
        .map(|k| {
            let mut p = [0.0; 9];
            p[0] = 0.1 * k as f64;
            member(quadruped(&p), false, &["contact/LF_foot", "duration"])
        })
        .collect();
    assert_eq!(check(&mut all, [9 * 36, 8 * 12]).in_lanes(), 3);
}

/// Checks that problems with active constraints are computed alone, and that batches with faults are refused.
#[test]
fn constraints_and_faults() {
    let mut all = constraints::solved();
    let many = check(&mut all, [16 * 14, 15 * 7]);
    assert_eq!((many.len(), many.in_lanes()), (1, 0));

    let none = Sensitivities::new([]).unwrap_err().to_string();
    assert_eq!(none, "sensitivity: the batch is empty, expected at least one sensitivity");
    let (arm, _) = member(arm(&[0.0; 20]), true, &[]);
    let (other, _) = member(quadruped(&[0.0; 9]), false, &[]);
    let mixed = Sensitivities::new([&arm, &other]).unwrap_err().to_string();
    assert_eq!(mixed, "`knot_models`: expected length 15, found 8");
    let mut two = Sensitivities::new([&arm, &arm]).unwrap();
    let short = two.adjoints(&[0.0; 224], &[0.0; 210]).unwrap_err().to_string();
    assert_eq!(short, "`by_states`: expected length 448, found 224");
}
