//! Derivatives of a horizon on several threads, concurrent with the sweep. Each thread has its own copies of the
//! actions.
//!
//! A group has as many knots as its model has lanes. The groups are processed from the end of the horizon to its
//! beginning, in three steps. First, a free thread computes the derivatives of the group. Second, the calling thread
//! sweeps the group. While the derivatives are not ready, the calling thread computes derivatives of other groups.
//! Third, an idle thread computes the gains of the group.

use super::action::ActionModel;
use super::group::{Evaluation, Results, evaluate};
use super::models::{Models, reserve, share};
use crate::lq::{Gains, KnotFeedback, LqKnot};
use condyle_linalg::threads::{Parts, join, pause};
use core::ops::Range;
use core::sync::atomic::AtomicU8;

/// Steps of the work on a group, in order: derivatives, sweep, and gains.
const DERIVE: u8 = 0;
const SWEEP: u8 = 1;
const FINISH: u8 = 2;

/// Number of idle polls (a few ms) after which a helper thread returns and leaves the remaining work to the sweeping
/// thread. A helper thread therefore never waits for ever, even if other work occupies the pool.
const PATIENCE: usize = 4096;

/// Copies of actions for other threads, and the division of the knots into groups.
#[derive(Default)]
pub(crate) struct Copies {
    /// Copy of each action, for each thread except the calling one.
    of: Vec<Vec<Option<Box<dyn ActionModel>>>>,
    /// Index of the first knot of each group, followed by the number of knots.
    cuts: Vec<usize>,
    /// Index of the action that evaluates each group.
    owners: Vec<usize>,
    /// States of the groups, for [`Parts`].
    states: Vec<AtomicU8>,
}

impl Copies {
    /// Returns the copies of the actions for the second thread, if they exist.
    pub(super) fn first(&mut self) -> Option<&mut [Option<Box<dyn ActionModel>>]> {
        self.of.first_mut().map(Vec::as_mut_slice)
    }

    /// Drops the copies of an action that is new or may have changed.
    pub(crate) fn forget(&mut self, action: usize) {
        for copies in &mut self.of {
            copies.resize_with(copies.len().max(action + 1), || None);
            copies[action] = None;
        }
    }

    /// Calls `visit` for each copy of an action, in which model `own` is chosen, until `visit` returns an error.
    pub(crate) fn each_of<E>(
        &mut self,
        action: usize,
        own: usize,
        visit: &mut dyn FnMut(&mut dyn ActionModel) -> Result<(), E>,
    ) -> Result<(), E> {
        for copy in self.of.iter_mut().filter_map(|copies| copies.get_mut(action)?.as_mut()) {
            if let Some(group) = copy.knot_group_mut() {
                group.choose(own);
            }
            visit(&mut **copy)?;
        }
        Ok(())
    }

    /// Notifies the copies that the horizon has moved by one knot.
    pub(crate) fn shift(&mut self) {
        self.of.iter_mut().flatten().flatten().for_each(|copy| copy.shift());
    }

    /// Assigns knot t, of `horizon` knots, to a model, in all copies of the action that represents this model.
    pub(crate) fn serve(&mut self, action: usize, t: usize, horizon: usize, model: usize) {
        for copy in self.of.iter_mut().filter_map(|copies| copies.get_mut(action)?.as_mut()) {
            if let Some(group) = copy.knot_group_mut() {
                group.serve(t, horizon, model);
            }
        }
    }

    /// Creates the missing copies of all models that can be copied, for `threads` threads including the calling one.
    fn renew(&mut self, threads: usize, models: &[Box<dyn ActionModel>]) {
        self.of.resize_with(threads - 1, Vec::new);
        for copies in &mut self.of {
            copies.resize_with(models.len(), || None);
            for k in 0..models.len() {
                let (before, rest) = copies.split_at_mut(k);
                if rest[0].is_none() {
                    rest[0] = models[k].try_clone();
                    if let Some(copy) = &mut rest[0] {
                        if let Some(first) = before.iter().flatten().next() {
                            share(&**first, &mut **copy);
                        }
                        reserve(&mut **copy);
                    }
                }
            }
        }
    }

    /// Divides the knots into groups. As on a single thread, the first group of each run begins at the first knot of
    /// the run.
    fn group(&mut self, lanes: &[usize], runs: &[(usize, Range<usize>)]) {
        let Self { cuts, owners, .. } = self;
        cuts.clear();
        owners.clear();
        for (model, run) in runs {
            for knot in run.clone().step_by(lanes[*model]) {
                cuts.push(knot);
                owners.push(*model);
            }
        }
        cuts.push(runs.last().map_or(0, |(_, run)| run.end));
    }

    /// Copies the multipliers of the models into the copies of the models.
    pub(super) fn share_multipliers(&mut self, models: &mut [Box<dyn ActionModel>], runs: &[(usize, Range<usize>)]) {
        for copies in &mut self.of {
            for (model, run) in runs {
                let Some(copy) = &mut copies[*model] else { continue };
                let pair = (copy.knot_group_mut(), models[*model].knot_group_mut());
                let (Some(copy), Some(own)) = pair else { continue };
                let mut k = 0;
                copy.constraints(run.start, &mut |theirs| {
                    let mut i = 0;
                    own.constraints(run.start, &mut |ours| {
                        if i == k {
                            theirs.multipliers.clone_from(ours.multipliers);
                        }
                        i += 1;
                    });
                    k += 1;
                });
            }
        }
    }

