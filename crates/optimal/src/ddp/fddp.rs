//! Differential dynamic programming, feasibility-driven or not.
#![allow(non_snake_case)] // K besides k: names of the literature

use super::best::Best;
use super::clock::{Clock, Phase};
use super::observer::{Observer, PacedObserver, Unobserved};
use super::progress::Progress;
use super::rollout::Sum;
use super::search::LineSearch;
use super::settings::Settings;
use super::solution::{Solution, Timings};
use crate::error::Error;
use crate::lq::{Hessian, LqKnot, Sweep, SweepError};
use crate::problem::{ActionModel, Evaluation, Problem};
use crate::time::Instant;
use condyle_linalg::max_abs;
use std::time::Duration;

/// FDDP (Mastalli et al., ICRA 2020) and DDP (see [`DdpMethod`](crate::DdpMethod)), with the rules and constants of
/// Crocoddyl 3.2: both produce the same iterates. Bounds on controls ([`bounds`](crate::ActionModel::bounds)) are
/// handled as in Crocoddyl's box solvers (Tassa, Mansard, Todorov, ICRA 2014; Mastalli et al., RA-L 2022). While gaps
/// exist, the bounds only clamp the controls of trials. Afterwards, each knot's step minimises its quadratic model
/// within the bounds.
///
/// The warm start may have gaps f, where the trajectory does not satisfy the dynamics. One iteration is
///
/// ```text
/// derivatives   at the iterate, if it is new
/// sweep         k, K, Vx, Vxx; repeated with a larger regularisation while Quu is not positive definite
/// line search   for α = 1, ½, ¼, …: a rollout that keeps 1 − α of each gap; accepted if it lowers the cost
///               by more than `accept` times the expected α (d₁ + ½ α d₂), or, while gaps exist, raises it by less
///               than `accept_ascent` times that
/// ```
///
/// Iterates count as feasible after the first full step (α = 1 closes all gaps at once). The feedback is u = ū + α k +
/// K (x ⊖ x̄); in Crocoddyl, k and K have the opposite sign.
///
/// The first step length is tried alone. If it fails, the next four are tried side by side, and then the others. The
/// number tried at once is limited by the [`lanes`](crate::GroupModel::lanes) of the actions. The longest good step is
/// taken, as in a search of one length after the other.
///
/// [`new`](Self::new) allocates the workspace. At its beginning, a solve allocates the trace, and workspaces for
/// [`segments`](Settings::segments). Copies of actions for [`threads`](Settings::threads) are allocated by the first
/// solve that needs them. Nothing else is allocated, except by rayon itself.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, Fddp, LqKnot, Problem, Status};
/// # struct Integrator { nu: usize }
/// # impl ActionModel for Integrator {
/// #     fn nx(&self) -> usize { 1 }
/// #     fn nu(&self) -> usize { self.nu }
/// #     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
/// #         let u: f64 = u.iter().sum();
/// #         next[0] = x[0] + u;
/// #         0.5 * (x[0] * x[0] + u * u)
/// #     }
/// #     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
/// #         (knot.A[0], knot.Q[0], knot.q[0]) = (1.0, 1.0, x[0]);
/// #         knot.B.fill(1.0);
/// #         knot.S.fill(0.0);
/// #         knot.R.fill(1.0);
/// #         knot.r.copy_from_slice(u);
/// #     }
/// # }
/// // x⁺ = x + u, ℓ = ½ (x² + u²): linear and quadratic, so the first step is the last.
/// let (knot, end) = (Integrator { nu: 1 }, Integrator { nu: 0 });
/// let mut problem = Problem::new(vec![1.0], vec![Box::new(knot)], vec![0; 30], Box::new(end))?;
/// let mut solver = Fddp::new(&problem);
/// let solution = solver.solve(&mut problem, &[0.0; 31], &[0.0; 30])?;
///
/// assert_eq!(solution.status, Status::Converged);
/// let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
/// assert!((solution.u(0)[0] + 1.0 / golden).abs() < 1e-8);
/// assert!((solution.cost - golden / 2.0).abs() < 1e-8);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Fddp {
    /// Settings; may be changed between solves.
    pub settings: Settings,
    pub(crate) lq_knots: Vec<LqKnot>,
    pub(super) sweep: Sweep,
    pub(super) line_search: LineSearch,
    /// Solution, whose trajectory is the iterate.
    pub(crate) solution: Solution,
    /// φₜ(xₜ, uₜ) of the iterate, N·nx.
    pub(super) next: Vec<f64>,
    /// Accelerations and forces of the iterate, N equal parts, for knots in inverse-dynamics form.
    pub(super) motions: Vec<f64>,
    /// Whether `motions` belongs to the iterate.
    pub(super) knows_motions: bool,
    costs: Vec<f64>,
    /// f₀ = x̂₀ ⊖ x₀, fₜ₊₁ = φₜ ⊖ xₜ₊₁ of the iterate, (N + 1)·ndx.
    pub(super) gaps: Vec<f64>,
    /// Best iterate; it becomes the solution if the last iterate is worse.
    pub(super) best: Best,
    pub(super) clock: Clock,
    /// Whether knots may be given as equations of inverse dynamics.
    inverse_dynamics: bool,
    /// Whether a trajectory exists from which a solve can resume.
    started: bool,
    /// Whether the trajectory was given or found since the last [`shift`](Self::shift). Without a step in between, a
    /// shift repeats the last state.
    pub(super) renewed: bool,
}

