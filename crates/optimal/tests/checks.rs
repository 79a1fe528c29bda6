//! Each function reports invalid arguments with their names and the invalid numbers. Invalid arguments never cause a
//! NaN, a wrong result or a later abort.

use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Error as ModelError, Force, Mat3, Motion, Se3, Vec3, neutral, robots,
};
use condyle_optimal::robot::{
    Activation, Contact, ContactDynamics, Cost, Dynamics, FreeDynamics, FrictionCone, Integrator, Knot, Limit,
    Residual, RobotProblem, WrenchCone,
};
use condyle_optimal::{ActionModel, AugmentedLagrangian, ConstraintSettings, Error, Fddp, Problem, Settings};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;

const NAN: f64 = f64::NAN;

fn half_turned() -> Mat3<f64> {
    Mat3 { x: Vec3::new(0.5, 0.0, 0.0), ..Mat3::identity() }
}

/// Returns the error text for an invalid cost term of a standing quadruped.
fn said(residual: Residual, activation: Activation) -> String {
    let quadruped = Arc::new(robots::quadruped());
    let foot = Contact::new("foot", ContactConstraint::rigid(quadruped.frame("LF_foot").unwrap()));
    let cost = vec![Cost::new("c", 1.0, residual, activation)];
    ContactDynamics::running(quadruped, &[foot], 0.01, cost).map(|_| ()).unwrap_err().to_string()
}

#[test]
fn rotations_that_are_none_are_refused() {
    let turned = || Se3 { rotation: half_turned(), ..Se3::identity() };
    let plain = Activation::Quadratic;
    let none = "is no rotation: expected three unit vectors at right angles";
    let pose = Residual::FramePlacement { frame: "LF_foot".into(), target: turned() };
    assert_eq!(said(pose, plain.clone()), format!("cost `c`: its target {none}"));
    let axes = Residual::FrameRotation { frame: "LF_foot".into(), target: half_turned() };
    assert_eq!(said(axes, plain.clone()), format!("cost `c`: its target {none}"));
    let pressure = Residual::CenterOfPressure { contact: "foot".to_owned(), rotation: half_turned(), size: [0.1, 0.1] };
    assert_eq!(said(pressure, plain.clone()), format!("cost `c`: its rotation {none}"));
    let cone = FrictionCone { rotation: half_turned(), ..FrictionCone::new(0.5) };
    let grip = Residual::FrictionCone { contact: "foot".to_owned(), cone };
    assert!(said(grip, plain.clone()).starts_with("cost `c`: its cone's rotation is none"));
    // a reference state must be a valid state
    let mut reference = [neutral(&robots::quadruped()), vec![0.0; 18]].concat();
    reference[6] = 0.5;
    let message = "cost `c`: its reference: joint `root_joint`: its rotation, q[3..7], has the length 0.5, expected 1";
    assert_eq!(said(Residual::State { reference }, plain), message);
    // the target force of a contact must be valid, when the residual is created and when the target is changed
    let quadruped = robots::quadruped();
    let foot = ContactConstraint::point(quadruped.frame("LF_foot").unwrap());
    let bad = |change: fn(&mut ContactConstraint)| {
        let mut contact = foot;
        change(&mut contact);
        let mut set = ConstraintSet::<f64>::new(&quadruped, &[foot]).unwrap();
        let changed = set.set_target(0, contact.target).unwrap_err();
        assert_eq!(set.target(0), foot.target); // the previous target is kept
        let planned = ConstraintSet::<f64>::new(&quadruped, &[contact]).map(|_| ()).unwrap_err();
        assert_eq!(planned, changed);
        let ModelError::Constraint { constraint: 0, what } = planned else { panic!("{planned}") };
        what
    };
    assert_eq!(
        bad(|c| c.target.placement.rotation = half_turned()),
        "its target's placement is no rotation and translation"
    );
    assert_eq!(bad(|c| c.target.placement.translation.x = NAN), "its target is not finite");
    assert_eq!(bad(|c| c.target.velocity = Motion::from([0.0, NAN, 0.0, 0.0, 0.0, 0.0])), "its target is not finite");
    assert_eq!(bad(|c| c.target.acceleration.angular.z = f64::INFINITY), "its target is not finite");
}

