//! A planned motion: what was asked for, and what came out.

use crate::robot::Robot;
use condyle::optimal::{Iteration, Solution, Status};
use condyle::{Model, Vec3};
use std::sync::Arc;

/// A point that a frame was to reach.
pub(crate) struct Goal {
    pub frame: usize,
    pub target: Vec3<f64>,
    /// How far the frame ends from the target (m).
    pub miss: f64,
    pub tolerance: f64,
    /// How near a posture within the limits comes (m).
    pub nearest: f64,
}

/// What was asked for, and what came out.
pub(crate) struct Plan {
    pub model: Arc<Model>,
    /// The robot's file, of which the page draws the shapes.
    pub robot: Robot,
    /// Whether the page draws the meshes that are found.
    pub meshes: bool,
    pub title: String,
    pub goal: Option<Goal>,
    pub feet: Vec<usize>,
    /// Whether they are soles, else points.
    pub soles: bool,
    /// Whether each foot touches, knot by knot.
    pub touches: Vec<Vec<bool>>,
    /// The time of each knot (s); an impact takes none.
    pub times: Vec<f64>,
    pub dt: f64,
    pub budget_ms: f64,
    pub solution: Solution,
    /// Where limits hold and hardly anything is left to gain, though the solver's own tolerance was not reached: the decrease
    /// that is still expected, relative to the cost.
    pub settled: Option<f64>,
    /// The iterations of all solves.
    pub trace: Vec<Iteration>,
}

impl Plan {
    /// Whether it is a solution.
    pub(crate) fn is_solved(&self) -> bool {
        self.solution.status == Status::Converged || self.settled.is_some()
    }

    /// The knots that have a control.
    pub(crate) fn knots(&self) -> usize {
        self.times.len() - 1
    }

    /// The efforts of all degrees of freedom at a knot: 0 where nothing drives them, and at an impact.
    pub(crate) fn effort(&self, t: usize) -> Vec<f64> {
        let (u, nv) = (self.solution.u(t), self.model.nv());
        let undriven = if u.is_empty() { nv } else { nv - u.len() };
        [&vec![0.0; undriven], u].concat()
    }
}
