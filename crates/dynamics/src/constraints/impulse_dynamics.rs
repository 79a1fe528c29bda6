//! Impacts: jumps of the velocity when constraints become active, and the analytical derivatives of the jumps.
//!
//! The constraints exert an impulse Λ during an infinitesimal time. During this time, other forces have no effect and
//! no body moves. The restitution ε determines the velocity v⁺ after the impact. ε ranges from 0 (the frames stick) to
//! 1 (no energy is lost):
//!
//! ```text
//! M (v⁺ − v) = Jᵀ Λ,   J v⁺ = −ε J v          (A Newtonian restitution: Featherstone 2008, section 11.7)
//! ```
//!
//! The equations of an impact are the equations of constrained dynamics with Δ = v⁺ − v instead of q̈, τ − h = 0 and γ
//! = (1 + ε) J v. The derivatives follow from the equations in `constrained_derivatives.rs`, which defines P and J̄,
//! with r = ∂(M Δ − Jᵀ Λ)/∂q, w = v⁺ + ε v and c = ∂(J w)/∂q. Here r is the derivative of inverse dynamics for a robot
//! at rest without gravity, with acceleration Δ:
//!
//! ```text
//! ∂v⁺/∂q = −P r − J̄ c,   ∂Λ/∂q = J̄ᵀ r − (J M⁻¹ Jᵀ)⁻¹ c,   ∂v⁺/∂v = 1 − (1 + ε) J̄ J,   ∂Λ/∂v = −(1 + ε) (J M⁻¹ Jᵀ)⁻¹ J
//! ```

use crate::constraints::constraint_motion::FramePair;
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::islands::clear_rows;
use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace};
use condyle_linalg::axpy::axpy;
use condyle_model::Model;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Array, Cross, Matrix, Motion};

workspace! {
    pub(crate) struct Workspace<S>(size) {
        /// Velocity v⁺ after the impact. Written by: `part`.
        pub v_after: Array<S> = filled(S::zero, size.nv),
        /// Velocity w = v⁺ + ε v, with the velocities v before and v⁺ after the impact and the restitution ε. Written
        /// by: `approach`, `part`.
        pub w: Array<S> = filled(S::zero, size.nv),
        /// Velocities of the bodies when the joints move with velocity w, in the world's frame. Written by: `spread`.
        pub velocity: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Motion Ψ̇ = v_λ × S of each column S when the joints move with velocity w; v_λ is the parent's velocity.
        /// Written by: `spread`.
        pub Psid: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Zeros that are never overwritten.
        pub zero: Array<S> = filled(S::zero, size.nv),
    }
}

kernel! {
    /// Computes the constraint Jacobian J and γ = (1 + ε) J v, with the velocity v before the impact and the
    /// restitution ε. `world` must contain the placements of the bodies.
    pub(crate) fn approach<S>(
        world: &World<S>,
        set: &mut ConstraintSet<S>,
        d: &mut Workspace<S>,
        v: &[S],
        restitution: S,
    ) {
        for (i, plan) in set.plans.iter().enumerate() {
            FramePair::at_rest(plan, &set.targets[i], world).jacobian(plan, &world.S, &mut set.J);
        }
        for k in 0..v.len() {
            d.w[k] = v[k].mul_add(restitution, v[k]); // (1 + ε) v
        }
        let mut gamma = core::mem::take(&mut set.gamma);
        gamma.fill(S::zero());
        set.add_motion(&d.w, &mut gamma);
        set.gamma = gamma;
    }
}

kernel! {
    /// Computes the velocity after the impact, v⁺ = v + Δ with the change Δ, and w = v⁺ + ε v with the restitution ε.
    pub(crate) fn part<S>(d: &mut Workspace<S>, v: &[S], change: &[S], restitution: S) {
        for k in 0..v.len() {
            d.v_after[k] = v[k] + change[k];
            d.w[k] = v[k].mul_add(restitution, d.v_after[k]);
        }
    }
}

kernel! {
    /// Computes c = ∂(J w)/∂q, with the constraint Jacobian J and the joint velocity w = v⁺ + ε v. `world` must contain
    /// the placements of the bodies.
    pub(crate) fn differentiate_motion<S, R>(
        model: &Model<R>,
        world: &World<S>,
        d: &mut Workspace<S>,
        set: &mut ConstraintSet<S>,
    ) {
        spread(&Single::new(model), world, d);
        clear_rows(&set.islands, &mut set.dgamma_dq);
        for (plan, target) in set.plans.iter().zip(&set.targets) {
            let ends = FramePair::new(plan, target, world, &d.velocity, &d.velocity);
            let value = &set.error[plan.row..plan.row + plan.rows()];
            ends.velocity_derivative(plan, &world.S, &d.Psid, value, &mut set.dgamma_dq);
        }
    }
}

kernel! {
    /// Computes the derivatives with respect to the velocity v before the impact: ∂v⁺/∂v is 1 − (1 + ε) J̄ J, and ∂Λ/∂v
    /// is −(1 + ε) (J M⁻¹ Jᵀ)⁻¹ J, with the restitution ε and J̄ = M⁻¹ Jᵀ (J M⁻¹ Jᵀ)⁻¹.
    pub(crate) fn respond_to_v_before<S>(set: &mut ConstraintSet<S>, restitution: S, dv: &mut Matrix<S>) {
        let (n, rows) = (set.nv, set.lambda.len());
        let (Jbar, inertia) = (set.Jbar.as_slice(), set.delassus.inverse.as_slice());
        let (dv, dlambda) = (dv.as_mut_slice(), set.dlambda_dv.as_mut_slice());
        let scale = -(S::one() + restitution);
        dv.fill(S::zero());
        dlambda.fill(S::zero());
        for k in 0..n {
            dv[k * (n + 1)] = S::one();
        }
        for island in &set.islands {
            for plan in &set.plans[island.constraints.clone()] {
                for r in 0..plan.rows() {
                    let (J, row) = (&set.J[plan.range(r)], plan.row + r);
                    for (k, &coordinate) in plan.coordinates.iter().enumerate() {
                        let (x, own) = (J[k] * scale, island.rows_of_column(coordinate, rows));
                        axpy(x, &Jbar[island.of_column(row, n)], &mut dv[island.of_column(coordinate, n)]);
                        axpy(x, &inertia[island.rows_of_column(row, rows)], &mut dlambda[own]);
                    }
                }
            }
        }
    }
}

/// Computes the velocities of all bodies and Ψ̇ = v_λ × S for the joint velocity w. `World` must contain the placements
/// of the bodies.
#[inline(always)]
fn spread<L: Layout>(l: &L, World { S, .. }: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { w, velocity, Psid, .. } = d;
    for i in l.bodies() {
        let v_parent = l.parent(velocity, i);
        let mut v_i = v_parent;
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            Psid[c] = v_parent.cross(S[c]);
            v_i = S[c].scale_add(l.joint_velocity(w, i, k), v_i);
        }
        velocity[i] = v_i;
    }
}
