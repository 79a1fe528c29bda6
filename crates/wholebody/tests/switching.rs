//! Contacts that appear and disappear from tick to tick.
#![allow(non_snake_case)]

mod common;
#[path = "common/kkt_residuals.rs"]
mod kkt_residuals;

use common::*;
use condyle_dynamics::{Force, Model, integrate, robots};
use condyle_wholebody::{FrictionContact, Gains, Settings, Task, WholeBodyController};

/// Checks that any set of touching feet gives the same command as a controller made for this set, in any order of the
/// sets.
#[test]
fn every_set_of_contacts() {
    let (model, contacts) = (robots::quadruped(), feet(0.7));
    // The weight of forces is small. So the comparison of torques requires a tighter tolerance than the default.
    let make = |contacts: &[FrictionContact]| {
        let settings = Settings { tolerance: 1e-13, force_weight: 1e-5, ..Settings::default() };
        WholeBodyController::new(&model, contacts, &tasks(), settings).unwrap()
    };
    let mut controller = make(&contacts);
    let hold = controller.hold(&stance()).unwrap();
    for (seed, set) in (0..16).chain((0..16).rev()).enumerate() {
        let (q, v) = state(&model, seed as u64, 0.05, 0.1);
        let mut references = hold.clone();
        for k in 0..4 {
            references.contacts[k].activation = f64::from(set >> k & 1);
        }
        let command = controller.step(&q, &v, &references).clone();
        check(&model, &contacts, &q, &v, &references, &command);

        let on = |k: &usize| set >> k & 1 == 1;
        let some: Vec<_> = (0..4).filter(on).map(|k| contacts[k].clone()).collect();
        let mut own = make(&some);
        let touching = (0..4).filter(on).map(|k| references.contacts[k]).collect();
        let expected = own.step(&q, &v, &condyle_wholebody::References { contacts: touching, ..references });
        let apart = max_abs(expected.tau.iter().zip(&command.tau).map(|(a, b)| a - b));
        assert!(apart < 1e-4, "set {set}: {apart:.1e} N m");
    }
}

#[test]
fn free_fall_is_a_tick_like_others() {
    let model = robots::quadruped();
    for contacts in [vec![], feet(0.7)] {
        let mut controller = controller(&model, &contacts);
        let mut references = controller.hold(&stance()).unwrap();
        references.contacts.iter_mut().for_each(|c| c.activation = 0.0);
        let (q, v) = state(&model, 1, 0.1, 1.0);
        let command = controller.step(&q, &v, &references);
        check(&model, &contacts, &q, &v, &references, command);
        assert!((command.com_acceleration.z + 9.81).abs() < 1e-6);
        assert!(command.forces.iter().all(|&f| f == Force::zero()));
    }
}

/// Checks that no torque jumps. The weight moves to the left foot, while the right foot is unloaded within 0.2 s,
/// hangs, and is loaded again.
#[test]
fn fading_contacts_do_not_jerk() {
    let model = robots::humanoid();
    let contacts = soles(0.7);
    // After the contact has ended, a task with more weight than the posture holds the foot at the same pose.
    let tasks = [humanoid_tasks(), vec![Task { weight: 1e3, ..Task::pose("right_sole") }]].concat();
    // The duality gap is relative to 1 if the objective is below 1. Only a tolerance tighter than the default makes the
    // gap small enough.
    let settings = Settings { contact_gains: Gains::critical(100.0), tolerance: 1e-11, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks, settings).unwrap();
    let (mut q, mut v) = (squat(&model), vec![0.0; 38]);
    let mut references = controller.hold(&q).unwrap();
    let aside = references.contacts[0].pose.translation.y - references.com.position.y;
    let dt = 1e-3;
    let mut before: Option<Vec<f64>> = None;
    let mut largest = 0.0f64;
    for tick in 0..1600 {
        // The centre of mass moves along half a cosine in 0.6 s.
        let (sin, cos) = (core::f64::consts::PI * f64::from(tick.min(600)) / 600.0).sin_cos();
        let rate = core::f64::consts::PI / 0.6;
        references.com.position.y = 0.5 * aside * (1.0 - cos);
        references.com.velocity.y = 0.5 * aside * rate * sin;
        references.com.acceleration.y = 0.5 * aside * rate * rate * if tick < 600 { cos } else { 0.0 };
        references.contacts[1].activation = match tick {
            0..800 => 1.0,
            800..1000 => 1.0 - f64::from(tick - 800) / 200.0,
            1000..1200 => 0.0,
            1200..1400 => f64::from(tick - 1200) / 200.0,
            _ => 1.0,
        };
        let command = controller.step(&q, &v, &references);
        assert_eq!(command.status, condyle_wholebody::Status::Solved);
        assert!(command.forces[1].linear.z < EQUALITY + if (1000..=1200).contains(&tick) { 0.0 } else { 1e3 });
        if let Some(before) = &before {
            let jump = max_abs(command.tau.iter().zip(before).map(|(a, b)| a - b));
            largest = largest.max(if tick > 650 { jump } else { 0.0 }); // c̈ of the reference jumps at tick 600
        }
        before = Some(command.tau.clone());
        let a = command.a.clone();
        if tick % 16 == 0 {
            kkt_residuals::check_optimality(&mut controller, &q, &v, &references, &format!("tick {tick}"));
        }
        advance(&model, &mut q, &mut v, &a, dt);
    }
    // A tick of the ramp changes the force of the right foot by 4 N, with a lever of 0.4 m between the feet. The last
    // tick of the ramp also moves the friction force of this foot, 2.7 N, to the other foot. This accelerates the
    // centre of mass, and the lever is 0.9 m, the height of the hips.
    assert!(largest < 4.0, "a torque jumps by {largest:.3} N m in a tick");
}

fn advance(model: &Model, q: &mut Vec<f64>, v: &mut [f64], a: &[f64], dt: f64) {
    let step: Vec<f64> = v.iter().zip(a).map(|(v, a)| dt * (v + 0.5 * dt * a)).collect();
    let mut next = q.clone();
    integrate(model, q, &step, &mut next);
    *q = next;
    v.iter_mut().zip(a).for_each(|(v, a)| *v += dt * a);
}
