//! Elimination of the first columns of a small matrix H plus a sum of outer products x xᵀ. These products are added to
//! each tile when the tile is computed.
#![allow(unsafe_code, non_snake_case)] // H, X

use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::{View, add_outer, has_strip, holds};

/// Number of columns of a tile.
const COLUMNS: usize = 4;

compiled! {
    /// Eliminates columns as [`eliminate`](crate::eliminate) does, for the matrix H + Σ xₖ xₖᵀ, where xₖ are the
    /// columns of X.
    ///
    /// `shape` = [rows of H, columns of H, m], where m is the number of columns to eliminate. `length` = [rows of X,
    /// columns of X]. X has at most as many rows as H. Each column of X is followed by zeros, at least up to the length
    /// of a column of H plus four registers. H has padding rows.
    ///
    /// # Errors
    /// Returns the first column whose pivot is not positive or not finite, and the pivot.
    pub fn eliminate_sum<V, WIDE>(
        h: &mut [f64],
        stride: usize,
        shape: [usize; 3],
        x: View<'_>,
        length: [usize; 2],
    ) -> Result<(), (usize, f64)> {
        let ([rows, size, m], [reach, count]) = (shape, length);
        if size == 0 {
            return Ok(());
        }
        let padding = rows + V::N.max(COLUMNS) - 1;
        assert!(m <= size && size <= rows && reach <= rows, "a triangle with more columns than rows");
        assert!(holds(h, stride, [padding, size]), "a matrix ends before the last of its entries");
        assert!(count == 0 || holds(x.data, x.stride, [rows + 4 * V::N, count]), "a row without padding");
        let sum = Sum { x, count, reach };
        for j in 0..m {
            let mut i = j;
            let mut factor = 0.0;
            while i < rows {
                // SAFETY: the assertions above check that H and X have the required padding.
                unsafe {
                    match (rows - i).div_ceil(V::N) {
                        1 => eliminate_strip::<V, 1>(h, stride, [i, j], sum, &mut factor)?,
                        2 => eliminate_strip::<V, 2>(h, stride, [i, j], sum, &mut factor)?,
                        3 => eliminate_strip::<V, 3>(h, stride, [i, j], sum, &mut factor)?,
                        _ => eliminate_strip::<V, 4>(h, stride, [i, j], sum, &mut factor)?,
                    }
                }
                i += 4 * V::N;
            }
        }
        let mut j = m;
        while j < size {
            // SAFETY: the assertions above check that H and X have the required padding.
            unsafe { add_tiles::<V>(h, stride, [rows, j], COLUMNS.min(size - j), sum, m) };
            j += COLUMNS;
        }
        Ok(())
    }
}

/// Sum Σ x xᵀ over the columns x of X, which is added to H.
#[derive(Clone, Copy)]
struct Sum<'a> {
    x: View<'a>,
    count: usize,
    reach: usize,
}

/// Computes H ← H + Σ x xᵀ − Σ h hᵀ, where x are the columns of the sum and h are the first m columns of H. Changes
/// only the rows j..`rows` of `columns` columns from column j on.
///
/// # Safety
/// H has padding rows after `rows`, and X has four registers of padding.
#[inline(always)]
unsafe fn add_tiles<V: Vector>(
    h: &mut [f64],
    stride: usize,
    [rows, j]: [usize; 2],
    columns: usize,
    sum: Sum<'_>,
    m: usize,
) {
    let mut i = j;
    while i < rows {
        // SAFETY: guaranteed by the caller.
        unsafe {
            match rows - i <= V::N {
                true => add_tile::<V, 1>(h, stride, [i, j], columns, sum, m),
                false => add_tile::<V, 2>(h, stride, [i, j], columns, sum, m),
            }
        }
        i += 2 * V::N;
    }
}

