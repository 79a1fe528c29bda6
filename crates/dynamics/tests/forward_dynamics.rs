//! All ways of forward dynamics are one.
#![allow(non_snake_case)]

mod common;

use common::{State, Worst, all_models, lift, lift_forces, rng};
use condyle_dynamics::{Data, Method, aba, forward_dynamics};
use num_dual::Dual64;

/// Some hundreds of roundings times the condition number of M, which is 1e2 to 1e5 in these robots.
const INVERTED: f64 = 1e-10;
const TREES: u64 = 30;
const METHODS: [Method; 3] = [Method::ArticulatedBody, Method::Dense, Method::Sparse];

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
                let method = Some(Method::fastest(model));
                assert_eq!(forward_dynamics(model, &mut data, &q, &v, &tau, f_ext, method), chosen);
            }
        }
    }
}

/// On dual numbers, and from whatever the scratch holds.
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

/// The recursion over bodies wherever it closes.
#[test]
fn what_is_fastest() {
    for model in all_models(3) {
        let shared = model.bodies().iter().any(|b| b.mimic.is_some());
        let expected = if shared { Method::Sparse } else { Method::ArticulatedBody };
        assert_eq!(Method::fastest(&model), expected, "{model}");
    }
}

#[test]
#[should_panic(expected = "tau: expected 7 numbers, found 6")]
fn wrong_effort() {
    let arm = condyle_dynamics::robots::arm7();
    forward_dynamics(&arm, &mut Data::new(&arm), &[0.0; 7], &[0.0; 7], &[0.0; 6], &[], Some(Method::Sparse));
}
