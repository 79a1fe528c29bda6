//! Iterations of the interior point: barrier parameter, sweep, line search and parabola.

use super::InteriorPoint;
use super::filter::Measure;
use super::kkt::{Coordinates, Kkt};
use super::step::sum_abs;
use crate::lq::{SweepError, SweepOutput};
use crate::problem::Problem;
use crate::solvers::best::Merit;
use crate::solvers::settings::Settings;
use crate::solvers::solution::{Iteration, Status};
use crate::solvers::solver_loop::SolverLoop;
use crate::solvers::watch::{Phase, Watch};

/// Fraction τ of a distance or multiplier by which a step may lower it.
pub(super) const TAU: f64 = 0.995;
/// Price of infeasibility after a restart, as a multiple of the mean |λ|. From an exact penalty on, steps are short
/// but cannot lead away again; before a restart, freer steps save iterations.
const CAREFUL: f64 = 10.0;
/// Length of a step below which the regularisation rises, after a restart.
const CAREFUL_BELOW: f64 = 0.2;
/// Largest regularisation to which short steps lead; with more, steps become tiny.
const CAREFUL_MOST: f64 = 1e-2;
/// Number of step lengths that a search tries before the regularisation rises.
const LENGTHS: usize = 12;
/// Smallest fraction by which μ falls in an iteration.
const SLOWEST: f64 = 0.02;
/// Largest ratio of a step length to the minimum of a parabola through the merit for which the step is kept.
const OVERSHOOT: f64 = 0.75;
/// Largest KKT error at which the curvature of the dynamics is included. With soft limits it is included at any error:
/// where they give way, multipliers are as large as their weights, and Gauss–Newton steps may not converge.
const CURVED_BELOW: f64 = 1e-1;
/// Number of iterations without a decrease of the KKT error by a tenth, after which the curvature of the dynamics is
/// included in a problem with soft limits, whatever the settings are.
const SLOW: usize = 8;
/// Regularisation after a first failure.
pub(super) const FIRST_REGULARISATION: f64 = 1e-6;
/// Infeasibility below which a step that the filter rejects is accepted nevertheless, and no restoration is needed.
const NEARLY_FEASIBLE: f64 = 1e-4;
/// Maximum number of consecutive steps that are accepted so.
const MOST_UNCHECKED: usize = 4;
/// Regularisation from which a search that fails is followed by a restoration.
const RESTORE_FROM: f64 = 1e2;
/// Number of steps without a decrease of the violation by a tenth, after which a restoration begins; and the length
/// below which a step is short.
const STALLED: usize = 60;
const SHORT: f64 = 0.05;
/// Weight of a short step in that number.
const SHORT_WEIGHT: usize = 4;
/// Number of iterations without a decrease of the KKT error by a tenth, after which a solve near the solution ends.
const MOST_IDLE: usize = 40;
/// Smallest μ at the start of a resumed solve, relative to μ at the start of a new solve.
const WARM_BARRIER: f64 = 1e-2;

/// State that one iteration passes to the next.
#[derive(Default)]
pub(super) struct Progress {
    regularisation: f64,
    /// Length of the last step.
    alpha: f64,
    /// Number of accepted steps.
    pub(super) steps: usize,
    /// Largest gradient with respect to the controls, divided by the largest one with respect to the unknowns of the
    /// inverse-dynamics form; at least 1.
    control_scale: f64,
    /// Smallest violation of a constraint so far, and the weighted number of steps since it fell by a tenth.
    violation: f64,
    stalled: usize,
    /// Smallest KKT error so far, and the number of iterations since it fell by a tenth.
    error: f64,
    idle: usize,
    /// Smallest KKT error so far at any distance from the solution, and the number of iterations since it fell by a
    /// tenth.
    smallest: f64,
    slow: usize,
    /// Number of restarts.
    restarts: usize,
    /// Number of consecutive steps that were accepted although the filter rejected them.
    unchecked: usize,
}

impl Progress {
    fn start(settings: &Settings) -> Self {
        let (regularisation, worst) = (settings.regularisation_min, f64::INFINITY);
        let [violation, error, smallest] = [worst; 3];
        Self { regularisation, violation, error, smallest, alpha: 1.0, control_scale: 1.0, ..Self::default() }
    }

