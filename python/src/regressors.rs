//! Dynamics and energies as linear functions of the inertial parameters, and the losses of joints: the library's
//! functions one to one.

use crate::functions::{any, functions};
use condyle::Scalar;
use pyo3::prelude::*;

functions! {
/// The joint torque regressor Y(q, v, a), (nv, 10 (nbodies − 1)), with τ = Y π: `rnea` as a linear function of
/// `Model.inertial_parameters`; O(n depth).
///
/// q: nq numbers; v, a: nv. Ten columns for each body but the world. With the rotors τ = Y π + armature a.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
/// >>> Y = condyle.joint_torque_regressor(arm, data, q, v, a)
/// >>> np.allclose(Y @ arm.inertial_parameters, condyle.rnea(arm, data, q, v, a))
/// True
fn joint_torque_regressor(model, data; q: Position, v: Tangent, a: Tangent; out) {
    condyle::regressors::joint_torque_regressor(model, data, &q, &v, &a)
}
batch b: any(q: Position, v: Tangent, a: Tangent) -> One { b.joint_torque_regressor(model, q, v, a) }

/// The kinetic energy regressor y(q, v), 10 (nbodies − 1) numbers, with T = y · π: `kinetic_energy`, without the
/// rotors, as a linear function of `Model.inertial_parameters`; O(n).
///
/// q: nq numbers; v: nv.
fn kinetic_energy_regressor(model, data; q: Position, v: Tangent; out) {
    condyle::regressors::kinetic_energy_regressor(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> One { b.kinetic_energy_regressor(model, q, v) }

/// The potential energy regressor y(q), 10 (nbodies − 1) numbers, with V = y · π: `potential_energy` as a linear
/// function of `Model.inertial_parameters`; O(n).
///
/// q: nq numbers.
fn potential_energy_regressor(model, data; q: Position; out) {
    condyle::regressors::potential_energy_regressor(model, data, &q)
}
batch b: any(q: Position) -> One { b.potential_energy_regressor(model, q) }

/// The passive torque τ = −d v − f tanh(v/ε) of the joints' own damping d and smoothed friction f, nv numbers (N m, N);
/// O(n).
///
/// v: nv numbers; smoothing: ε > 0, the speed (rad/s, m/s) at which friction is 76 % of f. No other function adds
/// them: add them to τ where they should act.
///
/// >>> arm = condyle.robots.arm7()
/// >>> v = np.ones(7)
/// >>> np.allclose(condyle.passive_torque(arm, v, 1e-3), -arm.damping - arm.friction)
/// True
fn passive_torque(model; v: Tangent, smoothing: Speed; out) {
    let mut tau = vec![Scalar::zero(); model.nv()];
    condyle::terms::passive_torque(model, &v, smoothing, &mut tau);
    tau
}
each(v: Tangent; smoothing: Speed) -> [nv] |tau| { condyle::terms::passive_torque(model, v, smoothing, tau); }

/// The derivative ∂τ/∂v = −d − f/ε (1 − tanh²(v/ε)) of `passive_torque`, nv numbers: the diagonal of a matrix without
/// other entries; O(n).
///
/// v: nv numbers; smoothing: ε > 0 (rad/s, m/s).
fn passive_torque_derivative(model; v: Tangent, smoothing: Speed; out) {
    let mut slope = vec![Scalar::zero(); model.nv()];
    condyle::derivatives::passive_torque_derivative(model, &v, smoothing, &mut slope);
    slope
}
each(v: Tangent; smoothing: Speed) -> [nv] |slope| {
    condyle::derivatives::passive_torque_derivative(model, v, smoothing, slope)
}
}
