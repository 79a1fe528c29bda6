//! Evaluation of a problem along a trajectory: rollouts, costs, derivatives and outputs of its knots.

use super::Problem;
use crate::error::{Error, assert_length};
use crate::lq::{Gains, KnotFeedback, LqKnot};
use crate::problem::action::ActionModel;
use crate::problem::group::{Evaluation, Results, evaluate, innermost, innermost_nx};
use crate::problem::shape::Shape;
use crate::problem::threads::Knots;
use std::ops::{ControlFlow, Range};

impl Problem {
    /// Returns the states x₀ … x_N that follow from x̂₀ under the controls `us`. They are a warm start without gaps.
    /// Allocates the states.
    ///
    /// # Errors
    /// [`Error`] if `us` has a wrong length or an entry that is not finite, or if a state becomes infinite.
    pub fn rollout(&mut self, us: &[f64]) -> Result<Vec<f64>, Error> {
        self.rollout_while(us, || ControlFlow::Continue(()))
    }

    /// Computes the states as [`rollout`](Self::rollout) does. `go_on` is called at each knot and returns whether to
    /// continue. The states of knots that were not reached are zeros.
    ///
    /// # Errors
    /// The same errors as [`rollout`](Self::rollout).
    #[doc(hidden)]
    pub fn rollout_while(&mut self, us: &[f64], mut go_on: impl FnMut() -> ControlFlow<()>) -> Result<Vec<f64>, Error> {
        Error::check("us", us, self.shape.offsets[self.horizon()])?;
        let mut xs = vec![0.0; (self.horizon() + 1) * self.nx()];
        xs[..self.shape.nx].copy_from_slice(&self.x0);
        for t in 0..self.horizon() {
            if go_on().is_break() {
                break;
            }
            let (done, ahead) = xs.split_at_mut((t + 1) * self.shape.nx);
            let u = &us[self.shape.u(t)];
            self.models.of_mut(self.knot_models[t]).calc(t, &done[self.shape.x(t)], u, &mut ahead[..self.shape.nx]);
        }
        Error::check("xs", &xs, xs.len())?;
        Ok(xs)
    }

    /// Computes the next states and the costs of all knots of a trajectory. `next` (N·nx) receives φₜ(xₜ, uₜ). `costs`
    /// (N + 1, the terminal cost last) receives ℓₜ(xₜ, uₜ). Allocates nothing.
    ///
    /// # Panics
    /// If a length is wrong.
    #[track_caller]
    pub fn calc(&mut self, xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        self.calc_with(xs, us, next, costs, [&mut [], &mut []]);
    }

    /// Computes as [`calc`](Self::calc) does, and also writes the motions and the constraints of the knots. Each may be
    /// empty. `motions` consists of N equal parts of [`motion_size`](Self::motion_size) entries. `constraints` consists
    /// of N + 1 equal parts for the values g(x, u); constraints then add no terms to the costs.
    #[track_caller]
    pub(crate) fn calc_with(
        &mut self,
        xs: &[f64],
        us: &[f64],
        next: &mut [f64],
        costs: &mut [f64],
        [motions, constraints]: [&mut [f64]; 2],
    ) {
        let (nx, horizon) = (self.nx(), self.horizon());
        let (size, rows) = (motions.len() / horizon, constraints.len() / (horizon + 1));
        self.assert_trajectory(xs, us);
        assert_length("next", next.len(), horizon * nx);
        assert_length("costs", costs.len(), horizon + 1);
        for (action, knots) in &self.runs {
            let (x, u) = self.places(knots);
            let motions = &mut motions[knots.start * size..knots.end * size];
            let mut results = Results::values(&mut next[x.clone()], &mut costs[knots.clone()], motions);
            results.constraints = &mut constraints[knots.start * rows..knots.end * rows];
            let (action, t) = (&mut *self.models.actions[*action], &self.knots[knots.clone()]);
            evaluate(action, t, &xs[x], &us[u], Evaluation::Values, &mut results);
        }
        let mut results = Results::values(&mut self.unread, &mut costs[horizon..], &mut []);
        results.constraints = &mut constraints[horizon * rows..];
        let x = &xs[self.shape.x(horizon)];
        evaluate(&mut *self.terminal, &self.knots[horizon..], x, &[], Evaluation::Values, &mut results);
    }

