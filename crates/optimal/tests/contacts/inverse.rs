//! Inverse dynamics in contact: exact derivatives, the same motions and optima as with forward dynamics, and errors.

use super::limits::check_gradient;
use super::{DT, check_derivatives, contact_costs, feet, largest_difference, random, random_state, rotation};
use condyle_dynamics::{ContactConstraint, Model, ReferenceFrame, Vec3, integrate, neutral, robots};
use condyle_optimal::robot::{
    Activation, Actuation, Contact, ContactAcceleration, ContactDynamics, ContactInverseDynamics, ContinuousModel,
    ControlledContactAcceleration, Cost, FreeDynamics, FreeInverseDynamics, FrictionCone, Integrated, Integrator,
    Limit, Residual,
};
use condyle_optimal::{
    ActionModel, AugmentedLagrangian, ConstraintSettings, Fddp, GroupModel, Problem, Settings, Status,
};
use nalgebra::DMatrix;
use rand::{SeedableRng, rngs::StdRng};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Tolerance after a solution with M and a product with M. The condition number of M is up to 1e4.
const BACK: f64 = 1e-9;
/// Tolerance for two sums of the same products (a few dozen) that are added in different orders.
const ROUNDING: f64 = 1e-12;
/// Maximum violation of the equations in a solution (N, m/s²). The next constant is the resulting error of forces of a
/// few hundred newtons.
const HELD: f64 = 1e-6;
const FORCES: f64 = 1e-2;

/// Returns four contacts with gains, one of each kind: line, plane, point and whole frame.
fn all_kinds(model: &Model, reference: ReferenceFrame, rng: &mut StdRng) -> Vec<Contact> {
    let kinds: [fn(usize) -> ContactConstraint; 4] =
        [ContactConstraint::line, ContactConstraint::plane, ContactConstraint::point, ContactConstraint::rigid];
    let frames = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let contact = |(name, kind): (&str, fn(usize) -> ContactConstraint)| {
        let constraint = kind(model.frame(name).unwrap());
        let axes = if constraint.kind.rows() < 3 { rotation(rng) } else { constraint.axes };
        Contact::new(name, ContactConstraint { reference, axes, kp: 20.0, kd: 30.0, ..constraint })
    };
    frames.into_iter().zip(kinds).map(contact).collect()
}

/// Returns the equations of a knot as weighted costs. Comparisons of derivatives then include the equations.
fn equations(contacts: &[Contact], driven: bool) -> Vec<Cost> {
    let undriven = driven.then(|| Cost::new("undriven", 1e-3, Residual::UndrivenEffort, Activation::Quadratic));
    let holds = contacts.iter().map(|contact| {
        let residual = Residual::ContactAcceleration { contact: contact.name.clone() };
        Cost::new(&format!("{} moves", contact.name), 1e-3, residual, Activation::Quadratic)
    });
    undriven.into_iter().chain(holds).collect()
}

#[test]
fn derivatives_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(41);
    for reference in [ReferenceFrame::Local, ReferenceFrame::LocalWorldAligned] {
        for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
            let mut sets = vec![feet(&model, reference)];
            if model.name() == "quadruped" {
                sets.push(all_kinds(&model, reference, &mut rng));
            }
            for contacts in sets {
                let nu = model.nv() + contacts.iter().map(|c| c.constraint.kind.rows()).sum::<usize>();
                let mut costs = contact_costs(&model, &contacts, nu, &mut rng);
                costs.extend(equations(&contacts, true));
                let action = ContactInverseDynamics::running(model.clone(), &contacts, DT, costs.clone()).unwrap();
                assert_eq!(action.nu(), nu);
                let what = format!("{} {reference:?} {}", model.name(), contacts.len());
                check_derivatives(&what, action.clone(), &model, 5.0, &mut rng);
                check_gradient(&what, action, &model, 5.0, &mut rng);
                let inner =
                    ControlledContactAcceleration::new(model.clone(), Actuation::joints(&model), &contacts, costs);
                let action = Integrated::new(inner.unwrap(), Integrator::RungeKutta4, DT).unwrap();
                check_derivatives(&format!("{what}, Runge-Kutta"), action, &model, 0.3, &mut rng);
            }
        }
    }
}

