//! Inverse dynamics under constraints: joint efforts and constraint accelerations for a given motion and given
//! constraint forces, with the derivatives of these results.

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

/// Result of [`constrained_inverse_dynamics`]. [`ConstraintSet::jacobian`] returns the constraint Jacobian J.
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedInverse<'d, S> {
    /// Joint efforts τ = M q̈ + h − Jᵀ λ − Σ Jᵢᵀ f_ext,i, nv numbers (N m, N).
    pub tau: &'d [S],
    /// Accelerations J q̈ + γ of the constraints, one number per row (m/s², rad/s²). They are 0 if the motion satisfies
    /// the constraints.
    pub acceleration: &'d [S],
}

/// Computes inverse dynamics under constraints for given accelerations q̈ and forces λ: the efforts τ = M q̈ + h − Jᵀ λ
/// − Σ Jᵢᵀ f_ext,i, and the accelerations J q̈ + γ of the constraints.
///
/// For a feasible motion, τ is 0 at each coordinate without an actuator, and the constraint accelerations J q̈ + γ are
/// 0.
///
/// q: nq numbers; v, a: nv numbers each; lambda: one number per row; f_ext: one force per body, in the body's frame, or
/// empty for no forces; index 0 is the world. For n bodies, costs O(n) plus the cost of the rows of J. Allocates
/// nothing.
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
/// Panics if an argument has the wrong length, or `data` or `constraints` were made for another model.
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

/// Result of [`constrained_inverse_dynamics_derivatives`]. [`ConstraintSet::jacobian`] returns the constraint Jacobian
/// J. The derivative ∂τ/∂λ with respect to the constraint forces is −Jᵀ.
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedInverseDerivatives<'d, S> {
    /// Joint efforts τ, nv numbers.
    pub tau: &'d [S],
    /// Accelerations J q̈ + γ of the constraints, one number per row.
    pub acceleration: &'d [S],
    /// Derivative ∂τ/∂q̈ = M of the joint efforts, nv × nv, including armature.
    pub M: &'d Matrix<S>,
    /// Derivative ∂τ/∂q of the joint efforts in the tangent space, nv × nv: the change of τ per δ when q moves to q ⊕
    /// δ.
    pub dtau_dq: &'d Matrix<S>,
    /// Derivative ∂τ/∂v of the joint efforts, nv × nv.
    pub dtau_dv: &'d Matrix<S>,
    /// Derivative ∂(J q̈ + γ)/∂q of the constraint accelerations in the tangent space, rows × nv.
    pub dacceleration_dq: &'d Matrix<S>,
    /// Derivative ∂(J q̈ + γ)/∂v of the constraint accelerations, rows × nv.
    pub dacceleration_dv: &'d Matrix<S>,
}

/// Computes the results of [`constrained_inverse_dynamics`] and their exact derivatives with respect to q, v and q̈.
/// The derivative with respect to λ is −Jᵀ for τ, and 0 for J q̈ + γ.
///
/// The arguments are the same as for [`constrained_inverse_dynamics`]. Targets of the constraints are fixed. Costs O(n
/// · depth). Allocates nothing. Source: Carpentier and Mansard, *Analytical derivatives of rigid body dynamics
/// algorithms* (2018).
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
/// Panics under the same conditions as [`constrained_inverse_dynamics`].
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

/// Matrices of [`ConstrainedInverseDerivatives`].
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub struct EquationsAt<'d, S> {
    pub M: &'d Matrix<S>,
    pub dtau_dq: &'d Matrix<S>,
    pub dtau_dv: &'d Matrix<S>,
    pub dgamma_dq: &'d Matrix<S>,
    pub dgamma_dv: &'d Matrix<S>,
}

/// Computes only the matrices of [`constrained_inverse_dynamics_derivatives`]. Optimal control calls this function at
/// the knots of a trajectory, where the rollout has already computed q̈ and λ.
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

/// Computes the derivatives of constrained inverse dynamics. The arguments must be valid.
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

/// Computes the efforts τ. `data` must contain the placements of the bodies.
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

/// Panics if an argument has the wrong length, or `data` or `constraints` were made for another model.
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
