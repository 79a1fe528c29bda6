//! Runs of numbers that go to other places.
#![allow(unsafe_code)]

use crate::registers::Vector;
use crate::tile::SLACK;
use alloc::vec::Vec;

/// Numbers of a row that go to other places, in runs of neighbours that stay neighbours.
#[derive(Clone, Debug, Default)]
pub struct Runs {
    /// The first place in the one row and in the other, and how many they are.
    runs: Vec<[usize; 3]>,
    /// What is behind the last of all places, in both rows.
    ends: [usize; 2],
}

impl Runs {
    /// No run, and room for so many.
    pub fn with_capacity(runs: usize) -> Self {
        Self { runs: Vec::with_capacity(runs), ends: [0; 2] }
    }

    /// Forgets all runs.
    pub fn clear(&mut self) {
        self.runs.clear();
        self.ends = [0; 2];
    }

    /// The number at `from` goes to `to`.
    #[inline(always)]
    pub fn push(&mut self, from: usize, to: usize) {
        match self.runs.last_mut() {
            Some([first, place, length]) if [*first + *length, *place + *length] == [from, to] => *length += 1,
            _ => self.runs.push([from, to, 1]),
        }
        self.ends = [self.ends[0].max(from + 1), self.ends[1].max(to + 1)];
    }

    /// The runs: the first place in the one row and in the other, and how many they are.
    pub fn iter(&self) -> impl Iterator<Item = [usize; 3]> {
        self.runs.iter().copied()
    }

    /// Writes a times the numbers of a row to their places, whole registers at a time: what is behind a run may change, up to
    /// [`SLACK`] numbers, and the run after it goes over that.
    ///
    /// # Panics
    /// If one of the rows has not all places and slack behind them.
    #[inline(always)]
    pub fn copy_scaled<V: Vector>(&self, row: &[f64], a: f64, to: &mut [f64]) {
        assert!(self.ends[0] + SLACK <= row.len() && self.ends[1] + SLACK <= to.len(), "rows without slack");
        let a = V::splat(a);
        for &[from, place, length] in &self.runs {
            let mut i = 0;
            while i < length {
                // SAFETY: i is in the run, which ends `SLACK` numbers before its rows do, and a register has no more than these
                // and one.
                unsafe {
                    let x = V::load(row.get_unchecked(from + i..from + i + V::N));
                    x.mul(a).store(to.get_unchecked_mut(place + i..place + i + V::N));
                }
                i += V::N;
            }
        }
    }
}
