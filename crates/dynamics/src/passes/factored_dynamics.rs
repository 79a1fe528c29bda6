//! Forward dynamics by solving M q̈ = τ − h with a factor of M, and the list of all methods of forward dynamics.

use crate::selection::SHORT_CHAIN;
use crate::workspace::{filled, workspace};
use condyle_linalg::Cholesky;
use condyle_linalg::Ltdl;
use condyle_linalg::small_solve::small_solve;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Array, Matrix, Scalar};

/// Method of forward dynamics. All methods give the same numbers, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ForwardDynamicsMethod {
    /// Articulated-body algorithm, O(n) for n bodies.
    ArticulatedBody,
    /// Solution of M q̈ = τ − h with the dense factor [`Cholesky`], O(n³) for n coordinates.
    Dense,
    /// Solution of M q̈ = τ − h with the sparse factor [`Ltdl`], O(n d²) for n coordinates and a tree of depth d.
    Sparse,
}

workspace! {
    pub(crate) struct Workspace<S>(size, model: &Model<R>) {
        /// Sparse factor of the inertia matrix M. Written by: `forward_dynamics`.
        pub sparse: Ltdl<S> = Ltdl::new(model),
        /// Dense factor of the inertia matrix M. Written by: `forward_dynamics`.
        pub dense: Cholesky<S> = Cholesky::new(size.nv),
        /// Zeros that are never overwritten.
        pub zero: Array<S> = filled(S::zero, model.nv()),
    }
}

/// Writes τ − h to `out`.
#[inline(always)]
fn subtract<S: Scalar>(tau: &[S], h: &[S], out: &mut [S]) {
    for k in 0..tau.len() {
        out[k] = tau[k] - h[k];
    }
}

kernel! {
    /// Computes q̈ with the dense factor of M.
    pub(crate) fn run_dense<S>(d: &mut Workspace<S>, h: &[S], M: &Matrix<S>, tau: &[S], qdd: &mut [S]) {
        subtract(tau, h, qdd);
        if qdd.len() <= SHORT_CHAIN {
            return small_solve::<S, SHORT_CHAIN>(M, qdd);
        }
        d.dense.factorize(M);
        d.dense.solve(qdd); // M q̈ = τ − h
    }
}

kernel! {
    /// Computes q̈ with the sparse factor of M.
    pub(crate) fn run_sparse<S>(d: &mut Workspace<S>, h: &[S], M: &Matrix<S>, tau: &[S], qdd: &mut [S]) {
        subtract(tau, h, qdd);
        d.sparse.factorize(M);
        d.sparse.solve(qdd); // M q̈ = τ − h
    }
}
