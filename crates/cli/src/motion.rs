//! Planned motion: the request and the result.

use crate::limits::Limited;
use crate::met::Held;
use crate::robot::Robot;
use condyle::optimal::{Iteration, Solution, Status};
use condyle::{Model, Vec3};
use std::sync::Arc;

/// Target point of a frame.
pub(crate) struct Goal {
    pub frame: usize,
    pub target: Vec3<f64>,
    /// Distance between the frame and the target at the end of the motion (m).
    pub miss: f64,
    pub tolerance: f64,
    /// Smallest distance (m) between frame and target that was found for any posture within the limits.
    pub nearest: f64,
}

/// Planned motion: the user's request, and the solver's result.
pub(crate) struct Plan {
    pub model: Arc<Model>,
    /// Robot and its file. The page draws the shapes in this file.
    pub robot: Robot,
    /// Whether the page draws the robot's meshes, as far as the program finds them.
    pub meshes: bool,
    pub title: String,
    pub goal: Option<Goal>,
    pub feet: Vec<usize>,
    /// Whether the feet are soles; otherwise they are points.
    pub soles: bool,
    /// Whether each foot touches the ground, for each knot.
    pub touches: Vec<Vec<bool>>,
    /// Time of each knot (s); an impact has no duration.
    pub times: Vec<f64>,
    pub dt: f64,
    pub budget_ms: f64,
    pub solution: Solution,
    /// Result for the limits, if the motion was solved with limits as constraints.
    pub held: Option<Held>,
    /// Expected decrease of the cost, relative to the cost. The value exists only if three conditions hold: the limits
    /// hold, the cost can hardly decrease, and the solver did not reach its own tolerance.
    pub settled: Option<f64>,
    /// Iterations of all solves.
    pub trace: Vec<Iteration>,
}

impl Plan {
    /// Returns whether the result counts as a solution of the task.
    pub(crate) fn is_solved(&self) -> bool {
        self.solution.status == Status::Converged || self.settled.is_some()
    }

    /// Returns the number of knots that have a control.
    pub(crate) fn knots(&self) -> usize {
        self.times.len() - 1
    }

    /// Returns the values of a limited quantity at all knots. An effort has no value at the last knot.
    pub(crate) fn values(&self, quantity: &Limited<'_>) -> Vec<f64> {
        let state = |t: usize| self.solution.x(t);
        match quantity.what {
            "position" => (0..=self.knots()).map(|t| state(t)[quantity.index]).collect(),
            "velocity" => (0..=self.knots()).map(|t| state(t)[self.model.nq() + quantity.index]).collect(),
            _ => (0..self.knots()).map(|t| self.effort(t)[quantity.index]).collect(),
        }
    }

    /// Returns the efforts of all degrees of freedom at a knot. The effort is 0 for degrees of freedom without a motor,
    /// and at an impact.
    pub(crate) fn effort(&self, t: usize) -> Vec<f64> {
        let (u, nv) = (self.solution.u(t), self.model.nv());
        let undriven = if u.is_empty() { nv } else { nv - u.len() };
        [&vec![0.0; undriven], u].concat()
    }
}
