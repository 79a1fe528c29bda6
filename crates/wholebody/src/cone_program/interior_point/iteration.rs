//! Iteration of the interior-point method: the length of each step, and the conditions under which the iteration ends.

use super::certificate::REDUCED_TOLERANCE;
use super::workspace::Workspace;
use crate::cone_program::Status;
use std::time::Instant;

/// Minimum and maximum of the step length, relative to the distance to the boundary. This ratio is 1 minus a tenth of
/// the predictor's shortfall, which is 1 minus the predictor's step length. The maximum keeps each slack variable
/// larger than the rounding errors of the terms from which the variable is computed.
const TO_BOUNDARY: [f64; 2] = [0.99, 0.9999];
const SHORTFALL: f64 = 0.1;
/// Duality gap at which the last steps aim, relative to the allowed gap.
const AIM: f64 = 0.1;
/// Maximum number of consecutive iterations that come closer neither to a solution nor to a proof that none exists.
const PATIENCE: u32 = 5;
/// Minimum length of a step; a shorter step is a failure.
const SHORT_STEP: f64 = 1e-7;
/// Maximum error of a solution with reduced accuracy, as a multiple of the tolerance.
const REDUCED: f64 = 1e4;
/// Ratio of the dual residual to its expected value above which later solves get one more refinement, up to
/// `REFINEMENTS`.
const INEXACT: f64 = 2.0;
const REFINEMENTS: usize = 2;

/// Limits that end the iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    pub tolerance: f64,
    /// Maximum number of iterations, including the iterations of earlier attempts.
    pub iterations: u32,
    /// Start time, and the maximum time after it (s).
    pub clock: Option<(Instant, f64)>,
}

impl Workspace {
    /// Iterates from the current x, y, s and z; returns the error of the last iterate.
    ///
    /// # Errors
    /// [`Status`] if the error is above [`REDUCED`] times the tolerance.
    pub(super) fn iterate(&mut self, iterations: &mut u32, limits: Limits) -> Result<f64, Status> {
        let Limits { tolerance, .. } = limits;
        let (mut least, mut idle, mut refinements) = ([f64::INFINITY; 2], 0, 0);
        let mut measure = self.measure();
        loop {
            let error = measure.error;
            let stop = |status| match status {
                _ if error <= REDUCED * tolerance => Ok(error),
                Status::NumericalError if measure.exclusion <= REDUCED_TOLERANCE => Err(Status::Infeasible),
                status => Err(status),
            };
            if error.is_nan() {
                return Err(Status::NumericalError);
            }
            if error <= tolerance {
                return Ok(error);
            }
            if let Some(status) = measure.certificate {
                return Err(status);
            }
            if *iterations >= limits.iterations {
                return stop(Status::IterationLimit);
            }
            if limits.clock.is_some_and(|(start, seconds)| start.elapsed().as_secs_f64() > seconds) {
                return stop(Status::TimeLimit);
            }
            idle = if error < least[0] || measure.exclusion < least[1] { 0 } else { idle + 1 };
            least = [least[0].min(error), least[1].min(measure.exclusion)];
            if idle > PATIENCE || !self.scale() || !self.system.factorize(&self.data) {
                return stop(Status::NumericalError);
            }
            *iterations += 1;

            // Predictor: a step towards s ∘ z = 0.
            let inverse = self.direction(0.0, false, refinements);
            let shortfall = if inverse > 1.0 { 1.0 - inverse.recip() } else { 0.0 };
            // Corrector: a step towards s ∘ z = σ μ e. Here s are the slack variables, z the multipliers, and μ the
            // mean of their present products. Mehrotra's factor is σ = (1 − α)³, with the step length α of the
            // predictor. `AIM` keeps the gap from becoming smaller than needed.
            let sigma = shortfall * shortfall * shortfall;
            let centre = (sigma * measure.mu).max(AIM * tolerance * measure.scale);
            let inverse = self.direction(centre, true, refinements);
            let to_boundary = (1.0 - SHORTFALL * shortfall).clamp(TO_BOUNDARY[0], TO_BOUNDARY[1]);
            let step = if inverse > to_boundary { to_boundary / inverse } else { 1.0 };
            if step.is_nan() || step < SHORT_STEP {
                return stop(Status::NumericalError);
            }
            self.advance(step);

            let expected = (1.0 - step) * measure.dual;
            measure = self.measure();
            if measure.dual > tolerance && measure.dual > INEXACT * expected && refinements < REFINEMENTS {
                refinements += 1;
            }
        }
    }
}
