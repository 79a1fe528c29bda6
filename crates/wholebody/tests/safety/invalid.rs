//! Tests that an invalid rotation in a state or in references gives a safe command, and a status that names the joint
//! or frame.

use crate::common::*;
use condyle_dynamics::{Data, Joint, Mat3, Model, ModelBuilder, Se3, Vec3, WORLD, gravity, neutral, robots};
use condyle_wholebody::{
    Command, CommandSource, InvalidRotation, References, Settings, Status, Task, WholeBodyController,
};

fn is_finite(command: &Command) {
    let forces = command.forces.iter().flat_map(|f| f.to_array());
    let numbers = command.tau.iter().chain(&command.a).copied().chain(forces);
    assert!(numbers.chain(command.com_acceleration.to_array()).all(f64::is_finite), "{command:?}");
}

fn scaled(q: &[f64], part: std::ops::Range<usize>, factor: f64) -> Vec<f64> {
    let mut q = q.to_vec();
    q[part].iter_mut().for_each(|x| *x *= factor);
    q
}

/// Returns a robot with a fixed base and one joint of each kind that has a quaternion or a pair (cos, sin) in its
/// position.
fn turning() -> Model {
    let mut builder = ModelBuilder::new("turning");
    let (axis, down) = (Vec3::new(0.0, 0.0, 1.0), Se3::new(Mat3::identity(), Vec3::new(0.1, 0.0, -0.3)));
    let ball =
        condyle_dynamics::Inertia::from_com(1.0, Vec3::new(0.1, 0.0, 0.0), condyle_dynamics::Sym3::diagonal(0.01));
    let wheel = builder.body("wheel", WORLD, Joint::Continuous { axis }, down, ball);
    let socket = builder.body("socket", wheel, Joint::Spherical, down, ball);
    builder.body("plane", socket, Joint::Planar, down, ball);
    builder.build().unwrap()
}

#[test]
fn a_quaternion_has_length_1() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let mut controller = controller(&model, &feet(0.7));
    let references = controller.hold(&q).unwrap();
    for factor in [0.0, 0.9, 1.1, 2.0, 1e200] {
        let bad = scaled(&q, 3..7, factor);
        let length = if factor > 1e100 { f64::INFINITY } else { factor };
        let command = controller.step(&bad, &v, &references);
        is_finite(command);
        let rotation = InvalidRotation::Joint { name: "q", body: 1, first: 3, end: 7, length };
        assert_eq!(command.status, Status::InvalidState(rotation));
        let fault = format!("its rotation, q[3..7], has the length {length}, expected 1");
        assert_eq!(command.status.to_string(), format!("joint of body 1: {fault}"));
        assert_eq!(controller.reason(), format!("joint `root_joint`: {fault}"));
        assert_eq!(controller.hold(&bad).unwrap_err().to_string(), format!("joint `root_joint`: {fault}"));
    }
    // Small errors of a quaternion's length are allowed. The opposite quaternion describes the same rotation.
    for factor in [1.0, -1.0, 1.0 + 5e-4, 1.0 - 5e-4] {
        let near = scaled(&q, 3..7, factor);
        controller.step(&near, &v, &references).solved().unwrap();
        let references = controller.hold(&near).unwrap();
        controller.step(&near, &v, &references).solved().unwrap();
    }
}

/// Checks that references made at a valid position are valid. The length of a rotation in this position may differ from
/// 1 by the allowed error.
#[test]
fn references_of_a_valid_position_are_valid() {
    let model = robots::quadruped();
    let mut controller = controller(&model, &feet(0.7));
    for (seed, factor) in [(1, 0.9991), (2, 1.0009), (3, 0.9991), (4, 1.0009)] {
        let (q, v) = state(&model, seed, 3.0, 0.0);
        let q = scaled(&q, 3..7, factor);
        let references = controller.hold(&q).unwrap();
        let status = controller.step(&q, &v, &references).status;
        assert!(!matches!(status, Status::InvalidState(_)), "{status}");
    }
}