    /// Computes the derivatives at all knots on as many threads as `gains` has entries. The calling thread passes the
    /// groups to `sweep`, from the last group to the first. The arguments of `sweep` begin with the group's model and
    /// the index of its first knot. The deferred gains of a group are written after its sweep. Models that cannot be
    /// copied are evaluated only on the calling thread.
    pub(super) fn calc_diff(
        &mut self,
        Models { actions: models, lanes, .. }: &mut Models,
        runs: &[(usize, Range<usize>)],
        knots: Knots<'_>,
        lq_knots: &mut [LqKnot],
        found: &mut [KnotFeedback],
        gains: &mut [Gains],
        mut sweep: impl FnMut(&dyn ActionModel, usize, &mut [LqKnot], &mut [KnotFeedback]) + Send,
    ) {
        self.renew(gains.len(), models);
        self.group(lanes, runs);
        let Self { of, cuts, owners, states } = self;
        let groups = Groups { parts: &Parts::new(lq_knots, found, cuts, states), owners, knots };
        let (own, gains) = gains.split_at_mut(1);
        join(
            || {
                let parts = groups.parts;
                let mut tried = parts.count(); // this thread has tried to DERIVE all groups from this index on
                for group in (0..parts.count()).rev() {
                    while !parts.work(group, SWEEP, |first, lq_knots, found| {
                        sweep(&*models[owners[group]], first, lq_knots, found);
                    }) {
                        if parts.is_abandoned() {
                            return; // another thread has panicked, and `join` passes its panic on
                        } else if tried > 0 {
                            tried -= 1;
                            groups.derive(tried, &mut *models[owners[tried]]);
                        } else {
                            pause();
                        }
                    }
                }
                (0..parts.count()).for_each(|group| _ = groups.finish(group, &mut own[0]));
            },
            || groups.spread(of, gains),
        );
    }
}

/// Trajectory and indices of the knots before the terminal one, which all threads read.
#[derive(Clone, Copy)]
pub(super) struct Knots<'a> {
    /// Indices of the knots.
    pub(super) knots: &'a [usize],
    /// States of all knots; the next field contains the controls.
    pub(super) xs: &'a [f64],
    pub(super) us: &'a [f64],
    /// Number of entries of a state.
    pub(super) nx: usize,
    /// Offset of the controls of each knot.
    pub(super) offsets: &'a [usize],
    /// Kind of derivatives to compute.
    pub(super) what: Evaluation<'a>,
}

/// Groups of knots on which all threads work.
#[derive(Clone, Copy)]
struct Groups<'a> {
    parts: &'a Parts<'a, LqKnot, KnotFeedback>,
    owners: &'a [usize],
    knots: Knots<'a>,
}

impl Groups<'_> {
    /// Computes the derivatives at the knots of a group, with `model`. Does nothing if another thread computes them.
    fn derive(self, group: usize, model: &mut dyn ActionModel) {
        let Knots { knots, xs, us, nx, offsets, what } = self.knots;
        self.parts.work(group, DERIVE, |first, lq_knots, _| {
            let end = first + lq_knots.len();
            let (xs, us) = (&xs[first * nx..end * nx], &us[offsets[first]..offsets[end]]);
            let what = what.part(first..end, offsets.len() - 1);
            evaluate(model, &knots[first..end], xs, us, what, &mut Results::derivatives(lq_knots));
        });
    }

    /// Writes the deferred gains of a group, if the group has been swept and no other thread writes its gains. Returns
    /// whether this thread wrote them.
    fn finish(self, group: usize, gains: &mut Gains) -> bool {
        self.parts.work(group, FINISH, |_, lq_knots, found| gains.finish(lq_knots, found))
    }

    /// Distributes the groups over several threads, each with its own copies of the actions. Returns when no group is
    /// left.
    fn spread(self, copies: &mut [Vec<Option<Box<dyn ActionModel>>>], gains: &mut [Gains]) {
        let ([copies], [gains]) = (&mut *copies, &mut *gains) else {
            let half = copies.len() / 2;
            let ((some, others), (first, second)) = (copies.split_at_mut(half), gains.split_at_mut(half));
            return join(|| self.spread(some, first), || self.spread(others, second));
        };
        for group in (0..self.parts.count()).rev() {
            if let Some(copy) = &mut copies[self.owners[group]] {
                self.derive(group, &mut **copy);
            }
        }
        for group in (0..self.parts.count()).rev() {
            let mut patience = PATIENCE;
            while !self.finish(group, gains) && self.parts.awaits(group, FINISH) {
                if patience == 0 || self.parts.is_abandoned() {
                    return;
                }
                patience -= 1;
                pause();
            }
        }
    }
}
