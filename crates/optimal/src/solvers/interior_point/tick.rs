//! Ticks: a known number of steps for the quadratic program of one linearisation.
#![allow(non_snake_case)] // names follow the literature: V

use super::InteriorPoint;
use super::iterations::{FIRST_REGULARISATION, TAU};
use crate::lq::{SweepError, SweepOutput};
use crate::problem::Problem;
use crate::solvers::settings::Settings;
use crate::solvers::solution::{Fallback, Solution, Status};
use crate::solvers::solver_loop::SolverLoop;
use crate::solvers::start::is_lost;
use crate::solvers::watch::{Phase, Watch};
use condyle_linalg::dot;

/// Largest complementarity of a quadratic program that counts as solved, relative to the tolerance.
const SOLVED: f64 = 10.0;
/// Barrier parameter μ of the first sweep of a tick, relative to the cost of the disturbance.
const PER_DISTURBANCE: f64 = 0.03;
/// Smallest value of this μ, relative to the cost of the plan divided by the number of bounds.
const PER_COST: f64 = 0.01;
/// Smallest ratio of this μ to the last μ of the tick before: one linearisation does not end a large disturbance.
const REMEMBERED: f64 = 0.7;

/// Steps for the quadratic program of one linearisation, so far.
#[derive(Debug, Clone, Copy)]
pub(super) struct ProgramSteps {
    /// Number of sweeps.
    pub(super) sweeps: usize,
    pub(super) regularisation: f64,
    /// Length of the last step.
    alpha: f64,
    /// Whether the last sweep computed gains.
    has_gains: bool,
}

impl InteriorPoint {
    /// Returns the cost of the disturbance d = x̂₀ ⊖ x̄₀, by which the initial state differs from the state of the plan:
    ///
    /// ```text
    /// ½ dᵀ V d,     V: Hessian of the value function at knot 0, from the last sweep
    /// ```
    pub(super) fn disturbance(&mut self, problem: &Problem) -> f64 {
        let Self { solver: SolverLoop { iterate, sweep, .. }, step, .. } = self;
        let (Vxx, d) = (&sweep.feedback()[0].Vxx, &mut step.dx[..problem.ndx()]);
        problem.action(0).difference(&iterate.solution.xs[..problem.nx()], problem.x0(), d);
        d.iter().zip(Vxx.column_iter()).map(|(x, column)| 0.5 * x * dot(column.as_slice(), d)).sum()
    }

    /// Returns the barrier parameter for the first sweep of a tick. A disturbance changes the set of rows that are
    /// active. With a small μ, only the rows that were active before would have curvature.
    pub(super) fn tick_barrier(&self, disturbance: f64) -> f64 {
        let mean_cost = self.solver.iterate.solution.cost.abs() / self.slacks.bound_count().max(1) as f64;
        let least = (REMEMBERED * self.mu).max(PER_COST * mean_cost).max(0.01 * self.settings.tolerance);
        self.disturbed_barrier(disturbance, least)
    }

    /// Returns the barrier parameter for a disturbance, at least `least`.
    pub(super) fn disturbed_barrier(&self, disturbance: f64, least: f64) -> f64 {
        (PER_DISTURBANCE * disturbance).max(least).min(self.settings.tick_barrier) // a NaN becomes the least μ
    }

    /// Makes steps for the quadratic program at the iterate. With the present s, z and y, each sweep finds the whole
    /// step Δ from the linearisation; the combined step moves towards Δ by the step length.
    pub(super) fn solve_linearisation(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        sweeps: usize,
        watch: &mut Watch<'_>,
    ) -> Status {
        match self.start_program(problem, settings).and_then(|mut now| {
            let status = self.step_program(problem, settings, &mut now, sweeps, watch)?;
            self.end_program(problem, now)?;
            Ok(status)
        }) {
            Ok(status) => status,
            Err(status) => self.fall_back(problem, status),
        }
    }

    /// Computes the quadratic program at the iterate, and moves s and z to the neighbourhood of the central path.
    ///
    /// # Errors
    /// [`Status::NotFinite`] if the cost of the iterate is not finite.
    pub(super) fn start_program(&mut self, problem: &mut Problem, settings: &Settings) -> Result<ProgramSteps, Status> {
        self.slacks.save();
        if !self.solver.iterate.solution.cost.is_finite() {
            return Err(Status::NotFinite);
        }
        self.differentiate(problem, settings, self.equations(false));
        Ok(self.center(settings))
    }

