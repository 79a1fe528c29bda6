//! Times the work of a solver for a horizon with N knots: the dynamics at all knots, and one iteration of FDDP. `cargo
//! bench -p condyle-benches --bench horizon`
//!
//! At each knot, RNEA, ABA and the derivatives of both are computed. Three variants are measured: one call at a time, a
//! batch on one thread (several knots in the lanes of vectors), and a batch on all threads. An iteration of FDDP starts
//! from the last solution with a disturbed initial state, as in MPC. `condyle budget` measures the same times for any
//! robot.

use condyle::optimal::robot::{Activation, Actuation, Cost, FreeDynamics, Residual};
use condyle::optimal::{Fddp, Problem};
use condyle::rand::rngs::StdRng;
use condyle::rand::{RngExt, SeedableRng};
use condyle::{
    Batch, Data, Model, aba, aba_derivatives, integrate, neutral, random_configuration, rnea, rnea_derivatives, robots,
};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Duration;

const KNOTS: [usize; 5] = [20, 60, 100, 115, 200];
/// Time between two knots (s).
const DT: f64 = 0.01;
/// Maximum difference between a new initial state and the previous initial state (rad and m; rad/s and m/s for
/// velocities).
const DISTURBANCE: f64 = 1e-3;

/// Positions, velocities, accelerations and efforts of all knots, one knot after the other.
struct States {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
}

impl States {
    fn new(model: &Model, knots: usize) -> Self {
        let mut rng = StdRng::seed_from_u64(1);
        let q = (0..knots).flat_map(|_| random_configuration(model, &mut rng)).collect();
        let [v, a, tau] = [(); 3].map(|()| (0..knots * model.nv()).map(|_| 2.0 * rng.random::<f64>() - 1.0).collect());
        Self { q, v, a, tau }
    }

    /// Computes one knot after the other in single calls.
    fn single(&self, model: &Model, data: &mut Data<f64>) {
        let (nq, nv) = (model.nq(), model.nv());
        for k in 0..self.q.len() / nq {
            let [v, a, tau] = [&self.v, &self.a, &self.tau].map(|x| &x[k * nv..(k + 1) * nv]);
            let q = &self.q[k * nq..(k + 1) * nq];
            black_box(rnea(model, data, q, v, a, &[]));
            black_box(rnea_derivatives(model, data, q, v, a, &[]));
            black_box(aba(model, data, q, v, tau, &[]));
            black_box(aba_derivatives(model, data, q, v, tau, &[]));
        }
    }

    /// Computes all knots as a batch.
    fn batch(&self, model: &Model, batch: &mut Batch) {
        let Self { q, v, a, tau } = self;
        black_box(batch.rnea(model, q, v, a, &[]));
        black_box(batch.rnea_derivatives(model, q, v, a, &[]));
        black_box(batch.aba(model, q, v, tau, &[]));
        black_box(batch.aba_derivatives(model, q, v, tau, &[]));
    }
}

fn robots() -> [(&'static str, Model); 3] {
    [("arm7", robots::arm7()), ("quadruped", robots::quadruped()), ("humanoid", robots::humanoid())]
}

fn threads() -> usize {
    available_parallelism().map_or(1, |n| n.get())
}

fn dynamics(c: &mut Criterion) {
    for (robot, model) in robots() {
        let mut group = c.benchmark_group(format!("horizon/{robot}"));
        for knots in KNOTS {
            let (states, mut data) = (States::new(&model, knots), Data::new(&model));
            group.throughput(Throughput::Elements(knots as u64));
            group.bench_function(BenchmarkId::new("one call at a time", knots), |b| {
                b.iter(|| black_box(&states).single(&model, &mut data));
            });
            for (name, threads) in [("batch", 1), ("threads", threads())] {
                let mut batch = Batch::new(&model, knots, threads);
                group.bench_function(BenchmarkId::new(name, knots), |b| {
                    b.iter(|| black_box(&states).batch(&model, &mut batch));
                });
            }
        }
        group.finish();
    }
}

/// Returns the problem of staying at the initial state with little effort, and initial controls.
fn problem(model: &Arc<Model>, knots: usize) -> (Problem, Vec<f64>) {
    let x0 = [neutral(model), vec![0.0; model.nv()]].concat();
    let state =
        |weight: f64| Cost::new("state", weight, Residual::State { reference: x0.clone() }, Activation::Quadratic);
    let effort = Residual::Control { reference: vec![0.0; Actuation::joints(model).nu()] };
    let costs = vec![state(1e0), Cost::new("effort", 1e-3, effort, Activation::Quadratic)];
    let mut knot = FreeDynamics::running(model.clone(), DT, costs).expect("the costs are those of this robot");
    let end = FreeDynamics::terminal(model.clone(), vec![state(1e1)]).expect("the costs are those of this robot");
    let us = knot.quasi_static(&x0).repeat(knots);
    let problem = Problem::new(x0, vec![Box::new(knot)], vec![0; knots], Box::new(end)).expect("all knots are alike");
    (problem, us)
}

fn iterations(c: &mut Criterion) {
    for (robot, model) in robots() {
        let model = Arc::new(model);
        let mut group = c.benchmark_group(format!("one iteration of FDDP/{robot}"));
        for knots in KNOTS {
            for threads in [1, threads()] {
                let (mut problem, us) = problem(&model, knots);
                let x0 = problem.x0().to_vec();
                let mut solver = Fddp::new(&problem);
                solver.settings.tolerance = 0.0; // makes the solver use the maximum number of iterations
                (solver.settings.threads, solver.settings.max_iterations) = (threads, 3);
                solver.solve(&mut problem, &x0.repeat(knots + 1), &us).expect("states and controls fit");
                solver.settings.max_iterations = 1;
                let (mut rng, mut x) = (StdRng::seed_from_u64(1), x0.clone());
                group.bench_function(BenchmarkId::new(format!("{threads} threads"), knots), |b| {
                    b.iter(|| {
                        let dx: Vec<f64> =
                            (0..2 * model.nv()).map(|_| DISTURBANCE * (2.0 * rng.random::<f64>() - 1.0)).collect();
                        let (dq, dv) = dx.split_at(model.nv());
                        integrate(&model, &x0[..model.nq()], dq, &mut x[..model.nq()]);
                        x[model.nq()..].copy_from_slice(dv);
                        problem.set_x0(&x).expect("x has the length of a state");
                        black_box(solver.resume(&mut problem).expect("the problem is the solver's").cost);
                    });
                });
                if threads == self::threads() {
                    break; // with one core, both numbers of threads are 1
                }
            }
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(800))
        .sample_size(20);
    targets = dynamics, iterations
}
criterion_main!(benches);
