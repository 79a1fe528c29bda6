//! Tests every function of a batch of `f32`. Such a batch has twice as many lanes as a batch of `f64`, and the accuracy
//! of seven digits.
#![allow(non_snake_case)]

mod common;
#[allow(dead_code)] // only the tests of `f64` use the functions that compare bits
#[path = "vectors/table.rs"]
mod table;

use common::embedded;
use common::table::Input;
use condyle_dynamics::level::{Level, pin};
use condyle_dynamics::{Batch, ContactConstraint, Data, Model, ProximalSettings, crba};
use table::{Found, States, table};

/// Tolerance of 1e3 rounding errors of the largest number. It is for sums over about twenty bodies with terms that
/// cancel.
const ROUNDINGS: f64 = 1e3 * f32::EPSILON as f64;
/// Number of states. It is odd, and larger than the number of lanes of a vector register.
const STATES: usize = 19;

/// Functions whose result depends on M⁻¹. The relative error of such a result may be a rounding error times the
/// condition number of M.
const INVERTS: [&str; 11] = [
    "aba",
    "minv",
    "forward_dynamics, dense",
    "aba_derivatives",
    "aba_hessian",
    "rnea_input_derivative and aba_input_derivative",
    "constrained_dynamics",
    "constrained_dynamics_derivatives",
    "constrained_dynamics_equations",
    "impulse_dynamics",
    "impulse_dynamics_derivatives",
];

/// Returns the largest condition number of M at the given states.
fn condition(model: &Model, states: &[Input<f64>]) -> f64 {
    let mut data = Data::new(model);
    let of = |state: &Input<f64>| {
        let values = crba(model, &mut data, &state.q).singular_values();
        values.max() / values.min()
    };
    states.iter().map(of).fold(1.0, f64::max)
}

/// Returns one contact, which is not redundant.
fn contact(model: &Model) -> Vec<ContactConstraint> {
    let last = model.bodies().len() - 1;
    let frame = model.frames().iter().position(|f| f.body == last).expect("each body has a frame");
    vec![ContactConstraint { kd: 3.0, ..ContactConstraint::point(frame) }]
}

/// Compares each function in `f32` with the same function in `f64`, at the same states and at each SIMD level.
#[test]
fn every_function_in_single_precision() {
    let mut worst = Vec::new();
    for model in embedded().map(|model| model.with_limbs(false)) {
        // Use states that both precisions represent exactly.
        let mut rng = common::rng(3);
        let narrow: Vec<Input<f32>> =
            (0..STATES).map(|_| Input::<f64>::random(&model, &mut rng).map(|x| x as f32)).collect();
        let wide: Vec<Input<f64>> = narrow.iter().map(|state| state.map(f64::from)).collect();
        let (condition, held) = (condition(&model, &wide), contact(&model));
        let (narrow, wide) = (States::of(&narrow), States::of(&wide));
        for level in Level::ALL {
            if let Err(error) = pin(level) {
                eprintln!("NOT RUN: {error}");
                continue;
            }
            let (mut batch, mut reference) =
                (Batch::<f32>::new(&model, STATES, 2), Batch::<f64>::new(&model, STATES, 1));
            let mut touch = batch.constraints(&model, &held, ProximalSettings::default()).unwrap();
            let mut held = reference.constraints(&model, &held, ProximalSettings::default()).unwrap();
            for (row, exact) in table::<f32>().iter().zip(table::<f64>()) {
                let (mut found, mut expected) = (Found::default(), Found::default());
                (row.many)(&model, &mut batch, &mut touch, &narrow, &mut found);
                (exact.many)(&model, &mut reference, &mut held, &wide, &mut expected);
                assert_eq!(found.results.len(), expected.results.len(), "{}", row.name);
                let scale = if INVERTS.contains(&row.name) { condition } else { 1.0 };
                for (k, (found, expected)) in found.results.iter().zip(&expected.results).enumerate() {
                    let largest = expected.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
                    let far = |(x, y): (&f32, &f64)| (f64::from(*x) - y).abs() / (largest * scale);
                    let error = found
                        .iter()
                        .zip(expected)
                        .map(far)
                        .fold(0.0, |most: f64, x| if x > most || x.is_nan() { x } else { most });
                    let name = row.name;
                    assert!(
                        error <= ROUNDINGS,
                        "{name}, result {k}, {level}: {error:.1e} of {} on\n{model}",
                        model.name()
                    );
                    worst.push((error, format!("{name}, result {k}, {level}, {}", model.name())));
                }
            }
        }
    }
    worst.sort_by(|x, y| y.0.total_cmp(&x.0));
    worst.iter().take(10).for_each(|(error, of)| println!("{error:.1e} of {ROUNDINGS:.1e}: {of}"));
}