    /// Starts the steps for the quadratic program, with the present μ.
    pub(super) fn center(&mut self, settings: &Settings) -> ProgramSteps {
        match self.is_warm {
            true => self.slacks.resume(self.mu),
            false => self.start_slacks(),
        }
        self.step.start_sum();
        ProgramSteps { sweeps: 0, regularisation: settings.regularisation_min, alpha: 1.0, has_gains: false }
    }

    /// Makes steps until there were `sweeps` sweeps, or the quadratic program is solved. Returns the status.
    ///
    /// # Errors
    /// The errors of [`sweep_program`](Self::sweep_program).
    pub(super) fn step_program(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut ProgramSteps,
        sweeps: usize,
        watch: &mut Watch<'_>,
    ) -> Result<Status, Status> {
        while now.sweeps < sweeps {
            if now.sweeps > 0
                && let Err(stop) = self.solver.clock.allows(&[Phase::Sweep], watch)
            {
                return Ok(stop);
            }
            let is_last = now.sweeps + 1 == sweeps;
            self.sweep_program(problem, settings, now, is_last)?;
            if self.make_program_step(problem, now) {
                return Ok(Status::Converged);
            }
        }
        Ok(Status::MaxIterations)
    }

    /// Makes a sweep for the quadratic program. Repeats it with a larger regularisation while it fails.
    ///
    /// # Errors
    /// [`Status::NotFinite`] if a number is not finite, [`Status::RegularisationLimit`] at the largest regularisation.
    pub(super) fn sweep_program(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        now: &mut ProgramSteps,
        with_gains: bool,
    ) -> Result<(), Status> {
        if now.sweeps > 0 {
            self.lower_barrier(now.alpha);
        }
        self.slacks.write_terms(&mut self.solver.knots, &self.step.r, problem.shape(), self.mu);
        let output = if with_gains { SweepOutput::Both } else { SweepOutput::Factors };
        while let Err(error) = self.sweep(problem, false, now.regularisation, output) {
            now.regularisation = settings.increased(now.regularisation).max(FIRST_REGULARISATION);
            if !matches!(error, SweepError::NotPositive { .. }) {
                return Err(Status::NotFinite);
            }
            if now.regularisation >= settings.regularisation_max {
                return Err(Status::RegularisationLimit);
            }
        }
        (now.sweeps, now.has_gains) = (now.sweeps + 1, with_gains);
        Ok(())
    }

    /// Makes the step of the last sweep. Returns whether it solves the quadratic program.
    pub(super) fn make_program_step(&mut self, problem: &Problem, now: &mut ProgramSteps) -> bool {
        self.find_steps(problem);
        let [primal, dual] = self.slacks.step_lengths(TAU);
        now.alpha = primal;
        self.step.add_to_sum(primal);
        self.slacks.advance(primal, dual, self.mu);
        self.solver.clock.end_guarantee();
        let complementarity = self.slacks.residuals().complementarity;
        primal.min(dual) == 1.0 && complementarity <= SOLVED * self.settings.tolerance
    }

    /// Moves the trajectory by the combined step, from x̂₀, and writes the gains of the last sweep to the solution.
    ///
    /// # Errors
    /// [`Status::NotFinite`] if a number of the new trajectory is not finite; then the trajectory does not move.
    pub(super) fn end_program(&mut self, problem: &mut Problem, now: ProgramSteps) -> Result<(), Status> {
        self.apply_sum(problem)?;
        match now.has_gains {
            true => self.write_gains(),
            false => self.sweep_for_gains(problem, now.regularisation),
        }
        Ok(())
    }

    /// Replaces the trajectory by its rollout from x̂₀ with the last gains, after a sweep or a step that failed.
    /// Multipliers become those before the tick. Returns the status of the tick: `status`, unless the rollout diverges.
    pub(super) fn fall_back(&mut self, problem: &mut Problem, status: Status) -> Status {
        let last_cost = self.solver.iterate.solution.cost;
        let cost = self.roll_out(problem);
        if is_lost(cost, 0.0, last_cost) {
            return Status::NotFinite;
        }
        self.accept_trial(cost);
        self.slacks.restore();
        let solution: &mut Solution = &mut self.solver.iterate.solution;
        solution.fallback = Some(Fallback::RolledOut);
        match status {
            Status::NotFinite => Status::RegularisationLimit,
            status => status,
        }
    }
}
