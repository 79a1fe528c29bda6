//! Derivatives with respect to numbers of robots, bounds and friction, and these numbers as vectors of a problem.

use super::{ARM, Family, Loss, TIGHT, arm, check, error, first_solution, quadruped_with, solve_tightly};
use condyle_dynamics::inertial_parameters::{from_inertia, to_inertia};
use condyle_dynamics::{Model, Vec3, robots};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, FrictionCone, Limit, Residual};
use condyle_optimal::{
    AugmentedLagrangian, ConstraintSettings, Parameter, ParameterValues, Problem, Sensitivity, SensitivitySettings,
    Solution, Status,
};
use std::sync::Arc;

/// Index of the arm's link whose inertia is a parameter.
const LINK: usize = 4;

/// Returns a robot whose inertial parameters of one body, gravity and armature are changed.
fn changed(model: Model, body: usize, inertia: &[f64], gravity: &[f64], armature: &[f64]) -> Model {
    let g = *model.gravity();
    let g = Vec3::new(g.x + gravity[0], g.y + gravity[1], g.z + gravity[2]);
    let armature: Vec<f64> = model.armature().iter().zip(armature).map(|(a, da)| a + da).collect();
    let with = |I: [f64; 10]| to_inertia(core::array::from_fn(|k| I[k] + inertia[k]));
    let model = model.with_inertias(|i, I| if i == body { with(from_inertia(I)) } else { I }).unwrap();
    model.with_gravity(g).unwrap().with_armature(&armature).unwrap()
}

/// Creates the problem of an arm that reaches a point. The parameters are changes of the inertial parameters of a link
/// (10), of gravity (3) and of the armature (7).
fn reach(p: &[f64]) -> Problem {
    let arm = robots::arm7().with_armature(&[0.1; 7]).unwrap();
    let model = Arc::new(changed(arm, LINK, &p[..10], &p[10..13], &p[13..]));
    let rest = Residual::State { reference: [ARM.to_vec(), vec![0.0; 7]].concat() };
    let target = Vec3::new(0.3, 0.3, 0.5);
    let end = vec![
        Cost::new("rest", 0.5, rest, Activation::Quadratic),
        Cost::new("reach", 20.0, Residual::FrameTranslation { frame: "tool".into(), target }, Activation::Quadratic),
    ];
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let running = [end.clone(), vec![Cost::new("effort", 1e-3, effort, Activation::Quadratic)]].concat();
    let knot = FreeDynamics::running(model.clone(), 0.05, running).unwrap();
    let end = FreeDynamics::terminal(model, end).unwrap();
    let x0 = [ARM.to_vec(), vec![0.0; 7]].concat();
    Problem::new(x0, vec![Box::new(knot)], vec![0; 12], Box::new(end)).unwrap()
}

/// Checks inertial parameters, gravity and armature of an arm.
#[test]
fn the_numbers_of_an_arm() {
    let solve = |problem: &mut Problem, near: &Solution| solve_tightly(problem, &near.xs, &near.us, true);
    let mut problem = reach(&[0.0; 20]);
    let first = first_solution(&mut problem);
    let solution = solve(&mut problem, &first);
    let loss = Loss::new(&problem, &solution);
    // the entries of an inertia are about 0.01, and the differences of solutions need small changes of them
    let scales: Vec<f64> = (0..20).map(|k| [0.2, 1.0][usize::from(!(4..10).contains(&k))]).collect();
    let numeric = Family { build: &reach, solve: &solve, scales: &scales }.differences(&solution, &loss);
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default()).unwrap();
    let link = robots::arm7().bodies()[LINK].name.clone();
    for (name, range) in [(format!("inertia/{link}"), 0..10), ("gravity".into(), 10..13), ("armature".into(), 13..20)] {
        let jacobian = sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap();
        check(&mut sensitivity, &jacobian, &loss, &numeric[range], &name);
    }
}

