//! Times one step of each integrator: `cargo bench -p condyle-benches --bench simulation`. `examples/energy_drift.rs`
//! shows the accuracy of the steps.

use condyle::simulation::{Ground, Integrator, Settings, Simulation};
use condyle::{Data, Vec3, forward_kinematics, neutral, random_configuration, robots};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

/// Number of initial states. The benchmark uses one after the other.
const STATES: usize = 16;

/// Measures a step of 1 ms from a random state, with efforts. The joints have neither friction nor damping.
fn step(c: &mut Criterion) {
    let integrators = [
        ("step_semi_implicit_euler", Integrator::SemiImplicitEuler),
        ("step_runge_kutta", Integrator::RungeKutta4),
        ("step_variational", Integrator::Variational),
    ];
    let robots = [("arm7", robots::arm7()), ("quadruped", robots::quadruped()), ("humanoid", robots::humanoid())];
    for (name, integrator) in integrators {
        let mut group = c.benchmark_group(name);
        for (robot, model) in &robots {
            let mut rng = StdRng::seed_from_u64(1);
            let mut vector = || -> Vec<f64> { (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect() };
            let states: Vec<_> = (0..STATES).map(|_| [vector(), vector()]).collect();
            let positions: Vec<_> = (0..STATES).map(|_| random_configuration(model, &mut rng)).collect();
            let mut simulation = Simulation::<f64>::new(model, Settings { integrator, ..Settings::default() });
            group.bench_function(BenchmarkId::from_parameter(robot), |b| {
                let mut k = 0;
                b.iter(|| {
                    let [v, tau] = &states[k];
                    simulation.set_state(&positions[k], v).expect("the state is valid");
                    let status = simulation.step(black_box(tau), &[]);
                    assert!(status.is_done(), "{status:?}");
                    k = (k + 1) % STATES;
                });
            });
        }
        group.finish();
    }
}

/// Measures a step of 1 ms of a robot on the ground, without an initial guess of the contact impulses. The contacts are
/// four feet, or the eight corners of two soles.
fn step_on_ground(c: &mut Criterion) {
    let corners = [(0.1, 0.05), (0.1, -0.05), (-0.1, -0.05), (-0.1, 0.05)].map(|(x, y)| Vec3::new(x, y, 0.0));
    let robots = [
        ("quadruped", robots::quadruped(), &["LF_foot", "RF_foot", "LH_foot", "RH_foot"][..], &[Vec3::zero()][..]),
        ("humanoid", robots::humanoid(), &["left_sole", "right_sole"][..], &corners[..]),
    ];
    let mut group = c.benchmark_group("step_on_ground");
    for (robot, model, feet, sole) in robots {
        let frames = feet.iter().map(|foot| model.frame(foot).expect("the robot has this frame"));
        let ground = frames.clone().fold(Ground::default(), |ground, frame| ground.with_sole(frame, sole));
        let (mut q, v) = (neutral(&model), vec![0.0; model.nv()]);
        q[2] -= forward_kinematics(&model, &mut Data::new(&model), &q).frame(ground.points[0].frame).translation.z;
        let mut simulation = Simulation::<f64>::new(model, Settings::default());
        simulation.set_ground(ground).expect("the ground fits the robot");
        group.bench_function(BenchmarkId::from_parameter(robot), |b| {
            b.iter(|| {
                simulation.set_state(&q, &v).expect("the state is valid");
                let status = simulation.step(black_box(&v), &[]);
                assert!(status.is_done(), "{status}");
            });
        });
    }
    group.finish();
}

criterion_group!(benches, step, step_on_ground);
criterion_main!(benches);
