//! Ticks in two parts, as in the real-time iteration scheme: the first part does not depend on the measured state.

use super::InteriorPoint;
use super::tick::ProgramSteps;
use crate::error::Error;
use crate::problem::Problem;
use crate::solvers::settings::Settings;
use crate::solvers::solution::{Iteration, Solution, Status};
use crate::solvers::watch::{Observer, Phase, Watch};
use std::time::Duration;

/// Ratio of the μ that a disturbance needs to the prepared μ, above which the sweep is repeated. A Go2 that trots
/// without pushes then rarely repeats it.
const CHANGES: f64 = 4.0;

/// First part of a tick: the linearisation, all steps but the last one, and the last sweep. A sweep does not contain
/// the initial state; only the step does.
#[derive(Debug, Clone)]
pub(super) struct PreparedTick {
    steps: Result<ProgramSteps, Status>,
    /// Whether the quadratic program was solved before the last sweep.
    is_solved: bool,
    /// Barrier parameter μ of the first sweep.
    mu: f64,
    /// Duration of the first part.
    lasted: Duration,
}

impl InteriorPoint {
    /// Makes the part of a [`tick`](Self::tick) that does not depend on the measured state, before the state arrives:
    /// the linearisation along the trajectory, all steps but the last one, and the last sweep.
    /// [`feedback`](Self::feedback) makes the rest. This is the real-time iteration scheme: call
    /// [`shift`](Self::shift), set references, and `prepare`; then wait for the state.
    ///
    /// The prediction is the first state x̄₀ of the trajectory; it becomes the problem's initial state. Until
    /// `feedback`, the problem must not change. A sweep that fails is reported by `feedback`. The time budget does not
    /// apply.
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn prepare(&mut self, problem: &mut Problem, sweeps: usize) -> Result<(), Error> {
        self.prepare_with(problem, sweeps, |_: &Iteration| {})
    }

    /// Prepares as [`prepare`](Self::prepare) does. The observer may end the preparation; it receives no iterations.
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn prepare_with(
        &mut self,
        problem: &mut Problem,
        sweeps: usize,
        mut observer: impl Observer,
    ) -> Result<(), Error> {
        let settings = Settings { time_budget: None, ..self.settings.shared()? };
        let mut watch = Watch::new(&mut observer);
        self.solver.predict(problem)?;
        let disturbance = self.begin(problem, &settings, None, &watch)?;
        self.mu = self.tick_barrier(disturbance);
        let (mut mu, mut is_solved, sweeps) = (self.mu, false, sweeps.max(1));
        let steps = self.start_program(problem, &settings).and_then(|mut now| {
            mu = self.mu;
            while now.sweeps < sweeps && !is_solved {
                self.solver.clock.allows(&[Phase::Sweep], &mut watch)?;
                let is_last = now.sweeps + 1 == sweeps;
                self.sweep_program(problem, &settings, &mut now, is_last)?;
                is_solved = !is_last && self.make_program_step(problem, &mut now);
            }
            Ok(now)
        });
        self.prepared = Some(PreparedTick { steps, is_solved, mu, lasted: watch.begin.elapsed() });
        Ok(())
    }

    /// Sets the initial state to the measured state `x0`, and completes the [prepared](Self::prepare) tick.
    ///
    /// Where x̂₀ equals the prediction, the result is, to the bit, the result of [`Problem::set_x0`] and
    /// [`tick`](Self::tick). Elsewhere, the quadratic program remains the one along the prediction, with the gap
    /// x̂₀ ⊖ x̄₀ at knot 0. A small disturbance only enters the last step. A disturbance whose barrier parameter μ
    /// exceeds four times the prepared one changes the active limits: then one sweep with this μ replaces the prepared
    /// sweeps.
    ///
    /// # Errors
    /// [`Error::NothingPrepared`] if `prepare` was not called since the last solve, tick, shift or feedback. The errors
    /// of [`Problem::set_x0`], for example if a number is not finite; the preparation is then kept.
    pub fn feedback(&mut self, problem: &mut Problem, x0: &[f64]) -> Result<&Solution, Error> {
        self.feedback_with(problem, x0, |_: &Iteration| {})
    }

    /// Completes a tick as [`feedback`](Self::feedback) does. The observer may end it between two sweeps; it receives
    /// no iterations.
    ///
    /// # Errors
    /// The same errors as [`feedback`](Self::feedback).
    pub fn feedback_with(
        &mut self,
        problem: &mut Problem,
        x0: &[f64],
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        let settings = self.settings.shared()?;
        let mut watch = Watch::new(&mut observer);
        if self.prepared.is_none() {
            return Err(Error::NothingPrepared);
        }
        self.solution().shape().check(problem.shape())?;
        problem.set_x0(x0)?;
        let Some(prepared) = self.prepared.take() else { return Err(Error::NothingPrepared) };
        self.solver.clock.start(watch.begin, settings.time_budget);
        self.solver.clock.reserve = self.finishing.median();
        self.solver.iterate.update_first_gap(problem);
        let status = match self.complete(problem, &settings, &prepared, &mut watch) {
            Ok(status) => status,
            Err(status) => self.fall_back(problem, status),
        };
        self.report(problem, status);
        self.outcome.dual = f64::INFINITY; // not measured
        let timings = &mut self.solver.iterate.solution.timings;
        timings.end(watch.begin.elapsed(), settings.time_budget);
        timings.total += prepared.lasted;
        Ok(self.solution())
    }

    /// Completes the steps for the prepared quadratic program, and moves the trajectory.
    ///
    /// A disturbance that needs a much larger μ gets one new sweep, from the s and z before the tick. A Go2 that trots
    /// then survives as many pushes as with two new sweeps. Without a new sweep it survives none: the prepared sweep
    /// lacks the curvature of the limits that become active.
    ///
    /// # Errors
    /// The status after a failed sweep.
    fn complete(
        &mut self,
        problem: &mut Problem,
        settings: &Settings,
        prepared: &PreparedTick,
        watch: &mut Watch<'_>,
    ) -> Result<Status, Status> {
        let (mut now, disturbance) = (prepared.steps?, self.disturbance(problem));
        let mu = self.disturbed_barrier(disturbance, prepared.mu);
        let holds = self.solver.iterate.gaps[..problem.ndx()].iter().all(|f| *f == 0.0);
        let mut sweeps = now.sweeps;
        if mu > CHANGES * prepared.mu {
            self.mu = mu;
            self.slacks.restore();
            now = self.center(settings);
            sweeps = 1;
        } else if prepared.is_solved && !holds {
            sweeps += 1;
        } else if prepared.is_solved || self.make_program_step(problem, &mut now) {
            self.end_program(problem, now)?;
            return Ok(Status::Converged);
        }
        let status = self.step_program(problem, settings, &mut now, sweeps, watch)?;
        self.end_program(problem, now)?;
        Ok(status)
    }
}
