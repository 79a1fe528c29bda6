//! Walk with its request.

use super::feet::FoundFoot;
use super::record::Walk;
use crate::robot::Robot;
use condyle::Model;
use condyle::mpc::{Command, Settings};
use std::sync::Arc;

/// Walk with its request, for the report and the page.
pub(crate) struct Walked {
    pub robot: Robot,
    pub model: Arc<Model>,
    /// Whether the page draws the robot's meshes.
    pub meshes: bool,
    pub feet: Vec<FoundFoot>,
    /// Source of the feet, for the report.
    pub feet_source: String,
    /// Source of the posture, and the angles of joints that differ from the neutral position.
    pub posture: (String, String),
    pub gait_text: String,
    pub settings: Settings,
    pub command: Command,
    pub seconds: f64,
    pub rate: f64,
    /// Names of joints that move no inertia, and got an armature.
    pub regular: Vec<String>,
    pub walk: Walk,
}

impl Walked {
    /// Returns the time budget of a tick (ms).
    pub(crate) fn budget_ms(&self) -> f64 {
        1e3 / self.rate
    }
}
