//! Algorithms that compute the limbs of a robot in parallel lanes.
//!
//! Limbs are branches of the tree, such as legs and arms. A step computes bodies of different limbs at once, one limb
//! per lane of a SIMD vector.
#![allow(unsafe_code)]

use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::lanes::limbs::lanes::Limbs;
use crate::lanes::limbs::pass::{Arguments, Scratch, load, scatter};
use crate::lanes::limbs::{LaneView, Plan};
use crate::passes::kinematics::{PlacementCache, World, place};
use crate::passes::{aba, crba, free_armature, rnea};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_spatial::gate::{FusedF64, Level, is, level, same};
use condyle_spatial::register_kernel;
use condyle_spatial::{Constant, Scalar};

/// Algorithm that [`run`] can run with limbs in parallel lanes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Task {
    Rnea,
    Aba,
    Crba,
    Minv,
    RneaDerivatives,
    AbaDerivatives,
}

register_kernel! {
    /// Computes the efforts τ, step by step.
    fn rnea_by_steps<V>(
        model: &Model,
        plan: &Plan,
        s: &mut Scratch,
        moving: [&[FusedF64]; 2],
        f_ext: bool,
        tau: &mut [FusedF64],
    ) {
        let l = Limbs::new(plan, model);
        rnea::pass(&l, &mut s.world.sin_cos, &mut s.rnea, &s.q, &s.v, &s.x, given(f_ext, &s.f_ext));
        scatter(plan, &s.rnea.tau, tau);
        let [v, a] = moving;
        Single::<FusedF64, f64>::new(model).add_armature_torque(a, tau);
        free_armature::add_armature_bias(model, v, tau);
    }
}

register_kernel! {
    /// Loads the arguments of a call into lanes.
    pub(super) fn load_steps<V>(plan: &Plan, s: &mut Scratch, arguments: Arguments<'_>) {
        load(plan, s, arguments);
    }
}

register_kernel! {
    /// Computes the placements and the joint columns S of all steps.
    pub(super) fn place_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch) {
        let l = Limbs::new(plan, model);
        place(&l, &mut s.world, &s.q);
        l.broadcast(&mut s.world.S);
    }
}

register_kernel! {
    /// Computes M step by step. The placements of all steps must be known.
    fn crba_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch, M: &mut [FusedF64]) {
        crba::pass(&Limbs::new(plan, model), &s.world, &mut s.IC, M);
    }
}

register_kernel! {
    /// Computes the factors U and 1/D of the articulated-body algorithm, step by step. The placements of all steps must
    /// be known.
    fn factorize_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch) {
        aba::factorize(&Limbs::new(plan, model), &s.world, &mut s.aba);
    }
}

register_kernel! {
    /// Computes q̈ step by step. The placements of all steps must be known.
    fn aba_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch, f_ext: bool, qdd: &mut [FusedF64]) {
        aba::pass(&Limbs::new(plan, model), &s.world, &mut s.aba, &s.v, &s.x, given(f_ext, &s.f_ext));
        scatter(plan, &s.aba.qdd, qdd);
    }
}

register_kernel! {
    /// Computes M⁻¹ from the factors U and 1/D of the articulated-body algorithm.
    fn inverse_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch, Minv: &mut [FusedF64]) {
        let l = Limbs::new(plan, model);
        l.broadcast(&mut s.aba.D_inv);
        s.inverted.inverse::<V>(&l, &s.world, &s.aba, &plan.columns.blocks, Minv);
    }
}

register_kernel! {
    /// Computes ∂τ/∂q, ∂τ/∂v and M step by step. The placements of all steps must be known. If `after_aba` is set, q̈
    /// is the result of the articulated-body algorithm; otherwise it is an argument of the call.
    fn rnea_derivatives_by_steps<V>(
        model: &Model,
        plan: &Plan,
        s: &mut Scratch,
        after_aba: bool,
        v: &[FusedF64],
        f_ext: bool,
        matrices: [&mut [FusedF64]; 3],
    ) {
        let l = Limbs::new(plan, model);
        let a = if after_aba { &s.aba.qdd } else { &s.x };
        let f_ext = given(f_ext, &s.f_ext);
        let [dq, dv, da] = matrices;
        let to = (&mut s.bodies, [dq, &mut *dv, da]);
        rnea_derivatives::pass(&l, &s.world, to, &s.v, a, f_ext, l.minus_gravity(), false);
        free_armature::add_slope(model, v, dv);
    }
}

