//! Limits of a knot: the values of the terms that limits add to the cost, and the exact derivatives of these terms.

use super::{DIFFERENCES, DT, contact_costs, feet, largest_difference, random, random_state, rotation};
use condyle_dynamics::{Mat3, Model, ReferenceFrame, Se3, Vec3, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, ContactDynamics, Cost, FrameName, FreeAcceleration, FreeDynamics, FreeInverseDynamics,
    FrictionCone, ImpulseDynamics, Integrated, Integrator, Limit, Residual,
};
use condyle_optimal::{ActionModel, Error, GroupModel, LqKnot, Problem};
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Default penalty 1/μ, used until a constrained solver sets another penalty.
const PENALTY: f64 = 10.0;
/// Step of central differences. Their error is about the square of the step, plus the rounding error of the cost
/// divided by the step.
const STEP: f64 = 1e-5;
/// Tolerance of a sum of a few dozen squares.
const ROUNDING: f64 = 1e-12;

/// Returns the number of entries of a residual of `contact_costs`. The argument `rows` is the number of rows of the
/// residual's contact.
fn size(residual: &Residual, model: &Model, nu: usize, rows: usize) -> usize {
    match residual {
        Residual::State { .. } => 2 * model.nv(),
        Residual::Control { .. } => nu,
        Residual::ControlGravity | Residual::JointEffort { .. } | Residual::JointAcceleration { .. } => model.nv(),
        Residual::CentroidalMomentum { .. } | Residual::FramePlacement { .. } | Residual::FrameVelocity { .. } => 6,
        Residual::ContactForce { .. } => rows,
        Residual::FrictionCone { cone, .. } => cone.facets + 1,
        Residual::WrenchCone { cone, .. } => cone.friction.facets + 13,
        Residual::CenterOfPressure { .. } => 4,
        _ => 3,
    }
}

/// Returns a limit for each kind of residual. In each limit, some entries must be zero, some have bounds, and some are
/// free.
fn limits(model: &Model, nu: usize, rng: &mut StdRng) -> Vec<Limit> {
    let contacts = feet(model, ReferenceFrame::LocalWorldAligned);
    let rows = contacts[1].constraint.kind.rows();
    let foot = || FrameName::from(&*contacts[0].name);
    let place = Se3 { rotation: rotation(rng), translation: Vec3::new(0.1, 0.3, -0.2) };
    let mut residuals: Vec<_> = contact_costs(model, &contacts, nu, rng).into_iter().map(|c| c.residual).collect();
    residuals.push(Residual::FramePlacement { frame: foot(), target: place });
    residuals.push(Residual::FrameTranslation { frame: foot(), target: place.translation });
    residuals.push(Residual::ImpulseCenterOfMass);
    let limit = |(k, residual): (usize, Residual)| {
        let n = size(&residual, model, nu, rows);
        let (mut lower, mut upper) = (vec![0.0; n], vec![0.0; n]);
        for i in (0..n).filter(|i| i % 3 > 0) {
            (lower[i], upper[i]) = if i % 3 == 1 { (-0.1, 0.2) } else { (f64::NEG_INFINITY, -0.1) };
        }
        Limit::new(&format!("limit {k}"), residual, lower, upper)
    };
    residuals.into_iter().enumerate().map(limit).collect()
}

/// Compares the gradient of a knot's cost with central differences at a random state.
pub(super) fn check_gradient<A: ActionModel>(what: &str, mut action: A, model: &Model, effort: f64, rng: &mut StdRng) {
    let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
    let (x, u) = (random_state(model, rng), random(nu, effort, rng));
    let mut knot = LqKnot::zeros(ndx, nu);
    action.calc_diff(0, &x, &u, &mut knot);
    let (mut moved, mut next) = (vec![0.0; nx], vec![0.0; nx]);
    let mut numeric = vec![];
    for k in 0..ndx + nu {
        let costs = [STEP, -STEP].map(|step| {
            let (mut dx, mut u) = (vec![0.0; ndx], u.clone());
            if k < ndx {
                dx[k] = step
            } else {
                u[k - ndx] += step
            }
            action.integrate(&x, &dx, &mut moved);
            action.calc(0, &moved, &u, &mut next)
        });
        numeric.push((costs[0] - costs[1]) / (2.0 * STEP));
    }
    let exact: Vec<_> = knot.q.iter().chain(knot.r.iter()).copied().collect();
    let error = largest_difference(&exact, &numeric);
    assert!(error < DIFFERENCES, "{what}: off by {error:e}");
    for H in [&knot.Q, &knot.R] {
        assert!(largest_difference(H.as_slice(), H.transpose().as_slice()) < ROUNDING, "{what}: not symmetric");
    }
}

