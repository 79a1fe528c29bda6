//! One step of each integrator: `cargo bench --bench simulation`. What the steps are worth: `examples/energy_drift.rs`.

use condyle::simulation::{Integrator, Settings, Simulation};
use condyle::{random_configuration, robots};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

/// From how many states steps are taken, one after the other.
const STATES: usize = 16;

/// A step of 1 ms from a random state, with efforts; joints without losses.
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

criterion_group!(benches, step);
criterion_main!(benches);
