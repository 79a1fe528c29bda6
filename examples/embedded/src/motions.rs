//! Motions of the arm, and the efforts that they require.

use crate::arm::JOINTS;
use condyle_dynamics::{Data, Model, aba, rnea};

/// Number of motions.
pub(crate) const MOTIONS: usize = 20;
/// Maximum rounding error of the accelerations (rad/s²).
const ROUNDING: f64 = 1e-10;

/// Computes the efforts τ of all motions. Then computes the accelerations from these efforts, and checks that they
/// equal the original accelerations.
pub(crate) fn efforts(arm: &Model, data: &mut Data<f64>) -> [[f64; JOINTS]; MOTIONS] {
    let mut efforts = [[0.0; JOINTS]; MOTIONS];
    for (motion, tau) in efforts.iter_mut().enumerate() {
        // The example needs no particular motion. All numbers are multiples of 1/16, which are exact on all machines.
        let number = |k: usize, part: usize| (((motion + 1) * (7 * part + 3 * k + 1) % 64) as f64 - 32.0) / 16.0;
        let [q, v, a]: [[f64; JOINTS]; 3] = [1, 2, 3].map(|part| core::array::from_fn(|k| number(k, part)));
        tau.copy_from_slice(rnea(arm, data, &q, &v, &a, &[])); // τ = M q̈ + h
        let again = aba(arm, data, &q, &v, &*tau, &[]); // q̈ = M⁻¹ (τ − h)
        for (a, again) in a.iter().zip(again) {
            assert!((again - a).abs() < ROUNDING, "motion {motion}: {a} came back as {again}");
        }
    }
    efforts
}
