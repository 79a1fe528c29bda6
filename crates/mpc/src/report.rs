//! Report of a tick.

use condyle_optimal::{Solution, Status};
use std::time::Duration;

/// Report of the last tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// Result of the tick.
    pub status: TickStatus,
    /// Time to which the plan belongs: knot 0 begins then (s).
    pub time: f64,
    /// Status of the solver.
    pub solver: Option<Status>,
    /// Number of linearisations of the tick.
    pub iterations: usize,
    /// Largest gap of the plan before the tick: between a state and the state that the knot before predicts.
    pub gap: f64,
    /// Cost of the plan before the tick.
    pub cost: f64,
    /// Duration of references and of the shift of the horizon.
    pub references: Duration,
    /// Duration of the solver's work.
    pub solve: Duration,
    /// Feet that should be on the ground now, one entry for each foot.
    pub stands: Vec<bool>,
    /// Commanded velocity now: forwards, to the left (m/s), and turning (rad/s).
    pub command: [f64; 3],
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TickStatus {
    /// The controller has no plan yet.
    NoPlan,
    /// The plan is new.
    Planned,
    /// The sweep failed, so the new plan is the last one, simulated from the measured state with its feedback.
    Fallback,
    /// A number of the measured state was not finite, or was 1e6 or more, so the last plan remains in use.
    InvalidState,
    /// The solver found no finite plan, so the horizon began anew from the measured state.
    Restarted,
    /// The solver found no finite plan, also from the measured state alone. The last plan remains in use.
    Failed,
}

impl TickStatus {
    /// Returns whether the tick made a new plan.
    pub fn is_new(self) -> bool {
        matches!(self, Self::Planned | Self::Fallback | Self::Restarted)
    }
}

impl Report {
    /// Writes the result of a solver, and the durations of references and of the solver's work.
    pub(crate) fn write(&mut self, status: TickStatus, time: f64, plan: &Solution, durations: [Duration; 2]) {
        (self.status, self.time, self.solver) = (status, time, Some(plan.status));
        (self.gap, self.cost, [self.references, self.solve]) = (plan.gap, plan.cost, durations);
    }

    /// Returns the report before the first tick.
    pub(crate) fn none(feet: usize) -> Self {
        Self {
            status: TickStatus::NoPlan,
            time: 0.0,
            solver: None,
            iterations: 0,
            gap: 0.0,
            cost: 0.0,
            references: Duration::ZERO,
            solve: Duration::ZERO,
            stands: vec![true; feet],
            command: [0.0; 3],
        }
    }
}
