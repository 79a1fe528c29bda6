//! Factorizes a diagonal block of a Cholesky factor, and solves for the rows below the block. Columns stay in registers
//! until they are finished.
#![allow(unsafe_code)]

use crate::registers::Vector;
use crate::tile::{View, has_strip, next_strip, tile_rows};

/// Diagonal block of L: its first `width` ≤ COLUMNS columns, and the inverses of its diagonal entries.
pub(crate) struct DiagonalBlock<const COLUMNS: usize> {
    pub(crate) L: [[f64; COLUMNS]; COLUMNS],
    pub(crate) inverse: [f64; COLUMNS],
    width: usize,
}

impl<const COLUMNS: usize> DiagonalBlock<COLUMNS> {
    /// Creates a block of `width` columns, which are written later.
    #[inline(always)]
    pub(crate) fn new(width: usize) -> Self {
        Self { L: [[0.0; COLUMNS]; COLUMNS], inverse: [0.0; COLUMNS], width }
    }

    /// Copies the first `width` columns of the leading diagonal block of L.
    #[inline(always)]
    pub(crate) fn of(L: View<'_>, width: usize) -> Self {
        let mut block = Self::new(width);
        for j in 0..width {
            let column = &L.data[j * L.stride..][..width];
            block.L[j][j..width].copy_from_slice(&column[j..]);
            block.inverse[j] = column[j].recip();
        }
        block
    }

    /// Factorizes the diagonal block of a matrix H that begins in row j0. `columns` are the columns of H from this
    /// block on. First subtracts the product a bᵀ, where a and b are rows of the j0 columns before the block. A column
    /// of the block has COLUMNS rows, which fit in S registers. The entries above the diagonal are overwritten.
    ///
    /// # Errors
    /// Returns the first column whose pivot is not positive or not finite, and the pivot.
    #[inline(always)]
    pub(crate) fn factor<V: Vector, const S: usize>(
        &mut self,
        columns: &mut [f64],
        j0: usize,
        a: View<'_>,
        b: View<'_>,
    ) -> Result<(), (usize, f64)> {
        let mut c = difference::<V, S, COLUMNS>(columns, a.stride, j0, self.width, a, b, j0);
        for j in 0..COLUMNS {
            if j < self.width {
                let mut numbers = [0.0; COLUMNS];
                for s in 0..S {
                    c[j][s].store(&mut numbers[s * V::N..]);
                }
                let pivot = numbers[j];
                if !(pivot > 0.0 && pivot.is_finite()) {
                    return Err((j, pivot));
                }
                self.inverse[j] = condyle_spatial::Scalar::sqrt(pivot).recip();
                for s in 0..S {
                    c[j][s] = c[j][s].mul(V::splat(self.inverse[j]));
                    c[j][s].store(&mut self.L[j][s * V::N..]);
                }
                for k in j + 1..COLUMNS {
                    let factor = V::splat(-self.L[j][k]);
                    for s in 0..S {
                        c[k][s] = c[j][s].mul_add(factor, c[k][s]);
                    }
                }
                store(&c[j], columns, j * a.stride + j0);
            }
        }
        Ok(())
    }

    /// Computes C ← (C − a bᵀ) L⁻ᵀ on the given rows of C, where L is this block. The product a bᵀ is a sum over
    /// `length` columns.
    #[inline(always)]
    pub(crate) fn solve_rows<V: Vector>(
        &self,
        c: &mut [f64],
        ldc: usize,
        rows: core::ops::Range<usize>,
        a: View<'_>,
        b: View<'_>,
        length: usize,
    ) {
        let mut i = rows.start;
        while i < rows.end {
            let strip = next_strip::<V>(rows.end - i);
            match strip {
                1 => self.solve_strip::<V, 1>(c, ldc, i, a, b, length),
                2 => self.solve_strip::<V, 2>(c, ldc, i, a, b, length),
                _ => self.solve_strip::<V, 3>(c, ldc, i, a, b, length),
            }
            i += strip * V::N;
        }
    }

    /// Computes C ← (C − a bᵀ) L⁻ᵀ on S registers of rows of C, from row i on, where L is this block.
    #[inline(always)]
    fn solve_strip<V: Vector, const S: usize>(
        &self,
        c: &mut [f64],
        ldc: usize,
        i: usize,
        a: View<'_>,
        b: View<'_>,
        length: usize,
    ) {
        let mut x = difference::<V, S, COLUMNS>(c, ldc, i, self.width, a, b, length);
        for j in 0..COLUMNS {
            if j < self.width {
                for p in 0..j {
                    let factor = V::splat(-self.L[p][j]);
                    for s in 0..S {
                        x[j][s] = x[p][s].mul_add(factor, x[j][s]);
                    }
                }
                for s in 0..S {
                    x[j][s] = x[j][s].mul(V::splat(self.inverse[j]));
                }
                let at = j * ldc + i;
                // SAFETY: the slice is column j of the strip, which `difference` found to be in bounds.
                store(&x[j], unsafe { c.get_unchecked_mut(at..at + S * V::N) }, 0);
            }
        }
    }
}

/// Returns C − a bᵀ on the first `width` columns of C, for S registers of rows from row i on. The product a bᵀ is a sum
/// over `length` columns.
#[inline(always)]
fn difference<V: Vector, const S: usize, const COLUMNS: usize>(
    c: &[f64],
    ldc: usize,
    i: usize,
    width: usize,
    a: View<'_>,
    b: View<'_>,
    length: usize,
) -> [[V; S]; COLUMNS] {
    let mut tile = tile_rows::<V, S, COLUMNS>(a, i, b, 0, length);
    assert!(has_strip::<V, S>(c, ldc, i, width), "a matrix ends before its tile");
    for j in 0..COLUMNS {
        if j < width {
            let at = j * ldc + i;
            // SAFETY: the slice is column j of the strip, which the assertion found to be in bounds.
            let column = unsafe { c.get_unchecked(at..at + S * V::N) };
            for s in 0..S {
                tile[j][s] = V::load(&column[s * V::N..]).sub(tile[j][s]);
            }
        }
    }
    tile
}

/// Writes S registers to `to`, from index `at` on.
#[inline(always)]
fn store<V: Vector, const S: usize>(x: &[V; S], to: &mut [f64], at: usize) {
    let to = &mut to[at..][..S * V::N];
    for s in 0..S {
        x[s].store(&mut to[s * V::N..]);
    }
}