/// Checks that bounds on controls as parameters equal the derivatives with respect to the active bounds.
#[test]
fn bounds_of_an_arm() {
    let mut problem = arm(&[0.0; 20]);
    let first = first_solution(&mut problem);
    let solution = solve_tightly(&mut problem, &first.xs, &first.us, true);
    let loss = Loss::new(&problem, &solution);
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, None, SensitivitySettings::default()).unwrap();
    assert!(sensitivity.report().active_controls >= 3);
    let sides = [Parameter::LowerBounds, Parameter::UpperBounds];
    let jacobians = sides.map(|side| sensitivity.jacobian(&mut problem, &side).unwrap());
    let own = sensitivity.jacobian_of(&problem, 20, 1e-5, |p| Ok(arm(p))).unwrap();
    let adjoint = sensitivity.adjoint(&loss.by_states, &loss.by_controls).unwrap();
    let [lower, upper] = [0, 1].map(|k| adjoint.gradient(&jacobians[k]));
    for i in 0..7 {
        let of_side = |upper: bool| -> f64 {
            let at = |t: usize| (solution.u(t)[i], adjoint.control_bounds[7 * t + i]);
            (0..15).map(at).filter(|(u, _)| (*u > 0.0) == upper).map(|(_, by_bound)| by_bound).sum()
        };
        assert!((lower[i] - of_side(false)).abs() + (upper[i] - of_side(true)).abs() < 1e-8, "{lower:?} {upper:?}");
    }
    let by_all = adjoint.gradient(&own)[19]; // all bounds become wider
    let sum = upper.iter().sum::<f64>() - lower.iter().sum::<f64>();
    assert!((sum - by_all).abs() < 1e-8 * by_all.abs(), "{sum} {by_all}");
}

/// Creates the problem of a quadruped that leans to the side, with friction cones at two feet. The parameters are
/// changes of the inertial parameters of its trunk (10), and of the coefficient of friction.
fn lean(p: &[f64]) -> Problem {
    let model = Arc::new(changed(robots::quadruped(), 1, &p[..10], &[0.0; 3], &[0.0; 18]));
    let limit = |foot: &str| {
        let cone = FrictionCone::new(0.35 + p[10]);
        let (lower, upper) = cone.bounds();
        Limit::new("grip", Residual::FrictionCone { contact: foot.into(), cone }, lower, upper)
    };
    quadruped_with(model, &[0.0; 9], vec![limit("LF_foot")])
}

/// Checks the inertia of the trunk and the friction of a quadruped in contact, whose friction is used up.
#[test]
fn the_numbers_of_a_quadruped() {
    let tight = |problem: &Problem| {
        let mut solver = AugmentedLagrangian::new(problem);
        let settings = ConstraintSettings::default();
        solver.settings = ConstraintSettings { tolerance: 1e-10, tolerance_dual: 1e-10, max_solves: 200, ..settings };
        (solver.inner.tolerance, solver.inner.max_iterations) = (TIGHT, 500);
        solver
    };
    let mut problem = lean(&[0.0; 11]);
    let xs = problem.x0().repeat(9);
    let us = problem.quasi_static(&xs).unwrap();
    let mut solver = tight(&problem);
    let solution = solver.solve(&mut problem, &xs, &us).unwrap().clone();
    let outcome = solver.outcome().clone();
    assert_eq!(solution.status, Status::Converged, "{:e} {:e}", outcome.primal, outcome.dual);
    let solve = |problem: &mut Problem, _: &Solution| {
        let solution = solver.clone().resume(problem).unwrap().clone(); // from the multipliers of the solution
        assert_eq!(solution.status, Status::Converged);
        solution
    };
    let loss = Loss::new(&problem, &solution);
    let scales: Vec<f64> =
        (0..11).map(|k| [300.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0, 10.0][k]).collect();
    let numeric = Family { build: &lean, solve: &solve, scales: &scales }.differences(&solution, &loss);
    let settings = SensitivitySettings::default();
    let mut sensitivity = Sensitivity::new(&mut problem, &solution, Some(&outcome), settings).unwrap();
    println!("{:?}", sensitivity.report());
    assert!(sensitivity.report().active_rows > 0 && sensitivity.report().strict_complementarity);
    let trunk = robots::quadruped().bodies()[1].name.clone();
    for (name, range) in [(format!("inertia/{trunk}"), 0..10), ("friction/grip".into(), 10..11)] {
        let jacobian = sensitivity.jacobian(&mut problem, &name.parse().unwrap()).unwrap();
        check(&mut sensitivity, &jacobian, &loss, &numeric[range], &name);
    }
}

