//! Interior point for constrained problems, whose Newton step is a sweep.
#![allow(non_snake_case)] // names follow the literature: K

mod filter;
mod iterations;
mod kkt;
mod prepared;
mod restoration;
mod settings;
mod slacks;
mod step;
mod tick;

use super::outcome::{Outcome, Violation};
use super::settings::Settings;
use super::solution::{Fallback, Iteration, Solution, Status};
use super::solver_loop::SolverLoop;
use super::start::{is_lost, quasi_static_start};
use super::watch::{Observer, Recent, Watch};
use crate::error::Error;
use crate::lq::SweepOutput;
use crate::problem::Problem;
use crate::time::Instant;
use condyle_linalg::max_abs;
use filter::Filter;
use kkt::{Adjoint, Coordinates, Kkt};
use prepared::PreparedTick;
pub use settings::InteriorPointSettings;
use slacks::Slacks;
use step::{Step, Trial};

/// Largest gap (rad, m, rad/s, m/s) after knot 1 with which a plan is resumed. Larger gaps follow from steps in a wrong
/// direction, for example after a wrong measurement.
const MOST_GAP: f64 = 10.0;

/// Primal–dual interior point with multiple shooting, for problems with [`Constrained`](crate::Constrained) actions,
/// robots with [`Limit`](crate::robot::Limit)s and bounds on controls.
///
/// ```text
/// minimise   Σ ℓ − μ Σ log(s − lower) − μ Σ log(upper − s)     subject to   the dynamics,   g(x, u) = s,   h(x, u) = 0
/// ```
///
/// An inequality g has a slack variable s and multipliers z of its bounds. Its Newton equations, with s and z
/// eliminated, are a row of the cost with the curvature Σ and the slope d:
///
/// ```text
/// Σ = z_l / (s − lower) + z_u / (upper − s),     d = Σ (g − s) + μ / (upper − s) − μ / (s − lower)
/// ```
///
/// An equation h is a row with the curvature 1/ρ and the slope y + h/ρ, and its multiplier becomes y + (h + ∂h δ)/ρ,
/// for ρ = 1e-8. It needs no rank condition: redundant equations share their multipliers. The rows enter the
/// [sweep](crate::Sweep), which therefore costs little more than a sweep without constraints.
///
/// One iteration is
///
/// ```text
/// derivatives   at the iterate; the iterate is optimal if the KKT error is below the tolerance
/// barrier       μ follows from the products z (s − lower), by LOQO's rule (Vanderbei and Shanno, 1999)
/// sweep         of the linear-quadratic problem with rows; repeated with more regularisation if Quu is not positive
/// step          x ⊕ α δx, u + α δu, s + α δs with gaps; no distance or multiplier falls by more than 99.5 %
/// line search   α is halved until a filter (Wächter and Biegler, 2006) accepts infeasibility and barrier function
/// ```
///
/// If no step is accepted, or the violation stalls, the method starts anew with careful steps, which lower a penalty of
/// the infeasibility. If that fails, too, a restoration minimises the violation of the constraints. It either returns
/// to the iterations, or ends at a stationary point of the violation. The status is then [`Status::Infeasible`], and
/// [`Outcome::worst`] has the knot, the row and the amount.
///
/// # Soft limits
/// A bound of a soft limit ([`Limit::softened`](crate::robot::Limit::softened)) gives way by a distance e ≥ 0, whose
/// cost is part of the problem. With d = upper + e − s and the multiplier w of e ≥ 0, the Newton equations of a bound
/// have four unknowns:
///
/// ```text
/// z d = μ,     w e = μ,     linear + quadratic · e = z + w
/// ```
///
/// They are eliminated as for other rows: the curvature is z / (d + c z) with c = 1 / (quadratic + w / e). If a limit
/// gives way, its curvature therefore falls to quadratic, while z / d would rise without bound. A soft equality has two
/// such bounds.
///
/// # The feedback
/// The gains K contain the rows: a row near its bound is stiff, so that the feedback keeps its distance. At the
/// solution, with μ near zero, active rows are equations. K does not move a control that is pressed against its bound,
/// and keeps g at its bound for deviations of the state.
///
/// # Constraints of the initial state
/// A constraint of knot 0 that depends on the state alone cannot be changed by any control. It is not imposed. If x̂₀
/// violates it by more than the tolerance, the solve ends as [`Status::Infeasible`] after all other conditions are met,
/// and [`Outcome::worst`] names the row.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, Constrained, InteriorPoint, LqKnot, PathConstraint, Problem, Status};
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
/// #     fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
/// #         (self.nu == 1).then_some((&[f64::NEG_INFINITY], &[0.6]))
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
/// // x⁺ = x + u with u ≤ 0.6, ℓ = ½ u², from 0 to 3 in 6 knots: u = ½ at each, and the multiplier is −½.
/// let end = Constrained::new(Box::new(Integrator { nu: 0 }), Box::new(Arrive));
/// let mut problem = Problem::new(vec![0.0], vec![Box::new(Integrator { nu: 1 })], vec![0; 6], Box::new(end))?;
/// let mut solver = InteriorPoint::new(&problem);
/// let solution = solver.solve(&mut problem, &[0.0; 7], &[0.0; 6])?;
/// assert_eq!(solution.status, Status::Converged);
/// assert!(solution.us.iter().all(|u| (u - 0.5).abs() < 1e-6));
/// assert!((solver.outcome().multipliers[6][0] + 0.5).abs() < 1e-5);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
///
/// Sources: Wächter and Biegler, *On the implementation of an interior-point filter line-search algorithm* (2006);
/// Vanderbei and Shanno, LOQO (1999), for μ; Vanroye, Sathya, De Schutter and Decré, *FATROP* (2023), for the
/// structure.
#[derive(Debug, Clone)]
pub struct InteriorPoint {
    /// Settings; may be changed between solves.
    pub settings: InteriorPointSettings,
    solver: SolverLoop,
    slacks: Slacks,
    filter: Filter,
    adjoint: Adjoint,
    outcome: Outcome,
    step: Step,
    trial: Trial,
    /// Planned state of knot 0, before x̂₀ replaced it.
    planned: Vec<f64>,
    /// Barrier parameter μ.
    mu: f64,
    /// Residuals of the optimality conditions, measured last.
    kkt: Kkt,
    /// Durations of the last sweeps for gains.
    finishing: Recent,
    /// Whether the slack variables and multipliers belong to the last trajectory.
    is_warm: bool,
    /// Whether multipliers were set since the last solve, so that also a new trajectory starts from them.
    is_given: bool,
    /// First part of a tick, which a state completes.
    prepared: Option<PreparedTick>,
}

