//! Command of a step.

use crate::error::Status;
use condyle_spatial::{Force, Vec3};
use std::fmt;

/// Source of a command: how it was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CommandSource {
    /// The program's solution; or an iterate that satisfies all constraints, if the solver did not finish.
    Solution,
    /// The last solution, at most [`Settings::hold_ticks`](crate::Settings::hold_ticks) old.
    LastSolution,
    /// Gravity compensation with damping, at the last valid state.
    GravityCompensation,
}

impl fmt::Display for CommandSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Solution => "solution",
            Self::LastSolution => "last solution",
            Self::GravityCompensation => "gravity compensation",
        })
    }
}

/// Command of a tick. Whatever the status, its numbers are finite and `tau` is within the limits.
///
/// Constraints hold up to the solver's tolerance: with the default tolerance, a force may leave its friction cone by
/// about 1e-7 N.
#[derive(Clone, Debug, PartialEq)]
pub struct Command {
    /// Status of the step.
    pub status: Status,
    /// Source of the command: how it was computed.
    pub source: CommandSource,
    /// τ, the efforts of the motors: nv numbers (N m, N), 0 at a free-flyer.
    pub tau: Vec<f64>,
    /// q̈, the acceleration that results if the contacts hold: nv numbers (rad/s², m/s²). A safe command repeats the
    /// value of the last solution.
    pub a: Vec<f64>,
    /// Force of the environment on the robot at each contact, about the frame's origin, along the world's axes (N, N
    /// m). A safe command repeats the forces of the last solution.
    pub forces: Vec<Force<f64>>,
    /// c̈ = J q̈ + J̇ v of the centre of mass, in the world's frame (m/s²). A safe command repeats the value of the
    /// last solution.
    pub com_acceleration: Vec3<f64>,
    /// Violation of the constraint that is violated most (N, N m, m/s²). A safe command repeats the value of the last
    /// solution.
    pub violation: f64,
    /// Iterations of the solver.
    pub iterations: u32,
    /// Whether the solver met only its reduced tolerance, not [`Settings::tolerance`](crate::Settings::tolerance).
    pub reduced_accuracy: bool,
    /// Whether joint limits were relaxed in favour of dynamics, contacts and torques.
    pub limits_relaxed: bool,
}

impl Command {
    /// Returns the command if its status is [`Status::Solved`].
    ///
    /// # Errors
    /// The status, if it is not [`Status::Solved`].
    pub fn solved(&self) -> Result<&Self, Status> {
        if self.status == Status::Solved { Ok(self) } else { Err(self.status) }
    }
}
