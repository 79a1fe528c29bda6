//! Robots in contact, at impacts, and with various actuations: exact derivatives, and errors.
#![allow(non_snake_case)] // names follow the literature

mod access;
mod callers;
mod distances;
mod files;
mod groups;
mod heading;
mod implicit;
mod integrators;
mod inverse;
mod limits;
mod motion;
mod own;
mod shapes;
mod together;

use condyle_dynamics::{
    ContactConstraint, Data, Force, Mat3, Model, Motion, ReferenceFrame, Vec3, centroidal_map, forward_kinematics,
    forward_velocities, integrate, neutral, robots,
};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactAcceleration, ContactDynamics, Cost, FrameName, FreeAcceleration,
    FreeDynamics, FreeInverseDynamics, FrictionCone, ImpulseDynamics, Integrated, Integrator, Residual, WrenchCone,
};
use condyle_optimal::{ActionModel, DynamicsStructure, Error, Fddp, LqKnot, NumDiff, Problem, Status, Sweep};
use nalgebra::DMatrix;
use rand::{RngExt, SeedableRng, rngs::StdRng};
use std::sync::Arc;

/// Tolerance of central differences, which are accurate to about 1e-9 for a function with values and derivatives of
/// order one. Contact forces are a few hundred times larger than the arguments.
const DIFFERENCES: f64 = 1e-6;
/// Tolerance of optima. The compared solves stop where the expected decrease of the cost is below 1e-9.
const OPTIMUM: f64 = 1e-7;
/// Tolerance for two sums of the same products (a few dozen) that are added in different orders.
const ROUNDING: f64 = 1e-13;
/// Tolerance for two results of a factorisation whose sums were added in different orders.
const SAME: f64 = 1e-9;
const DT: f64 = 0.02;

/// Returns n random weights from 0 to 1.
fn magnitudes(n: usize, rng: &mut StdRng) -> Vec<f64> {
    random(n, 1.0, rng).iter().map(|x| x.abs()).collect()
}

fn random(n: usize, scale: f64, rng: &mut StdRng) -> Vec<f64> {
    (0..n).map(|_| scale * (2.0 * rng.random::<f64>() - 1.0)).collect()
}

/// Returns a random state near the neutral state, where no joint is near a singularity.
fn random_state(model: &Model, rng: &mut StdRng) -> Vec<f64> {
    let mut q = neutral(model);
    integrate(model, &neutral(model), &random(model.nv(), 0.5, rng), &mut q);
    [q, random(model.nv(), 1.0, rng)].concat()
}

fn rotation(rng: &mut StdRng) -> Mat3<f64> {
    let axis = random(3, 1.0, rng);
    condyle_dynamics::lie::exp3(Vec3::new(axis[0], axis[1], axis[2])).to_rotation()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let scale = 1.0 + b.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    a.iter().zip(b).fold(0.0, |m: f64, (a, b)| m.max((a - b).abs())) / scale
}

/// Compares hand-written derivatives of an action with finite differences at a random state.
fn check_derivatives<A: ActionModel + Clone>(what: &str, mut action: A, model: &Model, effort: f64, rng: &mut StdRng) {
    let (ndx, nu) = (action.ndx(), action.nu());
    let mut oracle = NumDiff(action.clone());
    let (mut exact, mut numeric) = (LqKnot::zeros(ndx, nu), LqKnot::zeros(ndx, nu));
    let (x, u) = (random_state(model, rng), random(nu, effort, rng));
    action.calc_diff(0, &x, &u, &mut exact);
    oracle.calc_diff(0, &x, &u, &mut numeric);
    for (name, a, b) in [
        ("A", exact.A.as_slice(), numeric.A.as_slice()),
        ("B", exact.B.as_slice(), numeric.B.as_slice()),
        ("q", exact.q.as_slice(), numeric.q.as_slice()),
        ("r", exact.r.as_slice(), numeric.r.as_slice()),
    ] {
        let error = largest_difference(a, b);
        assert!(error < DIFFERENCES, "{what}: {name} is off by {error:e}");
    }
    for (name, H) in [("Q", &exact.Q), ("R", &exact.R)] {
        let error = largest_difference(H.as_slice(), H.transpose().as_slice());
        assert!(error < ROUNDING, "{what}: {name} is unsymmetric by {error:e}");
    }
}

