//! The second derivatives of forward dynamics, contracted with a vector, by hand.
//!
//! τ(q, v, q̈(q, v, τ)) = τ holds for every q, v and τ. Differentiated twice and multiplied by μᵀ = λᵀ M⁻¹, with the Hessian
//! of φ = μᵀ rnea(q, v, a) at a = q̈ (`rnea_hessian.rs`) and G = ∂²φ/∂a∂q,
//!
//! ```text
//! λᵀ ∂²q̈/∂q∂q = −∂²φ/∂q∂q − (∂q̈/∂q)ᵀ G − Gᵀ ∂q̈/∂q     λᵀ ∂²q̈/∂v∂q = −∂²φ/∂v∂q − (∂q̈/∂v)ᵀ G
//! λᵀ ∂²q̈/∂v∂v = −∂²φ/∂v∂v                                λᵀ ∂²q̈/∂τ∂q = −M⁻¹ G
//! ```
//!
//! and nothing else, since τ is linear in a and does not mix v with a. Source: Nganga and Wensing, *Accelerating
//! second-order differential dynamic programming for rigid-body systems* (2021).

use crate::aba::check_arguments;
use crate::aba_derivatives::{self, AbaDerivatives};
use crate::data::Data;
use crate::workspace::{Size, filled, zero_matrix};
use crate::{rnea_derivatives, rnea_hessian};
use condyle_linalg::check;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_linalg::tree_product::minus_product;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Constant, Force, Scalar};
use nalgebra::DMatrix;

/// Bᵀ, of a square matrix.
#[inline(always)]
fn transpose_to<S: Scalar>(B: &[S], out: &mut [S], n: usize) {
    for j in 0..n {
        for i in 0..n {
            out[j + n * i] = B[i + n * j];
        }
    }
}

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// μ = M⁻¹ λ. Shape: nv. Written by: `aba_hessian`.
    mu: Vec<S>,
    /// A transpose. Shape: nv × nv. Written by: `run`.
    transpose: Vec<S>,
    /// A product. Shape: nv × nv. Written by: `run`.
    product: Vec<S>,
    /// Shape: nv × nv. Written by: `run`.
    dqdq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `run`.
    dvdq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `run`.
    dvdv: DMatrix<S>,
    /// Shape: nv × nv. Written by: `run`.
    dtaudq: DMatrix<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        let square = || zero_matrix(size.nv, size.nv);
        Self {
            mu: filled(S::zero(), size.nv),
            transpose: filled(S::zero(), size.nv * size.nv),
            product: filled(S::zero(), size.nv * size.nv),
            dqdq: square(),
            dvdq: square(),
            dvdv: square(),
            dtaudq: square(),
        }
    }
}

kernel! {
    /// After `aba_derivatives` and the Hessian of φ.
    fn run<S>(
        coupled: &[NonzeroRows],
        first: &aba_derivatives::Workspace<S>,
        Minv: &DMatrix<S>,
        phi: &rnea_hessian::Workspace<S>,
        d: &mut Workspace<S>,
    ) {
        let Workspace { transpose, product, dqdq, dvdq, dvdv, dtaudq, .. } = d;
        let (n, G) = (coupled.len(), phi.dadq.as_slice());
        let product = product.as_mut_slice();
        transpose_to(first.da_dq.as_slice(), transpose, n);
        minus_product(transpose, G, product, coupled); // −(∂q̈/∂q)ᵀ G
        let (qq, vv) = (dqdq.as_mut_slice(), dvdv.as_mut_slice());
        let (phi_qq, phi_vv) = (phi.dqdq.as_slice(), phi.dvdv.as_slice());
        for j in 0..n {
            for i in 0..n {
                qq[i + n * j] = product[i + n * j] + product[j + n * i] - phi_qq[i + n * j];
                vv[i + n * j] = -phi_vv[i + n * j];
            }
        }
        transpose_to(first.da_dv.as_slice(), transpose, n);
        let (vq, phi_vq) = (dvdq.as_mut_slice(), phi.dvdq.as_slice());
        minus_product(transpose, G, vq, coupled); // −(∂q̈/∂v)ᵀ G
        for k in 0..n * n {
            vq[k] -= phi_vq[k];
        }
        minus_product(Minv.as_slice(), G, dtaudq.as_mut_slice(), coupled); // −M⁻¹ G
    }
}

/// The second derivatives of ψ = λᵀ aba(q, v, τ), each a full nv × nv matrix; all others are zero.
///
/// They are the Hessian of ψ(q ⊕ δ, v + …, τ + …) at δ = 0.
#[derive(Clone, Copy, Debug)]
pub struct AbaHessian<'d, S, R = f64> {
    /// ∂²ψ/∂q∂q, symmetric.
    pub dqdq: &'d DMatrix<S>,
    /// ∂²ψ/∂v∂q: entry (j, k) is ∂²ψ/∂v_j∂q_k.
    pub dvdq: &'d DMatrix<S>,
    /// ∂²ψ/∂v∂v, symmetric.
    pub dvdv: &'d DMatrix<S>,
    /// ∂²ψ/∂τ∂q: entry (j, k) is ∂²ψ/∂τ_j∂q_k, the derivative of M⁻¹ λ by q.
    pub dtaudq: &'d DMatrix<S>,
    /// q̈ and its first derivatives, which come with them.
    pub first: AbaDerivatives<'d, S, R>,
}

/// The second derivatives of [`aba`](crate::aba), contracted with a vector λ: the Hessian of ψ = λᵀ q̈(q, v, τ), exact.
///
/// q: nq numbers; v, tau, lambda: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for
/// none. Returns four nv × nv matrices (in units of λᵀ q̈ by those of q, v and τ), q̈ and its first derivatives: O(n · depth)
/// for what goes into them, and three sparse products of O(n²) columns. Allocates nothing. Source: Nganga and Wensing
/// (2021); see the head of the file.
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
/// If an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
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
    check_arguments(model, data, q, v, tau, f_ext);
    aba_derivatives::in_turn(model, data, q, v, tau, f_ext);
    let mut mu = core::mem::take(&mut data.aba_hessian.mu);
    for (i, mu) in mu.iter_mut().enumerate() {
        let row = data.minv.matrix().column(i); // symmetric: a row is a column
        *mu = row.iter().zip(lambda).fold(S::zero(), |sum, (&x, &l)| x.mul_add(l, sum)); // μ = M⁻¹ λ
    }
    rnea_hessian::run(model, &data.world, &data.rnea_derivatives.bodies, &mut data.rnea_hessian, &mu);
    data.aba_hessian.mu = mu;
    let (first, Minv) = (&data.aba_derivatives, data.minv.matrix());
    run(model.nonzero_rows(), first, Minv, &data.rnea_hessian, &mut data.aba_hessian);
    let state = rnea_derivatives::view(model, data).state;
    let first = data.aba_derivatives.view(data.minv.matrix(), state);
    let Workspace { dqdq, dvdq, dvdv, dtaudq, .. } = &data.aba_hessian;
    AbaHessian { dqdq, dvdq, dvdv, dtaudq, first }
}
