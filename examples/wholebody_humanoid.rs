//! A humanoid stands on two soles, shifts its weight to one foot, lifts the other foot, and sets it down.
//!
//! The contact of the lifted foot fades: its force decreases to 0 before the foot leaves the ground, and increases
//! after the foot has landed.
//!
//! ```text
//! cargo run --release --example wholebody_humanoid [ROBOT.urdf LEFT_SOLE RIGHT_SOLE]
//! ```

#[path = "support/ground.rs"]
mod ground;

use condyle::wholebody::{FrictionContact, Gains, Settings, Task, WholeBodyController};
use condyle::{ContactConstraint, Joint, Model, UrdfOptions, neutral, robots};
use ground::Ground;
use std::error::Error;
use std::f64::consts::PI;

const SOLE: [f64; 2] = [0.2, 0.1]; // m
const DT: f64 = 1e-3; // s
const LIFT: f64 = 0.1; // m

/// Rises smoothly from 0 at the time `from` to 1 at the time `to`. Returns value, first and second derivative at the
/// time t.
fn ramp(t: f64, from: f64, to: f64) -> [f64; 3] {
    let (s, w) = (((t - from) / (to - from)).clamp(0.0, 1.0), 1.0 / (to - from));
    let poly = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    [poly, 30.0 * w * (s * (1.0 - s)).powi(2), 60.0 * w * w * s * (1.0 - s) * (1.0 - 2.0 * s)]
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (model, soles) = match &arguments[..] {
        [urdf, left, right] => {
            let options = UrdfOptions { root_joint: Some(Joint::FreeFlyer), ..UrdfOptions::default() };
            (Model::from_urdf(urdf, &options)?, [left.as_str(), right.as_str()])
        }
        _ => (robots::humanoid(), ["left_sole", "right_sole"]),
    };
    let mut q = neutral(&model);
    for body in model.bodies() {
        let angle = if body.joint_name.contains("knee") { 0.8 } else { -0.4 };
        if ["hip_pitch", "knee", "ankle_pitch"].iter().any(|joint| body.joint_name.ends_with(joint)) {
            q[body.idx_q] = angle; // knees bent
        }
    }

    let contacts = soles.map(|sole| FrictionContact::sole(sole, 0.7, SOLE));
    let foot = Task { weight: 100.0, gains: Gains::critical(400.0), ..Task::pose(soles[1]) };
    let trunk = Task::orientation(&model.bodies()[1].name);
    let tasks = [Task { gains: Gains::critical(30.0), ..Task::com() }, trunk, foot, Task::posture()];
    let settings = Settings { contact_gains: Gains { stiffness: 0.0, damping: 40.0 }, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks, settings)?;
    let ground = controller.hold(&q)?.contacts[0].pose.translation.z;
    q[2] -= ground; // the robot stands at height 0
    let start = controller.hold(&q)?;
    let aside = start.contacts[0].pose.translation - start.com.position;

    let constraint = |sole: &str| ContactConstraint::rigid(model.frame(sole).expect("a sole of this robot"));
    let mut world = Ground::new(&model, &q, soles.map(constraint).to_vec());
    let mut references = start.clone();
    println!("  t, s   centre of mass, mm    left f_z, N   right f_z, N   right sole, mm");
    let mut error = 0.0f64;
    for tick in 0..=5000 {
        let t = f64::from(tick) * DT;
        // The weight moves to the left foot from 0.2 s to 1.2 s, and back from 3.8 s to 4.8 s.
        let (to, back) = (ramp(t, 0.2, 1.2), ramp(t, 3.8, 4.8));
        references.com.position = start.com.position + aside.scale(to[0] - back[0]);
        references.com.position.z = start.com.position.z;
        references.com.velocity.y = aside.y * (to[1] - back[1]);
        references.com.acceleration.y = aside.y * (to[2] - back[2]);
        // The right foot is unloaded from 1.4 s to 1.6 s. Then it is lifted and lands. After 3.3 s it is loaded again.
        let up = PI * ((t - 1.6) / 1.6).clamp(0.0, 1.0);
        references.frames[1].pose.translation.z = start.frames[1].pose.translation.z + LIFT * up.sin().powi(2);
        references.frames[1].velocity.linear.z = LIFT * PI / 1.6 * (2.0 * up).sin();
        references.contacts[1].activation = (1.0 - ramp(t, 1.4, 1.6)[0]) + ramp(t, 3.3, 3.5)[0];

        let command = controller.step(&world.q, &world.v, &references).solved()?;
        let (tau, com) = (command.tau.clone(), command.com_acceleration);
        error = controller.kkt_residuals(&world.q, &world.v, &references).worst().max(error);
        let forces = world.step(&tau, &[], DT);
        if tick % 250 == 0 {
            let now = controller.hold(&world.q)?;
            let (c, sole) = (now.com.position - start.com.position, now.frames[1].pose.translation.z);
            println!(
                "  {t:5.2}   {:6.1} {:6.1} {:6.1} {:12.1} {:14.1} {:14.1}",
                1e3 * c.x,
                1e3 * c.y,
                1e3 * c.z,
                forces[0].z,
                forces[1].z,
                1e3 * sole
            );
            assert!(com.z.abs() < 5.0 && c.z.abs() < 0.05, "it falls");
        }
    }
    println!("each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}");
    assert!(error < 1e-5);
    Ok(())
}
