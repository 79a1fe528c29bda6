//! Status that a simulation reports after a step.

use core::fmt;

/// Outcome of a step, or of a run of steps.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
#[non_exhaustive]
pub enum Status {
    /// Success: all steps were computed within all tolerances.
    Done,
    /// Failure of Newton's method to reach the tolerance. The step was discarded, and the old state is kept. A shorter
    /// step length may help.
    NotConverged {
        /// Number of iterations of Newton's method.
        iterations: usize,
    },
    /// Failure of the contact solver: the impulses of the ground violate the contact conditions by more than the
    /// tolerance. The step was still computed with these impulses, which only push and are inside the friction cones.
    /// More iterations ([`Ground::max_iterations`](super::Ground::max_iterations)) or a shorter step length may help.
    /// If M is badly conditioned, for example with bodies of a few grams, rounding errors may exceed the tolerance.
    /// Then the [`tolerance`](super::Ground::tolerance) should be larger.
    ContactsNotConverged {
        /// Largest error in the velocity of a point (m/s).
        error: f64,
    },
    /// Failure of a step whose velocity or position is not finite. The step was discarded, and the old state is kept.
    NotFinite,
}

impl Status {
    /// Returns whether all steps were computed within all tolerances.
    pub fn is_done(self) -> bool {
        self == Self::Done
    }

    /// Returns whether all steps were computed, including steps in which the contact solver did not reach its
    /// tolerance.
    pub fn is_taken(self) -> bool {
        matches!(self, Self::Done | Self::ContactsNotConverged { .. })
    }

    /// Returns the status of a run of steps. `self` is the status of all earlier steps, and `last` is the status of the
    /// last step. If a step was discarded, the result is the status of this step. Otherwise, the result reports the
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
