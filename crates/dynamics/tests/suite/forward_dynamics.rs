//! Tests that all methods of forward dynamics give the same result.

use crate::common::{self, State, Worst, all_models, lift, lift_forces, rng, tree};
use crate::counted::{Counted, counted};
use crate::counting::allocations;
use condyle_dynamics::{Cholesky, Data, DivideConquer, ForwardDynamicsMethod, Ltdl, Model};
use condyle_dynamics::{aba, crba, forward_dynamics};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance of some hundred rounding errors times the condition number of M, which is 1e2 to 1e5 for these robots.
const INVERTED: f64 = 1e-10;
const TREES: u64 = 30;
const METHODS: [ForwardDynamicsMethod; 3] =
    [ForwardDynamicsMethod::ArticulatedBody, ForwardDynamicsMethod::Dense, ForwardDynamicsMethod::Sparse];

#[test]
fn methods_agree() {
    let mut worst = Worst::new("forward dynamics by every method", INVERTED);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let mut data = Data::new(model);
        for state in 0..3 {
            let State { q, v, tau, f_ext, .. } = State::random(model, &mut rng(3 * seed as u64 + state));
            for f_ext in [&f_ext[..], &[]] {
                let expected = aba(model, &mut data, &q, &v, &tau, f_ext).to_vec();
                for method in METHODS {
                    let found = forward_dynamics(model, &mut data, &q, &v, &tau, f_ext, Some(method));
                    worst.see(model, found, &expected);
                }
                let chosen = forward_dynamics(model, &mut data, &q, &v, &tau, f_ext, None).to_vec();
                let method = Some(ForwardDynamicsMethod::fastest(model));
                assert_eq!(forward_dynamics(model, &mut data, &q, &v, &tau, f_ext, method), chosen);
            }
        }
    }
}

/// Checks that all methods give the same results on dual numbers, for any previous content of the scratch memory.
#[test]
fn methods_agree_on_dual_numbers() {
    let mut worst = Worst::new("derivatives by every method", INVERTED);
    for (seed, model) in all_models(4).iter().enumerate() {
        let State { q, v, a, tau, f_ext } = State::random(model, &mut rng(seed as u64));
        let q = common::moved(model, &lift(&q), &common::dual(&vec![0.0; a.len()], &a));
        let (v, tau, f_ext): (Vec<Dual64>, Vec<Dual64>, _) = (lift(&v), lift(&tau), lift_forces(&f_ext));
        let mut data = Data::new(model);
        let expected = common::eps(forward_dynamics(model, &mut data, &q, &v, &tau, &f_ext, Some(METHODS[0])));
        for method in METHODS {
            let found = common::eps(forward_dynamics(model, &mut data, &q, &v, &tau, &f_ext, Some(method)));
            worst.see(model, &found, &expected);
        }
    }
}

/// Counts the operations of forward dynamics by a given method.
fn operations(model: &Model, method: ForwardDynamicsMethod) -> f64 {
    let State { q, v, tau, .. } = State::random(model, &mut rng(0));
    let [q, v, tau]: [Vec<Counted>; 3] = [&q, &v, &tau].map(|x| lift(x));
    let mut data = Data::new(model);
    counted(|| forward_dynamics(model, &mut data, &q, &v, &tau, &[], Some(method))).0.flops() as f64
}

/// Checks that the method chosen by the library takes at most 25 % more operations than the best method. The test uses
/// robots, random trees, and chains, binary trees and stars of 1 to 60 joints. `benches/factorisation.rs` measures
/// times.
#[test]
fn the_choice_takes_few_operations() {
    let shapes: [fn(usize) -> usize; 3] = [|i| i - 1, |i| i / 2, |i| usize::from(i > 1)];
    let sizes = [1, 2, 4, 6, 8, 10, 12, 20, 60];
    let trees = shapes.iter().flat_map(|shape| sizes.map(|n| tree(n, n > 20, shape)));
    let (mut worst, mut models) = (0.0f64, 0);
    for model in all_models(3).into_iter().chain(trees) {
        let chosen = operations(&model, ForwardDynamicsMethod::fastest(&model));
        let [a, b, c] = METHODS.map(|method| operations(&model, method));
        let least = a.min(b).min(c);
        println!("{:10} nv = {:2}: {:.2} of the least; {a} {b} {c}", model.name(), model.nv(), chosen / least);
        assert!(chosen <= 1.25 * least, "{chosen} operations, {least} would do, on\n{model}");
        worst = worst.max(a.max(b).max(c) / least);
        models += 1;
    }
    assert_eq!(models, 10 + shapes.len() * sizes.len());
    assert!(worst > 2.0, "a wrong choice would not be seen: {worst}");
}

#[track_caller]
fn allocates_nothing(f: impl FnOnce()) {
    assert_eq!(allocations(f), 0);
}

/// Checks that every method, both factors, and divide and conquer do not allocate memory. Divide and conquer uses one
/// thread, because rayon allocates when threads share work.
#[test]
fn nothing_is_allocated() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread can be started");
    for (seed, model) in all_models(2).iter().enumerate() {
        let State { q, v, tau, f_ext, .. } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        for method in METHODS {
            allocates_nothing(|| _ = forward_dynamics(model, &mut data, &q, &v, &tau, &f_ext, Some(method)));
        }
        let M = crba(model, &mut data, &q).clone();
        let (mut sparse, mut dense) = (Ltdl::new(model), Cholesky::new(model.nv()));
        let (mut x, mut X) = (tau.clone(), DMatrix::identity(model.nv(), 3));
        let mut inverse = M.clone();
        allocates_nothing(|| {
            sparse.factorize(&M);
            sparse.solve(&mut x);
            sparse.solve_matrix(&mut X);
            sparse.inverse(&mut inverse);
            dense.factorize(&M);
            dense.solve(&mut x);
            dense.solve_matrix(&mut X);
            dense.inverse(&mut inverse);
        });
        let mut divided = DivideConquer::new(model, 1);
        pool.install(|| allocates_nothing(|| _ = divided.aba(model, &q, &v, &tau, &f_ext)));
    }
}

#[test]
#[should_panic(expected = "tau: expected 7 numbers, found 6")]
fn wrong_effort() {
    let arm = condyle_dynamics::robots::arm7();
    forward_dynamics(
        &arm,
        &mut Data::new(&arm),
        &[0.0; 7],
        &[0.0; 7],
        &[0.0; 6],
        &[],
        Some(ForwardDynamicsMethod::Sparse),
    );
}
