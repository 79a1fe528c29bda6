//! Rollouts of several trials in one group: several step lengths of one problem, or trials of several problems.

#![allow(non_snake_case)] // names follow the literature: K, k

use super::iterate::{Iterate, Sum};
use super::solution::Solution;
use crate::lq::{DIVERGED, KnotFeedback};
use crate::problem::{ActionModel, ActionView, Evaluation, Problem, Results, Shape, evaluate, evaluate_across};
use condyle_linalg::{View, add_scaled_product, dot};
use core::ops::RangeInclusive;
use nalgebra::{DMatrix, DVector};

/// Trial trajectories that are rolled out together, each with a step length. At each knot, one group call evaluates all
/// trials. The trials are stored knot after knot and, within a knot, trial after trial.
#[derive(Debug, Clone)]
pub(super) struct Trials {
    shape: Shape,
    /// Number of trials of the last run; at most `width`.
    count: usize,
    width: usize,
    xs: Vec<f64>,
    us: Vec<f64>,
    /// Next states φₜ(xₜ, uₜ) of N knots. Each next state differs from the state of the next knot by the remaining gap.
    next: Vec<f64>,
    /// Accelerations and forces of each knot, in parts of equal length.
    motions: Vec<f64>,
    motion_size: usize,
    /// Sum of the costs of each trial; meaningless for a trial with `failed`.
    costs: Vec<Sum>,
    /// Whether each trial has diverged.
    failed: Vec<bool>,
    knot_costs: Vec<f64>,
    knot: Vec<usize>,
    dx: Vec<f64>,
    /// Output buffer for the next state of a terminal action, which is never read.
    unread: Vec<f64>,
}

/// Trajectory from which trials start, and the feedback that gives the direction of their steps.
#[derive(Clone, Copy)]
pub(super) struct Nominal<'a> {
    pub(super) xs: &'a [f64],
    pub(super) us: &'a [f64],
    /// Gaps f₀ = x̂₀ ⊖ x₀, fₜ₊₁ = φₜ ⊖ xₜ₊₁, flat; `None` without gaps.
    pub(super) gaps: Option<&'a [f64]>,
    pub(super) gains: NominalGains<'a>,
}

/// Gains K and k of the feedback, in the results of a sweep or in a solution.
#[derive(Clone, Copy)]
pub(super) enum NominalGains<'a> {
    Swept(&'a [KnotFeedback]),
    Stored(&'a [DMatrix<f64>], &'a [DVector<f64>]),
}

impl<'a> NominalGains<'a> {
    /// Returns K and k of knot t, column after column; empty at the terminal knot.
    fn at(self, t: usize) -> [&'a [f64]; 2] {
        match self {
            Self::Swept(feedback) => [feedback[t].K.as_slice(), feedback[t].k.as_slice()],
            Self::Stored(K, k) => [K.get(t).map_or(&[], |K| K.as_slice()), k.get(t).map_or(&[], |k| k.as_slice())],
        }
    }
}

impl<'a> Nominal<'a> {
    /// Returns the trajectory of an iterate with its feedback, and with its gaps if `counts_gaps`.
    pub(super) fn of(iterate: &'a Iterate, feedback: &'a [KnotFeedback], counts_gaps: bool) -> Self {
        Self { gains: NominalGains::Swept(feedback), ..Self::stored(iterate, counts_gaps) }
    }

    /// Returns the trajectory as [`of`](Self::of) does, with the gains that are stored in the solution.
    pub(super) fn stored(iterate: &'a Iterate, counts_gaps: bool) -> Self {
        let Iterate { solution: Solution { xs, us, K, k, .. }, gaps, .. } = iterate;
        Self { xs, us, gaps: counts_gaps.then_some(&gaps[..]), gains: NominalGains::Stored(K, k) }
    }
}

/// Problems to which the trials of a group belong.
pub(super) trait TrialProblems {
    /// Returns the trajectory from which trial `i` starts, with its feedback.
    fn nominal(&self, i: usize) -> Nominal<'_>;

    /// Returns the actions of the problem of trial `i`.
    fn view(&self, i: usize) -> &ActionView<'_>;

    /// Evaluates knot t of all trials; `knots` contains t once for each trial.
    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], results: &mut Results<'_>);
}

