//! Tests that every step gives a status, and a command that is finite and within the torque limits.
#![allow(non_snake_case)]

#[path = "safety/clones.rs"]
mod clones;
mod common;
#[path = "safety/invalid.rs"]
mod invalid;

use common::*;
use condyle_dynamics::{Data, gravity, integrate, robots};
use condyle_wholebody::{
    Backend, Command, CommandSource, FrictionContact, JointLimits, Settings, Status, Task, WholeBodyController,
};

/// Checks that a command is finite, and within the effort limits without any tolerance.
fn is_safe(command: &Command, effort: &[f64]) {
    let numbers = command.tau.iter().chain(&command.a).copied();
    let forces = command.forces.iter().flat_map(|f| f.to_array());
    assert!(numbers.chain(forces).chain(command.com_acceleration.to_array()).all(f64::is_finite));
    for (tau, limit) in command.tau.iter().zip(effort).skip(6) {
        assert!(tau.abs() <= *limit, "{tau} of {limit}");
    }
    assert_eq!(command.tau[..6], [0.0; 6]);
}

#[test]
fn the_last_solution_then_gravity_compensation() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let effort = model.limits().effort();
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&q).unwrap();
    let good = controller.step(&q, &v, &references).solved().unwrap().clone();
    let mut bad = references.clone();
    bad.com.position.x = f64::NAN;
    for tick in 0..20 {
        let command = controller.step(&q, &v, &bad);
        is_safe(command, &effort);
        assert_eq!(command.status.to_string(), "`com[0]` is NaN, which is not finite");
        if tick < Settings::default().hold_ticks {
            assert_eq!((command.source, &command.tau), (CommandSource::LastSolution, &good.tau));
        } else {
            assert_eq!(command.source, CommandSource::GravityCompensation);
            // Four feet carry the robot. Only the torques of internal forces may differ.
            let apart = max_abs(command.tau.iter().zip(&good.tau).map(|(a, b)| a - b));
            assert!(apart < 2.0, "{apart} N m");
        }
    }
    let again = controller.step(&q, &v, &references).solved().unwrap();
    assert!(max_abs(again.tau.iter().zip(&good.tau).map(|(a, b)| a - b)) < 1e-2, "nothing of it stays behind");
}

#[test]
fn a_state_that_is_not_finite() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let effort = model.limits().effort();
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&q).unwrap();
    let (mut no_q, mut no_v) = (q.clone(), v.clone());
    (no_q[8], no_v[3]) = (f64::NAN, f64::INFINITY);
    for tick in 0..20 {
        // Before tick 10, all states were invalid, and no solution is stored.
        let command = controller.step(&no_q, &v, &references);
        is_safe(command, &effort);
        assert_eq!(command.status.to_string(), "`q[8]` is NaN, which is not finite");
        let command = controller.step(&q, &no_v, &references);
        is_safe(command, &effort);
        assert_eq!(command.status, Status::NotFinite { name: "v", index: 3, value: f64::INFINITY });
        if tick == 10 {
            controller.step(&q, &v, &references).solved().unwrap();
        }
    }
}

/// Checks commands in random states with impossible requirements, and with solvers that stop early.
#[test]
fn nothing_breaks_the_limits() {
    let model = robots::humanoid();
    let effort = model.limits().effort();
    let heavy: Vec<_> = soles(0.7).into_iter().map(|c| FrictionContact { min_force: 5000.0, ..c }).collect();
    for (contacts, max_iterations) in [(heavy, 50), (soles(0.7), 2), (soles(0.7), 6), (soles(0.05), 50)] {
        let settings = Settings { max_iterations, hold_ticks: 1, ..Settings::default() };
        let mut controller = WholeBodyController::new(&model, &contacts, &humanoid_tasks(), settings).unwrap();
        let references = controller.hold(&squat(&model)).unwrap();
        for seed in 0..30 {
            let (q, v) = near(&model, &squat(&model), seed, 0.3, 5.0);
            let command = controller.step(&q, &v, &references);
            is_safe(command, &effort);
            assert!(command.status != Status::Solved || command.source == CommandSource::Solution);
            assert!(contacts[0].min_force == 0.0 || command.status != Status::Solved, "5000 N on each foot");
            assert!(max_iterations > 2 || command.status == Status::IterationLimit, "{:?}", command.status);
        }
    }
}

