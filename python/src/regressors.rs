//! Dynamics and energies as linear functions of the inertial parameters, and passive efforts: one Python function for
//! each function of the library.

use crate::arrays::{Give, Number, give_named};
use crate::functions::{any, functions};
use condyle::Scalar;
use nalgebra::DMatrix;
use pyo3::prelude::*;

functions! {
/// Computes the joint torque regressor Y(q, v, a), (nv, 10 (nbodies − 1)), with τ = Y π: `rnea` as a linear function of
/// `Model.inertial_parameters`; O(n depth).
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each. Each body except the world has ten
/// columns. With rotors, τ = Y π + armature · a. For the linear coordinates of a free joint, armature · (a + ω × v)
/// replaces armature · a.
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

/// Computes the kinetic energy regressor y(q, v), 10 (nbodies − 1) numbers; O(n). T = y · π is `kinetic_energy` without
/// the rotors, as a linear function of π, the `Model.inertial_parameters`.
///
/// q: position, nq numbers; v: velocity, nv numbers.
fn kinetic_energy_regressor(model, data; q: Position, v: Tangent; out) {
    condyle::regressors::kinetic_energy_regressor(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> One { b.kinetic_energy_regressor(model, q, v) }

/// Computes the potential energy regressor y(q), 10 (nbodies − 1) numbers; O(n). V = y · π is `potential_energy` as a
/// linear function of π, the `Model.inertial_parameters`.
///
/// q: position, nq numbers.
fn potential_energy_regressor(model, data; q: Position; out) {
    condyle::regressors::potential_energy_regressor(model, data, &q)
}
batch b: any(q: Position) -> One { b.potential_energy_regressor(model, q) }

/// Computes the passive torque τ = −d v − f tanh(v/ε) + springs + gravity compensation, nv numbers (N m, N); O(n). The
/// damping coefficient is d = d₀ + d₁ |v| + d₂ v²; f is the friction, smoothed by ε.
///
/// q: position, nq numbers; v: velocity, nv numbers; smoothing: ε > 0, a speed (rad/s, m/s); at the speed ε, friction
/// is tanh 1 = 76 % of f. A spring with the coefficients k₀, k₁ and k₂ has the effort −(k₀ + k₁ Δ + k₂ Δ²) Δ, where Δ
/// is the displacement from its rest position. For joints with several degrees of freedom, the brackets contain |Δ|
/// instead of Δ. The equations are the same as for MuJoCo's `qfrc_passive`, with two exceptions. MuJoCo treats friction
/// as a constraint. For joints with `actuatorgravcomp`, MuJoCo counts gravity compensation among the efforts of
/// actuators. No other function of a model includes passive torques: add passive torques to τ where needed.
///
/// >>> arm = condyle.robots.arm7()
/// >>> q, v = np.zeros(7), np.ones(7)
/// >>> np.allclose(condyle.passive_torque(arm, q, v, 1e-3), -arm.damping - arm.friction)
/// True
fn passive_torque(model; q: Position, v: Tangent, smoothing: Speed; out) {
    let mut tau = vec![Scalar::zero(); model.nv()];
    condyle::terms::passive_torque(model, &q, &v, smoothing, &mut tau);
    tau
}
each(q: Position, v: Tangent; smoothing: Speed) -> [nv] |tau| {
    condyle::terms::passive_torque(model, q, v, smoothing, tau)
}

/// Computes the exact derivatives of `passive_torque`, as `PassiveDerivatives(dtau_dq, dtau_dv)`, each (nv, nv).
///
/// q: position, nq numbers; v: velocity, nv numbers; smoothing: ε > 0 (rad/s, m/s). ∂τ/∂v is diagonal, except for free
/// joints with friction or polynomial damping. ∂τ/∂q has a block for each spring, and couples joints if gravity is
/// compensated.
///
/// >>> arm = condyle.robots.arm7()
/// >>> d = condyle.passive_torque_derivatives(arm, np.zeros(7), np.ones(7), 1e-3)
/// >>> np.allclose(d.dtau_dv, -np.diag(arm.damping)), not d.dtau_dq.any()  # it has no springs
/// (True, True)
fn passive_torque_derivatives(model; q: Position, v: Tangent, smoothing: Speed; out) {
    let [mut dtau_dq, mut dtau_dv] = [(); 2].map(|()| DMatrix::from_element(model.nv(), model.nv(), Scalar::zero()));
    condyle::derivatives::passive_torque_derivatives(model, &q, &v, smoothing, &mut dtau_dq, &mut dtau_dv);
    PassiveDerivatives { dtau_dq, dtau_dv }
}
}

/// The derivatives of passive efforts with respect to q and v.
struct PassiveDerivatives<S> {
    dtau_dq: DMatrix<S>,
    dtau_dv: DMatrix<S>,
}

impl<S: Number + Give> Give for PassiveDerivatives<S> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        give_named!(py, out, "PassiveDerivatives", { "dtau_dq" => self.dtau_dq, "dtau_dv" => self.dtau_dv })
    }
}
