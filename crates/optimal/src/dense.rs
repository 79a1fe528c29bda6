//! Dense kernels of the sweep: small, column-major, blocked for registers; nothing allocates.
//!
//! Everything is built from one step, the product of an `MR`-row strip by `NR` columns, accumulated in registers by
//! plain loops that the compiler turns into vector instructions. A matrix that a tile reads or writes in whole strips
//! has [`SLACK`] rows below its last one; they hold zeros.

/// Rows of a tile: as many as 4 columns of accumulators fit the register file.
const MR: usize = if cfg!(target_feature = "avx512f") {
    16
} else if cfg!(target_feature = "avx") {
    8
} else {
    4
};

/// Columns of a tile.
const NR: usize = 4;

/// Whether a·b + c is one instruction; otherwise `mul_add` would be a function call.
const FMA: bool = cfg!(target_feature = "fma");

/// Rows that a strip may reach past the last row, and columns that a tile may.
pub(crate) const SLACK: usize = if MR > NR { MR } else { NR };

type Tile = [[f64; MR]; NR];

#[inline(always)]
fn mul_add(a: f64, b: f64, c: f64) -> f64 {
    if FMA { a.mul_add(b, c) } else { a * b + c }
}

/// tile = a[i.., :] · [b₀ b₁ b₂ b₃], the b given as columns of equal length.
#[inline(always)]
fn tile_columns(a: &[f64], lda: usize, i: usize, b: [&[f64]; NR]) -> Tile {
    let mut tile = [[0.0; MR]; NR];
    let length = b[0].len();
    let b = b.map(|column| &column[..length]);
    for (k, column) in a[i..].chunks(lda).enumerate().take(length) {
        let strip: &[f64; MR] = column.first_chunk().expect("slack rows");
        for j in 0..NR {
            for r in 0..MR {
                tile[j][r] = mul_add(strip[r], b[j][k], tile[j][r]);
            }
        }
    }
    tile
}

/// tile = a[i.., ..length] · b[j.., ..length]ᵀ.
#[inline(always)]
fn tile_rows(a: &[f64], lda: usize, i: usize, b: &[f64], ldb: usize, j: usize, length: usize) -> Tile {
    let mut tile = [[0.0; MR]; NR];
    for (a, b) in a[i..].chunks(lda).zip(b[j..].chunks(ldb)).take(length) {
        let strip: &[f64; MR] = a.first_chunk().expect("slack rows");
        let row: &[f64; NR] = b.first_chunk().expect("slack rows");
        for j in 0..NR {
            for r in 0..MR {
                tile[j][r] = mul_add(strip[r], row[j], tile[j][r]);
            }
        }
    }
    tile
}

/// C[i.., j..] += sign · tile, in its first `columns` columns.
#[inline(always)]
fn add_tile(c: &mut [f64], ldc: usize, i: usize, j: usize, columns: usize, sign: f64, tile: &Tile) {
    for (jj, column) in tile.iter().enumerate().take(columns) {
        let strip: &mut [f64; MR] = c[(j + jj) * ldc + i..].first_chunk_mut().expect("slack rows");
        for r in 0..MR {
            strip[r] += sign * column[r];
        }
    }
}

/// The columns j.. of a column-major matrix with `rows` rows; those past its end are `zero`.
#[inline(always)]
fn columns<'a>(b: &'a [f64], rows: usize, j: usize, zero: &'a [f64]) -> [&'a [f64]; NR] {
    std::array::from_fn(|jj| b.get((j + jj) * rows..(j + jj + 1) * rows).unwrap_or(zero))
}

/// W[at.., :] = (P B)ᵀ for a symmetric P (n×n) and B (n×`width`, no slack); `zero` holds n zeros.
///
/// Rows of W up to the next multiple of four are overwritten with zeros.
pub(crate) fn product_transposed(
    w: &mut [f64],
    ldw: usize,
    at: usize,
    p: &[f64],
    ldp: usize,
    b: &[f64],
    width: usize,
    zero: &[f64],
) {
    let n = zero.len();
    for j in (0..width).step_by(NR) {
        let b = columns(b, n, j, zero);
        for i in (0..n).step_by(MR) {
            let tile = tile_columns(p, ldp, i, b);
            for r in 0..MR.min(n - i) {
                let row: &mut [f64; NR] = w[(i + r) * ldw + at + j..].first_chunk_mut().expect("slack rows");
                *row = std::array::from_fn(|jj| tile[jj][r]);
            }
        }
    }
}

