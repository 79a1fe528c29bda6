//! Size from which divide and conquer is faster, on one thread and on two: `cargo bench --bench divide_conquer`.
//!
//! `docs/lanes.md` has the table of runs of n/2 bodies. Runs of one body take 8 times as long as ABA on one thread.

use condyle::{
    Data, Inertia, Joint, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, aba, divide_conquer::DivideConquer,
    random_configuration, robots, spatial::Mat3, tree::BodyId,
};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::time::Duration;

const SIZES: [usize; 5] = [10, 30, 100, 300, 1000];
const THREADS: [usize; 2] = [1, 2];

/// Builds n hinges; the parent of each body is given by `parent`.
fn tree(n: usize, parent: impl Fn(usize) -> usize) -> Model {
    let mut rng = StdRng::seed_from_u64(7);
    let mut builder = ModelBuilder::new("tree");
    let mut ids: Vec<BodyId> = vec![WORLD];
    for i in 1..=n {
        let mut r = || 0.2 * rng.random::<f64>() - 0.1;
        let inertia = Inertia::from_com(1.0, Vec3::new(r(), r(), r()), Sym3::diagonal(0.01));
        let placement = Se3::new(Mat3::identity(), Vec3::new(r(), r(), 0.2));
        let axis = Vec3::from(core::array::from_fn(|k| if k == i % 3 { 1.0 } else { 0.0 }));
        ids.push(builder.body(&format!("b{i}"), ids[parent(i)], Joint::Revolute { axis }, placement, inertia));
    }
    builder.build().expect("a tree is well-formed")
}

fn divide_conquer(c: &mut Criterion) {
    let pools = THREADS
        .map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started"));
    let mut models = vec![("humanoid".to_owned(), robots::humanoid())];
    for n in SIZES {
        models.push((format!("chain of {n}"), tree(n, |i| i - 1)));
        models.push((format!("binary tree of {n}"), tree(n, |i| i / 2)));
        models.push((format!("star of {n}"), tree(n, |i| usize::from(i > 1))));
    }
    for (name, model) in models {
        let mut rng = StdRng::seed_from_u64(1);
        let q = random_configuration(&model, &mut rng);
        let [v, tau] = [(); 2].map(|()| (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect::<Vec<f64>>());
        let mut group = c.benchmark_group(format!("divide and conquer/{name}"));
        let mut data = Data::new(&model);
        group.bench_function("aba", |b| {
            b.iter(|| _ = black_box(aba(&model, &mut data, black_box(&q), &v, &tau, &[])));
        });
        let n = model.bodies().len() - 1;
        for grain in [1, n.div_ceil(8), n.div_ceil(2)] {
            let mut divided = DivideConquer::new(&model, grain);
            for (threads, pool) in THREADS.into_iter().zip(&pools) {
                group.bench_function(BenchmarkId::new(format!("grain {grain}"), format!("{threads} threads")), |b| {
                    pool.install(|| b.iter(|| _ = black_box(divided.aba(&model, black_box(&q), &v, &tau, &[]))));
                });
            }
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(100))
        .measurement_time(Duration::from_millis(400))
        .sample_size(20);
    targets = divide_conquer
}
criterion_main!(benches);
