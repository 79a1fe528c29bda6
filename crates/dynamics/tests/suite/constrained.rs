//! Tests of constrained dynamics and impacts. The constraints must hold, and only constraint forces may enforce them.

use crate::common;

use common::contacts::{cases, random_constraint};
use common::{State, Worst, all_models, dual, lift, moved, normal, rng};
use condyle_dynamics::{
    Act, ConstraintKind, ConstraintSet, ContactConstraint, Data, Error, Force, Inertia, Joint, Mat3, Model,
    ModelBuilder, Motion, ProximalSettings, ReferenceFrame, Se3, Sym3, Target, Vec3, WORLD, aba, constrained_dynamics,
    constrained_dynamics_derivatives, crba, forward_accelerations, forward_kinematics, forward_velocities,
    impulse_dynamics, impulse_dynamics_derivatives, lie, minv, rnea, robots,
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

/// Tolerance between two exact methods with some thousand rounding errors each.
const EXACT: f64 = 1e-11;
/// Tolerance after a product with the inertia matrix M, with M⁻¹, or with the constraint inertia Λ = (J M⁻¹ Jᵀ)⁻¹. The
/// condition numbers of M and Λ are up to 1e4.
const CONDITIONED: f64 = 1e-9;
const TREES: u64 = 15;

/// Computes the quantity that must vanish according to a constraint, from the public functions of kinematics. Rates of
/// velocities are time derivatives by dual numbers.
fn wanted(model: &Model, c: &ContactConstraint, q: &[f64], v: &[f64], a: &[f64]) -> Vec<f64> {
    let world = ReferenceFrame::World;
    let mut data = Data::<Dual64>::new(model);
    let later = moved(model, &lift(q), &dual(&vec![0.0; model.nv()], v));
    let later = forward_velocities(model, &mut data, &later, &dual(v, a));
    let (x1, v1) = (later.frame(c.frame), later.frame_velocity(c.frame, world));
    let target = c.target.placement.lift();
    let (x2, v2) = match c.other {
        Some(f) => (later.frame(f) * target, later.frame_velocity(f, world)),
        None => (target, Motion::zero()),
    };
    let mut data = Data::new(model);
    let now = forward_kinematics(model, &mut data, q);
    let now = (now.frame(c.frame), c.other.map_or(Se3::identity(), |f| now.frame(f)) * c.target.placement);
    let turn = Se3::new(now.0.rotation, Vec3::zero());
    let shift = Se3::new(condyle_dynamics::Mat3::identity(), now.0.translation);
    let local = c.reference == ReferenceFrame::Local;
    let split =
        |m: Motion<Dual64>| [Motion::from(m.to_array().map(|x| x.re)), Motion::from(m.to_array().map(|x| x.eps))];
    let ([velocity, rate], error) = match c.kind {
        ConstraintKind::Rigid => {
            let x = now.1.inverse() * now.0;
            let error = lie::log6(lie::Quaternion::from_rotation(x.rotation), x.translation);
            if local {
                (split(x1.act_inv(v1 - v2)), error)
            } else {
                (split(v1 - v2).map(|m| shift.act_inv(m)), turn.act(error))
            }
        }
        _ => {
            let at = |v: Motion<Dual64>, p: Vec3<Dual64>| v.linear + v.angular.cross(p);
            let u = at(v1, x1.translation) - at(v2, x2.translation);
            let zero = Vec3::zero();
            let parts = split(Motion::new(u, Vec3::zero()));
            let error = Motion::new(now.0.translation - now.1.translation, zero);
            if local { (parts.map(|m| turn.act_inv(m)), turn.act_inv(error)) } else { (parts, error) }
        }
    };
    let Target { velocity: v_wanted, acceleration: a_wanted, .. } = c.target;
    let gains = c.kp_axes.unwrap_or([c.kp; 6]);
    let pull: [f64; 6] = core::array::from_fn(|k| gains[k] * error.to_array()[k]);
    let value = rate - a_wanted + (velocity - v_wanted).scale(c.kd) + Motion::from(pull);
    match c.kind {
        ConstraintKind::Line => vec![c.axes.z.dot(value.linear)],
        ConstraintKind::Plane => vec![c.axes.x.dot(value.linear), c.axes.z.dot(value.linear)],
        _ => value.to_array()[..c.kind.rows()].to_vec(),
    }
}

/// Returns the components of a force that the rows of a constraint contain.
fn in_rows(c: &ContactConstraint, force: Force<f64>) -> Vec<f64> {
    let along = c.axes.transpose_mul(force.linear);
    match c.kind {
        ConstraintKind::Line => vec![along.z],
        ConstraintKind::Plane => vec![along.x, along.z],
        _ => force.to_array()[..c.kind.rows()].to_vec(),
    }
}

/// Computes the joint efforts that are equivalent to a constraint's force, from the public Jacobians.
fn effort(model: &Model, c: &ContactConstraint, force: Force<f64>, q: &[f64]) -> DVector<f64> {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let mut J = DMatrix::zeros(6, model.nv());
    placements.frame_jacobian(c.frame, c.reference, &mut J);
    let own = J.tr_mul(&DVector::from_row_slice(&force.to_array()));
    let Some(other) = c.other else { return own };
    let x1 = placements.frame(c.frame);
    let shift = Se3::new(condyle_dynamics::Mat3::identity(), x1.translation);
    let oF = if c.reference == ReferenceFrame::Local { x1.act(force) } else { shift.act(force) };
    let oF = match c.kind {
        ConstraintKind::Rigid => oF,
        _ => {
            let p = (placements.frame(other) * c.target.placement).translation;
            Force::new(oF.linear, p.cross(oF.linear))
        }
    };
    placements.frame_jacobian(other, ReferenceFrame::World, &mut J);
    own - J.tr_mul(&DVector::from_row_slice(&oF.to_array()))
}

/// Checks that every constraint holds and that M q̈ + h − Jᵀ λ = τ. These two equations define the solution.
#[test]
fn constraints_hold_by_forces_of_their_own() {
    let mut held = Worst::new("J q̈ + γ", CONDITIONED);
    let mut balance = Worst::new("M q̈ + h − Jᵀ λ − τ", CONDITIONED);
    let (mut kinds, mut rows) = (std::collections::BTreeSet::new(), 0);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let d = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &s.f_ext);
        assert_eq!(d.redundant, 0.0);
        assert!(d.residual < CONDITIONED);
        let (a, lambda) = (d.a.to_vec(), d.lambda.to_vec());
        let mut tau = DVector::from_row_slice(rnea(&model, &mut data, &s.q, &s.v, &a, &s.f_ext));
        for (k, c) in constraints.iter().enumerate() {
            let value = wanted(&model, c, &s.q, &s.v, &a);
            held.see(&model, &value, &vec![0.0; value.len()]);
            assert!(common::relative(&in_rows(c, set.force(k)), &lambda[set.range(k)]) < EXACT);
            tau -= effort(&model, c, set.force(k), &s.q);
            kinds.insert((c.kind.rows(), c.other.is_some(), c.reference == ReferenceFrame::Local));
        }
        balance.see(&model, tau.as_slice(), &s.tau);
        rows += set.rows();
    }
    assert_eq!(kinds.len(), 16, "points, lines, planes and frames, contacts and loops, in both references");
    println!("{rows} rows in all");
}