/// Returns contacts at the robot's feet: points at two feet of the quadruped, or whole frames at both feet of the
/// humanoid.
fn feet(model: &Model, reference: ReferenceFrame) -> Vec<Contact> {
    let make: fn(usize) -> ContactConstraint = match model.name() {
        "quadruped" => ContactConstraint::point,
        _ => ContactConstraint::rigid,
    };
    let names = match model.name() {
        "quadruped" => ["LF_foot", "RH_foot"],
        _ => ["left_foot", "right_foot"],
    };
    let contact = |name: &str| {
        let constraint = ContactConstraint { reference, kp: 20.0, kd: 30.0, ..make(model.frame(name).unwrap()) };
        Contact::new(name, constraint)
    };
    names.map(contact).into()
}

fn barrier(n: usize) -> Activation {
    Activation::Barrier { lower: vec![-0.1; n], upper: vec![0.2; n] }
}

/// Returns a cost for every residual of a robot in contact.
fn contact_costs(model: &Model, contacts: &[Contact], nu: usize, rng: &mut StdRng) -> Vec<Cost> {
    let (nv, name, rows) = (model.nv(), contacts[1].name.clone(), contacts[1].constraint.kind.rows());
    let foot = || FrameName::from(&*contacts[0].name);
    let friction = FrictionCone { rotation: rotation(rng), inner: true, facets: 6, ..FrictionCone::new(0.6) };
    let force: [f64; 6] = core::array::from_fn(|k| if k < rows { rng.random::<f64>() } else { 0.0 });
    let velocity: [f64; 6] = core::array::from_fn(|_| rng.random::<f64>());
    let mut costs = vec![
        Cost::new("state", 0.3, Residual::State { reference: random_state(model, rng) }, Activation::Quadratic),
        Cost::new("effort", 0.1, Residual::Control { reference: random(nu, 1.0, rng) }, barrier(nu)),
        Cost::new("gravity", 1e-4, Residual::ControlGravity, Activation::Weighted(magnitudes(nv, rng))),
        Cost::new(
            "torque",
            1e-2,
            Residual::JointEffort { reference: random(nv, 1.0, rng) },
            Activation::Smooth1 { epsilon: 0.3 },
        ),
        Cost::new(
            "acceleration",
            1e-4,
            Residual::JointAcceleration { reference: random(nv, 1.0, rng) },
            Activation::Quadratic,
        ),
        Cost::new("com", 0.8, Residual::CenterOfMass { target: Vec3::new(0.1, 0.2, 0.3) }, Activation::Quadratic),
        Cost::new(
            "momentum",
            1e-2,
            Residual::CentroidalMomentum { target: Force::from(velocity) },
            Activation::Smooth2 { epsilon: 0.5 },
        ),
        Cost::new("turn", 0.7, Residual::FrameRotation { frame: foot(), target: rotation(rng) }, Activation::Quadratic),
        Cost::new(
            "force",
            1e-4,
            Residual::ContactForce { contact: name.clone(), target: Force::from(force) },
            Activation::WeightedBarrier {
                lower: vec![-0.5; rows],
                upper: vec![0.3; rows],
                weights: magnitudes(rows, rng),
            },
        ),
        Cost::new(
            "cone",
            1e-4,
            Residual::FrictionCone { contact: name.clone(), cone: friction.clone() },
            Activation::Barrier { lower: friction.bounds().0, upper: friction.bounds().1 },
        ),
    ];
    for (axes, label) in [
        (ReferenceFrame::Local, "fast"),
        (ReferenceFrame::World, "fast in the world"),
        (ReferenceFrame::LocalWorldAligned, "fast along the world"),
    ] {
        let residual = Residual::FrameVelocity { frame: foot(), target: Motion::from(velocity), reference: axes };
        costs.push(Cost::new(label, 0.2, residual, Activation::Quadratic));
    }
    if rows == 6 {
        let cone = WrenchCone { friction, size: [0.2, 0.1] };
        let (lower, upper) = cone.bounds();
        let wrench = Residual::WrenchCone { contact: name.clone(), cone };
        costs.push(Cost::new("wrench", 1e-4, wrench, Activation::Barrier { lower, upper }));
        let pressure = Residual::CenterOfPressure { contact: name, rotation: rotation(rng), size: [0.1, 0.2] };
        costs.push(Cost::new("pressure", 1e-4, pressure, barrier(4)));
    }
    costs
}

