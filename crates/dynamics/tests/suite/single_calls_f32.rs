//! Tests that single calls in `f32` give the numbers of `f64`, up to the accuracy of seven digits.

use crate::common::{State, Worst, all_models, lift, lift_forces, rng};
use condyle_dynamics::{
    Data, Model, Scalar, aba, aba_derivatives, crba, forward_kinematics, minv, nonlinear_effects, rnea,
    rnea_derivatives,
};

/// Tolerance of 1e3 rounding errors of the largest number. It is for sums over about twenty bodies with terms that
/// cancel.
const ROUNDINGS: f64 = 1e3 * f32::EPSILON as f64;

/// Returns the results of several calls. Each has a flag that tells whether the result depends on M⁻¹. Both precisions
/// represent the state exactly.
fn results<S: Scalar>(model: &Model, state: &State) -> Vec<(Vec<S>, bool)> {
    let round = |x: &[f64]| lift::<S>(&x.iter().map(|&x| f64::from(x as f32)).collect::<Vec<_>>());
    let (q, v, x) = (round(&state.q), round(&state.v), round(&state.a));
    let f_ext = lift_forces::<S>(&state.f_ext);
    let data = &mut Data::<S>::new(model).clone();
    let placements = forward_kinematics(model, data, &q);
    let frames = (0..model.frames().len()).flat_map(|k| placements.frame(k).translation.to_array());
    vec![
        (frames.collect(), false),
        (rnea(model, data, &q, &v, &x, &f_ext).to_vec(), false),
        (nonlinear_effects(model, data, &q, &v).to_vec(), false),
        (crba(model, data, &q).as_slice().to_vec(), false),
        (rnea_derivatives(model, data, &q, &v, &x, &f_ext).dtau_dq.as_slice().to_vec(), false),
        (minv(model, data, &q).as_slice().to_vec(), true),
        (aba(model, data, &q, &v, &x, &f_ext).to_vec(), true),
        (aba_derivatives(model, data, &q, &v, &x, &f_ext).da_dq.as_slice().to_vec(), true),
    ]
}

#[test]
fn single_calls_in_f32_agree_with_f64() {
    let mut worst = Worst::new("single calls in f32", ROUNDINGS);
    for (seed, model) in all_models(4).iter().enumerate() {
        let state = State::random(model, &mut rng(seed as u64));
        let singular = crba(model, &mut Data::new(model), &state.q).clone_owned().singular_values();
        let condition = if singular.is_empty() { 1.0 } else { singular.max() / singular.min() };
        let pairs = results::<f32>(model, &state).into_iter().zip(results::<f64>(model, &state));
        for ((found, inverts), (expected, _)) in pairs {
            let largest = expected.iter().fold(1.0, |most: f64, x| most.max(x.abs()));
            let scale = if inverts { largest * condition } else { largest };
            let scaled = |x: &mut dyn Iterator<Item = f64>| x.map(|x| x / scale).collect::<Vec<_>>();
            let (found, expected) = (scaled(&mut found.into_iter().map(f64::from)), scaled(&mut expected.into_iter()));
            worst.see(model, &found, &expected);
        }
    }
}
