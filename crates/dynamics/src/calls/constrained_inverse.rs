//! Inverse dynamics under constraints: the efforts and the constraints' accelerations for a motion and forces that are
//! given, and their derivatives.

use super::inverse_dynamics;
use crate::constraints::constrained_dynamics::evaluate;
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::kkt_derivatives::{differentiate_motion, load, turn};
use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::kinematics::{accelerations, positions, velocities};
use crate::passes::rnea;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Matrix, Scalar};

/// What [`constrained_inverse_dynamics`] gives; J is that of [`ConstraintSet::jacobian`].
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedInverse<'d, S> {
    /// τ = M q̈ + h − Jᵀ λ, nv numbers (N m, N).
    pub tau: &'d [S],
    /// J q̈ + γ, as many numbers as there are rows (m/s², rad/s²): 0 where the motion satisfies the constraints.
    pub acceleration: &'d [S],
}

/// τ = M q̈ + h − Jᵀ λ − Σ Jᵢᵀ f_ext,i and J q̈ + γ, for accelerations and forces that are given: inverse dynamics under
/// constraints.
///
/// Where nothing drives a coordinate, τ is 0 in any motion that is possible; where constraints hold, J q̈ + γ is.
///
/// q: nq numbers; v, a: nv; lambda: a number for each row; f_ext: a force on each body in its frame, number 0 being the
/// world's, or empty for none. In O(n) beside the rows of J. Allocates nothing.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, constrained_dynamics, constrained_inverse_dynamics};
/// let arm = condyle_dynamics::robots::arm7();
/// let touch = ContactConstraint { kd: 20.0, ..ContactConstraint::point(arm.frame("tool")?) };
/// let (mut touch, mut data) = (ConstraintSet::new(&arm, &[touch])?, Data::new(&arm));
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let forward = constrained_dynamics(&arm, &mut data, &mut touch, &q, &v, &tau, &[]);
/// let (a, lambda) = (forward.a.to_vec(), forward.lambda.to_vec());
/// let inverse = constrained_inverse_dynamics(&arm, &mut data, &mut touch, &q, &v, &a, &lambda, &[]);
/// assert!(inverse.tau.iter().all(|tau| f64::abs(tau - 1.0) < 1e-10));
/// assert!(inverse.acceleration.iter().all(|x| f64::abs(*x) < 1e-10));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` or `constraints` were made for another model.
#[track_caller]
pub fn constrained_inverse_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    lambda: &[S],
    f_ext: &[Force<S>],
) -> ConstrainedInverse<'d, S> {
    check_arguments(model, data, constraints, [q, v, a, lambda], f_ext);
    positions(model, &mut data.world, q);
    velocities(model, &data.world, &mut data.moving, v);
    accelerations(model, &data.world, &mut data.moving, a);
    evaluate(&data.world, constraints, &data.moving.v, &data.moving.a);
    inverse(model, data, constraints, [q, v, a, lambda], f_ext);
    ConstrainedInverse { tau: &data.rnea.tau, acceleration: &constraints.error }
}

/// What [`constrained_inverse_dynamics_derivatives`] gives; J is that of [`ConstraintSet::jacobian`], and ∂τ/∂λ = −Jᵀ.
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedInverseDerivatives<'d, S> {
    /// τ itself, nv numbers.
    pub tau: &'d [S],
    /// J q̈ + γ itself, as many numbers as there are rows.
    pub acceleration: &'d [S],
    /// ∂τ/∂q̈ = M, nv × nv, armature included.
    pub M: &'d Matrix<S>,
    /// ∂τ/∂q in the tangent space, nv × nv: the change of τ when q moves to q ⊕ δ, per δ.
    pub dtau_dq: &'d Matrix<S>,
    /// ∂τ/∂v, nv × nv.
    pub dtau_dv: &'d Matrix<S>,
    /// ∂(J q̈ + γ)/∂q in the tangent space, rows × nv.
    pub dacceleration_dq: &'d Matrix<S>,
    /// ∂(J q̈ + γ)/∂v, rows × nv.
    pub dacceleration_dv: &'d Matrix<S>,
}