#[test]
fn derivatives_in_contact_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(11);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        for reference in [ReferenceFrame::Local, ReferenceFrame::LocalWorldAligned] {
            let (contacts, nu) = (feet(&model, reference), model.nv() - 6);
            let mut costs = contact_costs(&model, &contacts, nu, &mut rng);
            let cone = FrictionCone::new(0.5);
            let (lower, upper) = cone.bounds();
            let barrier = Activation::RelaxedBarrier { lower, upper, mu: 0.5, delta: 2.0 };
            let grip = Residual::FrictionCone { contact: contacts[0].name.clone(), cone };
            costs.push(Cost::new("relaxed cone", 1e-2, grip, barrier));
            let action = ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
            check_derivatives(&format!("{} {reference:?}", model.name()), action, &model, 5.0, &mut rng);
        }
    }
}

/// Checks line and plane contacts, including two line contacts on the same body.
#[test]
fn derivatives_in_contact_along_axes_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(29);
    let model = Arc::new(robots::quadruped());
    for reference in [ReferenceFrame::Local, ReferenceFrame::LocalWorldAligned] {
        for second in [ContactConstraint::line, ContactConstraint::plane] {
            let make = |name: &str, make: fn(usize) -> ContactConstraint, frame: &str, rng: &mut StdRng| {
                let axes = rotation(rng);
                let frame = model.frame(frame).unwrap();
                Contact::new(name, ContactConstraint { reference, axes, kp: 20.0, kd: 30.0, ..make(frame) })
            };
            let contacts = [
                make("along", ContactConstraint::line, "LF_foot", &mut rng),
                make("RH_foot", second, "RH_foot", &mut rng),
                make("across", ContactConstraint::line, "LF_foot", &mut rng),
            ];
            let mut costs = contact_costs(&model, &contacts, 12, &mut rng);
            let at_frame =
                |cost: &Cost| !matches!(cost.residual, Residual::FrameRotation { .. } | Residual::FrameVelocity { .. });
            costs.retain(at_frame); // the frame and the contact have different names
            let what = format!("{:?} {reference:?}", contacts[1].constraint.kind);
            let action = ContactDynamics::running(model.clone(), &contacts, DT, costs.clone()).unwrap();
            check_derivatives(&what, action, &model, 5.0, &mut rng);
            let kept = ["state", "com", "momentum", "force", "cone"];
            costs.retain(|cost| kept.contains(&cost.name.as_str()));
            let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.3, 0.0, costs).unwrap();
            check_derivatives(&format!("impact, {what}"), impact, &model, 0.0, &mut rng);
        }
    }
}

#[test]
fn derivatives_with_damping_and_other_drives_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(12);
    let model = Arc::new(robots::quadruped());
    let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
    let S = DMatrix::from_fn(18, 4, |_, _| rng.random::<f64>() - 0.5);
    let drives = Actuation::matrix(&model, S).unwrap();
    let costs = contact_costs(&model, &contacts, 4, &mut rng);
    let inner = ContactAcceleration::new(model.clone(), drives, &contacts, 1e-3, costs).unwrap();
    let action = Integrated::new(inner, Integrator::SemiImplicitEuler, DT).unwrap();
    check_derivatives("damped", action, &model, 5.0, &mut rng);
}

#[test]
fn derivatives_of_an_impact_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(13);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let kept = ["state", "com", "momentum", "turn", "force", "cone", "fast", "wrench"];
        let mut costs = contact_costs(&model, &contacts, 0, &mut rng);
        costs.retain(|cost| kept.contains(&cost.name.as_str()));
        costs.push(Cost::new("jump", 0.4, Residual::ImpulseCenterOfMass, Activation::Quadratic));
        let action = ImpulseDynamics::instant(model.clone(), &contacts, 0.3, 1e-9, costs).unwrap();
        check_derivatives(&format!("impact of the {}", model.name()), action, &model, 0.0, &mut rng);
    }
}