    /// Computes the derivatives at all knots of a trajectory into `lq_knots` (N + 1, the terminal knot last). Allocates
    /// nothing.
    ///
    /// # Panics
    /// If a length is wrong.
    #[track_caller]
    pub fn calc_diff(&mut self, xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        self.calc_diff_as(Evaluation::Derivatives, xs, us, lq_knots);
    }

    /// Computes derivatives as [`calc_diff`](Self::calc_diff) does, or equations of inverse dynamics at knots that
    /// support them.
    #[track_caller]
    pub(crate) fn calc_diff_as(&mut self, what: Evaluation<'_>, xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        self.calc_diff_part(what, [xs, us], 0..self.horizon() + 1, lq_knots);
    }

    /// Computes the derivatives of [`calc_diff_as`](Self::calc_diff_as) at the knots of a range alone, into `lq_knots`.
    /// The terminal knot may be in the range.
    ///
    /// # Panics
    /// If a length is wrong.
    #[track_caller]
    pub(crate) fn calc_diff_part(
        &mut self,
        what: Evaluation<'_>,
        [xs, us]: [&[f64]; 2],
        range: Range<usize>,
        lq_knots: &mut [LqKnot],
    ) {
        let horizon = self.horizon();
        self.assert_trajectory(xs, us);
        assert_length("lq_knots", lq_knots.len(), range.len());
        clear(lq_knots);
        for (action, knots) in &self.runs {
            let knots = knots.start.max(range.start)..knots.end.min(range.end);
            if knots.is_empty() {
                continue;
            }
            let (x, u) = self.places(&knots);
            let mut results = Results::derivatives(&mut lq_knots[knots.start - range.start..knots.end - range.start]);
            let (action, t) = (&mut *self.models.actions[*action], &self.knots[knots.clone()]);
            evaluate(action, t, &xs[x], &us[u], what.part(knots, horizon), &mut results);
        }
        if range.end > horizon {
            let mut results = Results::derivatives(&mut lq_knots[horizon - range.start..]);
            let x = &xs[self.shape.x(horizon)];
            evaluate(&mut *self.terminal, &self.knots[horizon..], x, &[], what.without_equations(), &mut results);
        }
    }

    /// Computes [`calc_diff_as`](Self::calc_diff_as) on `gains.len()` threads of the rayon pool from which it is
    /// called, or else of the global pool. The result is the same to the last bit. `sweep` is called on the calling
    /// thread for each finished group, from the end of the horizon to its beginning. Its arguments are the model, the
    /// index of the first knot, the knots, and the part of `found` for these knots. Deferred gains are written after
    /// the sweep of their group. Models that cannot be [copied](ActionModel::try_clone) are evaluated on the calling
    /// thread.
    ///
    /// # Panics
    /// If a length is wrong.
    #[track_caller]
    pub(crate) fn calc_diff_on(
        &mut self,
        what: Evaluation<'_>,
        [xs, us]: [&[f64]; 2],
        lq_knots: &mut [LqKnot],
        found: &mut [KnotFeedback],
        gains: &mut [Gains],
        mut sweep: impl FnMut(&dyn ActionModel, usize, &mut [LqKnot], &mut [KnotFeedback]) + Send,
    ) {
        self.assert_trajectory(xs, us);
        assert_length("lq_knots", lq_knots.len(), self.horizon() + 1);
        clear(lq_knots);
        let Self { models, runs, copies, knots, shape, terminal, .. } = self;
        let t = shape.horizon();
        let ((lq_knots, end), (found, found_there)) = (lq_knots.split_at_mut(t), found.split_at_mut(t));
        let mut results = Results::derivatives(&mut *end);
        evaluate(&mut **terminal, &knots[t..], &xs[shape.x(t)], &[], what.without_equations(), &mut results);
        sweep(&**terminal, t, end, found_there);
        let all = Knots { knots, xs, us, nx: shape.nx, offsets: &shape.offsets, what };
        copies.calc_diff(models, runs, all, lq_knots, found, gains, sweep);
    }

