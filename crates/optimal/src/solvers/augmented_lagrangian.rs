//! Solver of constrained problems by an augmented Lagrangian method.

use super::outcome::{Outcome, Violation, ViolationKind};
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
///          if the violation is below the tolerance η:   y ← (z − Π z) / μ,   and η and ω become smaller
///          else:                                        μ becomes smaller
/// until    the violations, and the gradient of the Lagrangian ℓ + yᵀg under the dynamics, are below the tolerances
/// ```
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
    /// Adjoint state λ of a knot, and scratch for the adjoint state of the previous knot.
    adjoint: [DVector<f64>; 2],
    /// Last durations of `measure`.
    measuring: Recent,
    /// Whether the next solve must reset the multipliers and the penalty.
    lost: bool,
}

/// Residuals of the stopping tests that [`Outcome`] does not contain.
struct Residuals {
    /// Largest gap, or largest violation of a constraint that controls can change, whichever is larger.
    primal: f64,
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
            adjoint: [(); 2].map(|()| DVector::zeros(problem.ndx())),
            measuring: Recent::default(),
            lost: false,
        }
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat, with multipliers that
    /// start at zero.
    ///
    /// The status is [`Status::Converged`] when the residuals of [`outcome`](Self::outcome) are below the tolerances.
    /// It is [`Status::ConstraintsViolated`] if the penalty reached its limit and the inner solve found a minimum at
    /// which the constraints do not hold. It is [`Status::Infeasible`] if x̂₀ violates a constraint of knot 0 that is a
    /// function of the state alone; the solve then continues under the other constraints. In all other cases the status
    /// is the status of the inner solve that stopped early.
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
    /// state or new references, or may be [shifted](Self::shift) to the next horizon. If the last solve ended as
    /// [`Status::NotFinite`], or with violated constraints at the largest penalty, the multipliers and the penalty are
    /// reset. The multipliers then start at zero, and the penalty at its first value.
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
        if let Some(knots) = self.outcome.multipliers.get_mut(..horizon) {
            knots.rotate_left(1);
            if let [.., before, last] = knots {
                last.clone_from(before);
            }
        }
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
        if result.is_ok() {
            problem.multipliers(&mut self.outcome.multipliers);
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
        let goes_on = warm_start.is_none() && !self.lost && self.outcome.solves > 0;
        let ConstraintSettings { tolerance, tolerance_dual, penalty_start, penalty_max, .. } = self.settings;
        let penalty = if goes_on { self.outcome.penalty.clamp(penalty_start, penalty_max) } else { penalty_start };
        let mut mu = 1.0 / penalty;
        problem.start_constraints(mu)?;
        if goes_on {
            problem.set_multipliers(&self.outcome.multipliers);
        }
        let multipliers = std::mem::take(&mut self.outcome.multipliers);
        self.outcome = Outcome { multipliers, penalty, ..Outcome::default() };
        self.lost = false;
        self.solver.begin(problem, settings, warm_start)?;
        // tolerances of one pass, both functions of μ: eta for the constraints, omega for the gradient
        let (mut eta, mut omega) = (mu.powf(0.1), mu);
        let mut status = Status::MaxIterations;
        let mut residuals = Residuals { primal: f64::INFINITY, fixed: None, stationary: false };
        for solve in 0..self.settings.max_solves {
            // the tolerance of a pass is dual², because the expected decrease of the cost is about the square of the
            // gradient
            let dual = omega.max(0.1 * tolerance_dual);
            let resumes = warm_start.is_none() && solve == 0;
            self.solver.clock.reserve = self.measuring.median();
            let pass = Pass { tolerance: Some(dual * dual), trusts_start: true, resumes };
            let stopped = self.solver.pass(problem, settings, pass, watch);
            self.outcome.solves += 1;
            self.outcome.iterations += self.solver.iterate.solution.trace.len();
            // computes the violations z − Π z at the iterate, and the residuals of the stopping tests
            residuals = self.measure(problem);
            if matches!(stopped, Status::TimeLimit | Status::Interrupted | Status::NotFinite) {
                self.lost = stopped == Status::NotFinite;
                return Ok(stopped);
            }
            if residuals.primal <= eta.max(tolerance) {
                problem.update_multipliers();
                if residuals.primal <= tolerance && self.outcome.dual <= tolerance_dual {
                    status = Status::Converged;
                    break;
                }
                eta = (eta * mu.powf(0.9)).max(0.1 * tolerance);
                omega *= mu;
            } else {
                if mu <= 1.0 / penalty_max {
                    let solved = stopped == Status::Converged || residuals.stationary;
                    (status, self.lost) = (if solved { Status::ConstraintsViolated } else { stopped }, true);
                    break;
                }
                mu = (mu / self.settings.penalty_factor).max(1.0 / penalty_max);
                (eta, omega) = (mu.powf(0.1), mu);
                problem.set_penalty(mu);
                self.outcome.penalty = 1.0 / mu;
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

    /// Computes the cost and the residuals at the iterate, by the recursion λ = q + Aᵀλ⁺ and the gradient ∂L/∂u = r +
    /// Bᵀλ⁺ at each knot. The vectors q and r contain the terms yᵀ∂g of the constraints, with the multipliers y that
    /// the next update would give.
    fn measure(&mut self, problem: &mut Problem) -> Residuals {
        let Self { settings, solver: SolverLoop { iterate, knots, .. }, outcome, adjoint: [lambda, before], .. } = self;
        let (horizon, begin) = (problem.horizon(), Instant::now());
        let Solution { xs, us, gap, cost, .. } = &iterate.solution;
        problem.calc_diff(xs, us, knots);
        let measured = problem.measure_constraints(xs[..problem.nx()] == *problem.x0());
        let violation = measured.worst.as_ref().map_or(0.0, |worst| worst.amount);
        (outcome.primal, outcome.cost, outcome.dual) = (larger(*gap, violation), cost - measured.terms, 0.0);
        outcome.worst = match iterate.largest_gap() {
            Some((knot, row, amount)) if amount > violation => {
                Some(Violation { kind: ViolationKind::Gap, knot, row, name: None, entry: row, amount })
            }
            _ => measured.worst,
        };
        let primal = larger(*gap, measured.rest);
        let mut slope_of_free = 0.0; // largest ∂L/∂u of controls that are not pressed against a bound
        lambda.copy_from(&knots[horizon].q);
        for t in (0..horizon).rev() {
            let knot = &knots[t];
            let u = &us[problem.control_range(t)];
            for (j, u) in u.iter().enumerate() {
                let slope = knot.r[j] + knot.B.column(j).dot(lambda);
                let (lower, upper) = match problem.action(t).bounds(t) {
                    Some((lower, upper)) => (lower[j], upper[j]),
                    None => (f64::NEG_INFINITY, f64::INFINITY),
                };
                // at a minimum, u equals u − ∂L/∂u projected on the bounds of u
                let projected = if slope.is_nan() { slope } else { (u - slope).min(upper).max(lower) };
                outcome.dual = larger(outcome.dual, (u - projected).abs());
                if !(*u <= lower && slope > 0.0 || *u >= upper && slope < 0.0) {
                    slope_of_free = larger(slope_of_free, slope.abs());
                }
            }
            before.copy_from(&knot.q);
            before.gemv_tr(1.0, &knot.A, lambda, 1.0);
            std::mem::swap(lambda, before);
        }
        for number in [&mut outcome.cost, &mut outcome.primal, &mut outcome.dual] {
            *number = if number.is_nan() { f64::INFINITY } else { *number };
        }
        self.measuring.add(begin.elapsed());
        let stationary = *gap <= settings.tolerance && slope_of_free <= STATIONARY * measured.multiplier;
        Residuals { primal, fixed: measured.fixed, stationary }
    }
}

/// Returns the larger of two numbers, or NaN if one of them is NaN.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}
