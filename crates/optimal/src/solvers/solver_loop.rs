//! Loop that all solvers share. The loop repeats derivatives, a sweep and a line search until there is a reason to
//! stop.
//!
//! A solve [begins](SolverLoop::begin) from a trajectory and makes one or more [passes](SolverLoop::pass). A pass
//! iterates on one cost. A solver with an outer method, such as an augmented Lagrangian, changes the cost between
//! passes. All passes of a solve share the clock, the observer and the timings.
#![allow(non_snake_case)] // names follow the literature: K, k

use super::best::{Best, Merit};
use super::iterate::Iterate;
use super::prepared::Prepared;
use super::retime::Retiming;
use super::search::{LineSearch, Search, Surroundings};
use super::settings::{DdpMethod, Settings};
use super::solution::{Iteration, Solution, Status, Timings};
use super::watch::{Clock, Phase, Watch};
use crate::error::Error;
use crate::lq::{LqKnot, Sweep, SweepError};
use crate::problem::{ActionModel, Problem};
use crate::time::Instant;
use std::ops::Range;
use std::time::Duration;

/// Number of iterations for which a solve allocates the trace at its beginning; the trace grows if more are made.
const FORESEEN: usize = 10_000;

/// Iterate of a solver, the linear-quadratic problem around it, and the workspace of an iteration.
#[derive(Debug, Clone)]
pub(super) struct SolverLoop {
    pub(super) iterate: Iterate,
    /// Linear-quadratic problem at the iterate.
    pub(super) knots: Vec<LqKnot>,
    pub(super) sweep: Sweep,
    pub(super) line_search: LineSearch,
    /// Best iterate; it becomes the solution if the last iterate is worse.
    pub(super) best: Best,
    pub(super) clock: Clock,
    /// Whether this solve uses the inverse-dynamics form of knots, where actions support it.
    inverse_dynamics: bool,
    /// Whether some control has a bound.
    bounded: bool,
    /// Whether the solver has a trajectory from which a solve can resume.
    pub(super) started: bool,
    /// Whether a warm start or a solve has set the trajectory since the last shift. If not, the next shift repeats the
    /// last state.
    pub(super) renewed: bool,
    /// Old plan of a retiming.
    pub(super) retiming: Retiming,
    /// First half of an iteration, which a state completes.
    pub(super) prepared: Option<Prepared>,
}

/// Options of a pass that the calling solver sets, in addition to the settings.
#[derive(Clone, Copy, Default)]
pub(super) struct Pass {
    /// Tolerance that replaces the tolerance in the settings; `None` for the tolerance in the settings.
    pub(super) tolerance: Option<f64>,
    /// Whether a warm start without gaps counts as feasible if a control lies on its bound. In Crocoddyl such a warm
    /// start is not feasible, so the bounds only clamp trials until the first full step. If bounds are active, the full
    /// step may never be accepted.
    pub(super) trusts_start: bool,
    /// Whether the pass continues the last solve. If not, the pass starts from a warm start or follows an earlier pass
    /// of the same solve.
    pub(super) resumes: bool,
    /// Maximum number of iterations of a pass that ends when a step of length 1 is accepted; `None` for a pass that
    /// makes up to [`Settings::max_iterations`].
    pub(super) to_full_step: Option<usize>,
    /// Whether the pass continues the last pass of the same solve, on the same cost. The regularisation then continues
    /// if the last step was rejected.
    pub(super) continues: bool,
}

impl Pass {
    /// Returns the maximum number of iterations.
    pub(super) fn most(self, settings: &Settings) -> usize {
        self.to_full_step.unwrap_or(settings.max_iterations)
    }
}

/// Variables that one iteration passes to the next.
#[derive(Debug, Clone)]
pub(super) struct Progress {
    /// Merit of the iterate.
    pub(super) merit: Merit,
    /// Whether the iterate before the last accepted step was feasible.
    was_feasible: bool,
    /// Whether this pass has computed gains.
    swept: bool,
    /// Whether the last sweep of this pass computed the gains at the best iterate, because the last step started from
    /// that iterate.
    swept_best: bool,
}

