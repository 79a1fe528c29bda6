//! Iterations in two halves, as in the real-time iteration scheme (Diehl, Bock and Schlöder, 2005). The first half does
//! not depend on the measured state, and the second half is short.

use super::settings::Settings;
use super::solution::Status;
use super::solver_loop::{Pass, Progress, SolverLoop};
use super::watch::Watch;
use crate::error::Error;
use crate::problem::Problem;
use std::time::Duration;

/// First half of an iteration: derivatives and sweep along the predicted trajectory. Neither contains the initial
/// state: x̂₀ enters an iteration only as the gap f₀ = x̂₀ ⊖ x̄₀, with which the rollouts begin.
#[derive(Debug, Clone)]
pub(super) struct Prepared {
    now: Progress,
    /// Whether a direction was found, or the reason to stop.
    direction: Result<(), Status>,
    /// Duration of the first half.
    lasted: Duration,
}

impl SolverLoop {
    /// Sets x̂₀ to the first state of the trajectory, which the last plan predicts. A state that is not valid is not
    /// set.
    ///
    /// # Errors
    /// [`Error::NothingToResume`] without a trajectory. [`Error::Dimension`] for a problem with other dimensions.
    pub(super) fn predict(&self, problem: &mut Problem) -> Result<(), Error> {
        if !self.started {
            return Err(Error::NothingToResume);
        }
        let solution = &self.iterate.solution;
        solution.shape().check(problem.shape())?;
        let _: Result<(), Error> = problem.set_x0(&solution.xs[..problem.nx()]);
        Ok(())
    }

    /// Makes the first half of an iteration from the last trajectory: see [`Fddp::prepare`](crate::Fddp::prepare).
    ///
    /// # Errors
    /// The errors of [`Fddp::resume`](crate::Fddp::resume).
    pub(super) fn prepare(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        watch: &mut Watch<'_>,
    ) -> Result<(), Error> {
        self.predict(problem)?;
        self.begin(problem, settings, None)?;
        self.start_clock(settings, watch);
        self.clock.start(watch.begin, None);
        let mut now = self.start_pass(problem, settings, Pass { resumes: true, ..Pass::default() });
        let direction = match now.merit.cost.is_finite() && now.merit.gap.is_finite() {
            true => self.find_direction(problem, settings, &mut now, true, watch),
            false => Err(Status::NotFinite),
        };
        self.prepared = Some(Prepared { now, direction, lasted: watch.begin.elapsed() });
        Ok(())
    }

    /// Completes the prepared iteration for the initial state x̂₀ = `x0`: see
    /// [`Fddp::feedback`](crate::Fddp::feedback).
    ///
    /// # Errors
    /// [`Error::NothingPrepared`], and the errors of [`Problem::set_x0`]; then the preparation is kept.
    pub(super) fn feedback(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        x0: &[f64],
        most: usize,
        watch: &mut Watch<'_>,
    ) -> Result<(), Error> {
        if self.prepared.is_none() {
            return Err(Error::NothingPrepared);
        }
        settings.check()?;
        self.iterate.solution.shape().check(problem.shape())?;
        problem.set_x0(x0)?;
        let Some(Prepared { mut now, direction, lasted }) = self.prepared.take() else { return Ok(()) };
        self.clock.start(watch.begin, settings.time_budget);
        now.merit.gap = self.iterate.update_first_gap(problem);
        let pass = Pass { resumes: true, to_full_step: Some(most.max(1)), ..Pass::default() };
        let status = self.make_iterations(problem, settings, pass, &mut now, Some(direction), watch);
        self.clock.end_guarantee();
        self.finish(problem, settings, now, status);
        let timings = &mut self.iterate.solution.timings;
        timings.end(watch.begin.elapsed(), settings.time_budget);
        timings.total += lasted;
        Ok(())
    }
}
