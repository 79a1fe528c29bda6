//! A humanoid walks: two steps on soles, with wrench cones and impacts. A page shows the gait.
//!
//! ```text
//! cargo run --release --example walk [PAGE.html]
//! ```

#[path = "support/page.rs"]
mod page;
mod support;

use condyle::{neutral, robots};
use std::error::Error;
use std::sync::Arc;
use support::{Foot, Gait};

const FEET: [&str; 2] = ["left_sole", "right_sole"];
const SOLE: [f64; 2] = [0.2, 0.1]; // m
const KNOTS: usize = 20; // per step of the gait
const DT: f64 = 0.03; // s

fn main() -> Result<(), Box<dyn Error>> {
    let robot = Arc::new(robots::humanoid());
    let mut q = neutral(&robot);
    for side in ["left", "right"] {
        for (joint, angle) in [("hip_pitch", -0.4), ("knee", 0.8), ("ankle_pitch", -0.4)] {
            let name = format!("{side}_{joint}");
            let body = robot.bodies().iter().find(|body| body.joint_name == name).expect("a joint of the leg");
            q[body.idx_q] = angle; // knees bent
        }
    }

    let mut gait = Gait::new(robot.clone(), &q, Foot::Sole(SOLE), &FEET, DT);
    gait.stand(10)?;
    gait.step(&[1], 0.15, 0.06, KNOTS)?;
    gait.stand(8)?;
    gait.step(&[0], 0.3, 0.06, KNOTS)?;
    gait.stand(8)?;
    gait.step(&[1], 0.15, 0.06, KNOTS)?;
    gait.stand(10)?;
    let (solution, times) = gait.solve()?;

    let ahead = solution.x(times.len() - 1)[0] - solution.x(0)[0];
    println!("the pelvis went {ahead:.3} m ahead in {:.2} s", times[times.len() - 1]);
    assert!((ahead - 0.3).abs() < 0.03, "the feet went 0.3 m, the pelvis did not follow");
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/walk.html".to_owned());
    page::write(path.as_ref(), "A humanoid walks", &robot, &FEET, &solution, &times)?;
    println!("wrote {path}");
    Ok(())
}
