//! Robots without contacts and their costs: exact derivatives, references and limits.
#![allow(non_snake_case)] // names follow the literature

use condyle_dynamics::{
    Act, Data, FrameKind, Model, ModelBuilder, Se3, UrdfOptions, Vec3, WORLD, forward_kinematics, integrate, neutral,
    robots,
};
use condyle_optimal::robot::{
    Activation, Cost, Dynamics, FrameName, FreeDynamics, Knot, Limit, OwnResidual, Residual, ResidualFunction,
};
use condyle_optimal::{ActionModel, Error, Fddp, Hessian, LqKnot, NumDiff, Problem, Sweep};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Tolerance of central differences, which are accurate to about 1e-9 for a function with values and derivatives of
/// order one.
const DIFFERENCES: f64 = 1e-6;
/// Tolerance of two results of a factorisation whose sums were added in different orders.
const SAME: f64 = 1e-9;
const DT: f64 = 0.02;

fn random(n: usize, scale: f64, rng: &mut StdRng) -> Vec<f64> {
    (0..n).map(|_| scale * (2.0 * rng.random::<f64>() - 1.0)).collect()
}

/// Returns a random state near the neutral state, where no joint is near a singularity.
fn random_state(model: &Model, rng: &mut StdRng) -> Vec<f64> {
    let mut q = neutral(model);
    integrate(model, &neutral(model), &random(model.nv(), 0.5, rng), &mut q);
    [q, random(model.nv(), 1.0, rng)].concat()
}

/// Returns the index and the name of the last frame.
fn last_frame(model: &Model) -> (usize, FrameName) {
    let frames = model.frames();
    (frames.len() - 1, (&frames[frames.len() - 1]).into())
}

/// Returns a cost for every pair of a residual and an activation that fits it.
fn all_costs(model: &Model, nu: usize, rng: &mut StdRng) -> Vec<Cost> {
    let nv = model.nv();
    let (number, frame) = last_frame(model);
    let mut data = Data::new(model);
    let x = random_state(model, rng);
    let target = forward_kinematics(model, &mut data, &x[..model.nq()]).frame(number);
    let reference = random_state(model, rng);
    let barrier = |n: usize| Activation::Barrier { lower: vec![-0.1; n], upper: vec![0.2; n] };
    vec![
        Cost::new("state", 0.3, Residual::State { reference: reference.clone() }, Activation::Quadratic),
        Cost::new(
            "posture",
            0.2,
            Residual::State { reference: reference.clone() },
            Activation::Weighted(random(2 * nv, 1.0, rng).iter().map(|w| w.abs()).collect()),
        ),
        Cost::new("limits", 2.0, Residual::State { reference }, barrier(2 * nv)),
        Cost::new("effort", 0.1, Residual::Control { reference: random(nu, 1.0, rng) }, Activation::Quadratic),
        Cost::new("effort limits", 0.7, Residual::Control { reference: vec![0.0; nu] }, barrier(nu)),
        Cost::new(
            "effort barrier",
            0.6,
            Residual::Control { reference: vec![0.0; nu] },
            Activation::RelaxedBarrier { lower: vec![-3.0; nu], upper: vec![4.0; nu], mu: 0.8, delta: 0.5 },
        ),
        Cost::new("pose", 1.5, Residual::FramePlacement { frame: frame.clone(), target }, Activation::Quadratic),
        Cost::new(
            "place",
            0.9,
            Residual::FrameTranslation { frame, target: target.translation },
            Activation::Weighted(vec![1.0, 2.0, 3.0]),
        ),
    ]
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let scale = 1.0 + b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale
}

#[test]
fn derivatives_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(3);
    for model in [robots::arm7(), robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let nu = model.nv() - if model.nq() == model.nv() { 0 } else { 6 };
        let costs = all_costs(&model, nu, &mut rng);
        let mut action = FreeDynamics::running(model.clone(), DT, costs).unwrap();
        let mut oracle = NumDiff(action.clone());
        let ndx = action.ndx();
        let (mut exact, mut numeric) = (LqKnot::zeros(ndx, nu), LqKnot::zeros(ndx, nu));
        for _ in 0..5 {
            let (x, u) = (random_state(&model, &mut rng), random(nu, 5.0, &mut rng));
            action.calc_diff(0, &x, &u, &mut exact);
            oracle.calc_diff(0, &x, &u, &mut numeric);
            for (name, a, b) in [
                ("A", exact.A.as_slice(), numeric.A.as_slice()),
                ("B", exact.B.as_slice(), numeric.B.as_slice()),
                ("q", exact.q.as_slice(), numeric.q.as_slice()),
                ("r", exact.r.as_slice(), numeric.r.as_slice()),
            ] {
                let error = largest_difference(a, b);
                assert!(error < DIFFERENCES, "{}: {name} is off by {error:e}", model.name());
            }
        }
    }
}

