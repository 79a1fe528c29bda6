//! Many states at once: the same bits as one by one.

use crate::common::table::Input;
use crate::common::{fixed, rng};
use crate::counting::{allocations, bytes};
use crate::{each_level, models};
use condyle_dynamics::{
    Batch, Data, Force, Matrices, Model, aba, aba_derivatives, crba, gravity, minv, nonlinear_effects, rnea,
    rnea_derivatives,
};

/// The arguments of many states, one after the other.
struct States {
    one: Vec<Input<f64>>,
    q: Vec<f64>,
    v: Vec<f64>,
    x: Vec<f64>,
    f_ext: Vec<Force<f64>>,
}

impl States {
    fn random(model: &Model, n: usize, seed: u64) -> Self {
        let mut rng = rng(seed);
        let one: Vec<_> = (0..n).map(|_| Input::random(model, &mut rng)).collect();
        let all = |part: fn(&Input<f64>) -> &[f64]| one.iter().flat_map(part).copied().collect::<Vec<f64>>();
        let (q, v, x) = (all(|i| &i.q), all(|i| &i.v), all(|i| &i.x));
        let f_ext = one.iter().flat_map(|i| &i.f_ext).copied().collect();
        Self { one, q, v, x, f_ext }
    }
}

/// What two ways of rounding leave, relative to the largest entry: some hundred roundings of a matrix of condition 1e3.
const ROUNDING: f64 = 1e-11;

/// Matrices that are written by rows have the entries of those of each state, in groups that are full and one that is not.
#[test]
fn matrices_by_rows() {
    for model in models(2) {
        let (n, states) = (model.nv(), 19);
        let s = States::random(&model, states, 5);
        let mut batch = Batch::new(&model, states, 2);
        // what is symmetric may be written by columns, which then are rows up to rounding
        let check = |matrices: Matrices<'_, f64>, symmetric: bool| {
            let mut rows = vec![f64::NAN; states * n * n];
            matrices.write_rows(&mut rows);
            for (M, rows) in matrices.iter().zip(rows.chunks_exact(n * n)) {
                let allowed = if symmetric { ROUNDING * M.amax() } else { 0.0 };
                let same = |(x, y): (&f64, &f64)| (x - y).abs() <= allowed;
                assert!(M.transpose().iter().zip(rows).all(same), "{model}");
            }
        };
        let d = batch.aba_derivatives(&model, &s.q, &s.v, &s.x, &s.f_ext);
        check(d.da_dq, false);
        check(d.da_dv, false);
        check(d.da_dtau, true);
        let d = batch.rnea_derivatives(&model, &s.q, &s.v, &s.x, &s.f_ext);
        check(d.dtau_dq, false);
        check(d.dtau_dv, false);
        check(d.dtau_da, true);
        check(batch.crba(&model, &s.q), true);
        check(batch.minv(&model, &s.q), true);
    }
}

/// Everything that a batch computes, in turn.
fn of_batch(model: &Model, b: &mut Batch, s: &States, numbers: &mut Vec<f64>) {
    let m = model;
    numbers.clear();
    numbers.extend_from_slice(b.rnea(m, &s.q, &s.v, &s.x, &s.f_ext));
    numbers.extend_from_slice(b.rnea(m, &s.q, &s.v, &s.x, &[]));
    numbers.extend_from_slice(b.nonlinear_effects(m, &s.q, &s.v));
    numbers.extend_from_slice(b.gravity(m, &s.q));
    numbers.extend_from_slice(b.aba(m, &s.q, &s.v, &s.x, &s.f_ext));
    b.crba(m, &s.q).iter().for_each(|M| numbers.extend(M.iter()));
    b.minv(m, &s.q).iter().for_each(|M| numbers.extend(M.iter()));
    let d = b.rnea_derivatives(m, &s.q, &s.v, &s.x, &s.f_ext);
    [d.dtau_dq, d.dtau_dv, d.dtau_da].iter().flat_map(|x| x.iter()).for_each(|x| numbers.extend(x.iter()));
    let d = b.aba_derivatives(m, &s.q, &s.v, &s.x, &s.f_ext);
    numbers.extend_from_slice(d.a);
    [d.da_dq, d.da_dv, d.da_dtau].iter().flat_map(|x| x.iter()).for_each(|x| numbers.extend(x.iter()));
}