    /// Returns whether steps must not lead away from the constraints: after a restart, until they hold nearly.
    fn is_careful(&self, kkt: &Kkt) -> bool {
        self.restarts > 0 && kkt.violation.max(kkt.gap) > NEARLY_FEASIBLE
    }

    /// Counts the steps since the violation of constraints, and since the KKT error fell by a tenth.
    fn watch(&mut self, kkt: &Kkt) {
        self.stalled += if self.alpha < SHORT { SHORT_WEIGHT } else { 1 };
        if kkt.violation < 0.9 * self.violation || kkt.violation <= NEARLY_FEASIBLE {
            (self.violation, self.stalled) = (kkt.violation, 0);
        }
        self.slow += usize::from(self.slow < SLOW); // once slow, always slow
        if kkt.error() < 0.9 * self.smallest {
            self.smallest = kkt.error();
            self.slow = if self.slow < SLOW { 0 } else { SLOW };
        }
        self.idle += 1;
        if kkt.error() < 0.9 * self.error || kkt.error() > NEARLY_FEASIBLE {
            (self.error, self.idle) = (kkt.error().min(self.error), 0);
        }
    }
}

impl InteriorPoint {
    /// Makes iterations until one of the reasons to stop occurs.
    pub(super) fn make_iterations(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        watch: &mut Watch<'_>,
    ) -> Status {
        let tolerance = self.settings.tolerance;
        let mut now = Progress::start(settings);
        let mut curved = false;
        for iteration in 0..=settings.max_iterations {
            if !self.solver.iterate.solution.cost.is_finite() {
                return Status::NotFinite;
            }
            if let Err(status) = self.solver.clock.allows(&[Phase::CalcDiff, Phase::Sweep, Phase::Rollout], watch) {
                return status;
            }
            self.differentiate(problem, settings, self.equations(curved));
            if iteration == 0 {
                self.start_slacks();
            }
            let mut kkt = self.measure(problem, Coordinates::Unknowns);
            if self.equations(curved) {
                let of_unknowns = kkt.dual;
                kkt.dual *= now.control_scale;
                if kkt.is_converged(tolerance) {
                    // the gradient with respect to the controls themselves decides
                    kkt = self.measure(problem, Coordinates::Controls);
                    now.control_scale = (kkt.dual / of_unknowns.max(f64::MIN_POSITIVE)).max(1.0);
                }
            }
            self.kkt = kkt;
            if !kkt.error().is_finite() {
                return Status::NotFinite;
            }
            if kkt.is_converged(tolerance) {
                return Status::Converged;
            }
            if iteration == settings.max_iterations {
                return Status::MaxIterations;
            }
            now.watch(&kkt);
            if now.idle == MOST_IDLE {
                return Status::RegularisationLimit;
            }
            curved = match self.slacks.has_soft_rows() {
                true => self.settings.second_order || now.slow == SLOW,
                false => self.settings.second_order && kkt.error() < CURVED_BELOW,
            };
            if curved && self.equations(false) {
                self.differentiate(problem, settings, false);
            }
            let old = self.mu;
            if iteration > 0 {
                self.lower_barrier(now.alpha);
            }
            if self.mu != old {
                self.filter.clear();
            }
            let slope = match self.make_step(problem, settings, &mut now, &kkt, curved, watch) {
                Ok(slope) => slope,
                Err(status) => return status,
            };
            let record = self.record(iteration, &kkt, &now, slope);
            self.solver.iterate.solution.trace.push(record);
            self.solver.clock.end_guarantee();
            if watch.iteration(&record).is_break() {
                return Status::Interrupted;
            }
        }
        Status::MaxIterations
    }

    /// Sets the slack variables and multipliers, μ and the filter at the start of a solve.
    pub(super) fn start_slacks(&mut self) {
        let bounds = self.slacks.bound_count().max(1) as f64;
        let mean_cost = (self.solver.iterate.solution.cost + self.slacks.soft_cost()).abs() / bounds;
        let mu = self.settings.barrier_start.unwrap_or(mean_cost.clamp(1e-6, 1e2));
        if self.is_warm {
            self.mu = self.mu.clamp(WARM_BARRIER * mu, mu);
            self.slacks.resume(self.mu);
        } else {
            self.mu = mu;
            self.slacks.start(mu);
        }
        self.is_warm = true;
        self.filter.start(self.measure_merit().theta);
    }

