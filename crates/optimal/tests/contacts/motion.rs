//! Accelerations, efforts and contact forces of a solution, which must satisfy the equations of motion in the
//! documented frames.

use super::*;
use condyle_dynamics::{
    ConstraintSet, ProximalSettings, aba, constrained_dynamics, crba, frame_jacobian, impulse_dynamics, rnea,
};
use condyle_optimal::robot::{
    ContactInverseDynamics, ContinuousModel, ControlPolynomial, Derivatives, KnotInput, KnotMotion,
};
use condyle_optimal::{Constrained, PathConstraint};
use nalgebra::DVector;

/// Tolerance of the equation of motion after a factorisation, with forces of a few hundred newtons.
const BALANCE: f64 = 1e-8;

/// Path constraint without rows.
struct Nothing;

impl PathConstraint for Nothing {
    fn size(&self) -> usize {
        0
    }
    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&[], &[])
    }
    fn calc(&mut self, _: usize, _: &[f64], _: &[f64], _: &mut [f64]) {}
}

/// Creates a problem with one knot and a terminal action.
fn single(knot: Box<dyn ActionModel>, model: &Arc<Model>, x: &[f64]) -> Problem {
    let end = FreeDynamics::terminal(model.clone(), vec![]).unwrap();
    Problem::new(x.to_vec(), vec![knot], vec![0], Box::new(end)).unwrap()
}

/// Computes Σ Jᵀ f from the contact forces along the world's axes at the origins of the frames. Also checks that the
/// local forces are the same vectors.
fn generalised(model: &Model, q: &[f64], motion: &KnotMotion) -> DVector<f64> {
    let (mut data, mut sum) = (Data::new(model), DVector::zeros(model.nv()));
    for contact in &motion.contacts {
        let R = forward_kinematics(model, &mut data, q).frame(contact.frame).rotation;
        for (reference, force) in
            [(ReferenceFrame::LocalWorldAligned, contact.force), (ReferenceFrame::Local, contact.local)]
        {
            let mut J = DMatrix::zeros(6, model.nv());
            frame_jacobian(model, q, contact.frame, reference, &mut J);
            let f = DVector::from_row_slice(&force.to_array());
            sum += 0.5 * J.transpose() * f;
        }
        let (there, here) = (R * contact.local.linear, contact.force.linear);
        assert!(largest_difference(&there.to_array(), &here.to_array()) < ROUNDING);
        let (there, here) = (R * contact.local.angular, contact.force.angular);
        assert!(largest_difference(&there.to_array(), &here.to_array()) < ROUNDING);
    }
    sum
}

/// Returns contacts of all kinds, with rows along the axes of the frame or of the world.
fn kinds(model: &Model, rng: &mut StdRng) -> Vec<Contact> {
    let names: [&str; 4] = match model.name() {
        "quadruped" => ["LF_foot", "RF_foot", "LH_foot", "RH_foot"],
        _ => ["left_foot", "right_foot", "left_foot", "right_foot"],
    };
    let make = [
        ContactConstraint::rigid as fn(usize) -> ContactConstraint,
        ContactConstraint::point,
        ContactConstraint::line,
        ContactConstraint::plane,
    ];
    let count = if model.name() == "quadruped" { 4 } else { 2 };
    let contact = |k: usize| {
        let reference = [ReferenceFrame::Local, ReferenceFrame::LocalWorldAligned][k % 2];
        let mut constraint = make[k](model.frame(names[k]).unwrap());
        (constraint.reference, constraint.kd) = (reference, 20.0);
        if k > 1 {
            constraint.axes = rotation(rng);
        }
        Contact::new(&format!("contact {k}"), constraint)
    };
    (0..count).map(contact).collect()
}

#[test]
fn motion_of_an_arm_is_that_of_its_dynamics() {
    let (mut rng, arm) = (StdRng::seed_from_u64(41), Arc::new(robots::arm7()));
    let (x, u) = (random_state(&arm, &mut rng), random(7, 5.0, &mut rng));
    let (mut data, (q, v)) = (Data::new(&arm), x.split_at(7));
    let a = aba(&arm, &mut data, q, v, &u, &[]).to_vec();
    let inner = || FreeAcceleration::new(arm.clone(), Actuation::joints(&arm), vec![]).unwrap();
    let euler = || Integrated::new(inner(), Integrator::SemiImplicitEuler, DT).unwrap();
    let wrapped = Constrained::new(Box::new(euler()), Box::new(Nothing));
    let twice = Constrained::new(Box::new(wrapped), Box::new(Nothing));
    let runge_kutta = Integrated::new(inner(), Integrator::RungeKutta4, DT).unwrap();
    let linear = euler().with_controls(ControlPolynomial::Linear);
    for (knot, repeat) in
        [(Box::new(twice) as Box<dyn ActionModel>, 1), (Box::new(runge_kutta), 1), (Box::new(linear), 2)]
    {
        let motion = single(knot, &arm, &x).motion_at(0, &x, &u.repeat(repeat)).unwrap();
        assert!(largest_difference(&motion.acceleration, &a) < ROUNDING);
        assert_eq!(motion.effort, u);
        assert!(motion.contacts.is_empty() && !motion.is_impact() && motion.contact("none").is_none());
    }
    // with accelerations as controls, the motion is the same
    let knot = FreeInverseDynamics::running(arm.clone(), DT, vec![]).unwrap();
    let motion = single(Box::new(knot), &arm, &x).motion_at(0, &x, &a).unwrap();
    assert_eq!(motion.acceleration, a);
    assert!(largest_difference(&motion.effort, &u) < SAME);
    // a terminal knot and an action without a robot have no motion
    assert_eq!(single(Box::new(euler()), &arm, &x).motion_at(1, &x, &[]), None);
    assert_eq!(no_robot().motion_at(0, &[1.0, 2.0, 3.0], &[0.0; 2]), None);
}

