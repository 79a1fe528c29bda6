//! Groups of knots. One call evaluates all knots of a group.

use super::action::ActionModel;
use super::multipliers::Visit;
use crate::error::assert_length;
use crate::lq::LqKnot;
use core::any::Any;
use core::ops::Range;

/// Action that computes several knots in one call, for example in the lanes of a SIMD register, or in one call to
/// another language.
///
/// An action that implements this trait returns itself from [`ActionModel::group_model`]. The default methods loop over
/// the knots.
///
/// A **group** consists of consecutive knots of the horizon, or of the trials of a line search at one knot. The index t
/// of each knot in the horizon is given. The states, the controls and the next states are stored knot after knot.
pub trait GroupModel: ActionModel {
    /// Returns the number of states that a group call computes in about the time of one state; 1 without SIMD lanes.
    ///
    /// A line search evaluates this number of step lengths in one group.
    fn lanes(&self) -> usize {
        1
    }

    /// Returns whether `other` computes the same results as this action. If so, the knots of both actions form one
    /// group, which is evaluated by `self`. The default is false.
    fn is_same(&self, other: &dyn ActionModel) -> bool {
        let _ = other;
        false
    }

    /// Computes [`calc`](ActionModel::calc) for all knots of a group. Knot `knots[i]` has the i-th state of `xs` and
    /// the i-th control of `us`.
    ///
    /// # Panics
    /// If the lengths of the states, controls, next states and costs are not knots.len() times nx, nu, nx and 1.
    #[track_caller]
    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        calc_each(self, knots, [xs, us], next, costs);
    }

    /// Computes [`calc_diff`](ActionModel::calc_diff) for all knots of a group.
    ///
    /// # Panics
    /// If the lengths of the states, controls and LQ knots are not knots.len() times nx, nu and 1.
    #[track_caller]
    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        calc_diff_each(self, knots, [xs, us], lq_knots);
    }
}

/// Kind of quantities that a group evaluation computes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Evaluation<'m> {
    /// Next states and costs, and also the motions (accelerations and forces) if the results have storage for them.
    Values,
    /// Derivatives of dynamics and costs. Constraints add their terms of the augmented Lagrangian to the costs.
    Derivatives,
    /// Derivatives of dynamics and costs alone; the constraints are written to the [rows](LqKnot::rows) of LQ knots.
    Rows,
    /// Derivatives of the costs, with the dynamics as equations of inverse dynamics at knots that support this. The
    /// equations are taken at the given motions (accelerations and forces), which have the same length at each knot. If
    /// no motions are given, they are computed.
    Equations {
        /// Accelerations and forces of the knots.
        motions: &'m [f64],
        /// Whether the constraints are written to the rows of LQ knots, as for [`Rows`](Self::Rows).
        rows: bool,
    },
}

impl Evaluation<'_> {
    /// Returns whether constraints are written to the rows of LQ knots.
    pub(crate) fn has_rows(self) -> bool {
        matches!(self, Self::Rows | Self::Equations { rows: true, .. })
    }

    /// Returns the evaluation of the same quantities without equations of inverse dynamics.
    pub(crate) fn without_equations(self) -> Self {
        match self {
            Self::Equations { rows: true, .. } => Self::Rows,
            Self::Equations { rows: false, .. } => Self::Derivatives,
            other => other,
        }
    }

    /// Returns the part of this evaluation for the knots `knots` of a group of `count` knots.
    pub(crate) fn part(self, knots: Range<usize>, count: usize) -> Self {
        match self {
            Self::Equations { motions, rows } => {
                let size = motions.len() / count;
                Self::Equations { motions: &motions[knots.start * size..knots.end * size], rows }
            }
            other => other,
        }
    }
}

/// Outputs of a group evaluation. An evaluation writes either the LQ knots, or the other fields.
#[derive(Debug)]
pub struct Results<'a> {
    /// Next states, one after the other.
    pub(crate) next: &'a mut [f64],
    /// Costs, one for each knot.
    pub(crate) costs: &'a mut [f64],
    /// Accelerations and forces; empty if they are not stored. Each knot has an equal share of the slice, and uses the
    /// beginning of its share.
    pub(crate) motions: &'a mut [f64],
    /// Values g(x, u) of the constraints, an equal share for each knot. If the slice is empty, constraints instead add
    /// their terms of the augmented Lagrangian to the costs.
    pub(crate) constraints: &'a mut [f64],
    /// LQ knots that receive the derivatives.
    pub(crate) lq_knots: &'a mut [LqKnot],
}

impl<'a> Results<'a> {
    /// Returns outputs for an evaluation of values.
    pub(crate) fn values(next: &'a mut [f64], costs: &'a mut [f64], motions: &'a mut [f64]) -> Self {
        Self { next, costs, motions, constraints: &mut [], lq_knots: &mut [] }
    }

