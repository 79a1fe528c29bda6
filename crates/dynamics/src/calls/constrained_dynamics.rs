//! Forward dynamics under constraints, the derivatives of its results, and the linearised equations.

use super::inverse_dynamics::check_arguments;
use super::limbs_constrained;
use crate::constraints::constrained_derivatives::{By, invert, respond};
use crate::constraints::constrained_dynamics::{equations, evaluate, factorize, solve};
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::kkt_derivatives::{differentiate_motion, load, turn};
use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::lanes::limbs::pass::Arguments;
use crate::passes::kinematics::positions;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Matrix, Scalar};

/// Result of [`constrained_dynamics`].
#[derive(Clone, Copy, Debug)]
pub struct Constrained<'d, S> {
    /// Joint accelerations q̈, nv numbers (rad/s², m/s²).
    pub a: &'d [S],
    /// Forces λ of the constraints, one number per row of the constraint Jacobian J (N, N m). Each force acts on the
    /// body of the constraint's frame and is expressed in the axes of the constraint's rows.
    pub lambda: &'d [S],
    /// Largest absolute value of the constraint accelerations J q̈ + γ (m/s², rad/s²). It is 0 if the constraints are
    /// satisfied exactly.
    pub residual: S,
    /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, up to rounding. These rows get
    /// no force. In f64, a row is dependent if it makes J M⁻¹ Jᵀ + μ 1 singular to 13 digits, with the regularisation
    /// μ. If the number is 0, the solution is unique.
    pub redundant: S,
}

/// Computes forward dynamics under constraints: q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i), with the forces λ for which
/// the constraint accelerations J q̈ + γ are 0.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body, in the body's frame (N, N m), or empty for no
/// forces; index 0 is the world. The computation uses the sparsity of the tree. For n bodies and a tree of depth d, the
/// cost is O(n d²), plus O(d) for each pair of rows of J, plus O(rows³). For robots with limbs ([`Model::with_limbs`]),
/// the articulated-body algorithm is used, and the term O(n d²) becomes O(n). Allocates nothing.
///
/// If constraints contradict each other, or a constraint cannot be satisfied at a singular posture, the result is
/// finite and `residual` is not zero. [`ProximalSettings`](crate::ProximalSettings) decide how redundant constraints
/// share their forces. Source: Carpentier, Budhiraja, Mansard (2021), with the factorisation of Featherstone (2005);
/// Wensing, Featherstone, Orin, *A reduced-order recursive algorithm for the computation of the operational-space
/// inertia matrix* (2012).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, constrained_dynamics, neutral, robots};
/// let quadruped = robots::quadruped();
/// let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|name| quadruped.frame(name).unwrap());
/// let mut stance = ConstraintSet::new(&quadruped, &feet.map(ContactConstraint::point))?;
/// let (mut data, mut q) = (Data::new(&quadruped), neutral(&quadruped));
/// (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // knees bent
/// let d = constrained_dynamics(&quadruped, &mut data, &mut stance, &q, &[0.0; 18], &[0.0; 18], &[]);
/// assert!(d.residual < 1e-10 && d.redundant == 0.0); // the feet stay, in one way
/// assert_eq!(d.lambda.len(), 12);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn constrained_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> Constrained<'d, S> {
    let arguments = Arguments { q, v, x: tau, f_ext };
    check(model, data, constraints, arguments);
    if !limbs_constrained::run(model, data, constraints, arguments) {
        run(model, data, constraints, arguments);
    }
    Constrained {
        a: &data.constrained_dynamics.qdd,
        lambda: &constraints.lambda,
        residual: constraints.residual(),
        redundant: constraints.delassus.redundant,
    }
}

/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular.
#[inline]
#[track_caller]
fn check<S: Scalar, R>(model: &Model<R>, data: &Data<S>, constraints: &ConstraintSet<S>, arguments: Arguments<'_, S>) {
    check_arguments(model, data, "tau", arguments);
    constraints.check(model);
    model.check_regular();
}

/// Computes constrained dynamics with the sparse factor of M. The arguments must be valid.
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    Arguments { q, v, x: tau, f_ext }: Arguments<'_, S>,
) {
    positions(model, &mut data.world, q);
    let (world, d) = (&data.world, &mut data.constrained_dynamics);
    equations(model, world, d, v, tau, f_ext);
    factorize(d);
    evaluate(world, constraints, &d.v, &d.a);
    core::mem::swap(&mut constraints.gamma, &mut constraints.error);
    solve(constraints, &d.factor, &d.effort, &mut d.qdd);
}