    /// Chooses μ from the mean product p of multipliers and distances, and the centrality ξ, the smallest product
    /// divided by p: μ = σ p with
    ///
    /// ```text
    /// σ = 0.1 min(0.05 (1 − ξ) / ξ, 2)³     (LOQO),  at least  (1 − α)³  after a step of length α
    /// ```
    pub(super) fn lower_barrier(&mut self, alpha: f64) {
        if let Some([mean, least]) = self.slacks.products() {
            let centrality = (least / mean).max(1e-12);
            let sigma = 0.1 * (0.05 * (1.0 - centrality) / centrality).min(2.0).powi(3);
            let sigma = sigma.max(SLOWEST).max((1.0 - alpha).powi(3));
            self.mu = (sigma * mean).max(0.01 * self.settings.tolerance);
        }
    }

    /// Computes λ and the residuals of the optimality conditions at the iterate.
    pub(super) fn measure(&mut self, problem: &Problem, coordinates: Coordinates) -> Kkt {
        let Self { solver: SolverLoop { iterate, knots, .. }, slacks, adjoint, step, .. } = self;
        adjoint.run(knots, slacks, [&step.q, &step.r], &iterate.gaps, problem.shape(), coordinates)
    }

    /// Sweeps, searches and makes a step. Repeats this with a larger regularisation, and restores feasibility at last.
    /// Returns the slope of φ along the step.
    ///
    /// # Errors
    /// The reason to stop, if no step was made.
    fn make_step(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut Progress,
        kkt: &Kkt,
        mut curved: bool,
        watch: &mut Watch<'_>,
    ) -> Result<f64, Status> {
        if now.stalled >= STALLED {
            return self.restart(problem, settings, now, watch);
        }
        let shape = problem.shape();
        self.slacks.write_terms(&mut self.solver.knots, &self.step.r, shape, self.mu);
        loop {
            match self.sweep(problem, curved, now.regularisation, SweepOutput::Factors) {
                Ok(()) => {
                    self.find_steps(problem);
                    if let Some((alpha, slope)) = self.search(problem, kkt, now) {
                        now.alpha = alpha;
                        now.steps += 1;
                        now.regularisation = match now.is_careful(kkt) && alpha < CAREFUL_BELOW {
                            true => settings.increased(now.regularisation).clamp(FIRST_REGULARISATION, CAREFUL_MOST),
                            false => settings.decreased(now.regularisation),
                        };
                        return Ok(slope);
                    }
                }
                Err(SweepError::NotPositive { .. }) if curved => {
                    curved = false;
                    continue;
                }
                Err(SweepError::NotPositive { .. }) => {}
                Err(_) => return Err(Status::NotFinite),
            }
            if now.regularisation >= RESTORE_FROM && kkt.violation.max(kkt.gap) > NEARLY_FEASIBLE {
                return self.restart(problem, settings, now, watch);
            }
            now.regularisation = settings.increased(now.regularisation).max(FIRST_REGULARISATION);
            if now.regularisation >= settings.regularisation_max {
                return Err(Status::RegularisationLimit);
            }
        }
    }

    /// Starts anew where no step is accepted or the violation stalls: the first time with careful steps from the
    /// iterate, later from the trajectory of a restoration.
    fn restart(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut Progress,
        watch: &mut Watch<'_>,
    ) -> Result<f64, Status> {
        if now.restarts == 0 {
            self.is_warm = false;
            self.start_slacks();
        } else {
            self.restore(problem, settings, watch)?;
        }
        *now = Progress {
            restarts: now.restarts + 1,
            control_scale: now.control_scale,
            steps: now.steps + 1,
            ..Progress::start(settings)
        };
        Ok(0.0)
    }

