//! A quadruped trots: two steps of diagonal legs, with friction cones and impacts. A page shows the gait.
//!
//! ```text
//! cargo run --release --example trot [PAGE.html]
//! ```

#[path = "support/page.rs"]
mod page;
mod support;

use condyle::{neutral, robots};
use std::error::Error;
use std::sync::Arc;
use support::{Foot, Gait};

const FEET: [&str; 4] = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"];
const KNOTS: usize = 20; // per step of the gait
const DT: f64 = 0.01; // s

fn main() -> Result<(), Box<dyn Error>> {
    let robot = Arc::new(robots::quadruped());
    let mut q = neutral(&robot);
    (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // knees bent

    let mut gait = Gait::new(robot.clone(), &q, Foot::Point, &FEET, DT);
    gait.stand(5)?;
    gait.step(&[1, 2], 0.08, 0.06, KNOTS)?; // right front leg and left hind leg
    gait.stand(3)?;
    gait.step(&[0, 3], 0.16, 0.06, KNOTS)?;
    gait.stand(3)?;
    gait.step(&[1, 2], 0.08, 0.06, KNOTS)?;
    gait.stand(10)?;
    let (solution, times) = gait.solve()?;

    let ahead = solution.x(times.len() - 1)[0] - solution.x(0)[0];
    println!("the trunk went {ahead:.3} m ahead in {:.2} s", times[times.len() - 1]);
    assert!((ahead - 0.16).abs() < 0.02, "the feet went 0.16 m, the trunk did not follow");
    let path = std::env::args().nth(1).unwrap_or_else(|| "target/trot.html".to_owned());
    page::write(path.as_ref(), "A quadruped trots", &robot, &FEET, &solution, &times)?;
    println!("wrote {path}");
    Ok(())
}
