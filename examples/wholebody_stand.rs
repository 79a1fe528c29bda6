//! A quadruped stands on four point feet, is pushed, sways and comes back.
//!
//! Each millisecond one cone program gives the torques: whole-body control with true friction cones. The controller
//! knows nothing of the push, it sees only the state.
//!
//! The simulator holds the feet where they are, whatever force that takes: one linear system gives the acceleration
//! and the ground's forces. There is no slipping and no lifting in it. That is right as long as every force it finds
//! lies in its cone, so the example looks at each of them and says how close the worst one came. The controller holds
//! the feet's acceleration at 0 and the simulator their velocity after the step (with a pull back to where they stood),
//! so with a push, or with speed, the two find slightly different forces.
//!
//! ```text
//! cargo run --release --example wholebody_stand
//! ```
#![allow(non_snake_case)]

use condyle::wholebody::{FrameTask, FrictionContact, Gains, Settings, Tasks, WholeBodyController};
use condyle::{
    Data, Model, ReferenceFrame, Vec3, crba, forward_kinematics, integrate, nonlinear_effects, rnea, robots,
};
use nalgebra::{DMatrix, DVector};
use std::error::Error;
use std::time::Instant;

const FEET: [&str; 4] = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"];
const FRICTION: f64 = 0.6;
const DT: f64 = 1e-3; // s
const PUSH: Vec3<f64> = Vec3 { x: 0.0, y: 50.0, z: 0.0 }; // N, to the left
const PULL_BACK: f64 = 0.1; // the part of a foot's drift that the simulator takes back in a step

/// From 0.2 s to 0.6 s.
fn push(t: f64) -> Vec3<f64> {
    if (0.2..0.6).contains(&t) { PUSH } else { Vec3::zero() }
}

/// The robot on its held feet.
struct Simulator<'m> {
    model: &'m Model,
    data: Data<f64>,
    q: Vec<f64>,
    v: Vec<f64>,
    feet: [usize; 4],
    trunk: usize,
    anchors: [Vec3<f64>; 4],
}

impl Simulator<'_> {
    /// One step under torques τ and a push at the trunk's origin. Returns q̈ and the ground's forces:
    /// ```text
    /// M q̈ − Jᵀ f = τ + J_trunkᵀ F − h      J (v + Δt q̈) = −β (p − p₀) / Δt
    /// ```
    fn step(&mut self, tau: &[f64], push: Vec3<f64>) -> (Vec<f64>, Vec<Vec3<f64>>) {
        let Self { model, data, q, v, .. } = self;
        let nv = model.nv();
        let mut K = DMatrix::zeros(nv + 12, nv + 12);
        let mut r = DVector::zeros(nv + 12);
        K.view_mut((0, 0), (nv, nv)).copy_from(crba(model, data, q));
        for (i, h) in nonlinear_effects(model, data, q, v).iter().enumerate() {
            r[i] = tau[i] - h;
        }
        let placements = forward_kinematics(model, data, q);
        let mut J = DMatrix::zeros(6, nv);
        placements.frame_jacobian(self.trunk, ReferenceFrame::LocalWorldAligned, &mut J);
        for (i, x) in (J.rows(0, 3).transpose() * DVector::from(push.to_array().to_vec())).iter().enumerate() {
            r[i] += x;
        }
        for (k, &foot) in self.feet.iter().enumerate() {
            placements.frame_jacobian(foot, ReferenceFrame::LocalWorldAligned, &mut J);
            let (row, J) = (nv + 3 * k, J.rows(0, 3));
            K.view_mut((row, 0), (3, nv)).copy_from(&J);
            K.view_mut((0, row), (nv, 3)).copy_from(&-J.transpose());
            let drift = (placements.frame(foot).translation - self.anchors[k]).to_array();
            let velocity = J * DVector::from_column_slice(v);
            for i in 0..3 {
                r[row + i] = -velocity[i] / DT - PULL_BACK * drift[i] / (DT * DT);
            }
        }
        let x = K.lu().solve(&r).expect("four feet of bent legs are independent");
        let a = x.as_slice()[..nv].to_vec();
        for (v, a) in v.iter_mut().zip(&a) {
            *v += DT * a; // v⁺ = v + Δt q̈
        }
        let moved: Vec<f64> = v.iter().map(|v| DT * v).collect();
        let mut next = q.clone();
        integrate(model, q, &moved, &mut next); // q⁺ = q ⊕ Δt v⁺
        *q = next;
        (a, x.as_slice()[nv..].chunks(3).map(|f| Vec3::new(f[0], f[1], f[2])).collect())
    }
}

/// 0 for what would be printed as −0.000.
fn tidy(x: f64) -> f64 {
    if x.abs() < 0.0005 { 0.0 } else { x }
}