/// Checks an arm with a motor at every joint, which has no undriven efforts. Without contacts, a knot equals a knot of
/// `FreeInverseDynamics`.
#[test]
fn derivatives_of_an_arm_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(42);
    let arm = Arc::new(robots::arm7());
    let tool = Contact::new("tool", ContactConstraint::point(arm.frame("tool").unwrap()));
    for contacts in [vec![], vec![tool]] {
        let effort = Residual::JointEffort { reference: random(7, 1.0, &mut rng) };
        let mut costs = equations(&contacts, false);
        costs.push(Cost::new("effort", 0.3, effort, Activation::Quadratic));
        costs.push(Cost::new("gravity", 0.1, Residual::ControlGravity, Activation::Quadratic));
        let action = ContactInverseDynamics::running(arm.clone(), &contacts, DT, costs.clone()).unwrap();
        if contacts.is_empty() {
            let mut free = FreeInverseDynamics::running(arm.clone(), DT, costs).unwrap();
            let (x, u, mut other) = (random_state(&arm, &mut rng), random(7, 1.0, &mut rng), action.clone());
            let (mut next, mut same) = (vec![0.0; 14], vec![0.0; 14]);
            let costs = [free.calc(0, &x, &u, &mut next), other.calc(0, &x, &u, &mut same)];
            assert!((costs[0] - costs[1]).abs() < ROUNDING * costs[0] && next == same);
        }
        check_derivatives(&format!("arm, {} contacts", contacts.len()), action, &arm, 1.0, &mut rng);
    }
}

fn outputs<M: ContinuousModel>(action: &mut Integrated<M>, x: &[f64], u: &[f64]) -> BTreeMap<String, Vec<f64>> {
    let mut all = BTreeMap::new();
    action.outputs(0, x, u, &mut |name, numbers| {
        all.insert(name.to_owned(), numbers.to_vec());
    });
    all
}

/// Returns the outputs of each knot of a trajectory.
fn outputs_of_all(problem: &mut Problem, xs: &[f64], us: &[f64]) -> Vec<BTreeMap<String, Vec<f64>>> {
    let (nx, horizon) = (problem.nx(), problem.horizon());
    let nu = us.len() / horizon;
    let of = |t: usize| {
        let mut all = BTreeMap::new();
        problem.outputs(t, &xs[t * nx..][..nx], &us[t * nu..][..nu], &mut |name, numbers| {
            all.insert(name.to_owned(), numbers.to_vec());
        });
        all
    };
    (0..horizon).map(of).collect()
}