/// Checks the structure of A and B that an action reports: a sweep that ignores the structure gives the same result.
#[test]
fn derivatives_have_the_form_of_euler_steps() {
    let mut rng = StdRng::seed_from_u64(8);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let nu = model.nv() - 6;
        let costs = all_costs(&model, nu, &mut rng).into_iter().filter(|c| c.weight > 0.0).collect();
        let mut action = FreeDynamics::running(model.clone(), DT, costs).unwrap();
        let ndx = action.ndx();
        let mut lq_knots = vec![LqKnot::zeros(ndx, nu); 3];
        lq_knots.push(LqKnot::zeros(ndx, 0));
        lq_knots[3].Q.fill_with_identity();
        for knot in &mut lq_knots[..3] {
            let (x, u) = (random_state(&model, &mut rng), random(nu, 5.0, &mut rng));
            action.calc_diff(0, &x, &u, knot);
            knot.R.fill_diagonal(1.0);
            knot.Q += nalgebra::DMatrix::identity(ndx, ndx);
        }
        let mut sweep = Sweep::new(&lq_knots);
        sweep.run(&lq_knots, 1e-6).unwrap();
        let structured = sweep.feedback().to_vec();
        assert!(lq_knots[0].structure != condyle_optimal::DynamicsStructure::default());
        for knot in &mut lq_knots {
            knot.structure.set_dense();
        }
        sweep.run(&lq_knots, 1e-6).unwrap();
        for (a, b) in structured.iter().zip(sweep.feedback()) {
            for (name, a, b) in [("K", a.K.as_slice(), b.K.as_slice()), ("Vxx", a.Vxx.as_slice(), b.Vxx.as_slice())] {
                let error = largest_difference(a, b);
                assert!(error < SAME, "{}: {name} is off by {error:e}", model.name());
            }
        }
    }
}

/// Checks that the Gauss–Newton Hessian is exact for a residual that is linear in x and u.
#[test]
fn hessians_of_linear_residuals_are_exact() {
    let mut rng = StdRng::seed_from_u64(4);
    let model = Arc::new(robots::arm7());
    let mut costs = all_costs(&model, 7, &mut rng);
    costs.retain(|c| !matches!(c.residual, Residual::FramePlacement { .. } | Residual::FrameTranslation { .. }));
    let mut action = FreeDynamics::running(model.clone(), DT, costs).unwrap();
    let mut oracle = NumDiff(action.clone());
    let (mut exact, mut numeric) = (LqKnot::zeros(14, 7), LqKnot::zeros(14, 7));
    let (x, u) = (random_state(&model, &mut rng), random(7, 1.0, &mut rng));
    action.calc_diff(0, &x, &u, &mut exact);
    oracle.calc_diff(0, &x, &u, &mut numeric);
    assert!(largest_difference(exact.Q.as_slice(), numeric.Q.as_slice()) < DIFFERENCES);
    assert!(largest_difference(exact.R.as_slice(), numeric.R.as_slice()) < DIFFERENCES);
}

#[test]
fn a_cost_is_zero_at_its_reference() {
    let mut rng = StdRng::seed_from_u64(5);
    let model = Arc::new(robots::humanoid());
    let mut data = Data::new(&model);
    let x = random_state(&model, &mut rng);
    let (number, frame) = last_frame(&model);
    let target: Se3<f64> = forward_kinematics(&model, &mut data, &x[..model.nq()]).frame(number);
    let terms = vec![
        Cost::new("state", 1.0, Residual::State { reference: x.clone() }, Activation::Quadratic),
        Cost::new("pose", 1.0, Residual::FramePlacement { frame: frame.clone(), target }, Activation::Quadratic),
        Cost::new(
            "place",
            1.0,
            Residual::FrameTranslation { frame, target: target.act(Vec3::zero()) },
            Activation::Quadratic,
        ),
    ];
    let mut action = FreeDynamics::terminal(model.clone(), terms).unwrap();
    let mut next = x.clone();
    assert!(action.calc(0, &x, &[], &mut next) < 1e-28);
    assert_eq!(action.costs_mut().set_weight("pose", 3.0), Ok(true));
    assert_eq!(action.costs_mut().set_weight("rose", 3.0), Ok(false));
}

