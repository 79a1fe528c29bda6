//! Times single calls of Condyle. The script `dynamics.py` builds and runs this program, and a program that times
//! Pinocchio.
//!
//! ```text
//! ours URDF fixed|free_flyer LOCKED,JOINTS STATES [batch]
//! ```
//!
//! STATES is a file with q, v, a, τ of one state after the other, as 64-bit floating-point numbers. The program prints
//! a line for each algorithm: its name and the median time of a call in ns. The derivatives of `rnea` are also timed by
//! dual numbers and by central differences. Lines with `batch:` have the time per state of a batch. Lines with
//! `horizon:` have the time for N knots of `aba`, the derivatives of `aba`, and `rnea`. With the argument `batch`, the
//! program times only batches, and prints the least time instead of the median (see `python.py`).

use condyle::{
    Batch, Data, Joint, Model, UrdfOptions, aba, aba_derivatives, crba,
    derivatives::{aba_hessian, rnea_hessian},
    integrate, minv, rnea, rnea_derivatives,
};
use num_dual::Dual64;
use std::hint::black_box;
use std::time::Instant;

struct State {
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    tau: Vec<f64>,
}

/// Returns the median, over all series of calls, of the mean time of a call (ns).
fn median(states: &[State], call: impl FnMut(&State)) -> f64 {
    timed(states, 10, call)
}

/// Returns the mean time of a call (ns) in one of 21 series of calls, sorted by time. `rank` selects the series; rank 0
/// is the fastest.
fn timed(states: &[State], rank: usize, mut call: impl FnMut(&State)) -> f64 {
    let mut batch = |calls: usize| {
        let start = Instant::now();
        (0..calls).for_each(|i| call(black_box(&states[i % states.len()])));
        start.elapsed().as_secs_f64() * 1e9 / calls as f64
    };
    batch(200);
    let calls = ((2e6 / batch(50)) as usize).max(2);
    let mut times: Vec<f64> = (0..21).map(|_| batch(calls)).collect();
    times.sort_by(f64::total_cmp);
    times[rank]
}

/// Computes ∂τ/∂q by dual numbers, column by column.
fn by_duals(model: &Model, data: &mut Data<Dual64>, s: &State) -> f64 {
    let lift = |x: &[f64]| -> Vec<Dual64> { x.iter().map(|&x| x.into()).collect() };
    let (q0, v, a) = (lift(&s.q), lift(&s.v), lift(&s.a));
    let (mut q, mut step) = (q0.clone(), vec![Dual64::from(0.0); model.nv()]);
    let mut sum = 0.0;
    for k in 0..model.nv() {
        step[k].eps = 1.0;
        integrate(model, &q0, &step, &mut q);
        sum += rnea(model, data, &q, &v, &a, &[])[0].eps;
        step[k].eps = 0.0;
    }
    sum
}

/// Computes ∂τ/∂q by central differences.
fn by_differences(model: &Model, data: &mut Data<f64>, s: &State) -> f64 {
    let (mut q, mut step) = (s.q.clone(), vec![0.0; model.nv()]);
    let mut sum = 0.0;
    for k in 0..model.nv() {
        for h in [1e-5, -1e-5] {
            step[k] = h;
            integrate(model, &s.q, &step, &mut q);
            sum += rnea(model, data, &q, &s.v, &s.a, &[])[0] / (2.0 * h);
        }
        step[k] = 0.0;
    }
    sum
}

