//! Second derivatives of forward dynamics, contracted with a vector, by analytical formulas.
//!
//! τ(q, v, q̈(q, v, τ)) = τ holds for every q, v and τ. This equation is differentiated twice and multiplied by μᵀ = λᵀ
//! M⁻¹. `rnea_hessian.rs` computes the Hessian of φ = μᵀ rnea(q, v, a) at a = q̈. With G = ∂²φ/∂a∂q, the result is
//!
//! ```text
//! λᵀ ∂²q̈/∂q∂q = −∂²φ/∂q∂q − (∂q̈/∂q)ᵀ G − Gᵀ ∂q̈/∂q     λᵀ ∂²q̈/∂v∂q = −∂²φ/∂v∂q − (∂q̈/∂v)ᵀ G
//! λᵀ ∂²q̈/∂v∂v = −∂²φ/∂v∂v                                λᵀ ∂²q̈/∂τ∂q = −M⁻¹ G
//! ```
//!
//! All other second derivatives are zero, since τ is linear in a and has no term with both v and a. Source: Nganga and
//! Wensing, *Accelerating second-order differential dynamic programming for rigid-body systems* (2021).

use crate::derivatives::aba_derivatives::{self};
use crate::derivatives::rnea_hessian;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_linalg::sparsity::NonzeroRows;
use condyle_linalg::tree_product::neg_product;
use condyle_spatial::kernel;
use condyle_spatial::{Array, Matrix, Scalar};

/// Writes the transpose Bᵀ of an n × n matrix B to `out`.
#[inline(always)]
fn transpose_to<S: Scalar>(B: &[S], out: &mut [S], n: usize) {
    for j in 0..n {
        for i in 0..n {
            out[j + n * i] = B[i + n * j];
        }
    }
}

workspace! {
    pub(crate) struct Workspace<S>(size) {
        /// Vector μ = M⁻¹ λ. Written by: `aba_hessian`.
        pub mu: Array<S> = filled(S::zero, size.nv),
        /// Scratch for the transpose of ∂q̈/∂q, then of ∂q̈/∂v. Written by: `run`.
        pub transpose: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Scratch for the product −(∂q̈/∂q)ᵀ G, with G = ∂²φ/∂a∂q and φ = μᵀ rnea(q, v, a). Written by: `run`.
        pub product: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Matrix λᵀ ∂²q̈/∂q∂q of contracted second derivatives. Written by: `run`.
        pub dqdq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Matrix λᵀ ∂²q̈/∂v∂q of contracted second derivatives. Written by: `run`.
        pub dvdq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Matrix λᵀ ∂²q̈/∂v∂v of contracted second derivatives. Written by: `run`.
        pub dvdv: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Matrix λᵀ ∂²q̈/∂τ∂q of contracted second derivatives. Written by: `run`.
        pub dtaudq: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

kernel! {
    /// Computes μ = M⁻¹ λ.
    pub(crate) fn multiply<S>(Minv: &Matrix<S>, lambda: &[S], mu: &mut [S]) {
        let n = mu.len();
        for i in 0..n {
            let row = &Minv.as_slice()[i * n..(i + 1) * n]; // row i of M⁻¹ equals column i
            let mut sum = S::zero();
            for k in 0..n {
                sum = row[k].mul_add(lambda[k], sum);
            }
            mu[i] = sum;
        }
    }
}

kernel! {
    /// Computes the four matrices λᵀ ∂²q̈/∂x∂y, for x and y among q, v and τ. Runs after `aba_derivatives`, and after
    /// the Hessian of φ = λᵀ M⁻¹ rnea(q, v, a).
    pub(crate) fn run<S>(
        coupled: &[NonzeroRows],
        first: &aba_derivatives::Workspace<S>,
        Minv: &Matrix<S>,
        phi: &rnea_hessian::Workspace<S>,
        d: &mut Workspace<S>,
    ) {
        let Workspace { transpose, product, dqdq, dvdq, dvdv, dtaudq, .. } = d;
        let (n, G) = (coupled.len(), phi.dadq.as_slice());
        let product = &mut product[..];
        transpose_to(first.da_dq.as_slice(), transpose, n);
        neg_product(transpose, G, product, coupled); // −(∂q̈/∂q)ᵀ G
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
        neg_product(transpose, G, vq, coupled); // −(∂q̈/∂v)ᵀ G
        for k in 0..n * n {
            vq[k] -= phi_vq[k];
        }
        neg_product(Minv.as_slice(), G, dtaudq.as_mut_slice(), coupled); // −M⁻¹ G
    }
}
