//! Cholesky factor of the leading part of a symmetric matrix, and solutions of systems with this factor.
#![allow(non_snake_case)] // L, X, B

use crate::compiled::compiled;
use crate::diagonal_block::DiagonalBlock;
use crate::registers::Vector;
use crate::tile::{SLACK, Store, View, column_block};

compiled! {
    /// Eliminates the first m columns of a symmetric H, whose lower triangle is given. `shape` = [rows, columns, m].
    /// The rows below the square part of H are right-hand sides.
    ///
    /// H = [Hᵤᵤ ·; Hₓᵤ Hₓₓ] becomes [L ·; X Hₓₓ − X Xᵀ] with L Lᵀ = Hᵤᵤ and X = Hₓᵤ L⁻ᵀ. The block Hᵤᵤ has m rows and m
    /// columns. A dot stands for entries that are not used. H has padding rows.
    ///
    /// # Errors
    /// Returns the first column whose pivot is not positive or not finite, and the pivot.
    pub fn eliminate<V, COLUMNS>(h: &mut [f64], stride: usize, shape: [usize; 3]) -> Result<(), (usize, f64)> {
        let ([rows, size, m], mut j0) = (shape, 0);
        while j0 < m {
            let width = COLUMNS.min(m - j0);
            let (done, columns) = h.split_at_mut(j0 * stride);
            let (a, b) = (View { data: done, stride }, View { data: done, stride }.at(j0, 0));
            let mut block = DiagonalBlock::<COLUMNS>::new(width);
            let factor = match V::N < COLUMNS {
                true => block.factor::<V, 2>(columns, j0, a, b),
                false => block.factor::<V, 1>(columns, j0, a, b),
            };
            if let Err((j, pivot)) = factor {
                return Err((j0 + j, pivot));
            }
            block.solve_rows::<V>(columns, stride, j0 + COLUMNS..rows, a, b, j0);
            j0 += COLUMNS;
        }
        let mut j = m;
        while j < size {
            subtract_outer::<V, COLUMNS>(h, stride, rows, j, COLUMNS.min(size - j), m);
            j += COLUMNS;
        }
        Ok(())
    }

    /// Eliminates as [`eliminate`] does, for rows G = [Gᵤ Gₓ] that are not stored below H. The first m columns of H
    /// were eliminated before: `h` is [L; X], from column 0 on. Gᵤ has m columns. G becomes [Y Gₓ − Y Xᵀ] with Y = Gᵤ
    /// L⁻ᵀ. `shape` = [rows of G, columns, m]. G and H have padding rows.
    pub fn eliminate_rows<V, COLUMNS>(g: &mut [f64], stride: usize, shape: [usize; 3], h: View<'_>) {
        let ([rows, size, m], mut j0) = (shape, 0);
        while j0 < m {
            let (done, columns) = g.split_at_mut(j0 * stride);
            let block = DiagonalBlock::<COLUMNS>::of(h.at(j0, j0), COLUMNS.min(m - j0));
            block.solve_rows::<V>(columns, stride, 0..rows, View { data: done, stride }, h.at(j0, 0), j0);
            j0 += COLUMNS;
        }
        let mut j = m;
        while j < size {
            let (done, columns) = g.split_at_mut(j * stride);
            let (width, done) = (COLUMNS.min(size - j), View { data: done, stride });
            column_block::<V, COLUMNS>(columns, stride, 0..rows, 0, width, done, h.at(j, 0), m, Store::Subtract);
            j += COLUMNS;
        }
    }

    /// Computes x ← L⁻¹ x. H was eliminated before and contains L; the inverse of the diagonal of L is given. x has
    /// padding.
    pub fn forward_solve<V, COLUMNS>(h: View<'_>, inverse_diagonal: &[f64], x: &mut [f64]) {
        let (m, mut j) = (inverse_diagonal.len(), 0);
        while j < m {
            let (width, block) = (V::N.min(m - j), h.at(j, j));
            let mut y = [0.0; SLACK];
            for k in 0..width {
                y[k] += x[j + k];
                y[k] *= inverse_diagonal[j + k];
                let column = &block.data[k * h.stride..][..width];
                for i in k + 1..width {
                    y[i] -= column[i] * y[k];
                }
                x[j + k] = y[k];
            }
            let mut i = j + V::N;
            while i < m {
                let mut sum = V::load(&x[i..]);
                for k in 0..V::N {
                    sum = V::load(&h.data[(j + k) * h.stride + i..]).mul_add(V::splat(-y[k]), sum);
                }
                sum.store(&mut x[i..]);
                i += V::N;
            }
            j += V::N;
        }
    }

    /// Computes x ← L⁻ᵀ x, with the same arguments as [`forward_solve`]. The padding of x becomes zero.
    pub fn backward_solve<V, COLUMNS>(h: View<'_>, inverse_diagonal: &[f64], x: &mut [f64]) {
        let m = inverse_diagonal.len();
        x[m..m + V::N].fill(0.0);
        let mut block = m.div_ceil(V::N);
        while block > 0 {
            block -= 1;
            let j = block * V::N;
            let width = V::N.min(m - j);
            // Computes the sums over the rows below the block, for all columns of the block together.
            let mut products = [0.0; SLACK];
            if j + V::N < m {
                let (mut sums, mut i) = ([V::splat(0.0); SLACK], j + V::N);
                while i < m {
                    let x = V::load(&x[i..]);
                    for k in 0..V::N {
                        sums[k] = V::load(&h.data[(j + k) * h.stride + i..]).mul_add(x, sums[k]);
                    }
                    i += V::N;
                }
                V::transpose(&mut sums[..V::N]);
                let mut sum = sums[0];
                for k in 1..V::N {
                    sum = sum.add(sums[k]);
                }
                sum.store(&mut products);
            }
            for k in (0..width).rev() {
                let y = (x[j + k] - products[k]) * inverse_diagonal[j + k];
                for i in 0..k {
                    products[i] += h.data[(j + i) * h.stride + j + k] * y;
                }
                x[j + k] = y;
            }
        }
    }

    /// Computes X ← X L⁻¹. X is in the rows `first`..`rows` of the first m columns of H. L is in the lower triangle
    /// above X. `shape` = [first, rows, m]. H has padding rows.
    ///
    /// `upper` (m + [`SLACK`] rows, m columns) is scratch memory for Lᵀ.
    pub fn solve_right<V, COLUMNS>(h: &mut [f64], stride: usize, shape: [usize; 3], upper: &mut [f64]) {
        let [first, rows, m] = shape;
        let ldu = m + SLACK;
        for j in 0..m {
            for i in j..m {
                upper[i * ldu + j] = h[j * stride + i];
            }
        }
        // Solves for X from the last column to the first: X[:, j] ← (X[:, j] − Σ_{p > j} X[:, p] L[p, j]) / L[j, j].
        let mut block = m.div_ceil(COLUMNS);
        while block > 0 {
            block -= 1;
            let (j0, end) = (block * COLUMNS, m.min(block * COLUMNS + COLUMNS));
            if end < m {
                let (columns, later) = h.split_at_mut(end * stride);
                let (columns, width) = (&mut columns[j0 * stride..], end - j0);
                let a = View { data: later, stride };
                let b = View { data: &upper[end * ldu + j0..], stride: ldu };
                column_block::<V, COLUMNS>(columns, stride, first..rows, 0, width, a, b, m - end, Store::Subtract);
            }
            for j in (j0..end).rev() {
                let (left, right) = h.split_at_mut((j + 1) * stride);
                let column = &mut left[j * stride + first..];
                let (right, Lt) = (View { data: right, stride }, View { data: &upper[(j + 1) * ldu..], stride: ldu });
                subtract_multiples::<V>(column, rows - first, 0..end - j - 1, right, first, Lt, j);
                scale::<V>(column, rows - first, upper[j * ldu + j].recip());
            }
        }
    }
}

