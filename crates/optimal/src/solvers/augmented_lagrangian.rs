//! Solver of constrained problems by an augmented Lagrangian method.

use super::lagrangian::{larger, slopes};
use super::limit_rows;
use super::outcome::{Outcome, Violation};
use super::settings::{ConstraintSettings, Settings};
use super::solution::{Iteration, Solution, Status};
use super::solver_loop::{Pass, SolverLoop};
use super::start::quasi_static_start;
use super::watch::{Observer, Recent, Watch};
use crate::error::Error;
use crate::problem::Problem;
use crate::time::Instant;
use nalgebra::DVector;

/// Augmented Lagrangian solver for problems with [`Constrained`](crate::Constrained) actions and robots with
/// [`Limit`](crate::robot::Limit)s. Its inner solves are FDDP, as in [`Fddp`](crate::Fddp). It uses the
/// bound-constrained Lagrangian method (Conn, Gould, Toint, 1991; Nocedal and Wright, algorithm 17.4), as ProxDDP does
/// (Jallet, Bambade, Arlaud, El-Kazdadi, Mansard, Carpentier, 2023).
///
/// ```text
/// repeat   minimise   Σ ℓ + (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖²,   z = g + μ y        by FDDP, to a tolerance ω
///          if FDDP stopped before ω:                      continue the minimisation
///          if the violation is below the tolerance η, or the penalty 1/μ is at its limit:
///                                                         y ← (z − Π z) / μ,   and η and ω become smaller
///          else:                                          μ becomes smaller
/// until    the violations, and the gradient of the Lagrangian ℓ + yᵀg under the dynamics, are below the tolerances
/// ```
///
/// Multipliers and penalty change only after an inner solve that found a minimum. The gaps of the dynamics have no part
/// in this decision, but a converged solution has none. Each row is measured in its own unit: the penalty of an
/// inequality is divided by the square of its smaller finite bound other than 0, if that bound exceeds 1 in absolute
/// value. An effort limit of 87 N m and a joint limit of 2 rad then have similar weights. Tolerances, violations and
/// multipliers are not scaled.
///
/// A row of a soft limit has another term: the cost of the limit, rounded near the bounds by the penalty. Its
/// multiplier becomes the derivative of this cost. The row counts as violated by the difference between its distance
/// from the bounds and the distance that corresponds to its multiplier.
///
/// Bounds on the actions' controls are enforced as in [`Fddp`](crate::Fddp), in addition to the constraints. For a
/// receding horizon, call [`shift`](Self::shift) and then [`resume`](Self::resume). The solve then continues from the
/// last solution, its multipliers and its penalty.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, AugmentedLagrangian, Constrained, LqKnot, PathConstraint, Problem, Status};
/// use nalgebra::DMatrix;
/// # struct Integrator { nu: usize }
/// # impl ActionModel for Integrator {
/// #     fn nx(&self) -> usize { 1 }
/// #     fn nu(&self) -> usize { self.nu }
/// #     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
/// #         let u: f64 = u.iter().sum();
/// #         next[0] = x[0] + u;
/// #         0.5 * u * u
/// #     }
/// #     fn calc_diff(&mut self, _: usize, _: &[f64], u: &[f64], knot: &mut LqKnot) {
/// #         knot.A[0] = 1.0;
/// #         knot.Q.fill(0.0);
/// #         knot.q.fill(0.0);
/// #         knot.B.fill(1.0);
/// #         knot.S.fill(0.0);
/// #         knot.R.fill(1.0);
/// #         knot.r.copy_from_slice(u);
/// #     }
/// # }
/// /// x = 3.
/// struct Arrive;
/// impl PathConstraint for Arrive {
///     fn size(&self) -> usize { 1 }
///     fn bounds(&self, _: usize) -> (&[f64], &[f64]) { (&[3.0], &[3.0]) }
///     fn calc(&mut self, _: usize, x: &[f64], _: &[f64], g: &mut [f64]) { g[0] = x[0]; }
///     fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
///         gx.fill(1.0);
///         gu.fill(0.0);
///         true
///     }
/// }
///
/// // x⁺ = x + u, ℓ = ½ u², from 0 to 3 in 6 knots: u = ½ at each, and the multiplier is −½.
/// let end = Constrained::new(Box::new(Integrator { nu: 0 }), Box::new(Arrive));
/// let mut problem = Problem::new(vec![0.0], vec![Box::new(Integrator { nu: 1 })], vec![0; 6], Box::new(end))?;
/// let mut solver = AugmentedLagrangian::new(&problem);
/// let solution = solver.solve(&mut problem, &[0.0; 7], &[0.0; 6])?;
/// assert_eq!(solution.status, Status::Converged);
/// assert!(solution.us.iter().all(|u| (u - 0.5).abs() < 1e-6));
/// assert!((solver.outcome().multipliers[6][0] + 0.5).abs() < 1e-5);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct AugmentedLagrangian {
    /// Settings for the constraints; may be changed between solves.
    pub settings: ConstraintSettings,
    /// Settings of the inner solves. The solver chooses the tolerances itself. The time budget applies to all inner
    /// solves together.
    pub inner: Settings,
    solver: SolverLoop,
    outcome: Outcome,
    /// Adjoint state λ of a knot, scratch for the adjoint state of the previous knot, and the term Kᵀs.
    adjoint: [DVector<f64>; 3],
    /// Last durations of `measure`.
    measuring: Recent,
    /// Whether the last solve failed, so that its multipliers and its penalty are useless.
    lost: bool,
    kept: Kept,
}

