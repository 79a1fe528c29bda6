//! Dynamics and its derivatives: one Python function for each function of the library.
//!
//! A call for one state takes microseconds and keeps the interpreter's lock; a call for many states releases this lock.

use crate::arrays::{Give, Number, Symmetric, give_named};
use crate::functions::{any, functions, regular};
use pyo3::prelude::*;

impl<S: Number> Give for condyle::derivatives::RneaDerivatives<'_, S> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let dtau_da = Symmetric(self.dtau_da);
        give_named!(py, out, "RneaDerivatives", {
            "dtau_dq" => self.dtau_dq, "dtau_dv" => self.dtau_dv, "dtau_da" => dtau_da
        })
    }
}

impl<S: Number> Give for condyle::derivatives::AbaDerivatives<'_, S> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let da_dtau = Symmetric(self.da_dtau);
        give_named!(py, out, "AbaDerivatives", {
            "a" => self.a, "da_dq" => self.da_dq, "da_dv" => self.da_dv, "da_dtau" => da_dtau
        })
    }
}

functions! {
/// Computes the joint efforts τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i that produce the acceleration a (inverse dynamics),
/// nv numbers (N m, N); O(n).
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: (nbodies, 6), a force on each body
/// (N, then N m). Each force acts at the origin of its body and is expressed in the body's frame; row 0 belongs to the
/// world.
///
/// >>> arm = condyle.robots.arm7()
/// >>> tau = condyle.rnea(arm, condyle.Data(arm), [0.3] * 7, [0.0] * 7, [0.0] * 7)
/// >>> bool(abs(tau[0]) < 1e-9)  # gravity does not turn a vertical axis
/// True
fn rnea(model, data; q: Position, v: Tangent, a: Tangent, f_ext: Forces = None; out) {
    condyle::rnea(model, data, &q, &v, &a, &f_ext)
}
batch b: any(q: Position, v: Tangent, a: Tangent, f_ext: Forces) -> One { b.rnea(model, q, v, a, f_ext) }

/// Computes the acceleration q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i) (forward dynamics), nv numbers (rad/s², m/s²);
/// O(n).
///
/// q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`.
///
/// Raises `ModelError` if M is singular at every position. M may also be singular at this position only, for example if
/// a point mass lies on the axis of its joint. Then the acceleration is not finite, or is a large number caused by
/// rounding errors.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q, zero = condyle.neutral(quadruped), [0.0] * 18
/// >>> a = condyle.aba(quadruped, condyle.Data(quadruped), q, zero, zero)
/// >>> bool(abs(a[2] + 9.81) < 1e-12)  # it falls
/// True
fn aba(model, data; q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::aba(model, data, &q, &v, &tau, &f_ext)
}
batch b: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces) -> One { b.aba(model, q, v, tau, f_ext) }

/// Computes forward dynamics, like `aba`, by the method that `method` names: the acceleration q̈, nv numbers (rad/s²,
/// m/s²).
///
/// q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`. method: 'aba', the
/// articulated-body algorithm, O(n) for n coordinates; 'dense', a dense factor of M, O(n³); 'sparse', a factor of M
/// that keeps the zeros of the tree, O(n d²) for depth d of the tree. None selects 'sparse' for a robot with mimic
/// joints, and 'aba', the fastest method, for all other robots. All methods give the same numbers, up to rounding.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, tau = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [1.0] * 7
/// >>> a = condyle.forward_dynamics(arm, data, q, v, tau, method="sparse")
/// >>> np.allclose(a, condyle.aba(arm, data, q, v, tau))
/// True
fn forward_dynamics(model, data;
    q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None, method: MethodOf = None; out) {
    regular(model)?;
    condyle::factors::forward_dynamics(model, data, &q, &v, &tau, &f_ext, method)
}
batch b: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces; method: MethodOf) -> One {
    b.forward_dynamics(model, q, v, tau, f_ext, method)
}

/// Computes the joint-space inertia matrix M(q): (nv, nv), symmetric, both triangles filled, armature included; O(n
/// depth).
///
/// q: position, nq numbers. τ = M a + h; the kinetic energy is ½ vᵀ M v.
///
/// >>> arm = condyle.robots.arm7()
/// >>> M = condyle.crba(arm, condyle.Data(arm), [0.3] * 7)
/// >>> bool(np.linalg.eigvalsh(M).min() > 0.0)
/// True
fn crba(model, data; q: Position; out) {
    Symmetric(condyle::crba(model, data, &q))
}
batch b: any(q: Position) -> One { b.crba(model, q) }