#[test]
fn weights_bounds_and_cones_are_checked() {
    let effort = || Residual::Control { reference: vec![0.0; 12] };
    let weights = |k: usize, w: f64| (0..12).map(|i| if i == k { w } else { 1.0 }).collect::<Vec<_>>();
    let at_least = "expected a finite number of at least 0";
    for (w, name) in [(-1.0, "-1"), (NAN, "NaN"), (f64::INFINITY, "inf")] {
        let expected = format!("cost `c`: its weight 3 is {name}, {at_least}");
        assert_eq!(said(effort(), Activation::Weighted(weights(3, w))), expected);
        let (lower, upper) = (vec![-1.0; 12], vec![1.0; 12]);
        assert_eq!(said(effort(), Activation::WeightedBarrier { lower, upper, weights: weights(3, w) }), expected);
    }
    let barrier = Activation::Barrier { lower: weights(2, f64::INFINITY), upper: vec![f64::INFINITY; 12] };
    assert_eq!(said(effort(), barrier), "cost `c`: its bounds of entry 2 exclude each other: inf and inf");
    let grip = |cone: FrictionCone| {
        let error = cone.check().unwrap_err().to_string();
        let told = said(Residual::FrictionCone { contact: "foot".to_owned(), cone }, Activation::Quadratic);
        assert_eq!(told.strip_prefix("cost `c`: ").unwrap(), error.strip_prefix("cone: ").unwrap());
        error
    };
    let plain = || FrictionCone::new(0.5);
    for (mu, name) in [(-0.1, "-0.1"), (NAN, "NaN")] {
        let message = format!("cone: its friction is {name}, but it must be at least 0");
        assert_eq!(grip(FrictionCone { mu, ..plain() }), message);
    }
    for facets in [0, 2, 5, 1002, 1_000_000_000] {
        let message = format!("cone: its cone has {facets} sides, but they must be even, at least 4 and at most 1000");
        assert_eq!(grip(FrictionCone { facets, ..plain() }), message);
    }
    let message = "cone: its cone's normal force must be at least 2 and at most 1";
    assert_eq!(grip(FrictionCone { least: 2.0, greatest: 1.0, ..plain() }), message);
    assert!(grip(FrictionCone { least: NAN, ..plain() }).contains("at least NaN"));
    let sole = WrenchCone { friction: plain(), size: [0.1, -0.1] };
    let message = "cone: its sides are 0.1 and -0.1 m, expected finite numbers of at least 0";
    assert_eq!(sole.check().unwrap_err().to_string(), message);
    assert_eq!(plain().check(), Ok(()));
    assert!(std::panic::catch_unwind(|| FrictionCone { facets: usize::MAX, ..plain() }.bounds()).is_err());
}

fn arm_problem() -> (Problem, Vec<f64>) {
    let quadruped = Arc::new(robots::quadruped());
    let x0 = [neutral(&quadruped), vec![0.0; 18]].concat();
    let rest = || vec![Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic)];
    let knot = FreeDynamics::running(quadruped.clone(), 0.01, rest()).unwrap();
    let end = FreeDynamics::terminal(quadruped.clone(), rest()).unwrap();
    (Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 3], Box::new(end)).unwrap(), x0)
}

#[test]
fn states_are_states() {
    let (mut problem, x0) = arm_problem();
    let mut bad = x0.clone();
    bad[3..7].copy_from_slice(&[1.0, 0.0, 0.0, 1.0]);
    let what = "joint `root_joint`: its rotation, q[3..7], has the length 1.4142135623730951, expected 1";
    assert_eq!(problem.set_x0(&bad).unwrap_err().to_string(), format!("`x0`, knot 0: {what}"));
    assert_eq!(problem.x0(), x0);
    let mut xs = x0.repeat(4);
    xs[2 * 37..3 * 37].copy_from_slice(&bad);
    let us = [0.0; 36];
    let error = Fddp::new(&problem).solve(&mut problem, &xs, &us).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), format!("`xs`, knot 2: {what}"));
    let error = AugmentedLagrangian::new(&problem).solve(&mut problem, &xs, &us).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), format!("`xs`, knot 2: {what}"));
    bad[3..7].fill(0.0);
    assert!(problem.set_x0(&bad).is_err());
    // a quaternion with 0.707 in place of √½ is accepted
    bad[3..7].copy_from_slice(&[0.707, 0.0, 0.0, 0.707]);
    assert_eq!(problem.set_x0(&bad), Ok(()));
}

