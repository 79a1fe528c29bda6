//! Classical Runge–Kutta method on the joints' Lie groups.
//!
//! Source: Munthe-Kaas, *Runge–Kutta methods on Lie groups* (1998). Near q₀, the motion is expressed as q₀ ⊕ ξ(t).
//! Since ∂(q₀ ⊕ ξ)/∂ξ is the group's Jacobian J_exp(ξ) = J_log(ξ)⁻¹, the motion satisfies
//!
//! ```text
//! ξ̇ = J_log(ξ) v,   v̇ = aba(q₀ ⊕ ξ, v, τ),   ξ(0) = 0
//! ```
//!
//! These equations form an ordinary differential equation in a vector space, so the classical method has order 4.

use super::{Input, Status, acceleration, tangent};
use crate::data::Data;
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::integrate;
use condyle_model::joint::GroupJacobian;
use condyle_spatial::{Array, Constant, Scalar};

workspace! {
    pub(super) struct Workspace<S>(size) {
        /// Efforts, including passive efforts. Written by: `step`.
        effort: Array<S> = filled(S::zero, size.nv),
        /// State at which a stage is evaluated: the displacement ξ since the beginning of the step, and the velocity v.
        /// Written by: `step`.
        xi: Array<S> = filled(S::zero, size.nv),
        v: Array<S> = filled(S::zero, size.nv),
        /// Rates of the displacement ξ and the velocity v at a stage. Written by: `step`.
        dxi: Array<S> = filled(S::zero, size.nv),
        dv: Array<S> = filled(S::zero, size.nv),
        /// Weighted sums of the rates over all stages. Written by: `step`.
        sum_xi: Array<S> = filled(S::zero, size.nv),
        sum_v: Array<S> = filled(S::zero, size.nv),
    }
}

/// Time of each stage as a fraction of the step, and weight of the stage's rates.
const STAGES: [(f64, f64); 4] = [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)];

/// Computes one step of the Runge–Kutta method.
#[track_caller]
pub(super) fn step<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    w: &mut Workspace<S>,
    input: Input<S>,
    (q, v): (&[S], &[S]),
    (q_next, v_next): (&mut [S], &mut [S]),
) -> Status {
    let Workspace { effort, xi, v: v_stage, dxi, dv, sum_xi, sum_v } = w;
    sum_xi.fill(S::zero());
    sum_v.fill(S::zero());
    dxi.fill(S::zero());
    dv.fill(S::zero());
    for (part, weight) in STAGES {
        let (ahead, weight) = (input.h * S::splat(part), input.h * S::splat(weight));
        for k in 0..v.len() {
            xi[k] = dxi[k] * ahead; // ξ = c h ξ̇ of the previous stage
            v_stage[k] = dv[k].mul_add(ahead, v[k]); // v = v₀ + c h v̇ of the previous stage
        }
        integrate(model, q, xi, q_next);
        tangent::multiply(model, GroupJacobian::Log, xi, v_stage, dxi); // ξ̇ = J_log(ξ) v
        dv.copy_from_slice(acceleration(model, data, input, (q_next, v_stage), effort)); // v̇ = aba(q₀ ⊕ ξ, v, τ)
        for k in 0..v.len() {
            sum_xi[k] = dxi[k].mul_add(weight, sum_xi[k]);
            sum_v[k] = dv[k].mul_add(weight, sum_v[k]);
        }
    }
    integrate(model, q, sum_xi, q_next); // q' = q ⊕ h Σ b ξ̇
    for k in 0..v.len() {
        v_next[k] = v[k] + sum_v[k]; // v' = v + h Σ b v̇
    }
    Status::Done
}