/// Checks the derivatives of an action with each limit that the action accepts, and with all these limits together.
/// Returns the number of accepted limits.
fn check<A: ActionModel>(
    what: &str,
    model: &Model,
    limits: &[Limit],
    make: impl Fn(Vec<Limit>) -> Result<A, Error>,
    effort: f64,
    rng: &mut StdRng,
) -> usize {
    let taken: Vec<_> = limits.iter().filter(|limit| make(vec![(*limit).clone()]).is_ok()).cloned().collect();
    for limit in &taken {
        let what = format!("{what} with {:?}", limit.residual);
        check_gradient(&what, make(vec![limit.clone()]).unwrap(), model, effort, rng);
    }
    check_gradient(what, make(taken.clone()).unwrap(), model, effort, rng);
    taken.len()
}

#[test]
fn derivatives_of_limits_are_those_of_the_terms() {
    let mut rng = StdRng::seed_from_u64(31);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let (nv, name) = (model.nv(), model.name().to_owned());
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let still =
            |nu| vec![Cost::new("still", 0.1, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic)];
        let all = limits(&model, nv - 6, &mut rng);
        let of_forces = if model.name() == "humanoid" { 4 } else { 2 };
        let contact = |l| ContactDynamics::running(model.clone(), &contacts, DT, still(nv - 6)).unwrap().with_limits(l);
        assert_eq!(check(&format!("{name} in contact"), &model, &all, contact, 5.0, &mut rng), all.len() - 1);
        let free = |l| FreeDynamics::running(model.clone(), DT, still(nv - 6)).unwrap().with_limits(l);
        assert_eq!(check(&format!("free {name}"), &model, &all, free, 5.0, &mut rng), all.len() - 1 - of_forces);

        let none = limits(&model, 0, &mut rng);
        let end = |l| FreeDynamics::terminal(model.clone(), still(0)).unwrap().with_limits(l);
        let of_dynamics = 3;
        let kinds = none.len() - 1 - of_forces - of_dynamics;
        assert_eq!(check(&format!("end of the {name}"), &model, &none, end, 0.0, &mut rng), kinds);
        let impact =
            |l| ImpulseDynamics::instant(model.clone(), &contacts, 0.3, 1e-9, still(0)).unwrap().with_limits(l);
        let kinds = check(&format!("impact of the {name}"), &model, &none, impact, 0.0, &mut rng);
        assert_eq!(kinds, none.len() - of_dynamics);
    }
}

#[test]
fn derivatives_of_limits_of_other_steps_are_those_of_the_terms() {
    let mut rng = StdRng::seed_from_u64(32);
    let model = Arc::new(robots::quadruped());
    let all = limits(&model, 12, &mut rng);
    for method in [Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4] {
        let make = |l| {
            let rest = Residual::State { reference: random_state(&model, &mut StdRng::seed_from_u64(1)) };
            let rest = vec![Cost::new("rest", 0.1, rest, Activation::Quadratic)];
            let inner = FreeAcceleration::new(model.clone(), Actuation::joints(&model), rest)?;
            Integrated::new(inner, method, DT)?.with_limits(l)
        };
        assert_eq!(check(&format!("{method:?}"), &model, &all, make, 0.3, &mut rng), all.len() - 3);
    }
    let all = limits(&model, 18, &mut rng);
    let inverse = |l| FreeInverseDynamics::running(model.clone(), DT, vec![]).unwrap().with_limits(l);
    assert_eq!(check("inverse dynamics", &model, &all, inverse, 1.0, &mut rng), all.len() - 3);
}

