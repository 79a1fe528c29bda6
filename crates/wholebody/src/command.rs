//! Command of a step.

use crate::error::Status;
use condyle_spatial::{Force, Vec3};
use std::fmt;

/// Source of a command: how it was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CommandSource {
    /// Solution of the program. If the solver did not finish, it is an iterate that satisfies all constraints.
    Solution,
    /// Torques of the last solution, which is at most [`Settings::hold_ticks`](crate::Settings::hold_ticks) ticks old.
    LastSolution,
    /// Gravity compensation at the last valid state. Damping is added if this state is the current one.
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

/// Command of a tick. With every status, all numbers of the command are finite and `tau` is within the limits.
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
    /// Force of the environment on the robot at each contact (N, N m). The moment is about the frame's origin, and all
    /// components are along the world's axes. A safe command repeats the forces of the last solution.
    pub forces: Vec<Force<f64>>,
    /// Acceleration of the centre of mass, c̈ = J q̈ + J̇ v with its Jacobian J, in the world's frame (m/s²). A safe
    /// command repeats the value of the last solution.
    pub com_acceleration: Vec3<f64>,
    /// Largest violation of a constraint (N, N m, m/s²). A safe command repeats the value of the last solution.
    pub violation: f64,
    /// Iterations of the solver.
    pub iterations: u32,
    /// Whether the solver met only its reduced tolerance, not [`Settings::tolerance`](crate::Settings::tolerance).
    pub reduced_accuracy: bool,
    /// Whether joint limits were relaxed, because they contradicted dynamics, contacts and torque limits.
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
