//! Forward dynamics by the method that is fastest for the model.

use crate::aba::aba;
use crate::crba::crba;
use crate::data::{Data, check_forces};
use crate::rnea::rnea;
use crate::workspace::filled;
use condyle_linalg::Cholesky;
use condyle_linalg::Ltdl;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Constant, Force, Scalar};
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
    sparse: Ltdl<S>,
    /// A factor of M. Written by: `forward_dynamics`.
    dense: Cholesky<S>,
    /// τ − h, then joint accelerations. Shape: nv. Written by: `forward_dynamics`.
    pub qdd: Vec<S>,
    /// Zeros. Shape: nv. Written by: nobody.
    zero: Vec<S>,
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
    fn run_dense<S>(d: &mut Workspace<S>, h: &[S], M: &DMatrix<S>, tau: &[S]) {
        let Workspace { dense, qdd, .. } = d;
        subtract(tau, h, qdd);
        dense.factorize(M);
        dense.solve(qdd); // M q̈ = τ − h
    }
}

kernel! {
    fn run_sparse<S>(d: &mut Workspace<S>, h: &[S], M: &DMatrix<S>, tau: &[S]) {
        let Workspace { sparse, qdd, .. } = d;
        subtract(tau, h, qdd);
        sparse.factorize(M);
        sparse.solve(qdd); // M q̈ = τ − h
    }
}

/// q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i) by a method of choice, or by the [`fastest`](Method::fastest).
///
/// q: nq numbers; v, tau: nv; f_ext: a force on each body (N, N m), acting at the body's origin and expressed in its
/// frame, number 0 being the world's; or empty for none. Returns nv numbers (rad/s², m/s²). Allocates nothing.
/// Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 6 and 7. If joints share a coordinate,
/// [`Method::ArticulatedBody`] factorises M too, as [`aba`](crate::aba()) does.
///
/// ```
/// use condyle_dynamics::{Data, Method, forward_dynamics, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let a = forward_dynamics(&arm, &mut data, &q, &v, &tau, &[], None).to_vec();
/// let same = forward_dynamics(&arm, &mut data, &q, &v, &tau, &[], Some(Method::Sparse));
/// assert!(a.iter().zip(same).all(|(a, b)| f64::abs(a - b) < 1e-9));
/// ```
///
/// # Panics
/// If an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
pub fn forward_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
    method: Option<Method>,
) -> &'d [S] {
    data.check(model);
    model.check_regular();
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check("tau", tau.len(), model.nv());
    check_forces(f_ext.len(), model.nodes().len());
    match method.unwrap_or(Method::fastest(model)) {
        Method::ArticulatedBody => aba(model, data, q, v, tau, f_ext),
        method => {
            by_factor(model, data, q, v, tau, f_ext, method);
            &data.forward_dynamics.qdd
        }
    }
}

/// Over a factor of M.
pub(crate) fn by_factor<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
    method: Method,
) {
    let zero = core::mem::take(&mut data.forward_dynamics.zero);
    rnea(model, data, q, v, &zero, f_ext); // h − Σ Jᵢᵀ f_ext,i
    data.forward_dynamics.zero = zero;
    crba(model, data, q);
    let (d, h, M) = (&mut data.forward_dynamics, data.rnea.tau(), data.crba.matrix());
    match method {
        Method::Dense => run_dense(d, h, M, tau),
        _ => run_sparse(d, h, M, tau),
    }
}