/// Compares inverse dynamics with forward dynamics. Inverse dynamics receives the accelerations and forces that forward
/// dynamics computes from some controls. The next state and the costs must be the same, the efforts must equal the
/// controls, and the equations must hold. One actuation has one control for each joint; another actuation mixes all
/// coordinates.
#[test]
fn it_is_forward_dynamics_backwards() {
    let mut rng = StdRng::seed_from_u64(43);
    let model = Arc::new(robots::quadruped());
    let mixed = Actuation::matrix(&model, DMatrix::from_row_slice(18, 5, &random(90, 1.0, &mut rng))).unwrap();
    for drives in [Actuation::joints(&model), mixed] {
        for contacts in [feet(&model, ReferenceFrame::LocalWorldAligned), vec![]] {
            let nu = drives.nu();
            let mut costs = match contacts.is_empty() {
                true => vec![Cost::new("gravity", 1e-2, Residual::ControlGravity, Activation::Quadratic)],
                false => contact_costs(&model, &contacts, nu, &mut rng),
            };
            costs.retain(|cost| cost.name != "effort"); // this cost depends on the controls, which differ
            let forward =
                ContactAcceleration::new(model.clone(), drives.clone(), &contacts, 0.0, costs.clone()).unwrap();
            let mut forward = Integrated::new(forward, Integrator::SemiImplicitEuler, DT).unwrap();
            let inverse = ControlledContactAcceleration::new(model.clone(), drives.clone(), &contacts, costs).unwrap();
            let mut inverse = Integrated::new(inverse, Integrator::SemiImplicitEuler, DT).unwrap();
            let (x, u) = (random_state(&model, &mut rng), random(nu, 5.0, &mut rng));
            let found = outputs(&mut forward, &x, &u);
            let mut controls = found["acceleration"].clone();
            contacts.iter().for_each(|c| controls.extend(&found[&format!("force/{}", c.name)]));
            let same = outputs(&mut inverse, &x, &controls);
            for (name, numbers) in &found {
                let error = largest_difference(&same[name], numbers);
                assert!(error < BACK, "{name} is off by {error:e}");
            }
            let (mut next, mut back) = (vec![0.0; 37], vec![0.0; 37]);
            let cost = [forward.calc(0, &x, &u, &mut next), inverse.calc(0, &x, &controls, &mut back)];
            assert!((cost[0] - cost[1]).abs() < BACK * (1.0 + cost[0].abs()), "{cost:?}");
            assert!(largest_difference(&back, &next) < ROUNDING);
            // a violated equation increases the cost
            controls[2] += 1.0; // lifts the trunk
            assert!(inverse.calc(0, &x, &controls, &mut back) > cost[0] + 1.0);
        }
    }
}

/// Returns the state of the quadruped with bent knees.
pub(super) fn standing(model: &Model) -> Vec<f64> {
    let mut x = neutral(model);
    (0..4).for_each(|leg| (x[8 + 3 * leg], x[9 + 3 * leg]) = (0.7, -1.4));
    x.extend(vec![0.0; model.nv()]);
    x
}

/// Checks that quasi-static contact forces hold the robot still. The undriven efforts of the base are 0, and the joint
/// efforts equal the efforts of forward dynamics.
#[test]
fn forces_hold_the_robot_still() {
    let model = Arc::new(robots::quadruped());
    let point = |name: &&str| Contact::new(name, ContactConstraint::point(model.frame(name).unwrap()));
    let feet: Vec<_> = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].iter().map(point).collect();
    let mut knot = ContactInverseDynamics::running(model.clone(), &feet, DT, vec![]).unwrap();
    let x = standing(&model);
    let u = knot.quasi_static(&x);
    assert_eq!(u[..18], [0.0; 18]);
    let effort = outputs(&mut knot, &x, &u)["effort"].clone();
    assert!(effort[..6].iter().all(|x| x.abs() < 1e-10), "{effort:?}");
    let mut forward = ContactDynamics::running(model.clone(), &feet, DT, vec![]).unwrap();
    assert!(largest_difference(&effort[6..], &forward.quasi_static(&x)) < 1e-10);
    assert!(knot.calc(0, &x, &u, &mut [0.0; 37]) < 1e-18);
}

#[test]
fn knots_in_lanes_are_single_knots() {
    let mut rng = StdRng::seed_from_u64(44);
    let model = Arc::new(robots::quadruped());
    let contacts = all_kinds(&model, ReferenceFrame::Local, &mut rng);
    let nu = 18 + 12;
    let costs = contact_costs(&model, &contacts, nu, &mut rng);
    let mut action = ContactInverseDynamics::running(model.clone(), &contacts, DT, costs).unwrap();
    let knots: Vec<_> = (0..11).collect();
    let xs: Vec<_> = knots.iter().flat_map(|_| random_state(&model, &mut rng)).collect();
    let us = random(11 * nu, 3.0, &mut rng);
    let (mut next, mut costs) = (vec![0.0; xs.len()], vec![0.0; 11]);
    action.calc_group(&knots, &xs, &us, &mut next, &mut costs);
    let mut alone = vec![0.0; xs.len()];
    let single: Vec<_> =
        (0..11).map(|t| action.calc(t, &xs[37 * t..][..37], &us[nu * t..][..nu], &mut alone[37 * t..][..37])).collect();
    assert!(largest_difference(&costs, &single) < ROUNDING && largest_difference(&next, &alone) < ROUNDING);
}

