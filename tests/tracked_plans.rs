//! Tests that whole-body control tracks the trot and the walk of the examples, which FDDP plans. Condyle's own
//! constrained dynamics simulates the ground. Each control step must solve its cone program to the optimum, with forces
//! inside the friction cones.
#![cfg(all(feature = "loaders", feature = "optimal", feature = "wholebody"))]

#[path = "../examples/support/ground.rs"]
mod ground;
#[path = "../crates/wholebody/tests/common/kkt_residuals.rs"]
mod kkt_residuals;
#[path = "../examples/support/mod.rs"]
mod support;

use condyle::wholebody::{Command, FrictionContact, Gains, Settings, Status, Task, WholeBodyController};
use condyle::{ContactConstraint, Force, Model, Vec3, neutral, plan_of, robots};
use ground::Ground;
use kkt_residuals::check_optimality;
use std::sync::Arc;
use support::{Foot, Gait};

const FRICTION: f64 = 0.7;
const SOLE: [f64; 2] = [0.2, 0.1]; // m
const DT: f64 = 1e-3; // s

/// Number of control steps between two checks of the optimality conditions.
const EACH: usize = 8;
/// Maximum distance of a contact force from its friction cone (N). The solver's tolerance is 1e-9, relative to the
/// robot's weight.
const CONE: f64 = 1e-6;
/// Maximum distance of the centre of mass from the planned motion (m). The distance is large, because the knots of the
/// plan are at least 10 ms apart, and feet land earlier or later than planned.
const ASTRAY: f64 = 0.03;

/// Returns whether a contact force lies in the friction cone about the normal n.
fn in_cone(f: &Force<f64>, n: Vec3<f64>) -> bool {
    let f_n = f.linear.dot(n);
    (f.linear - n.scale(f_n)).norm_squared().sqrt() <= FRICTION * f_n + CONE
}

/// Plans a gait, and tracks the plan for the plan's duration and 0.3 s longer.
fn track(robot: &Arc<Model>, gait: Gait, contacts: &[FrictionContact], tasks: &[Task], damping: f64) {
    let touches = gait.touches();
    let (solution, times) = gait.solve().unwrap();
    let plan = plan_of(robot, &solution, &times, &touches, 0.02).unwrap();
    let contact_gains = Gains { stiffness: 0.0, damping };
    // The weight of contact forces in the objective is large enough to determine the load of each foot despite rounding
    // errors. The solver scales its program, and the tolerance applies to the scaled program. With a tolerance of
    // 1e-11, the duality gap is small compared with 1 in units of the objective.
    let settings = Settings { contact_gains, force_weight: 1e-5, tolerance: 1e-11, ..Settings::default() };
    let mut controller = WholeBodyController::new(robot, contacts, tasks, settings).unwrap();
    let x0 = &solution.x(0)[..robot.nq()];
    let mut references = controller.hold(x0).unwrap();
    let held = |contact: &FrictionContact| {
        let frame = robot.frame(&contact.frame).unwrap();
        if contacts.len() == 2 { ContactConstraint::rigid(frame) } else { ContactConstraint::point(frame) }
    };
    let mut world = Ground::new(robot, x0, contacts.iter().map(held).collect());
    let [_, end] = plan.span();
    let (start, mut farthest) = (references.com.position, 0.0_f64);
    for tick in 0..((end + 0.3) / DT) as usize {
        controller.track(&plan, tick as f64 * DT, &mut references);
        let Command { tau, forces, status, .. } = controller.step(&world.q, &world.v, &references).clone();
        assert_eq!(status, Status::Solved, "tick {tick}");
        // The normal of a point contact is vertical, because the ground is level. The normal of a sole turns with the
        // sole, which may land on an edge.
        for (f, here) in forces.iter().zip(&controller.hold(&world.q).unwrap().contacts) {
            let n = if contacts.len() == 2 { here.pose.rotation.z } else { Vec3::new(0.0, 0.0, 1.0) };
            assert!(in_cone(f, n), "tick {tick}: {f:?}");
        }
        if tick % EACH == 0 {
            check_optimality(&mut controller, &world.q, &world.v, &references, &format!("tick {tick}"));
        }
        world.step(&tau, &[], DT);
        let away = controller.hold(&world.q).unwrap().com.position - references.com.position;
        farthest = farthest.max(away.norm_squared().sqrt());
        assert!(farthest < ASTRAY, "tick {tick}: {away:?}");
    }
    assert!(references.com.position.x - start.x > 0.1, "the plan leads ahead");
    println!("at most {:.1} mm from the plan", 1e3 * farthest);
}

#[test]
fn a_trot() {
    const FEET: [&str; 4] = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
    let robot = Arc::new(robots::quadruped());
    let mut q = neutral(&robot);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // knees bent
    let mut gait = Gait::new(robot.clone(), &q, Foot::Point, &FEET, 0.01);
    gait.stand(10).unwrap();
    for (feet, length) in [([1, 2], 0.08), ([0, 3], 0.16), ([1, 2], 0.08)] {
        gait.step(&feet, length, 0.06, 20).unwrap();
        gait.stand(5).unwrap();
    }
    gait.stand(15).unwrap();
    let contacts = FEET.map(|foot| FrictionContact::point(foot, FRICTION));
    let com = Task { weight: 100.0, ..Task::com() };
    let mut tasks = vec![com, Task::orientation("trunk"), Task::posture()];
    tasks.extend(FEET.map(|foot| Task { weight: 100.0, gains: Gains::critical(900.0), ..Task::position(foot) }));
    track(&robot, gait, &contacts, &tasks, 40.0);
}

#[test]
fn a_walk() {
    const FEET: [&str; 2] = ["left_sole", "right_sole"];
    let robot = Arc::new(robots::humanoid());
    let mut q = neutral(&robot);
    for body in robot.bodies() {
        let bends = |joint: &str| body.joint_name.ends_with(joint);
        if bends("knee") || bends("hip_pitch") || bends("ankle_pitch") {
            q[body.idx_q] = if bends("knee") { 0.8 } else { -0.4 };
        }
    }
    let mut gait = Gait::new(robot.clone(), &q, Foot::Sole(SOLE), &FEET, 0.03);
    gait.stand(10).unwrap();
    for (foot, length) in [(1, 0.15), (0, 0.3), (1, 0.15)] {
        gait.step(&[foot], length, 0.06, 20).unwrap();
        gait.stand(8).unwrap();
    }
    gait.stand(2).unwrap();
    let contacts = FEET.map(|sole| FrictionContact::sole(sole, FRICTION, SOLE));
    let mut tasks = vec![
        Task { weight: 100.0, gains: Gains::critical(40.0), ..Task::com() },
        Task { weight: 20.0, ..Task::orientation("pelvis") },
        Task::posture(),
    ];
    tasks.extend(FEET.map(|sole| Task { weight: 100.0, gains: Gains::critical(400.0), ..Task::pose(sole) }));
    track(&robot, gait, &contacts, &tasks, 10.0);
}
