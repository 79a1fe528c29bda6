//! Errors of a controller's description, and results of a step.

use crate::cone_program;
use condyle_dynamics::ROTATION_ROUNDING;
use core::fmt;

/// Error in the description of a controller or of a plan, or in a state given to a controller or a plan.
///
/// ```
/// use condyle_wholebody::{FrictionContact, Settings, Task, WholeBodyController};
/// let robot = condyle_dynamics::robots::quadruped();
/// let contacts = [FrictionContact::point("LF_fot", 0.7)];
/// let error = WholeBodyController::new(&robot, &contacts, &[Task::com()], Settings::default()).unwrap_err();
/// assert_eq!(error.to_string(), "unknown frame `LF_fot`; nearest is `LF_foot`");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name is unknown in the model (the message names the nearest one), or a state is invalid.
    #[error(transparent)]
    Model(#[from] condyle_dynamics::Error),
    /// The same frame is listed as a contact twice.
    #[error("contact `{frame}` is listed twice")]
    DuplicateContact {
        /// The frame.
        frame: String,
    },
    /// A task sets the force of a frame that is not a contact.
    #[error("task `{frame}`: there is no contact of this frame")]
    NoSuchContact {
        /// The frame.
        frame: String,
    },
    /// A number of a contact lies outside of its range.
    #[error("contact `{frame}`: {name} is {value}, but it must be {allowed}")]
    Contact {
        /// The frame.
        frame: String,
        /// Name of the invalid field of [`FrictionContact`](crate::FrictionContact).
        name: &'static str,
        /// The invalid value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// A weight or gain of a task lies outside of its range.
    #[error("task `{task}`: {name} is {value}, but it must be {allowed}")]
    Task {
        /// Name of the task: `com`, `posture`, `angular momentum`, or the task's frame.
        task: String,
        /// Name of the invalid field of the task.
        name: &'static str,
        /// The invalid value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// A setting lies outside of its range.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// Name of the invalid field of [`Settings`](crate::Settings).
        name: &'static str,
        /// The invalid value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// The effort limit of an actuated coordinate is not positive. Such a coordinate cannot be controlled.
    #[error("joint `{joint}`: {origin} is {value}, but it must be above 0")]
    Effort {
        /// The joint's name.
        joint: String,
        /// The limit.
        value: f64,
        /// Origin of the limit, in words: the model or the settings.
        origin: &'static str,
    },
    /// A knot of a plan has an invalid state.
    #[error("states: knot {knot}: {error}")]
    Knot {
        /// Index of the knot.
        knot: usize,
        /// Error of the state. It names the joint and the invalid numbers.
        error: condyle_dynamics::Error,
    },
    /// A vector does not have the length that the model requires.
    #[error("`{name}`: expected {expected} numbers, found {found}")]
    Length {
        /// The field.
        name: &'static str,
        /// The required length.
        expected: usize,
        /// The length given.
        found: usize,
    },
}

/// Result of a step.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Status {
    /// No step has been made: the command is zero.
    #[error("no step has been made")]
    NotStarted,
    /// The command is the program's solution.
    #[error("solved")]
    Solved,
    /// Dynamics, held contacts, friction cones, force bounds and torque limits contradict each other: the solver has a
    /// certificate of infeasibility.
    #[error("dynamics, contacts, friction cones and limits exclude each other")]
    Infeasible,
    /// The solver needs more than [`Settings::max_iterations`](crate::Settings::max_iterations) iterations.
    #[error("not solved within the allowed iterations")]
    IterationLimit,
    /// The solver needs more time than [`Settings::time_limit`](crate::Settings::time_limit).
    #[error("not solved within the allowed time")]
    TimeLimit,
    /// A factorisation failed, the iterates stopped making progress, or the solution violates its constraints.
    #[error("the solver stopped for numerical reasons")]
    NumericalError,
    /// A number of the state or of the references is infinite or NaN. Nothing was solved.
    #[error("`{name}[{index}]` is {value}, which is not finite")]
    NotFinite {
        /// Name of the argument: `q`, `v`, or the field of [`References`](crate::References).
        name: &'static str,
        /// Index of the number in the argument, whose numbers are counted in memory order.
        index: usize,
        /// The number.
        value: f64,
    },
    /// A rotation of the state or of the references is invalid. Nothing was solved.
    /// [`WholeBodyController::reason`](crate::WholeBodyController::reason) names the joint or the frame.
    #[error("{0}")]
    InvalidState(InvalidRotation),
}

/// An invalid rotation, with its numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum InvalidRotation {
    /// A quaternion or a pair (cos, sin) whose length differs from 1 by more than 1e-3.
    Joint {
        /// Name of the argument: `q`, or `posture.q` of the references.
        name: &'static str,
        /// Index of the body that the rotating joint moves.
        body: usize,
        /// Index of the rotation's first number in q.
        first: usize,
        /// Index in q that follows the rotation's last number.
        end: usize,
        /// Length of the quaternion or of the pair.
        length: f64,
    },
    /// A matrix in the pose of a reference differs from a rotation by more than 1e-2.
    Pose {
        /// Name of the list: `frames` or `contacts` of the references.
        name: &'static str,
        /// Index of the frame or of the contact in this list.
        index: usize,
        /// Distance of the matrix from a rotation: [`Mat3::rotation_error`](condyle_spatial::Mat3::rotation_error).
        error: f64,
    },
}

impl InvalidRotation {
    /// Returns a description of the error with its numbers, but without the name of the joint or frame.
    pub(crate) fn fault(&self) -> String {
        match *self {
            Self::Joint { name, first, end, length, .. } => {
                format!("its rotation, {name}[{first}..{end}], has the length {length}, expected 1")
            }
            Self::Pose { name, index, error } => {
                format!("{name}[{index}].pose is no rotation: off by {error}, at most {ROTATION_ROUNDING} is allowed")
            }
        }
    }
}

impl fmt::Display for InvalidRotation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Joint { body, .. } => write!(f, "joint of body {body}: {}", self.fault()),
            Self::Pose { .. } => f.write_str(&self.fault()),
        }
    }
}

impl From<cone_program::Status> for Status {
    fn from(status: cone_program::Status) -> Self {
        match status {
            cone_program::Status::Infeasible => Self::Infeasible,
            cone_program::Status::IterationLimit => Self::IterationLimit,
            cone_program::Status::TimeLimit => Self::TimeLimit,
            // The objective is bounded below, and the input was checked. So `Unbounded` and `NotFinite` can only result
            // from numerical failures here.
            cone_program::Status::Unbounded
            | cone_program::Status::NotFinite { .. }
            | cone_program::Status::NumericalError => Self::NumericalError,
        }
    }
}

/// Returns `Ok` if every number of an argument is finite.
pub(crate) fn finite(name: &'static str, mut numbers: impl Iterator<Item = f64>) -> Result<(), Status> {
    let mut index = 0;
    match numbers.find(|x| {
        index += 1;
        !x.is_finite()
    }) {
        Some(value) => Err(Status::NotFinite { name, index: index - 1, value }),
        None => Ok(()),
    }
}
