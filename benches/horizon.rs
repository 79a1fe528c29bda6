//! Work of a solver at each of the 100 knots of a horizon: forward dynamics, their derivatives, and inverse dynamics.
//! `cargo bench --bench horizon`

use condyle::{Data, Model, aba, aba_derivatives, random_configuration, rnea, robots};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;

const KNOTS: usize = 100;

/// A position, a velocity, an effort.
type Knot = [Vec<f64>; 3];

fn knots(model: &Model) -> Vec<Knot> {
    let mut rng = StdRng::seed_from_u64(1);
    (0..KNOTS)
        .map(|_| {
            let q = random_configuration(model, &mut rng);
            let [v, tau] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
            [q, v, tau]
        })
        .collect()
}

fn horizon(c: &mut Criterion) {
    let mut group = c.benchmark_group("horizon of 100 knots");
    for (robot, model) in
        [("arm7", robots::arm7()), ("quadruped", robots::quadruped()), ("humanoid", robots::humanoid())]
    {
        let (mut data, knots) = (Data::new(&model), knots(&model));
        group.bench_function(BenchmarkId::from_parameter(robot), |b| {
            b.iter(|| {
                for [q, v, tau] in black_box(&knots) {
                    black_box(aba(&model, &mut data, q, v, tau, &[]));
                    black_box(aba_derivatives(&model, &mut data, q, v, tau, &[]));
                    black_box(rnea(&model, &mut data, q, v, tau, &[]));
                }
            });
        });
    }
    group.finish();
}

criterion_group!(benches, horizon);
criterion_main!(benches);