/// Result of [`constrained_dynamics_equations`]. [`ConstraintSet::jacobian`] returns the constraint Jacobian J.
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedEquations<'d, S> {
    /// Joint accelerations q̈, nv numbers.
    pub a: &'d [S],
    /// Forces λ of the constraints, one number per row of the constraint Jacobian J.
    pub lambda: &'d [S],
    /// Largest absolute value of the constraint accelerations J q̈ + γ (m/s², rad/s²).
    pub residual: S,
    /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, up to rounding.
    pub redundant: S,
    /// Inertia matrix M, nv × nv, including armature.
    pub M: &'d Matrix<S>,
    /// Derivative r_q = ∂(M q̈ + h − Jᵀ λ)/∂q in the tangent space, nv × nv: the change of M q̈ + h − Jᵀ λ per δ when q
    /// moves to q ⊕ δ.
    pub dtau_dq: &'d Matrix<S>,
    /// Derivative r_v = ∂h/∂v of the nonlinear effects h, nv × nv.
    pub dtau_dv: &'d Matrix<S>,
    /// Derivative c_q = ∂(J q̈ + γ)/∂q of the constraint accelerations in the tangent space, rows × nv.
    pub dgamma_dq: &'d Matrix<S>,
    /// Derivative c_v = ∂γ/∂v of the constraint accelerations, rows × nv.
    pub dgamma_dv: &'d Matrix<S>,
}

/// Computes the results of [`constrained_dynamics`](crate::constrained_dynamics()) and the linearised equations. These
/// equations relate changes of q, v and τ to changes of q̈ and λ:
///
/// ```text
/// M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,      J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0
/// ```
///
/// [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives) solves these equations. The linearised
/// equations are for callers that eliminate the unknowns themselves: no matrix is inverted, and all blocks keep the
/// sparsity of the tree.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with the
/// body), or empty for no forces. Targets of the constraints are fixed. Costs O(n · depth) in addition to the forward
/// dynamics. Allocates nothing. Source: Carpentier and Mansard (2018).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, constrained_dynamics_equations, crba, robots};
/// let arm = robots::arm7();
/// let touch = ContactConstraint { kp: 100.0, kd: 20.0, ..ContactConstraint::point(arm.frame("tool")?) };
/// let (mut touch, mut data) = (ConstraintSet::new(&arm, &[touch])?, Data::new(&arm));
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let M = constrained_dynamics_equations(&arm, &mut data, &mut touch, &q, &v, &tau, &[]).M.clone();
/// assert!((M - crba(&arm, &mut data, &q)).amax() < 1e-13);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn constrained_dynamics_equations<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> ConstrainedEquations<'d, S> {
    let arguments = Arguments { q, v, x: tau, f_ext };
    check(model, data, constraints, arguments);
    differentiate(model, data, constraints, arguments);
    ConstrainedEquations {
        a: &data.constrained_dynamics.qdd,
        lambda: &constraints.lambda,
        residual: constraints.residual(),
        redundant: constraints.delassus.redundant,
        M: &data.rnea_derivatives.dtau_da,
        dtau_dq: &data.constrained_derivatives.dtau_dq,
        dtau_dv: &data.rnea_derivatives.dtau_dv,
        dgamma_dq: &constraints.dgamma_dq,
        dgamma_dv: &constraints.dgamma_dv,
    }
}

/// Computes forward dynamics under constraints and the linearised equations. The arguments must be valid.
pub(crate) fn differentiate<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    arguments: Arguments<'_, S>,
) {
    run(model, data, constraints, arguments);
    let (world, qdd) = (&data.world, &data.constrained_dynamics.qdd);
    let (d, id) = (&mut data.constrained_derivatives, &mut data.rnea_derivatives);
    load(model, constraints, world, arguments.f_ext, &mut d.forces);
    rnea_derivatives::run(model, world, id, arguments.v, qdd, &d.forces, &[]);
    turn(constraints, world, &id.dtau_dq, &mut d.dtau_dq);
    differentiate_motion(constraints, world, &id.bodies);
}