/// Checks that a parameter that is set gives the problem that is built with it, and that a reader gets it back.
#[test]
fn numbers_are_set_without_building() {
    let p: Vec<f64> = (0..20).map(|k| if k < 10 { 1e-5 } else { 1e-3 } * f64::from(k + 1)).collect();
    let (mut built, mut problem) = (reach(&p), reach(&[0.0; 20]));
    let all = built.parameters().unwrap();
    let names: Vec<String> = all.iter().map(|(parameter, _)| parameter.to_string()).collect();
    assert_eq!(names[0], "x0");
    let expected = ["weight/reach", "target/reach", "duration", "gravity", "armature"];
    assert!(expected.iter().all(|name| names.iter().any(|own| own == name)), "{names:?}");
    for (parameter, size) in &all {
        assert_eq!(built.parameter(parameter).unwrap().len(), *size, "{parameter}");
    }
    let parameters: Vec<Parameter> = all.into_iter().map(|(parameter, _)| parameter).collect();
    let text = serde_json::to_string(&built.parameter_values(&parameters).unwrap()).unwrap();
    let values: ParameterValues = serde_json::from_str(&text).unwrap();
    assert_eq!(values, built.parameter_values(&parameters).unwrap());
    problem.set_parameter_values(&values).unwrap();
    assert_eq!(problem.parameter_values(&parameters).unwrap(), values);

    let xs = problem.x0().repeat(13);
    let us = vec![0.3; 84];
    let mut evaluated = [&mut built, &mut problem].map(|problem| {
        let (mut next, mut costs) = (vec![0.0; 12 * 14], vec![0.0; 13]);
        problem.calc(&xs, &us, &mut next, &mut costs);
        next.extend(costs);
        next
    });
    let [ours, theirs] = &mut evaluated;
    assert!(error(ours, theirs) < 1e-12);

    // an inertia that no body has, bounds that leave no control, and a negative friction
    let link = Parameter::Inertia(robots::arm7().bodies()[LINK].name.clone());
    let before = problem.parameter(&link).unwrap();
    let mut wrong = before.clone();
    wrong[0] = -1.0;
    let fault = problem.set_parameter(&link, &wrong).unwrap_err().to_string();
    assert!(fault.starts_with(&format!("parameter `{link}`: ")), "{fault}");
    assert_eq!(problem.parameter(&link).unwrap(), before);
    let mut bounded = arm(&[0.0; 20]);
    let fault = bounded.set_parameter(&Parameter::LowerBounds, &[30.0; 7]).unwrap_err().to_string();
    assert_eq!(fault, "parameter `bounds/lower`: expected numbers with each lower bound at most the upper one");
    bounded.set_parameter(&Parameter::LowerBounds, &[f64::NEG_INFINITY; 7]).unwrap();
    let values = bounded.parameter_values(&[Parameter::LowerBounds]).unwrap();
    let text = serde_json::to_string(&values).unwrap();
    assert_eq!(text, r#"{"bounds/lower":[null,null,null,null,null,null,null]}"#);
    assert_eq!(serde_json::from_str::<ParameterValues>(&text).unwrap(), values);
    let mut leaning = lean(&[0.0; 11]);
    let friction: Parameter = "friction/grip".parse().unwrap();
    assert_eq!(leaning.parameter(&friction).unwrap(), [0.35]);
    let fault = leaning.set_parameter(&friction, &[-0.1]).unwrap_err().to_string();
    assert_eq!(fault, "parameter `friction/grip`: expected a finite coefficient of at least 0, found -0.1");
    let none = leaning.parameter(&"inertia/nobody".parse().unwrap()).unwrap_err().to_string();
    assert_eq!(none, "sensitivity: the problem does not have the parameter `inertia/nobody`");
}
