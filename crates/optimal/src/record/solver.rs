//! Solvers whose calls a record contains.

use super::calls::Call;
use crate::error::Error;
use crate::problem::Problem;
use crate::solvers::{
    AugmentedLagrangian, ConstraintSettings, Fddp, InteriorPoint, InteriorPointSettings, Settings, Solution,
};
use serde::{Deserialize, Serialize};

/// Settings of a recorded solver.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum SolverSettings {
    /// Settings of [`Fddp`].
    Fddp {
        /// Settings of the solver.
        settings: Settings,
    },
    /// Settings of [`InteriorPoint`].
    InteriorPoint {
        /// Settings of the solver.
        settings: InteriorPointSettings,
    },
    /// Settings of [`AugmentedLagrangian`].
    AugmentedLagrangian {
        /// Settings for the constraints.
        settings: ConstraintSettings,
        /// Settings of the inner solves.
        inner: Settings,
    },
}

/// Solver of any kind, as a replay needs it.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum RecordedSolver {
    /// Solver by FDDP.
    Fddp(Box<Fddp>),
    /// Interior point method.
    InteriorPoint(Box<InteriorPoint>),
    /// Augmented Lagrangian method.
    AugmentedLagrangian(Box<AugmentedLagrangian>),
}

/// Solver that can be recorded.
pub trait Recorded {
    /// Returns the present settings.
    fn settings(&self) -> SolverSettings;

    /// Returns the result of the last solve.
    fn solution(&self) -> &Solution;
}

impl Recorded for Fddp {
    fn settings(&self) -> SolverSettings {
        SolverSettings::Fddp { settings: self.settings.clone() }
    }

    fn solution(&self) -> &Solution {
        self.solution()
    }
}

impl Recorded for InteriorPoint {
    fn settings(&self) -> SolverSettings {
        SolverSettings::InteriorPoint { settings: self.settings.clone() }
    }

    fn solution(&self) -> &Solution {
        self.solution()
    }
}

impl Recorded for AugmentedLagrangian {
    fn settings(&self) -> SolverSettings {
        SolverSettings::AugmentedLagrangian { settings: self.settings.clone(), inner: self.inner.clone() }
    }

    fn solution(&self) -> &Solution {
        self.solution()
    }
}

impl Recorded for RecordedSolver {
    fn settings(&self) -> SolverSettings {
        match self {
            Self::Fddp(solver) => Recorded::settings(&**solver),
            Self::InteriorPoint(solver) => Recorded::settings(&**solver),
            Self::AugmentedLagrangian(solver) => Recorded::settings(&**solver),
        }
    }

    fn solution(&self) -> &Solution {
        match self {
            Self::Fddp(solver) => solver.solution(),
            Self::InteriorPoint(solver) => solver.solution(),
            Self::AugmentedLagrangian(solver) => solver.solution(),
        }
    }
}

impl SolverSettings {
    /// Returns a new solver for `problem` with these settings.
    pub fn build(&self, problem: &Problem) -> RecordedSolver {
        let mut solver = match self {
            Self::Fddp { .. } => RecordedSolver::Fddp(Box::new(Fddp::new(problem))),
            Self::InteriorPoint { .. } => RecordedSolver::InteriorPoint(Box::new(InteriorPoint::new(problem))),
            Self::AugmentedLagrangian { .. } => {
                RecordedSolver::AugmentedLagrangian(Box::new(AugmentedLagrangian::new(problem)))
            }
        };
        solver.configure(self);
        solver
    }
}

impl RecordedSolver {
    /// Sets the settings. Settings of another kind of solver have no effect.
    pub(super) fn configure(&mut self, settings: &SolverSettings) {
        match (self, settings) {
            (Self::Fddp(solver), SolverSettings::Fddp { settings }) => solver.settings = settings.clone(),
            (Self::InteriorPoint(solver), SolverSettings::InteriorPoint { settings }) => {
                solver.settings = settings.clone();
            }
            (Self::AugmentedLagrangian(solver), SolverSettings::AugmentedLagrangian { settings, inner }) => {
                (solver.settings, solver.inner) = (settings.clone(), inner.clone());
            }
            _ => {}
        }
    }

    /// Shifts the solver after the problem.
    pub(super) fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        match self {
            Self::Fddp(solver) => solver.shift(problem),
            Self::InteriorPoint(solver) => solver.shift(problem),
            Self::AugmentedLagrangian(solver) => solver.shift(problem),
        }
    }

    /// Moves the horizon of the solver and of the problem.
    pub(super) fn retime(
        &mut self,
        problem: &mut Problem,
        elapsed: f64,
        knot_models: &[usize],
        durations: &[f64],
    ) -> Result<(), Error> {
        match self {
            Self::Fddp(solver) => solver.retime(problem, elapsed, knot_models, durations),
            Self::InteriorPoint(solver) => solver.retime(problem, elapsed, knot_models, durations),
            Self::AugmentedLagrangian(solver) => solver.retime(problem, elapsed, knot_models, durations),
        }
        .map(drop)
    }

    /// Starts the solver anew from a state.
    pub(super) fn reset(&mut self, problem: &mut Problem, x0: &[f64]) -> Result<(), Error> {
        match self {
            Self::Fddp(solver) => solver.reset(problem, x0),
            Self::InteriorPoint(solver) => solver.reset(problem, x0),
            Self::AugmentedLagrangian(solver) => solver.reset(problem, x0),
        }
    }

    /// Prepares an iteration or a tick. Has no effect for the augmented Lagrangian, which has no such call.
    pub(super) fn prepare(&mut self, problem: &mut Problem, sweeps: usize) -> Result<(), Error> {
        match self {
            Self::Fddp(solver) => solver.prepare(problem),
            Self::InteriorPoint(solver) => solver.prepare(problem, sweeps),
            Self::AugmentedLagrangian(_) => Ok(()),
        }
    }

    /// Sets multipliers. Has no effect for FDDP, which has none.
    pub(super) fn set_multipliers(
        &mut self,
        problem: &mut Problem,
        name: &str,
        values: &[impl AsRef<[f64]>],
    ) -> Result<(), Error> {
        match self {
            Self::Fddp(_) => Ok(()),
            Self::InteriorPoint(solver) => solver.set_multipliers(problem, name, values),
            Self::AugmentedLagrangian(solver) => solver.set_multipliers(problem, name, values),
        }
    }

    /// Makes a call that solves. A rule that another kind of solver has counts as [`Call::Resume`].
    pub(super) fn run(&mut self, problem: &mut Problem, call: &Call) -> Result<(), Error> {
        match (self, call) {
            (Self::Fddp(solver), Call::Solve { xs, us }) => solver.solve(problem, xs, us),
            (Self::InteriorPoint(solver), Call::Solve { xs, us }) => solver.solve(problem, xs, us),
            (Self::AugmentedLagrangian(solver), Call::Solve { xs, us }) => solver.solve(problem, xs, us),
            (Self::Fddp(solver), Call::ResumeToFullStep { most }) => solver.resume_to_full_step(problem, *most),
            (Self::InteriorPoint(solver), Call::Tick { sweeps }) => solver.tick(problem, *sweeps),
            (Self::Fddp(solver), Call::Feedback { x0, most }) => solver.feedback(problem, x0, *most),
            (Self::InteriorPoint(solver), Call::Feedback { x0, .. }) => solver.feedback(problem, x0),
            (Self::Fddp(solver), _) => solver.resume(problem),
            (Self::InteriorPoint(solver), _) => solver.resume(problem),
            (Self::AugmentedLagrangian(solver), _) => solver.resume(problem),
        }
        .map(drop)
    }
}
