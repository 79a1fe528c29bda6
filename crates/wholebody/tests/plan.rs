//! Tests of plans: a controller computes references from plain arrays.
#![allow(non_snake_case)]

mod common;

use common::*;
use condyle_dynamics::{Joint, Model, UrdfOptions, integrate, robots};
use condyle_wholebody::{Plan, PlanData, Settings, Task, WholeBodyController};

/// Returns a plan with five knots, 0.1 s apart. The trunk accelerates upwards from rest with 0.4 m/s². In the third
/// interval the first foot does not touch.
fn data(model: &Model) -> PlanData {
    let mut states = Vec::new();
    for k in 0..5 {
        let t = 0.1 * f64::from(k);
        let (mut q, mut v) = (stance(), vec![0.0; 18]);
        (q[2], v[2]) = (q[2] + 0.2 * t * t, 0.4 * t);
        states.extend(q.into_iter().chain(v));
    }
    let mut touches = vec![true; 16];
    touches[8] = false;
    assert_eq!(model.nv(), 18);
    let controls = (0..48).map(f64::from).collect();
    let mut gains = vec![0.0; 4 * 12 * 36];
    gains[2] = 100.0; // in the first interval: gain from the trunk's height to the first joint's effort
    PlanData { times: (0..5).map(|k| 0.1 * f64::from(k)).collect(), states, controls, gains, touches, fade: 0.05 }
}

#[test]
fn references_follow_the_plan() {
    let model = robots::quadruped();
    let plan = Plan::new(&model, 4, data(&model)).unwrap();
    assert_eq!(plan.span(), [0.0, 0.4]);
    let tasks = [tasks(), vec![Task::position("LF_foot")]].concat();
    let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks, Settings::default()).unwrap();
    let mut references = controller.hold(&stance()).unwrap();
    let height = references.com.position.z;
    controller.track(&plan, 0.1, &mut references);
    assert!((references.com.position.z - height - 0.002).abs() < 1e-12);
    assert!((references.com.velocity.z - 0.04).abs() < 1e-12);
    assert!((references.com.acceleration.z - 0.4).abs() < 1e-9);
    assert!((references.frames[1].acceleration.linear.z - 0.4).abs() < 1e-9, "the foot is lifted with the trunk");
    let lift: f64 = references.contacts.iter().map(|c| c.force.linear.z).sum();
    assert!((lift - model.total_mass() * (9.81 + 0.4)).abs() < 1e-9);
    // Before and after the plan's time span, the planned robot is at rest.
    controller.track(&plan, 1.0, &mut references);
    assert_eq!((references.com.velocity.z, references.com.acceleration.z), (0.0, 0.0));
    assert!((references.com.position.z - height - 0.032).abs() < 1e-12);
}

#[test]
fn contacts_are_ramped() {
    let model = robots::quadruped();
    let plan = Plan::new(&model, 4, data(&model)).unwrap();
    for (t, expected) in
        [(-1.0, 1.0), (0.1, 1.0), (0.175, 0.5), (0.2, 0.0), (0.25, 0.0), (0.325, 0.5), (0.36, 1.0), (9.0, 1.0)]
    {
        let found = plan.activation(0, t);
        assert!((found - expected).abs() < 1e-9, "at {t} s: {found}");
        assert_eq!(plan.activation(1, t), 1.0);
    }
}

#[test]
fn feedback_is_the_plans() {
    let model = robots::quadruped();
    let plan = Plan::new(&model, 4, data(&model)).unwrap();
    let (mut q, mut tau) = (stance(), vec![f64::NAN; 18]);
    let mut up = vec![0.0; 18];
    up[2] = 0.01;
    integrate(&model, &stance(), &up, &mut q);
    plan.feedback(0.0, &q, &[0.0; 18], &mut tau).unwrap();
    assert_eq!(tau[..6], [0.0; 6]);
    assert!((tau[6] - 1.0).abs() < 1e-12, "0 + 100 · 0.01 m");
    assert_eq!(tau[7..], (1..12).map(f64::from).collect::<Vec<_>>());
}