#[test]
fn weights_that_make_no_sense_are_refused_between_solves() {
    let (mut problem, _) = arm_problem();
    let knot = problem.model_mut::<FreeDynamics>(0).unwrap();
    for bad in [NAN, f64::INFINITY, -1.0] {
        let message = format!("cost `rest`: its weight is {bad}, expected a finite number of at least 0");
        let wrong = Cost::new("rest", bad, Residual::ControlGravity, Activation::Quadratic);
        assert_eq!(knot.set_costs(1, vec![wrong]).unwrap_err().to_string(), format!("{message} (knot 1)"));
        assert_eq!(knot.set_weight("rest", bad).unwrap_err().to_string(), message);
        assert_eq!(knot.costs_mut().set_weight("rest", bad).unwrap_err().to_string(), message);
        assert_eq!(knot.costs_mut().terms()[0].weight, 1.0);
    }
    let target = Residual::CentroidalMomentum { target: Force::from([NAN; 6]) };
    let error = knot.costs_mut().set_residual("rest", target).unwrap_err();
    assert_eq!(error.to_string(), "cost `rest`: its target holds a NaN");
    assert_eq!((knot.set_weight("rest", 2.0), knot.set_weight("west", 2.0)), (Ok(true), Ok(false)));
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let (mut problem, x0) = arm_problem();
    let mut solver = Fddp::new(&problem);
    let mut refused = |settings: Settings| {
        solver.settings = settings;
        solver.solve(&mut problem, &x0.repeat(4), &[0.0; 36]).map(|_| ()).unwrap_err().to_string()
    };
    let plain = Settings::default;
    for (settings, name) in [
        (Settings { tolerance: -1.0, ..plain() }, "tolerance"),
        (Settings { tolerance_bounded: NAN, ..plain() }, "tolerance_bounded"),
        (Settings { regularisation_min: 1.0, regularisation_max: 0.1, ..plain() }, "regularisation_max"),
        (Settings { regularisation_start: NAN, ..plain() }, "regularisation_start"),
        (Settings { regularisation_decrease_above: NAN, ..plain() }, "regularisation_decrease_above"),
        (Settings { regularisation_increase_below: NAN, ..plain() }, "regularisation_increase_below"),
        (Settings { accept: NAN, ..plain() }, "accept"),
        (Settings { step_lengths: 0, ..plain() }, "step_lengths"),
        (Settings { segments: 0, ..plain() }, "segments"),
        (Settings { threads: 0, ..plain() }, "threads"),
    ] {
        let message = refused(settings);
        assert!(message.starts_with(&format!("setting `{name}` is ")), "{message}");
    }
    let mut solver = AugmentedLagrangian::new(&problem);
    solver.settings = ConstraintSettings { max_solves: 0, ..ConstraintSettings::default() };
    let error = solver.solve(&mut problem, &x0.repeat(4), &[0.0; 36]).map(|_| ()).unwrap_err();
    assert_eq!(error.to_string(), "setting `max_solves` is 0, but it must be at least 1");
}

/// Action that computes nothing, with any number of states and controls.
struct Huge {
    nx: usize,
    nu: usize,
}

