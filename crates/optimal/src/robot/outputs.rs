//! Outputs of the dynamics of a knot, on which its residuals may depend.

use core::ops::Range;

/// Vector that the dynamics of a knot compute besides the next state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Output {
    /// q̈, or v⁺ − v at an impact.
    Acceleration,
    /// τ of all joints.
    Effort,
    /// λ, the forces or impulses of all contacts.
    Force,
    /// J q̈ + γ of all contacts, where accelerations are controls.
    ContactAcceleration,
}

/// Outputs that the dynamics of a knot have, known when the knot is made.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Capabilities {
    pub nu: usize,
    /// Whether there are accelerations and efforts.
    pub effort: bool,
    /// Whether it is an impact.
    pub impulse: bool,
    /// Whether accelerations, and forces of contacts, are controls.
    pub inverse: bool,
    /// Nᵀ: the parts of the efforts that nothing drives, where accelerations are controls. Shape: parts × nv, row after
    /// row.
    pub undriven: Vec<f64>,
    /// Contacts' names and rows of λ.
    pub contacts: Vec<(String, Range<usize>)>,
}

impl Capabilities {
    /// Returns the number of rows of λ.
    pub(crate) fn rows(&self) -> usize {
        self.contacts.last().map_or(0, |(_, rows)| rows.end)
    }

    /// Returns the rows of the contact called `name`, or what is wrong with the name.
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