    /// Returns outputs for an evaluation of derivatives.
    pub(crate) fn derivatives(lq_knots: &'a mut [LqKnot]) -> Self {
        Self { next: &mut [], costs: &mut [], motions: &mut [], constraints: &mut [], lq_knots }
    }
}

/// Knots that are evaluated in one call: knots of a robot, of user-defined accelerations, or with constraints. All
/// other actions are evaluated by [`evaluate`].
///
/// One group may represent several models of a robot that differ only in costs, limits and durations.
pub trait KnotGroup {
    /// Returns the number of states that a group call computes in about the time of one state.
    fn lanes(&mut self) -> usize;

    /// Evaluates knot `knots[i]` at the i-th state of `xs` and the i-th control of `us`, for all i.
    #[track_caller]
    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation<'_>, results: &mut Results<'_>);

    /// Computes values at knot t of several problems, in one batch. Lane i has the i-th state of `xs` and the i-th
    /// control of `us`. It belongs to this action if `of[i]` is 0, and else to action `of[i]` − 1 of `others`. All of
    /// them [match](Self::matches) this action. Returns false if the knot is not computed in batches.
    #[track_caller]
    fn evaluate_across(
        &mut self,
        others: &mut [&mut dyn ActionModel],
        of: &[usize],
        t: usize,
        trajectory: [&[f64]; 2],
        results: &mut Results<'_>,
    ) -> bool {
        let _ = (others, of, t, trajectory, results);
        false
    }

    /// Returns whether knot t of this action and of `other` differ only in numbers that may differ between the lanes of
    /// one batch: durations, weights, targets, bounds, and targets of contacts.
    fn matches(&self, other: &dyn ActionModel, t: usize) -> bool {
        let _ = (other, t);
        false
    }

    /// Calls `visit` for the constraints of knot t, in their order.
    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>);

    /// Returns the sizes of the equations of inverse dynamics: the number of accelerations and forces of a knot, and
    /// the maximum numbers of dependent coordinates and of residual rows. Returns `None` without such equations.
    fn inverse_dynamics(&self) -> Option<(usize, [usize; 2])> {
        None
    }

    /// Allocates the workspace, unless it is already allocated.
    fn reserve(&mut self) {}

    /// Takes over the model of another action of the same kind, as model `place` or as a new model. Returns whether
    /// this succeeded; if so, the other action is no longer used.
    fn merge(&mut self, other: &mut dyn ActionModel, place: Option<usize>) -> bool {
        let _ = (other, place);
        false
    }

    /// Uses scratch memory of `other`, an action of the same problem and thread, if possible.
    fn share(&mut self, other: &dyn KnotGroup) {
        let _ = other;
    }

    /// Selects the model that later changes affect, among the models that this action represents.
    fn choose(&mut self, model: usize) {
        let _ = model;
    }

    /// Assigns knot t, of `horizon` knots, to one of the models that this action represents.
    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        let _ = (t, horizon, model);
    }

    /// Removes the costs, limits and the duration that knot t of the selected model has in place of the model's own.
    fn release(&mut self, t: usize) {
        let _ = t;
    }

    /// Allocates memory so that [`set_duration`](Self::set_duration) allocates nothing in a horizon with `horizon`
    /// knots.
    fn reserve_durations(&mut self, horizon: usize) {
        let _ = horizon;
    }

    /// Sets the duration (s) of knot t of the selected model; returns whether the knot has a duration.
    fn set_duration(&mut self, t: usize, dt: f64) -> bool {
        let _ = (t, dt);
        false
    }

    /// Returns the lower and upper bounds on the controls, and the number of controls of the model. The bounds may
    /// consist of several parts of this length.
    fn bounds_mut(&mut self) -> Option<([&mut [f64]; 2], usize)> {
        None
    }

    /// Computes the next state of knot t after `dt` seconds in place of the knot's duration, into `next`. Returns
    /// whether the knot has a duration.
    fn advance(&mut self, t: usize, x: &[f64], u: &[f64], dt: f64, next: &mut [f64]) -> bool {
        let _ = (t, x, u, dt, next);
        false
    }

    /// Computes the controls that hold the state x still into `u`, as [`ActionModel::quasi_static`] does, but without
    /// allocation. Returns whether this action has such controls.
    fn hold_still(&mut self, x: &[f64], u: &mut [f64]) -> bool {
        let _ = (x, u);
        false
    }

    /// Returns whether the controls of this action have the same meaning as the controls of `other`. They do not if the
    /// actions have other contacts.
    fn has_controls_of(&self, other: &dyn KnotGroup) -> bool {
        let _ = other;
        true
    }

    /// Returns the dynamics of the knots as `Any`. The module that implements the group knows the type.
    fn dynamics_ref(&self) -> Option<&dyn Any> {
        None
    }

    /// Returns the duration (s) of knot t, 0 for an impact; `None` for an action without a duration.
    fn duration(&self, t: usize) -> Option<f64> {
        let _ = t;
        None
    }

    /// Calls `show` for each vector that the dynamics of knot t compute in addition to the next state, with its name.
    fn show_outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        let _ = (t, x, u, show);
    }

    /// Returns the dynamics of the knots as `Any`. The module that implements the group knows the type.
    fn dynamics(&mut self) -> Option<&mut dyn Any> {
        None
    }
}

