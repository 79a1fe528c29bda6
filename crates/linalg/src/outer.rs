//! Sums of outer products of rows that have blocks of zeros.

use crate::compiled::compiled;
use crate::registers::Vector;
use crate::vectors::copy_scaled;

/// Rows of numbers, one after the other, and for each row which of its blocks are not zero (see [`mask`]).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SparseRows {
    /// The numbers, with zeros up to the stride.
    pub numbers: Vec<f64>,
    /// The mask of each row.
    pub masks: Vec<u64>,
}

impl SparseRows {
    /// Makes it so many rows; allocates only where there were never so many.
    pub fn resize(&mut self, rows: usize, stride: usize) {
        self.numbers.resize(rows * stride, 0.0);
        self.masks.resize(rows, 0);
    }

    /// Notes which blocks are not zero.
    #[inline(always)]
    pub fn mark(&mut self, stride: usize) {
        for (to, row) in self.masks.iter_mut().zip(self.numbers.chunks_exact(stride)) {
            *to = mask(row);
        }
    }
}

/// The blocks of a row that are not zero: bit k stands for the columns from k times [`block`] on.
#[inline(always)]
pub fn mask(row: &[f64]) -> u64 {
    let (wide, mut mask) = (block(row.len()) / 8, 0);
    let (eights, rest) = row.as_chunks::<8>();
    for (k, x) in eights.iter().enumerate() {
        let mut bits = 0;
        for i in 0..8 {
            bits |= x[i].to_bits() << 1; // all but the sign
        }
        mask |= u64::from(bits != 0) << (k / wide);
    }
    let rest = rest.iter().any(|x| *x != 0.0);
    mask | u64::from(rest) << (eights.len() / wide)
}

/// The number of columns that one bit of a [`mask`] stands for, in rows of `stride` numbers.
#[inline(always)]
pub fn block(stride: usize) -> usize {
    8 * stride.div_ceil(8 * 64)
}

/// Outer products of some rows with as many others, with the same blocks of zeros.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// The first row on the left and on the right.
    rows: [usize; 2],
    /// The masks of both.
    masks: [u64; 2],
    /// The number of products.
    count: usize,
}

/// A sum Σ left rightᵀ of outer products, without the blocks that are zero. Each row has a number more than the sum has
/// columns: on the left it is the row's part of a gradient, which is a last row of the sum.
#[derive(Debug, Clone, Default)]
pub struct OuterProducts {
    /// The numbers of all rows.
    pub rows: Vec<f64>,
    /// The step from one row to the next.
    stride: usize,
    /// The columns of the sum.
    size: usize,
    /// The number of rows.
    count: usize,
    parts: Vec<Part>,
}

impl OuterProducts {
    /// Room for `numbers` numbers of all rows together, and for `products` products.
    pub fn with_capacity(numbers: usize, products: usize) -> Self {
        Self { rows: vec![0.0; numbers], parts: Vec::with_capacity(products), ..Self::default() }
    }

    /// An empty sum with `size` columns, of rows that are `stride` apart.
    pub fn clear(&mut self, size: usize, stride: usize) {
        (self.size, self.stride, self.count) = (size, stride, 0);
        self.parts.clear();
    }

    /// The number of rows.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Makes room for `count` more rows, whose numbers are to be written; returns the number of the first.
    #[inline(always)]
    pub fn add_rows(&mut self, count: usize) -> usize {
        let first = self.count;
        self.count += count;
        if self.rows.len() < self.count * self.stride {
            self.rows.resize(self.count * self.stride, 0.0);
        }
        first
    }

    /// Adds a row, a x; returns its numbers.
    #[inline(always)]
    pub fn push<V: Vector>(&mut self, x: &[f64], a: f64) -> &mut [f64] {
        let at = self.add_rows(1) * self.stride;
        let row = &mut self.rows[at..at + x.len()];
        copy_scaled::<V>(row, x, a);
        row
    }

    /// Adds the product of the row `rows[0]` on the left with `rows[1]` on the right, with such masks, to the sum.
    #[inline(always)]
    pub fn multiply(&mut self, rows: [usize; 2], masks: [u64; 2]) {
        match self.parts.last_mut() {
            Some(last) if last.masks == masks && last.rows.map(|row| row + last.count) == rows => last.count += 1,
            _ => self.parts.push(Part { rows, masks, count: 1 }),
        }
    }

    /// Adds d₂ x xᵀ to the sum and d₁ x to the gradient, for a row x with such a mask.
    #[inline(always)]
    pub fn square<V: Vector>(&mut self, x: &[f64], mask: u64, [d, dd]: [f64; 2]) {
        let (k, size) = (self.count, self.size);
        let gradient = 1 << (size / block(x.len()));
        if dd > 0.0 {
            let root = dd.sqrt();
            self.push::<V>(x, root)[size] = d / root;
            self.multiply([k, k], [mask | gradient, mask]);
        } else if d != 0.0 || dd != 0.0 {
            self.push::<V>(x, dd)[size] = d;
            self.push::<V>(x, 1.0);
            self.multiply([k, k + 1], [mask | gradient, mask]);
        }
    }

    /// Adds the lower triangle of the sum, and the gradient below it, to H (with some of what is above the diagonal). H has
    /// slack rows.
    pub fn add_to(&self, h: &mut [f64], ldh: usize) {
        add_parts(h, ldh, self);
    }
}