/// Checks that a residual stores the name of its frame, and that the action of each robot looks up the index of this
/// frame.
#[test]
fn frames_travel_by_name() {
    let arm = robots::arm7();
    let mut builder = ModelBuilder::new("two arms");
    builder.append(WORLD, Se3::identity(), &arm, "left_");
    builder.append(WORLD, Se3 { translation: Vec3::new(1.0, 0.0, 0.0), ..Se3::identity() }, &arm, "");
    let two = Arc::new(builder.build().unwrap());
    let (mut data, q) = (Data::new(&two), neutral(&two));
    let target = forward_kinematics(&two, &mut data, &q).frame(two.frame("tool").unwrap()).translation;
    assert_ne!(two.frame("tool"), arm.frame("tool"));
    let x = [q, vec![0.0; 14]].concat();
    for frame in [FrameName::from("tool"), (&arm.frames()[arm.frame("tool").unwrap()]).into()] {
        let reach = Cost::new("reach", 1.0, Residual::FrameTranslation { frame, target }, Activation::Quadratic);
        let mut action = FreeDynamics::terminal(two.clone(), vec![reach.clone()]).unwrap();
        assert_eq!(action.calc(0, &x, &[], &mut x.clone()), 0.0);
        // every function returns an error for another robot, which does not have the frame
        let quadruped = Arc::new(robots::quadruped());
        let unknown = |error: Error| assert!(error.to_string().contains("`reach`: unknown frame `tool`"), "{error}");
        unknown(FreeDynamics::terminal(quadruped.clone(), vec![reach.clone()]).map(|_| ()).unwrap_err());
        let mut end = FreeDynamics::terminal(quadruped.clone(), vec![]).unwrap();
        unknown(end.set_costs(1, vec![reach.clone()]).unwrap_err());
        let limit = Limit::equality("reach", reach.residual.clone());
        unknown(end.with_limits(vec![limit]).map(|_| ()).unwrap_err());
        // a file with this cost can be read, but building the knot fails for a robot without the frame
        let knot = serde_json::to_string(&Knot::new(Dynamics::Terminal, vec![reach.clone()])).unwrap();
        let read: Knot = serde_json::from_str(&knot).unwrap();
        assert_eq!(read.costs, [reach]);
        assert!(read.build(&two).is_ok());
        unknown(read.build(&quadruped).map(|_| ()).unwrap_err());
    }
    // among frames with the same name, the frame of the requested kind is chosen; without a request, the frame of a
    // link
    let text = r#"<robot name="twice"><link name="base"/><link name="tip"/><joint name="tip" type="continuous">
        <parent link="base"/><child link="tip"/><axis xyz="0 0 1"/></joint></robot>"#;
    let twice = Model::from_urdf_str(text, &UrdfOptions::default()).unwrap();
    let named = |kind| FrameName { name: "tip".to_owned(), kind }.number(&twice).unwrap();
    assert_eq!(twice.frames()[named(Some(FrameKind::Joint))].kind, FrameKind::Joint);
    assert_eq!(named(None), twice.frame("tip").unwrap());
    assert_ne!(named(None), named(Some(FrameKind::Joint)));
    assert_eq!(named(Some(FrameKind::User)), named(None)); // no frame of this kind exists
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let arm = Arc::new(robots::arm7());
    let cost = |residual, activation| {
        FreeDynamics::running(arm.clone(), DT, vec![Cost::new("reach", 1.0, residual, activation)])
    };
    let message = |r: Result<FreeDynamics, Error>| r.map(|_| ()).unwrap_err().to_string();
    let control = |n| Residual::Control { reference: vec![0.0; n] };
    assert_eq!(
        message(cost(control(6), Activation::Quadratic)),
        "cost `reach`: its reference has 6 numbers, expected 7"
    );
    assert_eq!(
        message(cost(control(7), Activation::Weighted(vec![1.0]))),
        "cost `reach`: its weighting has 1 numbers, expected 7"
    );
    let far = Residual::FrameTranslation { frame: "tol".into(), target: Vec3::zero() };
    assert_eq!(message(cost(far, Activation::Quadratic)), "cost `reach`: unknown frame `tol`; nearest is `tool`");
    let nowhere = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(f64::NAN, 0.0, 0.0) };
    assert_eq!(message(cost(nowhere, Activation::Quadratic)), "cost `reach`: its target holds a NaN");
    assert_eq!(message(FreeDynamics::running(arm.clone(), 0.0, vec![])), "a knot of 0 s: its duration must be above 0");
}

