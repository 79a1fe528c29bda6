//! Algorithms that compute the limbs of a robot in parallel lanes.
//!
//! Limbs are branches of the tree, such as legs and arms. A step of a pass computes one body of each limb at the same
//! time, with one limb per lane of a SIMD vector.
#![allow(unsafe_code)]

use crate::data::Data;
use crate::derivatives::rnea_derivatives;
use crate::lanes::limbs::lanes::Limbs;
use crate::lanes::limbs::pass::{Arguments, Scratch, load, scatter};
use crate::lanes::limbs::{LaneView, Plan};
use crate::passes::kinematics::{PlacementCache, World, place};
use crate::passes::{aba, crba, free_armature, minv, rnea};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_spatial::gate::{FusedF64, Level, is, level, same};
use condyle_spatial::register_kernel;
use condyle_spatial::{Constant, Scalar};

register_kernel! {
    /// Computes the joint efforts τ with the limbs in parallel lanes.
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
    /// Computes the placements of all bodies and the joint columns S, with the limbs in parallel lanes.
    pub(super) fn place_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch) {
        let l = Limbs::new(plan, model);
        place(&l, &mut s.world, &s.q);
        l.broadcast(&mut s.world.S);
    }
}

register_kernel! {
    /// Computes M with the limbs in parallel lanes. `s.world` must contain the placements of all bodies.
    fn crba_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch, M: &mut [FusedF64]) {
        crba::pass(&Limbs::new(plan, model), &s.world, &mut s.IC, M);
    }
}

register_kernel! {
    /// Computes the factors U and 1/D of the articulated-body algorithm, with the limbs in parallel lanes. `s.world`
    /// must contain the placements of all bodies.
    fn factorize_by_steps<V>(model: &Model, plan: &Plan, s: &mut Scratch) {
        aba::factorize(&Limbs::new(plan, model), &s.world, &mut s.aba);
    }
}

register_kernel! {
    /// Computes q̈ with the limbs in parallel lanes. `s.world` must contain the placements of all bodies.
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
    /// Computes ∂τ/∂q, ∂τ/∂v and M with the limbs in parallel lanes. `s.world` must contain the placements of all
    /// bodies. If `after_aba` is set, q̈ is the result of the articulated-body algorithm; otherwise q̈ is an argument
    /// of the call.
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

/// Returns `f_ext`, or an empty slice if the call has no external forces.
#[inline(always)]
fn given<T>(some: bool, f_ext: &[T]) -> &[T] {
    if some { f_ext } else { &[] }
}

/// Returns the plan for computing limbs in parallel lanes. Returns `None` if the model or `data` does not have such
/// limbs, or the processor does not support the vectors.
#[inline]
pub(crate) fn ready<'m, S: Scalar, R: Constant<S>>(model: &'m Model<R>, data: &Data<S>) -> Option<&'m Plan> {
    let (Some(plan), Some(scratch)) = (&model.limbs(), &data.limbs) else { return None };
    (is::<(S, R), (f64, f64)>() && scratch.fits(plan) && level() > Level::Baseline).then_some(plan)
}

/// Model, plan and scratch of a call, all with `f64` as the scalar type.
struct Call<'a> {
    model: &'a Model,
    plan: &'a Plan,
    s: &'a mut Scratch,
    world: &'a mut World<f64>,
    rnea: &'a mut rnea::Workspace<f64>,
    aba: &'a mut aba::Workspace<f64>,
    crba: &'a mut crba::Workspace<f64>,
    minv: &'a mut minv::Workspace<f64>,
    rnea_derivatives: &'a mut rnea_derivatives::Workspace<f64>,
}

/// Returns the call and its arguments as `f64`, or `None` if the model or `data` does not have limbs in parallel lanes.
#[inline]
fn call<'a, S: Scalar, R: Constant<S>>(
    model: &'a Model<R>,
    data: &'a mut Data<S>,
    arguments: Arguments<'a, S>,
) -> Option<(Call<'a>, Arguments<'a>)> {
    let plan = ready(model, data)?;
    // SAFETY: `ready` returns a plan only if S and R are f64.
    let (model, data, arguments): (&Model, &mut Data<f64>, _) = unsafe { (same(model), same(data), arguments.fused()) };
    let Data { limbs, world, rnea, aba, crba, minv, rnea_derivatives, .. } = data;
    let call = Call { model, plan, s: limbs.as_deref_mut()?, world, rnea, aba, crba, minv, rnea_derivatives };
    Some((call, arguments))
}

/// Returns the same as [`call`], but `None` if joints share a coordinate. Used by algorithms that do not support shared
/// coordinates.
#[inline]
fn call_without_mimic<'a, S: Scalar, R: Constant<S>>(
    model: &'a Model<R>,
    data: &'a mut Data<S>,
    arguments: Arguments<'a, S>,
) -> Option<(Call<'a>, Arguments<'a>)> {
    if model.has_mimic() { None } else { call(model, data, arguments) }
}