/// Rules of a solve that its caller sets, besides the settings.
#[derive(Clone, Copy)]
pub(crate) struct Rules {
    /// Whether the first iteration runs regardless of the time.
    pub(crate) guaranteed: bool,
    /// Whether a warm start without gaps counts as feasible if a control lies on its bound. Crocoddyl's value is false:
    /// the bounds then only clamp trials until the first full step, which is never accepted where the bounds are
    /// active.
    pub(crate) trusts_start: bool,
    /// Whether the solve continues the last one, instead of a warm start or an earlier part of the same solve.
    pub(crate) resumes: bool,
}

/// Number of iterations for which the trace is allocated when a solve begins; with more it grows.
const FORESEEN: usize = 10_000;

impl Fddp {
    /// Creates a solver with the default settings and the workspace for problems with the dimensions of `problem`.
    pub fn new(problem: &Problem) -> Self {
        let (mut lq_knots, shape) = (problem.lq_knots(), problem.shape());
        problem.reserve_inverse_dynamics(&mut lq_knots);
        let horizon = problem.horizon();
        Self {
            settings: Settings::default(),
            sweep: Sweep::new(&lq_knots),
            lq_knots,
            line_search: LineSearch::new(problem),
            solution: Solution::new(problem),
            next: vec![0.0; horizon * shape.nx],
            motions: vec![0.0; horizon * problem.motion_size()],
            knows_motions: false,
            costs: vec![0.0; horizon + 1],
            gaps: vec![0.0; (horizon + 1) * shape.ndx],
            best: Best::new(problem),
            clock: Clock::default(),
            inverse_dynamics: false,
            started: false,
            renewed: false,
        }
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat.
    ///
    /// # Errors
    /// [`Error`] if the dimensions of `problem` differ from the problem given to [`new`](Self::new), the warm start has
    /// a wrong length, is not finite or contains an invalid state, or a setting is invalid. A solve that does not
    /// converge is not an error: see [`Solution::status`].
    pub fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut Unobserved, self.rules(false))
    }

    /// Solves as [`solve`](Self::solve) does, and passes each iteration to `observer` when it ends. The observer may
    /// end the solve.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_with(
        &mut self,
        problem: &mut Problem,
        xs: &[f64],
        us: &[f64],
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut observer, self.rules(false))
    }

    /// Solves `problem` from the trajectory of the last solve: with a new initial state, new references or, after
    /// [`shift`](Self::shift), for the next horizon.
    ///
    /// A lost trajectory is replaced by x̂₀ held still at all knots, if that costs less. A trajectory is lost if it is
    /// not finite, or costs more than ten times as much as the last solution, with 1 added to both. If the last solve
    /// ran out of time or iterations with a rejected step, the regularisation starts at its last value.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn resume(&mut self, problem: &mut Problem) -> Result<&Solution, Error> {
        self.run(problem, None, &mut Unobserved, self.rules(true))
    }

    /// Solves as [`resume`](Self::resume) does, and passes each iteration to `observer` when it ends. The observer may
    /// end the solve.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn resume_with(&mut self, problem: &mut Problem, mut observer: impl Observer) -> Result<&Solution, Error> {
        self.run(problem, None, &mut observer, self.rules(true))
    }

    /// Returns the rules of a plain solve, which are Crocoddyl's.
    fn rules(&self, resumes: bool) -> Rules {
        Rules { guaranteed: self.settings.time_budget != Some(Duration::ZERO), trusts_start: false, resumes }
    }

    /// Solves from a warm start, or from the trajectory of the last solve.
    pub(crate) fn run(
        &mut self,
        problem: &mut Problem,
        warm_start: Option<[&[f64]; 2]>,
        observer: &mut dyn Observer,
        rules: Rules,
    ) -> Result<&Solution, Error> {
        let begin = Instant::now();
        if let Some([xs, us]) = warm_start {
            self.solution.shape().check(problem.shape())?;
            Error::check("xs", xs, self.solution.xs.len())?;
            Error::check("us", us, self.solution.us.len())?;
            for (knot, x) in xs.chunks_exact(problem.nx()).enumerate() {
                problem.action(knot).check_state(x).map_err(|what| Error::State { name: "xs", knot, what })?;
            }
            self.solution.xs.copy_from_slice(xs);
            self.solution.us.copy_from_slice(us);
            (self.started, self.renewed) = (true, true);
        } else if !self.started {
            return Err(Error::NothingToResume);
        }
        self.settings.check()?;
        self.solution.shape().check(problem.shape())?;
        if self.lq_knots[0].inverse_dynamics.stride == 0 && problem.reserve_inverse_dynamics(&mut self.lq_knots) {
            self.sweep = Sweep::new(&self.lq_knots); // the problem given to `new` did not have this form
        }
        let bounded = problem.check_bounds()?;
        self.inverse_dynamics = self.settings.inverse_dynamics_form && !bounded && !self.settings.second_order;
        let tolerance = if bounded { self.settings.tolerance_bounded } else { self.settings.tolerance };
        if bounded && self.settings.project_warm_start {
            self.solution.project(problem, 0..problem.horizon());
        }

        let start = if rules.resumes { self.resumed_regularisation() } else { self.settings.regularisation_start };
        self.solution.timings = Timings::default();
        self.solution.trace.clear();
        self.solution.trace.reserve(self.settings.max_iterations.min(FORESEEN));
        let motion_size = if self.inverse_dynamics { problem.motion_size() } else { 0 };
        self.motions.resize(problem.horizon() * motion_size, 0.0);
        self.line_search.start(problem, self.settings.step_lengths, motion_size, self.settings.threads);
        let mut progress = Progress {
            regularisation: start,
            feasible: false,
            was_feasible: false,
            tolerance,
            bounded: false,
            steps: 0,
            swept: false,
            swept_best: false,
        };
        self.sweep.set_segments(self.settings.segments);
        self.sweep.forget();
        self.best.start();
        self.clock.start(begin, self.settings.time_budget, rules.guaranteed);
        let last_cost = self.solution.cost;
        let mut gap = self.start(problem);
        if rules.resumes {
            gap = self.recover(problem, gap, last_cost);
        }
        progress.bounded = !bounded || self.solution.is_bounded(problem);
        progress.feasible = bounded && rules.trusts_start && gap == 0.0 && self.solution.touches_bounds(problem);
        let status = self.iterate(problem, &mut progress, gap, &mut PacedObserver::new(observer, begin));
        self.finish(problem, &mut progress, status);
        self.solution.timings.end(begin.elapsed(), self.settings.time_budget);
        Ok(&self.solution)
    }

    /// Returns the result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// Computes dynamics and cost of the warm start.
    pub(super) fn calc(&mut self, problem: &mut Problem) {
        let clock = Instant::now();
        let Self { solution: Solution { xs, us, .. }, next, costs, motions, .. } = self;
        problem.calc_with_motions(xs, us, next, costs, motions);
        self.knows_motions = true;
        let mut sum = Sum::default();
        self.costs.iter().for_each(|cost| sum.add(*cost));
        self.solution.cost = sum.value();
        self.solution.timings.calc += clock.elapsed();
    }

    /// Computes f₀ = x̂₀ ⊖ x₀,  fₜ₊₁ = φₜ(xₜ, uₜ) ⊖ xₜ₊₁; returns ‖f‖∞.
    pub(super) fn update_gaps(&mut self, problem: &Problem) -> f64 {
        let (shape, xs) = (self.solution.shape(), &self.solution.xs);
        for t in 0..=shape.horizon() {
            let predicted = if t == 0 { problem.x0() } else { &self.next[shape.x(t - 1)] };
            let (x, gap) = (&xs[shape.x(t)], &mut self.gaps[shape.dx(t)]);
            if x == predicted {
                gap.fill(0.0);
            } else {
                problem.action(t).difference(x, predicted, gap);
            }
        }
        max_abs(&self.gaps)
    }

    /// Returns the knot, the entry of the tangent space, and the size of the largest gap of the last iterate.
    pub(crate) fn largest_gap(&self) -> Option<(usize, usize, f64)> {
        let ndx = self.solution.shape().ndx;
        let sizes = self.gaps.iter().map(|gap| if gap.is_nan() { f64::INFINITY } else { gap.abs() });
        let (i, size) = sizes.enumerate().max_by(|a, b| a.1.total_cmp(&b.1))?;
        (size > 0.0).then_some((i / ndx, i % ndx, size))
    }

    /// Computes the LQ problem at the iterate. It contains the gaps until the first full step, and the bounds
    /// afterwards. With several threads, the sweep follows the derivatives from knot to knot if it can, and its outcome
    /// is returned.
    #[inline(never)] // `benches/instructions.py` counts this function by name
    pub(super) fn calc_diff(
        &mut self,
        problem: &mut Problem,
        feasible: bool,
        regularisation: f64,
    ) -> Option<Result<(), SweepError>> {
        let clock = Instant::now();
        let follows = self.follows();
        let Self { solution, gaps, lq_knots, sweep, settings, motions, .. } = self;
        let what = match self.inverse_dynamics {
            true => Evaluation::Equations(if self.knows_motions { motions } else { &[] }),
            false => Evaluation::Derivatives,
        };
        let (Solution { xs, us, .. }, threads) = (&*solution, settings.threads);
        let complete = |model: &dyn ActionModel, first: usize, lq_knots: &mut [LqKnot]| {
            for (t, knot) in (first..).zip(lq_knots) {
                match gaps.get(solution.shape().dx(t + 1)) {
                    Some(gap) if !feasible => knot.f.as_mut_slice().copy_from_slice(gap),
                    _ => knot.f.fill(0.0),
                }
                match model.bounds(t) {
                    Some((lower, upper)) if feasible => {
                        for (i, u) in us[solution.shape().u(t)].iter().enumerate() {
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
        };
        let (mut outcome, mut sweeping) = (Ok(()), Duration::ZERO);
        if threads == 1 {
            problem.calc_diff_as(what, xs, us, lq_knots);
            for (t, knot) in lq_knots.chunks_exact_mut(1).enumerate() {
                complete(problem.action(t), t, knot);
            }
        } else {
            let horizon = problem.horizon();
            let (step, feedback, gains) = sweep.parts(threads);
            problem.calc_diff_on(what, [xs, us], lq_knots, feedback, gains, |model, first, lq_knots, feedback| {
                complete(model, first, lq_knots);
                if !(follows && outcome.is_ok()) {
                    return;
                }
                let (clock, linear) = (Instant::now(), &mut |_: usize, _: &[f64], _: &mut Hessian| false);
                outcome = match first == horizon {
                    true => step.run(first, lq_knots, feedback, regularisation, linear),
                    false => step.back(first, lq_knots, feedback, regularisation, linear),
                };
                sweeping += clock.elapsed();
            });
        }
        let timings = &mut self.solution.timings;
        timings.calc_diff += self.clock.lasted(Phase::CalcDiff, clock.elapsed() - sweeping);
        if !follows {
            return None;
        }
        timings.sweep += self.clock.lasted(Phase::Sweep, sweeping);
        Some(outcome)
    }

    /// Returns whether the sweep follows the derivatives.
    pub(super) fn follows(&self) -> bool {
        self.settings.threads > 1 && !self.settings.second_order && self.sweep.is_sequential()
    }

    #[inline(never)] // `benches/instructions.py` counts this function by name
    pub(super) fn sweep(&mut self, problem: &mut Problem, regularisation: f64) -> Result<(), SweepError> {
        let clock = Instant::now();
        let result = if self.settings.second_order {
            let Solution { xs, us, .. } = &self.solution;
            let shape = self.solution.shape();
            self.sweep.run_with(&self.lq_knots, regularisation, |t, lambda, hessian| {
                let (x, u) = (&xs[shape.x(t)], &us[shape.u(t)]);
                problem.action_mut(t).dynamics_hessian(t, x, u, lambda, hessian)
            })
        } else {
            self.sweep.run(&self.lq_knots, regularisation)
        };
        self.solution.timings.sweep += self.clock.ran(Phase::Sweep, clock);
        result
    }
}
