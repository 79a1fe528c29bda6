//! The derivatives of a horizon on several threads, each with its own copies of the actions.

use super::action::ActionModel;
use crate::lq::LqNode;
use condyle_linalg::threads;
use core::ops::Range;

/// Copies of actions for threads, and which thread computes which knots.
#[derive(Default)]
pub(crate) struct Copies {
    /// The copy of each model, for each thread beside the first one.
    of: Vec<Vec<Option<Box<dyn ActionModel>>>>,
    /// Whether a model has copies.
    copied: Vec<bool>,
    /// The first knot of each thread, and the end of the horizon.
    cuts: Vec<usize>,
}

impl Copies {
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
        self.copied.resize(models.len(), false);
        for copies in &mut self.of {
            for ((copy, copied), model) in copies.iter_mut().zip(&mut self.copied).zip(models) {
                if copy.is_none() {
                    *copy = model.fork();
                    copy.iter_mut().for_each(|copy| copy.reserve());
                }
                *copied = copy.is_some();
            }
        }
    }

    /// Shares the groups of knots of the models with copies among `threads` threads: as many knots as a model has lanes,
    /// counted from the start of a run, as one thread counts them.
    fn share(&mut self, threads: usize, models: &[Box<dyn ActionModel>], runs: &[(usize, Range<usize>)]) {
        let Self { copied, cuts, .. } = self;
        let lanes = |model: usize| models[model].lanes().max(1);
        let groups = |model: usize, run: &Range<usize>| usize::from(copied[model]) * run.len().div_ceil(lanes(model));
        let total: usize = runs.iter().map(|(model, run)| groups(*model, run)).sum();
        let horizon = runs.last().map_or(0, |(_, run)| run.end);
        cuts.clear();
        cuts.push(0);
        for thread in 1..threads {
            let (mut group, mut cut) = (total * thread / threads, horizon);
            for (model, run) in runs {
                let here = groups(*model, run);
                if group < here {
                    cut = run.start + group * lanes(*model);
                    break;
                }
                group -= here;
            }
            cuts.push(cut);
        }
        cuts.push(horizon);
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

    /// The derivatives at all knots on `threads` threads, the first of which also does `last`. The knots of models without a
    /// copy come after the others, on one thread.
    pub(super) fn calc_diff(
        &mut self,
        threads: usize,
        models: &mut [Box<dyn ActionModel>],
        knots: Knots<'_>,
        nodes: &mut [LqNode],
        last: impl FnOnce() + Send,
    ) {
        self.renew(threads, models);
        self.share(threads, models, knots.runs);
        let Self { of, copied, cuts } = self;
        let (own, others) = nodes.split_at_mut(cuts[1]);
        threads::join(
            || {
                knots.visit(0..own.len(), own, |model, run, nodes| {
                    if copied[model] {
                        knots.derive(&mut *models[model], run, nodes);
                    }
                });
                last();
            },
            || knots.spread(&cuts[1..], of, others),
        );
        knots.visit(0..nodes.len(), nodes, |model, run, nodes| {
            if !copied[model] {
                knots.derive(&mut *models[model], run, nodes);
            }
        });
    }
}

/// The knots before the terminal one, as all threads read them.
#[derive(Clone, Copy)]
pub(super) struct Knots<'a> {
    /// Runs of knots with one model: (model, knots).
    pub(super) runs: &'a [(usize, Range<usize>)],
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

impl Knots<'_> {
    /// The derivatives at consecutive knots of one model; `nodes` are theirs.
    fn derive(self, model: &mut dyn ActionModel, knots: Range<usize>, nodes: &mut [LqNode]) {
        let xs = &self.xs[knots.start * self.nx..knots.end * self.nx];
        let us = &self.us[self.offsets[knots.start]..self.offsets[knots.end]];
        model.calc_diff_group(&self.knots[knots], xs, us, nodes);
    }

    /// Shows the runs in a part of the horizon, with their models; `nodes` are the part's.
    fn visit(self, part: Range<usize>, nodes: &mut [LqNode], mut f: impl FnMut(usize, Range<usize>, &mut [LqNode])) {
        for (model, run) in self.runs {
            let knots = run.start.max(part.start)..run.end.min(part.end);
            if !knots.is_empty() {
                f(*model, knots.clone(), &mut nodes[knots.start - part.start..knots.end - part.start]);
            }
        }
    }

    /// The parts between `cuts`, by the copies that each has; `nodes` are theirs.
    fn spread(self, cuts: &[usize], copies: &mut [Vec<Option<Box<dyn ActionModel>>>], nodes: &mut [LqNode]) {
        if let [copies] = copies {
            return self.visit(cuts[0]..cuts[1], nodes, |model, knots, nodes| {
                if let Some(copy) = &mut copies[model] {
                    self.derive(&mut **copy, knots, nodes);
                }
            });
        }
        let half = copies.len() / 2;
        let (some, others) = copies.split_at_mut(half);
        let (first, second) = nodes.split_at_mut(cuts[half] - cuts[0]);
        threads::join(|| self.spread(&cuts[..=half], some, first), || self.spread(&cuts[half..], others, second));
    }
}
