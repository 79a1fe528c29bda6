//! Derivatives other than the first derivatives of `rnea` and `aba`: one Python function for each function of the
//! library.

use crate::arrays::{Array, Number, named_tuples};
use crate::functions::{any, functions, regular};
use crate::kinematics::motions;
use condyle::{Scalar, derivatives::RneaSecondDerivatives};
use nalgebra::DMatrix;
use pyo3::prelude::*;

named_tuples! {
    RneaHessian<'_> { dqdq, dvdq, dvdv, dadq }
    AbaHessian<'_> { dqdq, dvdq, dvdv, dtaudq }
    CentroidalDerivatives<'_> {
        dh_dq, dh_dv, drate_dq, drate_dv, drate_da, dcom_dq, dvcom_dq, dacom_dq, dacom_dv
    }
    EnergyDerivatives<'_> { dT_dq, dT_dv, dV_dq }
    CoriolisDerivatives<'_> { dq, dv }
    RneaSecondDerivatives { dqdq, dvdq, dvdv, dadq }
}

/// Matrices of equal shape as one array, whose first axis numbers the matrices.
impl<S: Number> Array for [DMatrix<S>] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        let (rows, columns) = self.first().map_or((0, 0), DMatrix::shape);
        [self.len(), rows, columns]
    }
    fn write(&self, x: &mut [S]) {
        let size = self.first().map_or(1, DMatrix::len).max(1);
        self.iter().zip(x.chunks_exact_mut(size)).for_each(|(matrix, x)| matrix.write(x));
    }
}

