//! Sums of outer products of rows that contain blocks of zeros.
#![allow(unsafe_code)]

use crate::aligned::Aligned;
use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::{SLACK, Store, add_outer, next_strip, store_tile};
use crate::vectors::copy_scaled;
use alloc::vec::Vec;

/// Rows of numbers, stored one after another. Each row has a [`mask`] of its nonzero blocks.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SparseRows {
    /// Numbers of all rows; each row is padded with zeros up to the stride.
    pub numbers: Aligned,
    /// Mask of each row.
    pub masks: Vec<u64>,
}

impl SparseRows {
    /// Sets the number of rows. Allocates only if this number is larger than in all earlier calls.
    pub fn resize(&mut self, rows: usize, stride: usize) {
        self.numbers.resize(rows * stride);
        self.masks.resize(rows, 0);
    }

    /// Computes the masks of all rows.
    #[inline(always)]
    pub fn mark(&mut self, stride: usize) {
        for k in 0..self.masks.len() {
            self.masks[k] = mask(&self.numbers[k * stride..(k + 1) * stride]);
        }
    }
}

/// Returns the mask of a row's nonzero blocks. Bit k is set if at least one number in block k is nonzero. Block k has
/// [`block`] columns, from column k·`block` on.
#[inline(always)]
pub fn mask(row: &[f64]) -> u64 {
    let (fours, rest) = row.as_chunks::<4>();
    let (wide, mut last, mut mask) = (block(row.len()).trailing_zeros() - 2, [0.0; 4], 0);
    for k in 0..fours.len() {
        mask |= u64::from(any(&fours[k])) << (k >> wide);
    }
    if rest.is_empty() {
        return mask;
    }
    last[..rest.len()].copy_from_slice(rest);
    mask | u64::from(any(&last)) << (fours.len() >> wide)
}

/// Returns whether at least one of four numbers is nonzero. NaN counts as nonzero.
#[inline(always)]
fn any(x: &[f64; 4]) -> bool {
    let bits = x[0].to_bits() | x[1].to_bits() | x[2].to_bits() | x[3].to_bits();
    bits << 1 != 0 // without the sign, so that −0 counts as zero
}

/// Computes y −= Σ aᵢ xᵢ in whole registers. Numbers at the end of y that do not fill a register are not changed.
///
/// # Panics
/// If an entry of `x` is not as long as `y`.
#[inline(always)]
pub fn subtract_rows<V: Vector, const N: usize>(y: &mut [f64], x: [&[f64]; N], a: [f64; N]) {
    let n = y.len();
    let mut factors = [V::splat(0.0); N];
    for k in 0..N {
        assert!(x[k].len() == n, "rows of different lengths");
        factors[k] = V::splat(-a[k]);
    }
    for (i, y) in y.chunks_exact_mut(V::N).enumerate() {
        let mut sum = V::load(y);
        for k in 0..N {
            // SAFETY: all rows and y have n numbers.
            sum = V::load(unsafe { x[k].get_unchecked(i * V::N..(i + 1) * V::N) }).mul_add(factors[k], sum);
        }
        sum.store(y);
    }
}

/// Returns the number of columns in a block, for rows of `stride` numbers. Each block has one bit in a [`mask`]. The
/// number of columns is a power of two.
#[inline(always)]
pub fn block(stride: usize) -> usize {
    4 * stride.div_ceil(4 * 64).next_power_of_two()
}

/// Run of `count` outer products: left row k times right row k. The left rows are consecutive, and so are the right
/// rows.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Index of the first left row and of the first right row.
    rows: [usize; 2],
    count: usize,
    /// Masks of the run: one for all left rows, one for all right rows.
    masks: [u64; 2],
}

/// Position of a run in the memory of all rows.
#[derive(Debug, Clone, Copy, Default)]
struct Place {
    /// Offsets of the first left row and of the first right row.
    at: [usize; 2],
    /// Total length of the left rows of the run.
    length: usize,
    masks: [u64; 2],
}

/// Sum of outer products, each of a left row and a right row. Blocks of zeros are skipped. Each row has one number more
/// than the sum has columns. In a left row, this number contributes to the gradient, which is the last row of the sum.
#[derive(Debug, Clone, Default)]
pub struct OuterProducts {
    /// Numbers of all rows.
    pub rows: Aligned,
    /// Distance from one row to the next.
    stride: usize,
    /// Number of columns of the sum.
    size: usize,
    /// Number of rows.
    count: usize,
    runs: Vec<Run>,
    /// Positions of the runs in memory (scratch).
    places: Vec<Place>,
}

impl OuterProducts {
    /// Allocates memory for `products` products, and for rows with `numbers` numbers in total.
    pub fn with_capacity(numbers: usize, products: usize) -> Self {
        let places = Vec::with_capacity(products);
        Self { rows: Aligned::zeros(numbers), runs: Vec::with_capacity(products), places, ..Self::default() }
    }

    /// Resets the sum to zero, with `size` columns. Rows are `stride` numbers apart.
    pub fn clear(&mut self, size: usize, stride: usize) {
        (self.size, self.stride, self.count) = (size, stride, 0);
        self.runs.clear();
    }

    /// Returns the number of rows.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Adds `count` rows, which the caller must write, and returns the index of the first.
    #[inline(always)]
    pub fn add_rows(&mut self, count: usize) -> usize {
        let first = self.count;
        self.count += count;
        if self.rows.len() < self.count * self.stride {
            self.rows.resize(self.count * self.stride);
        }
        first
    }