/// The same by single calls.
fn one_by_one(model: &Model, s: &States) -> Vec<f64> {
    let (m, d) = (model, &mut Data::new(model));
    let mut numbers = Vec::new();
    let mut each = |call: &mut dyn FnMut(&Input<f64>, &mut Vec<f64>)| s.one.iter().for_each(|i| call(i, &mut numbers));
    each(&mut |i, to| to.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &i.f_ext)));
    each(&mut |i, to| to.extend_from_slice(rnea(m, d, &i.q, &i.v, &i.x, &[])));
    each(&mut |i, to| to.extend_from_slice(nonlinear_effects(m, d, &i.q, &i.v)));
    each(&mut |i, to| to.extend_from_slice(gravity(m, d, &i.q)));
    each(&mut |i, to| to.extend_from_slice(aba(m, d, &i.q, &i.v, &i.x, &i.f_ext)));
    each(&mut |i, to| to.extend_from_slice(crba(m, d, &i.q).as_slice()));
    each(&mut |i, to| to.extend_from_slice(minv(m, d, &i.q).as_slice()));
    for k in 0..3 {
        each(&mut |i, to| {
            let r = rnea_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            to.extend_from_slice([r.dtau_dq, r.dtau_dv, r.dtau_da][k].as_slice());
        });
    }
    each(&mut |i, to| to.extend_from_slice(aba_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext).a));
    for k in 0..3 {
        each(&mut |i, to| {
            let r = aba_derivatives(m, d, &i.q, &i.v, &i.x, &i.f_ext);
            to.extend_from_slice([r.da_dq, r.da_dv, r.da_dtau][k].as_slice());
        });
    }
    numbers
}

/// Whatever the number of states, full groups or not, and of threads; and on one thread, once each function has been called,
/// without allocating.
#[test]
fn every_state_is_a_single_call() {
    const MOST: usize = 19;
    let all = models(3);
    each_level(|level| {
        for (seed, model) in all.iter().enumerate() {
            let mut batches = [1, 2, 3].map(|threads| Batch::new(model, MOST, threads));
            let first = States::random(model, 1, 0);
            batches.iter_mut().for_each(|batch| of_batch(model, batch, &first, &mut Vec::new()));
            for n in [1, 8, MOST] {
                let states = States::random(model, n, seed as u64);
                let expected = one_by_one(model, &states);
                let mut found = Vec::with_capacity(expected.len());
                for (batch, threads) in batches.iter_mut().zip(1..) {
                    let count = allocations(|| of_batch(model, batch, &states, &mut found));
                    assert!(found == expected, "{n} states, {threads} threads, {level}, on\n{model}");
                    assert!(threads > 1 || count == 0, "{count} allocations on\n{model}");
                }
            }
        }
    });
}

#[test]
fn a_state_that_is_not_a_number_stays_alone() {
    let model = &models(1)[1];
    each_level(|level| {
        let (mut batch, mut states) = (Batch::new(model, 9, 1), States::random(model, 9, 0));
        let clean = batch.aba(model, &states.q, &states.v, &states.x, &[]).to_vec();
        let nv = model.nv();
        states.v[4 * nv] = f64::NAN;
        let broken = batch.aba(model, &states.q, &states.v, &states.x, &[]);
        assert!(broken[4 * nv..5 * nv].iter().any(|a| a.is_nan()));
        assert!(broken[..4 * nv] == clean[..4 * nv] && broken[5 * nv..] == clean[5 * nv..], "{level}");
    });
}

/// Twice as many lanes; nothing is fused in a single call in `f32`, so not the same bits.
#[test]
fn in_single_precision() {
    const TOLERANCE: f32 = 1e-3; // 1e4 units of the last place, for cancellation over some 20 bodies
    let model = &models(0)[1];
    each_level(|level| {
        let states = States::random(model, 19, 0);
        let narrow = |x: &[f64]| x.iter().map(|&x| x as f32).collect::<Vec<_>>();
        let (q, v, a) = (narrow(&states.q), narrow(&states.v), narrow(&states.x));
        let mut batch = Batch::<f32>::new(model, 19, 1);
        let tau = batch.rnea(model, &q, &v, &a, &[]);
        let mut wide = Batch::new(model, 19, 1);
        let expected = wide.rnea(model, &states.q, &states.v, &states.x, &[]);
        let largest = narrow(expected).iter().fold(1.0, |m: f32, x| m.max(x.abs()));
        assert!(tau.iter().zip(narrow(expected)).all(|(x, y)| (x - y).abs() < TOLERANCE * largest), "{level}");
    });
}