#[test]
fn wrong_arrays_are_named() {
    let model = robots::quadruped();
    let refusal = |change: &dyn Fn(&mut PlanData)| {
        let mut data = data(&model);
        change(&mut data);
        Plan::new(&model, 4, data).unwrap_err().to_string()
    };
    assert_eq!(refusal(&|d| d.touches.truncate(3)), "`touches`: expected 16 numbers, found 3");
    assert_eq!(refusal(&|d| d.states.truncate(3)), "`states`: expected 185 numbers, found 3");
    assert_eq!(refusal(&|d| d.times[2] = 0.0), "setting `times` is 0, but it must be finite, and times in their order");
    assert_eq!(
        refusal(&|d| d.gains[7] = f64::NAN),
        "setting `gains` is NaN, but it must be finite, and times in their order"
    );
}

/// Checks that a plan is rejected if a rotation in a knot does not have length 1, or if a number is not finite.
#[test]
fn states_are_checked() {
    let model = robots::quadruped();
    let refusal = |change: &dyn Fn(&mut [f64])| {
        let mut data = data(&model);
        change(&mut data.states[2 * 37..][..37]);
        Plan::new(&model, 4, data).unwrap_err().to_string()
    };
    for factor in [0.0, 1.1, 2.0] {
        let expected = format!("its rotation, q[3..7], has the length {factor}, expected 1");
        let found = refusal(&|x| x[3..7].iter_mut().for_each(|x| *x *= factor));
        assert_eq!(found, format!("states: knot 2: joint `root_joint`: {expected}"));
    }
    let found = refusal(&|x| x[19 + 6] = f64::INFINITY);
    assert_eq!(found, "states: knot 2: joint `LF_HAA`: v[6] is inf, which is not finite");
    let found = refusal(&|x| x[7] = f64::NAN);
    assert_eq!(found, "states: knot 2: joint `LF_HAA`: q[7] is NaN, which is not finite");

    let plan = Plan::new(&model, 4, data(&model)).unwrap();
    let (mut q, mut tau) = (stance(), vec![7.0; 18]);
    q[6] = 1.1;
    let error = plan.feedback(0.0, &q, &[0.0; 18], &mut tau).unwrap_err().to_string();
    assert_eq!(error, "joint `root_joint`: its rotation, q[3..7], has the length 1.1, expected 1");
    assert_eq!(tau, [7.0; 18], "no efforts are written");
}

#[test]
#[should_panic(expected = "plan: expected 3 contacts, found 4")]
fn a_plan_of_other_contacts_is_refused() {
    let model = robots::quadruped();
    let plan = Plan::new(&model, 4, data(&model)).unwrap();
    let mut controller = WholeBodyController::new(&model, &feet(0.7)[..3], &tasks(), Settings::default()).unwrap();
    let mut references = controller.hold(&stance()).unwrap();
    controller.track(&plan, 0.1, &mut references);
}

/// Checks that a plan is rejected for another robot: with the same number of coordinates, but with sliding knees.
#[test]
#[should_panic(expected = "plan: made for another model (`sliding`) than `quadruped`")]
fn a_plan_of_another_robot_is_refused() {
    let model = robots::quadruped();
    let text = robots::QUADRUPED
        .replace("type=\"revolute\"", "type=\"prismatic\"")
        .replace("<robot name=\"quadruped\"", "<robot name=\"sliding\"");
    let options = UrdfOptions { root_joint: Some(Joint::FreeFlyer), ..UrdfOptions::default() };
    let other = Model::from_urdf_str(&text, &options).unwrap();
    assert_eq!((other.nq(), other.nv()), (model.nq(), model.nv()));
    let plan = Plan::new(&other, 4, data(&other)).unwrap();
    let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks(), Settings::default()).unwrap();
    let mut references = controller.hold(&stance()).unwrap();
    controller.track(&plan, 0.1, &mut references);
}