/// Multipliers and penalty from which the next resumed solve starts.
#[derive(Debug, Clone, Default)]
struct Kept {
    /// Multipliers of each knot, from the last solve that did not fail.
    multipliers: Vec<Vec<f64>>,
    /// Penalty of the same solve; `None` if there is no such solve.
    penalty: Option<f64>,
    /// Whether a solve has failed since.
    failed: bool,
    /// Whether multipliers were set since the last solve, so that also a new trajectory starts from them.
    given: bool,
}

impl Kept {
    /// Takes the result of a solve. One failed solve leaves the earlier multipliers; a second one in succession, or a
    /// solve that is not finite, deletes them.
    fn take(&mut self, outcome: &Outcome, status: Status, lost: bool) {
        if !lost {
            self.multipliers.clone_from(&outcome.multipliers);
            self.penalty = Some(outcome.penalty);
        } else if self.failed || status == Status::NotFinite {
            self.penalty = None;
        }
        self.failed = lost;
    }
}

/// Progress of the multipliers' updates at the largest penalty.
#[derive(Debug)]
struct Progress {
    /// Smallest violation so far.
    smallest: f64,
    /// Number of consecutive updates that did not lower the violation.
    stalled: usize,
}

impl Progress {
    /// Takes the violation before an update. Returns whether the last updates made no progress.
    fn stalls(&mut self, violation: f64) -> bool {
        self.stalled = if violation < PROGRESS * self.smallest { 0 } else { self.stalled + 1 };
        self.smallest = self.smallest.min(violation);
        self.stalled >= STALLED
    }
}

/// Largest ratio of a violation to the smallest earlier violation that counts as progress.
const PROGRESS: f64 = 0.99;

/// Number of consecutive updates without progress after which a solve ends.
const STALLED: usize = 3;

/// Residuals of the stopping tests that [`Outcome`] does not contain.
struct Residuals {
    /// Largest violation of a constraint that controls can change.
    violation: f64,
    /// Largest violation of a constraint that depends only on the initial state x̂₀.
    fixed: Option<Violation>,
    /// Whether the trajectory minimises the augmented Lagrangian, except for rounding errors.
    stationary: bool,
}

/// Largest gradient entry of the augmented Lagrangian that counts as zero, relative to the largest multiplier. Rounding
/// at the largest penalty leaves four correct digits in the gradient of a violation.
const STATIONARY: f64 = 1e-4;

