//! Times the rigid-body algorithms, their derivatives, and the terms of the equations of motion, with single calls for
//! one state: `cargo bench -p condyle-benches --bench dynamics`.

use condyle::{
    Data, Model, aba, aba_derivatives,
    centroidal::{centroidal_map, centroidal_map_rate},
    crba, forward_accelerations, forward_kinematics, forward_velocities, minv, nonlinear_effects, random_configuration,
    regressors::{joint_torque_regressor, kinetic_energy_regressor, potential_energy_regressor},
    rnea, rnea_derivatives, robots,
    terms::{compute_all_terms, coriolis_matrix, static_torque},
};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

/// Number of states, which are used in turn. With a single state, the processor's branch prediction would learn this
/// state.
const STATES: usize = 16;

/// Position and velocity of a state, and a vector that serves as acceleration or effort.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
}

fn states(model: &Model) -> Vec<State> {
    let mut rng = StdRng::seed_from_u64(1);
    (0..STATES)
        .map(|_| {
            let q = random_configuration(model, &mut rng);
            let [v, x] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
            State { q, v, x }
        })
        .collect()
}

/// Computes the results of `compute_all_terms` by one function for each result.
fn apart(model: &Model, data: &mut Data<f64>, s: &State) {
    black_box(crba(model, data, &s.q));
    black_box(nonlinear_effects(model, data, &s.q, &s.v));
    black_box(centroidal_map_rate(model, data, &s.q, &s.v));
    let velocities = forward_velocities(model, data, &s.q, &s.v);
    black_box((velocities.kinetic_energy(), velocities.potential_energy()));
}

fn algorithms(c: &mut Criterion) {
    type Algorithm = fn(&Model, &mut Data<f64>, &State);
    let algorithms: [(&str, Algorithm); 17] = [
        ("rnea", |m, d, s| _ = black_box(rnea(m, d, &s.q, &s.v, &s.x, &[]))),
        ("crba", |m, d, s| _ = black_box(crba(m, d, &s.q))),
        ("aba", |m, d, s| _ = black_box(aba(m, d, &s.q, &s.v, &s.x, &[]))),
        ("minv", |m, d, s| _ = black_box(minv(m, d, &s.q))),
        ("rnea_derivatives", |m, d, s| _ = black_box(rnea_derivatives(m, d, &s.q, &s.v, &s.x, &[]))),
        ("aba_derivatives", |m, d, s| _ = black_box(aba_derivatives(m, d, &s.q, &s.v, &s.x, &[]))),
        ("joint_torque_regressor", |m, d, s| _ = black_box(joint_torque_regressor(m, d, &s.q, &s.v, &s.x))),
        ("energy_regressors", |m, d, s| {
            black_box(kinetic_energy_regressor(m, d, &s.q, &s.v));
            black_box(potential_energy_regressor(m, d, &s.q));
        }),
        ("forward_kinematics", |m, d, s| _ = black_box(forward_kinematics(m, d, &s.q))),
        ("forward_velocities", |m, d, s| _ = black_box(forward_velocities(m, d, &s.q, &s.v))),
        ("forward_accelerations", |m, d, s| _ = black_box(forward_accelerations(m, d, &s.q, &s.v, &s.x))),
        ("static_torque", |m, d, s| _ = black_box(static_torque(m, d, &s.q, &[]))),
        ("coriolis_matrix", |m, d, s| _ = black_box(coriolis_matrix(m, d, &s.q, &s.v))),
        ("centroidal_map", |m, d, s| _ = black_box(centroidal_map(m, d, &s.q))),
        ("centroidal_map_rate", |m, d, s| _ = black_box(centroidal_map_rate(m, d, &s.q, &s.v))),
        ("all terms together", |m, d, s| _ = black_box(compute_all_terms(m, d, &s.q, &s.v))),
        ("all terms apart", apart),
    ];
    let robots = [("arm7", robots::arm7()), ("quadruped", robots::quadruped()), ("humanoid", robots::humanoid())];
    for (name, algorithm) in algorithms {
        let mut group = c.benchmark_group(name);
        for (robot, model) in &robots {
            let (mut data, states) = (Data::new(model), states(model));
            group.bench_function(BenchmarkId::from_parameter(robot), |b| {
                let mut k = 0;
                b.iter(|| {
                    algorithm(model, &mut data, black_box(&states[k]));
                    k = (k + 1) % STATES;
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, algorithms);
criterion_main!(benches);
