//! Steps of differential inverse kinematics: errors fall as the gains ask, priorities are strict, and limits hold.
#![allow(non_snake_case)] // names follow the literature

use condyle_dynamics::{
    Data, Model, ReferenceFrame, Vec3, frame_jacobian, integrate, interpolate, neutral, random_configuration, robots,
};
use condyle_ik::{DifferentialIk, JointLimits, Settings, Status, Targets, Task};
use rand::SeedableRng;
use rand::rngs::StdRng;

fn free() -> Settings {
    Settings { limits: None, ..Settings::default() }
}

/// Returns a position, and a position near it on the way to another one.
fn pair(model: &Model, rng: &mut StdRng, way: f64) -> [Vec<f64>; 2] {
    let (q, end) = (random_configuration(model, rng), random_configuration(model, rng));
    let (mut near, mut tangent) = (q.clone(), vec![0.0; model.nv()]);
    interpolate(model, &q, &end, way, &mut tangent, &mut near);
    [q, near]
}

/// Makes a step, and returns q ⊕ T v.
fn advance(ik: &mut DifferentialIk, q: &[f64], v0: &[f64], targets: &Targets) -> Vec<f64> {
    let dt = ik.settings().dt;
    let x: Vec<f64> = ik.step(q, v0, targets).unwrap().v.iter().map(|v| dt * v).collect();
    let mut next = q.to_vec();
    integrate(ik.model(), q, &x, &mut next);
    next
}

/// Every kind of task alone removes the fraction α of its error, up to terms of order α². This holds only if the
/// Jacobian is the derivative of the error.
#[test]
fn errors_fall_by_the_gain() {
    const GAIN: f64 = 1e-4;
    let mut rng = StdRng::seed_from_u64(3);
    for (model, frame, root) in [
        (robots::arm7(), "tool", "link1"),
        (robots::quadruped(), "LF_foot", "RF_foot"),
        (robots::humanoid(), "left_hand", "right_hand"),
    ] {
        let mut kinds = vec![
            Task::pose(frame),
            Task::position(frame),
            Task::orientation(frame),
            Task::com(),
            Task::relative_pose(frame, root),
        ];
        kinds.extend([Task::position(frame), Task::orientation(frame)].map(|t| Task { root: Some(root.into()), ..t }));
        for task in kinds {
            for weight in [1.0, 20.0] {
                let task = Task { gain: GAIN, weight, ..task.clone() };
                let settings = Settings { damping: 1e-10, ..free() };
                let mut ik = DifferentialIk::new(&model, std::slice::from_ref(&task), settings).unwrap();
                let [q, goal] = pair(&model, &mut rng, 0.2);
                let targets = ik.hold(&goal).unwrap();
                let next = advance(&mut ik, &q, &vec![0.0; model.nv()], &targets);
                let before = ik.last().errors[0];
                ik.step(&next, &vec![0.0; model.nv()], &targets).unwrap();
                let after = ik.last().errors[0];
                for k in 0..2 {
                    let expected = (1.0 - GAIN) * before[k];
                    assert!((after[k] - expected).abs() < 20.0 * GAIN * GAIN, "{task:?}: {before:?} {after:?}");
                }
            }
        }
    }
}

#[test]
fn a_step_of_the_posture_removes_its_whole_error() {
    let model = robots::humanoid();
    let mut rng = StdRng::seed_from_u64(4);
    let mut ik = DifferentialIk::new(&model, &[Task { weight: 1.0, ..Task::posture() }], free()).unwrap();
    let (q, mut goal) = (neutral(&model), random_configuration(&model, &mut rng));
    goal[..7].copy_from_slice(&q[..7]); // the posture does not move the free-flyer
    let targets = ik.hold(&goal).unwrap();
    let next = advance(&mut ik, &q, &vec![0.0; model.nv()], &targets);
    assert!(next.iter().zip(&goal).all(|(x, y)| (x - y).abs() < 1e-7), "{next:?} {goal:?}");
}

#[test]
fn coupled_joints_keep_their_sum() {
    let model = robots::arm7();
    let names: Vec<&str> = model.bodies()[1..].iter().map(|b| b.joint_name.as_str()).collect();
    let tasks = [Task::coupling(&[(names[1], 1.0), (names[3], -2.0)], 0.4), Task { priority: 1, ..Task::pose("tool") }];
    let mut ik = DifferentialIk::new(&model, &tasks, free()).unwrap();
    let mut rng = StdRng::seed_from_u64(5);
    let [q, goal] = pair(&model, &mut rng, 0.1);
    let targets = ik.hold(&goal).unwrap();
    let next = advance(&mut ik, &q, &[0.0; 7], &targets);
    assert!((next[1] - 2.0 * next[3] - 0.4).abs() < 1e-6, "{next:?}");
    assert!((q[1] - 2.0 * q[3] - 0.4).abs() > 1e-3);
}