    /// Searches a step length that the filter accepts, and makes the step. Returns the length and the slope of φ;
    /// `None` if no length was accepted.
    fn search(&mut self, problem: &mut Problem, kkt: &Kkt, now: &mut Progress) -> Option<(f64, f64)> {
        let here = self.measure_merit();
        let lambda = &self.adjoint.lambda;
        let penalty = if now.is_careful(kkt) { CAREFUL * sum_abs(lambda) / lambda.len() as f64 } else { 0.0 };
        self.filter.set_penalty(penalty);
        let slope = self.step.slope() + self.slacks.soft_slope() + self.mu * self.slacks.barrier_slope();
        let [longest, beta] = self.slacks.step_lengths(TAU);
        let mut alpha = longest;
        for _ in 0..LENGTHS {
            let (cost, trial) = self.try_step(problem, alpha);
            if self.filter.accepts(here, trial, alpha, slope, self.mu) {
                let (alpha, cost) = self.interpolate(problem, here, slope, (alpha, cost, trial));
                now.unchecked = 0;
                self.make(alpha, beta, cost, kkt, now);
                return Some((alpha, slope));
            }
            alpha *= 0.5;
        }
        if kkt.violation.max(kkt.gap) > NEARLY_FEASIBLE || now.unchecked == MOST_UNCHECKED {
            return None;
        }
        // near the solution φ is flat up to rounding, and curved constraints raise θ: full steps still converge
        let (cost, trial) = self.try_step(problem, longest);
        let limit = NEARLY_FEASIBLE.max(here.theta);
        if trial.theta.is_nan() || trial.theta > limit {
            return None;
        }
        now.unchecked += 1;
        self.filter.clear();
        self.make(longest, beta, cost, kkt, now);
        Some((longest, slope))
    }

    /// Makes the step of s and of the trajectory with length α, whose trial has the given cost, and of z with length β.
    fn make(&mut self, alpha: f64, beta: f64, cost: f64, kkt: &Kkt, now: &Progress) {
        let merit = self.best_merit(kkt, now.steps);
        self.solver.best.leave(&mut self.solver.iterate, merit);
        self.accept_trial(cost);
        self.solver.renewed = true;
        self.slacks.advance(alpha, beta, self.mu);
    }

    /// Moves an accepted trial to the minimum of a parabola through φ, if the step went far beyond this minimum. Full
    /// Gauss–Newton steps may otherwise alternate between two sides of a valley. Returns the step length and the cost.
    fn interpolate(
        &mut self,
        problem: &mut Problem,
        here: Measure,
        slope: f64,
        (alpha, cost, trial): (f64, f64, Measure),
    ) -> (f64, f64) {
        let mu = self.mu;
        let curvature = 2.0 * (trial.phi(mu) - here.phi(mu) - slope * alpha) / (alpha * alpha);
        let best = -slope / curvature;
        if !(slope < 0.0 && curvature > 0.0 && best < OVERSHOOT * alpha && best > 0.05 * alpha) {
            return (alpha, cost);
        }
        let (new_cost, new) = self.try_step(problem, best);
        if new.phi(mu) < trial.phi(mu) && new.theta <= here.theta.max(trial.theta) {
            return (best, new_cost);
        }
        self.try_step(problem, alpha);
        (alpha, cost)
    }

    /// Returns θ and φ of the iterate.
    fn measure_merit(&self) -> Measure {
        let [infeasibility, logarithms, of_soft] = self.slacks.merit_here();
        let iterate = &self.solver.iterate;
        let theta = infeasibility + sum_abs(&iterate.gaps);
        Measure { theta, cost: iterate.solution.cost + of_soft, logarithms }
    }

    /// Returns the merit by which the best iterate is chosen: infeasibility, then cost.
    pub(super) fn best_merit(&self, kkt: &Kkt, steps: usize) -> Merit {
        let cost = self.solver.iterate.solution.cost + self.slacks.soft_cost();
        let gap = kkt.gap.max(kkt.violation);
        let gap = if gap <= self.settings.tolerance { 0.0 } else { gap };
        Merit { gap, cost, feasible: true, bounded: true, steps, regularisation: self.settings.regularisation_min }
    }

    fn record(&self, iteration: usize, kkt: &Kkt, now: &Progress, slope: f64) -> Iteration {
        Iteration {
            iteration,
            cost: self.solver.iterate.solution.cost,
            gap: kkt.gap.max(kkt.violation),
            stop: kkt.error(),
            step: now.alpha,
            regularisation: now.regularisation,
            d1: -slope,
            d2: 0.0,
            decrease: -slope * now.alpha,
            expected_decrease: -slope * now.alpha,
            feasible: kkt.gap == 0.0,
            accepted: true,
        }
    }
}
