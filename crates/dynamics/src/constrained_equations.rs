//! The equations of motion under constraints, differentiated.
//!
//! M q̈ + h − Jᵀ λ = τ and J q̈ + γ = 0 hold for every q, v and τ. So small changes of them satisfy
//!
//! ```text
//! M δq̈ − Jᵀ δλ + r_q δq + r_v δv = δτ,        r = ∂(M q̈ + h − Jᵀ λ)   at q̈ and λ as they are
//! J δq̈         + c_q δq + c_v δv = 0,         c = ∂(J q̈ + γ)
//! ```
//!
//! r comes from the derivatives of inverse dynamics with the forces of the constraints as external ones, each fixed in
//! its body, and what is different: along the world's axes λ does not turn with frame 1, and the force on the other
//! body is carried by frame 1 (a point's force: turned by frame 1, its point carried by body 2). Source: Carpentier and
//! Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018).

use crate::constrained_dynamics::{self, Inputs};
use crate::constraint::ConstraintKind;
use crate::constraint_motion::{Columns, Ends};
use crate::constraint_set::ConstraintSet;
use crate::data::Data;
use crate::frames::Placements;
use crate::kinematics::World;
use crate::rnea_derivatives;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Act, Constant, Cross, Force, Motion, Scalar};
use nalgebra::DMatrix;

impl<S: Scalar> ConstraintSet<S> {
    /// The force λ of constraint i along the axes of its frame.
    #[inline(always)]
    fn local_force(&self, i: usize, ends: &Ends<S>) -> Force<S> {
        let f = self.force(i);
        if self.plans[i].aligned() {
            let R = ends.x1.rotation;
            return Force::new(R.transpose_mul(f.linear), R.transpose_mul(f.angular));
        }
        f
    }

    /// The force on the other body, its sign turned, in the world's frame.
    #[inline(always)]
    fn reaction(&self, i: usize, ends: &Ends<S>) -> Force<S> {
        let f = self.local_force(i, ends);
        match self.plans[i].kind {
            ConstraintKind::Rigid => ends.x1.act(f),
            ConstraintKind::Point => {
                let linear = ends.x1.rotation * f.linear;
                Force::new(linear, ends.x2.translation.cross(linear))
            }
        }
    }

    /// All forces on the bodies, for bodies that are placed: those from outside, and those of the constraints.
    #[inline(always)]
    fn load<R: Constant<S>>(&self, model: &Model<R>, world: &World<S>, f_ext: &[Force<S>], forces: &mut [Force<S>]) {
        forces.fill(Force::zero());
        forces[..f_ext.len()].copy_from_slice(f_ext);
        for (i, plan) in self.plans.iter().enumerate() {
            let ends = Ends::at_rest(plan, &self.targets[i], world);
            forces[plan.bodies[0]] += plan.placements[0].lift().act(self.local_force(i, &ends));
            let oXb = Placements { model, world }.body(plan.bodies[1]);
            forces[plan.bodies[1]] -= oXb.act_inv(self.reaction(i, &ends));
        }
    }

    /// Adds to r = ∂(M q̈ + h − Jᵀ λ)/∂q what is different from forces that are fixed in their bodies.
    #[inline(always)]
    fn add_turning(&self, world: &World<S>, r: &mut DMatrix<S>) {
        for (i, plan) in self.plans.iter().enumerate() {
            if plan.bodies[1] > 0 {
                let ends = Ends::at_rest(plan, &self.targets[i], world);
                let f = self.reaction(i, &ends);
                for e in &plan.touches {
                    if e.first == e.second {
                        continue;
                    }
                    let s = world.S[e.column];
                    let change = match plan.kind {
                        ConstraintKind::Rigid => s.cross(f),
                        ConstraintKind::Point => {
                            let linear = s.angular.cross(f.linear);
                            Force::new(linear, ends.x2.translation.cross(linear))
                        }
                    };
                    let change = change.scale(S::splat(if e.first { e.ratio } else { -e.ratio }));
                    for j in &plan.touches {
                        if j.second {
                            let x = world.S[j.column].dot(change);
                            r[(j.coordinate, e.coordinate)] += x * S::splat(j.ratio);
                        }
                    }
                }
            }
            if plan.aligned() {
                let f = self.force(i);
                for e in &plan.touches {
                    if !e.first {
                        continue;
                    }
                    let w = world.S[e.column].angular.scale(S::splat(e.ratio));
                    let turned = Motion::new(w.cross(f.linear), w.cross(f.angular)).to_array(); // ω × λ
                    for k in 0..plan.rows() {
                        let J = &self.J[plan.range(k)];
                        for (at, &coordinate) in plan.coordinates.iter().enumerate() {
                            r[(coordinate, e.coordinate)] += J[at] * turned[k]; // Jᵀ (ω × λ)
                        }
                    }
                }
            }
        }
    }
}