/// Evaluates a group of knots, for any type of action.
#[track_caller]
pub(crate) fn evaluate(
    action: &mut dyn ActionModel,
    knots: &[usize],
    xs: &[f64],
    us: &[f64],
    what: Evaluation<'_>,
    results: &mut Results<'_>,
) {
    if let Some(group) = action.knot_group_mut() {
        return group.evaluate(knots, xs, us, what, results);
    }
    let Results { next, costs, lq_knots, .. } = results;
    match (action.group_model(), what) {
        (Some(group), Evaluation::Values) => group.calc_group(knots, xs, us, next, costs),
        (Some(group), _) => group.calc_diff_group(knots, xs, us, lq_knots),
        (None, Evaluation::Values) => calc_each(action, knots, [xs, us], next, costs),
        (None, _) => calc_diff_each(action, knots, [xs, us], lq_knots),
    }
}

/// Computes values at knot t of several problems. Trial i has the i-th state of `xs` and the i-th control of `us`, and
/// belongs to action `of[i]`. Actions that are not computed in batches are evaluated one by one.
#[track_caller]
pub(crate) fn evaluate_across(
    actions: &mut [&mut dyn ActionModel],
    of: &[usize],
    t: usize,
    xs: &[f64],
    us: &[f64],
    results: &mut Results<'_>,
) {
    let [first, others @ ..] = &mut *actions else { return };
    if let Some(group) = first.knot_group_mut()
        && group.evaluate_across(others, of, t, [xs, us], results)
    {
        return;
    }
    let count = of.len();
    let (nx, nu, motion) = (xs.len() / count, us.len() / count, results.motions.len() / count);
    for (i, &k) in of.iter().enumerate() {
        let next = &mut results.next[i * nx..][..nx];
        let motions = &mut results.motions[i * motion..][..motion];
        let mut own = Results::values(next, &mut results.costs[i..=i], motions);
        evaluate(&mut *actions[k], &[t], &xs[i * nx..][..nx], &us[i * nu..][..nu], Evaluation::Values, &mut own);
    }
}

/// Returns the number of states that an action computes in about the time of one state.
pub(crate) fn lanes(action: &mut dyn ActionModel) -> usize {
    let lanes = match action.knot_group_mut() {
        Some(group) => group.lanes(),
        None => action.group_model().map_or(1, |group| group.lanes()),
    };
    lanes.max(1)
}

/// Returns the number of constraints at knot t of an action.
pub(crate) fn constraint_count(action: &mut dyn ActionModel, t: usize) -> usize {
    let mut count = 0;
    if let Some(group) = action.knot_group_mut() {
        group.constraints(t, &mut |bounded| count += bounded.count);
    }
    count
}

/// Returns the innermost wrapped action, or the action itself if it wraps none, as a group of knots.
pub(crate) fn innermost(action: &mut dyn ActionModel) -> Option<&mut dyn KnotGroup> {
    if action.inner_mut().is_some() {
        return innermost(action.inner_mut()?);
    }
    action.knot_group_mut()
}

/// Returns the number of entries of a state of the innermost wrapped action. They are the first entries of a state of
/// the action.
pub(crate) fn innermost_nx(action: &mut dyn ActionModel) -> usize {
    let nx = action.nx();
    action.inner_mut().map_or(nx, innermost_nx)
}

/// Computes the values of a group, knot by knot.
#[track_caller]
fn calc_each<A: ActionModel + ?Sized>(
    action: &mut A,
    knots: &[usize],
    [xs, us]: [&[f64]; 2],
    next: &mut [f64],
    costs: &mut [f64],
) {
    let (nx, nu) = (action.nx(), action.nu());
    assert_length("xs", xs.len(), knots.len() * nx);
    assert_length("us", us.len(), knots.len() * nu);
    assert_length("next", next.len(), knots.len() * nx);
    assert_length("costs", costs.len(), knots.len());
    for (i, &t) in knots.iter().enumerate() {
        costs[i] = action.calc(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut next[i * nx..][..nx]);
    }
}

/// Computes the derivatives of a group, knot by knot.
#[track_caller]
fn calc_diff_each<A: ActionModel + ?Sized>(
    action: &mut A,
    knots: &[usize],
    [xs, us]: [&[f64]; 2],
    lq_knots: &mut [LqKnot],
) {
    let (nx, nu) = (action.nx(), action.nu());
    assert_length("xs", xs.len(), knots.len() * nx);
    assert_length("us", us.len(), knots.len() * nu);
    assert_length("lq_knots", lq_knots.len(), knots.len());
    for (i, &t) in knots.iter().enumerate() {
        action.calc_diff(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut lq_knots[i]);
    }
}