    /// Copies the multipliers of the models into the copies of the models that other threads use.
    pub(crate) fn share_multipliers(&mut self) {
        self.copies.share_multipliers(&mut self.models.actions, &self.runs);
    }

    /// Returns for each knot the controls that hold its state still, as nearly as controls can achieve: see
    /// [`quasi_static`](ActionModel::quasi_static). Each knot is computed independently of the others. Allocates.
    ///
    /// # Errors
    /// [`Error`] if the length of `xs` is not (N + 1)·nx, or an entry is not finite.
    pub fn quasi_static(&mut self, xs: &[f64]) -> Result<Vec<f64>, Error> {
        Error::check("xs", xs, (self.horizon() + 1) * self.nx())?;
        let mut us = Vec::with_capacity(self.shape.offsets[self.horizon()]);
        for t in 0..self.horizon() {
            us.extend(self.models.of_mut(self.knot_models[t]).quasi_static(t, &xs[self.shape.x(t)]));
        }
        Ok(us)
    }

    /// Returns whether the controls of knot t have the same meaning as the controls of knot t − 1. They do not if both
    /// knots belong to robots with different contacts, actuation or kinds of dynamics.
    pub(crate) fn continues_controls(&self, t: usize) -> bool {
        let group = |t: usize| self.action(t).knot_group();
        t == 0 || group(t).zip(group(t - 1)).is_none_or(|(own, before)| own.has_controls_of(before))
    }

    /// Returns whether the controls of two models have the same meaning: see
    /// [`continues_controls`](Self::continues_controls). Both models have the same number of controls.
    pub(crate) fn has_same_controls(&self, one: usize, other: usize) -> bool {
        let [a, b] = [one, other].map(|index| self.models.of(index));
        one == other
            || a.nu() == b.nu()
                && a.knot_group().zip(b.knot_group()).is_none_or(|(own, other)| own.has_controls_of(other))
    }

    /// Computes the controls that hold the state x of a robot's knot t still, as nearly as possible, into `u`. Returns
    /// whether the knot has such controls. Allocates nothing.
    pub(crate) fn hold_still(&mut self, t: usize, x: &[f64], u: &mut [f64]) -> bool {
        self.action_mut(t).knot_group_mut().is_some_and(|group| group.hold_still(x, u))
    }

    /// Calls `show` for each vector that the dynamics of knot t compute at (x, u) in addition to the next state, with
    /// its name. A robot's vectors are `acceleration`, `effort` of all joints, and `force/` followed by the name of
    /// each contact. The force of a contact is expressed in the axes of the contact's rows; at an impact it is an
    /// impulse. User-defined accelerations have the vector `acceleration`; other actions have no such vectors.
    ///
    /// # Panics
    /// If t > N or a length is wrong.
    #[track_caller]
    pub fn outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        assert_length("x", x.len(), self.nx());
        assert_length("u", u.len(), self.nu(t));
        let nx = innermost_nx(self.action_mut(t));
        if let Some(group) = innermost(self.action_mut(t)) {
            group.show_outputs(t, &x[..nx], u, show);
        }
    }

    /// Returns the index ranges of the states and of the controls of a run of knots, in flat trajectories.
    fn places(&self, knots: &Range<usize>) -> (Range<usize>, Range<usize>) {
        let Shape { nx, offsets, .. } = &self.shape;
        (knots.start * nx..knots.end * nx, offsets[knots.start]..offsets[knots.end])
    }

    #[track_caller]
    fn assert_trajectory(&self, xs: &[f64], us: &[f64]) {
        assert_length("xs", xs.len(), (self.horizon() + 1) * self.nx());
        assert_length("us", us.len(), self.shape.offsets[self.horizon()]);
    }
}

/// Clears the structures of A and B, and the constraint rows, which the actions then set again.
fn clear(lq_knots: &mut [LqKnot]) {
    for knot in lq_knots {
        knot.structure.set_dense();
        knot.rows.clear();
    }
}
