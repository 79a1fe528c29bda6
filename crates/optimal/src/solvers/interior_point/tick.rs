//! Ticks: a known number of steps for the quadratic program of one linearisation.
#![allow(non_snake_case)] // names follow the literature: V

use super::InteriorPoint;
use super::iterations::{FIRST_REGULARISATION, TAU};
use crate::lq::{SweepError, SweepOutput};
use crate::problem::Problem;
use crate::solvers::settings::Settings;
use crate::solvers::solution::Status;
use crate::solvers::solver_loop::SolverLoop;
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
        if !self.solver.iterate.solution.cost.is_finite() {
            return Status::NotFinite;
        }
        self.differentiate(problem, settings, self.equations(false));
        match self.is_warm {
            true => self.slacks.resume(self.mu),
            false => self.start_slacks(),
        }
        self.step.start_sum();
        let (mut regularisation, mut alpha) = (settings.regularisation_min, 1.0);
        let (mut status, mut has_gains) = (Status::MaxIterations, false);
        for sweep in 0..sweeps {
            if sweep > 0 {
                self.lower_barrier(alpha);
                if let Err(stop) = self.solver.clock.allows(&[Phase::Sweep], watch) {
                    status = stop;
                    break;
                }
            }
            self.slacks.write_terms(&mut self.solver.knots, &self.step.r, problem.shape(), self.mu);
            has_gains = sweep + 1 == sweeps;
            let output = if has_gains { SweepOutput::Both } else { SweepOutput::Factors };
            while let Err(error) = self.sweep(problem, false, regularisation, output) {
                regularisation = settings.increased(regularisation).max(FIRST_REGULARISATION);
                if !matches!(error, SweepError::NotPositive { .. }) || regularisation >= settings.regularisation_max {
                    return Status::NotFinite;
                }
            }
            self.find_steps(problem);
            let [primal, dual] = self.slacks.step_lengths(TAU);
            alpha = primal;
            self.step.add_to_sum(primal);
            self.slacks.advance(primal, dual, self.mu);
            self.solver.clock.end_guarantee();
            let complementarity = self.slacks.residuals().complementarity;
            if primal.min(dual) == 1.0 && complementarity <= SOLVED * self.settings.tolerance {
                status = Status::Converged;
                break;
            }
        }
        self.apply_sum(problem);
        if !has_gains {
            self.sweep_for_gains(problem, regularisation);
        } else {
            self.write_gains();
        }
        status
    }
}
