//! Impacts: jumps of the velocity when constraints become active, and the derivatives of the jumps.

use crate::constraints::constrained_derivatives::{By, invert, respond};
use crate::constraints::constrained_dynamics::{factorize, inertia, solve};
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::impulse_dynamics::{approach, differentiate_motion, part, respond_to_v_before};
use crate::constraints::kkt_derivatives::{load, turn};
use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::passes::kinematics::positions;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Constant, Matrix, Scalar, Vec3};

/// Result of [`impulse_dynamics`].
#[derive(Clone, Copy, Debug)]
pub struct Impulse<'d, S> {
    /// Velocity v⁺ after the impact, nv numbers (rad/s, m/s).
    pub v: &'d [S],
    /// Impulses Λ of the constraints, one number per row of the constraint Jacobian J (N s, N m s). Each impulse acts
    /// on the body of the constraint's frame and is expressed in the axes of the constraint's rows.
    pub lambda: &'d [S],
    /// Largest absolute value of J (v⁺ + ε v) (m/s, rad/s), for the velocities v before and v⁺ after the impact and the
    /// restitution ε.
    pub residual: S,
    /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, up to rounding.
    pub redundant: S,
}

/// Computes the velocity after an impact: v⁺ = v + M⁻¹ Jᵀ Λ, with the impulses Λ that make J v⁺ = −ε J v for a
/// restitution ε.
///
/// q: nq numbers; v: nv numbers; restitution: ε, from 0 (the frames stick) to 1 (the impact loses no energy). Gains and
/// desired motions of the constraints are ignored. The placement of a target is used only to locate the point on the
/// other frame. Like [`constrained_dynamics`](crate::constrained_dynamics()), this function uses the sparsity of the
/// tree and the [`ProximalSettings`](crate::ProximalSettings) of the set. Allocates nothing. Source: Featherstone,
/// *Rigid Body Dynamics Algorithms* (2008), section 11.7.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, impulse_dynamics, neutral, robots};
/// let quadruped = robots::quadruped();
/// let feet = ["LF_foot", "RH_foot"].map(|name| quadruped.frame(name).unwrap());
/// let mut touchdown = ConstraintSet::new(&quadruped, &feet.map(ContactConstraint::point))?;
/// let (mut data, q, mut v) = (Data::new(&quadruped), neutral(&quadruped), [0.0; 18]);
/// v[2] = -1.0; // falling
/// let after = impulse_dynamics(&quadruped, &mut data, &mut touchdown, &q, &v, 0.0);
/// assert!(after.residual < 1e-12 && after.lambda[2] > 0.0); // the ground pushes upwards
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn impulse_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    restitution: S,
) -> Impulse<'d, S> {
    checks(model, data, constraints, q, v);
    run(model, data, constraints, q, v, restitution);
    Impulse {
        v: &data.impulse_dynamics.v_after,
        lambda: &constraints.lambda,
        residual: constraints.residual(),
        redundant: constraints.delassus.redundant,
    }
}

#[track_caller]
fn checks<S, R>(model: &Model<R>, data: &Data<S>, constraints: &ConstraintSet<S>, q: &[S], v: &[S])
where
    S: Scalar,
{
    data.check(model);
    constraints.check(model);
    model.check_regular();
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
}

/// Computes the velocity after the impact and the impulses. The arguments must be valid.
fn run<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    restitution: S,
) {
    positions(model, &mut data.world, q);
    let (world, d, out) = (&data.world, &mut data.constrained_dynamics, &mut data.impulse_dynamics);
    inertia(model, world, d);
    factorize(d);
    approach(world, constraints, out, v, restitution);
    solve(constraints, &d.factor, &out.zero, &mut d.qdd); // Δ
    part(out, v, &d.qdd, restitution);
}

/// Result of [`impulse_dynamics_derivatives`].
#[derive(Clone, Copy, Debug)]
pub struct ImpulseDerivatives<'d, S> {
    /// Velocity v⁺ after the impact, nv numbers.
    pub v: &'d [S],
    /// Impulses Λ of the constraints, one number per row of the constraint Jacobian J.
    pub lambda: &'d [S],
    /// Largest absolute value of J (v⁺ + ε v) (m/s, rad/s), for the velocities v before and v⁺ after the impact and the
    /// restitution ε.
    pub residual: S,
    /// Number of rows of the constraint Jacobian J that depend linearly on earlier rows, up to rounding.
    pub redundant: S,
    /// Derivative ∂v⁺/∂q of the velocity after the impact in the tangent space, nv × nv: the change of v⁺ per δ when q
    /// moves to q ⊕ δ.
    pub dv_dq: &'d Matrix<S>,
    /// Derivative ∂v⁺/∂v of the velocity after the impact, nv × nv.
    pub dv_dv: &'d Matrix<S>,
    /// Derivative ∂Λ/∂q of the impulses in the tangent space, rows × nv.
    pub dlambda_dq: &'d Matrix<S>,
    /// Derivative ∂Λ/∂v of the impulses, rows × nv.
    pub dlambda_dv: &'d Matrix<S>,
    /// Inertia (J M⁻¹ Jᵀ)⁻¹ of the robot along its constraints, rows × rows.
    pub inertia: &'d Matrix<S>,
}

/// Computes the results v⁺ and Λ of [`impulse_dynamics`] and their exact derivatives with respect to q and to the
/// velocity v before the impact.
///
/// q: nq numbers; v: nv numbers; restitution: ε. The cost and the treatment of redundant constraints are the same as
/// for [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives()). Allocates nothing.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, ConstraintSet, Data, impulse_dynamics_derivatives, robots};
/// let arm = robots::arm7();
/// let mut hit = ConstraintSet::new(&arm, &[ContactConstraint::point(arm.frame("tool")?)])?;
/// let mut data = Data::new(&arm);
/// let d = impulse_dynamics_derivatives(&arm, &mut data, &mut hit, &[0.3; 7], &[0.1; 7], 0.0);
/// let again = d.dv_dv * d.dv_dv; // an impact that sticks is a projection
/// assert!((again - d.dv_dv).amax() < 1e-9);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
#[track_caller]
pub fn impulse_dynamics_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    restitution: S,
) -> ImpulseDerivatives<'d, S> {
    checks(model, data, constraints, q, v);
    run(model, data, constraints, q, v, restitution);
    let (world, change) = (&data.world, &data.constrained_dynamics.qdd);
    let (d, id, out) = (&mut data.constrained_derivatives, &mut data.rnea_derivatives, &mut data.impulse_dynamics);
    load(model, constraints, world, &[], &mut d.forces);
    rnea_derivatives::run(model, world, id, &out.zero, change, &d.forces, &[Vec3::zero()]); // ∂(M Δ − Jᵀ Λ)/∂q
    turn(constraints, world, &id.dtau_dq, &mut d.dtau_dq);
    differentiate_motion(model, world, out, constraints);
    invert(constraints, &data.constrained_dynamics.factor, &mut d.P);
    respond(constraints, By::Position, &d.P, &d.dtau_dq, &mut d.da_dq);
    respond_to_v_before(constraints, restitution, &mut d.da_dv);
    let (d, c) = (&data.constrained_derivatives, &*constraints);
    ImpulseDerivatives {
        v: &data.impulse_dynamics.v_after,
        lambda: &c.lambda,
        residual: c.residual(),
        redundant: c.delassus.redundant,
        dv_dq: &d.da_dq,
        dv_dv: &d.da_dv,
        dlambda_dq: &c.dlambda_dq,
        dlambda_dv: &c.dlambda_dv,
        inertia: &c.delassus.inverse,
    }
}
