//! The Cholesky factor of part of a symmetric matrix, and what follows from it; kernels as in [`dense`](crate::dense).
#![allow(non_snake_case)] // L, X, B

use crate::dense::{SLACK, Store, View, column_block};
use crate::vector::Vector;

/// Eliminates the first m of the columns of a symmetric H, of which the lower triangle is given and `rows` rows (one
/// or more below the square are right-hand sides): H = [Hᵤᵤ ·; Hₓᵤ Hₓₓ] becomes [L ·; X Hₓₓ − X Xᵀ] with
/// L Lᵀ = Hᵤᵤ and X = Hₓᵤ L⁻ᵀ.
///
/// The first pivot that is not positive ends it: `Err((column, pivot))`.
#[inline(always)]
pub(crate) fn eliminate<V: Vector, const NR: usize>(
    h: &mut [f64],
    stride: usize,
    rows: usize,
    size: usize,
    m: usize,
) -> Result<(), (usize, f64)> {
    let mut j0 = 0;
    while j0 < m {
        let width = NR.min(m - j0);
        subtract_outer::<V, NR>(h, stride, rows, j0, width, j0);
        for j in j0..j0 + width {
            let (done, column) = h.split_at_mut(j * stride);
            let column = &mut column[j..];
            let done = View { data: done, stride };
            subtract_multiples::<V>(column, rows - j, j0..j, done, j, done, j);
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err((j, pivot));
            }
            scale::<V>(column, rows - j, pivot.sqrt().recip());
        }
        j0 += NR;
    }
    let mut j = m;
    while j < size {
        subtract_outer::<V, NR>(h, stride, rows, j, NR.min(size - j), m);
        j += NR;
    }
    Ok(())
}

/// H[i, j] −= Σ_{p < length} H[i, p] H[j, p] for i ≥ j, on `width` ≤ NR columns from j ≥ `length` on.
#[inline(always)]
fn subtract_outer<V: Vector, const NR: usize>(
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
    column_block::<V, NR>(columns, stride, j..rows, 0, width, factor, b, length, Store::Subtract);
}

/// X ← X L⁻ᵀ for the L of an H of which m columns were eliminated; X has m columns and `rows` rows.
#[inline(always)]
pub(crate) fn solve_transposed<V: Vector, const NR: usize>(
    x: &mut [f64],
    ldx: usize,
    rows: usize,
    h: &[f64],
    stride: usize,
    m: usize,
) {
    let mut j0 = 0;
    while j0 < m {
        let width = NR.min(m - j0);
        let (done, columns) = x.split_at_mut(j0 * ldx);
        let (a, b) = (View { data: done, stride: ldx }, View { data: &h[j0..], stride });
        if j0 > 0 {
            column_block::<V, NR>(columns, ldx, 0..rows, 0, width, a, b, j0, Store::Subtract);
        }
        for j in 0..width {
            let (done, column) = columns.split_at_mut(j * ldx);
            let (done, L) = (View { data: done, stride: ldx }, View { data: &h[j0 * stride..], stride });
            subtract_multiples::<V>(column, rows, 0..j, done, 0, L, j0 + j);
            scale::<V>(column, rows, h[(j0 + j) * stride + j0 + j].recip());
        }
        j0 += NR;
    }
}

