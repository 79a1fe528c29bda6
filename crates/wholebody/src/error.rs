//! What can be wrong with a controller's description, and how a step can fail.

use crate::cone_program;

/// What is wrong with the description of a controller, found when it is built.
///
/// ```
/// use condyle_wholebody::{FrictionContact, Settings, Tasks, WholeBodyController};
/// let robot = condyle_dynamics::robots::quadruped();
/// let contacts = [FrictionContact::new("LF_fot", 0.7)];
/// let error = WholeBodyController::new(&robot, &contacts, Tasks::default(), Settings::default()).unwrap_err();
/// assert_eq!(error.to_string(), "unknown frame `LF_fot`; nearest is `LF_foot`");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A name of the model is unknown; the message has the nearest one.
    #[error(transparent)]
    Model(#[from] condyle_dynamics::Error),
    /// A controller of contact forces needs a contact.
    #[error("the list of contacts is empty")]
    NoContacts,
    /// The same frame is listed as a contact twice.
    #[error("contact `{frame}` is listed twice")]
    DuplicateContact {
        /// The frame.
        frame: String,
    },
    /// A number of a contact lies outside of its range.
    #[error("contact `{frame}`: {name} is {value}, but it must be {allowed}")]
    Contact {
        /// The frame.
        frame: String,
        /// The field of [`FrictionContact`](crate::FrictionContact).
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        allowed: &'static str,
    },
    /// A weight or gain of a task lies outside of its range.
    #[error("task `{task}`: {name} is {value}, but it must be {allowed}")]
    Task {
        /// `com`, `posture`, or the frame.
        task: String,
        /// The field of the task.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        allowed: &'static str,
    },
    /// A setting lies outside of its range.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// The field of [`Settings`](crate::Settings).
        name: &'static str,
        /// Its value.
        value: f64,
        /// The range.
        allowed: &'static str,
    },
    /// A vector has another length than the model needs.
    #[error("`{name}`: expected {expected} numbers, found {found}")]
    Length {
        /// The field.
        name: &'static str,
        /// What the model needs.
        expected: usize,
        /// The length given.
        found: usize,
    },
}

/// Why a step gave no command. A step that gave one never returns a `Status`.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Status {
    /// Dynamics, held contacts, friction cones, force bounds and torque limits exclude each other: the solver holds a
    /// certificate of it. No iterate exists; the last command is unchanged.
    #[error("dynamics, contacts, friction cones and limits exclude each other")]
    Infeasible,
    /// [`Settings::max_iterations`](crate::Settings::max_iterations) were not enough. The last iterate is kept.
    #[error("not solved within the allowed iterations")]
    IterationLimit,
    /// [`Settings::time_limit`](crate::Settings::time_limit) was not enough. The last iterate is kept.
    #[error("not solved within the allowed time")]
    TimeLimit,
    /// A factorisation failed or the iterates made no more progress. The last command is unchanged.
    #[error("the solver stopped for numerical reasons")]
    NumericalError,
    /// A number of the state or of the references is infinite or NaN. Nothing was solved; the last command is
    /// unchanged.
    #[error("`{name}[{index}]` is {value}, which is not finite")]
    NotFinite {
        /// `q`, `v`, or the field of [`References`](crate::References).
        name: &'static str,
        /// Its position in the flattened argument.
        index: usize,
        /// The number.
        value: f64,
    },
}

impl From<cone_program::Status> for Status {
    fn from(status: cone_program::Status) -> Self {
        match status {
            cone_program::Status::Infeasible => Self::Infeasible,
            cone_program::Status::IterationLimit => Self::IterationLimit,
            cone_program::Status::TimeLimit => Self::TimeLimit,
            // The objective is bounded below, and what goes into the numbers was checked: both are numerical failures.
            cone_program::Status::Unbounded
            | cone_program::Status::NotFinite { .. }
            | cone_program::Status::NumericalError => Self::NumericalError,
        }
    }
}

/// `Ok` if every number of an argument is finite.
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