    /// Adds the row a x and returns its numbers. The numbers after x have arbitrary values.
    #[inline(always)]
    pub fn push<V: Vector>(&mut self, x: &[f64], a: f64) -> &mut [f64] {
        let at = self.add_rows(1) * self.stride;
        let row = &mut self.rows[at..at + self.stride];
        copy_scaled::<V>(row, x, a);
        row
    }

    /// Adds the product of left row `rows[0]` and right row `rows[1]` to the sum; `masks` are the masks of these rows.
    #[inline(always)]
    pub fn multiply(&mut self, rows: [usize; 2], masks: [u64; 2]) {
        match self.runs.last_mut() {
            Some(Run { rows: [left, right], count, masks: own })
                if *own == masks && [*left + *count, *right + *count] == rows =>
            {
                *count += 1;
            }
            _ => self.runs.push(Run { rows, count: 1, masks }),
        }
    }

    /// Adds d₂ x xᵀ to the sum and d₁ x to the gradient, for a row x with the given mask and [d, dd] = [d₁, d₂].
    #[inline(always)]
    pub fn square<V: Vector>(&mut self, x: &[f64], mask: u64, [d, dd]: [f64; 2]) {
        let (k, size) = (self.count, self.size);
        let (gradient, x) = (1 << (size / block(x.len())), &x[..size]);
        if dd > 0.0 {
            let root = condyle_spatial::Scalar::sqrt(dd);
            self.push::<V>(x, root)[size] = d / root;
            self.multiply([k, k], [mask | gradient, mask]);
        } else if d != 0.0 || dd != 0.0 {
            self.push::<V>(x, dd)[size] = d;
            self.push::<V>(x, 1.0);
            self.multiply([k, k + 1], [mask | gradient, mask]);
        }
    }

    /// Adds the lower triangle of the sum to the matrix H, and the gradient to the row below. Some entries above the
    /// diagonal change as well. H has padding rows.
    pub fn add_to(&mut self, h: &mut [f64], ldh: usize) {
        let Self { rows, stride, size, runs, places, .. } = self;
        places.clear();
        for &Run { rows, count, masks } in &*runs {
            places.push(Place { at: rows.map(|row| row * *stride), length: count * *stride, masks });
        }
        add_products(h, ldh, Sum { rows, stride: *stride, size: *size, places });
    }
}

/// Sum of outer products, as stored in [`OuterProducts`].
#[derive(Clone, Copy)]
struct Sum<'a> {
    rows: &'a [f64],
    stride: usize,
    size: usize,
    places: &'a [Place],
}

compiled! {
    /// Implements [`OuterProducts::add_to`].
    fn add_products<V, COLUMNS>(h: &mut [f64], ldh: usize, sum: Sum<'_>) {
        let Sum { rows, stride, size, places } = sum;
        assert!(size + SLACK <= stride, "rows without padding");
        for Place { at: [left, right], length, .. } in places {
            let inside = [left, right].iter().all(|at| **at <= rows.len() && *length <= rows.len() - **at);
            assert!(inside, "a product of rows that do not exist");
        }
        let (wide, mut j) = (block(stride).trailing_zeros(), 0);
        while j < size {
            let (columns, mut i) = (bits(wide, j, COLUMNS.min(size - j)), j);
            while i <= size {
                let strip = next_strip::<V>(size + 1 - i);
                let masks = [bits(wide, i, strip * V::N), columns];
                // SAFETY: the positions refer to existing rows of `stride` numbers. The strip ends at most `SLACK`
                // numbers after the sum's size.
                unsafe {
                    match strip {
                        1 => add_strip::<V, 1, COLUMNS>(h, ldh, sum, masks, [i, j]),
                        2 => add_strip::<V, 2, COLUMNS>(h, ldh, sum, masks, [i, j]),
                        _ => add_strip::<V, 3, COLUMNS>(h, ldh, sum, masks, [i, j]),
                    }
                }
                i += strip * V::N;
            }
            j += COLUMNS;
        }
    }
}

/// Returns the mask bits for `length` numbers from index `from` on. Each bit of a [`mask`] covers 2ʷⁱᵈᵉ numbers.
#[inline(always)]
fn bits(wide: u32, from: usize, length: usize) -> u64 {
    let (first, last) = (from >> wide, (from + length - 1) >> wide);
    (2_u64 << (last - first)).wrapping_sub(1) << first
}

/// Adds one tile of the sum to the matrix H, from entry (i, j) on; the tile has S registers of rows. Runs without
/// nonzero blocks in this tile are skipped.
///
/// # Safety
/// Each left row has S registers of numbers from i on, and each right row COLUMNS numbers from j on.
#[inline(always)]
unsafe fn add_strip<V: Vector, const S: usize, const COLUMNS: usize>(
    h: &mut [f64],
    ldh: usize,
    sum: Sum<'_>,
    masks: [u64; 2],
    [i, j]: [usize; 2],
) {
    let mut tile = [[V::splat(0.0); S]; COLUMNS];
    for run in sum.places {
        if run.masks[0] & masks[0] == 0 || run.masks[1] & masks[1] == 0 {
            continue;
        }
        let [left, right] = run.at;
        debug_assert!((left + i + S * V::N).max(right + j + COLUMNS) + run.length <= sum.rows.len() + sum.stride);
        // SAFETY: the caller guarantees this for the first row; the other rows are `stride` apart.
        let from = |at: usize, count| unsafe { core::slice::from_raw_parts(sum.rows.as_ptr().add(at), count) };
        let mut row = 0;
        while row < run.length {
            add_outer(&mut tile, from(left + i + row, S * V::N), from(right + j + row, COLUMNS));
            row += sum.stride;
        }
    }
    store_tile(h, ldh, [i, j], COLUMNS.min(sum.size - j), &tile, Store::Add);
}