/// User-defined residual r = (v₁ u₁, sin q₂ + u₂² + t), for a robot whose position has `nq` entries.
struct OwnFunction {
    nq: usize,
    nv: usize,
    /// Indices of the coordinates and controls that the residual reads.
    place: [usize; 2],
}

impl ResidualFunction for OwnFunction {
    fn size(&self) -> usize {
        2
    }

    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]) {
        let [c, k] = self.place;
        r[0] = x[self.nq + c] * u[k];
        r[1] = x[self.nq - self.nv + c].sin() + u[k + 1] * u[k + 1] + t as f64;
    }

    fn calc_diff(&self, _: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]) {
        let ([c, k], nu) = (self.place, u.len());
        by_x[self.nv + c] = u[k];
        by_u[k] = x[self.nq + c];
        by_x[2 * self.nv + c] = x[self.nq - self.nv + c].cos();
        by_u[nu + k + 1] = 2.0 * u[k + 1];
    }
}

/// User-defined cost ℓ = 1 − cos q₁ + ½ q₂ u₁² + u₁ v₃ of the arm.
struct OwnCost {
    hessian: bool,
}

impl ResidualFunction for OwnCost {
    fn size(&self) -> usize {
        1
    }

    fn calc(&self, _: usize, x: &[f64], u: &[f64], r: &mut [f64]) {
        r[0] = 1.0 - x[0].cos() + 0.5 * x[1] * u[0] * u[0] + u[0] * x[9];
    }

    fn calc_diff(&self, _: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]) {
        (by_x[0], by_x[1], by_x[9]) = (x[0].sin(), 0.5 * u[0] * u[0], u[0]);
        by_u[0] = x[1] * u[0] + x[9];
    }

    fn has_hessian(&self) -> bool {
        self.hessian
    }

    fn calc_hessian(
        &self,
        t: usize,
        x: &[f64],
        u: &[f64],
        d: &[f64],
        [by_x, by_u]: [&mut [f64]; 2],
        hessian: &mut Hessian,
    ) {
        self.calc_diff(t, x, u, by_x, by_u);
        hessian.xx[(0, 0)] = d[0] * x[0].cos();
        hessian.xu[(1, 0)] = d[0] * u[0];
        hessian.xu[(9, 0)] = d[0];
        hessian.uu[(0, 0)] = d[0] * x[1];
    }
}

/// Checks the gradient and Hessian of a user-defined cost in a knot, multiplied by Δt and the weight. With the
/// activation ½ r² instead of the sum, the knot contains the exact Hessian of ½ r².
#[test]
fn a_cost_of_ones_own_has_its_hessian() {
    let (arm, mut rng) = (Arc::new(robots::arm7()), StdRng::seed_from_u64(31));
    let (x, u) = (random(14, 1.0, &mut rng), random(7, 1.0, &mut rng));
    for activation in [Activation::Sum, Activation::Quadratic] {
        let knot = |hessian: bool| {
            let own = Residual::Own(OwnResidual::new(OwnCost { hessian }));
            let costs = vec![
                Cost::new("own", 0.7, own.clone(), activation.clone()),
                Cost::new("same", 0.3, own, activation.clone()),
                Cost::new("rest", 1.0, Residual::State { reference: vec![0.0; 14] }, Activation::Quadratic),
                Cost::new("effort", 1.0, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
            ];
            let mut action = FreeDynamics::running(arm.clone(), DT, costs).unwrap();
            let (mut knot, mut numeric) = (LqKnot::zeros(14, 7), LqKnot::zeros(14, 7));
            action.calc_diff(0, &x, &u, &mut knot);
            NumDiff(action).calc_diff(0, &x, &u, &mut numeric);
            assert!((&knot.q - &numeric.q).amax() < DIFFERENCES && (&knot.r - &numeric.r).amax() < DIFFERENCES);
            knot
        };
        let (own, gauss_newton) = (knot(true), knot(false));
        let mut r = [0.0];
        OwnCost { hessian: true }.calc(0, &x, &u, &mut r);
        let (mut expected, slope) = (gauss_newton.clone(), if activation == Activation::Sum { DT } else { DT * r[0] });
        expected.Q[(0, 0)] += slope * x[0].cos();
        expected.S[(1, 0)] += slope * u[0];
        expected.S[(9, 0)] += slope;
        expected.R[(0, 0)] += slope * x[1];
        for (name, a, b) in [("Q", &own.Q, &expected.Q), ("S", &own.S, &expected.S), ("R", &own.R, &expected.R)] {
            assert!(largest_difference(a.as_slice(), b.as_slice()) < 1e-14, "{name} of {activation:?}");
        }
    }
}

/// Checks that iterates do not depend on the form of the knots, and that the optimum is the same with an exact and an
/// approximate Hessian.
#[test]
fn a_cost_of_ones_own_in_a_solve() {
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let solve = |hessian: bool, form: bool| {
        let own = Residual::Own(OwnResidual::new(OwnCost { hessian }));
        let costs = vec![
            Cost::new("own", 1e-2, own, Activation::Sum),
            Cost::new("rest", 1.0, Residual::State { reference: vec![0.1; 14] }, Activation::Quadratic),
            Cost::new("effort", 1e-1, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic),
        ];
        let knot = FreeDynamics::running(arm.clone(), DT, costs).unwrap();
        let end = Box::new(FreeDynamics::terminal(arm.clone(), vec![]).unwrap());
        let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 10], end).unwrap();
        let us = problem.quasi_static(&x0.repeat(11)).unwrap();
        let mut solver = Fddp::new(&problem);
        solver.settings.inverse_dynamics_form = form;
        solver.solve(&mut problem, &x0.repeat(11), &us).unwrap().clone()
    };
    let [with, without, gauss_newton] = [solve(true, true), solve(true, false), solve(false, true)];
    assert_eq!(with.trace.len(), without.trace.len());
    assert!((with.cost - without.cost).abs() < 1e-10 * (1.0 + with.cost.abs()));
    assert!((with.cost - gauss_newton.cost).abs() < 1e-7 * (1.0 + with.cost.abs()), "one optimum");
}