functions! {
/// Computes the derivative ∂τ/∂(input) of `rnea`, (nv, k), for an input of k numbers other than q, v and a; exact, at
/// most O(n) per column.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; wrt: the input; f_ext: as for `rnea`.
/// Values of wrt: 'gravity', the acceleration of free fall, 3 numbers; 'armature', nv numbers; 'damping', nv numbers,
/// as if `passive_torque` were added to τ; ('force', body), the external force on a body in the body's frame, 6
/// numbers; ('inertia', body), the 10 inertial parameters of a body; or ('friction', smoothing), nv numbers, with the
/// smoothing of `passive_torque`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, zero = condyle.Data(arm), [0.3] * 7, [0.0] * 7
/// >>> dtau_dg = condyle.rnea_input_derivative(arm, data, q, zero, zero, "gravity")
/// >>> np.allclose(dtau_dg @ [0.0, 0.0, -9.81], condyle.gravity(arm, data, q))  # τ is linear in g
/// True
fn rnea_input_derivative(model, data; q: Position, v: Tangent, a: Tangent, wrt: InputOf, f_ext: Forces = None; out) {
    let mut dtau = DMatrix::from_element(model.nv(), wrt.len(model), Scalar::zero());
    condyle::rnea_derivatives(model, data, &q, &v, &a, &f_ext).with_respect_to(wrt, &mut dtau);
    dtau
}
batch b: any(q: Position, v: Tangent, a: Tangent, f_ext: Forces; wrt: InputOf) -> One {
    b.rnea_input_derivative(model, q, v, a, f_ext, wrt)
}

/// Computes the derivative ∂q̈/∂(input) of `aba`, (nv, k), for an input of k numbers other than q, v and τ; exact, at
/// most O(n²) per column.
///
/// q: position, nq numbers; v, tau: velocity and efforts, nv numbers each; wrt: as for `rnea_input_derivative`; f_ext:
/// as for `rnea`.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), [0.0] * 18
/// >>> da_df = condyle.aba_input_derivative(quadruped, data, q, zero, zero, ("force", "root_joint"))
/// >>> np.allclose(da_df, condyle.minv(quadruped, data, q)[:, :6])  # a force on the trunk is an effort of its joint
/// True
fn aba_input_derivative(model, data; q: Position, v: Tangent, tau: Tangent, wrt: InputOf, f_ext: Forces = None; out) {
    regular(model)?;
    let mut da = DMatrix::from_element(model.nv(), wrt.len(model), Scalar::zero());
    condyle::aba_derivatives(model, data, &q, &v, &tau, &f_ext).with_respect_to(wrt, &mut da);
    da
}
batch b: regular(q: Position, v: Tangent, tau: Tangent, f_ext: Forces; wrt: InputOf) -> One {
    b.aba_input_derivative(model, q, v, tau, f_ext, wrt)
}

/// Computes the exact Hessian of λᵀ τ(q, v, a), with τ of `rnea`, in O(n depth), as `RneaHessian(dqdq, dvdq, dvdv,
/// dadq)`, each (nv, nv); the other blocks are zero.
///
/// q: position, nq numbers; v, a, lambda_: velocity, acceleration and λ, nv numbers each; f_ext: as for `rnea`,
/// constant in the bodies' frames. Entry [j, k] of dvdq is the derivative with respect to v_j and q_k, entry [j, k] of
/// dadq with respect to a_j and q_k. Derivatives with respect to q are derivatives with respect to δ at `integrate(q,
/// δ)`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
/// >>> hessian = condyle.rnea_hessian(arm, data, q, v, a, np.ones(7))
/// >>> np.allclose(hessian.dqdq, hessian.dqdq.T)
/// True
fn rnea_hessian(model, data; q: Position, v: Tangent, a: Tangent, lambda_: Tangent, f_ext: Forces = None; out) {
    condyle::derivatives::rnea_hessian(model, data, &q, &v, &a, &f_ext, &lambda_)
}
batch b: any(q: Position, v: Tangent, a: Tangent, lambda_: Tangent, f_ext: Forces) -> Named("RneaHessian") {
    b.rnea_hessian(model, q, v, a, f_ext, lambda_)
}

/// Computes the exact Hessian of λᵀ q̈(q, v, τ), with q̈ of `aba`, as `AbaHessian(dqdq, dvdq, dvdv, dtaudq)`, each (nv,
/// nv); the other blocks are zero.
///
/// q: position, nq numbers; v, tau, lambda_: velocity, efforts and λ, nv numbers each; f_ext: as for `rnea`, constant
/// in the bodies' frames. Entry [j, k] of dvdq is the derivative with respect to v_j and q_k, entry [j, k] of dtaudq
/// with respect to τ_j and q_k. Derivatives with respect to q are derivatives with respect to δ at `integrate(q, δ)`.
fn aba_hessian(model, data; q: Position, v: Tangent, tau: Tangent, lambda_: Tangent, f_ext: Forces = None; out) {
    regular(model)?;
    condyle::derivatives::aba_hessian(model, data, &q, &v, &tau, &f_ext, &lambda_)
}
batch b: regular(q: Position, v: Tangent, tau: Tangent, lambda_: Tangent, f_ext: Forces) -> Named("AbaHessian") {
    b.aba_hessian(model, q, v, tau, f_ext, lambda_)
}

/// Computes the exact second derivatives of `rnea` as full tensors in O(n² depth), as `RneaSecondDerivatives(dqdq,
/// dvdq, dvdv, dadq)`, each (nv, nv, nv): member[i] is the Hessian of τ_i.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; f_ext: as for `rnea`. Each Hessian has
/// the index order of `rnea_hessian`. If the product of the tensors with a vector is enough, `rnea_hessian` is many
/// times faster.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a, weights = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7, np.arange(7.0)
/// >>> tensors = condyle.rnea_second_derivatives(arm, data, q, v, a)
/// >>> hessian = condyle.rnea_hessian(arm, data, q, v, a, weights)
/// >>> np.allclose(np.einsum("i,ijk->jk", weights, tensors.dqdq), hessian.dqdq)
/// True
fn rnea_second_derivatives(model, data; q: Position, v: Tangent, a: Tangent, f_ext: Forces = None; out) {
    let mut tensors = RneaSecondDerivatives::new(model);
    condyle::derivatives::rnea_second_derivatives(model, data, &q, &v, &a, &f_ext, &mut tensors);
    tensors
}
batch b: any(q: Position, v: Tangent, a: Tangent, f_ext: Forces) -> Named("RneaSecondDerivatives") {
    b.rnea_second_derivatives(model, q, v, a, f_ext)
}
}