/// Computes one tile of [`add_tiles`]: S registers of rows from row i on.
///
/// # Safety
/// The conditions of [`add_tiles`] hold.
#[inline(always)]
unsafe fn add_tile<V: Vector, const S: usize>(
    h: &mut [f64],
    stride: usize,
    [i, j]: [usize; 2],
    columns: usize,
    sum: Sum<'_>,
    m: usize,
) {
    debug_assert!(has_strip::<V, S>(h, stride, j * stride + i, columns));
    // SAFETY: guaranteed by the caller.
    let rows = |x: &[f64], at: usize, count: usize| unsafe { core::slice::from_raw_parts(x.as_ptr().add(at), count) };
    let mut tile = [[V::splat(0.0); S]; COLUMNS];
    if i < sum.reach {
        let mut at = 0;
        for _ in 0..sum.count {
            add_outer(&mut tile, rows(sum.x.data, at + i, S * V::N), rows(sum.x.data, at + j, COLUMNS));
            at += sum.x.stride;
        }
    }
    for jj in 0..COLUMNS {
        if jj < columns {
            let column = rows(h, (j + jj) * stride + i, S * V::N);
            for s in 0..S {
                tile[jj][s] = V::load(&column[s * V::N..]).add(tile[jj][s]);
            }
        }
    }
    let mut at = 0;
    for _ in 0..m {
        subtract_outer(&mut tile, rows(h, at + i, S * V::N), rows(h, at + j, COLUMNS));
        at += stride;
    }
    for jj in 0..COLUMNS {
        if jj < columns {
            let at = (j + jj) * stride + i;
            // SAFETY: guaranteed by the caller.
            let column = unsafe { h.get_unchecked_mut(at..at + S * V::N) };
            for s in 0..S {
                tile[jj][s].store(&mut column[s * V::N..]);
            }
        }
    }
}

/// Computes tile −= strip · rowᵀ, with S registers of rows.
#[inline(always)]
fn subtract_outer<V: Vector, const S: usize>(tile: &mut [[V; S]; COLUMNS], strip: &[f64], row: &[f64]) {
    for jj in 0..COLUMNS {
        let x = V::splat(-row[jj]);
        for s in 0..S {
            tile[jj][s] = V::load(&strip[s * V::N..]).mul_add(x, tile[jj][s]);
        }
    }
}

/// Computes column j of the eliminated matrix, on S registers of rows from row i on. The result follows from column j
/// of H + Σ x xᵀ and from the columns before column j. The first call for a column starts on the diagonal and sets
/// `factor`, the inverse of the diagonal entry.
///
/// # Errors
/// Returns the column and its pivot if the pivot is not positive or not finite.
///
/// # Safety
/// The columns 0 to j of H have S registers of numbers from row i on. If i < `sum.reach`, the columns of X also have S
/// registers of numbers from row i on.
#[inline(always)]
unsafe fn eliminate_strip<V: Vector, const S: usize>(
    h: &mut [f64],
    stride: usize,
    [i, j]: [usize; 2],
    sum: Sum<'_>,
    factor: &mut f64,
) -> Result<(), (usize, f64)> {
    debug_assert!(has_strip::<V, S>(h, stride, j * stride + i, 1));
    // SAFETY: guaranteed by the caller.
    let rows = |x: &[f64], at: usize, count: usize| unsafe { core::slice::from_raw_parts(x.as_ptr().add(at), count) };
    let mut sums = [V::splat(0.0); S];
    if i < sum.reach {
        let mut at = 0;
        for _ in 0..sum.count {
            let (x, column) = (V::splat(rows(sum.x.data, at + j, 1)[0]), rows(sum.x.data, at + i, S * V::N));
            for s in 0..S {
                sums[s] = V::load(&column[s * V::N..]).mul_add(x, sums[s]);
            }
            at += sum.x.stride;
        }
    }
    let column = rows(h, j * stride + i, S * V::N);
    for s in 0..S {
        sums[s] = V::load(&column[s * V::N..]).add(sums[s]);
    }
    let mut at = 0;
    for _ in 0..j {
        let (x, column) = (V::splat(-rows(h, at + j, 1)[0]), rows(h, at + i, S * V::N));
        for s in 0..S {
            sums[s] = V::load(&column[s * V::N..]).mul_add(x, sums[s]);
        }
        at += stride;
    }
    let at = at + i;
    // SAFETY: guaranteed by the caller; the slice of column j begins after the first j columns.
    let column = unsafe { h.get_unchecked_mut(at..at + S * V::N) };
    if i == j {
        sums[0].store(column);
        let pivot = column[0];
        if !(pivot > 0.0 && pivot.is_finite()) {
            return Err((j, pivot));
        }
        *factor = condyle_spatial::Scalar::sqrt(pivot).recip();
    }
    for s in 0..S {
        sums[s].mul(V::splat(*factor)).store(&mut column[s * V::N..]);
    }
    Ok(())
}
