//! Times the analytic derivatives for several sizes and shapes of a tree, compared with dual numbers and central
//! differences: `cargo bench -p condyle-benches --bench derivatives`.
//!
//! The throughput is the number of pairs per time. A pair consists of a joint and one of its ancestors, or of a joint
//! and itself. The number of pairs is n · depth, where n is the number of joints, and depth is the mean number of
//! joints on the path to the world. If the throughput is constant, the cost grows as O(n · depth).
//!
//! The table has results for n = 8, 32 and 128 on a Xeon with AVX-512 under `chrt -f 20 taskset -c 1`. The rows ∂τ and
//! ∂q̈ are first derivatives of efforts and accelerations; the rows λᵀ∂² are second derivatives of a sum with the
//! weights λ. A cell has the times of analytic derivatives (µs), and in brackets the times per pair (ns). Two ranges
//! over n follow: the time with dual numbers, and the time with central differences, each divided by the time of
//! analytic derivatives.
//!
//! | | shape | n = 8, 32, 128 |
//! | --- | --- | --- |
//! | ∂τ | chain | 1.2, 8.1, 103 (32, 15, 13) 19–56, 17–46 |
//! | ∂τ | binary tree | 1.1, 4.9, 30 (51, 36, 38) 21–196, 17–147 |
//! | ∂τ | star | 1.0, 4.2, 23 (69, 66, 88) 21–245, 17–182 |
//! | ∂q̈ | chain | 2.4, 17, 273 (67, 32, 33) 22–59, 22–39 |
//! | ∂q̈ | binary tree | 2.3, 15, 106 (108, 111, 136) 24–153, 24–90 |
//! | ∂q̈ | star | 2.2, 9.1, 66 (147, 144, 260) 24–232, 20–157 |
//! | λᵀ∂²τ | chain | 2.6, 19, 253 (72, 36, 31) 22–271, 15–176 |
//! | λᵀ∂²τ | binary tree | 2.2, 11, 91 (107, 80, 117) 23–218, 16–193 |
//! | λᵀ∂²τ | star | 2.3, 8.8, 48 (152, 139, 190) 25–325, 15–243 |
//! | λᵀ∂²q̈ | chain | 4.3, 52, 1227 (120, 98, 149) 27–233, 19–110 |
//! | λᵀ∂²q̈ | binary tree | 4.1, 26, 360 (196, 189, 464) 25–315, 18–143 |
//! | λᵀ∂²q̈ | star | 4.0, 20, 259 (264, 323, 1017) 23–233, 17–132 |
//!
//! The times of ∂τ and λᵀ∂²τ grow as O(n · depth), until most of the time is spent on writing n² zeros. On chains, ∂q̈
//! is the solution of a linear system, and its time grows in the same way. On other trees, ∂q̈ is computed as a matrix
//! product, whose time grows faster. On all trees, λᵀ∂²q̈ contains an additional matrix product, whose time also grows
//! faster.
use condyle::{
    Data, Model, Scalar, aba, aba_derivatives,
    derivatives::{LaneJacobian, StateFunction, aba_hessian, rnea_hessian},
    integrate, random_configuration, rnea, rnea_derivatives,
};
use condyle_benches::tree;
use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use num_dual::Dual64;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};
use std::hint::black_box;
use std::time::Duration;

const SIZES: [usize; 5] = [8, 16, 32, 64, 128];

/// Returns the number of pairs of a joint and one of its ancestors, plus the number of joints (each joint paired with
/// itself).
fn pairs(model: &Model) -> u64 {
    let mut depth = vec![0; model.bodies().len()];
    for (i, body) in model.bodies().iter().enumerate().skip(1) {
        depth[i] = depth[body.parent] + 1;
    }
    depth.iter().sum()
}

/// State (q, v), a vector x that serves as acceleration a or effort τ, and the weights λ of the second derivatives.
struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
    lambda: Vec<f64>,
}