/// Compares the limit term of the controls with its closed form. The term is not multiplied by Δt or by the weight of
/// an integrator's stage.
#[test]
fn a_limit_costs_what_it_should() {
    let mut rng = StdRng::seed_from_u64(33);
    let arm = Arc::new(robots::arm7());
    let (x, u) = (random_state(&arm, &mut rng), random(7, 2.0, &mut rng));
    let (lower, mut upper) = (vec![-0.5; 7], vec![0.25; 7]);
    upper[3] = f64::INFINITY;
    let squares = (0..7).map(|i| (u[i] - u[i].clamp(lower[i], upper[i])).powi(2)).sum::<f64>();
    let expected = 0.5 * PENALTY * squares;
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let limit = || vec![Limit::new("effort", effort.clone(), lower.clone(), upper.clone())];
    let mut next = vec![0.0; 14];
    for method in
        [Integrator::SemiImplicitEuler, Integrator::RungeKutta2, Integrator::RungeKutta3, Integrator::RungeKutta4]
    {
        let cost = vec![Cost::new("effort", 0.3, effort.clone(), Activation::Quadratic)];
        let inner = FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), cost).unwrap();
        let mut free = Integrated::new(inner, method, DT).unwrap();
        let without = free.calc(0, &x, &u, &mut next);
        let mut limited = free.clone().with_limits(limit()).unwrap();
        let term = limited.calc(0, &x, &u, &mut next) - without;
        assert!((term - expected).abs() < ROUNDING * expected, "{method:?}: {term}, expected {expected}");
        // knot 2 gets a separate list of limits, which is empty
        limited.set_limits(2, vec![]).unwrap();
        let costs = [1, 2, 3].map(|t| limited.calc(t, &x, &u, &mut next) - without);
        assert_eq!(costs, [term, 0.0, term], "{method:?}");
    }
}

/// Checks that knots in SIMD lanes give the same results as single knots.
#[test]
fn limits_in_lanes_are_those_of_single_knots() {
    let mut rng = StdRng::seed_from_u64(34);
    let model = Arc::new(robots::quadruped());
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let all: Vec<_> = limits(&model, 12, &mut rng);
    let kept = all[..all.len() - 1].to_vec();
    let mut action = ContactDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap().with_limits(kept).unwrap();
    let knots: Vec<_> = (0..11).collect();
    let xs: Vec<_> = knots.iter().flat_map(|_| random_state(&model, &mut rng)).collect();
    let us: Vec<_> = (0..11 * 12).map(|_| rng.random::<f64>()).collect();
    let (mut next, mut costs) = (vec![0.0; xs.len()], vec![0.0; 11]);
    action.calc_group(&knots, &xs, &us, &mut next, &mut costs);
    let mut unread = vec![0.0; 37];
    let single: Vec<_> =
        (0..11).map(|t| action.calc(t, &xs[37 * t..][..37], &us[12 * t..][..12], &mut unread)).collect();
    assert!(largest_difference(&costs, &single) < ROUNDING);
}

#[test]
fn limits_of_implicit_knots_have_the_gains_of_explicit_ones() {
    let mut rng = StdRng::seed_from_u64(35);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let nu = model.nv() - 6;
        let mut kept = limits(&model, nu, &mut rng);
        kept.truncate(kept.len() - 1);
        let effort = Cost::new("u", 1.0, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic);
        let stance = ContactDynamics::running(model.clone(), &contacts, DT, vec![effort]).unwrap();
        let stance = Box::new(stance.with_limits(kept).unwrap());
        super::implicit::compare(model.name(), &model, stance, |rng| random_state(&model, rng));
    }
}

