//! Restoration of feasibility: a Levenberg–Marquardt method that minimises the violation of the constraints and the
//! gaps.

use super::InteriorPoint;
use super::step::sum_abs;
use crate::lq::{SweepError, SweepOutput};
use crate::problem::Problem;
use crate::solvers::settings::Settings;
use crate::solvers::solution::Status;
use crate::solvers::watch::{Phase, Watch};
use condyle_linalg::max_abs;

/// Maximum number of iterations.
const MOST: usize = 100;
/// Weight of the cost, which decides among trajectories with equal violations.
const COST_WEIGHT: f64 = 1e-6;
/// Fraction of the initial violation below which the restoration has succeeded.
const SUFFICIENT: f64 = 1e-2;
/// Relative decrease of the violation in an iteration, and number of consecutive iterations with at most this decrease,
/// by which a stationary point is recognised.
const STATIONARY: f64 = 1e-5;
const FLAT: usize = 3;
/// Smallest violation that counts as a proof of infeasibility.
const CERTAIN: f64 = 1e-4;

impl InteriorPoint {
    /// Reduces the violation v = ½ Σ w e² of the constraints, and closes the gaps. Here e are the distances from the
    /// bounds and w the weights of the rows. On success the slack variables and multipliers start anew at the
    /// trajectory.
    ///
    /// # Errors
    /// [`Status::Infeasible`] at a stationary point of v where a constraint is violated,
    /// [`Status::RegularisationLimit`] if no step is accepted elsewhere, [`Status::ConstraintsViolated`] after the
    /// maximum number of iterations, and the reasons to stop of any iteration.
    pub(super) fn restore(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        watch: &mut Watch<'_>,
    ) -> Result<(), Status> {
        let start = self.slacks.residuals().violation;
        let (mut regularisation, mut flat, mut weight) = (1e-3, 0, 1.0);
        for _ in 0..MOST {
            self.solver.clock.allows(&[Phase::CalcDiff, Phase::Sweep, Phase::Rollout], watch)?;
            self.linearise_violation(problem, settings);
            let decrease = loop {
                match self.sweep(problem, false, regularisation, SweepOutput::Factors) {
                    Err(SweepError::NotPositive { .. }) => {}
                    Err(_) => return Err(Status::NotFinite),
                    Ok(()) => {
                        // the merit is exact if the weight of the gaps exceeds their multipliers
                        let multipliers = self.solver.sweep.feedback().iter().map(|feedback| feedback.Vx.amax());
                        weight = multipliers.fold(weight, |weight: f64, lambda| weight.max(2.0 * lambda));
                        let before = self.restoration_merit(false, weight);
                        self.find_steps(problem);
                        let (cost, _) = self.try_step(problem, 1.0);
                        let after = self.restoration_merit(true, weight);
                        if cost.is_finite() && after < before {
                            self.accept_trial(cost);
                            regularisation = (0.1 * regularisation).max(settings.regularisation_min);
                            break (before - after) / before;
                        }
                    }
                }
                regularisation *= 10.0;
                if regularisation > settings.regularisation_max {
                    break 0.0;
                }
            };
            let (gap, violation) = (max_abs(&self.solver.iterate.gaps), self.slacks.residuals().violation);
            if violation.max(gap) <= (SUFFICIENT * start).max(0.1 * self.settings.tolerance) {
                self.differentiate(problem, settings, false);
                self.is_warm = false;
                self.start_slacks();
                return Ok(());
            }
            flat = if decrease <= STATIONARY { flat + 1 } else { 0 };
            if flat == FLAT || regularisation > settings.regularisation_max {
                let proved = gap <= self.settings.tolerance && violation > CERTAIN;
                return Err(if proved { Status::Infeasible } else { Status::RegularisationLimit });
            }
        }
        Err(Status::ConstraintsViolated)
    }

    /// Writes the linear-quadratic problem of the violation, with a small multiple of the cost.
    fn linearise_violation(&mut self, problem: &mut Problem, settings: &Settings) {
        self.differentiate(problem, settings, false);
        let Self { slacks, solver, step, .. } = self;
        for knot in &mut solver.knots {
            [&mut knot.Q, &mut knot.S, &mut knot.R].into_iter().for_each(|matrix| *matrix *= COST_WEIGHT);
            [&mut knot.q, &mut knot.r].into_iter().for_each(|gradient| *gradient *= COST_WEIGHT);
        }
        slacks.write_violation_terms(&mut solver.knots, &step.r, problem.shape());
    }

    /// Returns the merit of a restoration, v + `weight` Σ |f| with the gaps f, of the iterate or of the trial.
    fn restoration_merit(&self, of_trial: bool, weight: f64) -> f64 {
        let gaps = if of_trial { self.trial.gaps() } else { &self.solver.iterate.gaps };
        self.slacks.squared_violation(of_trial) + weight * sum_abs(gaps)
    }
}
