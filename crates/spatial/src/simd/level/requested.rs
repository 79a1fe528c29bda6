//! SIMD level that an environment variable requests.

use super::{Level, Unsupported};
use core::fmt;

/// Error: `CONDYLE_LEVEL` has a value that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refused {
    /// The value is not the name of a level.
    Unknown(
        /// Value of the variable.
        String,
    ),
    /// This processor does not have the level.
    Unsupported(
        /// Requested level.
        Level,
    ),
}

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(name) => write!(f, "CONDYLE_LEVEL: expected {}, found `{name}`", List(&Level::ALL))?,
            Self::Unsupported(level) => write!(f, "CONDYLE_LEVEL: {}", Unsupported(*level))?,
        }
        let here: Vec<Level> = Level::ALL.into_iter().filter(|level| level.is_supported()).collect();
        write!(f, " (this processor has {})", List(&here))
    }
}

impl core::error::Error for Refused {}

/// List of SIMD levels. It is displayed as words with commas and "or".
struct List<'a>(&'a [Level]);

impl fmt::Display for List<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, level) in self.0.iter().enumerate() {
            let before = if i == 0 {
                ""
            } else if i + 1 == self.0.len() {
                " or "
            } else {
                ", "
            };
            write!(f, "{before}{level}")?;
        }
        Ok(())
    }
}

/// Returns the level that `CONDYLE_LEVEL` requests, or `None` if it is not set.
///
/// ```
/// let requested = condyle_spatial::level::requested()?; // a program that would rather stop than run another level
/// assert!(requested.is_none_or(|level| level.is_supported()));
/// # Ok::<(), condyle_spatial::level::Refused>(())
/// ```
///
/// # Errors
/// Returns [`Refused`] if the value is not the name of a level, or if this processor does not have the level.
pub fn requested() -> Result<Option<Level>, Refused> {
    let Some(name) = std::env::var_os("CONDYLE_LEVEL") else { return Ok(None) };
    let Some(level) = Level::ALL.into_iter().find(|level| name == level.name()) else {
        return Err(Refused::Unknown(name.to_string_lossy().into_owned()));
    };
    if level.is_supported() { Ok(Some(level)) } else { Err(Refused::Unsupported(level)) }
}