#[test]
fn what_does_not_fit_is_refused_by_the_limits_name() {
    let arm = Arc::new(robots::arm7());
    let effort = |n| Residual::Control { reference: vec![0.0; n] };
    let refused = |limits: Vec<Limit>| {
        let knot = FreeDynamics::running(arm.clone(), DT, vec![]).unwrap();
        knot.with_limits(limits).map(|_| ()).unwrap_err().to_string()
    };
    let limit = |lower: Vec<f64>, upper| vec![Limit::new("effort", effort(7), lower, upper)];
    assert_eq!(refused(limit(vec![0.0; 6], vec![0.0; 7])), "limit `effort`: its lower bound has 6 numbers, expected 7");
    assert_eq!(refused(limit(vec![0.0; 7], vec![0.0; 8])), "limit `effort`: its upper bound has 8 numbers, expected 7");
    for (lower, upper) in [(1.0, -1.0), (f64::NAN, 1.0), (f64::INFINITY, f64::INFINITY)] {
        let expected = format!("limit `effort`: entry 0 must be at least {lower} and at most {upper}");
        assert_eq!(refused(limit(vec![lower; 7], vec![upper; 7])), expected);
    }
    let one = Limit::new("effort", effort(6), vec![0.0; 6], vec![1.0; 6]);
    assert_eq!(refused(vec![one]), "limit `effort`: its reference has 6 numbers, expected 7");
    let twice = [limit(vec![0.0; 7], vec![1.0; 7]), limit(vec![0.0; 7], vec![1.0; 7])].concat();
    assert_eq!(refused(twice), "limit `effort`: another limit has this name");
    let force = Residual::ContactForce { contact: "hand".into(), target: condyle_dynamics::Force::zero() };
    let force = vec![Limit::new("push", force, vec![0.0; 3], vec![1.0; 3])];
    assert_eq!(refused(force.clone()), "limit `push`: there is no contact `hand` at this knot; there is none");
    let mut knot = FreeDynamics::running(arm.clone(), DT, vec![]).unwrap();
    let error = knot.set_limits(4, force).unwrap_err().to_string();
    assert_eq!(error, "limit `push` of knot 4: there is no contact `hand` at this knot; there is none");
    let end = FreeDynamics::terminal(arm.clone(), vec![]).unwrap();
    let effort = Limit::new("effort", Residual::JointEffort { reference: vec![0.0; 7] }, vec![0.0; 7], vec![1.0; 7]);
    let error = end.with_limits(vec![effort]).map(|_| ()).unwrap_err().to_string();
    assert_eq!(error, "limit `effort`: there is no effort at this knot");
}

/// Checks that a problem whose friction cones are turned in place has the bits of a problem that is made with turned
/// cones, and that other limits are refused.
#[test]
fn friction_cones_turn_in_place() {
    let (model, mut rng) = (Arc::new(robots::quadruped()), StdRng::seed_from_u64(31));
    let (R, count) = (rotation(&mut rng), 9);
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let problem = |rotation: Mat3<f64>| {
        let cone = FrictionCone { rotation, facets: 8, inner: true, ..FrictionCone::new(0.6) };
        let (lower, upper) = cone.bounds();
        let residual = Residual::FrictionCone { contact: contacts[0].name.clone(), cone };
        let effort = Residual::Control { reference: vec![0.0; 12] };
        let limits = [Limit::new("grip", residual, lower, upper), Limit::equality("effort", effort)];
        let knot = ContactDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap();
        let knot = Box::new(knot.with_limits(limits.to_vec()).unwrap());
        let x0 = [neutral(&model), vec![0.0; 18]].concat();
        Problem::new(x0, vec![knot], vec![0; count], Box::new(FreeDynamics::terminal(model.clone(), vec![]).unwrap()))
    };
    let (mut turned, mut made) = (problem(Mat3::identity()).unwrap(), problem(R).unwrap());
    assert!(turned.turn_cones("grip", R).unwrap() && !turned.turn_cones("grasp", R).unwrap());
    let xs: Vec<f64> = (0..=count).flat_map(|_| random_state(&model, &mut rng)).collect();
    let us = random(12 * count, 10.0, &mut rng);
    let [one, other] = [&mut turned, &mut made].map(|problem| {
        let mut knots = problem.lq_knots();
        problem.calc_diff(&xs, &us, &mut knots);
        knots
    });
    assert!(one == other);
    let wrong = turned.turn_cones("effort", R).unwrap_err().to_string();
    assert_eq!(wrong, "limit `effort`: it is no friction cone of a force");
    let scaled = turned.turn_cones("grip", Mat3 { x: Vec3::new(2.0, 0.0, 0.0), ..Mat3::identity() }).unwrap_err();
    assert!(scaled.to_string().contains("the rotation is none"), "{scaled}");
}
