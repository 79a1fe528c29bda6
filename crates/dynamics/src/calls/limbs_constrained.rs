//! Forward dynamics under constraints, with the limbs of a robot in parallel lanes.
#![allow(unsafe_code)]

use super::limbs::{load_free, place_steps, ready};
use crate::constraints::constraint_lanes::{ConstraintLanes, WIDE};
use crate::constraints::constraint_set::ConstraintSet;
use crate::data::Data;
use crate::lanes::limbs::Plan;
use crate::lanes::limbs::forces::{Left, six};
use crate::lanes::limbs::lanes::{Limbs, numbers, numbers_mut};
use crate::lanes::limbs::pass::{Arguments, Scratch, scatter};
use crate::passes::aba;
use crate::passes::kinematics::PlacementCache;
use condyle_model::Model;
use condyle_spatial::gate::{FusedF64, Rename, same};
use condyle_spatial::{Constant, Scalar};
use condyle_spatial::{kernel, register_kernel};

register_kernel! {
    /// Runs the inward pass of the articulated-body algorithm. `s.world` must contain the placements of all bodies.
    fn articulate<V>(model: &Model, plan: &Plan, s: &mut Scratch, f_ext: bool) {
        let f_ext = if f_ext { &s.f_ext[..] } else { &[] };
        aba::inward(&Limbs::new(plan, model), &s.world, &mut s.aba, &s.v, &s.x, f_ext);
    }
}

register_kernel! {
    /// Computes the constraint Jacobian J and the Delassus matrix J M⁻¹ Jᵀ. Also computes −(J q̈ + γ), the negative
    /// constraint accelerations without constraint forces, and stores them in `set.lambda`.
    fn carry_forces<V>(
        model: &Model,
        plan: &Plan,
        s: &Scratch,
        lanes: &mut ConstraintLanes,
        set: &mut ConstraintSet<FusedF64>,
    ) {
        let left = Left::new(plan, model, &s.world, &s.aba);
        if V::LANES == WIDE { lanes.carry::<V, 1>(left, set) } else { lanes.carry::<V, 2>(left, set) }
        for r in 0..set.lambda.len() {
            set.lambda[r] = FusedF64(-lanes.all.x[r]);
        }
    }
}

kernel! {
    /// Factorises the Delassus matrix J M⁻¹ Jᵀ and computes the constraint forces λ.
    fn decompose<S>(set: &mut ConstraintSet<S>) {
        set.delassus.redundant = S::zero();
        for island in &set.islands {
            set.delassus.decompose(island, set.proximal, &mut set.lambda);
        }
    }
}

register_kernel! {
    /// Computes the joint accelerations q̈ and the constraint accelerations J q̈ + γ for the constraint forces λ.
    fn accelerate<V>(
        model: &Model,
        plan: &Plan,
        s: &mut Scratch,
        lanes: &mut ConstraintLanes,
        set: &mut ConstraintSet<FusedF64>,
        qdd: &mut [FusedF64],
    ) {
        for r in 0..set.lambda.len() {
            lanes.all.x[r] = set.lambda[r].0;
        }
        // SAFETY: the elements of `u` consist only of vectors of numbers.
        lanes.push(plan, &set.plans, unsafe { numbers_mut(&mut s.aba.u) });
        aba::outward(&Limbs::new(plan, model), &s.world, &mut s.aba);
        scatter(plan, &s.aba.qdd, qdd);
        // SAFETY: the motions in `a` consist only of vectors of numbers.
        let a = unsafe { numbers(&s.aba.a) };
        for (of, constraint) in lanes.rows.iter().zip(&set.plans) {
            let [one, other] = constraint.bodies;
            let error = of.error([six(a, plan.place(one)), six(a, plan.place(other))]);
            for r in 0..constraint.rows() {
                set.error[constraint.row + r] = FusedF64(error[r]);
            }
        }
    }
}

/// Computes constrained dynamics with limbs in parallel lanes, and returns true. Returns false if the model, `data` or
/// `constraints` does not support this.
#[inline]
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some(plan) = ready(model, data).filter(|_| constraints.limbs.is_some()) else { return false };
    // SAFETY: `ready` returns a plan only if S and R are f64.
    unsafe {
        let constraints = same::<_, &mut ConstraintSet<f64>>(constraints).renamed();
        enter(same(model), plan, same(data), constraints, arguments.fused());
    }
    true
}

/// Computes constrained dynamics in lanes and writes the results to `data` and `set`. The arguments must be valid.
fn enter(
    model: &Model,
    plan: &Plan,
    data: &mut Data<f64>,
    set: &mut ConstraintSet<FusedF64>,
    arguments: Arguments<'_>,
) {
    let (Some(s), Some(mut lanes)) = (data.limbs.as_deref_mut(), set.limbs.take()) else { return };
    load_free(model, plan, s, &mut data.aba, arguments);
    place_steps(model, plan, s);
    data.world.placed = PlacementCache::Limbs(model.geometry_hash());
    articulate(model, plan, s, !arguments.f_ext.is_empty());
    carry_forces(model, plan, s, &mut lanes, set);
    decompose(set);
    accelerate(model, plan, s, &mut lanes, set, FusedF64::of_mut(&mut data.constrained_dynamics.qdd));
    set.limbs = Some(lanes);
}