/// Returns the external forces on the bodies of all steps, or an empty slice if there are no forces.
#[inline(always)]
fn given<T>(some: bool, f_ext: &[T]) -> &[T] {
    if some { f_ext } else { &[] }
}

/// Returns the plan of the limbs, if the model and `data` have limbs in parallel lanes and the processor supports the
/// vectors.
#[inline]
pub(crate) fn ready<'m, S: Scalar, R: Constant<S>>(model: &'m Model<R>, data: &Data<S>) -> Option<&'m Plan> {
    let (Some(plan), Some(scratch)) = (&model.limbs(), &data.limbs) else { return None };
    (is::<(S, R), (f64, f64)>() && scratch.fits(plan) && level() > Level::Baseline).then_some(plan)
}

/// Runs an algorithm with limbs in parallel lanes, if the model and `data` have such limbs. Returns whether the
/// algorithm ran. Arguments that the algorithm does not use are empty.
#[inline]
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    task: Task,
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some(plan) = ready(model, data) else { return false };
    if model.has_mimic() && !matches!(task, Task::Rnea) {
        return false; // only `Task::Rnea` supports joints that share a coordinate
    }
    // SAFETY: `ready` returns a plan only if S and R are f64.
    unsafe { enter(task, same(model), plan, same(data), arguments.fused()) }
    true
}

/// Runs an algorithm in lanes and writes its results to `data`. The arguments must be valid.
fn enter(task: Task, model: &Model, plan: &Plan, data: &mut Data<f64>, arguments: Arguments<'_>) {
    let Some(s) = data.limbs.as_deref_mut() else { return };
    let f_ext = !arguments.f_ext.is_empty();
    match task {
        Task::Aba | Task::AbaDerivatives => load_free(model, plan, s, &mut data.aba, arguments),
        _ => load_steps(plan, s, arguments),
    }
    if let Task::Rnea = task {
        data.world.placed = PlacementCache::Nowhere;
        let [v, a] = [arguments.v, arguments.x];
        return rnea_by_steps(model, plan, s, [v, a], f_ext, FusedF64::of_mut(&mut data.rnea.tau));
    }
    place_steps(model, plan, s);
    data.world.placed = PlacementCache::Limbs(model.geometry_hash());
    match task {
        Task::Crba => crba_by_steps(model, plan, s, FusedF64::of_mut(data.crba.M.as_mut_slice())),
        Task::Minv => factorize_by_steps(model, plan, s),
        Task::Aba | Task::AbaDerivatives => aba_by_steps(model, plan, s, f_ext, FusedF64::of_mut(&mut data.aba.qdd)),
        Task::Rnea | Task::RneaDerivatives => {}
    }
    if let Task::Minv | Task::AbaDerivatives = task {
        inverse_by_steps(model, plan, s, FusedF64::of_mut(data.minv.Minv.as_mut_slice()));
    }
    if let Task::RneaDerivatives | Task::AbaDerivatives = task {
        let matrices = data.rnea_derivatives.parts().1.map(FusedF64::of_mut);
        let after_aba = matches!(task, Task::AbaDerivatives);
        rnea_derivatives_by_steps(model, plan, s, after_aba, arguments.v, f_ext, matrices);
    }
}

/// Loads the arguments of forward dynamics into lanes, with efforts from which the bias of free joints with armature is
/// subtracted.
pub(super) fn load_free(
    model: &Model,
    plan: &Plan,
    s: &mut Scratch,
    d: &mut aba::Workspace<f64>,
    arguments: Arguments<'_>,
) {
    if model.free_armature().is_empty() {
        return load_steps(plan, s, arguments);
    }
    let effort = FusedF64::of_mut(&mut d.effort);
    free_armature::without_bias(model, arguments.v, arguments.x, effort);
    load_steps(plan, s, Arguments { x: effort, ..arguments });
}

/// Copies the placements and joint columns that the last call computed in lanes to the arrays of single bodies.
pub(crate) fn spread<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>) {
    let Some(plan) = ready(model, data) else { return };
    let Data { limbs: Some(scratch), world: World { oX, S: columns, placed, .. }, .. } = data else { return };
    let view = LaneView::new(plan, scratch);
    for i in 1..oX.len() {
        oX[i] = view.pose(i);
        for k in 0..model.nodes()[i].joint.nv() {
            columns[model.nodes()[i].column + k] = view.column(i, k);
        }
    }
    *placed = PlacementCache::Bodies(model.geometry_hash());
}