/// Measures the times of calls for one state.
fn singles(m: &Model, states: &[State]) {
    let (d, duals) = (&mut Data::new(m), &mut Data::<Dual64>::new(m));
    let print = |name: &str, ns: f64| println!("{name} {ns:.2}");
    print("rnea", median(states, |s| _ = black_box(rnea(m, d, &s.q, &s.v, &s.a, &[]))));
    print("aba", median(states, |s| _ = black_box(aba(m, d, &s.q, &s.v, &s.tau, &[]))));
    print("crba", median(states, |s| _ = black_box(crba(m, d, &s.q))));
    print("minv", median(states, |s| _ = black_box(minv(m, d, &s.q))));
    print("rnea_derivatives", median(states, |s| _ = black_box(rnea_derivatives(m, d, &s.q, &s.v, &s.a, &[]))));
    print("aba_derivatives", median(states, |s| _ = black_box(aba_derivatives(m, d, &s.q, &s.v, &s.tau, &[]))));
    print("rnea_hessian", median(states, |s| _ = black_box(rnea_hessian(m, d, &s.q, &s.v, &s.a, &[], &s.tau))));
    print("aba_hessian", median(states, |s| _ = black_box(aba_hessian(m, d, &s.q, &s.v, &s.tau, &[], &s.a))));
    print("dtau_dq_by_duals", median(states, |s| _ = black_box(by_duals(m, duals, s))));
    print("dtau_dq_by_differences", median(states, |s| _ = black_box(by_differences(m, d, s))));
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [urdf, root, locked, states, only @ ..] = arguments.as_slice() else {
        println!("python3 benches/peers/dynamics.py runs this");
        return Ok(());
    };
    let root_joint = (root == "free_flyer").then_some(Joint::FreeFlyer);
    let model = Model::from_urdf(urdf, &UrdfOptions { root_joint, ..UrdfOptions::default() })?;
    let joints = locked.split(',').filter(|name| !name.is_empty()).map(|name| model.joint(name));
    let joints = joints.collect::<Result<Vec<_>, _>>()?;
    let model = if joints.is_empty() { model } else { model.lock(&joints, &condyle::neutral(&model))? };
    let bytes = std::fs::read(states)?;
    let numbers: Vec<f64> = bytes.as_chunks::<8>().0.iter().map(|&b| f64::from_le_bytes(b)).collect();
    let (nq, nv) = (model.nq(), model.nv());
    let states: Vec<State> = numbers
        .chunks_exact(nq + 3 * nv)
        .map(|x| {
            let part = |k: usize| x[nq + k * nv..nq + (k + 1) * nv].to_vec();
            State { q: x[..nq].to_vec(), v: part(0), a: part(1), tau: part(2) }
        })
        .collect();
    let m = &model;
    if only.is_empty() {
        singles(m, &states);
    }
    let all = |part: fn(&State) -> &[f64]| states.iter().flat_map(part).copied().collect::<Vec<f64>>();
    let (q, v, a, tau) = (all(|s| &s.q), all(|s| &s.v), all(|s| &s.a), all(|s| &s.tau));
    let b = &mut Batch::new(m, states.len(), 1);
    let print = |name: &str, ns: f64| println!("batch:{name} {:.2}", ns / states.len() as f64);
    let (one, rank) = (&states[..1], if only.is_empty() { 10 } else { 0 });
    print("rnea", timed(one, rank, |_| _ = black_box(b.rnea(m, &q, &v, &a, &[]))));
    print("aba", timed(one, rank, |_| _ = black_box(b.aba(m, &q, &v, &tau, &[]))));
    print("crba", timed(one, rank, |_| _ = black_box(b.crba(m, &q))));
    print("minv", timed(one, rank, |_| _ = black_box(b.minv(m, &q))));
    print("rnea_derivatives", timed(one, rank, |_| _ = black_box(b.rnea_derivatives(m, &q, &v, &a, &[]))));
    print("aba_derivatives", timed(one, rank, |_| _ = black_box(b.aba_derivatives(m, &q, &v, &tau, &[]))));
    if !only.is_empty() {
        return Ok(());
    }
    for knots in [20, 60, 100, 200] {
        let cycle = |x: &[f64], n: usize| x.iter().copied().cycle().take(knots * n).collect::<Vec<_>>();
        let (q, v, a, tau) = (cycle(&q, nq), cycle(&v, nv), cycle(&a, nv), cycle(&tau, nv));
        let b = &mut Batch::new(m, knots, 1);
        let ns = median(one, |_| {
            black_box(b.aba(m, &q, &v, &tau, &[]));
            black_box(b.aba_derivatives(m, &q, &v, &tau, &[]));
            black_box(b.rnea(m, &q, &v, &a, &[]));
        });
        println!("horizon:{knots} {ns:.2}");
    }
    Ok(())
}