/// Checks a contact of a point or a frame in two reference frames. Only the axes in which λ is expressed may differ.
#[test]
fn references_turn_forces_only() {
    let mut worst = Worst::new("q̈ in both references", CONDITIONED);
    for (seed, model) in all_models(TREES).into_iter().enumerate() {
        let mut rng = rng(seed as u64);
        let (s, mut data) = (State::random(&model, &mut rng), Data::new(&model));
        let contact = |rng: &mut _| {
            let c =
                ContactConstraint { other: None, kd: 3.0, kp: 2.0, kp_axes: None, ..random_constraint(&model, rng) };
            let target = Target { placement: c.target.placement, ..Target::identity() };
            ContactConstraint { target, ..c }
        };
        let Some(c) = (0..200).map(|_| contact(&mut rng)).filter(|c| c.kind.rows() >= 3).find(|&c| {
            ConstraintSet::<f64>::new(&model, &[c]).is_ok_and(|mut set| {
                let d = impulse_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, 0.0);
                d.redundant == 0.0 && d.inertia.amax() < 1e4
            })
        }) else {
            panic!("no contact on\n{model}");
        };
        let mut run = |reference| {
            let mut set = ConstraintSet::new(&model, &[ContactConstraint { reference, ..c }]).unwrap();
            let a = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]).a.to_vec();
            (a, set.force(0))
        };
        let (a, local) = run(ReferenceFrame::Local);
        let (same, aligned) = run(ReferenceFrame::LocalWorldAligned);
        worst.see(&model, &a, &same);
        let R = forward_kinematics(&model, &mut data, &s.q).frame(c.frame).rotation;
        worst.see(&model, &(R * local.linear).to_array(), &aligned.linear.to_array());
        worst.see(&model, &(R * local.angular).to_array(), &aligned.angular.to_array());
    }
}