/// Returns ln √det(J Jᵀ) of a frame.
fn log_manipulability(model: &Model, frame: usize, q: &[f64]) -> f64 {
    let mut J = nalgebra::DMatrix::zeros(6, model.nv());
    frame_jacobian(model, q, frame, ReferenceFrame::Local, &mut J);
    0.5 * (&J * J.transpose()).determinant().ln()
}

#[test]
fn manipulability_follows_its_gradient() {
    let model = robots::arm7();
    let frame = model.frame("tool").unwrap();
    let mut rng = StdRng::seed_from_u64(6);
    let mut ik =
        DifferentialIk::new(&model, &[Task { weight: 1.0, gain: 1.0, ..Task::manipulability("tool") }], free())
            .unwrap();
    for _ in 0..10 {
        let q = random_configuration(&model, &mut rng);
        let targets = ik.hold(&q).unwrap();
        let step = ik.step(&q, &[0.0; 7], &targets).unwrap().v.clone();
        for i in 0..7 {
            let mut sides = [q.clone(), q.clone()];
            (sides[0][i], sides[1][i]) = (q[i] - 1e-6, q[i] + 1e-6);
            let [below, above] = sides.map(|q| log_manipulability(&model, frame, &q));
            let (slope, found) = ((above - below) / 2e-6, 0.01 * step[i]);
            assert!((slope - found).abs() < 1e-4 * (1.0 + slope.abs()), "joint {i}: {found}, expected {slope}");
        }
    }
}

/// A task of priority 0 reaches its target in one linear step, whatever contradicts it at priority 1.
#[test]
fn priorities_are_strict() {
    let model = robots::arm7();
    let mut rng = StdRng::seed_from_u64(7);
    for _ in 0..20 {
        let [q, goal] = pair(&model, &mut rng, 0.02);
        let alone = [Task::position("tool")];
        let both = [Task::position("tool"), Task { priority: 1, weight: 1e4, ..Task::orientation("tool") }];
        let third = [both.as_slice(), &[Task { priority: 2, weight: 1e6, ..Task::posture() }]].concat();
        let frame = model.frame("tool").unwrap();
        let mut J = nalgebra::DMatrix::zeros(6, 7);
        frame_jacobian(&model, &q, frame, ReferenceFrame::LocalWorldAligned, &mut J);
        let mut velocities = Vec::new();
        for tasks in [&alone[..], &both, &third] {
            let mut ik = DifferentialIk::new(&model, tasks, Settings::default()).unwrap();
            let mut targets = ik.hold(&goal).unwrap();
            targets.posture = neutral(&model);
            let step = ik.step(&q, &[0.0; 7], &targets).unwrap();
            assert_eq!(step.status, Status::Solved);
            velocities.push(&J * nalgebra::DVector::from_row_slice(&step.v));
        }
        let linear = |a: usize, b: usize| (velocities[a].rows(0, 3) - velocities[b].rows(0, 3)).norm();
        let angular = |a: usize, b: usize| (velocities[a].rows(3, 3) - velocities[b].rows(3, 3)).norm();
        assert!(linear(0, 1) < 1e-6 && linear(0, 2) < 1e-6, "{} {}", linear(0, 1), linear(0, 2));
        assert!(angular(1, 2) < 1e-6, "{}", angular(1, 2));
    }
}

/// From inside, no step leaves the limits of position, velocity and acceleration, with targets far away.
#[test]
fn steps_stay_within_limits() {
    for (model, frame) in
        [(robots::arm7(), "tool"), (robots::humanoid(), "left_hand"), (robots::quadruped(), "LF_foot")]
    {
        let mut rng = StdRng::seed_from_u64(8);
        let nv = model.nv();
        let (speed, most) = (vec![1.5; nv], vec![30.0; nv]);
        let limits = JointLimits {
            gain: 1.0,
            velocity: Some(speed.clone()),
            acceleration: Some(most.clone()),
            ..JointLimits::default()
        };
        let settings = Settings { limits: Some(limits), ..Settings::default() };
        let mut ik = DifferentialIk::new(&model, &[Task::pose(frame), Task::posture()], settings).unwrap();
        let mut held = 0;
        for _ in 0..5 {
            let (mut q, mut v0) = (random_configuration(&model, &mut rng), vec![0.0; nv]);
            let targets = ik.hold(&random_configuration(&model, &mut rng)).unwrap();
            for _ in 0..150 {
                let next = advance(&mut ik, &q, &v0, &targets);
                let v = &ik.last().v;
                for i in 0..nv {
                    assert!(v[i].abs() <= speed[i] * (1.0 + 1e-12), "{v:?}");
                    assert!((v[i] - v0[i]).abs() <= 0.01 * most[i] + 1e-9, "{i}: {} after {}", v[i], v0[i]);
                }
                held += ik.last().held.len();
                (q, v0) = (next, v.clone());
                inside(&model, &q);
            }
        }
        assert!(held > 100, "{held}");
    }
}

fn inside(model: &Model, q: &[f64]) {
    for (i, x) in q.iter().enumerate() {
        let (lower, upper) = (model.limits().lower[i], model.limits().upper[i]);
        assert!(lower - 1e-12 <= *x && *x <= upper + 1e-12, "q[{i}] = {x}, outside of {lower} to {upper}");
    }
}

