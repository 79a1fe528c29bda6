//! Forward dynamics by the method that is fastest for the model.

use crate::workspace::filled;
use condyle_linalg::Cholesky;
use condyle_linalg::Ltdl;
use condyle_model::Model;
use condyle_spatial::Scalar;
use condyle_spatial::kernel;
use nalgebra::DMatrix;

/// A way to compute forward dynamics. All give the same numbers, up to rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The articulated-body algorithm, O(n).
    ArticulatedBody,
    /// M q̈ = τ − h with the dense factor [`Cholesky`], O(n³).
    Dense,
    /// M q̈ = τ − h with the sparse factor [`Ltdl`], O(n d²) for a tree of depth d.
    Sparse,
}

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// A factor of M. Written by: `forward_dynamics`.
    pub sparse: Ltdl<S>,
    /// A factor of M. Written by: `forward_dynamics`.
    pub dense: Cholesky<S>,
    /// τ − h, then joint accelerations. Shape: nv. Written by: `forward_dynamics`.
    pub qdd: Vec<S>,
    /// Zeros. Shape: nv. Written by: nobody.
    pub zero: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new<R>(model: &Model<R>) -> Self {
        Self {
            sparse: Ltdl::new(model),
            dense: Cholesky::new(model.nv()),
            qdd: filled(S::zero(), model.nv()),
            zero: filled(S::zero(), model.nv()),
        }
    }
}

impl Method {
    /// The fastest method for a model: [`ArticulatedBody`](Self::ArticulatedBody), unless joints share a coordinate
    /// (mimic), for which the recursion over bodies does not close; then [`Sparse`](Self::Sparse).
    ///
    /// Measured by `benches/factorisation.rs` on chains, binary trees and stars of 6 to 200 joints and on the embedded
    /// robots: h and M alone cost as much as the whole recursion on the smallest and 1.1 to 3 times as much on the
    /// others, so no factor of M can win, however sparse. Of the factors, the sparse one is as fast as the dense one on
    /// chains, and on a star of 200 it makes forward dynamics 13 times faster.
    ///
    /// ```
    /// use condyle_dynamics::{Method, robots};
    /// assert_eq!(Method::fastest(&robots::humanoid()), Method::ArticulatedBody);
    /// ```
    pub fn fastest<R>(model: &Model<R>) -> Self {
        if model.has_mimic() { Self::Sparse } else { Self::ArticulatedBody }
    }
}

/// τ − h, of which h has been computed.
#[inline(always)]
fn subtract<S: Scalar>(tau: &[S], h: &[S], out: &mut [S]) {
    for k in 0..tau.len() {
        out[k] = tau[k] - h[k];
    }
}

kernel! {
    pub(crate) fn run_dense<S>(d: &mut Workspace<S>, h: &[S], M: &DMatrix<S>, tau: &[S]) {
        let Workspace { dense, qdd, .. } = d;
        subtract(tau, h, qdd);
        dense.factorize(M);
        dense.solve(qdd); // M q̈ = τ − h
    }
}

kernel! {
    pub(crate) fn run_sparse<S>(d: &mut Workspace<S>, h: &[S], M: &DMatrix<S>, tau: &[S]) {
        let Workspace { sparse, qdd, .. } = d;
        subtract(tau, h, qdd);
        sparse.factorize(M);
        sparse.solve(qdd); // M q̈ = τ − h
    }
}
