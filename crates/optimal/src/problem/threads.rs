//! Derivatives of a horizon on several threads, each with its own copies of the actions, concurrent with the sweep.
//!
//! A group has as many knots as its model has lanes. From the end of the horizon to its beginning, each group passes
//! through three steps. The first free thread computes the derivatives of the group. The calling thread sweeps the
//! group; while it waits for derivatives, it computes derivatives itself. An idle thread computes the gains of the
//! group.

use super::action::ActionModel;
use super::group::{Evaluation, Results, evaluate};
use super::models::{Models, reserve};
use crate::lq::{Gains, KnotFeedback, LqKnot};
use condyle_linalg::threads::{Parts, join, pause};
use core::ops::Range;
use core::sync::atomic::AtomicU8;

/// Steps that each group passes through.
const DERIVE: u8 = 0;
const SWEEP: u8 = 1;
const FINISH: u8 = 2;

/// Number of idle polls (a few ms) after which a helper thread returns and leaves the rest to the sweeping thread. Thus
/// no thread waits for ever, even if other work occupies the pool.
const PATIENCE: usize = 4096;

/// Copies of actions for threads, and the groups of knots that the copies compute.
#[derive(Default)]
pub(crate) struct Copies {
    /// Copy of each model, for each thread except the first one.
    of: Vec<Vec<Option<Box<dyn ActionModel>>>>,
    /// First knot of each group, and the end of the horizon.
    cuts: Vec<usize>,
    /// Index of the action of each group.
    owners: Vec<usize>,
    /// Scratch for [`Parts`].
    states: Vec<AtomicU8>,
}

impl Copies {
    /// Returns the copies for the second thread, if they exist.
    pub(super) fn first(&mut self) -> Option<&mut [Option<Box<dyn ActionModel>>]> {
        self.of.first_mut().map(Vec::as_mut_slice)
    }

    /// Drops the copies of an action that may have changed, or that is new.
    pub(crate) fn forget(&mut self, action: usize) {
        for copies in &mut self.of {
            copies.resize_with(copies.len().max(action + 1), || None);
            copies[action] = None;
        }
    }

    /// Notifies the copies that the horizon has moved by one knot.
    pub(crate) fn shift(&mut self) {
        self.of.iter_mut().flatten().flatten().for_each(|copy| copy.shift());
    }

    /// Assigns knot t, of `horizon` knots, to a model that an action represents.
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
            for (copy, model) in copies.iter_mut().zip(models) {
                if copy.is_none() {
                    *copy = model.try_clone();
                    copy.iter_mut().for_each(|copy| reserve(&mut **copy));
                }
            }
        }
    }

    /// Computes the groups of knots. They are counted from the start of a run of knots, as on a single thread.
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
    /// groups to `sweep`, from the last to the first, each with its model and the index of its first knot. Deferred
    /// gains are written afterwards. Models that cannot be copied are evaluated on the calling thread only.
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
                let mut tried = parts.count(); // this thread has tried to derive all groups from this index on
                for group in (0..parts.count()).rev() {
                    while !parts.work(group, SWEEP, |first, lq_knots, found| {
                        sweep(&*models[owners[group]], first, lq_knots, found);
                    }) {
                        if parts.is_abandoned() {
                            return; // another thread has panicked, so this thread will panic too
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

/// Knots before the terminal one, as read by all threads.
#[derive(Clone, Copy)]
pub(super) struct Knots<'a> {
    /// Indices of the knots.
    pub(super) knots: &'a [usize],
    /// States and controls.
    pub(super) xs: &'a [f64],
    pub(super) us: &'a [f64],
    /// Number of entries of a state.
    pub(super) nx: usize,
    /// Offset of the controls of each knot.
    pub(super) offsets: &'a [usize],
    /// Kind of derivatives.
    pub(super) what: Evaluation<'a>,
}

/// Groups of knots, as all threads use them.
#[derive(Clone, Copy)]
struct Groups<'a> {
    parts: &'a Parts<'a, LqKnot, KnotFeedback>,
    owners: &'a [usize],
    knots: Knots<'a>,
}

impl Groups<'_> {
    /// Computes the derivatives at the knots of a group, by its model or a copy, unless another thread computes them.
    fn derive(self, group: usize, model: &mut dyn ActionModel) {
        let Knots { knots, xs, us, nx, offsets, what } = self.knots;
        self.parts.work(group, DERIVE, |first, lq_knots, _| {
            let end = first + lq_knots.len();
            let (xs, us) = (&xs[first * nx..end * nx], &us[offsets[first]..offsets[end]]);
            let what = what.part(first..end, offsets.len() - 1);
            evaluate(model, &knots[first..end], xs, us, what, &mut Results::derivatives(lq_knots));
        });
    }

    /// Writes the deferred gains of a group, and returns true, if the group has been swept and no other thread writes
    /// its gains.
    fn finish(self, group: usize, gains: &mut Gains) -> bool {
        self.parts.work(group, FINISH, |_, lq_knots, found| gains.finish(lq_knots, found))
    }

    /// Lets several threads work on the groups, each thread with its own copies of the actions, until no group is left.
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