/// Problem to which all trials of a group belong. The trials start from one trajectory.
pub(super) struct OneProblem<'a, 'v> {
    pub(super) view: &'a mut ActionView<'v>,
    pub(super) nominal: Nominal<'a>,
}

impl TrialProblems for OneProblem<'_, '_> {
    fn nominal(&self, _: usize) -> Nominal<'_> {
        self.nominal
    }

    fn view(&self, _: usize) -> &ActionView<'_> {
        self.view
    }

    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], results: &mut Results<'_>) {
        evaluate(self.view.action_mut(knots[0]), knots, xs, us, Evaluation::Values, results);
    }
}

/// Problems of one shape, to each of which some trials of a group belong.
pub(super) struct SeveralProblems<'a> {
    /// Actions and trajectory of each problem.
    pub(super) problems: Vec<(ActionView<'a>, Nominal<'a>)>,
    /// Index of each trial's problem.
    pub(super) of: Vec<usize>,
}

impl TrialProblems for SeveralProblems<'_> {
    fn nominal(&self, i: usize) -> Nominal<'_> {
        self.problems[self.of[i]].1
    }

    fn view(&self, i: usize) -> &ActionView<'_> {
        &self.problems[self.of[i]].0
    }

    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], results: &mut Results<'_>) {
        let t = knots[0];
        let mut actions: Vec<&mut dyn ActionModel> =
            self.problems.iter_mut().map(|(view, _)| view.action_mut(t)).collect();
        evaluate_across(&mut actions, &self.of, t, xs, us, results);
    }
}

impl Trials {
    /// Allocates the storage for `width` trials of `problem`.
    pub(super) fn new(problem: &Problem, width: usize) -> Self {
        let shape = problem.shape().clone();
        let horizon = shape.horizon();
        Self {
            count: 0,
            width,
            xs: vec![0.0; (horizon + 1) * shape.nx * width],
            us: vec![0.0; shape.offsets[horizon] * width],
            next: vec![0.0; horizon * shape.nx * width],
            motions: Vec::new(),
            motion_size: 0,
            costs: vec![Sum::default(); width],
            failed: vec![false; width],
            knot_costs: vec![0.0; width],
            knot: vec![0; width],
            dx: vec![0.0; shape.ndx],
            unread: vec![0.0; shape.nx * width],
            shape,
        }
    }