#[test]
fn derivatives_of_inverse_dynamics_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(17);
    for model in [robots::arm7(), robots::quadruped()].map(Arc::new) {
        let nv = model.nv();
        let costs = vec![
            Cost::new(
                "state",
                0.3,
                Residual::State { reference: random_state(&model, &mut rng) },
                Activation::Quadratic,
            ),
            Cost::new("torque", 1e-2, Residual::JointEffort { reference: random(nv, 1.0, &mut rng) }, barrier(nv)),
            Cost::new("gravity", 1e-2, Residual::ControlGravity, Activation::Quadratic),
            Cost::new("change", 0.1, Residual::Control { reference: random(nv, 1.0, &mut rng) }, Activation::Quadratic),
        ];
        let action = FreeInverseDynamics::running(model.clone(), DT, costs).unwrap();
        check_derivatives(&format!("inverse dynamics of {}", model.name()), action, &model, 1.0, &mut rng);
    }
}

/// Checks that an arm which reaches for a point has the same optimum with torques and with accelerations as controls.
#[test]
fn inverse_and_forward_dynamics_have_one_optimum() {
    let arm = Arc::new(robots::arm7());
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    let reach = Residual::FrameTranslation { frame: "tool".into(), target: Vec3::new(0.4, 0.2, 0.5) };
    let effort = || Residual::JointEffort { reference: vec![0.0; 7] };
    let acceleration = || Residual::JointAcceleration { reference: vec![0.0; 7] };
    let running = || {
        vec![
            Cost::new("rest", 1e-1, Residual::State { reference: x0.clone() }, Activation::Quadratic),
            Cost::new("effort", 1e-3, effort(), Activation::Quadratic),
            Cost::new("smooth", 1e-4, acceleration(), Activation::Quadratic),
        ]
    };
    let end =
        || FreeDynamics::terminal(arm.clone(), vec![Cost::new("reach", 1e2, reach.clone(), Activation::Quadratic)]);
    let solve = |knot: Box<dyn ActionModel>, us: &[f64]| {
        let mut problem = Problem::new(x0.clone(), vec![knot], vec![0; 20], Box::new(end().unwrap())).unwrap();
        let mut solver = Fddp::new(&problem);
        let solution = solver.solve(&mut problem, &x0.repeat(21), us).unwrap();
        assert_eq!(solution.status, Status::Converged);
        solution.cost
    };
    let mut forward = FreeDynamics::running(arm.clone(), 0.05, running()).unwrap();
    let hold = forward.quasi_static(&x0).repeat(20);
    let by_effort = solve(Box::new(forward), &hold);
    let by_acceleration =
        solve(Box::new(FreeInverseDynamics::running(arm.clone(), 0.05, running()).unwrap()), &[0.0; 140]);
    assert!((by_effort - by_acceleration).abs() < OPTIMUM * by_effort, "{by_effort} and {by_acceleration}");
}

#[test]
fn residuals_are_what_they_say() {
    let mut rng = StdRng::seed_from_u64(16);
    let model = Arc::new(robots::quadruped());
    let (x, frame) = (random_state(&model, &mut rng), model.frame("LF_foot").unwrap());
    let (q, v) = x.split_at(model.nq());
    let mut data = Data::new(&model);
    let R = forward_kinematics(&model, &mut data, q).frame(frame).rotation;
    let motion = forward_velocities(&model, &mut data, q, v);
    let (speed, momentum) = (motion.frame_velocity(frame, ReferenceFrame::World), motion.centroidal_momentum());
    let com = centroidal_map(&model, &mut data, q).com;
    let reference = ReferenceFrame::World;
    for residual in [
        Residual::CenterOfMass { target: com },
        Residual::CentroidalMomentum { target: momentum },
        Residual::FrameRotation { frame: "LF_foot".into(), target: R },
        Residual::FrameVelocity { frame: "LF_foot".into(), target: speed, reference },
    ] {
        let terms = vec![Cost::new("zero", 1.0, residual, Activation::Quadratic)];
        let mut action = FreeDynamics::terminal(model.clone(), terms).unwrap();
        let cost = action.calc(0, &x, &[], &mut []);
        assert!(cost < 1e-24, "{cost:e}");
    }
    // with the efforts that hold the robot still, `ControlGravity` is zero for any set of feet on the ground
    let still = [q, &[0.0; 18]].concat();
    let all = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
    let contacts = all.map(|name| Contact::new(name, ContactConstraint::point(model.frame(name).unwrap())));
    let costs = vec![Cost::new("gravity", 1.0, Residual::ControlGravity, Activation::Quadratic)];
    let mut stand = ContactDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
    let u = stand.quasi_static(&still);
    let mut next = still.clone();
    let cost = stand.calc(0, &still, &u, &mut next) / DT;
    assert!(cost < 1e-16 && largest_difference(&next, &still) < 1e-9, "{cost:e}");
}