/// Computes the inverse M(q)⁻¹ of the inertia matrix: (nv, nv), symmetric, both triangles filled. M itself is not
/// computed.
///
/// q: position, nq numbers.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q = condyle.Data(arm), [0.3] * 7
/// >>> np.allclose(condyle.minv(arm, data, q) @ condyle.crba(arm, data, q), np.eye(7))
/// True
fn minv(model, data; q: Position; out) {
    regular(model)?;
    Symmetric(condyle::minv(model, data, &q))
}
batch b: regular(q: Position) -> One { b.minv(model, q) }

/// Computes the nonlinear effects h(q, v) = C(q, v) v + g(q), nv numbers: the efforts of `rnea` with a = 0.
///
/// q: position, nq numbers; v: velocity, nv numbers.
fn nonlinear_effects(model, data; q: Position, v: Tangent; out) {
    condyle::nonlinear_effects(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> One { b.nonlinear_effects(model, q, v) }

/// Computes the gravity efforts g(q) that hold the robot still, nv numbers: the efforts of `rnea` with v = a = 0.
///
/// q: position, nq numbers.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> g = condyle.gravity(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(g[2] - 9.81 * quadruped.total_mass) < 1e-9)  # the base carries the weight
/// True
fn gravity(model, data; q: Position; out) {
    condyle::terms::gravity(model, data, &q)
}
batch b: any(q: Position) -> One { b.gravity(model, q) }

/// Computes the efforts τ = g(q) − Σ Jᵢᵀ f_ext,i that hold the robot still under external forces, nv numbers (N m, N);
/// O(n).
///
/// q: position, nq numbers; f_ext: as for `rnea`. The result equals `rnea` with v = a = 0.
fn static_torque(model, data; q: Position, f_ext: Forces = None; out) {
    condyle::terms::static_torque(model, data, &q, &f_ext)
}
batch b: any(q: Position, f_ext: Forces) -> One { b.static_torque(model, q, f_ext) }

/// Computes the Coriolis matrix C(q, v) by Christoffel symbols: (nv, nv), with C v = h − g and Ṁ = C + Cᵀ; O(n depth).
///
/// q: position, nq numbers; v: velocity, nv numbers.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
/// >>> h, g = condyle.nonlinear_effects(arm, data, q, v), condyle.gravity(arm, data, q)
/// >>> np.allclose(condyle.coriolis_matrix(arm, data, q, v) @ v, h - g)
/// True
fn coriolis_matrix(model, data; q: Position, v: Tangent; out) {
    condyle::terms::coriolis_matrix(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> One { b.coriolis_matrix(model, q, v) }

/// Computes the exact derivatives of `rnea` with respect to q, v and a in O(n depth), as `RneaDerivatives(dtau_dq,
/// dtau_dv, dtau_da)`, each (nv, nv).
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: as for `rnea`, constant in the
/// bodies' frames. ∂τ/∂q is taken in the tangent space, as the derivative of τ at `integrate(q, δ)` with respect to δ,
/// at δ = 0. out: three arrays, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> dtau_dq, dtau_dv, dtau_da = condyle.rnea_derivatives(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7)
/// >>> dtau_dq.shape
/// (7, 7)
fn rnea_derivatives(model, data; q: Position, v: Tangent, a: Tangent, f_ext: Forces = None; out) {
    condyle::rnea_derivatives(model, data, &q, &v, &a, &f_ext)
}
batch b: any(q: Position, v: Tangent, a: Tangent, f_ext: Forces) -> Named("RneaDerivatives") {
    b.rnea_derivatives(model, q, v, a, f_ext)
}

/// Computes the acceleration of `aba` and its exact derivatives with respect to q, v and τ, as `AbaDerivatives(a,
/// da_dq, da_dv, da_dtau)`: nv numbers and three matrices (nv, nv).
///
/// q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; f_ext: as for `rnea`, constant in the
/// bodies' frames. ∂q̈/∂q is taken in the tangent space, as the derivative of q̈ at `integrate(q, δ)` with respect to
/// δ, at δ = 0. out: four arrays, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data = condyle.Data(arm)
/// >>> d = condyle.aba_derivatives(arm, data, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.array_equal(d.da_dtau, condyle.minv(arm, data, [0.3] * 7))
/// True
fn aba_derivatives(model, data; q: Position, v: Tangent, tau: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::aba_derivatives(model, data, &q, &v, &tau, &f_ext)
}
batch b: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces) -> Named("AbaDerivatives") {
    b.aba_derivatives(model, q, v, tau, f_ext)
}
}