impl Call<'_> {
    /// Loads the arguments into lanes and computes the placements of all bodies.
    fn place(&mut self, arguments: Arguments<'_>) {
        load_steps(self.plan, self.s, arguments);
        self.place_loaded();
    }

    /// Loads the arguments of forward dynamics into lanes and computes the placements of all bodies.
    fn place_free(&mut self, arguments: Arguments<'_>) {
        load_free(self.model, self.plan, self.s, self.aba, arguments);
        self.place_loaded();
    }

    /// Computes the placements of all bodies from arguments that are already in lanes.
    fn place_loaded(&mut self) {
        place_steps(self.model, self.plan, self.s);
        self.world.placed = PlacementCache::Limbs(self.model.geometry_hash());
    }
}

/// Computes [`rnea`](crate::rnea) with the limbs in parallel lanes, and returns true. Returns false if the model or
/// `data` does not have such limbs. The arguments must be valid.
#[inline]
pub(crate) fn rnea<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some((c, arguments)) = call(model, data, arguments) else { return false };
    load_steps(c.plan, c.s, arguments);
    c.world.placed = PlacementCache::Nowhere;
    let Arguments { v, x: a, f_ext, .. } = arguments;
    rnea_by_steps(c.model, c.plan, c.s, [v, a], !f_ext.is_empty(), FusedF64::of_mut(&mut c.rnea.tau));
    true
}

/// Computes [`aba`](crate::aba()) with the limbs in parallel lanes, and returns true; returns false if this is not
/// possible.
#[inline]
pub(crate) fn aba<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some((mut c, arguments)) = call_without_mimic(model, data, arguments) else { return false };
    c.place_free(arguments);
    aba_by_steps(c.model, c.plan, c.s, !arguments.f_ext.is_empty(), FusedF64::of_mut(&mut c.aba.qdd));
    true
}

/// Computes [`crba`](crate::crba()) with the limbs in parallel lanes, and returns true; returns false if this is not
/// possible.
#[inline]
pub(crate) fn crba<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, q: &[S]) -> bool {
    let Some((mut c, arguments)) = call_without_mimic(model, data, Arguments::position(q)) else { return false };
    c.place(arguments);
    crba_by_steps(c.model, c.plan, c.s, FusedF64::of_mut(c.crba.M.as_mut_slice()));
    true
}

/// Computes [`minv`](crate::minv()) with the limbs in parallel lanes, and returns true; returns false if this is not
/// possible.
#[inline]
pub(crate) fn minv<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, q: &[S]) -> bool {
    let Some((mut c, arguments)) = call_without_mimic(model, data, Arguments::position(q)) else { return false };
    c.place(arguments);
    factorize_by_steps(c.model, c.plan, c.s);
    inverse_by_steps(c.model, c.plan, c.s, FusedF64::of_mut(c.minv.Minv.as_mut_slice()));
    true
}

/// Computes [`rnea_derivatives`](crate::rnea_derivatives()) with the limbs in parallel lanes, and returns true; returns
/// false if this is not possible.
#[inline]
pub(crate) fn rnea_derivatives<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some((mut c, arguments)) = call_without_mimic(model, data, arguments) else { return false };
    c.place(arguments);
    let Arguments { v, x: an, f_ext, .. } = arguments;
    let matrices = c.rnea_derivatives.parts().1.map(FusedF64::of_mut);
    rnea_derivatives_by_steps(c.model, c.plan, c.s, false, v, !f_ext.is_empty(), matrices);
    FusedF64::of_mut(&mut c.rnea_derivatives.qd).copy_from_slice(v);
    FusedF64::of_mut(&mut c.rnea_derivatives.qdd).copy_from_slice(an);
    true
}

/// Computes q̈, M⁻¹, and the derivatives of τ at q̈, for [`aba_derivatives`](crate::aba_derivatives()).
#[inline]
pub(crate) fn aba_derivatives<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    arguments: Arguments<'_, S>,
) -> bool {
    let Some((mut c, arguments)) = call_without_mimic(model, data, arguments) else { return false };
    c.place_free(arguments);
    let (v, f_ext) = (arguments.v, !arguments.f_ext.is_empty());
    aba_by_steps(c.model, c.plan, c.s, f_ext, FusedF64::of_mut(&mut c.aba.qdd));
    inverse_by_steps(c.model, c.plan, c.s, FusedF64::of_mut(c.minv.Minv.as_mut_slice()));
    let matrices = c.rnea_derivatives.parts().1.map(FusedF64::of_mut);
    rnea_derivatives_by_steps(c.model, c.plan, c.s, true, v, f_ext, matrices);
    FusedF64::of_mut(&mut c.rnea_derivatives.qd).copy_from_slice(v);
    true
}

/// Loads the arguments of forward dynamics into lanes. The bias efforts of free joints with armature are subtracted
/// from τ.
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

/// Copies the placements and joint columns that the last call computed in lanes to the arrays with one entry per body.
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
