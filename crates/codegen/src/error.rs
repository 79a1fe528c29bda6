//! Errors of code generation.

/// Error of code generation.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No function has this name.
    #[error("no function `{name}`; there are {}", crate::FUNCTIONS.join(", "))]
    Function {
        /// The given name.
        name: String,
    },
    /// A function name was given twice. The generated code would define this function twice.
    #[error("{name}: named twice")]
    Twice {
        /// Name of the function.
        name: String,
    },
    /// A function needs frames or constraints, but the settings list none.
    #[error("{name}: needs {needs}, of which there are none")]
    Missing {
        /// Name of the function.
        name: &'static str,
        /// Whether frames or constraints are missing, in words.
        needs: &'static str,
    },
    /// The joint-space inertia matrix M is singular, but the function needs M⁻¹.
    #[error("{name}: the inertia matrix is singular, because of joint `{joint}`")]
    Singular {
        /// Name of the function.
        name: &'static str,
        /// Name of a joint that moves no inertia.
        joint: String,
    },
    /// The robot, one of its frames or the constraints are invalid.
    #[error(transparent)]
    Model(#[from] condyle_model::Error),
    /// A file cannot be written.
    #[error("{file}: {source}")]
    Write {
        /// Path of the file.
        file: String,
        /// The system's error.
        source: std::io::Error,
    },
}