/// Checks that each back end returns the status of a time limit if the limit is almost zero.
#[test]
fn too_slow_is_a_status() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let effort = model.limits().effort();
    for backend in [Backend::InteriorPoint, Backend::Clarabel] {
        let settings = Settings { backend, time_limit: 1e-12, ..Settings::default() };
        let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks(), settings).unwrap();
        let references = controller.hold(&q).unwrap();
        for _ in 0..10 {
            let command = controller.step(&q, &v, &references);
            is_safe(command, &effort);
            assert_eq!(command.status, Status::TimeLimit, "{backend:?}");
        }
    }
}

/// Checks that gravity compensation in the air consists of the torques of gravity.
#[test]
fn compensation_without_contacts() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &[]);
    let references = controller.hold(&stance()).unwrap();
    let mut bad = references.clone();
    bad.momentum.rate.y = f64::INFINITY;
    let command = controller.step(&stance(), &[0.0; 18], &bad);
    let (mut data, zero) = (Data::new(&model), [0.0; 6]);
    let g = gravity(&model, &mut data, &stance());
    assert_eq!((&command.tau[..6], &command.tau[6..]), (&zero[..], &g[6..]));
}

/// Simulates a free fall with moving targets. Joints beyond their limits must be led back, and the other joints must
/// stay within their limits.
#[test]
fn joints_stay_within_their_limits() {
    let model = robots::quadruped();
    let limits = JointLimits::default();
    let mut lower = vec![f64::NEG_INFINITY; 19];
    let mut upper = vec![f64::INFINITY; 19];
    let velocity = vec![5.0; 18];
    for i in 7..19 {
        (lower[i], upper[i]) = (stance()[i] - 0.3, stance()[i] + 0.3);
    }
    let limits =
        JointLimits { lower: Some(lower.clone()), upper: Some(upper.clone()), velocity: Some(velocity), ..limits };
    let settings = Settings { joint_limits: Some(limits), effort: Some(vec![500.0; 18]), ..Settings::default() };
    let tasks = [Task { weight: 1.0, ..Task::posture() }];
    for beyond in [false, true] {
        let mut controller = WholeBodyController::new(&model, &[], &tasks, settings.clone()).unwrap();
        let (mut q, mut v) = (stance(), vec![0.0; 18]);
        let mut references = controller.hold(&q).unwrap();
        for i in 7..19 {
            references.posture.q[i] += if i % 2 == 0 { 1.0 } else { -1.0 }; // a target far outside of the limits
            if beyond {
                q[i] += if i % 2 == 0 { 0.35 } else { -0.35 };
                v[i - 1] = if i % 2 == 0 { 4.0 } else { -4.0 };
            }
        }
        for tick in 0..1000 {
            let command = controller.step(&q, &v, &references).solved().unwrap_or_else(|s| panic!("{tick}: {s}"));
            assert!(!command.limits_relaxed);
            assert!(command.a[6..].iter().all(|a| a.abs() < 201.0 || !beyond), "led back at a bounded acceleration");
            let step: Vec<f64> = v.iter().zip(&command.a).map(|(v, a)| 1e-3 * (v + 0.5e-3 * a)).collect();
            v.iter_mut().zip(&command.a).for_each(|(v, a)| *v += 1e-3 * a);
            let mut next = q.clone();
            integrate(&model, &q, &step, &mut next);
            q = next;
            assert!(beyond || v[6..].iter().all(|v| v.abs() < 5.0 + 1e-6));
            // After 0.5 s, the distance of a joint from its limit is at most a fifth of the initial distance. A joint
            // that started within its limits never leaves them.
            for i in 7..19 {
                let out = (q[i] - upper[i]).max(lower[i] - q[i]);
                assert!(
                    out < if !beyond {
                        1e-4
                    } else if tick > 500 {
                        0.01
                    } else {
                        0.2
                    },
                    "{tick}: {i} is out by {out}"
                );
            }
        }
        let near = (7..19).all(|i| (q[i] - upper[i]).max(lower[i] - q[i]) > -0.01);
        assert!(near, "and it does go to the limit: {q:?}");
    }
}

/// Checks a stance in which a joint limit contradicts the held feet: the limit is relaxed.
#[test]
fn limits_give_way_to_contacts() {
    let (model, q) = (robots::quadruped(), stance());
    let mut upper = model.limits().upper.clone();
    // All joints are beyond the limit: no motion of the trunk can lead all of them back.
    (7..19).for_each(|i| upper[i] = q[i] - 0.2);
    let limits = JointLimits { upper: Some(upper), ..JointLimits::default() };
    let settings = Settings { joint_limits: Some(limits), ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks(), settings).unwrap();
    let references = controller.hold(&q).unwrap();
    let command = controller.step(&q, &[0.0; 18], &references);
    check(&model, &feet(0.7), &q, &[0.0; 18], &references, command);
    assert!(command.limits_relaxed);
}