/// Returns a humanoid that stands on both soles with bent knees, the humanoid's state, and the frames of the soles.
fn standing() -> (Model, State, [usize; 2]) {
    let model = robots::humanoid();
    let mut state = State::random(&model, &mut rng(7));
    let soles = ["left_sole", "right_sole"].map(|name| model.frame(name).unwrap());
    for (q, lower) in state.q.iter_mut().skip(7).zip(7..) {
        *q = 0.2 + 0.01 * f64::from(lower);
    }
    (model, state, soles)
}

/// Checks that redundant rows are detected and get no force. With the proximal parameter μ, redundant rows must share
/// the force, and the motion must be the same.
#[test]
fn redundant_constraints() {
    let (model, s, [left, right]) = standing();
    let mut data = Data::new(&model);
    let once = [
        ContactConstraint::rigid(left),
        ContactConstraint { reference: ReferenceFrame::LocalWorldAligned, ..ContactConstraint::rigid(right) },
    ];
    // The frame of the ankle is on the same body as the sole.
    let body = model.frames()[left].body;
    let again = (0..model.frames().len()).find(|&f| f != left && model.frames()[f].body == body).unwrap();
    let twice = [once[0], once[1], ContactConstraint::rigid(again)];
    let mut single = ConstraintSet::new(&model, &once).unwrap();
    let reference = constrained_dynamics_derivatives(&model, &mut data, &mut single, &s.q, &s.v, &s.tau, &[]);
    assert_eq!(reference.redundant, 0.0);
    let (a, da_dq) = (reference.a.to_vec(), reference.da_dq.clone());
    for proximal in [ProximalSettings::default(), ProximalSettings { mu: 1e-8, iterations: 4 }] {
        let mut set = ConstraintSet::new(&model, &twice).unwrap();
        set.proximal = proximal;
        let d = constrained_dynamics_derivatives(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]);
        assert_eq!(d.redundant, if proximal.mu > 0.0 { 0.0 } else { 6.0 });
        assert!(d.residual < CONDITIONED);
        assert!(common::relative(d.a, &a) < CONDITIONED);
        assert!(common::relative(d.da_dq.as_slice(), da_dq.as_slice()) < CONDITIONED);
        let shared = d.lambda[12..].iter().any(|&x| x != 0.0);
        assert_eq!(shared, proximal.mu > 0.0, "the third constraint carries a share with μ only");
    }
}

