//! Plan of a controller over its horizon: the problem, its solver, and the time of each knot.

use crate::Error;
use crate::policy::Policy;
use crate::report::{Report, TickStatus};
use crate::settings::PlanSettings;
use condyle_dynamics::Model;
use condyle_optimal::{InteriorPoint, PolicyPublisher, Problem, Schedule, Status};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Magnitude from which the numbers of a measured state are invalid (m, rad, m/s, rad/s).
const LARGEST: f64 = 1e6;

/// Plan that each tick renews, in the same way for all controllers. A controller gives the references.
#[derive(Debug)]
pub(crate) struct Planner {
    pub model: Arc<Model>,
    pub problem: Problem,
    pub solver: InteriorPoint,
    publisher: PolicyPublisher,
    /// Models of the knots in time.
    pub knots: Schedule,
    pub knot_models: Vec<usize>,
    durations: Vec<f64>,
    /// Times of the knots (s): N + 1 times. Knot 0 begins when the plan is used.
    pub times: Vec<f64>,
    /// State with which the plan begins: the measured one, or its prediction.
    pub x: Vec<f64>,
    /// Whether there is a plan.
    pub is_started: bool,
    /// Time of the last measurement (s).
    pub measured: f64,
    pub report: Report,
    settings: PlanSettings,
}

impl Planner {
    /// Creates a planner for the problem of a controller with the given number of feet.
    pub(crate) fn new(model: Arc<Model>, problem: Problem, settings: PlanSettings, feet: usize) -> Result<Self, Error> {
        let horizon = problem.horizon();
        Ok(Self {
            solver: settings.solver_of(&problem),
            publisher: PolicyPublisher::new(&problem)?,
            knots: Schedule::new(settings.knot, 0)?,
            knot_models: vec![0; horizon],
            durations: vec![settings.knot; horizon],
            times: vec![0.0; horizon + 1],
            x: problem.x0().to_vec(),
            is_started: false,
            measured: f64::NEG_INFINITY,
            report: Report::none(feet),
            problem,
            settings,
            model,
        })
    }

    /// Returns the number of positions.
    pub(crate) fn nq(&self) -> usize {
        self.model.nq()
    }

    /// Returns the time at which a plan from a measurement at the time t is used (s).
    pub(crate) fn start(&self, t: f64) -> f64 {
        (t + self.settings.latency).max(self.times[0])
    }

    /// Begins at the time t (s) in the state x, without a plan.
    pub(crate) fn begin(&mut self, t: f64, x: &[f64]) -> Result<(), Error> {
        Error::check_array("x", x, self.x.len())?;
        Error::check_array("t", &[t], 1)?;
        self.write_state(x);
        self.times[0] = t + self.settings.latency;
        (self.measured, self.is_started) = (t, false);
        Ok(())
    }

    /// Checks the time t of a measurement (s).
    pub(crate) fn check_time(&self, t: f64) -> Result<(), Error> {
        Error::check_array("t", &[t], 1)?;
        if t < self.measured {
            return Err(Error::Time { t, last: self.measured });
        }
        Ok(())
    }

    /// Returns whether the numbers of a measured state are below [`LARGEST`]. Otherwise, the report says that the state
    /// is invalid.
    pub(crate) fn accepts(&mut self, x: &[f64]) -> Result<bool, Error> {
        let is_small = |x: &f64| x.abs() < LARGEST; // false for NaN
        if x.len() == self.x.len() && !x.iter().all(is_small) {
            self.report.status = TickStatus::InvalidState;
            return Ok(false);
        }
        Error::check_array("x", x, self.x.len())?;
        Ok(true)
    }

    fn write_state(&mut self, x: &[f64]) {
        let nq = self.nq();
        self.x.copy_from_slice(x);
        condyle_dynamics::normalize(&self.model, &mut self.x[..nq]);
    }

    /// Writes the state at the time `start` to `self.x`: the measured state x at the time t, moved by the dynamics
    /// under the plan until then.
    pub(crate) fn predict(&mut self, t: f64, start: f64, x: &[f64]) -> Result<(), Error> {
        self.write_state(x);
        if start > t {
            let (plan, begin) = (self.solver.solution(), self.times[0]);
            plan.predict(&mut self.problem, x, t - begin, start - begin, &mut self.x)?;
        }
        Ok(())
    }