impl State {
    fn random(model: &Model) -> Self {
        let mut rng = StdRng::seed_from_u64(1);
        let q = random_configuration(model, &mut rng);
        let mut vector = || (0..model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect();
        Self { q, v: vector(), x: vector(), lambda: vector() }
    }
}

/// Calls `f` for a step δ in one direction after the other: first at (q ⊕ δ, v, x), then at (q, v + δ, x), then at (q,
/// v, x + δ).
fn along_each<S: Scalar>(
    model: &Model,
    s: &State,
    directions: usize,
    steps: &[S],
    mut f: impl FnMut(&[S], &[S], &[S]),
) {
    let lift = |x: &[f64]| -> Vec<S> { x.iter().map(|&x| S::splat(x)).collect() };
    let (n, q0) = (model.nv(), lift(&s.q));
    let (mut q, mut v, mut x, mut delta) = (q0.clone(), lift(&s.v), lift(&s.x), lift(&vec![0.0; n]));
    for direction in 0..directions {
        let k = direction % n;
        for &step in steps {
            match direction / n {
                0 => {
                    delta[k] = step;
                    integrate(model, &q0, &delta, &mut q);
                    delta[k] = S::zero();
                }
                1 => v[k] = S::splat(s.v[k]) + step,
                _ => x[k] = S::splat(s.x[k]) + step,
            }
            f(&q, &v, &x);
        }
        match direction / n {
            0 => q.copy_from_slice(&q0),
            1 => v[k] = S::splat(s.v[k]),
            _ => x[k] = S::splat(s.x[k]),
        }
    }
}

type Group<'c> = BenchmarkGroup<'c, WallTime>;

/// Measures one method for all derivatives. `steps` contains the steps that the method needs for the derivative in one
/// direction, in the method's number type.
fn by_steps<S: Scalar>(group: &mut Group<'_>, way: &str, n: usize, model: &Model, s: &State, steps: &[S]) {
    let (mut data, nv) = (Data::<S>::new(model), model.nv());
    group.bench_function(BenchmarkId::new(format!("∂τ {way}"), n), |b| {
        b.iter(|| along_each(model, s, 3 * nv, steps, |q, v, a| _ = black_box(rnea(model, &mut data, q, v, a, &[]))));
    });
    group.bench_function(BenchmarkId::new(format!("∂q̈ {way}"), n), |b| {
        b.iter(|| {
            along_each(model, s, 3 * nv, steps, |q, v, tau| _ = black_box(aba(model, &mut data, q, v, tau, &[])))
        });
    });
    // The second derivatives are differentiated from the analytic first derivatives. ∂²/∂a∂a is known and not computed.
    group.bench_function(BenchmarkId::new(format!("λᵀ∂²τ {way}"), n), |b| {
        let mut call = |q: &[S], v: &[S], a: &[S]| _ = black_box(rnea_derivatives(model, &mut data, q, v, a, &[]));
        b.iter(|| along_each(model, s, 2 * nv, steps, &mut call));
    });
    group.bench_function(BenchmarkId::new(format!("λᵀ∂²q̈ {way}"), n), |b| {
        let mut call = |q: &[S], v: &[S], tau: &[S]| _ = black_box(aba_derivatives(model, &mut data, q, v, tau, &[]));
        b.iter(|| along_each(model, s, 2 * nv, steps, &mut call));
    });
}

fn by_hand(group: &mut Group<'_>, n: usize, model: &Model, s: &State) {
    let (mut data, State { q, v, x, lambda }) = (Data::new(model), s);
    group.bench_function(BenchmarkId::new("∂τ by hand", n), |b| {
        b.iter(|| _ = black_box(rnea_derivatives(model, &mut data, black_box(q), v, x, &[])));
    });
    group.bench_function(BenchmarkId::new("∂q̈ by hand", n), |b| {
        b.iter(|| _ = black_box(aba_derivatives(model, &mut data, black_box(q), v, x, &[])));
    });
    group.bench_function(BenchmarkId::new("λᵀ∂²τ by hand", n), |b| {
        b.iter(|| _ = black_box(rnea_hessian(model, &mut data, black_box(q), v, x, &[], lambda)));
    });
    group.bench_function(BenchmarkId::new("λᵀ∂²q̈ by hand", n), |b| {
        b.iter(|| _ = black_box(aba_hessian(model, &mut data, black_box(q), v, x, &[], lambda)));
    });
}

/// Function `rnea` or `aba` with the arguments (q, v, x).
struct Dynamics<'m> {
    model: &'m Model,
    forward: bool,
}

impl StateFunction for Dynamics<'_> {
    fn len(&self) -> usize {
        self.model.nv()
    }
    fn call<S: Scalar>(&mut self, data: &mut Data<S>, x: &[S], y: &mut [S]) {
        let (q, rest) = x.split_at(self.model.nq());
        let (v, x) = rest.split_at(self.model.nv());
        let of = if self.forward { aba(self.model, data, q, v, x, &[]) } else { rnea(self.model, data, q, v, x, &[]) };
        y.copy_from_slice(of);
    }
}

/// Measures derivatives by dual numbers in SIMD lanes. Each lane computes a different direction.
fn by_lanes(group: &mut Group<'_>, n: usize, model: &Model, s: &State) {
    let x = [&s.q[..], &s.v, &s.x].concat();
    let mut jacobian = LaneJacobian::new(model, x.len(), model.nv());
    for (what, forward) in [("∂τ", false), ("∂q̈", true)] {
        group.bench_function(BenchmarkId::new(format!("{what} by duals in lanes"), n), |b| {
            b.iter(|| _ = black_box(jacobian.of(model, black_box(&x), &mut Dynamics { model, forward })));
        });
    }
}

type Parent = fn(usize) -> usize;

fn derivatives(c: &mut Criterion) {
    let shapes: [(&str, Parent); 3] =
        [("chain", |i| i - 1), ("binary tree", |i| i / 2), ("star", |i| usize::from(i > 1))];
    for (shape, parent) in shapes {
        let mut group = c.benchmark_group(format!("derivatives/{shape}"));
        for n in SIZES {
            let model = tree(n, parent);
            let state = State::random(&model);
            group.throughput(Throughput::Elements(pairs(&model)));
            by_hand(&mut group, n, &model, &state);
            by_steps(&mut group, "by duals", n, &model, &state, &[Dual64::new(0.0, 1.0)]);
            by_steps(&mut group, "by differences", n, &model, &state, &[1e-5, -1e-5]);
            by_lanes(&mut group, n, &model, &state);
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(50))
        .measurement_time(Duration::from_millis(200))
        .sample_size(10);
    targets = derivatives
}
criterion_main!(benches);