/// Checks the forces of redundant points on a line. With the proximal parameter μ, these forces must be the smallest
/// possible forces. The test computes the smallest forces from M⁻¹ and a pseudo-inverse.
#[test]
fn smallest_forces() {
    let mut builder = ModelBuilder::new("box");
    let inertia = condyle_dynamics::Inertia::from_com(3.0, Vec3::zero(), condyle_dynamics::Sym3::diagonal(0.1));
    let body =
        builder.body("box", condyle_dynamics::WORLD, condyle_dynamics::Joint::FreeFlyer, Se3::identity(), inertia);
    for (k, x) in [-1.0, 0.0, 2.0].into_iter().enumerate() {
        let placement = Se3 { translation: Vec3::new(x, 0.0, -0.5), ..Se3::identity() };
        builder.frame(&format!("f{k}"), body, placement);
    }
    let model = builder.build().unwrap();
    let points = ["f0", "f1", "f2"].map(|name| ContactConstraint::point(model.frame(name).unwrap()));
    let (mut data, q) = (Data::new(&model), [0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0]);
    let mut set = ConstraintSet::new(&model, &points).unwrap();
    let d = constrained_dynamics(&model, &mut data, &mut set, &q, &[0.0; 6], &[0.0; 6], &[]);
    assert_eq!(d.redundant, 4.0, "a line of points holds all but its own rotation");
    assert!(d.residual < 1e-12 && d.a.iter().all(|a: &f64| a.abs() < 1e-12));
    set.proximal = ProximalSettings { mu: 1e-6, iterations: 5 };
    let d = constrained_dynamics(&model, &mut data, &mut set, &q, &[0.0; 6], &[0.0; 6], &[]);
    assert!(d.redundant == 0.0 && d.residual < CONDITIONED);
    let lambda = DVector::from_row_slice(d.lambda);
    let mut J = DMatrix::zeros(9, 6);
    set.jacobian(&mut J);
    let Minv = minv(&model, &mut data, &q).clone();
    let free = DVector::from_row_slice(aba(&model, &mut data, &q, &[0.0; 6], &[0.0; 6], &[]));
    let smallest = -(&J * Minv * J.transpose()).pseudo_inverse(1e-9).unwrap() * J * free;
    assert!((lambda - smallest).amax() < 1e-6);
}

/// Checks two constraints that contradict each other. The result must be the finite solution for the first constraint,
/// and the contradiction must be reported.
#[test]
fn contradictions() {
    let (model, s, [left, _]) = standing();
    let body = model.frames()[left].body;
    let again = (0..model.frames().len()).find(|&f| f != left && model.frames()[f].body == body).unwrap();
    let mut data = Data::new(&model);
    let mut first = ConstraintSet::new(&model, &[ContactConstraint::rigid(left)]).unwrap();
    let a = constrained_dynamics(&model, &mut data, &mut first, &s.q, &s.v, &s.tau, &[]).a.to_vec();
    let mut other = ContactConstraint::point(again);
    other.target.acceleration.linear.z = 1.0 + 1e3;
    let mut set = ConstraintSet::new(&model, &[ContactConstraint::rigid(left), other]).unwrap();
    let d = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]);
    assert_eq!(d.redundant, 3.0);
    assert!(d.residual > 500.0);
    assert!(common::relative(d.a, &a) < CONDITIONED);
}

/// Checks that constrained dynamics without constraints equals forward dynamics, and that an impact without constraints
/// changes nothing.
#[test]
fn no_constraint() {
    for (seed, model) in all_models(4).iter().enumerate() {
        let (s, mut data) = (State::random(model, &mut rng(seed as u64)), Data::new(model));
        let mut set = ConstraintSet::new(model, &[]).unwrap();
        assert!(set.is_empty() && set.rows() == 0);
        let d = constrained_dynamics_derivatives(model, &mut data, &mut set, &s.q, &s.v, &s.tau, &s.f_ext);
        assert_eq!(d.residual, 0.0);
        let a = d.a.to_vec();
        let expected = aba(model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext);
        assert!(common::relative(&a, expected) < EXACT);
        assert_eq!(impulse_dynamics(model, &mut data, &mut set, &s.q, &s.v, 0.0).v, s.v);
    }
}

/// Checks the energy of impacts. For the restitution ε = 1, the kinetic energy is constant. For ε = 0, the lost energy
/// is ½ Δᵀ M Δ, where Δ is the lost velocity (Carnot's theorem).
#[test]
fn energy_of_impacts() {
    let mut worst = Worst::new("energy of impacts", CONDITIONED);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let M = crba(&model, &mut data, &s.q).clone();
        let energy = |v: &DVector<f64>| 0.5 * v.dot(&(&M * v));
        let before = DVector::from_row_slice(&s.v);
        let mut after = |restitution| {
            let d = impulse_dynamics(&model, &mut data, &mut set, &s.q, &s.v, restitution);
            assert!(d.residual < CONDITIONED && d.redundant == 0.0);
            DVector::from_row_slice(d.v)
        };
        let (bounced, stuck) = (after(1.0), after(0.0));
        worst.see(&model, &[energy(&bounced)], &[energy(&before)]);
        worst.see(&model, &[energy(&stuck) + energy(&(before - &stuck))], &[energy(&DVector::from_row_slice(&s.v))]);
    }
}