/// X ← X L⁻¹ on the rows `first`..`rows` of H's first m columns, with L in the lower triangle above them.
///
/// `upper` (m + SLACK rows, m columns) is scratch for Lᵀ.
#[inline(always)]
pub(crate) fn solve_right<V: Vector, const NR: usize>(
    h: &mut [f64],
    stride: usize,
    first: usize,
    rows: usize,
    m: usize,
    upper: &mut [f64],
) {
    let ldu = m + SLACK;
    for j in 0..m {
        for i in j..m {
            upper[i * ldu + j] = h[j * stride + i];
        }
    }
    // From the last columns to the first: X[:, j] ← (X[:, j] − Σ_{p > j} X[:, p] L[p, j]) / L[j, j].
    let mut block = m.div_ceil(NR);
    while block > 0 {
        block -= 1;
        let (j0, end) = (block * NR, m.min(block * NR + NR));
        if end < m {
            let (columns, later) = h.split_at_mut(end * stride);
            let b = View { data: &upper[end * ldu + j0..], stride: ldu };
            let a = View { data: later, stride };
            column_block::<V, NR>(
                &mut columns[j0 * stride..],
                stride,
                first..rows,
                0,
                end - j0,
                a,
                b,
                m - end,
                Store::Subtract,
            );
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

/// y −= Σ X[i.., p] B[j, p] over the columns p on `rows` rows, in whole registers: what follows them is slack.
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

/// y ← factor · y on `rows` rows, in whole registers.
#[inline(always)]
fn scale<V: Vector>(y: &mut [f64], rows: usize, factor: f64) {
    let (factor, mut k) = (V::splat(factor), 0);
    while k < rows {
        V::load(&y[k..]).mul(factor).store(&mut y[k..]);
        k += V::N;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::tests::at_each_level;
    use crate::vector::{Dense, at_level};
    use nalgebra::DMatrix;

    /// Entries of size one, sums of 30 of them: 1e-12 leaves room for rounding and nothing else.
    const TOLERANCE: f64 = 1e-12;

    fn entry(i: usize, j: usize) -> f64 {
        ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4
    }

    /// The factor and the gains of a matrix of which m columns are eliminated and one row is a right-hand side.
    struct Both<'a> {
        before: &'a [f64],
        h: &'a mut [f64],
        gains: &'a mut [f64],
        size: usize,
        m: usize,
        result: &'a mut Result<(), (usize, f64)>,
    }

    impl Dense for Both<'_> {
        #[inline(always)]
        fn run<V: Vector, const NR: usize>(self) {
            let (rows, stride) = (self.size + 1, self.size + 1 + SLACK);
            *self.result = eliminate::<V, NR>(self.h, stride, rows, self.size, self.m);
            self.gains.copy_from_slice(self.h);
            if self.result.is_ok() {
                let (n, m) = (self.size + 1 - self.m, self.m); // X L⁻ᵀ of the rows below is what `eliminate` leaves
                let mut x = vec![0.0; (n + SLACK) * m];
                for (to, from) in x.chunks_exact_mut(n + SLACK).zip(self.before.chunks_exact(stride)) {
                    to[..n].copy_from_slice(&from[m..rows]);
                }
                solve_transposed::<V, NR>(&mut x, n + SLACK, n, self.h, stride, m);
                for (x, h) in x.chunks_exact(n + SLACK).zip(self.h.chunks_exact(stride)) {
                    assert!(x[..n].iter().zip(&h[m..rows]).all(|(x, h)| (x - h).abs() < TOLERANCE));
                }
                let mut upper = vec![0.0; (self.m + SLACK) * self.m];
                solve_right::<V, NR>(self.gains, stride, self.m, rows, self.m, &mut upper);
            }
        }
    }

    #[test]
    fn elimination_and_solve_match_nalgebra_for_every_edge() {
        at_each_level(|| {
            for m in 0..19 {
                for n in 1..19 {
                    let size = m + n;
                    let root = DMatrix::from_fn(size + 1, size, entry);
                    let full = &root * root.transpose() + DMatrix::identity(size + 1, size + 1) * 2.0;
                    let stride = size + 1 + SLACK;
                    let mut h = vec![0.0; stride * size];
                    for j in 0..size {
                        h[j * stride..][..size + 1].copy_from_slice(full.column(j).as_slice());
                    }
                    let (before, mut gains, mut result) = (h.clone(), h.clone(), Ok(()));
                    at_level(Both { before: &before, h: &mut h, gains: &mut gains, size, m, result: &mut result });
                    result.unwrap();

                    let uu = full.view((0, 0), (m, m)).into_owned();
                    let xu = full.view((m, 0), (n + 1, m)).into_owned();
                    let gain = &xu * uu.clone().try_inverse().unwrap();
                    let schur = full.view((m, m), (n + 1, n + 1)) - &gain * xu.transpose();
                    for (i, j) in (0..n + 1).flat_map(|i| (0..n.min(i + 1)).map(move |j| (i, j))) {
                        assert!((h[(m + j) * stride + m + i] - schur[(i, j)]).abs() < TOLERANCE * size as f64);
                    }
                    for (i, j) in (0..n + 1).flat_map(|i| (0..m).map(move |j| (i, j))) {
                        assert!((gains[j * stride + m + i] - gain[(i, j)]).abs() < TOLERANCE * size as f64);
                    }
                }
            }
        });
    }

    #[test]
    fn elimination_names_the_pivot_that_is_not_positive() {
        let stride = 5 + SLACK;
        let mut h = vec![0.0; stride * 4];
        for (j, x) in [1.0, 2.0, -3.0, 4.0].into_iter().enumerate() {
            h[j * stride + j] = x;
        }
        let (before, mut gains, mut result) = (h.clone(), h.clone(), Ok(()));
        at_level(Both { before: &before, h: &mut h, gains: &mut gains, size: 4, m: 3, result: &mut result });
        assert_eq!(result, Err((2, -3.0)));
    }
}
