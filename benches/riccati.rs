//! Times the backward sweep per knot, with and without use of the structure of Euler steps: `cargo bench -p
//! condyle-benches --bench riccati`.
//!
//! The table has times in µs per knot on a Xeon at 2.5 GHz with the default build. Each time is from the shortest of
//! many sweeps of 50 knots. A column is a pair of sizes: ndx numbers of the state's tangent vector, and nu controls.
//!
//! | level | matrices | (76, 32) | (36, 12) | (18, 9) | (14, 7) |
//! | --- | --- | --- | --- | --- | --- |
//! | AVX-512 | with the structure | 46 | 8.4 | 2.6 | 1.7 |
//! | AVX-512 | dense | 65 | 9.1 | 2.7 | 1.6 |
//! | AVX2 | with the structure | 63 | 9.1 | 2.7 | 1.7 |
//! | AVX2 | dense | 106 | 11 | 2.9 | 1.8 |
//! | baseline | with the structure | 133 | 15 | 3.7 | 2.3 |
//! | baseline | dense | 222 | 22 | 4.9 | 2.7 |
//!
//! The sweep uses the structure if ndx is at least 16. The 46 µs of the first entry consist of three matrix products
//! (36 %, at 57 GFLOP/s), factor and gains (24 %), and waiting for 200 KB of memory per knot (10 %). Copies and
//! transposes take the rest.
//!
//! In a sweep in segments, some knots take longer than a usual knot, which takes 46, 8.1 and 1.6 µs on one thread for
//! ndx = 76, 36 and 14. If the value function after its segment is unknown, a knot takes 1.4, 1.3 and 1.0 times as long
//! as a usual knot. A link between two segments takes 1.9, 1.7 and 1.35 times as long as a usual knot. The figures of
//! `Sweep::set_segments` follow from these ratios. The benchmark group `segments` has the times of whole sweeps, on one
//! thread and on all threads.
#![allow(non_snake_case)]

use condyle::optimal::{LqKnot, Sweep};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::DMatrix;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::time::Duration;

const HORIZON: usize = 50;
const LONG: usize = 100;
const DT: f64 = 0.02;

/// Sizes (ndx, nu, rows of the free joint) of a humanoid, a quadruped, and arms of 7 and 9 joints.
const SIZES: [(usize, usize, usize); 4] = [(76, 32, 6), (36, 12, 6), (14, 7, 0), (18, 9, 0)];

/// Returns a knot of a problem with semi-implicit Euler steps and a convex cost.
fn knot(rng: &mut StdRng, ndx: usize, nu: usize, free: usize) -> LqKnot {
    let nv = ndx / 2;
    let mut random = |rows, columns| DMatrix::from_fn(rows, columns, |_, _| 2.0 * rng.random::<f64>() - 1.0);
    let mut knot = LqKnot::zeros(ndx, nu);
    let root = random(ndx + nu, ndx + nu);
    let hessian = &root * root.transpose() * DT + DMatrix::identity(ndx + nu, ndx + nu);
    knot.Q.copy_from(&hessian.view((0, 0), (ndx, ndx)));
    knot.S.copy_from(&hessian.view((0, ndx), (ndx, nu)));
    knot.R.copy_from(&hessian.view((ndx, ndx), (nu, nu)));
    knot.q.copy_from(&random(ndx, 1).column(0));
    knot.r.copy_from(&random(nu, 1).column(0));
    let lower =
        DMatrix::identity(nv, ndx).map_with_location(|r, c, _: f64| f64::from(c == nv + r)) + random(nv, ndx) * DT;
    let control = random(nv, nu) * DT;
    knot.A.rows_mut(0, nv).copy_from(&(&lower * DT + DMatrix::identity(nv, ndx)));
    knot.A.rows_mut(nv, nv).copy_from(&lower);
    knot.B.rows_mut(0, nv).copy_from(&(&control * DT));
    knot.B.rows_mut(nv, nv).copy_from(&control);
    let root = 0..free;
    knot.structure.set_euler(DT, if free > 0 { std::slice::from_ref(&root) } else { &[] }); // T and E are the identity
    knot
}

fn lq_knots(horizon: usize, (ndx, nu, free): (usize, usize, usize)) -> Vec<LqKnot> {
    let mut rng = StdRng::seed_from_u64(1);
    let mut lq_knots: Vec<_> = (0..horizon).map(|_| knot(&mut rng, ndx, nu, free)).collect();
    let mut end = LqKnot::zeros(ndx, 0);
    end.Q.fill_with_identity();
    lq_knots.push(end);
    lq_knots
}

fn sweep(c: &mut Criterion) {
    let mut group = c.benchmark_group("sweep");
    group.throughput(Throughput::Elements(HORIZON as u64));
    for (ndx, nu, free) in SIZES {
        let mut lq_knots = lq_knots(HORIZON, (ndx, nu, free));
        let mut sweep = Sweep::new(&lq_knots);
        for form in ["Euler", "dense"] {
            if form == "dense" {
                for knot in &mut lq_knots {
                    knot.structure.set_dense();
                }
            }
            let id = BenchmarkId::new(form, format!("ndx {ndx}, nu {nu}"));
            group.bench_function(id, |b| b.iter(|| sweep.run(black_box(&lq_knots), 1e-9)));
        }
    }
    group.finish();
}

fn segments(c: &mut Criterion) {
    let mut group = c.benchmark_group("segments");
    group.throughput(Throughput::Elements(LONG as u64));
    let all = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    for threads in [1, all] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
        for (ndx, nu, free) in &SIZES[..3] {
            let lq_knots = lq_knots(LONG, (*ndx, *nu, *free));
            let mut sweep = Sweep::new(&lq_knots);
            for segments in [1, 2, 4, 8] {
                sweep.set_segments(segments);
                let id = BenchmarkId::new(format!("{segments} on {threads} threads"), format!("ndx {ndx}, nu {nu}"));
                group.bench_function(id, |b| pool.install(|| b.iter(|| sweep.run(black_box(&lq_knots), 1e-9))));
            }
        }
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(30)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(2));
    targets = sweep, segments
}
criterion_main!(benches);
