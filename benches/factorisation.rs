//! Finds the fastest method for forward dynamics and for the inverse inertia matrix M⁻¹, for several sizes and shapes
//! of a tree: `cargo bench -p condyle-benches --bench factorisation`. `ForwardDynamicsMethod::fastest` has a rule that
//! follows from these results; `docs/performance.md` has the table. Computing M⁻¹ from the factor of M is faster than
//! the recursion if the factor's rows have at most about 12 entries on average.
#![allow(non_snake_case)]

use condyle::{
    Data, Model, ModelBuilder, Se3, WORLD, crba,
    factors::{Cholesky, ForwardDynamicsMethod, Ltdl, forward_dynamics},
    minv, random_configuration, robots,
};
use condyle_benches::tree;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::DMatrix;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::time::Duration;

const SIZES: [usize; 6] = [6, 12, 25, 50, 100, 200];

fn models() -> Vec<(String, Model)> {
    let mut models = vec![
        ("arm7".to_owned(), robots::arm7()),
        ("quadruped".to_owned(), robots::quadruped()),
        ("humanoid".to_owned(), robots::humanoid()),
    ];
    for n in SIZES {
        models.push((format!("chain of {n}"), tree(n, |i| i - 1)));
        models.push((format!("binary tree of {n}"), tree(n, |i| i / 2)));
        models.push((format!("star of {n}"), tree(n, |i| usize::from(i > 1))));
    }
    models
}

fn factorisation(c: &mut Criterion) {
    for (name, model) in models() {
        let mut rng = StdRng::seed_from_u64(1);
        let q = random_configuration(&model, &mut rng);
        let [v, tau] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect::<Vec<f64>>());
        let mut data = Data::new(&model);

        let mut group = c.benchmark_group(format!("forward dynamics/{name}"));
        for method in
            [ForwardDynamicsMethod::ArticulatedBody, ForwardDynamicsMethod::Dense, ForwardDynamicsMethod::Sparse]
        {
            group.bench_function(BenchmarkId::from_parameter(format!("{method:?}")), |b| {
                b.iter(|| {
                    _ = black_box(forward_dynamics(&model, &mut data, black_box(&q), &v, &tau, &[], Some(method)))
                });
            });
        }
        group.finish();

        let (mut sparse, mut dense) = factors(c, &name, &model);

        let mut x = tau.clone();
        let mut group = c.benchmark_group(format!("solve/{name}"));
        group.bench_function("Dense", |b| {
            b.iter(|| {
                x.copy_from_slice(black_box(&tau));
                dense.solve(&mut x);
            });
        });
        group.bench_function("Sparse", |b| {
            b.iter(|| {
                x.copy_from_slice(black_box(&tau));
                sparse.solve(&mut x);
            });
        });
        group.finish();

        let mut X = DMatrix::zeros(model.nv(), model.nv());
        let mut group = c.benchmark_group(format!("inverse of M/{name}"));
        group.bench_function("minv", |b| b.iter(|| _ = black_box(minv(&model, &mut data, black_box(&q)))));
        group.bench_function("Dense", |b| {
            b.iter(|| {
                dense.factorize(crba(&model, &mut data, black_box(&q)));
                dense.inverse(&mut X);
            });
        });
        group.bench_function("Sparse", |b| {
            b.iter(|| {
                sparse.factorize(crba(&model, &mut data, black_box(&q)));
                sparse.inverse(&mut X);
            });
        });
        group.finish();
    }
}

/// Measures the sparse and the dense factor of M.
fn factors(c: &mut Criterion, name: &str, model: &Model) -> (Ltdl<f64>, Cholesky<f64>) {
    let q = random_configuration(model, &mut StdRng::seed_from_u64(1));
    let M = crba(model, &mut Data::new(model), &q).clone();
    let (mut sparse, mut dense) = (Ltdl::new(model), Cholesky::new(model.nv()));
    let mut group = c.benchmark_group(format!("factorise/{name}"));
    group.bench_function("Dense", |b| b.iter(|| dense.factorize(black_box(&M))));
    group.bench_function("Sparse", |b| b.iter(|| sparse.factorize(black_box(&M))));
    group.finish();
    (sparse, dense)
}

/// Measures models that contain several humanoids each.
fn crowds(c: &mut Criterion) {
    for n in [2, 4, 8, 22] {
        let (one, mut builder) = (robots::humanoid(), ModelBuilder::new("crowd"));
        for k in 0..n {
            builder.append(WORLD, Se3::identity(), &one, &format!("{k}_"));
        }
        factors(c, &format!("{n} humanoids"), &builder.build().expect("robots side by side are one"));
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(400))
        .sample_size(20);
    targets = factorisation, crowds
}
criterion_main!(benches);
