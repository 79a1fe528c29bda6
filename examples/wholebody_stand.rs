//! A quadruped stands on four point feet. It is pushed, sways and returns.
//!
//! Every millisecond, the whole-body controller solves one cone program with exact friction cones, which gives the
//! torques. The controller measures only the state, not the push. The simulated ground holds a foot as long as the
//! ground pushes the foot, and the friction force has no limit. So the example checks each force and prints the
//! smallest distance of a force from the boundary of its cone.
//!
//! ```text
//! cargo run --release --example wholebody_stand
//! ```

#[path = "support/ground.rs"]
mod ground;

use condyle::wholebody::{FrictionContact, Gains, Settings, Task, WholeBodyController};
use condyle::{ContactConstraint, Force, Vec3, robots};
use ground::Ground;
use std::error::Error;
use std::time::Instant;

const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
const FRICTION: f64 = 0.6;
const DT: f64 = 1e-3; // s
const PUSH: Vec3<f64> = Vec3 { x: 0.0, y: 50.0, z: 0.0 }; // N, to the left, from 0.2 s to 0.6 s

fn main() -> Result<(), Box<dyn Error>> {
    let model = robots::quadruped();
    let mut q = vec![0.0, 0.0, 0.7 * 0.7f64.cos(), 0.0, 0.0, 0.0, 1.0]; // knees inwards, feet on the ground
    q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);

    let contacts = FEET.map(|foot| FrictionContact::point(foot, FRICTION));
    let gains = Gains::critical(60.0);
    let tasks = [Task { gains, ..Task::com() }, Task { gains, ..Task::orientation("trunk") }, Task::posture()];
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks, Settings::default())?;
    let references = controller.hold(&q)?;

    println!(
        "{} of {:.1} kg, friction {FRICTION}, is pushed to the left by {} N",
        model.name(),
        model.total_mass(),
        PUSH.y
    );
    println!("         moved, mm        f_z of each foot, N");
    println!("  t, s     y     z     LF    LH    RF    RH    ‖f_t‖ / μ f_n");
    let feet = FEET.map(|foot| ContactConstraint::point(model.frame(foot).expect("a foot of this robot")));
    let mut world = Ground::new(&model, &q, feet.to_vec());
    let mut f_ext = vec![Force::zero(); model.bodies().len()];
    let (mut worst, mut error, mut times) = (0.0f64, 0.0f64, Vec::new());
    for tick in 0..=2000 {
        let clock = Instant::now();
        let tau = controller.step(&world.q, &world.v, &references).solved()?.tau.clone();
        times.push(1e6 * clock.elapsed().as_secs_f64());
        error = controller.kkt_residuals(&world.q, &world.v, &references).worst().max(error);

        let pushed = (200..600).contains(&tick);
        f_ext[1].linear = if pushed { PUSH } else { Vec3::zero() }; // along the axes of the trunk, which hardly rotates
        let forces = world.step(&tau, &f_ext, DT);
        let used = forces.iter().map(|f| f.x.hypot(f.y) / (FRICTION * f.z)).fold(0.0, f64::max);
        assert!(used < 1.0 && forces.iter().all(|f| f.z > 0.0), "a foot slips or lifts at tick {tick}");
        worst = worst.max(used);
        if tick % 100 == 0 {
            print!("  {:4.1}", f64::from(tick) * DT);
            (1..3).for_each(|i| print!(" {:5.1}", 1e3 * (world.q[i] - q[i])));
            print!(" ");
            forces.iter().for_each(|f| print!(" {:5.1}", f.z));
            println!(" {used:16.2}");
        }
    }
    println!("\nNo foot left its cone: at worst {:.0} % of the friction was used.", 100.0 * worst);
    println!("Each tick is an optimum: the conditions of Karush, Kuhn and Tucker hold to {error:.0e}.");
    assert!(error < 1e-5);
    times.sort_by(f64::total_cmp);
    let quantile = |part: f64| times[(part * (times.len() - 1) as f64) as usize];
    println!("A tick takes {:.0} µs in the median, {:.0} µs in 99 of 100.", quantile(0.5), quantile(0.99));
    Ok(())
}
