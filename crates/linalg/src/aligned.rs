//! Memory in which the columns of a matrix begin at cache lines. A register that crosses two lines takes twice as long
//! to load or store.
#![allow(unsafe_code)]

use crate::tile::SLACK;
use alloc::vec::Vec;
use core::ops::{Deref, DerefMut};

/// Number of `f64` numbers in a cache line, and in the longest register.
const LINE: usize = 8;

/// Returns the stride of a matrix with the given number of rows: the rows, at least [`SLACK`] padding rows, and as many
/// more that each column begins at a cache line. The stride is no multiple of eight lines, because the columns would
/// then share few sets of a cache.
#[inline]
pub fn padded(rows: usize) -> usize {
    let stride = (rows + SLACK).next_multiple_of(LINE);
    if stride.is_multiple_of(8 * LINE) { stride + LINE } else { stride }
}

/// Line of a cache.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
struct Line([f64; LINE]);

/// Numbers whose first one begins at a cache line.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Aligned(Vec<Line>);

impl Aligned {
    /// Creates at least `length` zeros; the number of zeros is rounded up to whole cache lines.
    pub fn zeros(length: usize) -> Self {
        let mut numbers = Self::default();
        numbers.resize(length);
        numbers
    }

    /// Sets the length to `length`, rounded up to whole cache lines; new numbers are zeros. Allocates only if the
    /// length is larger than in all earlier calls.
    pub fn resize(&mut self, length: usize) {
        self.0.resize(length.div_ceil(LINE), Line([0.0; LINE]));
    }
}

impl Deref for Aligned {
    type Target = [f64];

    #[inline(always)]
    fn deref(&self) -> &[f64] {
        // SAFETY: a line consists of LINE numbers, without padding.
        unsafe { core::slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len() * LINE) }
    }
}

impl DerefMut for Aligned {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        // SAFETY: a line consists of LINE numbers, without padding.
        unsafe { core::slice::from_raw_parts_mut(self.0.as_mut_ptr().cast(), self.0.len() * LINE) }
    }
}