impl ActionModel for Huge {
    fn nx(&self) -> usize {
        self.nx
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn calc(&mut self, _: usize, _: &[f64], _: &[f64], _: &mut [f64]) -> f64 {
        0.0
    }
}

#[test]
fn sizes_beyond_memory_are_refused_before_it_is_asked_for() {
    let problem = |nx: usize, nu: usize, knots: usize| {
        let (knot, end) = (Huge { nx, nu }, Huge { nx, nu: 0 });
        Problem::new(vec![0.0; nx.min(5000)], vec![Box::new(knot)], vec![0; knots], Box::new(end)).map(|_| ())
    };
    let error = |nx, nu, knots| problem(nx, nu, knots).unwrap_err().to_string();
    assert_eq!(error(1 << 40, 1, 1), "nx: 1099511627776 is more than the limit of 4096");
    assert_eq!(error(1, 1 << 40, 1), "nu: 1099511627776 is more than the limit of 4096");
    assert_eq!(error(1, 1, (1 << 20) + 1), "knots: 1048577 is more than the limit of 1048576");
    assert_eq!(
        error(4096, 4096, 9),
        "numbers in the matrices of all knots: 301989888 is more than the limit of 268435456"
    );
    assert_eq!(problem(4, 1, 100_000), Ok(()));
    assert_eq!(problem(0, 1, 3), Err(Error::EmptyState));
    let arm = Arc::new(robots::arm7());
    let mut knot = FreeDynamics::running(arm, 0.01, vec![]).unwrap();
    let far = Error::Size { name: "knot", found: 1_000_000_000, most: 1 << 20 };
    assert_eq!(knot.set_costs(1_000_000_000, vec![]), Err(far.clone()));
    assert_eq!(knot.set_limits(1_000_000_000, vec![]), Err(far));
}

/// Reads a problem from a file whose content `change` has modified.
fn file(change: impl FnOnce(&mut Value)) -> Result<(), String> {
    let arm = robots::arm7();
    let effort = Cost::new("effort", 1.0, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let step = Dynamics::Free { actuation: None, integrator: Integrator::SemiImplicitEuler, dt: 0.05 };
    let mut knot = Knot::new(step, vec![effort.clone()]);
    knot.costs_at = BTreeMap::from([(1, vec![effort])]);
    knot.limits = vec![Limit::equality("still", Residual::JointAcceleration { reference: vec![0.0; 7] })];
    let end = Knot::new(Dynamics::Terminal, vec![]);
    let data =
        RobotProblem { model: arm, x0: vec![0.1; 14], knots: vec![knot], knot_models: vec![0; 3], terminal: end };
    let mut json = serde_json::to_value(&data).unwrap();
    change(&mut json);
    let data: RobotProblem = serde_json::from_str(&json.to_string()).map_err(|error| error.to_string())?;
    data.build().map(|_| ()).map_err(|error| error.to_string())
}

#[test]
fn problem_files_are_checked_before_memory_is_asked_for() {
    assert_eq!(file(|_| ()), Ok(()));
    let refused = |change: fn(&mut Value)| file(change).unwrap_err();
    let message = refused(|json| json["knots"][0]["costs_at"] = json!({"1000000000": []}));
    assert_eq!(message, "knot: 1000000000 is more than the limit of 1048576");
    let message = refused(|json| json["knots"][0]["limits_at"] = json!({"18446744073709551615": []}));
    assert_eq!(message, "knot: 18446744073709551615 is more than the limit of 1048576");
    for (rows, columns) in [(7_u64, 1_u64 << 63), (8, 1 << 61), (u64::MAX, u64::MAX), (7, 2), (0, 1 << 40)] {
        let message = file(|json| json["knots"][0]["dynamics"]["free"]["actuation"] = json!([[], rows, columns]));
        let expected = format!("a matrix of {rows} × {columns} with 0 numbers, at most 4096 rows");
        assert!(message.clone().unwrap_err().starts_with(&expected), "{message:?}");
    }
    assert_eq!(
        refused(|json| json["knots"][0]["dynamics"]["free"]["dt"] = json!(0.0)),
        "a knot of 0 s: its duration must be above 0"
    );
    assert_eq!(
        refused(|json| json["knots"][0]["costs"][0]["weight"] = json!(-2.0)),
        "cost `effort`: its weight is -2, expected a finite number of at least 0"
    );
    assert!(refused(|json| json["knot_models"] = json!([0, 1])).contains("there is no action model 1"));
    assert!(refused(|json| json["x0"] = json!([0.0, 0.0, 0.0])).contains("expected length 14, found 3"));
    let cone = json!({"friction_cone": {"contact": "foot", "cone": {"rotation": Mat3::<f64>::identity(), "mu": 0.5,
        "facets": 1_000_000_000, "inner": false, "least": 0.0, "greatest": null}}});
    let quadruped = robots::quadruped();
    let foot = Contact::new("foot", ContactConstraint::point(quadruped.frame("LF_foot").unwrap()));
    let (integrator, dt) = (Integrator::SemiImplicitEuler, 0.01);
    let stance = Dynamics::Contact { contacts: vec![foot], damping: 0.0, actuation: None, integrator, dt };
    let mut json = serde_json::to_value(Knot::new(stance, vec![])).unwrap();
    json["costs"] = json!([{"name": "grip", "weight": 1.0, "residual": cone, "activation": "quadratic"}]);
    let knot: Knot = serde_json::from_value(json).unwrap();
    let message = knot.build(&Arc::new(quadruped)).map(|_| ()).unwrap_err().to_string();
    assert!(message.starts_with("cost `grip`: its cone has 1000000000 sides"), "{message}");
}
