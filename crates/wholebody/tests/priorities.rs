//! Tests that later priorities do not change the results of earlier priorities.
#![allow(non_snake_case)]

mod common;

use common::*;
use condyle_dynamics::{Vec3, robots};
use condyle_wholebody::{Axes, Backend, Formulation, Gains, Settings, Task, TaskKind, WholeBodyController};

/// Tolerance of q̈, relative to 1 plus the largest entry of q̈. Only the regularisation determines some directions of
/// q̈. So the tolerance is slightly above the square root of the solver's tolerance of 1e-11.
const AGREEMENT: f64 = 1e-5;

/// Checks two tasks that contradict each other: the trunk's height and the centre of mass. The order of their
/// priorities decides, not their weights.
#[test]
fn order_beats_weight() {
    let model = robots::quadruped();
    let (q, v, contacts) = (stance(), vec![0.0; 18], feet(0.7));
    let missed = |com: usize, trunk: usize, weight: f64| {
        let tasks = [
            Task { priority: com, ..Task::com() },
            Task { priority: trunk, weight, ..Task::position("trunk") },
            Task { priority: 1, ..Task::posture() },
        ];
        let mut controller = WholeBodyController::new(&model, &contacts, &tasks, Settings::default()).unwrap();
        let mut references = controller.hold(&q).unwrap();
        references.com.acceleration.z = 1.0;
        references.frames[0].acceleration.linear.z = -1.0;
        let command = controller.step(&q, &v, &references);
        check(&model, &contacts, &q, &v, &references, command);
        (command.com_acceleration.z - 1.0).abs()
    };
    let alone = missed(0, 1, 0.0);
    assert!(alone < 0.01, "{alone}"); // only the regularisation causes this error
    let (strict, weighted) = (missed(0, 1, 1e4), missed(0, 0, 1e4));
    assert!(strict < alone + 1e-5, "{strict} {alone}");
    assert!(weighted > 1.0, "with weights it yields: {weighted}");
    assert!(missed(1, 0, 10.0) > 1.0);
}

/// Checks a first priority at the limit of friction, which leaves no freedom to the next priority. The program of the
/// next priority must be solved nevertheless.
#[test]
fn a_first_priority_at_its_limit() {
    let model = robots::humanoid();
    let (q, v, contacts) = (squat(&model), vec![0.0; 38], soles(0.2));
    let tasks = |later: usize| {
        vec![
            Task::com(),
            Task { priority: later, ..Task::orientation("pelvis") },
            Task { priority: 2 * later, ..Task::posture() },
        ]
    };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks(1), Settings::default()).unwrap();
    let mut references = controller.hold(&q).unwrap();
    references.com.acceleration = Vec3::new(1.0, 4.0, 0.0);
    let command = controller.step(&q, &v, &references).solved().unwrap().clone();
    assert!(command.violation < 1e-4, "within what the rows are widened by, and the reduced tolerance");
    let mut alone = WholeBodyController::new(&model, &contacts, &[Task::com()], Settings::default()).unwrap();
    let first = alone.step(&q, &v, &references_without_frames(&references)).com_acceleration;
    assert!(norm(first - command.com_acceleration) < 1e-3, "{first:?} {:?}", command.com_acceleration);
}

fn references_without_frames(references: &condyle_wholebody::References) -> condyle_wholebody::References {
    condyle_wholebody::References { frames: Vec::new(), ..references.clone() }
}

/// Checks that all forms of a program with three priorities give the same commands with both back ends.
#[test]
fn forms_agree_on_priorities() {
    let (humanoid, quadruped) = (robots::humanoid(), robots::quadruped());
    let of_quadruped =
        vec![Task::com(), Task { priority: 1, ..Task::orientation("trunk") }, Task { priority: 2, ..Task::posture() }];
    let of_humanoid = vec![
        Task { gains: Gains::critical(40.0), ..Task::com() },
        Task { priority: 1, ..Task::orientation("pelvis") },
        Task { priority: 1, ..Task::angular_momentum() },
        Task { priority: 2, ..Task::posture() },
    ];
    for (model, contacts, tasks, centre, push) in [
        (&quadruped, feet(0.7), of_quadruped, stance(), 0.5),
        (&humanoid, soles(0.7), of_humanoid, squat(&humanoid), 0.3),
    ] {
        for seed in 0..3 {
            let (q, v) = near(model, &centre, seed, 0.02, 0.1);
            let command = |backend, formulation| {
                let settings =
                    Settings { formulation, backend, tolerance: 1e-11, force_weight: 1e-5, ..Settings::default() };
                let mut controller = WholeBodyController::new(model, &contacts, &tasks, settings).unwrap();
                let mut references = controller.hold(&q).unwrap();
                references.com.acceleration.x = push;
                let command = controller.step(&q, &v, &references).clone();
                check(model, &contacts, &q, &v, &references, &command);
                command
            };
            let reference = command(Backend::InteriorPoint, Formulation::Condensed);
            for (backend, formulation) in [
                (Backend::InteriorPoint, Formulation::Full),
                (Backend::Clarabel, Formulation::Condensed),
                (Backend::Clarabel, Formulation::Full),
            ] {
                let found = command(backend, formulation);
                let apart = max_abs(found.a.iter().zip(&reference.a).map(|(a, b)| a - b));
                let bound = AGREEMENT * (1.0 + max_abs(reference.a.iter().copied()));
                assert!(
                    apart < bound,
                    "push {push}, seed {seed}, {backend:?}, {formulation:?}: {apart:.1e} of {bound:.1e}"
                );
            }
        }
    }
}