compiled! {
    /// See [`OuterProducts::add_to`].
    fn add_parts<V, COLUMNS>(h: &mut [f64], ldh: usize, sum: &OuterProducts) {
        let OuterProducts { ref rows, stride, size, ref parts, .. } = *sum;
        let wide = block(stride);
        let bits = |from: usize, length: usize| {
            let (first, last) = (from / wide, (from + length - 1) / wide);
            (2_u64 << (last - first)).wrapping_sub(1) << first
        };
        let mut j = 0;
        while j < size {
            let columns = bits(j, COLUMNS.min(size - j));
            let mut i = j;
            while i <= size {
                let strip = if size - i >= V::N { 2 } else { 1 };
                let upper = bits(i, V::N);
                let lower = if strip == 2 { bits(i + V::N, V::N) } else { 0 };
                let mut tile = [[V::splat(0.0); 2]; COLUMNS];
                for part in parts {
                    if part.masks[1] & columns == 0 {
                        continue;
                    }
                    match [part.masks[0] & upper != 0, part.masks[0] & lower != 0] {
                        [true, true] => add_part::<V, 0, 2, COLUMNS>(&mut tile, rows, stride, part, [i, j]),
                        [true, false] => add_part::<V, 0, 1, COLUMNS>(&mut tile, rows, stride, part, [i, j]),
                        [false, true] => add_part::<V, 1, 2, COLUMNS>(&mut tile, rows, stride, part, [i, j]),
                        [false, false] => (),
                    }
                }
                for jj in 0..COLUMNS {
                    if jj < size - j {
                        let column = &mut h[(j + jj) * ldh + i..][..strip * V::N];
                        for s in 0..2 {
                            if s < strip {
                                let place = &mut column[s * V::N..];
                                V::load(place).add(tile[jj][s]).store(place);
                            }
                        }
                    }
                }
                i += strip * V::N;
            }
            j += COLUMNS;
        }
    }
}

/// The registers FROM..TO of rows of a tile at (i, j) += those of a part.
#[inline(always)]
fn add_part<V: Vector, const FROM: usize, const TO: usize, const COLUMNS: usize>(
    tile: &mut [[V; 2]; COLUMNS],
    rows: &[f64],
    stride: usize,
    part: &Part,
    [i, j]: [usize; 2],
) {
    for p in 0..part.count {
        let [left, right] = part.rows;
        let (left, right) =
            (&rows[(left + p) * stride + i..][..TO * V::N], &rows[(right + p) * stride + j..][..COLUMNS]);
        let mut registers = [V::splat(0.0); 2];
        for s in FROM..TO {
            registers[s] = V::load(&left[s * V::N..]);
        }
        for jj in 0..COLUMNS {
            let x = V::splat(right[jj]);
            for s in FROM..TO {
                tile[jj][s] = registers[s].mul_add(x, tile[jj][s]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registers::Vectorized;
    use crate::registers::tests::at_each_level;
    use crate::{SLACK, at_level};

    /// Entries of size one, sums of 20 of them: 1e-12 leaves room for rounding and nothing else.
    const TOLERANCE: f64 = 1e-12;

    /// Squares of the first rows, and products of the later ones with each other.
    struct Fill<'a> {
        sum: &'a mut OuterProducts,
        rows: &'a SparseRows,
        stride: usize,
        slopes: &'a [[f64; 2]],
    }

    impl Vectorized for Fill<'_> {
        #[inline(always)]
        fn run<V: Vector>(self) {
            let Self { sum, rows, stride, slopes } = self;
            let row = |k: usize| &rows.numbers[k * stride..][..stride];
            for (k, slopes) in slopes.iter().enumerate() {
                sum.square::<V>(row(k), rows.masks[k], *slopes);
            }
            for k in slopes.len()..rows.masks.len() - 1 {
                let first = sum.count();
                sum.push::<V>(row(k), 2.0);
                sum.push::<V>(row(k + 1), 1.0);
                sum.multiply([first, first + 1], [rows.masks[k], rows.masks[k + 1]]);
            }
        }
    }

    #[test]
    fn sums_of_outer_products_match_plain_loops() {
        at_each_level(|| {
            for size in [1, 4, 7, 8, 20, 33] {
                let (stride, count) = (size + SLACK, 9);
                let mut rows = SparseRows::default();
                rows.resize(count, stride);
                for k in 0..count {
                    for i in (0..size).filter(|i| (i / 8 + k) % 3 != 0) {
                        rows.numbers[k * stride + i] = ((i * 31 + k * 17 + 5) % 23) as f64 / 23.0 - 0.4;
                    }
                }
                rows.mark(stride);
                let slopes = [[0.5, 2.0], [-1.0, 0.0], [0.3, -0.7], [0.0, 1.0], [0.0, 0.0]];
                let mut sum = OuterProducts::default();
                sum.clear(size, stride);
                at_level(Fill { sum: &mut sum, rows: &rows, stride, slopes: &slopes });
                let ldh = size + 1 + SLACK;
                let mut h = vec![1.0; ldh * size];
                sum.add_to(&mut h, ldh);

                let entry = |k: usize, i: usize| rows.numbers[k * stride + i];
                for j in 0..size {
                    for i in j..=size {
                        let squares = slopes.iter().enumerate().map(|(k, [d, dd])| match i == size {
                            true => d * entry(k, j),
                            false => dd * entry(k, i) * entry(k, j),
                        });
                        let products = (slopes.len()..count - 1).map(|k| 2.0 * entry(k, i) * entry(k + 1, j));
                        let products = if i == size { 0.0 } else { products.sum::<f64>() };
                        let expected = 1.0 + squares.sum::<f64>() + products;
                        assert!((h[j * ldh + i] - expected).abs() < TOLERANCE, "size {size}, entry ({i}, {j})");
                    }
                }
            }
        });
    }
}
