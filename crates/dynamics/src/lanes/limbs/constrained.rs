//! Dynamics under constraints of a robot with limbs, computed without M.
//!
//! Source: Wensing, Featherstone, Orin, *A reduced-order recursive algorithm for the computation of the
//! operational-space inertia matrix* (2012), based on Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1.
//! U = Iᴬ S and D are quantities of the articulated-body algorithm. A force f on a body causes the effort Y_d = S_dᵀ f
//! at column d of the body's joint. The joint transmits the force f − U_d D_d⁻¹ Y_d to the parent. If the unit forces
//! of the rows of J are propagated to the root in this way, then
//!
//! ```text
//! J M⁻¹ Jᵀ = Σ Y_d D_d⁻¹ Y_dᵀ,           J q̈ + γ = Σ Y_d D_d⁻¹ u_d + Σ f_iᵀ c_i + f₀ᵀ a₀ + γ'       for λ = 0,
//! ```
//!
//! Here u and c are quantities of the articulated-body algorithm, and f_i is the force that the joint of body i
//! transmits to the parent. a₀ is the acceleration of the world. γ' is γ without the terms of the bodies'
//! accelerations. The last pass of the articulated-body algorithm, with u + Yᵀ λ instead of u, gives q̈ = M⁻¹ (τ − h +
//! Jᵀ λ). In the articulated-body algorithm, each lane computes one limb. In the propagation of forces, each lane
//! computes one row of J. On the path to the root, a vector contains the rows of one constraint; at the root, vectors
//! contain the rows of all constraints.

use super::forces::Left;
use super::lanes::Four;
use super::{LANES, Plan};
use crate::constraints::constraint::ConstraintKind;
use crate::constraints::constraint_lanes::{All, ConstraintLanes, WIDE};
use crate::constraints::constraint_motion::FramePair;
use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::plan::Plan as ConstraintPlan;
use crate::workspace::Gate;
use condyle_spatial::block::Block;
use condyle_spatial::gate::FusedF64;
use condyle_spatial::gate::Rename;
use condyle_spatial::{Scalar, moves};

/// Returns xᵀ y in every lane. x and y fill N vector registers each.
#[inline(always)]
fn product<const N: usize>(x: &[f64], y: &[f64]) -> Four {
    let mut sum = Four::load(x) * Four::load(y);
    for n in 1..N {
        sum = Four::load(&x[n * LANES..]).mul_add(Four::load(&y[n * LANES..]), sum);
    }
    moves::sum::<Gate>(sum)
}

impl ConstraintLanes {
    /// Computes the constraint Jacobian J, the Delassus matrix J M⁻¹ Jᵀ, and the constraint accelerations J q̈ + γ
    /// without constraint forces (λ = 0).
    #[inline(always)]
    pub(crate) fn carry<V: Block<Number = f64>, const N: usize>(
        &mut self,
        left: Left<'_>,
        set: &mut ConstraintSet<FusedF64>,
    ) {
        let Self { rows, Y, YD, all } = self;
        all.end::<V, N>(set.lambda.len());
        for (k, of) in rows.iter_mut().enumerate() {
            let (plan, target) = (&set.plans[k], &set.targets[k]);
            let [one, other] = plan.bodies;
            let mut ends = FramePair::between(plan, target, [left.pose(one), left.pose(other)]);
            ends.v = [left.velocity(one), left.velocity(other)];
            of.begin(plan, &ends, ends.acceleration(plan, target).to_array());
            match plan.kind {
                ConstraintKind::Rigid => of.carry::<V, N>(plan, left, [Y, YD], all, &mut set.J),
                _ => of.carry::<Four, 1>(plan, left, [Y, YD], all, &mut set.J),
            }
        }
        all.carry_on::<V, N>(&set.plans, left, &mut set.J);
        if all.nv == 0 {
            for island in &set.islands {
                set.delassus.clear(island);
            }
        }
        let (G, stride): (&mut [f64], _) = ((&mut set.delassus.CE[..]).renamed(), set.delassus.stride);
        if all.nv > 0 {
            all.multiply::<V, N>(set.lambda.len(), G, stride);
        }
        for (of, plan) in rows.iter().zip(&set.plans) {
            for (j, runs) in &of.beside {
                let other = &set.plans[*j];
                for r in (0..other.rows()).step_by(3) {
                    let (columns, G) = ((&rows[*j], r), &mut G[(other.row + r) * stride + plan.row..]);
                    match plan.kind {
                        ConstraintKind::Rigid => of.multiply::<V, N>(columns, runs, [Y, YD], G, stride),
                        _ => of.multiply::<Four, 1>(columns, runs, [Y, YD], G, stride),
                    }
                }
            }
        }
    }

    /// Adds Yᵀ λ, the efforts of the constraint forces λ, to the efforts u of all joint columns.
    #[inline(always)]
    pub(crate) fn push(&self, plan: &Plan, constraints: &[ConstraintPlan], u: &mut [f64]) {
        let All { root, nv, stride, Y, x: lambda, .. } = &self.all;
        for (of, constraint) in self.rows.iter().zip(constraints) {
            let lambda = &lambda[constraint.row..];
            for link in of.ways.iter().flatten() {
                let (step, lane) = plan.place(link.body);
                for k in 0..link.nv {
                    let Y = &self.Y[of.start + (link.at + k) * of.wide..];
                    let sum = if of.wide == LANES { product::<1>(Y, lambda) } else { product::<2>(Y, lambda) };
                    u[(plan.steps[step].idx_v + k) * LANES + lane] += sum.to_array()[0];
                }
            }
        }
        for k in 0..*nv {
            let u = &mut u[(plan.steps[plan.place(*root).0].idx_v + k) * LANES..]; // equal in all lanes
            let mut sum = Four::load(u);
            for first in (0..stride - WIDE).step_by(WIDE) {
                sum += product::<2>(&Y[k * stride + first..], &lambda[first..]);
            }
            sum.store(u);
        }
    }
}
