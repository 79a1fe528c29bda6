//! A quadruped trots along a plan that FDDP finds. Whole-body control tracks the plan at 1 kHz, on simulated ground
//! that can push but not pull.
//!
//! ```text
//! cargo run --release --example wholebody_trot
//! ```

#[path = "support/ground.rs"]
mod ground;
mod support;

use condyle::wholebody::{FrictionContact, Gains, Settings, Status, Task, WholeBodyController};
use condyle::{ContactConstraint, neutral, plan_of, robots};
use ground::Ground;
use std::error::Error;
use std::sync::Arc;
use support::{Foot, Gait};

const FEET: [&str; 4] = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
const FRICTION: f64 = 0.7;
const DT: f64 = 1e-3; // s

fn main() -> Result<(), Box<dyn Error>> {
    let robot = Arc::new(robots::quadruped());
    let mut q = neutral(&robot);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // knees bent

    let mut gait = Gait::new(robot.clone(), &q, Foot::Point, &FEET, 0.01);
    gait.stand(10)?;
    gait.step(&[1, 2], 0.08, 0.06, 20)?; // right front leg and left hind leg
    gait.stand(5)?;
    gait.step(&[0, 3], 0.16, 0.06, 20)?;
    gait.stand(5)?;
    gait.step(&[1, 2], 0.08, 0.06, 20)?;
    gait.stand(20)?;
    let touches = gait.touches();
    let (solution, times) = gait.solve()?;
    // The simulated friction force has no limit, so the example reports the forces that are outside their friction
    // cones.
    let plan = plan_of(&robot, &solution, &times, &touches, 0.02)?;

    let contacts = FEET.map(|foot| FrictionContact::point(foot, FRICTION));
    let mut tasks = vec![Task::com(), Task::orientation("trunk"), Task::posture()];
    let swing = |foot| Task { weight: 100.0, gains: Gains::critical(900.0), ..Task::position(foot) };
    tasks.extend(FEET.map(swing));
    let settings = Settings { contact_gains: Gains { stiffness: 0.0, damping: 40.0 }, ..Settings::default() };
    let mut controller = WholeBodyController::new(&robot, &contacts, &tasks, settings)?;
    let x0 = solution.x(0);
    let mut references = controller.hold(&x0[..robot.nq()])?;
    let feet = FEET.map(|foot| ContactConstraint::point(robot.frame(foot).expect("a foot of this robot")));
    let mut world = Ground::new(&robot, &x0[..robot.nq()], feet.to_vec());

    let [_, end] = plan.span();
    let (mut t, mut unsolved, mut loaded, mut slips, mut error) = (0.0, 0, 0, 0, 0.0f64);
    while t < end + 0.3 {
        controller.track(&plan, t, &mut references);
        let command = controller.step(&world.q, &world.v, &references);
        unsolved += usize::from(command.status != Status::Solved);
        let tau = command.tau.clone();
        error = controller.kkt_residuals(&world.q, &world.v, &references).worst().max(error);
        let forces = world.step(&tau, &[], DT);
        for (f, _) in forces.iter().zip(&references.contacts).filter(|(f, c)| c.activation == 1.0 && f.z > 0.0) {
            (loaded, slips) = (loaded + 1, slips + usize::from(f.x.hypot(f.y) > FRICTION * f.z));
        }
        if ((t / DT).round() as usize).is_multiple_of(100) {
            let away = (0..3).map(|i| (world.q[i] - references.posture.q[i]).powi(2)).sum::<f64>().sqrt();
            let loads: Vec<String> = forces.iter().map(|f| format!("{:4.0}", f.z)).collect();
            println!(
                "{t:4.1} s   trunk at {:6.3} m, {:4.1} mm from the plan   feet carry {} N",
                world.q[0],
                1e3 * away,
                loads.join(" ")
            );
        }
        t += DT;
    }
    let (ahead, planned) = (world.q[0] - x0[0], solution.x(times.len() - 1)[0] - x0[0]);
    println!("the trunk went {ahead:.3} m ahead, as planned {planned:.3} m; {unsolved} ticks without a solution");
    println!("each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}");
    println!(
        "{:.1} % of the forces on loaded feet leave the cone: there a foot would slip",
        1e2 * slips as f64 / loaded as f64
    );
    assert!((ahead - planned).abs() < 0.03 && unsolved == 0 && error < 1e-5, "the plan was not tracked");
    Ok(())
}