/// Checks that constraint forces do no work on motions that the constraints allow: vᵀ Jᵀ λ = 0 for v in the kernel of
/// J. So q̈ is the allowed acceleration with the smallest distance from the free acceleration (Gauss's principle).
#[test]
fn gauss_principle() {
    let mut worst = Worst::new("Gauss's principle", CONDITIONED);
    for (model, s, constraints) in cases(TREES) {
        let mut data = Data::new(&model);
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        let d = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &s.f_ext);
        let a = DVector::from_row_slice(d.a);
        let free = DVector::from_row_slice(aba(&model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext));
        let any = normal(&mut rng(3), model.nv());
        let allowed = DVector::from_row_slice(impulse_dynamics(&model, &mut data, &mut set, &s.q, &any, 0.0).v);
        let force = crba(&model, &mut data, &s.q) * (a - free);
        let size = 1.0 + allowed.norm() * force.norm();
        worst.see(&model, &[allowed.dot(&force) / size], &[0.0]);
    }
}

/// Checks that the targets of a constraint set are used, and that they can be changed.
#[test]
fn moving_targets() {
    let (model, s, [left, right]) = standing();
    let mut data = Data::new(&model);
    let mut set =
        ConstraintSet::new(&model, &[ContactConstraint::rigid(left), ContactConstraint::point(right)]).unwrap();
    constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]);
    let mut target = set.target(1);
    target.acceleration.linear.y = 0.7;
    set.set_target(1, target).unwrap();
    let a = constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]).a.to_vec();
    let motion = forward_accelerations(&model, &mut data, &s.q, &s.v, &a);
    let found = motion.frame_classical_acceleration(right, ReferenceFrame::Local).linear;
    assert!(common::relative(&found.to_array(), &[0.0, 0.7, 0.0]) < EXACT);
}

#[test]
fn what_cannot_be_is_refused() {
    let model = robots::quadruped();
    let [foot, trunk] = ["LF_foot", "trunk"].map(|name| model.frame(name).unwrap());
    let (point, none) = (ContactConstraint::point(foot), model.frames().len());
    let (line, plane) = (ContactConstraint::line(foot), ContactConstraint::plane(foot));
    let axes = |diagonal: &[f64; 3]| {
        let [x, y, z] = *diagonal;
        Mat3 { x: Vec3::new(x, 0.0, 0.0), y: Vec3::new(0.0, y, 0.0), z: Vec3::new(0.0, 0.0, z) }
    };
    const LEFT: &str = "its axes are left-handed: expected e₁ × e₂ = e₃, found −e₃";
    let refused = |constraints: &[ContactConstraint]| match ConstraintSet::<f64>::new(&model, constraints) {
        Err(error @ Error::Constraint { .. }) => error.to_string(),
        other => panic!("{other:?}"),
    };
    let cases = [
        (
            refused(&[point, ContactConstraint::point(none)]),
            format!("constraint 1: there is no frame {none}: the model has {none}"),
        ),
        (
            refused(&[ContactConstraint { other: Some(none), ..point }]),
            format!("constraint 0: there is no frame {none}: the model has {none}"),
        ),
        (
            refused(&[ContactConstraint { other: Some(foot), ..point }]),
            "constraint 0: frames `LF_foot` and `LF_foot` do not move relative to each other".to_owned(),
        ),
        (
            refused(&[ContactConstraint { reference: ReferenceFrame::World, ..point }]),
            "constraint 0: its reference must be `local` or `local_world_aligned`, found `world`".to_owned(),
        ),
        (
            refused(&[ContactConstraint { kd: -1.0, ..point }]),
            "constraint 0: kd must be a number of at least 0, found -1".to_owned(),
        ),
        (
            refused(&[ContactConstraint { kp_axes: Some([0.0, 0.0, -2.0, 0.0, 0.0, 0.0]), ..point }]),
            "constraint 0: kp_axes must be a number of at least 0, found -2".to_owned(),
        ),
        (
            refused(&[ContactConstraint { kp: f64::NAN, ..point }]),
            "constraint 0: kp must be a number of at least 0, found NaN".to_owned(),
        ),
        (
            refused(&[point, ContactConstraint::point(trunk), point]),
            "constraint 2: it holds frame `LF_foot` as constraint 0 does already".to_owned(),
        ),
        (refused(&[ContactConstraint { axes: axes(&[1.0, 1.0, -1.0]), ..line }]), format!("constraint 0: {LEFT}")),
        (
            refused(&[ContactConstraint { axes: axes(&[1.0, 1.0, f64::NAN]), ..plane }]),
            "constraint 0: its axes are not finite".to_owned(),
        ),
        (
            refused(&[ContactConstraint { axes: axes(&[1.0, 1.0, 2.0]), ..line }]),
            "constraint 0: its axes are no unit vectors at right angles: the largest deviation is 1.0e0".to_owned(),
        ),
        (
            refused(&[ContactConstraint { axes: axes(&[1.0, -1.0, -1.0]), ..point }]),
            "constraint 0: its axes must be the identity: only lines and planes have axes of their own".to_owned(),
        ),
    ];
    for (found, expected) in cases {
        assert_eq!(found, expected);
    }
}

