//! Errors of descriptions and of calls.

/// Error in the description of a controller, or in the arguments of a call.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Error of the optimal control problem.
    #[error(transparent)]
    Optimal(#[from] condyle_optimal::Error),
    /// The foot does not fit the robot, or has an invalid number.
    #[error("foot `{foot}`: {what}")]
    Foot {
        /// Name of the foot's frame.
        foot: String,
        /// Description of the error.
        what: String,
    },
    /// The gait does not fit the feet, or leaves the robot without support.
    #[error("gait: {what}")]
    Gait {
        /// Description of the error.
        what: String,
    },
    /// The setting has a value that is not allowed.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
        /// Description of the allowed values.
        allowed: &'static str,
    },
    /// The robot cannot be controlled as asked.
    #[error("robot: {what}")]
    Robot {
        /// Description of the error.
        what: String,
    },
    /// An argument has a number that is not finite, or another length than expected.
    #[error("`{name}`: {what}")]
    Argument {
        /// Name of the argument.
        name: &'static str,
        /// Description of the error.
        what: String,
    },
    /// The time of the call is before the time of the last call.
    #[error("time runs backwards: {t} s after a call at {last} s; `reset` begins anew")]
    Time {
        /// Time of the call (s).
        t: f64,
        /// Time of the last call (s).
        last: f64,
    },
}

impl Error {
    /// Returns an error unless `is_valid` is true.
    pub(crate) fn check(name: &'static str, value: f64, is_valid: bool, allowed: &'static str) -> Result<(), Self> {
        if is_valid { Ok(()) } else { Err(Self::Setting { name, value, allowed }) }
    }

    /// Returns an error if an array has another length than expected, or an entry that is not finite.
    pub(crate) fn check_array(name: &'static str, array: &[f64], length: usize) -> Result<(), Self> {
        if array.len() != length {
            let what = format!("expected {length} numbers, found {}", array.len());
            return Err(Self::Argument { name, what });
        }
        match array.iter().position(|number| !number.is_finite()) {
            Some(index) => Err(Self::Argument { name, what: format!("entry {index} is {}", array[index]) }),
            None => Ok(()),
        }
    }
}