/// A robot without coordinates has no numbers, in as many states as there are forces or room for.
#[test]
fn no_coordinates() {
    let model = &fixed();
    let forces = vec![Force::zero(); 3 * model.bodies().len()];
    each_level(|_| {
        let (mut batch, none): (_, &[f64]) = (Batch::new(model, 19, 2), &[]);
        assert!(batch.rnea(model, none, none, none, &[]).is_empty());
        assert!(batch.rnea(model, none, none, none, &forces).is_empty());
        assert!(batch.nonlinear_effects(model, none, none).is_empty() && batch.gravity(model, none).is_empty());
        assert!(batch.aba(model, none, none, none, &forces).is_empty());
        assert_eq!(batch.crba(model, none).iter().map(|M| M.shape()).collect::<Vec<_>>(), [(0, 0); 19]);
        assert_eq!(batch.minv(model, none).at(18).shape(), (0, 0));
        let d = batch.rnea_derivatives(model, none, none, none, &forces);
        assert!([d.dtau_dq, d.dtau_dv, d.dtau_da].iter().all(|x| x.iter().count() == 3 && x.at(2).shape() == (0, 0)));
        let d = batch.aba_derivatives(model, none, none, none, &[]);
        assert!(d.a.is_empty() && d.da_dq.iter().count() == 19);
    });
}

/// A batch takes memory for what is asked of it: its results, and the scratch of its threads.
#[test]
fn memory_by_state() {
    const STATES: [usize; 2] = [1000, 3000];
    const BESIDE: usize = 48; // for each matrix, where it is and how large, and of all kinds of a group
    let model = &models(0)[2];
    let (nq, nv) = (model.nq(), model.nv());
    let q: Vec<f64> = condyle_dynamics::neutral(model).repeat(STATES[1]);
    let zero = vec![0.0; nv * STATES[1]];
    type Call = fn(&mut Batch, &Model, &[f64], &[f64]);
    let calls: [(&str, usize, usize, Call); 8] = [
        ("rnea", 1, 0, |b, m, q, v| _ = b.rnea(m, q, v, v, &[])),
        ("nonlinear_effects", 1, 0, |b, m, q, v| _ = b.nonlinear_effects(m, q, v)),
        ("gravity", 1, 0, |b, m, q, _| _ = b.gravity(m, q)),
        ("aba", 1, 0, |b, m, q, v| _ = b.aba(m, q, v, v, &[])),
        ("crba", 1, 1, |b, m, q, _| _ = b.crba(m, q)),
        ("minv", 1, 1, |b, m, q, _| _ = b.minv(m, q)),
        ("rnea_derivatives", 1, 3, |b, m, q, v| _ = b.rnea_derivatives(m, q, v, v, &[])),
        ("aba_derivatives", 1, 3, |b, m, q, v| _ = b.aba_derivatives(m, q, v, v, &[])),
    ];
    each_level(|level| {
        for (name, vectors, matrices, call) in calls {
            let [few, many] =
                STATES.map(|n| bytes(|| call(&mut Batch::new(model, n, 1), model, &q[..n * nq], &zero[..n * nv])));
            let by_state = (many - few) / (STATES[1] - STATES[0]);
            let expected = 8 * (vectors * nv + matrices * nv * nv) + if matrices > 0 { 7 * BESIDE } else { 0 };
            assert!(by_state <= expected, "{name}, {level}: {by_state} bytes a state, expected {expected}");
        }
    });
}

#[test]
fn no_state() {
    let model = &models(0)[0];
    assert!(Batch::<f64>::new(model, 4, 1).rnea(model, &[], &[], &[], &[]).is_empty());
}

#[test]
#[should_panic(expected = "q: expected 7 numbers for each of at most 2 states, found 21")]
fn too_many_states() {
    let model = &models(0)[0];
    _ = Batch::<f64>::new(model, 2, 1).gravity(model, &[0.0; 21]);
}

#[test]
#[should_panic(expected = "v: expected 14 numbers, found 7")]
fn too_few_velocities() {
    let model = &models(0)[0];
    _ = Batch::<f64>::new(model, 2, 1).nonlinear_effects(model, &[0.0; 14], &[0.0; 7]);
}

#[test]
#[should_panic(expected = "data: made for a model of (8, 7, 7) bodies, joint axes and coordinates, found (14, 18, 18)")]
fn another_robot() {
    let [arm, quadruped, _] = crate::common::embedded();
    _ = Batch::<f64>::new(&arm, 2, 1).gravity(&quadruped, &condyle_dynamics::neutral(&quadruped));
}
