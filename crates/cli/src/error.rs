//! Errors of the program. Each error has an exit status for scripts, and one line of text for people.

use std::process::ExitCode;

/// Exit statuses of the program, as `--help` lists them.
pub(crate) const STATUSES: &str = "\
Exit status:
  0    done, and the answer is yes
  1    done, and the answer is no: over budget, a check failed, the target is missed, a limit is not held,
       the robot fell
  2    a file, flag, number or name is wrong: one line says which, and nothing is written
  130  stopped by Ctrl-C; the best found so far is written";

/// Reason why the exit status is not 0.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// Error in the robot's file, or unknown name of a frame or joint.
    #[error(transparent)]
    Model(#[from] condyle::ModelError),
    /// Error in the optimal control problem built from a task.
    #[error(transparent)]
    Problem(#[from] condyle::optimal::Error),
    /// Error in the description of a controller: the robot, its feet, the gait or a setting.
    #[error(transparent)]
    Controller(#[from] condyle::mpc::Error),
    /// Error in the description of a search for a posture.
    #[error(transparent)]
    Posture(#[from] condyle::ik::Error),
    /// Invalid value of an option.
    #[error("--{option}: {what}")]
    Option { option: &'static str, what: String },
    /// Unknown name of a robot.
    #[error("no robot `{name}`{nearest}")]
    Robot { name: String, nearest: String },
    /// File that cannot be read, or that describes no robot.
    #[error("{file}: {what}")]
    File { file: String, what: String },
    /// Error in a line of a task file.
    #[error("{file}:{line}: {what}")]
    Task { file: String, line: usize, what: String },
    /// Command that needs a feature of Cargo, with which this program was not built.
    #[cfg(not(feature = "generate"))]
    #[error(
        "{command}: this program was built without the feature `{command}`: cargo install condyle-cli --features {command}"
    )]
    Feature { command: &'static str },
    /// Robot without moving joints.
    #[error("the robot has no joint that moves")]
    Rigid,
    /// File that cannot be written.
    #[error("{file}: {source}")]
    Write { file: String, source: std::io::Error },
    /// Negative answer to the question of a command, for example if a check failed.
    #[error("{0}")]
    NegativeAnswer(String),
    /// Interruption by Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// Returns the exit status of the error.
    pub(crate) fn status(&self) -> ExitCode {
        match self {
            Self::NegativeAnswer(_) => ExitCode::from(1),
            Self::Interrupted => ExitCode::from(130),
            _ => ExitCode::from(2),
        }
    }
}

/// Checks that the value of an option is above 0.
pub(crate) fn positive(option: &'static str, value: f64) -> Result<(), Error> {
    match value > 0.0 && value.is_finite() {
        true => Ok(()),
        false => Err(Error::Option { option, what: format!("must be above 0, not {value}") }),
    }
}

/// Returns a suffix for an error message, which suggests the most similar of the valid names. The suffix is empty if no
/// names are given.
pub(crate) fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let found = names.into_iter().min_by_key(|other| strsim::osa_distance(other, name));
    found.map_or(String::new(), |found| format!("; nearest is `{found}`"))
}
