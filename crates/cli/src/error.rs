//! What the program ends with: a status for scripts, and one line for people.

use std::process::ExitCode;

/// The statuses with which the program ends, as `--help` lists them.
pub(crate) const STATUSES: &str = "\
Exit status:
  0    done, and the answer is yes
  1    done, and the answer is no: over budget, a check failed, the target is missed, a limit is not held
  2    a file, flag, number or name is wrong: one line says which, and nothing is written
  130  stopped by Ctrl-C; the best found so far is written";

/// Why the program does not end with 0.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// The robot's file, or a name in it.
    #[error(transparent)]
    Model(#[from] condyle::ModelError),
    /// The problem that was made of a task.
    #[error(transparent)]
    Problem(#[from] condyle::optimal::Error),
    /// A flag.
    #[error("--{option}: {what}")]
    Option { option: &'static str, what: String },
    /// No such robot.
    #[error("no robot `{name}`{nearest}")]
    Robot { name: String, nearest: String },
    /// A file that is no robot's.
    #[error("{file}: {what}")]
    File { file: String, what: String },
    /// A line of a task.
    #[error("{file}:{line}: {what}")]
    Task { file: String, line: usize, what: String },
    /// A command of a feature with which the program was not built.
    #[cfg(not(feature = "generate"))]
    #[error(
        "{command}: this program was built without the feature `{command}`: cargo install condyle-cli --features {command}"
    )]
    Feature { command: &'static str },
    /// A robot without joints.
    #[error("the robot has no joint that moves")]
    Rigid,
    /// A file that cannot be written.
    #[error("{file}: {source}")]
    Write { file: String, source: std::io::Error },
    /// A question that was answered with no.
    #[error("{0}")]
    No(String),
    /// Ctrl-C.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// The status that belongs to it.
    pub(crate) fn status(&self) -> ExitCode {
        match self {
            Self::No(_) => ExitCode::from(1),
            Self::Interrupted => ExitCode::from(130),
            _ => ExitCode::from(2),
        }
    }
}

/// A flag's number that must be above 0.
pub(crate) fn positive(option: &'static str, value: f64) -> Result<(), Error> {
    match value > 0.0 && value.is_finite() {
        true => Ok(()),
        false => Err(Error::Option { option, what: format!("must be above 0, not {value}") }),
    }
}

/// The name that is most like another one, in words that go behind a message; nothing if there are none.
pub(crate) fn nearest<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    let found = names.into_iter().min_by_key(|other| strsim::osa_distance(other, name));
    found.map_or(String::new(), |found| format!("; nearest is `{found}`"))
}