impl SolverLoop {
    /// Allocates the workspace for problems with the dimensions of `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        Self::with(problem, Self::knots_of(problem), problem.lanes())
    }

    /// Allocates a workspace without storage for derivatives and sweeps, and with storage for one trial.
    pub(super) fn for_batch(problem: &Problem) -> Self {
        Self::with(problem, vec![LqKnot::zeros(problem.ndx(), 0)], 1)
    }

    /// Allocates the LQ knots of `problem`.
    pub(super) fn knots_of(problem: &Problem) -> Vec<LqKnot> {
        let mut knots = problem.lq_knots();
        problem.reserve_inverse_dynamics(&mut knots);
        knots
    }

    /// Allocates the workspace, with the given LQ knots and storage for `width` trials.
    fn with(problem: &Problem, knots: Vec<LqKnot>, width: usize) -> Self {
        Self {
            iterate: Iterate::new(problem),
            sweep: Sweep::new(&knots),
            knots,
            line_search: LineSearch::new(problem, width),
            best: Best::new(problem),
            clock: Clock::default(),
            inverse_dynamics: false,
            bounded: false,
            started: false,
            renewed: false,
            retiming: Retiming::default(),
            prepared: None,
        }
    }

    /// Returns the mean number of bytes that a sweep reads from a knot before the terminal one.
    pub(super) fn bytes_per_knot(&self) -> usize {
        let horizon = self.knots.len() - 1;
        self.knots[..horizon].iter().map(LqKnot::bytes).sum::<usize>() / horizon.max(1)
    }

    /// Begins an attempt to solve `problem`, from a warm start if one is given, else from the last trajectory.
    ///
    /// # Errors
    /// The errors of [`Fddp::solve`](crate::Fddp::solve).
    pub(super) fn begin(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        warm_start: Option<[&[f64]; 2]>,
    ) -> Result<(), Error> {
        let solution = &mut self.iterate.solution;
        self.prepared = None;
        if let Some([xs, us]) = warm_start {
            solution.shape().check(problem.shape())?;
            Error::check("xs", xs, solution.xs.len())?;
            Error::check("us", us, solution.us.len())?;
            for (knot, x) in xs.chunks_exact(problem.nx()).enumerate() {
                problem.action(knot).check_state(x).map_err(|what| Error::State { name: "xs", knot, what })?;
            }
            solution.xs.copy_from_slice(xs);
            solution.us.copy_from_slice(us);
            (self.started, self.renewed) = (true, true);
        } else if !self.started {
            return Err(Error::NothingToResume);
        }
        settings.check()?;
        solution.shape().check(problem.shape())?;
        solution.fallback = None;
        if self.knots[0].inverse_dynamics.stride == 0 && problem.reserve_inverse_dynamics(&mut self.knots) {
            self.sweep = Sweep::new(&self.knots); // `new` was called with a problem without inverse-dynamics form
        }
        self.bounded = problem.check_bounds()?;
        self.inverse_dynamics = settings.inverse_dynamics_form && !self.bounded && !settings.second_order;
        Ok(())
    }

    /// Starts the clock and the timings of a solve.
    pub(super) fn start_clock(&mut self, settings: &Settings, watch: &Watch<'_>) {
        self.iterate.solution.timings = Timings::default();
        self.clock.start(watch.begin, settings.time_budget);
    }

    /// Iterates from the current trajectory until there is a reason to stop, and then completes the solution.
    pub(super) fn pass(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        pass: Pass,
        watch: &mut Watch<'_>,
    ) -> Status {
        let mut now = self.start_pass(problem, settings, pass);
        let status = self.make_iterations(problem, settings, pass, &mut now, None, watch);
        self.clock.end_guarantee();
        self.finish(problem, settings, now, status);
        status
    }

    /// Evaluates the current trajectory, from which a pass starts.
    pub(super) fn start_pass(&mut self, problem: &mut Problem, settings: &Settings, pass: Pass) -> Progress {
        let solution = &mut self.iterate.solution;
        if self.bounded && settings.project_warm_start {
            solution.project(problem, 0..problem.horizon());
        }
        let start = settings.regularisation_start;
        let kept = pass.resumes || pass.continues;
        let regularisation = if kept { solution.resumed_regularisation(start) } else { start };
        solution.trace.clear();
        solution.trace.reserve(pass.most(settings).min(FORESEEN));
        let motion_size = if self.inverse_dynamics { problem.motion_size() } else { 0 };
        self.iterate.motions.resize(problem.horizon() * motion_size, 0.0);
        self.line_search.start(problem, settings.step_lengths, motion_size, settings.threads);
        self.sweep.set_segments(settings.segments);
        self.sweep.forget();
        self.best.start();
        let last_cost = self.iterate.solution.cost;
        let mut gap = self.iterate.evaluate(problem);
        if pass.resumes {
            gap = self.recover(problem, settings, gap, last_cost);
        }
        let Solution { cost, .. } = self.iterate.solution;
        let bounded = !self.bounded || self.iterate.solution.is_bounded(problem);
        let feasible = self.bounded && pass.trusts_start && gap == 0.0 && self.iterate.solution.touches_bounds(problem);
        let merit = Merit { gap, cost, feasible, bounded, steps: 0, regularisation };
        Progress { merit, was_feasible: false, swept: false, swept_best: false }
    }

    /// Ends a solve: completes its timings, and returns the solution.
    pub(super) fn end(&mut self, settings: &Settings, watch: &Watch<'_>) -> &Solution {
        self.iterate.solution.timings.end(watch.begin.elapsed(), settings.time_budget);
        &self.iterate.solution
    }

    /// Makes iterations until there is a reason to stop. The first iteration has the search direction `direction`, if
    /// it is given.
    pub(super) fn make_iterations(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        pass: Pass,
        now: &mut Progress,
        mut direction: Option<Result<(), Status>>,
        watch: &mut Watch<'_>,
    ) -> Status {
        if !now.is_finite() {
            return Status::NotFinite;
        }
        let mut search = Search::default();
        for iteration in 0..pass.most(settings) {
            let known = direction.take();
            if let Err(status) =
                self.begin_iteration(problem, settings, now, [iteration == 0, search.accepted], known, watch)
            {
                return status;
            }
            search = self.search(problem, settings, now, search, watch);
            if let Some(status) = self.end_iteration(settings, pass, now, iteration, &search, watch) {
                return status;
            }
        }
        Status::MaxIterations
    }

    /// Makes the first half of an iteration: finds the search direction, unless it is `known`. `[first, moved]` are
    /// whether this is the first iteration of a pass, and whether the last iteration accepted a step.
    ///
    /// # Errors
    /// The reason to stop.
    pub(super) fn begin_iteration(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut Progress,
        [first, moved]: [bool; 2],
        known: Option<Result<(), Status>>,
        watch: &mut Watch<'_>,
    ) -> Result<(), Status> {
        if moved {
            now.merit.gap = self.iterate.update_gaps(problem);
        }
        known.unwrap_or_else(|| self.find_direction(problem, settings, now, first || moved, watch))
    }

    /// Makes the line search of an iteration; `last` is the search of the iteration before.
    fn search(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &Progress,
        last: Search,
        watch: &mut Watch<'_>,
    ) -> Search {
        let (line_search, around, clock) = self.surroundings(settings, now);
        line_search.run(problem, around, last, clock, watch)
    }

    /// Returns the line search, the iterate with its feedback, and the clock.
    pub(super) fn surroundings<'a>(
        &'a mut self,
        settings: &'a Settings,
        now: &Progress,
    ) -> (&'a mut LineSearch, Surroundings<'a>, &'a mut Clock) {
        let Self { iterate, line_search, best, sweep, clock, .. } = self;
        let (merit, feedback) = (now.merit, sweep.feedback());
        (line_search, Surroundings { iterate, merit, best, feedback, settings }, clock)
    }

    /// Ends an iteration after its line search: updates the progress, and adds the iteration to the trace. Returns the
    /// reason to stop, if there is one.
    pub(super) fn end_iteration(
        &mut self,
        settings: &Settings,
        pass: Pass,
        now: &mut Progress,
        iteration: usize,
        search: &Search,
        watch: &mut Watch<'_>,
    ) -> Option<Status> {
        if search.stopped.is_some() {
            return search.stopped;
        }
        let usual = if self.bounded { settings.tolerance_bounded } else { settings.tolerance };
        let tolerance = pass.tolerance.unwrap_or(usual);
        now.advance(search, settings, self.iterate.solution.cost);
        let Merit { gap, cost, feasible, regularisation, .. } = now.merit;
        let Search { step, d1, d2, decrease, expected_decrease, accepted, .. } = *search;
        let stop = (d1 + 0.5 * d2).abs(); // expected decrease for α = 1
        let record = Iteration {
            iteration,
            cost,
            gap,
            stop,
            step,
            regularisation,
            d1,
            d2,
            decrease,
            expected_decrease,
            feasible,
            accepted,
        };
        self.iterate.solution.trace.push(record);
        self.clock.end_guarantee();
        let verdict = watch.iteration(&record);
        if regularisation == settings.regularisation_max {
            Some(Status::RegularisationLimit)
        } else if now.was_feasible && stop < tolerance {
            Some(Status::Converged)
        } else if verdict.is_break() {
            Some(Status::Interrupted)
        } else if pass.to_full_step.is_some() && accepted && step == 1.0 {
            Some(Status::FullStep)
        } else {
            None
        }
    }

    /// Computes the derivatives, if the iterate is new, and then the feedback by a sweep. The sweep is repeated with a
    /// larger regularisation while a block Quu is not positive definite.
    ///
    /// # Errors
    /// The reason to stop, if no direction was found or no time is left.
    pub(super) fn find_direction(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut Progress,
        is_new: bool,
        watch: &mut Watch<'_>,
    ) -> Result<(), Status> {
        let Merit { feasible, .. } = now.merit;
        self.sweep.keep_values(false);
        let mut swept = None;
        if is_new {
            let phases = [Phase::CalcDiff, Phase::Sweep];
            self.clock.allows(&phases[..1 + usize::from(self.follows(settings))], watch)?;
            swept = self.calc_diff(problem, settings, feasible, now.merit.regularisation);
        }
        if swept.is_none() {
            self.clock.allows(&[Phase::Sweep], watch)?;
        }
        now.swept_best = false;
        while let Err(error) = swept.take().unwrap_or_else(|| self.sweep(problem, settings, now.merit.regularisation)) {
            assert!(!matches!(error, SweepError::ConstraintRows { .. }), "{error}");
            now.merit.regularisation = settings.increased(now.merit.regularisation);
            if now.merit.regularisation == settings.regularisation_max {
                return Err(match error {
                    SweepError::NotPositive { .. } => Status::RegularisationLimit,
                    _ => Status::NotFinite,
                });
            }
            self.clock.allows(&[Phase::Sweep], watch)?;
        }
        now.swept = true;
        Ok(())
    }

    /// Computes the linear-quadratic problem at the iterate. The problem contains the gaps until the first full step,
    /// and the bounds afterwards. With several threads, the sweep processes knots as soon as their derivatives are
    /// known, if possible. Returns the result of the sweep if it ran here, otherwise `None`.
    #[inline(never)] // `benches/instructions.py` counts this function by name
    fn calc_diff(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        feasible: bool,
        regularisation: f64,
    ) -> Option<Result<(), SweepError>> {
        let clock = Instant::now();
        let follows = self.follows(settings);
        let Self { iterate, knots, sweep, inverse_dynamics, .. } = self;
        let what = iterate.derivatives(*inverse_dynamics);
        let Iterate { solution, gaps, .. } = &*iterate;
        let (Solution { xs, us, .. }, shape) = (solution, solution.shape());
        let complete = |model: &dyn ActionModel, first: usize, knots: &mut [LqKnot]| {
            for (t, knot) in (first..).zip(knots) {
                complete(model, t, knot, feasible, gaps.get(shape.dx(t + 1)), &us[shape.u(t)]);
            }
        };
        let (mut outcome, mut sweeping) = (Ok(()), Duration::ZERO);
        if settings.threads == 1 {
            problem.calc_diff_as(what, xs, us, knots);
            for (t, knot) in knots.chunks_exact_mut(1).enumerate() {
                complete(problem.action(t), t, knot);
            }
        } else {
            let (mut following, feedback, gains) = sweep.follow(settings.threads);
            problem.calc_diff_on(what, [xs, us], knots, feedback, gains, |model, first, knots, feedback| {
                complete(model, first, knots);
                if follows && outcome.is_ok() {
                    let clock = Instant::now();
                    outcome = following.run(first, knots, feedback, regularisation);
                    sweeping += clock.elapsed();
                }
            });
        }
        let timings = &mut self.iterate.solution.timings;
        timings.calc_diff += self.clock.lasted(Phase::CalcDiff, clock.elapsed() - sweeping);
        if !follows {
            return None;
        }
        timings.sweep += self.clock.lasted(Phase::Sweep, sweeping);
        Some(outcome)
    }

    /// Computes the knots of a range of the linear-quadratic problem at the iterate into `lq_knots`, as the derivatives
    /// of an iteration do.
    pub(super) fn calc_diff_part(
        &self,
        problem: &mut Problem,
        now: &Progress,
        range: Range<usize>,
        lq_knots: &mut [LqKnot],
    ) {
        let Iterate { solution: Solution { xs, us, .. }, gaps, .. } = &self.iterate;
        let what = self.iterate.derivatives(self.inverse_dynamics);
        problem.calc_diff_part(what, [xs, us], range.clone(), lq_knots);
        let shape = problem.shape();
        for (t, knot) in range.zip(lq_knots) {
            complete(problem.action(t), t, knot, now.merit.feasible, gaps.get(shape.dx(t + 1)), &us[shape.u(t)]);
        }
    }

    /// Returns whether the solve uses the inverse-dynamics form of knots, where actions support it.
    pub(super) fn uses_inverse_dynamics(&self) -> bool {
        self.inverse_dynamics
    }

    /// Returns whether the sweep processes knots as soon as their derivatives are known.
    fn follows(&self, settings: &Settings) -> bool {
        settings.threads > 1 && !settings.second_order && self.sweep.is_sequential()
    }

    #[inline(never)] // `benches/instructions.py` counts this function by name
    fn sweep(&mut self, problem: &mut Problem, settings: &Settings, regularisation: f64) -> Result<(), SweepError> {
        let clock = Instant::now();
        let solution = &mut self.iterate.solution;
        let result = if settings.second_order {
            let (Solution { xs, us, .. }, shape) = (&*solution, solution.shape());
            self.sweep.run_with(&self.knots, regularisation, |t, lambda, hessian| {
                let (x, u) = (&xs[shape.x(t)], &us[shape.u(t)]);
                problem.action_mut(t).dynamics_hessian(t, x, u, lambda, hessian)
            })
        } else {
            self.sweep.run(&self.knots, regularisation)
        };
        solution.timings.sweep += self.clock.ran(Phase::Sweep, clock);
        result
    }

    /// Completes the solution at the end of a pass, from the last iterate or a better one.
    pub(super) fn finish(&mut self, problem: &mut Problem, settings: &Settings, mut now: Progress, status: Status) {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        now.merit.gap = infinite_if_nan(self.iterate.update_gaps(problem));
        now.merit.cost = infinite_if_nan(self.iterate.solution.cost);
        (self.iterate.solution.gap, self.iterate.solution.cost) = (now.merit.gap, now.merit.cost);
        let goes_back = match status {
            Status::Converged => false,
            Status::NotFinite => true, // no direction exists at the last iterate
            _ => self.best.is_better_than(&now.merit),
        };
        let Merit { regularisation, .. } = now.merit;
        if goes_back && let Some(best) = self.best.restore(&mut self.iterate) {
            now.merit = best;
            self.iterate.update_gaps(problem);
            self.iterate.knows_motions = false;
            if !now.swept_best {
                self.sweep.keep_values(false);
                let swept = self.calc_diff(problem, settings, best.feasible, best.regularisation);
                now.swept = swept.unwrap_or_else(|| self.sweep(problem, settings, best.regularisation)).is_ok();
            }
        }
        self.renewed |= now.merit.steps > 0;
        let solution = &mut self.iterate.solution;
        solution.feasible = now.merit.feasible;
        solution.regularisation = regularisation;
        solution.status = status;
        if now.swept {
            self.store_gains(&mut now); // else, the gains of the previous solve stay, shifted or not
        }
    }

    /// Copies the gains of the last sweep to the solution.
    pub(super) fn store_gains(&mut self, now: &mut Progress) {
        let solution = &mut self.iterate.solution;
        for ((K, k), feedback) in solution.K.iter_mut().zip(&mut solution.k).zip(self.sweep.feedback()) {
            K.copy_from(&feedback.K);
            k.copy_from(&feedback.k);
        }
        now.swept = false;
    }

    /// Sets the gains of the solution to zero, as in a new solver.
    pub(super) fn forget_gains(&mut self) {
        let solution = &mut self.iterate.solution;
        solution.K.iter_mut().for_each(|K| K.fill(0.0));
        solution.k.iter_mut().for_each(|k| k.fill(0.0));
    }

    /// Exchanges the linear-quadratic problem and the sweep of this loop for `knots` and `sweep`. The next sweep starts
    /// from the feed-forward in the solution, if this loop has `swept` before.
    pub(super) fn exchange(&mut self, knots: &mut Vec<LqKnot>, sweep: &mut Sweep, swept: bool) {
        std::mem::swap(&mut self.knots, knots);
        std::mem::swap(&mut self.sweep, sweep);
        if swept {
            self.sweep.start_from(&self.iterate.solution.k);
        }
    }
}

