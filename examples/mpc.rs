//! Model predictive control of an arm at a fixed rate. The tool follows a moving point under disturbances.
//!
//! `cargo run --release --example mpc`
//!
//! Every 10 ms the loop reads the state x and applies the control u + K (x ⊖ x̄), with the control u, the gains K and
//! the state x̄ of the last plan. Then it shifts the horizon by a knot, and improves the plan by one iteration within 5
//! ms. The example prints the error of the tool and the timing of the loop. If an iteration takes longer than 5 ms, the
//! solve ends after this iteration and reports the overrun. The next solve has its whole time budget again.

use condyle::optimal::robot::{Activation, Cost, FreeDynamics, Residual};
use condyle::optimal::{ActionModel, Fddp, Problem, Status};
use condyle::{Data, Vec3, forward_kinematics, robots};
use std::sync::Arc;
use std::time::{Duration, Instant};

const DT: f64 = 0.01;
const HORIZON: usize = 30;
const STEPS: usize = 500;
const BUDGET: Duration = Duration::from_millis(5);

/// Returns the target of the tool at a time. The target runs around a circle in 2.5 s.
fn target(time: f64) -> Vec3<f64> {
    let (sin, cos) = (time * core::f64::consts::TAU / 2.5).sin_cos();
    Vec3::new(0.45, 0.15 * cos, 0.45 + 0.15 * sin)
}

/// Returns the costs of a knot, which move the tool to the target at step `step`. `controls` is the knot's number of
/// controls.
fn costs(rest: &[f64], step: usize, controls: usize) -> Vec<Cost> {
    let follow = Residual::FrameTranslation { frame: "tool".into(), target: target(step as f64 * DT) };
    let effort = Residual::Control { reference: vec![0.0; controls] };
    vec![
        Cost::new("follow", 1e3, follow, Activation::Quadratic),
        Cost::new("rest", 1e-1, Residual::State { reference: rest.to_vec() }, Activation::Quadratic),
        Cost::new("effort", 1e-3, effort, Activation::Quadratic),
    ]
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arm = Arc::new(robots::arm7());
    let rest = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
    // All knots share one action model of the arm. Each knot has its own target, which stays the same when the horizon
    // is shifted.
    let mut knot = FreeDynamics::running(arm.clone(), DT, vec![])?;
    for t in 0..HORIZON {
        knot.set_costs(t, costs(&rest, t, 7))?;
    }
    let mut plant = knot.clone();
    let hold = plant.quasi_static(&rest);
    let end = FreeDynamics::terminal(arm.clone(), costs(&rest, HORIZON, 0))?;
    let mut problem = Problem::new(rest.clone(), vec![Box::new(knot)], vec![0; HORIZON], Box::new(end))?;

    let mut solver = Fddp::new(&problem);
    solver.solve(&mut problem, &rest.repeat(HORIZON + 1), &hold.repeat(HORIZON))?;
    (solver.settings.max_iterations, solver.settings.tolerance) = (1, 0.0);
    solver.settings.time_budget = Some(BUDGET);

    let (mut x, mut u, mut dx, mut next) = (rest.clone(), hold, vec![0.0; 14], rest.clone());
    let (mut late, mut used, mut cut_short, mut overrun) = (Vec::new(), Vec::new(), 0, 0);
    let (mut errors, mut data) = (Vec::new(), Data::new(&arm));
    let begin = Instant::now();
    for step in 0..STEPS {
        let due = begin + Duration::from_secs_f64(DT) * step as u32;
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
        late.push(due.elapsed());

        // apply u = ū + K (x ⊖ x̄)
        let plan = solver.solution();
        plant.difference(plan.x(0), &x, &mut dx);
        for (i, u) in u.iter_mut().enumerate() {
            *u = plan.u(0)[i] + plan.K[0].row(i).iter().zip(&dx).map(|(k, dx)| k * dx).sum::<f64>();
        }
        // Simulate the arm. At two steps, a disturbance adds 1 rad/s to the speed of the elbow.
        plant.calc(0, &x, &u, &mut next);
        if step == STEPS / 3 || step == 2 * STEPS / 3 {
            next[7 + 3] += 1.0;
        }
        x.copy_from_slice(&next);

        // Shift the horizon. Then set new targets for the horizon's last knot and for the terminal.
        problem.shift(0)?;
        let knots: &mut FreeDynamics = problem.model_mut(0).expect("it serves all knots");
        knots.set_costs(HORIZON - 1, costs(&rest, step + HORIZON, 7))?;
        let end: &mut FreeDynamics = problem.terminal_mut().expect("it is a robot's");
        end.set_costs(HORIZON, costs(&rest, step + 1 + HORIZON, 0))?;
        solver.shift(&mut problem)?;
        problem.set_x0(&x)?;
        let plan = solver.resume(&mut problem)?;
        cut_short += usize::from(plan.status == Status::TimeLimit);
        overrun += usize::from(!plan.timings.overrun.is_zero());
        used.push(plan.timings.total);

        let tool = forward_kinematics(&arm, &mut data, &x[..7]).frame(arm.frame("tool")?).translation;
        let off = tool - target((step + 1) as f64 * DT);
        errors.push(off.norm_squared().sqrt());
    }

    let percentile = |times: &mut Vec<Duration>, p: usize| {
        times.sort();
        times[(times.len() - 1) * p / 100]
    };
    println!("{STEPS} steps of {:.0} ms; a plan has {HORIZON} knots", DT * 1e3);
    println!(
        "woken late:     median {:?}, 99 % {:?}, worst {:?}",
        percentile(&mut late, 50),
        percentile(&mut late, 99),
        percentile(&mut late, 100)
    );
    println!(
        "an iteration:   median {:?}, 99 % {:?}, worst {:?}",
        percentile(&mut used, 50),
        percentile(&mut used, 99),
        percentile(&mut used, 100)
    );
    println!("out of time:    {cut_short} times, over the budget {overrun} times");
    let worst = |errors: &[f64]| errors.iter().fold(0.0, |worst: f64, e| worst.max(*e));
    println!(
        "off the target: {:.1} mm at worst, {:.1} mm before the first push",
        1e3 * worst(&errors[50..]),
        1e3 * worst(&errors[50..STEPS / 3])
    );
    Ok(())
}