fn no_robot() -> Problem {
    let unicycle = condyle_optimal::Unicycle::default();
    let end = Box::new(unicycle.clone().terminal());
    Problem::new(vec![0.0; 3], vec![Box::new(unicycle)], vec![0; 2], end).unwrap()
}

/// User-defined dynamics of a mass with one coordinate: q̈ = u.
struct Mass {
    zero: DMatrix<f64>,
}

impl ContinuousModel for Mass {
    fn nq(&self) -> usize {
        1
    }
    fn nv(&self) -> usize {
        1
    }
    fn nu(&self) -> usize {
        1
    }
    fn calc(&mut self, input: KnotInput<'_>) -> (&[f64], f64) {
        self.zero[0] = 2.0 * input.u[0];
        (self.zero.as_slice(), 0.0)
    }
    fn calc_diff(&mut self, _: KnotInput<'_>, _: f64, _: &mut LqKnot) -> Derivatives<'_> {
        unreachable!("it is not differentiated")
    }
}

#[test]
fn dynamics_of_a_user_have_accelerations_alone() {
    let mass = || Mass { zero: DMatrix::zeros(1, 1) };
    let knot = Integrated::new(mass(), Integrator::SemiImplicitEuler, DT).unwrap();
    let end = Box::new(condyle_optimal::Lqr::new(LqKnot::zeros(2, 0)));
    let mut problem = Problem::new(vec![0.0; 2], vec![Box::new(knot)], vec![0], end).unwrap();
    let motion = problem.motion_at(0, &[0.0; 2], &[3.0]).unwrap();
    assert_eq!((&motion.acceleration[..], &motion.effort[..]), (&[6.0][..], &[][..]));
}

#[test]
fn forces_of_contacts_balance_the_robot() {
    let mut rng = StdRng::seed_from_u64(42);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let (nq, nv, contacts) = (model.nq(), model.nv(), kinds(&model, &mut rng));
        let (x, u) = (random_state(&model, &mut rng), random(nv - 6, 5.0, &mut rng));
        let ((q, v), mut data) = (x.split_at(nq), Data::new(&model));
        let constraints: Vec<_> = contacts.iter().map(|contact| contact.constraint).collect();
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        set.proximal = ProximalSettings { mu: 0.0, iterations: 1 };
        let tau = [vec![0.0; 6], u.clone()].concat();
        let by_hand = constrained_dynamics(&model, &mut data, &mut set, q, v, &tau, &[]);
        let (a, lambda) = (by_hand.a.to_vec(), by_hand.lambda.to_vec());
        let knot = ContactDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap();
        let mut forward = single(Box::new(knot), &model, &x);
        let motion = forward.motion_at(0, &x, &u).unwrap();
        assert!(largest_difference(&motion.acceleration, &a) < SAME);
        assert_eq!(motion.effort, tau);
        let names: Vec<_> = motion.contacts.iter().map(|contact| &*contact.name).collect();
        assert_eq!(names, contacts.iter().map(|contact| &*contact.name).collect::<Vec<_>>());
        assert_eq!(motion.contact("contact 1").unwrap().frame, contacts[1].constraint.frame);
        // equation of motion: M q̈ + h = τ + Σ Jᵀ f
        let needed = DVector::from_row_slice(rnea(&model, &mut data, q, v, &motion.acceleration, &[]));
        let found = DVector::from_row_slice(&tau) + generalised(&model, q, &motion);
        assert!(largest_difference(found.as_slice(), needed.as_slice()) < BALANCE);
        // with accelerations and forces as controls, the efforts and forces are the same
        let knot = ContactInverseDynamics::running(model.clone(), &contacts, DT, vec![]).unwrap();
        let mut inverse = single(Box::new(knot), &model, &x);
        let again = inverse.motion_at(0, &x, &[a, lambda].concat()).unwrap();
        assert!(largest_difference(&again.effort, &tau) < BALANCE);
        for (one, other) in again.contacts.iter().zip(&motion.contacts) {
            assert!(largest_difference(&one.force.to_array(), &other.force.to_array()) < SAME);
        }
    }
}

