//! Second derivatives of inverse and forward dynamics, contracted with a vector or as tensors.

use super::derivatives::{AbaDerivatives, RneaDerivatives, run_aba_serially, run_rnea_serially, view, view_of_aba};
use super::inverse_dynamics::check_arguments;
use crate::data::Data;
use crate::derivatives::{aba_hessian as aba, rnea_hessian as rnea};
use crate::lanes::limbs::pass::Arguments;
use crate::workspace::filled;
use alloc::vec::Vec;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Array, Constant, Force, Matrix, Scalar};
use nalgebra::DMatrix;

/// Second derivatives of φ = λᵀ rnea(q, v, a), each a full nv × nv matrix. The derivatives ∂²φ/∂v∂a and ∂²φ/∂a∂a are
/// zero.
///
/// The matrices are blocks of the Hessian of φ(q ⊕ δ, v + δv, a + δa) at δ = 0, δv = 0 and δa = 0.
#[derive(Clone, Copy, Debug)]
pub struct RneaHessian<'d, S, R = f64> {
    /// Second derivatives ∂²φ/∂q∂q of φ = λᵀ rnea(q, v, a), symmetric.
    pub dqdq: &'d Matrix<S>,
    /// Second derivatives ∂²φ/∂v∂q of φ = λᵀ rnea(q, v, a): entry (j, k) is ∂²φ/∂v_j∂q_k.
    pub dvdq: &'d Matrix<S>,
    /// Second derivatives ∂²φ/∂v∂v of φ = λᵀ rnea(q, v, a), symmetric.
    pub dvdv: &'d Matrix<S>,
    /// Second derivatives ∂²φ/∂a∂q, the derivative of M λ with respect to q: entry (j, k) is ∂²φ/∂a_j∂q_k.
    pub dadq: &'d Matrix<S>,
    /// First derivatives of τ, which the same call computes.
    pub first: RneaDerivatives<'d, S, R>,
}

/// Computes the second derivatives of [`rnea`](crate::rnea), contracted with a vector λ, in O(n · depth). The result is
/// the exact Hessian of φ = λᵀ τ(q, v, a).
///
/// q: nq numbers; v, a, lambda: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with
/// the body), or empty for no forces. Returns four nv × nv matrices (units: λᵀ τ divided by the units of q, v and a),
/// and the first derivatives of τ. Allocates nothing. Source: the equations of
/// [`rnea_derivatives`](crate::rnea_derivatives()), differentiated once more.
///
/// ```
/// use condyle_dynamics::{Data, rnea_hessian, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a, lambda) = ([0.3; 7], [0.1; 7], [0.2; 7], [1.0; 7]);
/// let hessian = rnea_hessian(&arm, &mut data, &q, &v, &a, &[], &lambda);
/// // φ is quadratic in v: λᵀ (τ(v) + τ(−v) − 2 τ(0)) = vᵀ ∂²φ/∂v² v
/// let v = nalgebra::DVector::from_row_slice(&v);
/// let quadratic = v.dot(&(hessian.dvdv * &v));
/// let mut effort = |s: f64| -> f64 {
///     condyle_dynamics::rnea(&arm, &mut data, &q, (&v * s).as_slice(), &a, &[]).iter().sum()
/// };
/// assert!((effort(1.0) + effort(-1.0) - 2.0 * effort(0.0) - quadratic).abs() < 1e-12);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn rnea_hessian<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
    lambda: &[S],
) -> RneaHessian<'d, S, R> {
    check("lambda", lambda.len(), model.nv());
    let arguments = Arguments { q, v, x: a, f_ext };
    check_arguments(model, data, "a", arguments);
    run_rnea_serially(model, data, arguments);
    rnea::run(model, &data.world, &data.rnea_derivatives.bodies, &mut data.rnea_hessian, lambda);
    let first = view(model, data);
    let rnea::Workspace { dqdq, dvdq, dvdv, dadq, .. } = &data.rnea_hessian;
    RneaHessian { dqdq, dvdq, dvdv, dadq, first }
}