/// Result of [`constrained_dynamics_derivatives`]. K is the matrix of the equations of motion and constraints. K⁻¹ has
/// the diagonal blocks ∂q̈/∂τ and −Λ, and the other blocks are −∂λ/∂τ and its transpose.
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedDerivatives<'d, S> {
    /// Joint accelerations q̈, nv numbers.
    pub a: &'d [S],
    /// Forces λ of the constraints, one number per row of the constraint Jacobian J.
    pub lambda: &'d [S],
    /// Largest absolute value of the constraint accelerations J q̈ + γ (m/s², rad/s²).
    pub residual: S,
    /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, up to rounding.
    pub redundant: S,
    /// Derivative ∂q̈/∂q of the joint accelerations in the tangent space, nv × nv: the change of q̈ per δ when q moves
    /// to q ⊕ δ.
    pub da_dq: &'d Matrix<S>,
    /// Derivative ∂q̈/∂v of the joint accelerations, nv × nv.
    pub da_dv: &'d Matrix<S>,
    /// Derivative ∂q̈/∂τ of the joint accelerations, nv × nv, symmetric.
    pub da_dtau: &'d Matrix<S>,
    /// Derivative ∂λ/∂q of the constraint forces in the tangent space, rows × nv.
    pub dlambda_dq: &'d Matrix<S>,
    /// Derivative ∂λ/∂v of the constraint forces, rows × nv.
    pub dlambda_dv: &'d Matrix<S>,
    /// Derivative ∂λ/∂τ of the constraint forces, rows × nv.
    pub dlambda_dtau: &'d Matrix<S>,
    /// Inertia Λ = (J M⁻¹ Jᵀ)⁻¹ of the robot along its constraints, rows × rows.
    pub inertia: &'d Matrix<S>,
}

/// Computes the results q̈ and λ of [`constrained_dynamics`](crate::constrained_dynamics()) and their exact derivatives
/// with respect to q, v and τ.
///
/// q: nq numbers; v, tau: nv numbers each; f_ext: one force per body, in the body's frame (the force moves with the
/// body), or empty for no forces. Targets of the constraints are fixed. Costs O(n · depth) for the right-hand sides and
/// O((n + rows)² n) for the products with K⁻¹, the inverse of the constrained equations' matrix. The products skip the
/// zeros of the tree. Allocates nothing.
///
/// If constraints are redundant, the derivatives of q̈ are exact up to the residual. The proximal parameter μ then
/// selects the derivatives of λ, as it selects λ: for μ = 0, redundant rows have no force; for μ > 0, the solution has
/// the smallest norm. Source: Carpentier and Mansard (2018).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, constrained_dynamics_derivatives, robots};
/// use nalgebra::DMatrix;
/// let arm = robots::arm7();
/// let touch = ContactConstraint { kp: 100.0, kd: 20.0, ..ContactConstraint::point(arm.frame("tool")?) };
/// let (mut touch, mut data) = (ConstraintSet::new(&arm, &[touch])?, Data::new(&arm));
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let da_dtau = constrained_dynamics_derivatives(&arm, &mut data, &mut touch, &q, &v, &tau, &[]).da_dtau.clone();
/// let mut J = DMatrix::<f64>::zeros(3, 7);
/// touch.jacobian(&mut J);
/// assert!((J * da_dtau).amax() < 1e-12); // no effort moves the point
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn constrained_dynamics_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> ConstrainedDerivatives<'d, S> {
    let arguments = Arguments { q, v, x: tau, f_ext };
    check(model, data, constraints, arguments);
    differentiate(model, data, constraints, arguments);
    let (d, id) = (&mut data.constrained_derivatives, &data.rnea_derivatives);
    invert(constraints, &data.constrained_dynamics.factor, &mut d.P);
    respond(constraints, By::Position, &d.P, &d.dtau_dq, &mut d.da_dq);
    respond(constraints, By::Velocity, &d.P, &id.dtau_dv, &mut d.da_dv);
    let (d, c) = (&data.constrained_derivatives, &*constraints);
    ConstrainedDerivatives {
        a: &data.constrained_dynamics.qdd,
        lambda: &c.lambda,
        residual: c.residual(),
        redundant: c.delassus.redundant,
        da_dq: &d.da_dq,
        da_dv: &d.da_dv,
        da_dtau: &d.P,
        dlambda_dq: &c.dlambda_dq,
        dlambda_dv: &c.dlambda_dv,
        dlambda_dtau: &c.dlambda_dtau,
        inertia: &c.delassus.inverse,
    }
}
