//! Ticks: a known number of steps for the quadratic program of one linearisation.

use super::InteriorPoint;
use super::iterations::{FIRST_REGULARISATION, TAU};
use crate::lq::{SweepError, SweepOutput};
use crate::problem::Problem;
use crate::solvers::settings::Settings;
use crate::solvers::solution::Status;
use crate::solvers::watch::{Phase, Watch};

/// Largest complementarity of a quadratic program that counts as solved, relative to the tolerance.
const SOLVED: f64 = 10.0;

impl InteriorPoint {
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
        self.start_slacks();
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