motions! {
/// Computes the derivative ∂v/∂q of a frame's velocity, (6, nv), linear rows first. The derivative with respect to v is
/// the frame's Jacobian.
///
/// q: position, nq numbers; v: velocity, nv numbers; frame: the frame's name or index; reference: as for
/// `frame_jacobian`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> dv_dq = condyle.frame_velocity_derivative(arm, condyle.Data(arm), [0.3] * 7, [0.5] * 7, "tool")
/// >>> bool((dv_dq[:, 0] == 0.0).all())  # turned as a whole, the arm moves as before
/// True
fn frame_velocity_derivative(frame: FrameOf) after forward_velocities(q: Position, v: Tangent) fills (dv_dq) -> One;

/// Computes the derivatives ∂a/∂q and ∂a/∂v of a frame's spatial acceleration, `(da_dq, da_dv)`, each (6, nv). The
/// derivative with respect to the joint accelerations is the frame's Jacobian.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
/// reference: as for `frame_jacobian`.
fn frame_acceleration_derivatives(frame: FrameOf)
    after forward_accelerations(q: Position, v: Tangent, a: Tangent) fills (da_dq, da_dv) -> Pair;

/// Computes the derivatives ∂a/∂q and ∂a/∂v of a frame's classical acceleration, `(da_dq, da_dv)`, each (6, nv). The
/// derivative with respect to the joint accelerations is the frame's Jacobian.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; frame: the frame's name or index;
/// reference: as for `frame_jacobian`.
fn frame_classical_acceleration_derivatives(frame: FrameOf)
    after forward_accelerations(q: Position, v: Tangent, a: Tangent) fills (da_dq, da_dv) -> Pair;

/// Computes the derivative ∂v/∂q of a body's velocity, (6, nv): `frame_velocity_derivative` of the body's own frame.
///
/// q: position, nq numbers; v: velocity, nv numbers; body: as for `body_jacobian`; reference: as for `frame_jacobian`.
fn body_velocity_derivative(body: BodyOf) after forward_velocities(q: Position, v: Tangent) fills (dv_dq) -> One;

/// Computes the derivatives ∂a/∂q and ∂a/∂v of a body's spatial acceleration, `(da_dq, da_dv)`, each (6, nv):
/// `frame_acceleration_derivatives` of the body's own frame.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each; body: as for `body_jacobian`; reference:
/// as for `frame_jacobian`.
fn body_acceleration_derivatives(body: BodyOf)
    after forward_accelerations(q: Position, v: Tangent, a: Tangent) fills (da_dq, da_dv) -> Pair;
}

functions! {
/// Computes the exact derivatives of the centroidal momentum, its rate and the centre of mass with respect to q, v and
/// a in O(n), as `CentroidalDerivatives`.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each. The accelerations do not include gravity.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data, q, zero = condyle.Data(quadruped), condyle.neutral(quadruped), [0.0] * 18
/// >>> d = condyle.centroidal_derivatives(quadruped, data, q, zero, zero)
/// >>> np.allclose(d.drate_da, condyle.centroidal_map(quadruped, data, q).Ag)
/// True
fn centroidal_derivatives(model, data; q: Position, v: Tangent, a: Tangent; out) {
    condyle::centroidal::centroidal_derivatives(model, data, &q, &v, &a)
}
batch b: any(q: Position, v: Tangent, a: Tangent) -> Named("CentroidalDerivatives") {
    b.centroidal_derivatives(model, q, v, a)
}

/// Computes the exact derivatives of kinetic energy T and potential energy V in O(n), as `EnergyDerivatives(dT_dq,
/// dT_dv, dV_dq)`, nv numbers each.
///
/// q: position, nq numbers; v: velocity, nv numbers.
fn energy_derivatives(model, data; q: Position, v: Tangent; out) {
    condyle::derivatives::energy_derivatives(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> Named("EnergyDerivatives") { b.energy_derivatives(model, q, v) }

/// Computes the exact derivative ∂τ/∂q of `static_torque`, (nv, nv), in O(n depth). Without external forces, ∂τ/∂q is
/// also the derivative of `gravity`.
///
/// q: position, nq numbers; f_ext: as for `rnea`, constant in the bodies' frames.
fn static_torque_derivative(model, data; q: Position, f_ext: Forces = None; out) {
    condyle::derivatives::static_torque_derivative(model, data, &q, &f_ext)
}
batch b: any(q: Position, f_ext: Forces) -> One { b.static_torque_derivative(model, q, f_ext) }

/// Computes the exact derivatives of C(q, v) v, the Coriolis and centrifugal efforts, in O(n depth), as
/// `CoriolisDerivatives(dq, dv)`, each (nv, nv).
///
/// q: position, nq numbers; v: velocity, nv numbers.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
/// >>> d = condyle.coriolis_derivatives(arm, data, q, v)
/// >>> np.allclose(d.dv, 2.0 * condyle.coriolis_matrix(arm, data, q, v))  # C v is quadratic in v
/// True
fn coriolis_derivatives(model, data; q: Position, v: Tangent; out) {
    condyle::derivatives::coriolis_derivatives(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> Named("CoriolisDerivatives") { b.coriolis_derivatives(model, q, v) }
}