#[test]
fn impulses_change_velocities() {
    let mut rng = StdRng::seed_from_u64(43);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let (nq, contacts, x) = (model.nq(), kinds(&model, &mut rng), random_state(&model, &mut rng));
        let ((q, v), mut data) = (x.split_at(nq), Data::new(&model));
        let constraints: Vec<_> = contacts.iter().map(|contact| contact.constraint).collect();
        let mut set = ConstraintSet::new(&model, &constraints).unwrap();
        set.proximal = ProximalSettings { mu: 0.0, iterations: 1 };
        let after = impulse_dynamics(&model, &mut data, &mut set, q, v, 0.2).v.to_vec();
        let change: Vec<_> = after.iter().zip(v).map(|(after, before)| after - before).collect();
        let impact = ImpulseDynamics::instant(model.clone(), &contacts, 0.2, 0.0, vec![]).unwrap();
        let motion = single(Box::new(impact.clone()), &model, &x).motion_at(0, &x, &[]).unwrap();
        assert!(motion.is_impact() && motion.acceleration.is_empty() && motion.effort.is_empty());
        assert!(largest_difference(&motion.velocity_change, &change) < SAME);
        // equation of the impact: M (v⁺ − v) = Σ Jᵀ Λ
        let M = DMatrix::from_column_slice(v.len(), v.len(), crba(&model, &mut data, q).as_slice());
        let needed = M.symmetric_part() * DVector::from_row_slice(&motion.velocity_change);
        let found = generalised(&model, q, &motion);
        assert!(largest_difference(found.as_slice(), needed.as_slice()) < BALANCE);
        // an impact may be the terminal knot
        let knot = FreeDynamics::running(model.clone(), DT, vec![]).unwrap();
        let mut problem = Problem::new(x.clone(), vec![Box::new(knot)], vec![0], Box::new(impact)).unwrap();
        assert_eq!(problem.motion_at(1, &x, &[]).unwrap(), motion);
    }
}

/// Checks the motions in a solution of a trot. Each knot has contacts at the standing feet, whose forces carry the
/// robot.
#[test]
fn a_solution_of_a_trot_has_forces_at_the_feet_that_stand() {
    let model = Arc::new(robots::quadruped());
    let foot = |name: &str| {
        let constraint = ContactConstraint {
            kd: 30.0,
            reference: ReferenceFrame::LocalWorldAligned,
            ..ContactConstraint::point(model.frame(name).unwrap())
        };
        Contact::new(name, constraint)
    };
    let pairs = [["LF_foot", "RH_foot"], ["RF_foot", "LH_foot"]];
    let x0 = inverse::standing(&model);
    let costs = || {
        vec![
            Cost::new("rest", 1.0, Residual::State { reference: x0.clone() }, Activation::Quadratic),
            Cost::new("effort", 1e-4, Residual::Control { reference: vec![0.0; 12] }, Activation::Quadratic),
        ]
    };
    let stand = |pair: [&str; 2]| -> Box<dyn ActionModel> {
        Box::new(ContactDynamics::running(model.clone(), &pair.map(foot), DT, costs()).unwrap())
    };
    let touch = ImpulseDynamics::instant(model.clone(), &pairs[1].map(foot), 0.0, 1e-9, vec![]).unwrap();
    let models = vec![stand(pairs[0]), Box::new(touch) as Box<dyn ActionModel>, stand(pairs[1])];
    let end = Box::new(FreeDynamics::terminal(model.clone(), costs().drain(..1).collect()).unwrap());
    let knot_models = vec![0, 0, 0, 0, 1, 2, 2, 2];
    let mut problem = Problem::new(x0.clone(), models, knot_models.clone(), end).unwrap();
    let xs = x0.repeat(9);
    let us = problem.quasi_static(&xs).unwrap();
    let solution = Fddp::new(&problem).solve(&mut problem, &xs, &us).unwrap().clone();
    for (t, stage) in knot_models.iter().enumerate() {
        let motion = problem.motion(&solution, t).unwrap();
        let names: Vec<_> = motion.contacts.iter().map(|contact| &*contact.name).collect();
        assert_eq!(names, if *stage == 0 { pairs[0] } else { pairs[1] });
        assert_eq!(motion.is_impact(), *stage == 1);
        if *stage == 1 {
            continue;
        }
        assert_eq!(motion.effort[6..], *solution.u(t));
        let x = solution.x(t);
        let mut data = Data::new(&model);
        let needed = rnea(&model, &mut data, &x[..19], &x[19..], &motion.acceleration, &[]).to_vec();
        let found = DVector::from_row_slice(&motion.effort) + generalised(&model, &x[..19], &motion);
        assert!(largest_difference(found.as_slice(), &needed) < BALANCE);
    }
    assert_eq!(problem.motion(&solution, 8), None);
}