#[test]
fn a_start_outside_of_the_limits_returns() {
    let model = robots::arm7();
    let mut ik = DifferentialIk::new(&model, &[Task::pose("tool")], Settings::default()).unwrap();
    let mut q = vec![0.0; 7];
    (q[1], q[3]) = (model.limits().upper[1] + 0.3, model.limits().lower[3] - 0.2);
    let targets = ik.hold(&q).unwrap(); // the task would stay outside
    let mut excess = 0.3_f64;
    for _ in 0..200 {
        q = advance(&mut ik, &q, &[0.0; 7], &targets);
        let now = q[1] - model.limits().upper[1];
        assert!(now <= excess.max(0.0) + 1e-12, "{now} after {excess}");
        excess = now;
        for (v, most) in ik.last().v.iter().zip(&model.limits().velocity) {
            assert!(v.abs() <= most * (1.0 + 1e-12));
        }
    }
    assert!(excess < 1e-9 && q[3] > model.limits().lower[3] - 1e-9, "{q:?}");
    assert!(ik.last().held.iter().any(|&held| ik.describe(held).contains("limit of joint")));
}

#[test]
fn humanoids_reach_with_their_feet_in_place() {
    let model = robots::humanoid();
    let feet = ["left_foot", "right_foot"];
    let mut tasks: Vec<Task> = feet.iter().map(|f| Task { weight: 100.0, ..Task::pose(f) }).collect();
    tasks.extend([Task::position("left_hand"), Task::com(), Task::posture()]);
    let mut ik = DifferentialIk::new(&model, &tasks, Settings::default()).unwrap();
    let mut q = neutral(&model);
    inside(&model, &q);
    let mut targets = ik.hold(&q).unwrap();
    targets.frames[2].translation += Vec3::new(0.15, 0.05, 0.1);
    targets.com += Vec3::new(0.0, 0.01, -0.03);
    let steps = ik.converge(&mut q, &targets, [1e-4, 1e-3], 500).unwrap();
    assert!(steps < 500, "{:?}", ik.last().errors);
    inside(&model, &q);
    let mut data = Data::new(&model);
    let placements = condyle_dynamics::forward_kinematics(&model, &mut data, &q);
    let hand = placements.frame(model.frame("left_hand").unwrap()).translation;
    assert!((hand - targets.frames[2].translation).norm_squared().sqrt() < 1e-4);
}

/// A target out of reach, at a singular position, gives finite velocities, and the arm comes to rest near it.
#[test]
fn the_limit_that_holds_a_step_is_named() {
    let model = robots::arm7();
    let limits = model.limits();
    let named = |dt: f64, q: &[f64], acceleration: Option<Vec<f64>>| {
        let limits = JointLimits { gain: 1.0, acceleration, ..JointLimits::default() };
        let settings = Settings { dt, limits: Some(limits), ..Settings::default() };
        let mut ik = DifferentialIk::new(&model, &[Task::posture()], settings).unwrap();
        let mut targets = ik.hold(q).unwrap();
        targets.posture[1] = model.limits().upper[1];
        let held = ik.step(q, &[0.0; 7], &targets).unwrap().held.clone();
        held.iter().map(|&held| ik.describe(held)).collect::<Vec<_>>()
    };
    let q = vec![0.0; 7];
    assert!(limits.velocity[1].is_finite() && limits.upper[1].is_finite());
    assert_eq!(named(1e-3, &q, None), ["upper limit of the velocity of joint `joint2`"]);
    assert_eq!(named(1e-3, &q, Some(vec![1.0; 7])), ["upper limit of the acceleration of joint `joint2`"]);
    let mut ik = DifferentialIk::new(&model, &[Task::position("tool")], Settings::default()).unwrap();
    let mut targets = ik.hold(&q).unwrap();
    targets.frames[0].translation.x += 0.1;
    let refused = ik.converge(&mut q.clone(), &targets, [f64::NAN, 1e-3], 10).unwrap_err().to_string();
    assert_eq!(refused, "setting `tolerance` is NaN, but it must be at least 0");
}

#[test]
fn targets_out_of_reach_are_approached() {
    let model = robots::arm7();
    let tasks = [Task { damping: 1.0, ..Task::position("tool") }, Task::posture()];
    let mut ik = DifferentialIk::new(&model, &tasks, Settings::default()).unwrap();
    let mut q = vec![0.0; 7]; // stretched: singular
    let mut targets = ik.hold(&q).unwrap();
    targets.frames[0].translation = Vec3::new(3.0, 0.0, 0.4);
    ik.converge(&mut q, &targets, [1e-4, 1e-3], 1000).unwrap();
    let step = ik.last();
    assert!(step.v.iter().all(|v| v.abs() < 1e-2), "{:?}", step.v);
    assert!(step.errors[0][0] > 1.0 && step.errors[0][0] < 3.0, "{:?}", step.errors);
}
