//! Why no code was written.

/// Why no code was written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// There is no function of that name.
    #[error("no function `{name}`; there are {}", crate::FUNCTIONS.join(", "))]
    Function {
        /// The name that was given.
        name: String,
    },
    /// A function was named twice: compilers would find two of one name.
    #[error("{name}: named twice")]
    Twice {
        /// The function.
        name: String,
    },
    /// A function that needs frames or constraints was given none.
    #[error("{name}: needs {needs}, of which there are none")]
    Missing {
        /// The function.
        name: &'static str,
        /// What it needs.
        needs: &'static str,
    },
    /// M is singular, and the function needs its inverse.
    #[error("{name}: the inertia matrix is singular, because of joint `{joint}`")]
    Singular {
        /// The function.
        name: &'static str,
        /// A joint that moves nothing with inertia.
        joint: String,
    },
    /// Something is wrong with the robot, a frame of it or the constraints.
    #[error(transparent)]
    Model(#[from] condyle_model::Error),
    /// A file cannot be written.
    #[error("{file}: {source}")]
    Write {
        /// Its path.
        file: String,
        /// What the system says.
        source: std::io::Error,
    },
}