/// Completes knot t of the linear-quadratic problem: with the gap after it until the trajectory is feasible, and with
/// its bounds afterwards.
fn complete(model: &dyn ActionModel, t: usize, knot: &mut LqKnot, feasible: bool, gap: Option<&[f64]>, u: &[f64]) {
    match gap {
        Some(gap) if !feasible => knot.f.as_mut_slice().copy_from_slice(gap),
        _ => knot.f.fill(0.0),
    }
    match model.bounds(t) {
        Some((lower, upper)) if feasible => {
            for (i, u) in u.iter().enumerate() {
                knot.lower[i] = lower[i] - u;
                knot.upper[i] = upper[i] - u;
            }
        }
        _ => {
            knot.lower.fill(f64::NEG_INFINITY);
            knot.upper.fill(f64::INFINITY);
        }
    }
}

impl Progress {
    /// Records that another sweep has written the gains of the iterate to the solution.
    pub(super) fn stores_gains(&mut self) {
        (self.swept, self.swept_best) = (false, false);
    }

    /// Returns whether the cost and the gaps of the iterate are finite.
    pub(super) fn is_finite(&self) -> bool {
        self.merit.cost.is_finite() && self.merit.gap.is_finite()
    }

    /// Updates the progress after a line search; the iterate now has the given cost.
    fn advance(&mut self, search: &Search, settings: &Settings, cost: f64) {
        let Self { merit, was_feasible, swept_best, .. } = self;
        merit.cost = cost;
        if search.accepted {
            (merit.bounded, merit.steps) = (true, merit.steps + 1);
            *swept_best = search.left_best;
            *was_feasible = merit.feasible;
            merit.feasible |= search.step == 1.0 || settings.method == DdpMethod::Ddp;
        }
        if search.step > settings.regularisation_decrease_above {
            merit.regularisation = settings.decreased(merit.regularisation);
        }
        if search.step <= settings.regularisation_increase_below {
            merit.regularisation = settings.increased(merit.regularisation);
        }
    }
}
