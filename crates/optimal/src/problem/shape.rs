//! Dimensions of a horizon.

use crate::error::Error;
use crate::lq::LqKnot;
use core::ops::Range;

/// Maximum number of knots of a horizon.
pub(crate) const MOST_KNOTS: usize = 1 << 20;
/// Maximum number of entries of a state, of a change of state, and of the controls of a knot. A square matrix of this
/// size takes 128 MiB.
pub(crate) const MOST_ENTRIES: usize = LqKnot::MOST_SIZE;

/// Dimensions of a horizon, which determine the lengths of trajectories and workspaces.
#[derive(Debug, PartialEq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Shape {
    pub(crate) nx: usize,
    pub(crate) ndx: usize,
    /// Offset of uₜ in the flat controls, N + 1 entries. The last entry is the length of the controls.
    pub(crate) offsets: Vec<usize>,
}

impl Clone for Shape {
    fn clone(&self) -> Self {
        Self { nx: self.nx, ndx: self.ndx, offsets: self.offsets.clone() }
    }

    /// Copies the dimensions. Does not allocate if both horizons have the same length.
    fn clone_from(&mut self, other: &Self) {
        (self.nx, self.ndx) = (other.nx, other.ndx);
        self.offsets.clone_from(&other.offsets);
    }
}

impl Shape {
    pub(crate) fn horizon(&self) -> usize {
        self.offsets.len() - 1
    }

    pub(crate) fn nu(&self, t: usize) -> usize {
        self.offsets.get(t + 1).map_or(0, |end| end - self.offsets[t])
    }

    /// Returns the index range of xₜ in a flat trajectory.
    pub(crate) fn x(&self, t: usize) -> Range<usize> {
        t * self.nx..(t + 1) * self.nx
    }

    /// Returns the index range of δxₜ in a flat trajectory of changes.
    pub(crate) fn dx(&self, t: usize) -> Range<usize> {
        t * self.ndx..(t + 1) * self.ndx
    }

    /// Returns the index range of uₜ in flat controls; empty at the terminal knot.
    pub(crate) fn u(&self, t: usize) -> Range<usize> {
        self.offsets[t]..self.offsets[t] + self.nu(t)
    }

    /// Checks that the dimensions, read from a file, are valid dimensions of a problem.
    #[cfg(feature = "serde")]
    pub(crate) fn check_itself(&self) -> Result<(), String> {
        let Self { nx, ndx, offsets } = self;
        if offsets.len() < 2 || offsets.len() > MOST_KNOTS + 1 || offsets[0] != 0 {
            return Err(format!("a horizon of {} offsets: expected at least two, the first 0", offsets.len()));
        }
        if let Some(t) =
            (1..offsets.len()).find(|&t| offsets[t] < offsets[t - 1] || offsets[t] - offsets[t - 1] > MOST_ENTRIES)
        {
            return Err(format!("knot {}: its controls end at {}, and begin at {}", t - 1, offsets[t], offsets[t - 1]));
        }
        match [nx, ndx].into_iter().find(|n| !(1..=MOST_ENTRIES).contains(*n)) {
            Some(n) => Err(format!("a state of {n} numbers: expected 1 to {MOST_ENTRIES}")),
            None => Ok(()),
        }
    }

    /// Returns `Ok` if the dimensions of a problem equal the dimensions for which a solver was created.
    pub(crate) fn check(&self, found: &Self) -> Result<(), Error> {
        if self.horizon() != found.horizon() {
            return Err(Error::Length { name: "knot_models", expected: self.horizon(), found: found.horizon() });
        }
        for t in 0..=self.horizon() {
            for (name, expected, found) in
                [("nx", self.nx, found.nx), ("ndx", self.ndx, found.ndx), ("nu", self.nu(t), found.nu(t))]
            {
                if expected != found {
                    return Err(Error::Dimension { knot: t, name, expected, found });
                }
            }
        }
        Ok(())
    }
}
