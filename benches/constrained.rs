//! Times the dynamics under contacts and the derivatives of this dynamics, with single calls for one state: `cargo
//! bench -p condyle-benches --bench constrained`.

use condyle::{
    ConstraintSet, ContactConstraint, Data, Model, constrained_dynamics, constrained_dynamics_derivatives,
    constraints::{
        constrained_inverse_dynamics, constrained_inverse_dynamics_derivatives, impulse_dynamics,
        impulse_dynamics_derivatives,
    },
    random_configuration, robots,
};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

/// Number of states, which are used in turn. With a single state, the processor's branch prediction would learn this
/// state.
const STATES: usize = 16;

/// Position, velocity and effort of one state.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    tau: Vec<f64>,
}

fn states(model: &Model) -> Vec<State> {
    let mut rng = StdRng::seed_from_u64(1);
    (0..STATES)
        .map(|_| {
            let q = random_configuration(model, &mut rng);
            let [v, tau] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
            State { q, v, tau }
        })
        .collect()
}

fn algorithms(c: &mut Criterion) {
    type Algorithm = fn(&Model, &mut Data<f64>, &mut ConstraintSet<f64>, &State);
    let algorithms: [(&str, Algorithm); 6] = [
        ("constrained_dynamics", |m, d, c, s| {
            black_box(constrained_dynamics(m, d, c, &s.q, &s.v, &s.tau, &[]));
        }),
        ("constrained_dynamics_derivatives", |m, d, c, s| {
            black_box(constrained_dynamics_derivatives(m, d, c, &s.q, &s.v, &s.tau, &[]));
        }),
        ("constrained_inverse_dynamics", |m, d, c, s| {
            let lambda = &[1.0; 12][..c.rows()];
            black_box(constrained_inverse_dynamics(m, d, c, &s.q, &s.v, &s.tau, lambda, &[]));
        }),
        ("constrained_inverse_dynamics_derivatives", |m, d, c, s| {
            let lambda = &[1.0; 12][..c.rows()];
            black_box(constrained_inverse_dynamics_derivatives(m, d, c, &s.q, &s.v, &s.tau, lambda, &[]));
        }),
        ("impulse_dynamics", |m, d, c, s| _ = black_box(impulse_dynamics(m, d, c, &s.q, &s.v, 0.0))),
        ("impulse_dynamics_derivatives", |m, d, c, s| {
            black_box(impulse_dynamics_derivatives(m, d, c, &s.q, &s.v, 0.0));
        }),
    ];
    let (quadruped, humanoid) = (robots::quadruped(), robots::humanoid());
    let feet =
        ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|name| quadruped.frame(name).expect("it has this foot"));
    let soles = ["left_sole", "right_sole"].map(|name| humanoid.frame(name).expect("it has this sole"));
    let stances = [
        ("quadruped on four points", &quadruped, feet.map(ContactConstraint::point).to_vec()),
        ("humanoid on two soles", &humanoid, soles.map(ContactConstraint::rigid).to_vec()),
    ];
    for (name, algorithm) in algorithms {
        let mut group = c.benchmark_group(name);
        for (stance, model, constraints) in &stances {
            let (mut data, states) = (Data::new(model), states(model));
            let mut set = ConstraintSet::new(model, constraints).expect("the constraints are right");
            group.bench_function(BenchmarkId::from_parameter(stance), |b| {
                let mut k = 0;
                b.iter(|| {
                    algorithm(model, &mut data, &mut set, black_box(&states[k]));
                    k = (k + 1) % STATES;
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, algorithms);
criterion_main!(benches);