/// Checks that the derivatives of a user-defined residual equal differences, and that the solver's iterates do not
/// depend on the form of the knots.
#[test]
fn a_residual_of_ones_own_is_one_among_others() {
    use condyle_dynamics::ContactConstraint;
    use condyle_optimal::robot::{Contact, ContactDynamics};
    let model = Arc::new(robots::quadruped());
    let (nq, nv) = (model.nq(), model.nv());
    let mut q = condyle_dynamics::neutral(&model);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4));
    let x0 = [q, vec![0.0; nv]].concat();
    let own = OwnResidual::new(OwnFunction { nq, nv, place: [8, 2] });
    let costs = vec![
        Cost::new("state", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic),
        Cost::new("own", 0.3, Residual::Own(own.clone()), Activation::Smooth1 { epsilon: 0.5 }),
        Cost::new("effort", 1e-2, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic),
    ];
    let foot = |name: &str| Contact::new(name, ContactConstraint::point(model.frame(name).unwrap()));
    let contacts = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(foot);
    let knot = ContactDynamics::running(model.clone(), &contacts, 0.02, costs).unwrap();
    let end = || Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap());
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot.clone())], vec![0; 9], end()).unwrap();
    let xs = x0.repeat(10);
    let us = problem.quasi_static(&xs).unwrap();
    let mut by_differences = knot.clone();
    let (mut ours, mut theirs) = (LqKnot::zeros(36, 12), LqKnot::zeros(36, 12));
    by_differences.calc_diff(3, &x0, &us[..12], &mut ours);
    NumDiff(by_differences).calc_diff(3, &x0, &us[..12], &mut theirs);
    assert!((&ours.q - &theirs.q).amax() < 1e-6 * (1.0 + theirs.q.amax()));
    assert!((&ours.r - &theirs.r).amax() < 1e-6 * (1.0 + theirs.r.amax()));
    let mut solve = |inverse_dynamics_form: bool| {
        let mut solver = Fddp::new(&problem);
        (solver.settings.inverse_dynamics_form, solver.settings.max_iterations) = (inverse_dynamics_form, 6);
        solver.solve(&mut problem, &xs, &us).unwrap().clone()
    };
    let (one, other) = (solve(true), solve(false));
    assert!(one.trace.len() > 2 && one.trace[0].accepted);
    for (a, b) in one.trace.iter().zip(&other.trace) {
        assert!((a.cost - b.cost).abs() < 1e-8 * b.cost.abs() && a.step == b.step, "{a:?} {b:?}");
    }
    assert!(serde_json::to_string(&Residual::Own(own)).is_err());
}
