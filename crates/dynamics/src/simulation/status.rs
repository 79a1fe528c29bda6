//! The outcome of a step.

use core::fmt;

/// Outcome of a step, or of a run of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
#[non_exhaustive]
pub enum Status {
    /// All steps were taken, within all tolerances.
    Done,
    /// Newton's method has not reached the tolerance: the step was not taken, the state is the one before it. A shorter
    /// step helps.
    NotConverged {
        /// Number of iterations that were made.
        iterations: usize,
    },
    /// The impulses of the ground break the laws of contact by more than the tolerance. The step was taken with them: they
    /// push only, and are inside the friction cones. More iterations
    /// ([`Ground::max_iterations`](super::Ground::max_iterations)) or a shorter step may help. Where M is badly conditioned, as
    /// with bodies of some grams, rounding leaves an error, and the [`tolerance`](super::Ground::tolerance) should be larger.
    ContactsNotConverged {
        /// Largest error in the velocity of a point (m/s).
        error: f64,
    },
    /// The velocity or the position is no longer finite: the step was not taken, the state is the one before it.
    NotFinite,
}

impl Status {
    /// Whether all steps were taken, within all tolerances.
    pub fn is_done(self) -> bool {
        self == Self::Done
    }

    /// Whether all steps were taken.
    pub fn is_taken(self) -> bool {
        matches!(self, Self::Done | Self::ContactsNotConverged { .. })
    }

    /// Returns the status of a run whose last step has the status `last`: that of a step that was not taken, or else the
    /// largest error of the contacts.
    #[must_use = "the status of the run"]
    pub fn and(self, last: Self) -> Self {
        match (self, last) {
            (Self::ContactsNotConverged { error }, Self::Done) => Self::ContactsNotConverged { error },
            (Self::ContactsNotConverged { error: a }, Self::ContactsNotConverged { error: b }) => {
                Self::ContactsNotConverged { error: a.max(b) }
            }
            _ => last,
        }
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => write!(f, "done"),
            Self::NotConverged { iterations } => {
                write!(f, "Newton's method did not converge in {iterations} iterations; the step was not taken")
            }
            Self::ContactsNotConverged { error } => {
                write!(f, "contacts did not converge: an error of {error:.1e} m/s is left; the step was taken")
            }
            Self::NotFinite => write!(f, "the state is no longer finite; the step was not taken"),
        }
    }
}