#[test]
fn a_knot_can_have_costs_of_its_own() {
    let model = Arc::new(robots::arm7());
    let term = |weight| {
        vec![Cost::new("effort", weight, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic)]
    };
    let mut action = FreeDynamics::running(model, 1.0, term(2.0)).unwrap();
    action.set_costs(3, term(10.0)).unwrap();
    let (x, u, mut next) = ([0.0; 14], [1.0; 7], [0.0; 14]);
    let costs: Vec<f64> = (0..5).map(|t| action.calc(t, &x, &u, &mut next)).collect();
    assert_eq!(costs, [7.0, 7.0, 7.0, 35.0, 7.0]);
    assert!(
        action.costs_at_mut(3).set_weight("effort", 4.0).unwrap()
            && action.costs_mut().set_weight("effort", 0.0).unwrap()
    );
    assert_eq!([2, 3].map(|t| action.calc(t, &x, &u, &mut next)), [0.0, 14.0]);
    let moved = Residual::Control { reference: vec![1.0; 7] };
    action.costs_at_mut(3).set_residual("effort", moved).unwrap();
    assert_eq!(action.calc(3, &x, &u, &mut next), 0.0);
    let other = action.costs_at_mut(3).set_residual("effort", Residual::State { reference: vec![0.0; 14] });
    assert_eq!(other.unwrap_err().to_string(), "cost `effort`: its residual is of another kind than before");
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let model = Arc::new(robots::humanoid());
    let sole = |name: &str, frame: &str| Contact::new(name, ContactConstraint::rigid(model.frame(frame).unwrap()));
    let refused = |contacts: &[Contact], costs| {
        ContactDynamics::running(model.clone(), contacts, DT, costs).map(|_| ()).unwrap_err().to_string()
    };
    let left = sole("left", "left_foot");
    assert_eq!(
        refused(&[left.clone(), sole("left", "right_foot")], vec![]),
        "contact `left`: another contact has this name"
    );
    let heel = Contact::new("heel", ContactConstraint::point(left.constraint.frame));
    assert!(
        refused(&[left.clone(), heel], vec![])
            .ends_with("as contact `left`: together they are singular without damping")
    );
    assert_eq!(
        refused(&[Contact::new("ghost", ContactConstraint::point(10_000))], vec![]),
        format!("contact `ghost`: there is no frame 10000; the robot has {}", model.frames().len())
    );
    let loose =
        Contact::new("loose", ContactConstraint { kd: f64::NAN, ..ContactConstraint::point(left.constraint.frame) });
    assert_eq!(refused(&[loose], vec![]), "contact `loose`: kd must be a number of at least 0, found NaN");
    let cone = |contact: &str, mu| Residual::FrictionCone { contact: contact.into(), cone: FrictionCone::new(mu) };
    let term = |residual| vec![Cost::new("grip", 1.0, residual, Activation::Quadratic)];
    let contacts = [left];
    assert_eq!(
        refused(&contacts, term(cone("right", 0.7))),
        "cost `grip`: there is no contact `right` at this knot; there is `left`"
    );
    assert_eq!(
        refused(&contacts, term(cone("left", -1.0))),
        "cost `grip`: its friction is -1, but it must be at least 0"
    );
    let twice = [term(cone("left", 0.7)), term(cone("left", 0.7))].concat();
    assert_eq!(refused(&contacts, twice), "cost `grip`: another term has this name");
    assert_eq!(
        refused(&contacts, term(Residual::ImpulseCenterOfMass)),
        "cost `grip`: only an impact changes velocities at once"
    );
    let exclusive = Activation::Barrier { lower: vec![1.0; 3], upper: vec![0.0; 3] };
    let com = Residual::CenterOfMass { target: Vec3::zero() };
    assert_eq!(
        refused(&contacts, vec![Cost::new("grip", 1.0, com, exclusive)]),
        "cost `grip`: its bounds of entry 0 exclude each other: 1 and 0"
    );
    let flat = WrenchCone { friction: FrictionCone::new(0.7), size: [0.1, 0.1] };
    let point = [Contact::new("toe", ContactConstraint::point(contacts[0].constraint.frame))];
    assert_eq!(
        refused(&point, term(Residual::WrenchCone { contact: "toe".into(), cone: flat })),
        "cost `grip`: a wrench cone needs a rigid contact, of 6 rows; this one has 3"
    );
    let bounce = ImpulseDynamics::instant(model.clone(), &contacts, 2.0, 0.0, vec![]).unwrap_err();
    assert_eq!(bounce.to_string(), "setting `restitution` is 2, but it must be from 0 to 1");
    let drives = Actuation::matrix(&model, DMatrix::zeros(3, 2)).unwrap_err();
    assert_eq!(drives.to_string(), format!("actuation: its map is 3 × 2, expected {} rows", model.nv()));
    let end = FreeDynamics::terminal(model.clone(), term(cone("left", 0.7))).map(|_| ()).unwrap_err();
    assert!(matches!(end, Error::Cost { .. }));
}