impl InteriorPoint {
    /// Creates a solver with the default settings and the workspace for problems with the dimensions of `problem`.
    pub fn new(problem: &Problem) -> Self {
        Self {
            settings: InteriorPointSettings::default(),
            solver: SolverLoop::new(problem),
            slacks: Slacks::default(),
            filter: Filter::default(),
            adjoint: Adjoint::default(),
            outcome: Outcome::default(),
            step: Step::new(problem),
            trial: Trial::new(problem),
            planned: problem.x0().to_vec(),
            mu: 0.0,
            kkt: Kkt::default(),
            finishing: Recent::default(),
            is_warm: false,
            is_given: false,
            prepared: None,
        }
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat.
    ///
    /// The status is [`Status::Converged`] when the KKT error is below the tolerance. A violated constraint is never
    /// reported as satisfied. The cost of the solution is Σ ℓ, without terms of the constraints.
    ///
    /// # Errors
    /// [`Error`] as for [`Fddp::solve`](crate::Fddp::solve), or if no value satisfies the bounds of a constraint.
    pub fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut |_: &Iteration| {})
    }

    /// Solves as [`solve`](Self::solve) does, and passes each iteration to `observer` when it ends. The observer may
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

    /// Solves `problem` from the last solution and its multipliers: with a new initial state, new references or, after
    /// [`shift`](Self::shift), for the next horizon.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume(&mut self, problem: &mut Problem) -> Result<&Solution, Error> {
        self.run(problem, None, &mut |_: &Iteration| {})
    }

    /// Solves as [`resume`](Self::resume) does, and passes each iteration to `observer` when it ends. The observer may
    /// end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume_with(&mut self, problem: &mut Problem, mut observer: impl Observer) -> Result<&Solution, Error> {
        self.run(problem, None, &mut observer)
    }

    /// Turns the solution, its slack variables and multipliers into a warm start for a problem that has since been
    /// [shifted](Problem::shift) by one knot, as [`Fddp::shift`](crate::Fddp::shift) does. The new last knot gets the
    /// multipliers of the knot before it, if both knots have the same number of constraints.
    ///
    /// # Errors
    /// [`Error`] if the numbers of knots, states and controls differ from the numbers of the last problem, shifted
    /// once.
    pub fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let settings = self.settings.shared()?;
        self.prepared = None;
        self.solver.shift(problem, &settings)?;
        self.step.reshape(problem);
        self.trial.reshape(problem);
        if self.is_warm {
            self.slacks.shift(problem)?;
        }
        Ok(())
    }

    /// Moves the horizon of `problem` by `elapsed` seconds, gives its knots new models and durations (s), and turns the
    /// solution into a warm start for it, as [`Fddp::retime`](crate::Fddp::retime) does. Slack variables and
    /// multipliers come from the same knots as controls. If models differ, limits with the same name keep theirs. The
    /// multipliers are scaled by the durations of the knots.
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
        let settings = self.settings.shared()?;
        let passed = self.solver.retime(problem, &settings, elapsed, knot_models, durations)?;
        self.step.reshape(problem);
        self.trial.reshape(problem);
        self.prepared = None;
        if self.is_warm {
            self.slacks.retime(problem, &self.solver.retiming)?;
        }
        Ok(passed)
    }

    /// Makes one linearisation at the last trajectory and up to `sweeps` steps of the interior point for the quadratic
    /// program that results, as a controller does in each period. The time is known in advance: no step is searched.
    /// Steps end earlier when the program is solved, or when the [time budget](InteriorPointSettings::time_budget) is
    /// used up; one step is always made. The gains belong to the last step.
    ///
    /// The status of the solution is [`Status::MaxIterations`] if all steps were made, and [`Status::Converged`] if the
    /// quadratic program is solved. The plan begins at x̄₀ = x̂₀. The cost of the solution is the cost of the trajectory
    /// before the tick.
    ///
    /// If a sweep fails, the plan is a rollout of the last plan from x̂₀ with its gains. The status is then
    /// [`Status::RegularisationLimit`], and [`Solution::fallback`] says so. If the rollout diverges, too, the status is
    /// [`Status::NotFinite`]: see [`Solution::is_executable`].
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn tick(&mut self, problem: &mut Problem, sweeps: usize) -> Result<&Solution, Error> {
        self.tick_with(problem, sweeps, |_: &Iteration| {})
    }

    /// Makes a tick as [`tick`](Self::tick) does. The observer may end it between two sweeps
    /// ([`Observer::go_on`]); it receives no iterations.
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn tick_with(
        &mut self,
        problem: &mut Problem,
        sweeps: usize,
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        let settings = self.settings.shared()?;
        let mut watch = Watch::new(&mut observer);
        let disturbance = self.begin(problem, &settings, None, &watch)?;
        self.mu = self.tick_barrier(disturbance);
        let status = self.solve_linearisation(problem, &settings, sweeps.max(1), &mut watch);
        self.report(problem, status);
        self.outcome.dual = f64::INFINITY; // not measured
        Ok(self.solver.end(&settings, &watch))
    }

    /// Forgets the last trajectory and its multipliers, and starts anew from the state `x0`, as
    /// [`Fddp::reset`](crate::Fddp::reset) does. This is the recovery after [`Status::NotFinite`];
    /// [`resume`](Self::resume), [`tick`](Self::tick) or [`prepare`](Self::prepare) follow. Allocates.
    ///
    /// # Errors
    /// The same errors as [`Fddp::reset`](crate::Fddp::reset).
    pub fn reset(&mut self, problem: &mut Problem, x0: &[f64]) -> Result<(), Error> {
        let settings = self.settings.shared()?;
        self.solver.reset(problem, &settings, x0)?;
        (self.is_warm, self.is_given, self.prepared, self.mu) = (false, false, None, 0.0);
        Ok(())
    }

    /// Sets the multipliers of the limit `name`, one list for each knot 0 … N, which is empty at a knot without this
    /// limit. The result of [`Outcome::multipliers_of`] has this form. The next [`solve`](Self::solve),
    /// [`resume`](Self::resume) or [`tick`](Self::tick) starts from them. Other limits keep the multipliers of the last
    /// solve; without a solve, they start at the central path. The [`outcome`](Self::outcome) does not change.
    ///
    /// A positive number belongs to the upper bound, a negative one to the lower bound. Numbers without such a bound
    /// have no effect, and numbers far from the central path are moved towards it.
    ///
    /// # Errors
    /// [`Error::Multipliers`] if no limit has this name, a length is wrong, or a number is not finite; then all
    /// multipliers are kept. The errors of [`solve`](Self::solve) for invalid bounds.
    pub fn set_multipliers(
        &mut self,
        problem: &mut Problem,
        name: &str,
        multipliers: &[impl AsRef<[f64]>],
    ) -> Result<(), Error> {
        let given = problem.check_multipliers(name, multipliers)?;
        self.prepared = None;
        let rows = self.slacks.len();
        self.slacks.arrange(problem)?;
        if !self.is_warm || self.slacks.len() != rows {
            self.slacks.forget();
        }
        for (limit, y) in given {
            self.slacks.set_multipliers(limit.knot, limit.rows.start, y);
        }
        (self.is_warm, self.is_given) = (true, true);
        Ok(())
    }

    /// Returns the result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solver.iterate.solution
    }

    /// Returns the state of the constraints after the last solve.
    pub fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Sets the gains of the solution to zero, as in a new solver.
    pub(in crate::solvers) fn forget_gains(&mut self) {
        self.solver.forget_gains();
    }

    fn run(
        &mut self,
        problem: &mut Problem,
        warm_start: Option<[&[f64]; 2]>,
        observer: &mut dyn Observer,
    ) -> Result<&Solution, Error> {
        let settings = self.settings.shared()?;
        let mut watch = Watch::new(observer);
        self.begin(problem, &settings, warm_start, &watch)?;
        let status = self.make_iterations(problem, &settings, &mut watch);
        let status = self.finish(problem, &settings, status);
        self.report(problem, status);
        Ok(self.solver.end(&settings, &watch))
    }

    /// Begins a solve: checks the arguments, sets x₀ = x̂₀, and evaluates the start. In a resumed solve, a trajectory
    /// with large gaps is replaced by its rollout. A lost trajectory is replaced by x̂₀ held still, as in
    /// [`Fddp::resume`](crate::Fddp::resume). Returns the cost of the
    /// [disturbance](Self::disturbance).
    fn begin(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        warm_start: Option<[&[f64]; 2]>,
        watch: &Watch<'_>,
    ) -> Result<f64, Error> {
        self.prepared = None;
        self.solver.begin(problem, settings, warm_start)?;
        self.is_warm &= warm_start.is_none() || self.is_given;
        self.is_given = false;
        self.solver.start_clock(settings, watch);
        self.solver.clock.reserve = self.finishing.median();
        self.slacks.arrange(problem)?;
        self.trial.start(problem, self.slacks.most(), self.equations(false));
        let disturbance = self.disturbance(problem);
        let solution = &mut self.solver.iterate.solution;
        solution.trace.clear();
        solution.trace.reserve(settings.max_iterations.min(1000));
        let first = &mut solution.xs[..problem.nx()];
        self.planned.copy_from_slice(first);
        first.copy_from_slice(problem.x0());
        self.solver.sweep.keep_values(false);
        self.solver.best.start();
        let last_cost = solution.cost;
        self.trial.set(&solution.xs, &solution.us);
        let cost = self.evaluate_trial(problem);
        self.accept_trial(cost);
        let gap = max_abs(&self.solver.iterate.gaps);
        // the gap after x̂₀ is the measured disturbance; the others are left by the last steps
        let left = max_abs(self.solver.iterate.gaps.get(2 * problem.ndx()..).unwrap_or(&[]));
        let is_broken = left > MOST_GAP || left.is_nan();
        if warm_start.is_some() || !(is_broken || is_lost(cost, gap, last_cost)) {
            return Ok(disturbance);
        }
        let cost_of_rollout = self.roll_out(problem);
        if is_broken && !is_lost(cost_of_rollout, max_abs(self.trial.gaps()), last_cost) {
            self.accept_trial(cost_of_rollout);
            self.solver.iterate.solution.fallback = Some(Fallback::RolledOut);
        } else if let Ok([xs, us]) = quasi_static_start(problem) {
            self.trial.set(&xs, &us);
            let start_cost = self.evaluate_trial(problem);
            if start_cost.is_finite() && (is_broken || !(gap.is_finite() && start_cost >= cost)) {
                self.accept_trial(start_cost);
                self.planned.copy_from_slice(problem.x0());
                self.solver.iterate.solution.fallback = Some(Fallback::HeldStill);
                self.is_warm = false;
            }
        }
        Ok(disturbance)
    }

    /// Returns whether knots of robots are differentiated as equations of inverse dynamics, which have no curvature.
    fn equations(&self, curved: bool) -> bool {
        self.settings.inverse_dynamics_form && !curved
    }

    /// Goes back to the best iterate if the last one is worse, and computes the gains there. Returns the status.
    fn finish(&mut self, problem: &mut Problem, settings: &Settings, status: Status) -> Status {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        if status != Status::Converged {
            let gap = infinite_if_nan(max_abs(&self.solver.iterate.gaps));
            let violation = infinite_if_nan(self.slacks.residuals().violation);
            let mut merit = self.best_merit(&Kkt { gap, violation, ..self.kkt }, 0);
            merit.cost = infinite_if_nan(merit.cost);
            let goes_back = status == Status::NotFinite || self.solver.best.is_better_than(&merit);
            if goes_back && self.solver.best.restore(&mut self.solver.iterate).is_some() {
                let Solution { xs, us, .. } = &self.solver.iterate.solution;
                self.trial.set(xs, us);
                let cost = self.evaluate_trial(problem);
                self.accept_trial(cost);
            }
        }
        if status != Status::NotFinite {
            if !matches!(status, Status::Converged | Status::TimeLimit) {
                self.differentiate(problem, settings, self.equations(false));
                self.kkt = self.measure(problem, Coordinates::Controls);
            }
            self.slacks.write_terms(&mut self.solver.knots, &self.step.r, problem.shape(), self.mu);
            self.sweep_for_gains(problem, settings.regularisation_min);
        }
        // a stationary point of the violation elsewhere proves nothing about a feasible iterate
        let is_violated = self.slacks.residuals().violation > 0.1 * self.settings.tolerance;
        if status == Status::Infeasible && !is_violated { Status::RegularisationLimit } else { status }
    }

    /// Writes the gains of the present terms to the solution. Where the sweep fails, no step was found either, and the
    /// gains of the last solve are kept.
    fn sweep_for_gains(&mut self, problem: &mut Problem, regularisation: f64) {
        let begin = Instant::now();
        if self.sweep(problem, false, regularisation, SweepOutput::Gains).is_ok() {
            self.write_gains();
        }
        self.finishing.add(begin.elapsed());
    }

    /// Copies the gains of the last sweep to the solution.
    fn write_gains(&mut self) {
        let (solution, feedback) = (&mut self.solver.iterate.solution, self.solver.sweep.feedback());
        for ((K, k), feedback) in solution.K.iter_mut().zip(&mut solution.k).zip(feedback) {
            K.copy_from(&feedback.K);
            k.copy_from(&feedback.k);
        }
    }

    /// Completes the solution, and writes the outcome.
    fn report(&mut self, problem: &mut Problem, status: Status) {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        let (rows, tolerance) = (self.slacks.residuals(), self.settings.tolerance);
        let iterate = &mut self.solver.iterate;
        let largest_gap = iterate.largest_gap();
        let solution = &mut iterate.solution;
        solution.gap = infinite_if_nan(max_abs(&iterate.gaps));
        solution.cost = infinite_if_nan(solution.cost);
        solution.feasible = solution.gap <= tolerance;
        solution.status = status;
        self.outcome.worst = match largest_gap {
            Some((knot, row, amount)) if amount > rows.violation => Some(Violation::of_gap(knot, row, amount)),
            _ => self.slacks.worst(problem, true),
        };
        let fixed = self.slacks.worst(problem, false).filter(|violation| violation.amount > tolerance);
        if status == Status::Converged && fixed.is_some() {
            (solution.status, self.outcome.worst) = (Status::Infeasible, fixed);
        }
        self.outcome.cost = solution.cost;
        self.outcome.soft_cost = self.slacks.write_given_way(problem, tolerance, &mut self.outcome.gave_way);
        self.outcome.primal = infinite_if_nan(rows.violation).max(solution.gap);
        self.outcome.dual = infinite_if_nan(self.kkt.gradient);
        (self.outcome.iterations, self.outcome.solves) = (solution.trace.len(), 1);
        (self.outcome.penalty, self.outcome.barrier) = (0.0, self.mu);
        self.slacks.write_multipliers(&mut self.outcome.multipliers);
        problem.write_limit_rows(&mut self.outcome.limits);
    }
}