/// [`constrained_inverse_dynamics`] and its derivatives with respect to q, v and q̈, exact; those with respect to λ are
/// −Jᵀ and 0.
///
/// Arguments as there; targets of the constraints are fixed. In O(n · depth). Allocates nothing. Source: Carpentier and
/// Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, constrained_inverse_dynamics_derivatives, crba};
/// let arm = condyle_dynamics::robots::arm7();
/// let touch = ContactConstraint::point(arm.frame("tool")?);
/// let (mut touch, mut data) = (ConstraintSet::new(&arm, &[touch])?, Data::new(&arm));
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let d = constrained_inverse_dynamics_derivatives(&arm, &mut data, &mut touch, &q, &v, &a, &[5.0; 3], &[]);
/// let M = d.M.clone();
/// assert!((M - crba(&arm, &mut data, &q)).amax() < 1e-13);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// As [`constrained_inverse_dynamics`].
#[track_caller]
pub fn constrained_inverse_dynamics_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    lambda: &[S],
    f_ext: &[Force<S>],
) -> ConstrainedInverseDerivatives<'d, S> {
    check_arguments(model, data, constraints, [q, v, a, lambda], f_ext);
    differentiate(model, data, constraints, [q, v, a, lambda], f_ext);
    rnea::run(model, &mut data.world, &mut data.rnea, q, v, a, &data.constrained_derivatives.forces);
    ConstrainedInverseDerivatives {
        tau: &data.rnea.tau,
        acceleration: &constraints.error,
        M: &data.rnea_derivatives.dtau_da,
        dtau_dq: &data.constrained_derivatives.dtau_dq,
        dtau_dv: &data.rnea_derivatives.dtau_dv,
        dacceleration_dq: &constraints.dgamma_dq,
        dacceleration_dv: &constraints.dgamma_dv,
    }
}

/// The matrices of [`ConstrainedInverseDerivatives`].
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct EquationsAt<'d, S> {
    pub M: &'d Matrix<S>,
    pub dtau_dq: &'d Matrix<S>,
    pub dtau_dv: &'d Matrix<S>,
    pub dgamma_dq: &'d Matrix<S>,
    pub dgamma_dv: &'d Matrix<S>,
}

/// [`constrained_inverse_dynamics_derivatives`] without the values: for the knots of an optimal control problem, whose rollout
/// has found q̈ and λ.
#[doc(hidden)]
#[track_caller]
pub fn constrained_equations_at<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    lambda: &[S],
) -> EquationsAt<'d, S> {
    check_arguments(model, data, constraints, [q, v, a, lambda], &[]);
    differentiate(model, data, constraints, [q, v, a, lambda], &[]);
    EquationsAt {
        M: &data.rnea_derivatives.dtau_da,
        dtau_dq: &data.constrained_derivatives.dtau_dq,
        dtau_dv: &data.rnea_derivatives.dtau_dv,
        dgamma_dq: &constraints.dgamma_dq,
        dgamma_dv: &constraints.dgamma_dv,
    }
}

/// The derivatives, for arguments that fit.
fn differentiate<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    [q, v, a, lambda]: [&[S]; 4],
    f_ext: &[Force<S>],
) {
    positions(model, &mut data.world, q);
    let (world, d, id) = (&data.world, &mut data.constrained_derivatives, &mut data.rnea_derivatives);
    constraints.lambda.copy_from_slice(lambda);
    load(model, constraints, world, f_ext, &mut d.forces);
    rnea_derivatives::run(model, world, id, v, a, &d.forces, &[]);
    evaluate(world, constraints, &id.bodies.v, &id.bodies.a);
    turn(constraints, world, &id.dtau_dq, &mut d.dtau_dq);
    differentiate_motion(constraints, world, &id.bodies);
}

/// τ, for bodies that are placed.
fn inverse<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    [q, v, a, lambda]: [&[S]; 4],
    f_ext: &[Force<S>],
) {
    constraints.lambda.copy_from_slice(lambda);
    load(model, constraints, &data.world, f_ext, &mut data.constrained_derivatives.forces);
    rnea::run(model, &mut data.world, &mut data.rnea, q, v, a, &data.constrained_derivatives.forces);
}

/// Panics unless the arguments fit.
#[inline]
#[track_caller]
fn check_arguments<S: Scalar, R>(
    model: &Model<R>,
    data: &Data<S>,
    constraints: &ConstraintSet<S>,
    [q, v, a, lambda]: [&[S]; 4],
    f_ext: &[Force<S>],
) {
    inverse_dynamics::check_arguments(model, data, "a", Arguments { q, v, x: a, f_ext });
    constraints.check(model);
    check("lambda", lambda.len(), constraints.rows());
}