/// Checks contact points on a line of the same body, which constrain only five of six directions. With damping, these
/// contacts share the forces, and a solve converges.
#[test]
fn a_line_of_contacts_on_one_body_needs_damping() {
    let arm = robots::arm7();
    let tool = arm.frame("tool").unwrap();
    let model = Arc::new(arm);
    let body = model.frames()[tool].body;
    let on_body: Vec<_> = (0..model.frames().len()).filter(|&f| model.frames()[f].body == body).collect();
    let contacts: Vec<_> = on_body
        .iter()
        .enumerate()
        .map(|(k, &f)| Contact::new(&format!("point {k}"), ContactConstraint::point(f)))
        .collect();
    assert!(contacts.len() > 1);
    assert!(ContactDynamics::running(model.clone(), &contacts, DT, vec![]).is_err());
    let x0 = [[0.3; 7], [0.0; 7]].concat();
    let costs = || vec![Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic)];
    let effort = Cost::new("effort", 1e-2, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic);
    let running = [costs(), vec![effort]].concat();
    let inner = ContactAcceleration::new(model.clone(), Actuation::joints(&model), &contacts, 1e-6, running).unwrap();
    let action = Integrated::new(inner, Integrator::SemiImplicitEuler, DT).unwrap();
    let end = FreeDynamics::terminal(model.clone(), costs()).unwrap();
    let mut problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; 10], Box::new(end)).unwrap();
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve(&mut problem, &x0.repeat(11), &[0.0; 70]).unwrap();
    assert_eq!(solution.status, Status::Converged);
    assert!(solution.xs.iter().all(|x| x.is_finite()));
}

/// Checks the structure of A and B that knots in contact and impacts report. A sweep that ignores the structure gives
/// the same result.
#[test]
fn derivatives_have_the_form_of_euler_steps() {
    let mut rng = StdRng::seed_from_u64(9);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let (ndx, nu) = (2 * model.nv(), model.nv() - 6);
        let contacts = feet(&model, ReferenceFrame::LocalWorldAligned);
        let mut stand = ContactDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap();
        let mut impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.0, 1e-9, vec![]).unwrap();
        let mut lq_knots = [nu, 0, nu, 0].map(|nu| LqKnot::zeros(ndx, nu));
        for (t, knot) in lq_knots.iter_mut().enumerate() {
            let (x, u) = (random_state(&model, &mut rng), random(knot.nu(), 5.0, &mut rng));
            match t {
                1 => impact.calc_diff(t, &x, &u, knot),
                3 => {}
                _ => stand.calc_diff(t, &x, &u, knot),
            }
            assert!(t == 3 || knot.structure != DynamicsStructure::default());
            knot.Q.fill_with_identity();
            knot.R.fill_with_identity();
        }
        let mut sweep = Sweep::new(&lq_knots);
        sweep.run(&lq_knots, 1e-6).unwrap();
        let structured = sweep.feedback().to_vec();
        lq_knots.iter_mut().for_each(|knot| knot.structure.set_dense());
        sweep.run(&lq_knots, 1e-6).unwrap();
        for (a, b) in structured.iter().zip(sweep.feedback()) {
            for (name, a, b) in [("K", a.K.as_slice(), b.K.as_slice()), ("Vxx", a.Vxx.as_slice(), b.Vxx.as_slice())] {
                let error = largest_difference(a, b);
                assert!(error < SAME, "{}: {name} is off by {error:e}", model.name());
            }
        }
    }
}
