//! Forward dynamics: accelerations of a robot for given efforts.

use super::inertia::crba as inertia_matrix;
use super::inverse_dynamics::{check_arguments, rnea as inverse_dynamics};
use super::limbs;
use crate::data::Data;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::factored_dynamics::{ForwardDynamicsMethod, run_dense, run_sparse};
use crate::passes::free_armature::without_bias;
use crate::passes::kinematics::{positions, positions_after_rnea};
use crate::passes::{aba, crba, rnea};
use crate::selection::{self, is_short_chain};
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Scalar};

/// Computes forward dynamics, q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i), in O(n) for n bodies.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body (N, N m), at the body's origin and in the body's
/// frame, or empty for no forces; index 0 is the world. Returns nv numbers (rad/s², m/s²). Allocates nothing. Source:
/// Featherstone (2008), table 7.1. If joints share a coordinate (mimic), the function solves with a sparse factor of M,
/// like [`ForwardDynamicsMethod::Sparse`].
///
/// ```
/// use condyle_dynamics::{Data, aba, robots, rnea};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let a = aba(&arm, &mut data, &q, &v, &tau, &[]).to_vec();
/// let back = rnea(&arm, &mut data, &q, &v, &a, &[]);
/// assert!(back.iter().all(|&tau| f64::abs(tau - 1.0) < 1e-10));
/// ```
///
/// M may be singular at some positions only, for example if a point mass lies on its joint's axis. Such positions are
/// not detected: the accelerations are then not finite, or mostly rounding errors. All functions that need M⁻¹ have
/// this limitation.
///
/// # Panics
/// Panics if an argument has the wrong length, `data` was made for a model of another tree, or M is singular at every
/// position ([`Model::singular_joints`]).
#[track_caller]
pub fn aba<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    let arguments = Arguments { q, v, x: tau, f_ext };
    model.check_regular();
    check_arguments(model, data, "tau", arguments);
    if !limbs::aba(model, data, arguments) {
        run_serially(model, data, arguments);
    }
    &data.aba.qdd
}

/// Computes q̈ body by body, and leaves the placements and the factors of ABA in `data`. The arguments must be valid.
pub(crate) fn run_serially<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) {
    if model.has_mimic() {
        return by_factor(model, data, arguments, ForwardDynamicsMethod::Sparse);
    }
    let Arguments { q, v, x: tau, f_ext } = arguments;
    positions(model, &mut data.world, q);
    if model.free_armature().is_empty() {
        return aba::run(model, &data.world, &mut data.aba, v, tau, f_ext);
    }
    let mut effort = core::mem::take(&mut data.aba.effort);
    without_bias(model, v, tau, &mut effort);
    aba::run(model, &data.world, &mut data.aba, v, &effort, f_ext);
    data.aba.effort = effort;
}

impl ForwardDynamicsMethod {
    /// Returns the fastest method for a model: [`ArticulatedBody`](Self::ArticulatedBody), or [`Sparse`](Self::Sparse)
    /// if joints share a coordinate (mimic). The recursion over bodies does not support shared coordinates.
    ///
    /// ```
    /// use condyle_dynamics::{ForwardDynamicsMethod, robots};
    /// assert_eq!(ForwardDynamicsMethod::fastest(&robots::humanoid()), ForwardDynamicsMethod::ArticulatedBody);
    /// ```
    pub fn fastest<R>(model: &Model<R>) -> Self {
        selection::forward_dynamics(model)
    }
}

/// Computes q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i) by a given method. `None` selects the
/// [`fastest`](ForwardDynamicsMethod::fastest) method.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body (N, N m), at the body's origin and in the body's
/// frame, or empty for no forces; index 0 is the world. Returns nv numbers (rad/s², m/s²). Allocates nothing. Source:
/// Featherstone, *Rigid Body Dynamics Algorithms* (2008), chapters 6 and 7. If joints share a coordinate,
/// [`ForwardDynamicsMethod::ArticulatedBody`] factorises M too, as [`aba`](crate::aba()) does.
///
/// ```
/// use condyle_dynamics::{Data, ForwardDynamicsMethod, forward_dynamics, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let a = forward_dynamics(&arm, &mut data, &q, &v, &tau, &[], None).to_vec();
/// let same = forward_dynamics(&arm, &mut data, &q, &v, &tau, &[], Some(ForwardDynamicsMethod::Sparse));
/// assert!(a.iter().zip(same).all(|(a, b)| f64::abs(a - b) < 1e-9));
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` was made for a model of another tree, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn forward_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
    method: Option<ForwardDynamicsMethod>,
) -> &'d [S] {
    let arguments = Arguments { q, v, x: tau, f_ext };
    model.check_regular();
    check_arguments(model, data, "tau", arguments);
    match method.unwrap_or(ForwardDynamicsMethod::fastest(model)) {
        ForwardDynamicsMethod::ArticulatedBody => aba(model, data, q, v, tau, f_ext),
        method => {
            by_factor(model, data, arguments, method);
            &data.aba.qdd
        }
    }
}

/// Computes forward dynamics by factorising M, as a dense or a sparse matrix.
pub(crate) fn by_factor<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    Arguments { q, v, x: tau, f_ext }: Arguments<'_, S>,
    method: ForwardDynamicsMethod,
) {
    let zero = core::mem::take(&mut data.forward_dynamics.zero);
    if method == ForwardDynamicsMethod::Dense && is_short_chain(model) {
        // A chain has no limbs, so `rnea` runs body by body and stores the sines and cosines of all joints. The
        // computation of M uses these numbers again.
        rnea::run(model, &mut data.world, &mut data.rnea, q, v, &zero, f_ext);
        positions_after_rnea(model, &mut data.world, q);
        crba::run(model, &data.world, &mut data.crba);
    } else {
        inverse_dynamics(model, data, q, v, &zero, f_ext); // h − Σ Jᵢᵀ f_ext,i
        inertia_matrix(model, data, q);
    }
    data.forward_dynamics.zero = zero;
    let (d, h, M, qdd) = (&mut data.forward_dynamics, &data.rnea.tau, &data.crba.M, &mut data.aba.qdd);
    match method {
        ForwardDynamicsMethod::Dense => run_dense(d, h, M, tau, qdd),
        _ => run_sparse(d, h, M, tau, qdd),
    }
}