fn sum(forces: &[Vec3<f64>]) -> Vec3<f64> {
    forces.iter().fold(Vec3::zero(), |sum, &f| sum + f)
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = robots::quadruped();
    let mut q = vec![0.0, 0.0, 0.7 * 0.7f64.cos(), 0.0, 0.0, 0.0, 1.0]; // knees inwards, feet on the ground
    q.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);

    let contacts = FEET.map(|foot| FrictionContact::new(foot, FRICTION));
    let gains = Gains::critical(60.0);
    let upright =
        FrameTask { frame: "trunk".into(), linear: Vec3::zero(), angular: Vec3::new(10.0, 10.0, 10.0), gains };
    let mut tasks = Tasks { frames: vec![upright], ..Tasks::default() };
    tasks.com.gains = gains;
    let mut controller = WholeBodyController::new(&model, &contacts, tasks, Settings::default())?;
    let references = controller.hold(&q);

    let m = model.total_mass();
    let command = controller.step(&q, &[0.0; 18], &references)?;
    println!("{} of {m:.1} kg, friction {FRICTION}. Standing, the feet are to push with (N)", model.name());
    println!("                f_x      f_y      f_z");
    let line = |name: &str, f: Vec3<f64>| println!("  {name:10} {:8.3} {:8.3} {:8.3}", tidy(f.x), tidy(f.y), tidy(f.z));
    for (foot, &f) in FEET.iter().zip(&command.forces) {
        line(foot, f);
    }
    line("Σ f", sum(&command.forces));
    line("m (c̈ − g) ", (command.com_acceleration - *model.gravity()).scale(m));
    println!();

    println!("Pushed to the left by {} N from 0.2 s to 0.6 s; the ground's forces, in the simulation", PUSH.y);
    println!("         moved, mm        f_z of each foot, N           sideways, N");
    println!("  t, s     y     z     LF    LH    RF    RH      push + Σ f_y = m c̈_y    ‖f_t‖ / μ f_n");
    let mut data = Data::new(&model);
    let placements = forward_kinematics(&model, &mut data, &q);
    let feet = FEET.map(|foot| model.frame(foot).expect("a foot of this robot"));
    let anchors = feet.map(|foot| placements.frame(foot).translation);
    let trunk = model.frame("trunk")?;
    let start = q.clone();
    let mut simulator = Simulator { model: &model, data, q, v: vec![0.0; model.nv()], feet, trunk, anchors };
    let (mut worst, mut iterations, mut times) = (0.0f64, 0, Vec::new());
    for tick in 0..=2000 {
        let t = f64::from(tick) * DT;
        let clock = Instant::now();
        let command = controller.step(&simulator.q, &simulator.v, &references)?;
        times.push(1e6 * clock.elapsed().as_secs_f64());
        iterations += command.iterations;

        let (q, v) = (simulator.q.clone(), simulator.v.clone());
        let (a, forces) = simulator.step(&command.tau, push(t));
        let used = forces.iter().map(|f| f.x.hypot(f.y) / (FRICTION * f.z)).fold(0.0, f64::max);
        assert!(used < 1.0 && forces.iter().all(|f| f.z > 0.0), "a foot would slip or lift at {t} s");
        worst = worst.max(used);
        if tick % 100 == 0 {
            // All the force that the motion takes is what inverse dynamics asks of the base: R rnea₁₋₃ = m (c̈ − g).
            let R = forward_kinematics(&model, &mut simulator.data, &q).frame(trunk).rotation;
            let base = rnea(&model, &mut simulator.data, &q, &v, &a, &[]);
            let needed = R * Vec3::new(base[0], base[1], base[2]);
            let moved = |i: usize| tidy(1e3 * (q[i] - start[i]));
            print!("  {t:4.1} {:5.1} {:5.1} ", moved(1), moved(2));
            forces.iter().for_each(|f| print!(" {:5.1}", f.z));
            let (pushed, ground, needed) = (push(t).y, tidy(sum(&forces).y), tidy(needed.y));
            println!("     {pushed:5.1} {ground:+6.1} = {needed:6.1} {used:16.2}");
        }
    }
    println!("\nNo foot left its cone: at worst {:.0} % of the friction was used.", 100.0 * worst);
    times.sort_by(f64::total_cmp);
    let quantile = |part: f64| times[(part * (times.len() - 1) as f64) as usize];
    let each = f64::from(iterations) / times.len() as f64;
    println!(
        "One program a tick, {each:.1} iterations: {:.0} µs in the median, {:.0} µs in 9 of 10.",
        quantile(0.5),
        quantile(0.9)
    );
    Ok(())
}