/// Compares optima of a quadruped that moves its trunk over its feet. The costs include efforts, forces, accelerations
/// and a friction cone. FDDP solves the problem with forward dynamics, and the augmented Lagrangian with inverse
/// dynamics.
#[test]
fn forward_and_inverse_dynamics_have_one_optimum() {
    let model = Arc::new(robots::quadruped());
    let constraint = |name: &str| ContactConstraint {
        reference: ReferenceFrame::LocalWorldAligned,
        kd: 10.0,
        ..ContactConstraint::point(model.frame(name).unwrap())
    };
    let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let contacts = feet.map(|name| Contact::new(name, constraint(name)));
    let (x0, horizon, dt) = (standing(&model), 12, 0.02);
    let mut goal = x0.clone();
    let mut step = vec![0.0; 18];
    (step[0], step[2], step[4]) = (0.03, -0.04, 0.05);
    integrate(&model, &x0[..19], &step, &mut goal[..19]);
    let cone = FrictionCone::new(0.7);
    let (lower, upper) = cone.bounds();
    let running = || {
        let mut costs = vec![
            Cost::new("rest", 1.0, Residual::State { reference: goal.clone() }, Activation::Quadratic),
            Cost::new("effort", 1e-3, Residual::JointEffort { reference: vec![0.0; 18] }, Activation::Quadratic),
            Cost::new("smooth", 1e-3, Residual::JointAcceleration { reference: vec![0.0; 18] }, Activation::Quadratic),
        ];
        for foot in feet {
            let force = Residual::ContactForce { contact: foot.into(), target: condyle_dynamics::Force::zero() };
            costs.push(Cost::new(&format!("{foot} force"), 1e-4, force, Activation::Quadratic));
            let grip = Residual::FrictionCone { contact: foot.into(), cone: cone.clone() };
            let barrier = Activation::Barrier { lower: lower.clone(), upper: upper.clone() };
            costs.push(Cost::new(&format!("{foot} grip"), 1.0, grip, barrier));
        }
        costs
    };
    let end = || {
        let there = Residual::State { reference: goal.clone() };
        FreeDynamics::terminal(model.clone(), vec![Cost::new("there", 1e2, there, Activation::Quadratic)]).unwrap()
    };
    let mut knot = ContactDynamics::running(model.clone(), &contacts, dt, running()).unwrap();
    let us = knot.quasi_static(&x0).repeat(horizon);
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; horizon], Box::new(end())).unwrap();
    let mut solver = Fddp::new(&problem);
    solver.settings = Settings { tolerance: 1e-14, ..Settings::default() };
    let forward = solver.solve(&mut problem, &x0.repeat(horizon + 1), &us).unwrap().clone();
    assert_eq!(forward.status, Status::Converged);
    let solved = outputs_of_all(&mut problem, &forward.xs, &forward.us);

    let mut knot = ContactInverseDynamics::running(model.clone(), &contacts, dt, running()).unwrap();
    let us = knot.quasi_static(&x0).repeat(horizon);
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; horizon], Box::new(end())).unwrap();
    let mut solver = AugmentedLagrangian::new(&problem);
    solver.settings = ConstraintSettings { tolerance: HELD, tolerance_dual: HELD, ..ConstraintSettings::default() };
    let inverse = solver.solve(&mut problem, &x0.repeat(horizon + 1), &us).unwrap().clone();
    let outcome = solver.outcome();
    println!(
        "forward: cost {}, {} iterations; inverse: {:?}, cost {}, primal {:e}, dual {:e}, {} solves, {} iterations",
        forward.cost,
        forward.trace.len(),
        inverse.status,
        outcome.cost,
        outcome.primal,
        outcome.dual,
        outcome.solves,
        outcome.iterations
    );
    assert_eq!(inverse.status, Status::Converged);
    assert!((outcome.cost - forward.cost).abs() < 1e-6 * forward.cost, "{} and {}", outcome.cost, forward.cost);
    assert!(largest_difference(&inverse.xs, &forward.xs) < 1e-5);
    let found = outputs_of_all(&mut problem, &inverse.xs, &inverse.us);
    for (t, (found, solved)) in found.iter().zip(&solved).enumerate() {
        for (name, numbers) in solved {
            let error = largest_difference(&found[name], numbers);
            assert!(error < FORCES, "{name} of knot {t} is off by {error:e}");
        }
    }
}