impl AugmentedLagrangian {
    /// Creates a solver with the default settings and the workspace for problems with the dimensions of `problem`.
    pub fn new(problem: &Problem) -> Self {
        Self {
            settings: ConstraintSettings::default(),
            inner: Settings::default(),
            solver: SolverLoop::new(problem),
            outcome: Outcome::default(),
            adjoint: [(); 3].map(|()| DVector::zeros(problem.ndx())),
            measuring: Recent::default(),
            lost: false,
            kept: Kept::default(),
        }
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat, with multipliers that
    /// start at zero.
    ///
    /// The status is [`Status::Converged`] when the residuals of [`outcome`](Self::outcome) are below the tolerances.
    /// It is [`Status::ConstraintsViolated`] if inner solves at the largest penalty found minima at which constraints
    /// are violated. Three updates of the multipliers in succession then did not lower the violation by a hundredth. It
    /// is [`Status::RegularisationLimit`] if an inner solve found no acceptable step and did not end at a minimum. It
    /// is [`Status::Infeasible`] if x̂₀ violates a constraint of knot 0 that is a function of the state alone; the
    /// solve then continues under the other constraints. It is [`Status::MaxIterations`] after
    /// [`max_solves`](ConstraintSettings::max_solves) inner solves. In all other cases the status is the status of the
    /// inner solve that stopped early.
    ///
    /// The cost of the solution includes the terms of the constraints; the cost of the outcome does not. After the
    /// solve, the multipliers in the problem are zero again.
    ///
    /// Controls of the warm start outside their bounds are moved to the bounds, whatever the value of
    /// [`Settings::project_warm_start`] in [`inner`](Self::inner). A failed solve is repeated from x̂₀ at all knots and
    /// the controls that hold x̂₀ still: see [`ConstraintSettings::restart`].
    ///
    /// # Errors
    /// The errors of [`Fddp::solve`](crate::Fddp::solve). Also an [`Error`] if no value satisfies the bounds of a
    /// constraint.
    pub fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut |_: &Iteration| {})
    }

    /// Solves as [`solve`](Self::solve) does, and passes each iteration of the inner solves to `observer`, which may
    /// end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn solve_with(
        &mut self,
        problem: &mut Problem,
        xs: &[f64],
        us: &[f64],
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut observer)
    }

    /// Solves `problem` from the last solution, its multipliers and its penalty. The problem may have a new initial
    /// state or new references, or may be [shifted](Self::shift) to the next horizon. The settings may be others.
    ///
    /// A solve has failed if it ended as [`Status::NotFinite`] or [`Status::ConstraintsViolated`], or found no
    /// acceptable step while constraints were violated. After one failed solve, the multipliers and the penalty are
    /// taken from the solve before it. After two failed solves in succession, or after [`Status::NotFinite`], the
    /// multipliers start at zero, and the penalty at its first value.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume(&mut self, problem: &mut Problem) -> Result<&Solution, Error> {
        self.run(problem, None, &mut |_: &Iteration| {})
    }

    /// Solves as [`resume`](Self::resume) does, and passes each iteration of the inner solves to `observer`, which may
    /// end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume_with(&mut self, problem: &mut Problem, mut observer: impl Observer) -> Result<&Solution, Error> {
        self.run(problem, None, &mut observer)
    }

    /// Turns the solution and its multipliers into a warm start for a problem that has since been
    /// [shifted](Problem::shift) by one knot, as [`Fddp::shift`](crate::Fddp::shift) does. The new last knot gets the
    /// multipliers of the knot before it, if both knots have the same number of constraints.
    ///
    /// # Errors
    /// [`Error`] if the numbers of knots, states and controls differ from the numbers of the last problem, shifted
    /// once.
    pub fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        self.solver.shift(problem, &self.inner)?;
        let horizon = problem.horizon();
        limit_rows::shift(&mut self.outcome.limits, horizon);
        for multipliers in [&mut self.outcome.multipliers, &mut self.kept.multipliers] {
            let Some(knots) = multipliers.get_mut(..horizon) else { continue };
            knots.rotate_left(1);
            if let [.., before, last] = knots {
                last.clone_from(before);
            }
        }
        Ok(())
    }

    /// Moves the horizon of `problem` by `elapsed` seconds, gives its knots new models and durations (s), and turns the
    /// solution into a warm start for it, as [`Fddp::retime`](crate::Fddp::retime) does. Multipliers come from the
    /// same knots as controls. If models differ, limits with the same name keep theirs. The multipliers are scaled by
    /// the durations of the knots. Allocates.
    ///
    /// # Errors
    /// The same errors as [`Fddp::retime`](crate::Fddp::retime).
    pub fn retime(
        &mut self,
        problem: &mut Problem,
        elapsed: f64,
        knot_models: &[usize],
        durations: &[f64],
    ) -> Result<usize, Error> {
        let passed = self.solver.retime(problem, &self.inner, elapsed, knot_models, durations)?;
        let counts: Vec<usize> = (0..=problem.horizon()).map(|t| problem.constraint_count(t)).collect();
        for multipliers in [&mut self.outcome.multipliers, &mut self.kept.multipliers] {
            let old = std::mem::take(multipliers);
            if old.len() != counts.len() {
                continue;
            }
            multipliers.extend(counts.iter().map(|&count| vec![0.0; count]));
            for (t, now) in multipliers.iter_mut().enumerate() {
                self.solver.retiming.each_rows(problem, t, &mut |to, knot, from, scale| {
                    if let (Some(now), Some(old)) = (now.get_mut(to), old[knot].get(from)) {
                        now.iter_mut().zip(old).for_each(|(now, old)| *now = scale * old);
                    }
                });
            }
        }
        problem.write_limit_rows(&mut self.outcome.limits);
        Ok(passed)
    }

    /// Forgets the last trajectory, its multipliers and the penalty, and starts anew from the state `x0`, as
    /// [`Fddp::reset`](crate::Fddp::reset) does; [`resume`](Self::resume) follows. Allocates.
    ///
    /// # Errors
    /// The same errors as [`Fddp::reset`](crate::Fddp::reset).
    pub fn reset(&mut self, problem: &mut Problem, x0: &[f64]) -> Result<(), Error> {
        self.solver.reset(problem, &self.inner, x0)?;
        (self.kept, self.lost) = (Kept::default(), false);
        Ok(())
    }

    /// Sets the multipliers of the limit `name`, one list for each knot 0 … N, which is empty at a knot without this
    /// limit. The result of [`Outcome::multipliers_of`] has this form. The next [`solve`](Self::solve) or
    /// [`resume`](Self::resume) starts from them. Other limits keep the multipliers of the last solve; without a
    /// solve, they start at zero. The penalty stays as well. The [`outcome`](Self::outcome) does not change.
    ///
    /// # Errors
    /// [`Error::Multipliers`] if no limit has this name, a length is wrong, or a number is not finite; then all
    /// multipliers are kept.
    pub fn set_multipliers(
        &mut self,
        problem: &mut Problem,
        name: &str,
        multipliers: &[impl AsRef<[f64]>],
    ) -> Result<(), Error> {
        let given = problem.check_multipliers(name, multipliers)?;
        let counts: Vec<usize> = (0..=problem.horizon()).map(|t| problem.constraint_count(t)).collect();
        let kept = &mut self.kept;
        if kept.penalty.is_none() || !kept.multipliers.iter().map(Vec::len).eq(counts.iter().copied()) {
            kept.multipliers = counts.iter().map(|&count| vec![0.0; count]).collect();
        }
        for (limit, y) in given {
            kept.multipliers[limit.knot][limit.rows].copy_from_slice(y);
        }
        kept.penalty = kept.penalty.or(Some(self.settings.penalty_start));
        (kept.failed, kept.given) = (false, true);
        Ok(())
    }

    /// Returns the result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solver.iterate.solution
    }

    /// Returns the results for the constraints of the last solve.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Sets the gains of the solution to zero, as in a new solver.
    pub(super) fn forget_gains(&mut self) {
        self.solver.forget_gains();
    }

    fn run(
        &mut self,
        problem: &mut Problem,
        warm_start: Option<[&[f64]; 2]>,
        observer: &mut dyn Observer,
    ) -> Result<&Solution, Error> {
        let mut watch = Watch::new(observer);
        let settings = Settings { project_warm_start: true, ..self.inner.clone() };
        self.solver.start_clock(&settings, &watch);
        let mut result = self.attempt(problem, &settings, warm_start, &mut watch);
        if let (Ok(status), Some(start)) = (&result, warm_start)
            && self.lost
            && self.settings.restart
        {
            result = self.restart(problem, &settings, start, *status, &mut watch);
        }
        if let Ok(status) = result {
            problem.multipliers(&mut self.outcome.multipliers);
            problem.write_limit_rows(&mut self.outcome.limits);
            self.kept.take(&self.outcome, status, self.lost);
        }
        problem.forget_multipliers();
        self.solver.iterate.solution.status = result?;
        Ok(self.solver.end(&settings, &watch))
    }

    /// Makes one attempt: repeats a pass of the solver's loop and an update of the multipliers or of the penalty.
    fn attempt(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        warm_start: Option<[&[f64]; 2]>,
        watch: &mut Watch<'_>,
    ) -> Result<Status, Error> {
        self.settings.check()?;
        let ConstraintSettings { tolerance, tolerance_dual, penalty_start, penalty_max, .. } = self.settings;
        if warm_start.is_some() && !std::mem::take(&mut self.kept.given) {
            self.kept.penalty = None;
        }
        self.kept.given = false;
        let penalty = self.kept.penalty.map_or(penalty_start, |penalty| penalty.clamp(penalty_start, penalty_max));
        let mut mu = 1.0 / penalty;
        problem.start_constraints(mu)?;
        if self.kept.penalty.is_some() {
            problem.set_multipliers(&self.kept.multipliers);
        }
        let Outcome { multipliers, limits, gave_way, .. } = std::mem::take(&mut self.outcome);
        self.outcome = Outcome { multipliers, limits, gave_way, penalty, ..Outcome::default() };
        self.lost = false;
        self.solver.begin(problem, settings, warm_start)?;
        // tolerances of one pass, both functions of μ: eta for the constraints, omega for the gradient
        let (mut eta, mut omega) = (mu.powf(0.1), mu);
        let mut progress = Progress { smallest: f64::INFINITY, stalled: 0 };
        let (mut status, mut continues) = (Status::MaxIterations, false);
        let mut residuals = Residuals { violation: f64::INFINITY, fixed: None, stationary: false };
        for solve in 0..self.settings.max_solves {
            // the tolerance of a pass is dual², because the expected decrease of the cost is about the square of the
            // gradient
            let dual = omega.max(0.1 * tolerance_dual);
            let resumes = warm_start.is_none() && solve == 0;
            self.solver.clock.reserve = self.measuring.median();
            let pass = Pass { tolerance: Some(dual * dual), trusts_start: true, resumes, continues, ..Pass::default() };
            let stopped = self.solver.pass(problem, settings, pass, watch);
            self.outcome.solves += 1;
            self.outcome.iterations += self.solver.iterate.solution.trace.len();
            // computes the violations z − Π z at the iterate, and the residuals of the stopping tests
            residuals = self.measure(problem);
            if matches!(stopped, Status::TimeLimit | Status::Interrupted | Status::NotFinite) {
                self.lost = stopped == Status::NotFinite;
                return Ok(stopped);
            }
            let (violation, gap) = (residuals.violation, self.solver.iterate.solution.gap);
            if larger(gap, violation) <= tolerance && self.outcome.dual <= tolerance_dual {
                problem.update_multipliers();
                status = Status::Converged;
                break;
            }
            status = if stopped == Status::Converged { Status::MaxIterations } else { stopped };
            let small = gap <= tolerance && self.outcome.dual <= dual;
            let solved = stopped == Status::Converged || residuals.stationary || small;
            continues = !solved;
            if !solved {
                let moved = self.solver.iterate.solution.trace.iter().any(|iteration| iteration.accepted);
                if stopped == Status::RegularisationLimit && !moved {
                    self.lost = violation > tolerance;
                    break; // the next pass would repeat this one
                }
                continue;
            }
            let met = violation <= eta.max(tolerance);
            if !met && mu > 1.0 / penalty_max {
                mu = (mu / self.settings.penalty_factor).max(1.0 / penalty_max);
                (eta, omega) = (mu.powf(0.1), mu);
                problem.set_penalty(mu);
                self.outcome.penalty = 1.0 / mu;
                continue;
            }
            problem.update_multipliers();
            (eta, omega) = ((eta * mu.powf(0.9)).max(0.1 * tolerance), omega * mu);
            if !met && progress.stalls(violation) {
                (status, self.lost) = (Status::ConstraintsViolated, true);
                break;
            }
        }
        // no control changes x₀ = x̂₀: if x̂₀ violates a constraint on x₀ alone, no trajectory satisfies that
        // constraint
        if let Some(proof) = residuals.fixed.filter(|violation| violation.amount > tolerance) {
            self.outcome.worst = Some(proof);
            return Ok(Status::Infeasible);
        }
        Ok(status)
    }

    /// Makes a second attempt after a failed one: from x̂₀ at all knots and the controls that hold x̂₀ still, with
    /// multipliers of zero. Returns the status of the better attempt, and keeps its solution and outcome. A converged
    /// attempt is better; if neither converged, the attempt with the smaller violation is better.
    ///
    /// Does nothing if the first attempt already had this start, or if no time is left. Also does nothing without
    /// constraints and bounds, because the solve is then a plain solve by [`Fddp`](crate::Fddp).
    fn restart(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        [xs, us]: [&[f64]; 2],
        status: Status,
        watch: &mut Watch<'_>,
    ) -> Result<Status, Error> {
        if self.solver.clock.is_over() || !(problem.check_bounds()? || problem.has_constraints()) {
            return Ok(status);
        }
        let [start_xs, start_us] = quasi_static_start(problem)?;
        let finite = start_us.iter().all(|u| u.is_finite());
        if !finite || (start_xs == xs && start_us == us) {
            return Ok(status);
        }
        problem.multipliers(&mut self.outcome.multipliers);
        let (solution, first, lost) = (self.solver.iterate.solution.clone(), self.outcome.clone(), self.lost);
        let second = self.attempt(problem, settings, Some([&start_xs, &start_us]), watch)?;
        let (solves, iterations) = (first.solves + self.outcome.solves, first.iterations + self.outcome.iterations);
        let solved = second == Status::Converged || second == Status::Infeasible && !self.lost;
        let mut kept = second;
        if !(solved || self.outcome.primal < first.primal) {
            let timings = self.solver.iterate.solution.timings;
            self.solver.iterate.solution = solution;
            self.solver.iterate.solution.timings = timings;
            (self.outcome, self.lost) = (first, lost);
            problem.set_multipliers(&self.outcome.multipliers);
            if !matches!(second, Status::TimeLimit | Status::Interrupted) {
                kept = status;
            }
        }
        (self.outcome.solves, self.outcome.iterations) = (solves, iterations);
        Ok(kept)
    }

    /// Computes the cost and the residuals at the iterate, with the multipliers y that the next update would give. The
    /// adjoint states λ are free in the optimality conditions. They are computed twice, without feedback and with the
    /// feedback of the last sweep, and the smaller residual counts.
    fn measure(&mut self, problem: &mut Problem) -> Residuals {
        let Self { settings, solver: SolverLoop { iterate, knots, .. }, outcome, adjoint, .. } = self;
        let begin = Instant::now();
        let Solution { xs, us, gap, cost, .. } = &iterate.solution;
        problem.calc_diff(xs, us, knots);
        let measured = problem.measure_constraints(xs[..problem.nx()] == *problem.x0());
        let violation = measured.worst.as_ref().map_or(0.0, |worst| worst.amount);
        (outcome.primal, outcome.cost) = (larger(*gap, violation), cost - measured.terms);
        outcome.soft_cost = problem.write_given_way(settings.tolerance, &mut outcome.gave_way, |bounded, t, _, i| {
            bounded.multipliers.distance(t, i)
        });
        outcome.worst = match iterate.largest_gap() {
            Some((knot, row, amount)) if amount > violation => Some(Violation::of_gap(knot, row, amount)),
            _ => measured.worst,
        };
        let [open, closed] = [false, true].map(|fed_back| slopes(problem, knots, &iterate.solution, adjoint, fed_back));
        outcome.dual = open.dual.min(closed.dual);
        for number in [&mut outcome.cost, &mut outcome.primal, &mut outcome.dual] {
            *number = if number.is_nan() { f64::INFINITY } else { *number };
        }
        self.measuring.add(begin.elapsed());
        let stationary = *gap <= settings.tolerance && open.free.min(closed.free) <= STATIONARY * measured.multiplier;
        Residuals { violation: measured.rest, fixed: measured.fixed, stationary }
    }
}