/// H[i, at + j] += (W B)[i, j] for i ≥ at + j, B (n×`width`, no slack), H and W with `rows` rows and one stride.
pub(crate) fn add_product_lower(
    h: &mut [f64],
    w: &[f64],
    stride: usize,
    rows: usize,
    at: usize,
    b: &[f64],
    width: usize,
    zero: &[f64],
) {
    for j in (0..width).step_by(NR) {
        let b = columns(b, zero.len(), j, zero);
        for i in (at + j..rows).step_by(MR) {
            let tile = tile_columns(w, stride, i, b);
            add_tile(h, stride, i, at + j, NR.min(width - j), 1.0, &tile);
        }
    }
}

/// Eliminates the first m of the columns of a symmetric H, of which the lower triangle is given and `rows` rows (one
/// or more below the square are right-hand sides): H = [Hᵤᵤ ·; Hₓᵤ Hₓₓ] becomes [L ·; X Hₓₓ − X Xᵀ] with
/// L Lᵀ = Hᵤᵤ and X = Hₓᵤ L⁻ᵀ.
///
/// The first pivot that is not positive ends it: `Err((column, pivot))`.
pub(crate) fn eliminate(h: &mut [f64], stride: usize, rows: usize, size: usize, m: usize) -> Result<(), (usize, f64)> {
    for j0 in (0..m).step_by(NR) {
        let width = NR.min(m - j0);
        subtract_outer(h, stride, rows, j0, width, j0);
        for j in j0..j0 + width {
            let (done, column) = h.split_at_mut(j * stride);
            let column = &mut column[j..rows];
            for p in j0..j {
                let left = &done[p * stride + j..p * stride + rows];
                let factor = left[0];
                for (c, l) in column.iter_mut().zip(left) {
                    *c -= l * factor;
                }
            }
            let pivot = column[0];
            if !(pivot > 0.0 && pivot.is_finite()) {
                return Err((j, pivot));
            }
            let scale = pivot.sqrt().recip();
            for c in column.iter_mut() {
                *c *= scale;
            }
        }
    }
    for j in (m..size).step_by(NR) {
        subtract_outer(h, stride, rows, j, NR.min(size - j), m);
    }
    Ok(())
}

/// H[i, j] −= Σ_{p < length} H[i, p] H[j, p] for i ≥ j, on `width` ≤ NR columns from j on.
#[inline(always)]
fn subtract_outer(h: &mut [f64], stride: usize, rows: usize, j: usize, width: usize, length: usize) {
    if length == 0 {
        return;
    }
    for i in (j..rows).step_by(MR) {
        let tile = tile_rows(h, stride, i, h, stride, j, length);
        add_tile(h, stride, i, j, width, -1.0, &tile);
    }
}

/// X ← X L⁻¹ on the rows `first`..`rows` of H's first m columns, with L in the lower triangle above them.
///
/// `upper` (m + SLACK rows, m columns) is scratch for Lᵀ.
pub(crate) fn solve_right(h: &mut [f64], stride: usize, first: usize, rows: usize, m: usize, upper: &mut [f64]) {
    let ldu = m + SLACK;
    for j in 0..m {
        for i in j..m {
            upper[i * ldu + j] = h[j * stride + i];
        }
    }
    // From the last columns to the first: X[:, j] ← (X[:, j] − Σ_{p > j} X[:, p] L[p, j]) / L[j, j].
    for block in (0..m.div_ceil(NR)).rev() {
        let (j0, end) = (block * NR, m.min(block * NR + NR));
        if end < m {
            for i in (first..rows).step_by(MR) {
                let tile = tile_rows(&h[end * stride..], stride, i, &upper[end * ldu..], ldu, j0, m - end);
                add_tile(h, stride, i, j0, end - j0, -1.0, &tile);
            }
        }
        for j in (j0..end).rev() {
            let (left, right) = h.split_at_mut((j + 1) * stride);
            let column = &mut left[j * stride + first..j * stride + rows];
            for p in j + 1..end {
                let factor = upper[p * ldu + j];
                for (c, x) in column.iter_mut().zip(&right[(p - j - 1) * stride + first..]) {
                    *c -= x * factor;
                }
            }
            let scale = upper[j * ldu + j].recip();
            for c in column.iter_mut() {
                *c *= scale;
            }
        }
    }
}