/// Checks that inverse dynamics supports redundant contacts. The contacts share the forces in such proportions that the
/// efforts are smallest.
#[test]
fn contacts_may_be_redundant() {
    let model = Arc::new(robots::humanoid());
    let foot =
        |name: &str, kind: fn(usize) -> ContactConstraint| Contact::new(name, kind(model.frame("left_foot").unwrap()));
    let twice = [foot("sole", ContactConstraint::rigid), foot("point", ContactConstraint::point)];
    assert!(ContactDynamics::running(model.clone(), &twice, DT, vec![]).is_err());
    let mut knot = ContactInverseDynamics::running(model.clone(), &twice, DT, vec![]).unwrap();
    let x = [neutral(&model), vec![0.0; model.nv()]].concat();
    let u = knot.quasi_static(&x);
    let (sole, point) = u[model.nv()..].split_at(6);
    assert!(largest_difference(&sole[..3], point) < 1e-8 && point[2] > 1.0); // each contact carries half of the force
}

#[test]
fn what_does_not_fit_is_refused() {
    let model = Arc::new(robots::quadruped());
    let contacts = feet(&model, ReferenceFrame::Local);
    let cost = |residual| vec![Cost::new("r", 1.0, residual, Activation::Quadratic)];
    let moves = || Residual::ContactAcceleration { contact: "LF_foot".into() };
    let forward = |residual| ContactDynamics::running(model.clone(), &contacts, DT, cost(residual));
    assert_eq!(
        forward(moves()).unwrap_err().to_string(),
        "cost `r`: its contact holds at this knot; contacts accelerate where accelerations are controls"
    );
    let driven = "cost `r`: all efforts of this knot are those of drives";
    assert_eq!(forward(Residual::UndrivenEffort).unwrap_err().to_string(), driven);
    let arm = Arc::new(robots::arm7());
    let arm = FreeInverseDynamics::running(arm, DT, cost(Residual::UndrivenEffort));
    assert_eq!(arm.unwrap_err().to_string(), driven);
    let end = FreeDynamics::terminal(model.clone(), cost(Residual::UndrivenEffort));
    assert_eq!(end.unwrap_err().to_string(), "cost `r`: there is no effort at this knot");
    let inverse = |contacts: &[Contact]| ContactInverseDynamics::running(model.clone(), contacts, DT, vec![]);
    let same = [contacts[0].clone(), contacts[0].clone()];
    assert_eq!(inverse(&same).unwrap_err().to_string(), "contact `LF_foot`: another contact has this name");
    let again = Limit::equality("contact LF_foot", moves());
    let error = inverse(&contacts).unwrap().with_limits(vec![again]).unwrap_err().to_string();
    assert_eq!(error, "limit `contact LF_foot`: another limit has this name");
    let other = Actuation::joints(&robots::humanoid());
    assert!(ControlledContactAcceleration::new(model.clone(), other, &contacts, vec![]).is_err());
    let point = Residual::FrameTranslation { frame: "LF_foot".into(), target: Vec3::zero() };
    let knot = inverse(&contacts).unwrap().with_limits(vec![Limit::equality("point", point)]);
    assert!(knot.is_ok());
}
