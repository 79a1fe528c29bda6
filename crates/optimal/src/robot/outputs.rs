//! Outputs of the dynamics of a knot, on which its residuals may depend.

use core::ops::Range;

/// Vector that the dynamics of a knot compute besides the next state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    /// Accelerations q̈, or the jump v⁺ − v of the velocities at an impact.
    Acceleration,
    /// Efforts τ of all joints.
    Effort,
    /// Forces λ, or impulses at an impact, of all contacts.
    Force,
    /// Accelerations J q̈ + γ of all contacts, if joint accelerations are controls.
    ContactAcceleration,
}

/// Outputs that the dynamics of a knot can compute, known when the knot is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Capabilities {
    pub nu: usize,
    /// Whether the dynamics compute accelerations and efforts.
    pub effort: bool,
    /// Whether the knot is an impact.
    pub impulse: bool,
    /// Whether accelerations, and forces of contacts, are controls.
    pub inverse: bool,
    /// Basis Nᵀ of the joint efforts that no control can produce, if accelerations are controls. Shape: undriven
    /// efforts × nv, row after row.
    pub undriven: Vec<f64>,
    /// Name of each contact, and the rows of λ that belong to it.
    pub contacts: Vec<(String, Range<usize>)>,
}

impl Capabilities {
    /// Returns the number of rows of λ.
    pub(crate) fn rows(&self) -> usize {
        self.contacts.last().map_or(0, |(_, rows)| rows.end)
    }

    /// Returns the rows of the contact called `name`, or an error text with the existing names.
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
