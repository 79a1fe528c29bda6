//! The level that the environment asks for.

use super::{Level, Unsupported};
use core::fmt;

/// A `CONDYLE_LEVEL` that cannot be obeyed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Refused {
    /// The value names no level.
    Unknown(
        /// The value.
        String,
    ),
    /// This processor does not have the level.
    Unsupported(
        /// The level.
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

/// Levels as a sentence names them.
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

/// The level that `CONDYLE_LEVEL` asks for, if it is set.
///
/// ```
/// let requested = condyle_spatial::level::requested()?; // a program that would rather stop than run another level
/// assert!(requested.is_none_or(|level| level.is_supported()));
/// # Ok::<(), condyle_spatial::level::Refused>(())
/// ```
///
/// # Errors
/// [`Refused`], if it names no level, or one that this processor does not have.
pub fn requested() -> Result<Option<Level>, Refused> {
    let Some(name) = std::env::var_os("CONDYLE_LEVEL") else { return Ok(None) };
    let Some(level) = Level::ALL.into_iter().find(|level| name == level.name()) else {
        return Err(Refused::Unknown(name.to_string_lossy().into_owned()));
    };
    if level.is_supported() { Ok(Some(level)) } else { Err(Refused::Unsupported(level)) }
}