/// Two constraints of one frame are refused if they hold it in the same way, whatever their axes are called.
#[test]
fn a_frame_is_held_once() {
    let model = robots::quadruped();
    let foot = model.frame("LF_foot").unwrap();
    let [line, plane] = [ContactConstraint::line(foot), ContactConstraint::plane(foot)];
    let [point, rigid] = [ContactConstraint::point(foot), ContactConstraint::rigid(foot)];
    let (x, y, z) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0));
    let along = |x, y, z, c| ContactConstraint { axes: Mat3 { x, y, z }, ..c };
    let world = |c| ContactConstraint { reference: ReferenceFrame::LocalWorldAligned, ..c };
    let refused = |a, b| match ConstraintSet::<f64>::new(&model, &[a, b]) {
        Ok(_) => false,
        Err(error) => {
            assert_eq!(error.to_string(), "constraint 1: it holds frame `LF_foot` as constraint 0 does already");
            true
        }
    };
    let same = [(line, along(x, -y, -z, line)), (plane, along(z, -y, x, plane)), (point, world(point))];
    assert!(same.into_iter().all(|(a, b)| refused(a, b) && refused(b, a)));
    let other = [(line, along(y, z, x, line)), (plane, along(y, z, x, plane)), (line, world(line)), (line, plane)];
    assert!(!other.into_iter().chain([(point, rigid)]).any(|(a, b)| refused(a, b)));
}

/// A point whose axes have different gains is held like three lines, each with its own gain.
#[test]
fn a_point_with_gains_for_each_axis_is_three_lines() {
    let mut worst = Worst::new("a point as three lines", CONDITIONED);
    let model = robots::quadruped();
    let foot = model.frame("RF_foot").unwrap();
    let [x, y, z] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(Vec3::from);
    for seed in 0..20 {
        let mut rng = rng(seed);
        let (s, mut data) = (State::random(&model, &mut rng), Data::new(&model));
        for reference in [ReferenceFrame::Local, ReferenceFrame::LocalWorldAligned] {
            let gains = [0.0, 40.0, 300.0, 7.0, 7.0, 7.0]; // a point has no angular rows
            let point = ContactConstraint { kd: 5.0, reference, ..ContactConstraint::point(foot) };
            let whole = ContactConstraint { kp_axes: Some(gains), kp: 1e3, ..point };
            let line = |k: usize| {
                let [a, b, c] = [[y, z, x], [z, x, y], [x, y, z]][k];
                let axes = condyle_dynamics::Mat3 { x: a, y: b, z: c };
                ContactConstraint { kind: ConstraintKind::Line, axes, kp: gains[k], ..point }
            };
            let mut run = |constraints: &[ContactConstraint]| {
                let mut set = ConstraintSet::new(&model, constraints).unwrap();
                constrained_dynamics(&model, &mut data, &mut set, &s.q, &s.v, &s.tau, &[]).a.to_vec()
            };
            let (ours, lines) = (run(&[whole]), run(&[line(0), line(1), line(2)]));
            worst.see(&model, &ours, &lines);
            let uniform = ContactConstraint { kp: 300.0, ..point };
            let mut changed = ConstraintSet::new(&model, &[point]).unwrap();
            changed.set_gains(0, 1e3, Some(gains), 5.0).unwrap();
            assert!(changed.set_gains(0, 0.0, None, f64::NAN).is_err()); // the old gains are kept
            let again =
                constrained_dynamics(&model, &mut Data::new(&model), &mut changed, &s.q, &s.v, &s.tau, &[]).a.to_vec();
            assert_eq!(again, ours);
            worst.see(&model, &run(&[ContactConstraint { kp_axes: Some([300.0; 6]), ..point }]), &run(&[uniform]));
            assert_ne!(run(&[uniform]), ours);
        }
    }
}

