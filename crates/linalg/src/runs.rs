//! Runs of consecutive numbers that are copied to other indices.
#![allow(unsafe_code)]

use crate::registers::Vector;
use crate::tile::SLACK;
use alloc::vec::Vec;

/// Map from indices of one row to indices of another row, stored as runs of consecutive indices.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// First source index, first target index, and length of each run.
    runs: Vec<[usize; 3]>,
    /// End of all runs: the largest index plus 1, in the source row and in the target row.
    ends: [usize; 2],
}

impl Runs {
    /// Creates an empty map with memory for `runs` runs.
    pub fn with_capacity(runs: usize) -> Self {
        Self { runs: Vec::with_capacity(runs), ends: [0; 2] }
    }

    /// Removes all runs.
    pub fn clear(&mut self) {
        self.runs.clear();
        self.ends = [0; 2];
    }

    /// Adds the pair of source index `from` and target index `to` to the map.
    #[inline(always)]
    pub fn push(&mut self, from: usize, to: usize) {
        match self.runs.last_mut() {
            Some([first, place, length]) if [*first + *length, *place + *length] == [from, to] => *length += 1,
            _ => self.runs.push([from, to, 1]),
        }
        self.ends = [self.ends[0].max(from + 1), self.ends[1].max(to + 1)];
    }

    /// Returns the runs: first source index, first target index, and length.
    pub fn iter(&self) -> impl Iterator<Item = [usize; 3]> {
        self.runs.iter().copied()
    }

    /// Multiplies the numbers of a row by a and writes them to their target indices in `to`, in whole registers. Up to
    /// [`SLACK`] numbers after a run may change; the next run overwrites them.
    ///
    /// # Panics
    /// If `row` or `to` does not contain all indices and [`SLACK`] numbers of padding after them.
    #[inline(always)]
    pub fn copy_scaled<V: Vector>(&self, row: &[f64], a: f64, to: &mut [f64]) {
        assert!(self.ends[0] + SLACK <= row.len() && self.ends[1] + SLACK <= to.len(), "rows without padding");
        let a = V::splat(a);
        for &[from, place, length] in &self.runs {
            let mut i = 0;
            while i < length {
                // SAFETY: i is in the run. The run ends at least `SLACK` numbers before the end of `row` and of `to`,
                // and a register has at most `SLACK` + 1 numbers.
                unsafe {
                    let x = V::load(row.get_unchecked(from + i..from + i + V::N));
                    x.mul(a).store(to.get_unchecked_mut(place + i..place + i + V::N));
                }
                i += V::N;
            }
        }
    }
}