/// y += α A x for a column-major A without slack.
#[inline(always)]
pub(crate) fn add_scaled_product(y: &mut [f64], alpha: f64, a: &[f64], x: &[f64]) {
    for (column, x) in a.chunks_exact(y.len().max(1)).zip(x) {
        let factor = alpha * x;
        for (y, a) in y.iter_mut().zip(column) {
            *y = mul_add(*a, factor, *y);
        }
    }
}

/// xᵀ y.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// ‖x‖∞; NaN if an entry is.
pub(crate) fn max_abs(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |largest, x| if x.abs() > largest || x.is_nan() { x.abs() } else { largest })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Entries of size one, sums of 30 of them: 1e-12 leaves room for rounding and nothing else.
    const TOLERANCE: f64 = 1e-12;

    fn entry(i: usize, j: usize) -> f64 {
        ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4
    }

    /// A copy with slack rows and columns of zeros.
    fn padded(a: &DMatrix<f64>, stride: usize) -> Vec<f64> {
        let mut out = vec![0.0; stride * (a.ncols() + SLACK)];
        for j in 0..a.ncols() {
            out[j * stride..][..a.nrows()].copy_from_slice(a.column(j).as_slice());
        }
        out
    }

    #[test]
    fn products_match_nalgebra_for_every_edge() {
        for n in 1..14 {
            for width in 0..11 {
                let (zero, stride) = (vec![0.0; n], n + width + SLACK);
                let a = DMatrix::from_fn(n, n, |i, j| entry(i, j) + entry(j, i));
                let b = DMatrix::from_fn(n, width, entry);
                let mut w = vec![0.0; stride * n];
                product_transposed(&mut w, stride, 0, &padded(&a, n + SLACK), n + SLACK, b.as_slice(), width, &zero);
                let expected = (&a * &b).transpose();
                for (i, j) in (0..width).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    assert!((w[j * stride + i] - expected[(i, j)]).abs() < TOLERANCE);
                }
                let mut h = vec![0.0; stride * (width + SLACK)];
                add_product_lower(&mut h, &w, stride, width, 0, b.as_slice(), width, &zero);
                let expected = b.transpose() * &a * &b;
                for (i, j) in (0..width).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                    assert!((h[j * stride + i] - expected[(i, j)]).abs() < TOLERANCE);
                }
            }
        }
    }

    #[test]
    fn elimination_and_solve_match_nalgebra_for_every_edge() {
        for m in 0..14 {
            for n in 1..10 {
                let size = m + n;
                let root = DMatrix::from_fn(size + 1, size, entry);
                let full = &root * root.transpose() + DMatrix::identity(size + 1, size + 1) * 2.0;
                let stride = size + 1 + SLACK;
                let mut h = padded(&full, stride);
                eliminate(&mut h, stride, size + 1, size, m).unwrap();

                let uu = full.view((0, 0), (m, m)).into_owned();
                let xu = full.view((m, 0), (n + 1, m)).into_owned();
                let gain = &xu * uu.clone().try_inverse().unwrap();
                let schur = full.view((m, m), (n + 1, n + 1)) - &gain * xu.transpose();
                for (i, j) in (0..n + 1).flat_map(|i| (0..n.min(i + 1)).map(move |j| (i, j))) {
                    assert!((h[(m + j) * stride + m + i] - schur[(i, j)]).abs() < TOLERANCE * size as f64);
                }
                let mut upper = vec![0.0; (m + SLACK) * m];
                solve_right(&mut h, stride, m, size + 1, m, &mut upper);
                for (i, j) in (0..n + 1).flat_map(|i| (0..m).map(move |j| (i, j))) {
                    assert!((h[j * stride + m + i] - gain[(i, j)]).abs() < TOLERANCE * size as f64);
                }
            }
        }
    }

    #[test]
    fn elimination_names_the_pivot_that_is_not_positive() {
        let h = DMatrix::from_diagonal(&nalgebra::dvector![1.0, 2.0, -3.0, 4.0]);
        let mut h = padded(&h, 4 + SLACK);
        assert_eq!(eliminate(&mut h, 4 + SLACK, 4, 3, 3), Err((2, -3.0)));
    }
}
