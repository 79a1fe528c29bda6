//! Tests of batches: the result for each of many states has the same bits as the result of a single call.

use crate::common::panics::{Panic, panic_of};
use crate::common::table::Input;
use crate::common::{fixed, rng};
use crate::counting::{allocations, bytes};
use crate::table::{Found, States, constraints, table};
use crate::{best_level, each_level, models};
use condyle_dynamics::{
    Batch, ConstraintSet, ContactConstraint, Data, Force, Matrices, Model, ProximalSettings, ReferenceFrame, Se3,
    Target, robots,
};

fn random(model: &Model, n: usize, seed: u64) -> Vec<Input<f64>> {
    let mut rng = rng(seed);
    (0..n).map(|_| Input::random(model, &mut rng)).collect()
}

fn states(model: &Model, n: usize, seed: u64) -> States<f64> {
    States::of(&random(model, n, seed))
}

/// Tolerance between two computations with different rounding, relative to the largest entry. It is some hundred
/// rounding errors of a matrix with condition number 1e3.
const ROUNDING: f64 = 1e-11;

/// Checks that matrices written by rows have the entries of each state's matrix. The last group of states is not full.
#[test]
fn matrices_by_rows() {
    for model in models(2) {
        let (n, count) = (model.nv(), 19);
        let s = states(&model, count, 5);
        let mut batch = Batch::new(&model, count, 2);
        // Symmetric matrices may be written by columns, whose entries equal the entries of the rows up to rounding.
        let check = |matrices: Matrices<'_, f64>, symmetric: bool| {
            let mut rows = vec![f64::NAN; count * n * n];
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

/// Checks that a writer writes the results of the batch by rows into slices of the caller. On one thread, the writer
/// must not allocate.
#[test]
fn written_to_places() {
    const COUNT: usize = 19;
    each_level(|level| {
        for model in models(2) {
            let (n, s) = (model.nv(), states(&model, COUNT, 7));
            let States { q, v, x, f_ext } = &s;
            for threads in [1, 2] {
                let mut batch = Batch::new(&model, COUNT, threads);
                let mut kept = [(); 4].map(|()| vec![0.0; COUNT * n * n]);
                let mut found = kept.clone().map(|_| vec![f64::NAN; COUNT * n * n]);
                let check = |kept: &[Vec<f64>], found: &mut [Vec<f64>], what: &str| {
                    assert!(kept == found, "{what}, {threads} threads, {level}, on\n{model}");
                    found.iter_mut().for_each(|place| place.fill(f64::NAN));
                };
                let quiet = |count: usize| assert!(threads > 1 || count == 0, "{count} allocations on\n{model}");

                let d = batch.rnea_derivatives(&model, q, v, x, f_ext);
                let matrices = [d.dtau_dq, d.dtau_dv, d.dtau_da];
                matrices.iter().zip(&mut kept).for_each(|(matrix, kept)| matrix.write_rows(kept));
                let [a, b, c, _] = &mut found;
                let to: &mut [&mut [f64]] = &mut [a, b, c];
                quiet(allocations(|| batch.writer(to).rnea_derivatives(&model, q, v, x, f_ext)));
                check(&kept[..3], &mut found[..3], "rnea_derivatives");

                let d = batch.aba_derivatives(&model, q, v, x, f_ext);
                let (accelerations, matrices) = (d.a.to_vec(), [d.da_dq, d.da_dv, d.da_dtau]);
                matrices.iter().zip(&mut kept[1..]).for_each(|(matrix, kept)| matrix.write_rows(kept));
                kept[0][..COUNT * n].copy_from_slice(&accelerations);
                kept[0].truncate(COUNT * n);
                found[0].truncate(COUNT * n);
                let [a, b, c, d] = &mut found;
                let to: &mut [&mut [f64]] = &mut [a, b, c, d];
                quiet(allocations(|| batch.writer(to).aba_derivatives(&model, q, v, x, f_ext)));
                check(&kept, &mut found, "aba_derivatives");

                batch.crba(&model, q).write_rows(&mut kept[1]);
                quiet(allocations(|| batch.writer(&mut [&mut found[1]]).crba(&model, q)));
                check(&kept[1..2], &mut found[1..2], "crba");
                batch.minv(&model, q).write_rows(&mut kept[1]);
                batch.writer(&mut [&mut found[1]]).minv(&model, q);
                check(&kept[1..2], &mut found[1..2], "minv");
                batch.coriolis_matrix(&model, q, v).write_rows(&mut kept[1]);
                batch.writer(&mut [&mut found[1]]).coriolis_matrix(&model, q, v);
                check(&kept[1..2], &mut found[1..2], "coriolis_matrix");
                kept[0].copy_from_slice(batch.rnea(&model, q, v, x, f_ext));
                quiet(allocations(|| batch.writer(&mut [&mut found[0]]).rnea(&model, q, v, x, f_ext)));
                check(&kept[..1], &mut found[..1], "rnea");
            }
        }
    });
}

#[test]
#[should_panic(expected = "to[0]: expected length 98, found 49")]
fn a_place_that_is_too_small() {
    let model = robots::arm7();
    Batch::new(&model, 2, 1).writer(&mut [&mut [0.0; 49]]).crba(&model, &[0.3; 14]);
}

#[test]
#[should_panic(expected = "to: expected a place for each of 3 results, found 1")]
fn a_place_that_is_missing() {
    let model = robots::arm7();
    Batch::new(&model, 1, 1).writer(&mut [&mut [0.0; 49]]).rnea_derivatives(
        &model,
        &[0.3; 7],
        &[0.1; 7],
        &[0.2; 7],
        &[],
    );
}

/// Checks that each state of a batch has the bits of a single call. The test uses different numbers of states and
/// threads, and full and partial groups. On one thread, a batch must not allocate after the first call of a function.
/// On an emulated processor (`CONDYLE_EMULATED`), the test uses only two robots and few states.
#[test]
fn every_state_is_a_single_call() {
    const MOST: usize = 19;
    let (mut all, mut counts) = (models(2), &[1, 8, MOST][..]);
    if std::env::var_os("CONDYLE_EMULATED").is_some() {
        let mimics = all.remove(4);
        (all, counts) = (vec![all.remove(1), mimics], &[1, 6]);
    }
    let table = table::<f64>();
    each_level(|level| {
        for (seed, model) in all.iter().enumerate() {
            let inputs = random(model, MOST, seed as u64);
            let (held, proximal) = constraints(model);
            let (mut data, mut set) = (Data::new(model), ConstraintSet::new(model, &held).unwrap());
            set.proximal = proximal;
            let mut batches = [1, 2, 3].map(|threads| {
                let batch = Batch::new(model, MOST, threads);
                let constraints = batch.constraints(model, &held, proximal).unwrap();
                (batch, constraints)
            });
            for row in &table {
                for &n in counts {
                    let (mut expected, all) = (Found::default(), States::of(&inputs[..n]));
                    for input in &inputs[..n] {
                        expected.again();
                        (row.one)(model, &mut data, &mut set, input, &mut expected);
                    }
                    for ((batch, constraints), threads) in batches.iter_mut().zip(1..) {
                        for call in ["first", "second"] {
                            let mut found = expected.emptied();
                            let count = allocations(|| (row.many)(model, batch, constraints, &all, &mut found));
                            found.again();
                            expected.again();
                            let name = row.name;
                            assert!(found == expected, "{name}: {n} states, {threads} threads, {level}, on\n{model}");
                            let once = n > 1 || call == "second";
                            assert!(threads > 1 || !once || count == 0, "{name}: {count} allocations on\n{model}");
                        }
                    }
                }
            }
        }
    });
}

/// Checks that in each function, a state with NaN does not affect the other states.
#[test]
fn a_state_that_is_not_a_number_stays_alone() {
    const STATES: usize = 9;
    let model = &models(1)[1];
    let (held, proximal) = constraints(model);
    each_level(|level| {
        let mut batch = Batch::new(model, STATES, 1);
        let mut constraints = batch.constraints(model, &held, proximal).unwrap();
        let (clean, mut broken) = (states(model, STATES, 0), states(model, STATES, 0));
        let (nq, nv) = (model.nq(), model.nv());
        broken.q[4 * nq..5 * nq].fill(f64::NAN);
        broken.v[4 * nv..5 * nv].fill(f64::NAN);
        for row in table::<f64>() {
            let [mut expected, mut found] = [Found::default(), Found::default()];
            (row.many)(model, &mut batch, &mut constraints, &clean, &mut expected);
            (row.many)(model, &mut batch, &mut constraints, &broken, &mut found);
            let mut any = false;
            for (found, expected) in found.results.iter().zip(&expected.results) {
                let size = found.len() / STATES;
                any |= found[4 * size..5 * size].iter().any(|x| x.is_nan());
                let beside = found[..4 * size] == expected[..4 * size] && found[5 * size..] == expected[5 * size..];
                assert!(beside, "{}, {level}", row.name);
            }
            assert!(any, "{}, {level}", row.name);
        }
    });
}

/// Checks that the results for a robot without coordinates are empty. The number of states is then taken from the
/// number of forces or from the capacity.
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

/// Checks that a batch allocates memory only for the requested results and for the scratch memory of its threads.
#[test]
fn memory_by_state() {
    const STATES: [usize; 2] = [1000, 3000];
    const BESIDE: usize = 48; // bytes for each matrix's address and size, and for the kinds of a group
    let model = &models(0)[2];
    let (nq, nv) = (model.nq(), model.nv());
    let q: Vec<f64> = condyle_dynamics::neutral(model).repeat(STATES[1]);
    let zero = vec![0.0; nv * STATES[1]];
    type Call = fn(&mut Batch, &Model, &[f64], &[f64]);
    let calls: [(&str, usize, usize, Call); 11] = [
        ("rnea", 1, 0, |b, m, q, v| _ = b.rnea(m, q, v, v, &[])),
        ("nonlinear_effects", 1, 0, |b, m, q, v| _ = b.nonlinear_effects(m, q, v)),
        ("gravity", 1, 0, |b, m, q, _| _ = b.gravity(m, q)),
        ("aba", 1, 0, |b, m, q, v| _ = b.aba(m, q, v, v, &[])),
        ("crba", 1, 1, |b, m, q, _| _ = b.crba(m, q)),
        ("minv", 1, 1, |b, m, q, _| _ = b.minv(m, q)),
        ("rnea_derivatives", 1, 3, |b, m, q, v| _ = b.rnea_derivatives(m, q, v, v, &[])),
        ("aba_derivatives", 1, 3, |b, m, q, v| _ = b.aba_derivatives(m, q, v, v, &[])),
        ("coriolis_matrix", 0, 1, |b, m, q, v| _ = b.coriolis_matrix(m, q, v)),
        ("rnea_hessian", 0, 4, |b, m, q, v| _ = b.rnea_hessian(m, q, v, v, &[], v)),
        ("body_velocity", 1, 0, |b, m, q, v| _ = b.body_velocity(m, q, v, 1, ReferenceFrame::Local)),
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

/// Checks that every function gives the results of single calls also for a robot without coordinates.
#[test]
fn every_function_without_coordinates() {
    let model = &fixed();
    let inputs = random(model, 3, 0);
    each_level(|level| {
        let mut batch = Batch::new(model, 3, 2);
        let (held, proximal) = constraints(model);
        let mut constraints = batch.constraints(model, &held, proximal).unwrap();
        let (mut data, mut set) = (Data::new(model), ConstraintSet::new(model, &held).unwrap());
        for row in table::<f64>() {
            let [mut expected, mut found] = [Found::default(), Found::default()];
            for input in &inputs {
                expected.again();
                (row.one)(model, &mut data, &mut set, input, &mut expected);
            }
            (row.many)(model, &mut batch, &mut constraints, &States::of(&inputs), &mut found);
            // Compare bits without the sign bit, because the sign of NaN may differ.
            let bits = |of: &Found<f64>| of.results.iter().flatten().map(|x| x.to_bits() << 1).collect::<Vec<_>>();
            assert_eq!(bits(&found), bits(&expected), "{}, {level}", row.name);
        }
    });
}

/// Checks that a changed target of a constraint applies to all states.
#[test]
fn targets_of_constraints() {
    let _best = best_level();
    let model = &robots::arm7();
    let tool = ContactConstraint { kp: 100.0, ..ContactConstraint::point(model.frame("tool").unwrap()) };
    let inputs = random(model, 5, 0);
    let s = States::of(&inputs);
    let target = Target { placement: Se3::new(Se3::identity().rotation, [0.1, 0.2, 0.3].into()), ..Target::identity() };
    let mut batch = Batch::new(model, 5, 2);
    let mut constraints = batch.constraints(model, &[tool], ProximalSettings::default()).unwrap();
    let before = batch.constrained_dynamics(model, &mut constraints, &s.q, &s.v, &s.x, &[]).a.to_vec();
    constraints.set_target(0, target).unwrap();
    assert_eq!((constraints.rows(), constraints.range(0)), (3, 0..3));
    let after = batch.constrained_dynamics(model, &mut constraints, &s.q, &s.v, &s.x, &[]).a.to_vec();
    assert!(before.iter().zip(&after).all(|(x, y)| x != y));
    let tool = ContactConstraint { target, ..tool };
    let mut anew = batch.constraints(model, &[tool], ProximalSettings::default()).unwrap();
    assert_eq!(after, batch.constrained_dynamics(model, &mut anew, &s.q, &s.v, &s.x, &[]).a);
    let wrong = Target { placement: Se3::new(target.placement.rotation, [f64::NAN; 3].into()), ..target };
    assert!(constraints.set_target(0, wrong).is_err());
    assert_eq!(after, batch.constrained_dynamics(model, &mut constraints, &s.q, &s.v, &s.x, &[]).a);
}

#[test]
#[should_panic(expected = "constraints: made for another batch")]
fn constraints_of_another_batch() {
    let model = &robots::arm7();
    let mut constraints = Batch::<f64>::new(model, 2, 2).constraints(model, &[], ProximalSettings::default()).unwrap();
    let (q, v) = ([0.0; 7], [0.0; 7]);
    _ = Batch::<f64>::new(model, 2, 1).constrained_dynamics(model, &mut constraints, &q, &v, &v, &[]);
}

/// Checks that a copy of a batch computes the same bits as the original, and does not share memory with the original.
#[test]
fn copies_compute_alone() {
    let _best = best_level();
    let model = &robots::quadruped();
    let (s, other) = (states(model, 11, 1), states(model, 11, 2));
    let mut batch = Batch::new(model, 11, 1);
    batch.constrained_dynamics(model, &mut held(model, &batch.clone()), &s.q, &s.v, &s.x, &s.f_ext);
    let expected = batch.aba_derivatives(model, &s.q, &s.v, &s.x, &s.f_ext).da_dq.at(10).to_owned();
    let mut copy = batch.clone();
    assert_eq!((copy.capacity(), copy.threads()), (11, 1));
    copy.aba_derivatives(model, &other.q, &other.v, &other.x, &other.f_ext);
    let found = copy.aba_derivatives(model, &s.q, &s.v, &s.x, &s.f_ext);
    assert_eq!(found.da_dq.at(10), expected);
    assert_eq!(batch.aba_derivatives(model, &s.q, &s.v, &s.x, &s.f_ext).da_dq.at(10), expected);
    let (mut one, mut constraints) = (copy.clone(), held(model, &copy));
    let first = one.constrained_dynamics(model, &mut constraints.clone(), &s.q, &s.v, &s.x, &[]).a.to_vec();
    assert_eq!(copy.constrained_dynamics(model, &mut constraints, &s.q, &s.v, &s.x, &[]).a, first);
    // Copy a batch that was never called with forces. The first call of the copy with forces must not allocate.
    let (mut without, rnea) = (Batch::new(model, 11, 1), batch.rnea(model, &s.q, &s.v, &s.x, &s.f_ext).to_vec());
    without.rnea(model, &s.q, &s.v, &s.x, &[]);
    let mut with = without.clone();
    let count = allocations(|| _ = with.rnea(model, &s.q, &s.v, &s.x, &s.f_ext));
    assert_eq!((count, with.rnea(model, &s.q, &s.v, &s.x, &s.f_ext)), (0, &rnea[..]));
}

/// Creates the constraints that the functions in `table.rs` receive.
fn held(model: &Model, batch: &Batch) -> condyle_dynamics::BatchConstraints {
    let (held, proximal) = constraints(model);
    batch.constraints(model, &held, proximal).unwrap()
}

/// Checks that every function reports an argument of wrong length. The panic must give the caller's file.
#[test]
fn wrong_lengths_are_reported_at_the_call() {
    let _best = best_level();
    let model = &robots::quadruped();
    for row in table::<f64>() {
        let mut panics = 0;
        for argument in ["q", "v", "x", "f_ext"] {
            let mut s = states(model, 3, 1);
            match argument {
                "q" => drop(s.q.pop()),
                "v" => drop(s.v.pop()),
                "x" => drop(s.x.pop()),
                _ => drop(s.f_ext.pop()),
            }
            let mut batch = Batch::new(model, 3, 1);
            let (mut constraints, mut found) = (held(model, &batch), Found::default());
            let call = || (row.many)(model, &mut batch, &mut constraints, &s, &mut found);
            if let Some(Panic { file, message, .. }) = panic_of(call) {
                let called = file.ends_with("tests/vectors/table.rs");
                assert!(called, "{}, {argument} too short: {message:?} is reported in {file}", row.name);
                panics += 1;
            }
        }
        assert!(panics > 0, "{} accepts every length", row.name);
    }
}
