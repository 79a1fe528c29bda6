//! Finds the minimum number of bodies for which divide and conquer is faster than ABA, on one thread and on two
//! threads: `cargo bench -p condyle-benches --bench divide_conquer`.
//!
//! `docs/lanes.md` has the table for a tree of n bodies that is cut into two halves. If the tree is cut at every joint,
//! divide and conquer takes 8 times as long as ABA on one thread.

use condyle::{Data, aba, divide_conquer::DivideConquer, random_configuration, robots};
use condyle_benches::tree;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::time::Duration;

const SIZES: [usize; 5] = [10, 30, 100, 300, 1000];
const THREADS: [usize; 2] = [1, 2];

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
