//! The derivatives of a horizon on several threads, each with its own copies of the actions, and the sweep beside them.
//!
//! Groups of knots, as many as a model has lanes, go through three stages, from the end of the horizon to its beginning:
//! their derivatives, by the thread that comes first; the sweep, by the calling thread, which computes derivatives itself
//! while those that it needs are not there; and their gains, by a thread that has nothing else to do.

use super::action::ActionModel;
use crate::lq::{Gains, LqKnot, LqNode};
use condyle_linalg::threads::{Parts, join, pause};
use core::ops::Range;
use core::sync::atomic::AtomicU8;

/// The stages of a group.
const DERIVE: u8 = 0;
const SWEEP: u8 = 1;
const FINISH: u8 = 2;

/// A thread that so often found nothing to do leaves what is left to the one that sweeps, some milliseconds: so none waits
/// for ever, whatever else shares the pool.
const PATIENCE: usize = 4096;

/// Copies of actions for threads, and the groups of knots that these compute.
#[derive(Default)]
pub(crate) struct Copies {
    /// The copy of each model, for each thread beside the first one.
    of: Vec<Vec<Option<Box<dyn ActionModel>>>>,
    /// The first knot of each group, and the end of the horizon.
    cuts: Vec<usize>,
    /// The model of each group.
    owners: Vec<usize>,
    /// Scratch for [`Parts`].
    states: Vec<AtomicU8>,
}

impl Copies {
    /// The copies that the first of the other threads has, as far as they were made.
    pub(super) fn first(&mut self) -> Option<&mut [Option<Box<dyn ActionModel>>]> {
        self.of.first_mut().map(Vec::as_mut_slice)
    }

    /// Drops the copies of a model that may change.
    pub(crate) fn forget(&mut self, model: usize) {
        for copy in self.of.iter_mut().filter_map(|copies| copies.get_mut(model)) {
            *copy = None;
        }
    }

    /// The horizon has moved on by a knot.
    pub(crate) fn shift(&mut self) {
        self.of.iter_mut().flatten().flatten().for_each(|copy| copy.shift());
    }

    /// Lets a model that an action stands for serve knot t of so many.
    pub(crate) fn serve(&mut self, action: usize, t: usize, horizon: usize, model: usize) {
        for copy in self.of.iter_mut().filter_map(|copies| copies[action].as_mut()) {
            copy.serve(t, horizon, model);
        }
    }

    /// Makes those that are missing of the models that can be copied, for `threads` threads in all.
    fn renew(&mut self, threads: usize, models: &[Box<dyn ActionModel>]) {
        self.of.resize_with(threads - 1, || models.iter().map(|_| None).collect());
        for copies in &mut self.of {
            for (copy, model) in copies.iter_mut().zip(models) {
                if copy.is_none() {
                    *copy = model.fork();
                    copy.iter_mut().for_each(|copy| copy.reserve());
                }
            }
        }
    }

    /// Finds the groups of knots: counted from the start of a run, as one thread counts them.
    fn group(&mut self, models: &[Box<dyn ActionModel>], runs: &[(usize, Range<usize>)]) {
        let Self { cuts, owners, .. } = self;
        cuts.clear();
        owners.clear();
        for (model, run) in runs {
            for knot in run.clone().step_by(models[*model].lanes().max(1)) {
                cuts.push(knot);
                owners.push(*model);
            }
        }
        cuts.push(runs.last().map_or(0, |(_, run)| run.end));
    }

    /// Gives copies the multipliers of their models.
    pub(super) fn share_multipliers(&mut self, models: &mut [Box<dyn ActionModel>], runs: &[(usize, Range<usize>)]) {
        for copies in &mut self.of {
            for (model, run) in runs {
                let Some(copy) = &mut copies[*model] else { continue };
                let mut k = 0;
                copy.constraints(run.start, &mut |theirs| {
                    let mut i = 0;
                    models[*model].constraints(run.start, &mut |ours| {
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

    /// The derivatives at all knots on as many threads as there is scratch in `gains`. This one shows the groups to `sweep`,
    /// from the last to the first, each with its model and the number of its first knot; the gains that are put off then are
    /// written. Models without a copy are asked on this thread alone.
    pub(super) fn calc_diff(
        &mut self,
        models: &mut [Box<dyn ActionModel>],
        runs: &[(usize, Range<usize>)],
        knots: Knots<'_>,
        nodes: &mut [LqNode],
        found: &mut [LqKnot],
        gains: &mut [Gains],
        mut sweep: impl FnMut(&dyn ActionModel, usize, &mut [LqNode], &mut [LqKnot]) + Send,
    ) {
        self.renew(gains.len(), models);
        self.group(models, runs);
        let Self { of, cuts, owners, states } = self;
        let groups = Groups { parts: &Parts::new(nodes, found, cuts, states), owners, knots };
        let (own, gains) = gains.split_at_mut(1);
        join(
            || {
                let parts = groups.parts;
                let mut tried = parts.count(); // this thread has tried to derive those from here on
                for group in (0..parts.count()).rev() {
                    while !parts.work(group, SWEEP, |first, nodes, found| {
                        sweep(&*models[owners[group]], first, nodes, found);
                    }) {
                        if parts.is_abandoned() {
                            return; // another thread panics, and so will this one
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

/// The knots before the terminal one, as all threads read them.
#[derive(Clone, Copy)]
pub(super) struct Knots<'a> {
    /// Their numbers.
    pub(super) knots: &'a [usize],
    /// The states, and the controls.
    pub(super) xs: &'a [f64],
    pub(super) us: &'a [f64],
    /// The number of entries of a state.
    pub(super) nx: usize,
    /// The place at which the controls of each knot start.
    pub(super) offsets: &'a [usize],
}

/// The groups of knots, as all threads see them.
#[derive(Clone, Copy)]
struct Groups<'a> {
    parts: &'a Parts<'a, LqNode, LqKnot>,
    owners: &'a [usize],
    knots: Knots<'a>,
}

impl Groups<'_> {
    /// The derivatives at the knots of a group, by its model or a copy of it, unless somebody computes them.
    fn derive(self, group: usize, model: &mut dyn ActionModel) {
        let Knots { knots, xs, us, nx, offsets } = self.knots;
        self.parts.work(group, DERIVE, |first, nodes, _| {
            let end = first + nodes.len();
            let (xs, us) = (&xs[first * nx..end * nx], &us[offsets[first]..offsets[end]]);
            model.calc_diff_group(&knots[first..end], xs, us, nodes);
        });
    }

    /// Writes the gains of a group that were put off, if it has been swept and nobody does; says whether it did.
    fn finish(self, group: usize, gains: &mut Gains) -> bool {
        self.parts.work(group, FINISH, |_, nodes, found| gains.finish(nodes, found))
    }

    /// Lets each of some threads, by the copies that it has, work on groups until there are none left.
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