/// Second derivatives of τ = rnea(q, v, a): one Hessian per effort, 4 nv³ numbers.
#[derive(Clone, Debug)]
pub struct RneaSecondDerivatives<S> {
    /// Second derivatives ∂²τ_i/∂q∂q for each i, symmetric.
    pub dqdq: Vec<DMatrix<S>>,
    /// Second derivatives ∂²τ_i/∂v∂q for each i: entry (j, k) is ∂²τ_i/∂v_j∂q_k.
    pub dvdq: Vec<DMatrix<S>>,
    /// Second derivatives ∂²τ_i/∂v∂v for each i, symmetric.
    pub dvdv: Vec<DMatrix<S>>,
    /// Second derivatives ∂²τ_i/∂a∂q for each i: entry (j, k) is ∂²τ_i/∂a_j∂q_k = ∂M_ij/∂q_k.
    pub dadq: Vec<DMatrix<S>>,
    /// Scratch for the unit vector that selects an effort. Shape: nv. Written by: `new`, `rnea_second_derivatives`.
    lambda: Array<S>,
}

impl<S: Scalar> RneaSecondDerivatives<S> {
    /// Allocates the tensors for a model.
    pub fn new<R>(model: &Model<R>) -> Self {
        let zeros = || vec![DMatrix::from_element(model.nv(), model.nv(), S::zero()); model.nv()];
        let lambda = filled(S::zero, model.nv());
        Self { dqdq: zeros(), dvdq: zeros(), dvdv: zeros(), dadq: zeros(), lambda }
    }
}

