//! Errors in descriptions and arguments.

/// Error in the description of a problem, or in its arguments.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A frame or joint does not exist, or a position is not a valid position of the robot.
    #[error(transparent)]
    Model(#[from] condyle_dynamics::Error),
    /// A number of a task lies outside of its range.
    #[error("task `{task}`: {name} is {value}, but it must be {allowed}")]
    Task {
        /// Name of the task: its kind, or the frame that it moves.
        task: String,
        /// Name of the invalid field of the task.
        name: &'static str,
        /// The invalid value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// The list of a task's factors is too short or too long.
    #[error("task `{task}`: factors: expected {expected} numbers or none, found {found}")]
    Factors {
        /// Name of the task.
        task: String,
        /// Number of components of the task.
        expected: usize,
        /// Number of factors given.
        found: usize,
    },
    /// A task has a root, but its quantity is not measured relative to a frame.
    #[error("task `{task}`: root `{root}`: only pose, position and orientation of a frame have a root")]
    Root {
        /// Name of the task.
        task: String,
        /// The root.
        root: String,
    },
    /// A coupled joint does not have exactly one coordinate of its own.
    #[error("coupling: joint `{joint}` does not have one coordinate in q and in v")]
    Coupling {
        /// The joint's name.
        joint: String,
    },
    /// A task needs a mass, but the robot has none.
    #[error("task `com`: no moving body of robot `{robot}` has mass")]
    NoMass {
        /// Name of the robot.
        robot: String,
    },
    /// A setting lies outside of its range.
    #[error("setting `{name}` is {value}, but it must be {allowed}")]
    Setting {
        /// Name of the invalid field of the settings.
        name: &'static str,
        /// The invalid value.
        value: f64,
        /// The allowed range, in words.
        allowed: &'static str,
    },
    /// A limit is given for the position of a joint on a circle, a sphere or in free space, which has no limits here.
    #[error("limits of joint `{joint}`: entry {index} is finite, but positions of such joints have no limits")]
    Unlimited {
        /// The joint's name.
        joint: String,
        /// Index of the entry in q.
        index: usize,
    },
    /// A lower limit is above the upper limit.
    #[error("limits of joint `{joint}`: lower is {lower}, above upper, which is {upper}")]
    Limits {
        /// The joint's name.
        joint: String,
        /// Lower limit.
        lower: f64,
        /// Upper limit.
        upper: f64,
    },
    /// A list does not have the required length.
    #[error("`{name}`: expected {expected} numbers, found {found}")]
    Length {
        /// Name of the list.
        name: &'static str,
        /// The required length.
        expected: usize,
        /// The length given.
        found: usize,
    },
    /// A number of an argument is infinite or NaN.
    #[error("`{name}[{index}]` is {value}, which is not finite")]
    NotFinite {
        /// Name of the argument.
        name: &'static str,
        /// Index of the number in the argument. The numbers of a pose are its rotation, column by column, and then its
        /// translation.
        index: usize,
        /// The number.
        value: f64,
    },
    /// The matrix of a target pose is not a rotation.
    #[error("`{name}[{index}]`: its matrix is no rotation: off by {error}, at most {ROTATION} is allowed")]
    Rotation {
        /// Name of the argument.
        name: &'static str,
        /// Index of the pose.
        index: usize,
        /// Distance of the matrix from a rotation.
        error: f64,
    },
    /// A search has no frame to move.
    #[error("frames: expected at least one frame, found none")]
    NoFrames,
}

/// Maximum distance of a target's matrix from a rotation. Rotations that were rounded to four digits are accepted.
pub(crate) const ROTATION: f64 = 1e-3;

/// Checks that all numbers are finite.
pub(crate) fn finite(name: &'static str, numbers: &[f64]) -> Result<(), Error> {
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(index) => Err(Error::NotFinite { name, index, value: numbers[index] }),
        None => Ok(()),
    }
}

/// Checks the length of a list.
pub(crate) fn length(name: &'static str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected { Ok(()) } else { Err(Error::Length { name, expected, found }) }
}

/// Checks target poses: finite numbers and rotations.
pub(crate) fn poses(name: &'static str, poses: &[condyle_dynamics::Se3<f64>]) -> Result<(), Error> {
    for (index, pose) in poses.iter().enumerate() {
        let [x, y, z] = pose.rotation.columns();
        for (k, part) in [x, y, z, pose.translation].into_iter().enumerate() {
            if let Some(i) = part.to_array().iter().position(|x| !x.is_finite()) {
                return Err(Error::NotFinite { name, index: 12 * index + 3 * k + i, value: part.to_array()[i] });
            }
        }
        let error = pose.rotation.rotation_error();
        if error > ROTATION {
            return Err(Error::Rotation { name, index, error });
        }
    }
    Ok(())
}