/// Computes H[i, j] −= Σ_{p < length} H[i, p] H[j, p] for i ≥ j, on `width` ≤ COLUMNS columns from column j on, with j
/// ≥ `length`.
#[inline(always)]
fn subtract_outer<V: Vector, const COLUMNS: usize>(
    h: &mut [f64],
    stride: usize,
    rows: usize,
    j: usize,
    width: usize,
    length: usize,
) {
    if length == 0 {
        return;
    }
    let (done, columns) = h.split_at_mut(j * stride);
    let factor = View { data: done, stride };
    let b = View { data: &done[j..], stride };
    column_block::<V, COLUMNS>(columns, stride, j..rows, 0, width, factor, b, length, Store::Subtract);
}

/// Computes y −= Σ X[i.., p] B[j, p] over the columns p, on `rows` rows, in whole registers. The rows must be followed
/// by padding.
#[inline(always)]
fn subtract_multiples<V: Vector>(
    y: &mut [f64],
    rows: usize,
    columns: core::ops::Range<usize>,
    X: View<'_>,
    i: usize,
    B: View<'_>,
    j: usize,
) {
    let mut k = 0;
    while k < rows {
        let mut sum = V::load(&y[k..]);
        for p in columns.start..columns.end {
            let factor = V::splat(-B.data[p * B.stride + j]);
            sum = V::load(&X.data[p * X.stride + i + k..]).mul_add(factor, sum);
        }
        sum.store(&mut y[k..]);
        k += V::N;
    }
}

/// Computes y ← factor · y on `rows` rows, in whole registers.
#[inline(always)]
fn scale<V: Vector>(y: &mut [f64], rows: usize, factor: f64) {
    let (factor, mut k) = (V::splat(factor), 0);
    while k < rows {
        V::load(&y[k..]).mul(factor).store(&mut y[k..]);
        k += V::N;
    }
}