/// Computes the second derivatives of [`rnea`](crate::rnea) as full tensors, in O(n² · depth).
///
/// q: nq numbers; v, a: nv numbers each; f_ext: one force per body, in the body's frame, or empty for no forces; out:
/// the tensors, overwritten. Allocates nothing. Solvers usually need only the tensors contracted with a vector, which
/// [`rnea_hessian`] computes. This function calls the contraction once for each unit vector.
///
/// ```
/// use condyle_dynamics::{Data, RneaSecondDerivatives, rnea_second_derivatives, robots};
/// let arm = robots::arm7();
/// let mut tensors = RneaSecondDerivatives::new(&arm);
/// let (q, o) = ([0.3; 7], [0.0; 7]);
/// rnea_second_derivatives(&arm, &mut Data::new(&arm), &q, &o, &o, &[], &mut tensors);
/// let (dM_01, dM_10) = (tensors.dadq[0].row(1), tensors.dadq[1].row(0));
/// assert!((dM_01 - dM_10).amax() < 1e-14); // M is symmetric wherever q goes
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` or `out` was made for a model of another tree.
#[track_caller]
pub fn rnea_second_derivatives<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
    out: &mut RneaSecondDerivatives<S>,
) {
    check("out", out.lambda.len(), model.nv());
    let RneaSecondDerivatives { dqdq, dvdq, dvdv, dadq, lambda } = out;
    each_unit_hessian(model, data, Arguments { q, v, x: a, f_ext }, lambda, |i, matrices| {
        for (to, from) in [&mut dqdq[i], &mut dvdq[i], &mut dvdv[i], &mut dadq[i]].into_iter().zip(matrices) {
            to.copy_from(from);
        }
    });
}

/// Computes the matrices of [`rnea_hessian`] for λ equal to each unit vector. Calls `give` with the index of the unit
/// vector and the matrices. `lambda` is scratch.
#[track_caller]
pub(crate) fn each_unit_hessian<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
    lambda: &mut [S],
    mut give: impl FnMut(usize, [&Matrix<S>; 4]),
) {
    check_arguments(model, data, "a", arguments);
    run_rnea_serially(model, data, arguments);
    lambda.fill(S::zero());
    for i in 0..model.nv() {
        lambda[i] = S::one();
        rnea::run(model, &data.world, &data.rnea_derivatives.bodies, &mut data.rnea_hessian, lambda);
        lambda[i] = S::zero();
        let rnea::Workspace { dqdq, dvdq, dvdv, dadq, .. } = &data.rnea_hessian;
        give(i, [dqdq, dvdq, dvdv, dadq]);
    }
}

/// Second derivatives of ψ = λᵀ aba(q, v, τ), each a full nv × nv matrix. All other second derivatives are zero.
///
/// The matrices are blocks of the Hessian of ψ(q ⊕ δ, v + δv, τ + δτ) at δ = 0, δv = 0 and δτ = 0.
#[derive(Clone, Copy, Debug)]
pub struct AbaHessian<'d, S, R = f64> {
    /// Second derivatives ∂²ψ/∂q∂q of ψ = λᵀ aba(q, v, τ), symmetric.
    pub dqdq: &'d Matrix<S>,
    /// Second derivatives ∂²ψ/∂v∂q of ψ = λᵀ aba(q, v, τ): entry (j, k) is ∂²ψ/∂v_j∂q_k.
    pub dvdq: &'d Matrix<S>,
    /// Second derivatives ∂²ψ/∂v∂v of ψ = λᵀ aba(q, v, τ), symmetric.
    pub dvdv: &'d Matrix<S>,
    /// Second derivatives ∂²ψ/∂τ∂q, the derivative of M⁻¹ λ with respect to q: entry (j, k) is ∂²ψ/∂τ_j∂q_k.
    pub dtaudq: &'d Matrix<S>,
    /// q̈ and the first derivatives of q̈, which the same call computes.
    pub first: AbaDerivatives<'d, S, R>,
}

/// Computes the second derivatives of [`aba`](crate::aba), contracted with a vector λ. The result is the exact Hessian
/// of ψ = λᵀ q̈(q, v, τ).
///
/// q: nq numbers; v, tau, lambda: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with
/// the body), or empty for no forces. Returns q̈, the first derivatives of q̈, and four nv × nv matrices (units: λᵀ q̈
/// divided by the units of q, v and τ). Costs O(n · depth) for the second derivatives of τ, and three sparse products
/// of O(n²) columns. Allocates nothing. Source: Nganga and Wensing (2021).
///
/// ```
/// use condyle_dynamics::{Data, aba_hessian, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau, lambda) = ([0.3; 7], [0.1; 7], [0.2; 7], [1.0; 7]);
/// let hessian = aba_hessian(&arm, &mut data, &q, &v, &tau, &[], &lambda);
/// assert!((hessian.dqdq - hessian.dqdq.transpose()).amax() < 1e-9);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn aba_hessian<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
    lambda: &[S],
) -> AbaHessian<'d, S, R> {
    check("lambda", lambda.len(), model.nv());
    let arguments = Arguments { q, v, x: tau, f_ext };
    model.check_regular();
    check_arguments(model, data, "tau", arguments);
    run_aba_serially(model, data, arguments);
    let mut mu = core::mem::take(&mut data.aba_hessian.mu);
    aba::multiply(&data.minv.Minv, lambda, &mut mu); // μ = M⁻¹ λ
    rnea::run(model, &data.world, &data.rnea_derivatives.bodies, &mut data.rnea_hessian, &mu);
    data.aba_hessian.mu = mu;
    let (first, Minv) = (&data.aba_derivatives, &data.minv.Minv);
    aba::run(model.nonzero_rows(), first, Minv, &data.rnea_hessian, &mut data.aba_hessian);
    let first = view_of_aba(model, data);
    let aba::Workspace { dqdq, dvdq, dvdv, dtaudq, .. } = &data.aba_hessian;
    AbaHessian { dqdq, dvdq, dvdv, dtaudq, first }
}