/// What [`constrained_dynamics_equations`] gives; J is that of [`ConstraintSet::jacobian`].
#[derive(Clone, Copy, Debug)]
pub struct ConstrainedEquations<'d, S> {
    /// q̈ itself, nv numbers.
    pub a: &'d [S],
    /// λ itself, as many numbers as there are rows.
    pub lambda: &'d [S],
    /// The largest number in J q̈ + γ (m/s², rad/s²).
    pub residual: S,
    /// How many rows of J depend on rows before them, up to rounding.
    pub redundant: S,
    /// M, nv × nv, armature included.
    pub M: &'d DMatrix<S>,
    /// r_q = ∂(M q̈ + h − Jᵀ λ)/∂q in the tangent space, nv × nv: the change of τ when q moves to q ⊕ δ, per δ.
    pub dtau_dq: &'d DMatrix<S>,
    /// r_v = ∂h/∂v, nv × nv.
    pub dtau_dv: &'d DMatrix<S>,
    /// c_q = ∂(J q̈ + γ)/∂q in the tangent space, rows × nv.
    pub dgamma_dq: &'d DMatrix<S>,
    /// c_v = ∂γ/∂v, rows × nv.
    pub dgamma_dv: &'d DMatrix<S>,
}

/// [`constrained_dynamics`](crate::constrained_dynamics()) and the linear equations between changes of q, v, τ and of the
/// q̈ and λ that follow:
///
/// ```text
/// M δq̈ − Jᵀ δλ + ∂τ/∂q δq + ∂τ/∂v δv = δτ,      J δq̈ + ∂γ/∂q δq + ∂γ/∂v δv = 0
/// ```
///
/// What [`constrained_dynamics_derivatives`](crate::constrained_dynamics_derivatives) solves, for those who would rather
/// eliminate something else: nothing is inverted here, and all blocks keep the zeros of the tree.
///
/// q: nq numbers; v, tau: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for none.
/// Targets of the constraints are fixed. In O(n · depth) beside the forward dynamics. Allocates nothing. Source: Carpentier
/// and Mansard (2018).
///
/// ```
/// use condyle_dynamics::{Constraint, ConstraintSet, Data, constrained_dynamics_equations, crba, robots};
/// let arm = robots::arm7();
/// let touch = Constraint { kp: 100.0, kd: 20.0, ..Constraint::point(arm.frame("tool")?) };
/// let (mut touch, mut data) = (ConstraintSet::new(&arm, &[touch])?, Data::new(&arm));
/// let (q, v, tau) = ([0.3; 7], [0.1; 7], [1.0; 7]);
/// let M = constrained_dynamics_equations(&arm, &mut data, &mut touch, &q, &v, &tau, &[]).M.clone();
/// assert!((M - crba(&arm, &mut data, &q)).amax() < 1e-13);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
pub fn constrained_dynamics_equations<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> ConstrainedEquations<'d, S> {
    let inputs = Inputs { q, v, tau, f_ext };
    inputs.check(model, data, constraints);
    differentiate(model, data, constraints, inputs);
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

/// The whole algorithm, for arguments that fit.
pub(crate) fn differentiate<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    inputs: Inputs<'_, S>,
) {
    constrained_dynamics::run(model, data, constraints, inputs);
    let (world, qdd) = (&data.world, &data.constrained_dynamics.qdd);
    let (d, id) = (&mut data.constrained_derivatives, &mut data.rnea_derivatives);
    load(model, constraints, world, inputs.f_ext, &mut d.forces);
    rnea_derivatives::run(model, world, id, inputs.v, qdd, &d.forces, &[]);
    turn(constraints, world, &id.dtau_dq, &mut d.dtau_dq);
    differentiate_motion(constraints, world, &id.bodies);
}

kernel! {
    /// All forces on the bodies, for bodies that are placed: those from outside, and those of the constraints.
    pub(crate) fn load<S, R>(
        model: &Model<R>,
        set: &ConstraintSet<S>,
        world: &World<S>,
        f_ext: &[Force<S>],
        forces: &mut [Force<S>],
    ) {
        set.load(model, world, f_ext, forces);
    }
}

kernel! {
    /// r_q, from the derivative for forces that are fixed in their bodies.
    pub(crate) fn turn<S>(set: &ConstraintSet<S>, world: &World<S>, fixed: &DMatrix<S>, r: &mut DMatrix<S>) {
        r.as_mut_slice().copy_from_slice(fixed.as_slice());
        set.add_turning(world, r);
    }
}

kernel! {
    /// c_q and c_v, for bodies whose motion is known.
    fn differentiate_motion<S>(set: &mut ConstraintSet<S>, world: &World<S>, bodies: &rnea_derivatives::Bodies<S>) {
        let rnea_derivatives::Bodies { v, a, Psid, Psidd, PsidSd, .. } = bodies;
        let columns = Columns { S: &world.S, Psid, Psidd, PsidSd };
        let ConstraintSet { plans, targets, error, dgamma_dq, dgamma_dv, .. } = set;
        dgamma_dq.as_mut_slice().fill(S::zero());
        dgamma_dv.as_mut_slice().fill(S::zero());
        for (plan, target) in plans.iter().zip(targets.iter()) {
            let ends = Ends::new(plan, target, world, v, a);
            let error = &error[plan.row..plan.row + plan.rows()];
            ends.acceleration_derivatives(plan, target, columns, error, dgamma_dq, dgamma_dv);
        }
    }
}
