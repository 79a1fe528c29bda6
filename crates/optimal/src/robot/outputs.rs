//! Outputs of the dynamics of a knot that residuals may read.

use core::ops::Range;

/// Vector that the dynamics of a knot compute in addition to the next state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    /// Accelerations q̈, or the jump v⁺ − v of the velocities at an impact.
    Acceleration,
    /// Efforts τ of all joints.
    Effort,
    /// Forces λ of all contacts, or their impulses at an impact.
    Force,
    /// Accelerations J q̈ + γ of all contacts, if joint accelerations are controls.
    ContactAcceleration,
}

/// Outputs that the dynamics of a knot can compute. The set of outputs is fixed when the action is created.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Capabilities {
    pub nu: usize,
    /// Whether the dynamics compute accelerations and efforts.
    pub effort: bool,
    /// Whether the knot is an impact.
    pub impulse: bool,
    /// Whether accelerations are controls, and also the forces of contacts.
    pub inverse: bool,
    /// Orthonormal basis Nᵀ of the joint efforts that no control can produce; empty unless accelerations are controls.
    /// Shape: undriven efforts × nv, row after row.
    pub undriven: Vec<f64>,
    /// Name of each contact, and the range of its rows in λ.
    pub contacts: Vec<(String, Range<usize>)>,
}

impl Capabilities {
    /// Returns the number of rows of λ.
    pub(crate) fn rows(&self) -> usize {
        self.contacts.last().map_or(0, |(_, rows)| rows.end)
    }

    /// Returns the rows of the contact with the name `name`, or an error text that lists the existing names.
    pub(crate) fn contact(&self, name: &str) -> Result<Range<usize>, String> {
        match self.contacts.iter().find(|(n, _)| n == name) {
            Some((_, rows)) => Ok(rows.clone()),
            None => {
                let names: Vec<_> = self.contacts.iter().map(|(n, _)| format!("`{n}`")).collect();
                let there = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                Err(format!("there is no contact `{name}` at this knot; there is {there}"))
            }
        }
    }
}
