//! Test that the functions of a control loop do not allocate memory, once a `Data` exists.

use crate::common::table::{Input, Output, functions};
use crate::common::{all_models, rng};
use crate::counting::allocations;
use condyle_dynamics::{Data, Scalar};
use num_dual::Dual64;

/// Checks every call, including the first, on the three embedded robots, a tree with every joint type, and a tree with
/// mimic joints.
fn check<S: Scalar>() {
    for (seed, model) in all_models(1).iter().enumerate() {
        let input = Input::<S>::random(model, &mut rng(seed as u64));
        for (name, function) in functions() {
            let (mut data, mut output) = (Data::new(model), Output::new(model));
            for call in ["first", "second"] {
                output.numbers.clear();
                let count = allocations(|| function(model, &mut data, &input, &mut output));
                assert_eq!(count, 0, "{name}, {call} call, on\n{model}");
            }
        }
    }
}

#[test]
fn numbers() {
    check::<f64>();
}

#[test]
fn dual_numbers() {
    check::<Dual64>();
}
