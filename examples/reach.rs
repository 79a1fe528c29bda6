//! An arm reaches for a point and comes to rest there.
//!
//! ```text
//! cargo run --release --example reach
//! ```

use condyle::optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle::optimal::{Fddp, Iteration, Problem};
use condyle::{Data, Vec3, forward_kinematics, robots};
use std::error::Error;
use std::sync::Arc;

const KNOTS: usize = 50;
const DT: f64 = 0.02; // s

fn main() -> Result<(), Box<dyn Error>> {
    let arm = Arc::new(robots::arm7());
    let tool = arm.frame("tool")?;
    let target = Vec3::new(0.4, 0.2, 0.5);
    let x0 = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();

    // Running costs are speed and effort. The terminal costs are the distance to the point and the speed.
    let only_speed = Activation::Weighted([[0.0; 7], [1.0; 7]].concat());
    let state = Residual::State { reference: x0.clone() };
    let effort = Residual::Control { reference: vec![0.0; 7] };
    let point = Residual::FrameTranslation { frame: "tool".into(), target };
    let running = vec![
        Cost::new("speed", 1e-2, state.clone(), only_speed.clone()),
        Cost::new("effort", 1e-4, effort, Activation::Quadratic),
    ];
    let terminal =
        vec![Cost::new("point", 1e4, point, Activation::Quadratic), Cost::new("rest", 1e1, state, only_speed)];

    let mut knot = FreeDynamics::running(arm.clone(), DT, running)?;
    let hold = knot.quasi_static(&x0);
    let end = FreeDynamics::terminal(arm.clone(), terminal)?;
    let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; KNOTS], Box::new(end))?;
    let mut solver = Fddp::new(&problem);
    let solution = solver.solve_with(&mut problem, &x0.repeat(KNOTS + 1), &hold.repeat(KNOTS), |i: &Iteration| {
        println!("iteration {:2}   cost {:12.6}   step {:.3}", i.iteration, i.cost, i.step);
    })?;

    let mut data = Data::new(&arm);
    let reached = forward_kinematics(&arm, &mut data, &solution.x(KNOTS)[..7]).frame(tool).translation;
    let miss = (reached - target).norm_squared().sqrt();
    println!(
        "{:?} in {:.2} ms; {:.3} mm from the point",
        solution.status,
        1e3 * solution.timings.total.as_secs_f64(),
        1e3 * miss
    );
    assert!(miss < 1e-3, "the arm did not arrive");
    Ok(())
}