    /// Adapts the storage to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.shape.clone_from(problem.shape());
        self.us.resize(self.shape.offsets[self.shape.horizon()] * self.width, 0.0);
    }

    /// Sets the number of accelerations and forces of each knot that the next runs store.
    pub(super) fn keep_motions(&mut self, size: usize) {
        self.motion_size = size;
        self.motions.resize(self.shape.horizon() * self.width * size, 0.0);
    }

    /// Returns the maximum number of trials.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Rolls out one trial per step length α. Trial i belongs to a problem of `problems`:
    ///
    /// x₀ = x̂₀ ⊕ (α − 1) f₀,   uₜ = ūₜ + α kₜ + Kₜ (xₜ ⊖ x̄ₜ),   xₜ₊₁ = φₜ(xₜ, uₜ) ⊕ (α − 1) fₜ₊₁
    ///
    /// with uₜ moved into its bounds. The range of `knots` begins at the first knot, or continues where the last call
    /// ended.
    pub(super) fn run(&mut self, problems: &mut impl TrialProblems, steps: &[f64], knots: RangeInclusive<usize>) {
        let Self { shape, xs, us, next, motions, costs, failed, knot_costs, knot, dx, unread, .. } = self;
        let size = self.motion_size;
        let (nx, horizon, count) = (shape.nx, shape.horizon(), steps.len());
        if *knots.start() == 0 {
            self.count = count;
            costs[..count].fill(Sum::default());
            failed[..count].fill(false);
        }
        for t in knots {
            let nu = shape.nu(t);
            let (done, ahead) = next.split_at_mut(t * nx * count);
            let x_all = &mut xs[t * nx * count..][..nx * count];
            let u_all = &mut us[shape.offsets[t] * count..][..nu * count];
            for (i, &step) in steps.iter().enumerate() {
                let (x, u) = (&mut x_all[i * nx..][..nx], &mut u_all[i * nu..][..nu]);
                let (nominal, view) = (problems.nominal(i), problems.view(i));
                let (x_nominal, u_nominal) = (&nominal.xs[shape.x(t)], &nominal.us[shape.u(t)]);
                u.copy_from_slice(u_nominal);
                if failed[i] {
                    x.copy_from_slice(x_nominal); // a valid state, at which the group call evaluates the action
                    continue;
                }
                let action = view.action(t);
                let predicted = if t == 0 { view.x0() } else { &done[((t - 1) * count + i) * nx..][..nx] };
                match nominal.gaps {
                    Some(gaps) if step != 1.0 => {
                        for (dx, f) in dx.iter_mut().zip(&gaps[shape.dx(t)]) {
                            *dx = (step - 1.0) * f;
                        }
                        action.integrate(predicted, dx, x);
                    }
                    _ => x.copy_from_slice(predicted),
                }
                action.difference(x_nominal, x, dx);
                let [K, k] = nominal.gains.at(t);
                add_scaled_product(u, step, View::new(k, nu), &[1.0]); // u += α k + K δx
                add_scaled_product(u, 1.0, View::new(K, nu), dx);
                if let Some((lower, upper)) = action.bounds(t) {
                    for (u, (lower, upper)) in u.iter_mut().zip(lower.iter().zip(upper)) {
                        *u = if *u < *lower { *lower } else { *u }; // unlike `max`, this keeps a NaN
                        *u = if *u > *upper { *upper } else { *u };
                    }
                }
            }
            knot[..count].fill(t);
            let next_all = if t < horizon { &mut ahead[..nx * count] } else { &mut unread[..nx * count] };
            let (knot, costs_all) = (&knot[..count], &mut knot_costs[..count]);
            let motions = if t < horizon { &mut motions[t * size * count..][..size * count] } else { &mut [] };
            let mut results = Results::values(next_all, costs_all, motions);
            problems.evaluate(knot, x_all, u_all, &mut results);
            for i in 0..count {
                costs[i].add(knot_costs[i]);
                let bounded = |x: f64| x.abs() < DIVERGED; // false for NaN
                let finite = |x: &[f64]| x.iter().all(|x| bounded(*x));
                failed[i] |= !(bounded(costs[i].value()) && (t == horizon || finite(&next_all[i * nx..][..nx])));
            }
        }
    }

    /// Returns the cost of trial `i`, or `None` if the trial diverged.
    pub(super) fn cost(&self, i: usize) -> Option<f64> {
        (!self.failed[i]).then_some(self.costs[i].value())
    }

    /// Computes −Σ bᵀ (x ⊖ x_trial) for trial `i`. The sum is over all knots, with the states x in `xs` and the vectors
    /// b in `b`, both flat.
    pub(super) fn distance(&mut self, view: &ActionView<'_>, i: usize, xs: &[f64], b: &[f64]) -> f64 {
        let mut dx = std::mem::take(&mut self.dx);
        let mut sum = 0.0;
        for t in 0..=self.shape.horizon() {
            view.action(t).difference(self.x(i, t), &xs[self.shape.x(t)], &mut dx);
            sum -= dot(&b[self.shape.dx(t)], &dx);
        }
        self.dx = dx;
        sum
    }

    /// Returns the state xₜ of trial `i`.
    fn x(&self, i: usize, t: usize) -> &[f64] {
        &self.xs[(t * self.count + i) * self.shape.nx..][..self.shape.nx]
    }

    /// Copies trial `i`, except its cost, to the iterate.
    pub(super) fn copy_to(&self, i: usize, to: &mut Iterate) {
        let Iterate { solution: Solution { xs, us, .. }, next, motions, .. } = to;
        for t in 0..=self.shape.horizon() {
            xs[self.shape.x(t)].copy_from_slice(self.x(i, t));
        }
        for t in 0..self.shape.horizon() {
            let (nx, nu) = (self.shape.nx, self.shape.nu(t));
            let u = self.shape.offsets[t] * self.count + i * nu;
            us[self.shape.u(t)].copy_from_slice(&self.us[u..u + nu]);
            next[self.shape.x(t)].copy_from_slice(&self.next[(t * self.count + i) * nx..][..nx]);
        }
        let size = self.motion_size;
        for (t, motion) in motions.chunks_exact_mut(size.max(1)).enumerate() {
            motion.copy_from_slice(&self.motions[(t * self.count + i) * size..][..size]);
        }
    }
}