#[test]
fn gains_are_one_number_or_several_in_json() {
    let point = ContactConstraint::point(3);
    let text = |c: &ContactConstraint| serde_json::to_string(c).unwrap();
    let read = |text: &str| serde_json::from_str::<ContactConstraint>(text);
    let uniform = ContactConstraint { kp: 20.0, ..point };
    assert!(text(&uniform).contains(r#""kp":20.0,"kd":0.0"#));
    assert_eq!(read(&text(&uniform)).unwrap(), uniform);
    assert_eq!(read(&text(&uniform).replace("20.0", "20")).unwrap(), uniform);
    let each = ContactConstraint { kp_axes: Some([0.0, 0.0, 20.0, 1.0, 2.0, 3.0]), ..point };
    assert!(text(&each).contains(r#""kp":[0.0,0.0,20.0,1.0,2.0,3.0],"kd":0.0"#));
    assert_eq!(read(&text(&each)).unwrap(), each);
    let linear = read(&text(&each).replace(",1.0,2.0,3.0]", "]")).unwrap();
    assert_eq!(linear.kp_axes, Some([0.0, 0.0, 20.0, 0.0, 0.0, 0.0]));
    let wrong = read(&text(&each).replace(",2.0,3.0]", "]")).unwrap_err().to_string();
    assert!(wrong.contains("invalid length 4, expected a number, or a list of 3 or 6 numbers"), "{wrong}");
}

#[test]
#[should_panic = "constraints: made for another model than `arm7`"]
fn another_robots_constraints() {
    let (arm, quadruped) = (robots::arm7(), robots::quadruped());
    let mut set = ConstraintSet::<f64>::new(&quadruped, &[]).unwrap();
    constrained_dynamics(&arm, &mut Data::new(&arm), &mut set, &[0.0; 7], &[0.0; 7], &[0.0; 7], &[]);
}

/// Checks that the loops of a model become constraints between frames of the model. A coupling of joints is not a
/// constraint of a frame.
#[test]
fn loops_of_a_model() {
    let mut builder = ModelBuilder::new("loops");
    let hinge = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let [one, other] = ["one", "other"].map(|name| builder.body(name, WORLD, hinge, Se3::identity(), I));
    builder.constraint_point("pin", [(one, Se3::identity()), (other, Se3::identity())]);
    builder.constraint_coupling("gear", one, Some(other), [0.1, -2.0, 0.0, 0.0, 0.0]);
    builder.constraint_rigid("weld", [(other, Se3::identity()), (WORLD, Se3::identity())]);
    let model = builder.build().unwrap();
    let names: Vec<&str> = model.constraints().iter().map(|c| &*c.name).collect();
    assert_eq!(names, ["pin", "gear", "weld"]);
    let [pin, gear, weld] = [0, 1, 2].map(|k| ContactConstraint::of(&model.constraints()[k]));
    let frame = |name: &str| model.frame(name).unwrap();
    assert_eq!(
        pin,
        Some(ContactConstraint { other: Some(frame("pin#2")), ..ContactConstraint::point(frame("pin#1")) })
    );
    assert_eq!(gear, None);
    assert_eq!(
        weld,
        Some(ContactConstraint { other: Some(frame("weld#2")), ..ContactConstraint::rigid(frame("weld#1")) })
    );
    let both: Vec<ContactConstraint> = model.constraints().iter().filter_map(ContactConstraint::of).collect();
    assert_eq!(ConstraintSet::<f64>::new(&model, &both).unwrap().rows(), 9);
}