#[test]
fn each_kind_of_joint_is_named() {
    let (model, v) = (turning(), vec![0.0; 7]);
    let settings = Settings { effort: Some(vec![100.0; 7]), ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &[], &[Task::posture()], settings).unwrap();
    let q = neutral(&model);
    let references = controller.hold(&q).unwrap();
    controller.step(&q, &v, &references).solved().unwrap();
    for (joint, part) in [("wheel", 0..2), ("socket", 2..6), ("plane", 8..10)] {
        for factor in [0.0, 1.1, 2.0] {
            let (bad, (first, end)) = (scaled(&q, part.clone(), factor), (part.start, part.end));
            is_finite(controller.step(&bad, &v, &references));
            let fault = |name| {
                format!("joint `{joint}`: its rotation, {name}[{first}..{end}], has the length {factor}, expected 1")
            };
            assert_eq!(controller.reason(), fault("q"));
            assert_eq!(controller.hold(&bad).unwrap_err().to_string(), fault("q"));
            let mut references = references.clone();
            references.posture.q.copy_from_slice(&bad);
            is_finite(controller.step(&q, &v, &references));
            assert_eq!(controller.reason(), fault("posture.q"));
        }
    }
}

#[test]
fn a_reference_rotation_is_one() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let mut controller = controller(&model, &feet(0.7));
    let good = controller.hold(&q).unwrap();
    let one = Mat3::<f64>::identity();
    let mirror = Mat3 { z: Vec3::new(0.0, 0.0, -1.0), ..one };
    let sheared = Mat3 { x: Vec3::new(1.0, 0.1, 0.0), ..one };
    for R in [Mat3::zero(), one.scale(1.1), one.scale(2.0), one.scale(-1.0), mirror, sheared] {
        let error = R.rotation_error();
        let fault = |frame: &str, place: &str| {
            format!("frame `{frame}`: {place}.pose is no rotation: off by {error}, at most 0.01 is allowed")
        };
        let mut references = good.clone();
        references.frames[0].pose.rotation = R;
        is_finite(controller.step(&q, &v, &references));
        assert_eq!(controller.reason(), fault("trunk", "frames[0]"));
        let mut references = good.clone();
        references.contacts[2].pose.rotation = R;
        let command = controller.step(&q, &v, &references);
        is_finite(command);
        let rotation = InvalidRotation::Pose { name: "contacts", index: 2, error };
        assert_eq!(command.status, Status::InvalidState(rotation));
        assert_eq!(controller.reason(), fault("RF_foot", "contacts[2]"));
    }
    controller.step(&q, &v, &good).solved().unwrap();
}

/// Checks that gravity compensation uses the last valid state. This holds before and after the first solution, whatever
/// arguments follow this state.
#[test]
fn the_safe_command_is_of_the_last_valid_state() {
    let model = robots::quadruped();
    let settings = Settings { hold_ticks: 0, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &[], &tasks(), settings).unwrap();
    let references = controller.hold(&stance()).unwrap();
    let compensation = |controller: &mut WholeBodyController, q: &[f64], at: &[f64]| {
        let command = controller.step(q, &[0.0; 18], &references);
        assert_eq!(command.source, CommandSource::GravityCompensation);
        let mut data = Data::new(&model);
        assert_eq!(command.tau[6..], gravity(&model, &mut data, at)[6..]);
    };
    let bad = |q: &[f64]| scaled(q, 3..7, 0.0);
    compensation(&mut controller, &bad(&stance()), &neutral(&model)); // before the first valid state
    for seed in 0..3 {
        let (q, v) = state(&model, seed, 0.2, 0.0);
        controller.step(&q, &v, &references).solved().unwrap();
        let (other, _) = state(&model, seed + 10, 0.2, 0.0);
        compensation(&mut controller, &bad(&other), &q);
        compensation(&mut controller, &bad(&other), &q);
    }
}

/// Checks that finite numbers of any size give a finite command.
#[test]
fn huge_numbers_are_safe() {
    let model = robots::quadruped();
    let unlimited = Settings { effort: Some(vec![f64::INFINITY; 18]), hold_ticks: 0, ..Settings::default() };
    for settings in [Settings { hold_ticks: 0, ..Settings::default() }, unlimited] {
        let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks(), settings).unwrap();
        let references: References = controller.hold(&stance()).unwrap();
        for size in [1e30, 1e160, 1e300, f64::MAX] {
            let (mut q, mut v) = (stance(), vec![0.0; 18]);
            (q[0], q[9], v[2], v[8]) = (size, size, -size, size);
            is_finite(controller.step(&q, &v, &references));
        }
    }
}