/// Checks a task for one axis of the hand's position, along the hand's own axes and along other axes.
#[test]
fn masks_and_axes() {
    let model = robots::humanoid();
    let (q, v, contacts) = (squat(&model), vec![0.0; 38], soles(0.7));
    let only_x = [true, false, false, false, false, false];
    for axes in [Axes::World, Axes::Local, Axes::Frame("right_palm".to_owned())] {
        let reach = Task { mask: only_x, axes: axes.clone(), weight: 1e4, ..Task::position("left_hand") };
        let tasks = [humanoid_tasks(), vec![reach]].concat();
        let mut q = q.clone();
        (29..36).for_each(|i| q[i] += 0.2);
        let mut controller = WholeBodyController::new(&model, &contacts, &tasks, Settings::default()).unwrap();
        let mut references = controller.hold(&q).unwrap();
        references.frames[1].acceleration.linear = Vec3::new(1.0, 2.0, 3.0);
        let command = controller.step(&q, &v, &references);
        check(&model, &contacts, &q, &v, &references, command);
        let hand = condyle_wholebody::FrictionContact::point("left_hand", 1.0);
        let (a, _) = accelerations(&model, &[hand], &q, &v, &command.a);
        let x = match &axes {
            Axes::World => Vec3::new(1.0, 0.0, 0.0),
            Axes::Local => orientation(&model, &q, "left_hand").x,
            Axes::Frame(frame) => orientation(&model, &q, frame).x,
            other => panic!("{other:?} is not tested here"),
        };
        let error = a[0] - Vec3::new(1.0, 2.0, 3.0);
        assert!(error.dot(x).abs() < 0.01, "{axes:?}: {error:?}");
        assert!(norm(error) > 0.5, "the other axes are left alone");
    }
}

/// Checks tasks for angular momentum, velocities and forces.
#[test]
fn momentum_velocity_and_force() {
    let model = robots::humanoid();
    let (q, v, contacts) = (squat(&model), vec![0.0; 38], soles(0.7));
    let gains = Gains { stiffness: 1e9, damping: 10.0 }; // the task of a velocity must ignore the stiffness
    let tasks = [
        Task::com(),
        Task { weight: 100.0, ..Task::angular_momentum() },
        Task { gains, weight: 100.0, mask: [true, true, true, false, false, false], ..Task::velocity("left_hand") },
        Task { weight: 1.0, mask: [false, false, true, false, false, false], ..Task::contact_force("left_sole") },
        Task { weight: 0.01, ..Task::posture() },
    ];
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks, Settings::default()).unwrap();
    let mut references = controller.hold(&q).unwrap();
    references.momentum.rate = Vec3::new(1.0, 2.0, 0.5);
    references.frames[0].velocity.linear = Vec3::new(0.0, 0.1, 0.0);
    references.frames[0].pose.translation = Vec3::zero();
    references.contacts[0].force.linear.z = 350.0;
    let command = controller.step(&q, &v, &references);
    check(&model, &contacts, &q, &v, &references, command);
    assert!((command.forces[0].linear.z - 350.0).abs() < 0.5, "{:?}", command.forces[0]);
    let hand = condyle_wholebody::FrictionContact::point("left_hand", 1.0);
    let (a, _) = accelerations(&model, &[hand], &q, &v, &command.a);
    assert!(norm(a[0] - Vec3::new(0.0, 1.0, 0.0)) < 0.1, "{:?}", a[0]);
    // The time derivative of the angular momentum is the moment of all forces about the centre of mass.
    let com = controller.hold(&q).unwrap().com.position;
    let command = controller.step(&q, &v, &references);
    let mut rate = Vec3::zero();
    for (contact, &f) in contacts.iter().zip(&command.forces) {
        let p = position(&model, &q, &contact.frame);
        rate += f.angular + (p - com).cross(f.linear);
    }
    assert!(norm(rate - references.momentum.rate) < 0.1, "{rate:?}");
    assert_eq!(tasks[1].kind, TaskKind::AngularMomentum);
}
