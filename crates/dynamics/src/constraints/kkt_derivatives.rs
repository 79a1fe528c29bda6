//! Linearised equations of motion under constraints.
//!
//! The equations of motion M q̈ + h − Jᵀ λ = τ and the constraints J q̈ + γ = 0 hold for every q, v and τ. So small
//! changes of q, v, τ, q̈ and λ satisfy
//!
//! ```text
//! M δq̈ − Jᵀ δλ + r_q δq + r_v δv = δτ,        r = ∂(M q̈ + h − Jᵀ λ)   at fixed q̈ and λ
//! J δq̈         + c_q δq + c_v δv = 0,         c = ∂(J q̈ + γ)
//! ```
//!
//! The derivative r of the equations of motion follows from the derivatives of inverse dynamics. There, the constraint
//! forces are external forces that move with the bodies on which they act. Two corrections are added. First, a force
//! expressed in the world's axes does not turn with frame 1. Second, the force on body 2 moves with frame 1, not with
//! body 2. For a point constraint, this force turns with frame 1, but its point of action moves with body 2. Source:
//! Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018).

use crate::constraints::constraint::ConstraintKind;
use crate::constraints::constraint_motion::{Columns, FramePair};
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::islands::clear_rows;
use crate::derivatives::rnea_derivatives;
use crate::passes::frames::Placements;
use crate::passes::kinematics::World;
use condyle_model::Model;
use condyle_spatial::kernel;
use condyle_spatial::{Act, Cross, Force, Matrix, Motion, Scalar};

impl<S: Scalar> ConstraintSet<S> {
    /// Returns the force λ of constraint i along the axes of the constraint's frame.
    #[inline(always)]
    fn local_force(&self, i: usize, ends: &FramePair<S>) -> Force<S> {
        let f = self.force(i);
        if self.plans[i].aligned() {
            let R = ends.x1.rotation;
            return Force::new(R.transpose_mul(f.linear), R.transpose_mul(f.angular));
        }
        f
    }

    /// Returns the negative of the force that constraint i exerts on the other body, in the world's frame.
    #[inline(always)]
    fn reaction(&self, i: usize, ends: &FramePair<S>) -> Force<S> {
        let f = self.local_force(i, ends);
        match self.plans[i].kind {
            ConstraintKind::Rigid => ends.x1.act(f),
            _ => {
                let linear = ends.x1.rotation * f.linear;
                Force::new(linear, ends.x2.translation.cross(linear))
            }
        }
    }
}

kernel! {
    /// Computes the sum of external forces and constraint forces on each body. `world` must contain the placements of
    /// the bodies.
    pub(crate) fn load<S, R>(
        model: &Model<R>,
        set: &ConstraintSet<S>,
        world: &World<S>,
        f_ext: &[Force<S>],
        forces: &mut [Force<S>],
    ) {
        forces.fill(Force::zero());
        forces[..f_ext.len()].copy_from_slice(f_ext);
        for (i, plan) in set.plans.iter().enumerate() {
            let ends = FramePair::at_rest(plan, &set.targets[i], world);
            forces[plan.bodies[0]] += plan.placements[0].lift().act(set.local_force(i, &ends));
            let oXb = Placements { model, world }.body(plan.bodies[1]);
            forces[plan.bodies[1]] -= oXb.act_inv(set.reaction(i, &ends));
        }
    }
}

kernel! {
    /// Computes r_q = ∂(M q̈ + h − Jᵀ λ)/∂q. The result is the sum of `fixed`, the derivative for forces that move with
    /// their bodies, and two corrections.
    pub(crate) fn turn<S>(set: &ConstraintSet<S>, world: &World<S>, fixed: &Matrix<S>, r: &mut Matrix<S>) {
        r.as_mut_slice().copy_from_slice(fixed.as_slice());
        for (i, plan) in set.plans.iter().enumerate() {
            if plan.bodies[1] > 0 {
                let ends = FramePair::at_rest(plan, &set.targets[i], world);
                let f = set.reaction(i, &ends);
                for e in &plan.touches {
                    if e.first == e.second {
                        continue;
                    }
                    let s = world.S[e.column];
                    let change = match plan.kind {
                        ConstraintKind::Rigid => s.cross(f),
                        _ => {
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
                let f = set.force(i);
                let ends = match plan.kind {
                    ConstraintKind::Line | ConstraintKind::Plane => {
                        Some(FramePair::at_rest(plan, &set.targets[i], world))
                    }
                    _ => None,
                };
                for e in &plan.touches {
                    if !e.first {
                        continue;
                    }
                    let w = world.S[e.column].angular.scale(S::splat(e.ratio));
                    // For a line or plane constraint, the correction ω × λ is not along the held axes. So the
                    // correction needs all three rows of the point's Jacobian.
                    if let Some(ends) = &ends {
                        let turned = w.cross(f.linear); // ω × λ
                        for j in &plan.touches {
                            let column = ends.point_column(plan, world.S[j.column], j.first, j.second);
                            r[(j.coordinate, e.coordinate)] += column.dot(turned) * S::splat(j.ratio); // Jᵀ (ω × λ)
                        }
                        continue;
                    }
                    let turned = Motion::new(w.cross(f.linear), w.cross(f.angular)).to_array(); // ω × λ
                    for k in 0..plan.rows() {
                        let J = &set.J[plan.range(k)];
                        for (at, &coordinate) in plan.coordinates.iter().enumerate() {
                            r[(coordinate, e.coordinate)] += J[at] * turned[k]; // Jᵀ (ω × λ)
                        }
                    }
                }
            }
        }
    }
}

kernel! {
    /// Computes c_q and c_v, the derivatives of the constraint accelerations J q̈ + γ with respect to q and v. The
    /// velocities and accelerations of the bodies must already be computed.
    pub(crate) fn differentiate_motion<S>(
        set: &mut ConstraintSet<S>,
        world: &World<S>,
        bodies: &rnea_derivatives::Bodies<S>,
    ) {
        let rnea_derivatives::Bodies { v, a, Psid, Psidd, PsidSd, .. } = bodies;
        let columns = Columns { S: &world.S, Psid, Psidd, PsidSd };
        let ConstraintSet { plans, islands, targets, error, dgamma_dq, dgamma_dv, .. } = set;
        clear_rows(islands, dgamma_dq);
        clear_rows(islands, dgamma_dv);
        for (plan, target) in plans.iter().zip(targets.iter()) {
            let ends = FramePair::new(plan, target, world, v, a);
            let error = &error[plan.row..plan.row + plan.rows()];
            ends.acceleration_derivatives(plan, target, columns, error, dgamma_dq, dgamma_dv);
        }
    }
}