    /// Writes the state of the plan at the time `start` to `self.x`.
    pub(crate) fn follow(&mut self, start: f64) -> Result<(), Error> {
        let (plan, begin) = (self.solver.solution(), self.times[0]);
        Ok(plan.predict(&mut self.problem, plan.x(0), 0.0, start - begin, &mut self.x)?)
    }

    /// Writes the models, durations and times of the knots of a horizon that begins at the time `start`.
    fn arrange(&mut self, start: f64) {
        self.knots.write_knots(start, &mut self.knot_models, &mut self.durations);
        self.times[0] = start;
        for (k, dt) in self.durations.iter().enumerate() {
            self.times[k + 1] = self.times[k] + dt;
        }
    }

    /// Moves the horizon, and the plan with it, to the time `start`.
    pub(crate) fn move_to(&mut self, start: f64) -> Result<(), Error> {
        let elapsed = start - self.times[0];
        self.arrange(start);
        self.solver.retime(&mut self.problem, elapsed, &self.knot_models, &self.durations)?;
        Ok(())
    }

    /// Replaces the problem by one whose first models are the present ones. The plan stays.
    pub(crate) fn replace(&mut self, mut problem: Problem) -> Result<(), Error> {
        let mut solver = self.settings.solver_of(&problem);
        if self.is_started {
            problem.set_knots(&self.knot_models, &self.durations)?;
            problem.set_x0(self.problem.x0())?;
            let plan = self.solver.solution();
            let (xs, us) = (plan.xs.clone(), plan.us.clone());
            solver.settings.max_iterations = 0;
            solver.solve(&mut problem, &xs, &us)?;
            solver.settings.max_iterations = self.solver.settings.max_iterations;
        }
        (self.problem, self.solver) = (problem, solver);
        Ok(())
    }

    /// Makes a plan for a horizon that begins at the time `start`, from a robot that stands still in the state
    /// `self.x`. `refer` writes the references. The report then has this `status`.
    pub(crate) fn restart(
        &mut self,
        start: f64,
        status: TickStatus,
        refer: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let begin = Instant::now();
        self.arrange(start);
        self.problem.set_knots(&self.knot_models, &self.durations)?;
        refer(self)?;
        self.problem.set_x0(&self.x)?;
        let xs = self.x.repeat(self.times.len());
        let us = self.problem.quasi_static(&xs)?;
        let references = begin.elapsed();
        let solved = self.solver.solve(&mut self.problem, &xs, &us)?.status;
        if solved == Status::NotFinite {
            return Err(Error::Robot { what: format!("no plan from this state: {solved}") });
        }
        self.is_started = true;
        self.publish(status, begin, references)
    }

    /// Renews the plan from the state `self.x`, after `begin`, when the tick began. `is_prepared` tells whether the
    /// solver has prepared the tick. If no plan is found, it is made anew with the references that `refer` writes.
    pub(crate) fn tick(
        &mut self,
        is_prepared: bool,
        begin: Instant,
        refer: impl FnOnce(&mut Self) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let [least, most] = self.settings.iterations;
        let (references, mut last, mut made) = (begin.elapsed(), begin, 0);
        let status = loop {
            let plan = match is_prepared && made == 0 {
                true => self.solver.feedback(&mut self.problem, &self.x)?,
                false => self.solver.tick(&mut self.problem, self.settings.sweeps)?,
            };
            made += 1;
            self.report.iterations = made;
            if !plan.is_executable() {
                if self.restart(self.times[0], TickStatus::Restarted, refer).is_err() {
                    self.report.status = TickStatus::Failed;
                }
                return Ok(());
            }
            let status = if plan.fallback.is_none() { TickStatus::Planned } else { TickStatus::Fallback };
            let spent = (begin.elapsed() + last.elapsed()).as_secs_f64(); // after another linearisation
            if made >= most || made >= least && spent > self.settings.budget {
                break status;
            }
            last = Instant::now();
        };
        self.publish(status, begin, references)
    }

    fn publish(&mut self, status: TickStatus, begin: Instant, references: Duration) -> Result<(), Error> {
        let (start, plan) = (self.times[0], self.solver.solution());
        self.publisher.publish(&self.problem, plan, start)?;
        self.report.write(status, start, plan, [references, begin.elapsed() - references]);
        Ok(())
    }

    /// Returns a policy that follows the latest plan. `posture` (nq) is a typical position of the robot, and the first
    /// `root` coordinates of v have no motors.
    pub(crate) fn policy(&self, posture: &[f64], root: usize) -> Policy {
        Policy::new(&self.publisher, &self.model, posture, root)
    }
}
