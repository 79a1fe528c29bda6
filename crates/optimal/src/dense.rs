//! Dense kernels of the sweep: small, column-major, blocked for registers; nothing allocates.
//!
//! Everything is built from one step, the product of a strip of two registers of rows by `NR` columns, accumulated in
//! registers. A matrix that a tile reads or writes in whole strips has [`SLACK`] rows below its last one; what they hold
//! does not matter. All is inlined into the work that [`at_level`](crate::vector::at_level) compiles for the processor.

use crate::vector::Vector;

/// Rows that a strip may reach past the last row, and columns that a tile may.
pub(crate) const SLACK: usize = 8;

/// tile = a[i.., ..length] · b[j.., ..length]ᵀ, with S registers of rows.
#[inline(always)]
pub(crate) fn tile_rows<V: Vector, const S: usize, const NR: usize>(
    a: &[f64],
    lda: usize,
    i: usize,
    b: &[f64],
    ldb: usize,
    j: usize,
    length: usize,
) -> [[V; S]; NR] {
    let mut tile = [[V::splat(0.0); S]; NR];
    for k in 0..length {
        let strip = &a[k * lda + i..][..S * V::N];
        let row = &b[k * ldb + j..][..NR];
        let mut registers = [V::splat(0.0); S];
        for s in 0..S {
            registers[s] = V::load(&strip[s * V::N..]);
        }
        for jj in 0..NR {
            let x = V::splat(row[jj]);
            for s in 0..S {
                tile[jj][s] = registers[s].mul_add(x, tile[jj][s]);
            }
        }
    }
    tile
}

/// What becomes of an entry of C under that of a product.
#[derive(Clone, Copy)]
pub(crate) enum Store {
    /// The product.
    Set,
    /// The sum.
    Add,
    /// C minus the product.
    Subtract,
}

/// One strip of S registers of rows of a product into C.
#[inline(always)]
fn strip<V: Vector, const S: usize, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    [i, j]: [usize; 2],
    columns: usize,
    tile: &[[V; S]; NR],
    how: Store,
) {
    for jj in 0..NR {
        if jj < columns {
            let column = &mut c[(j + jj) * ldc + i..][..S * V::N];
            for s in 0..S {
                let place = &mut column[s * V::N..];
                let product = tile[jj][s];
                match how {
                    Store::Set => product.store(place),
                    Store::Add => V::load(place).add(product).store(place),
                    Store::Subtract => V::load(place).sub(product).store(place),
                }
            }
        }
    }
}

/// A matrix in column-major storage, from an entry on.
#[derive(Clone, Copy)]
pub(crate) struct View<'a> {
    pub(crate) data: &'a [f64],
    pub(crate) stride: usize,
}

/// C[i, j] ← A[i, ..length] · B[j, ..length]ᵀ for the rows `first`..`rows` and `columns` columns from j on, in strips of
/// two registers, the last of one where that is enough.
#[inline(always)]
pub(crate) fn column_block<V: Vector, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    rows: core::ops::Range<usize>,
    j: usize,
    columns: usize,
    a: View<'_>,
    b: View<'_>,
    length: usize,
    how: Store,
) {
    let mut i = rows.start;
    while i < rows.end {
        if rows.end - i > V::N {
            let tile = tile_rows::<V, 2, NR>(a.data, a.stride, i, b.data, b.stride, j, length);
            strip(c, ldc, [i, j], columns, &tile, how);
            i += 2 * V::N;
        } else {
            let tile = tile_rows::<V, 1, NR>(a.data, a.stride, i, b.data, b.stride, j, length);
            strip(c, ldc, [i, j], columns, &tile, how);
            i += V::N;
        }
    }
}

/// C ← A Bᵀ, with `rows` rows of A, `columns` rows of B and `length` columns of both.
#[inline(always)]
pub(crate) fn product<V: Vector, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    [rows, columns, length]: [usize; 3],
    a: View<'_>,
    b: View<'_>,
) {
    let mut j = 0;
    while j < columns {
        column_block::<V, NR>(c, ldc, 0..rows, j, NR.min(columns - j), a, b, length, Store::Set);
        j += NR;
    }
}

/// The lower triangle (with some of the upper one) of C += A Bᵀ, with `rows` rows of A, `columns` rows of B and `length`
/// columns of both.
#[inline(always)]
pub(crate) fn add_product_lower<V: Vector, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    [rows, columns, length]: [usize; 3],
    a: View<'_>,
    b: View<'_>,
) {
    let mut j = 0;
    while j < columns {
        column_block::<V, NR>(c, ldc, j..rows, j, NR.min(columns - j), a, b, length, Store::Add);
        j += NR;
    }
}

/// The lower triangle of C += (A Bᵀ)ᵀ for square A and B of `size` rows, by way of the upper triangle of the product, which
/// is left in `scratch` (stride `lds`, `size` columns).
#[inline(always)]
pub(crate) fn add_transposed_product_lower<V: Vector, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    size: usize,
    a: View<'_>,
    b: View<'_>,
    scratch: &mut [f64],
    lds: usize,
) {
    let mut j = 0;
    while j < size {
        let columns = NR.min(size - j);
        column_block::<V, NR>(scratch, lds, 0..j + columns, j, columns, a, b, size, Store::Set);
        j += NR;
    }
    for j in 0..size {
        for i in j..size {
            c[j * ldc + i] += scratch[i * lds + j];
        }
    }
}

/// to = x, without the function call that copying a few numbers would be.
#[inline(always)]
#[allow(clippy::manual_memcpy)] // that is the call
pub(crate) fn copy<V: Vector>(to: &mut [f64], x: &[f64]) {
    let length = x.len();
    let to = &mut to[..length];
    if length < V::N {
        for i in 0..length {
            to[i] = x[i];
        }
        return;
    }
    let mut i = 0;
    while i + V::N < length {
        V::load(&x[i..]).store(&mut to[i..]);
        i += V::N;
    }
    V::load(&x[length - V::N..]).store(&mut to[length - V::N..]);
}

/// to = a x, in the same way.
#[inline(always)]
pub(crate) fn copy_scaled<V: Vector>(to: &mut [f64], x: &[f64], a: f64) {
    let length = x.len();
    let to = &mut to[..length];
    if length < V::N {
        for i in 0..length {
            to[i] = a * x[i];
        }
        return;
    }
    let (a, last, mut i) = (V::splat(a), length - V::N, 0);
    while i < last {
        V::load(&x[i..]).mul(a).store(&mut to[i..]);
        i += V::N;
    }
    V::load(&x[last..]).mul(a).store(&mut to[last..]);
}

/// Aᵀ into `out` (stride `ldo`) from its row `at` on, for the rows `rows` of A (stride `lda`) and its columns `columns`.
#[inline(always)]
pub(crate) fn transpose<V: Vector>(
    out: &mut [f64],
    ldo: usize,
    at: usize,
    a: &[f64],
    lda: usize,
    rows: core::ops::Range<usize>,
    columns: core::ops::Range<usize>,
) {
    let (height, width) = (rows.len(), columns.len());
    if width == 0 {
        return;
    }
    let a = &a[columns.start * lda + rows.start..];
    if height < V::N || width < V::N {
        for j in 0..width {
            for i in 0..height {
                out[i * ldo + at + j] = a[j * lda + i];
            }
        }
        return;
    }
    // In square blocks, of which the last ones overlap those before.
    let mut j = 0;
    loop {
        let mut i = 0;
        loop {
            let mut block = [V::splat(0.0); SLACK];
            for k in 0..V::N {
                block[k] = V::load(&a[(j + k) * lda + i..]);
            }
            V::transpose(&mut block[..V::N]);
            for k in 0..V::N {
                block[k].store(&mut out[(i + k) * ldo + at + j..]);
            }
            if i + V::N >= height {
                break;
            }
            i = (i + V::N).min(height - V::N);
        }
        if j + V::N >= width {
            break;
        }
        j = (j + V::N).min(width - V::N);
    }
}

/// Copies the lower triangle of A to both triangles of `out`.
#[inline(always)]
pub(crate) fn copy_symmetric<V: Vector>(out: &mut [f64], ldo: usize, a: &[f64], lda: usize, size: usize) {
    // What lies below the diagonal to the right of it, in blocks of columns; with them comes what lies above.
    let (width, mut j) = (V::N.min(size), 0);
    while j < size {
        let from = j.min(size - width);
        transpose::<V>(&mut out[from * ldo..], ldo, from, a, lda, from..size, from..from + width);
        j += V::N;
    }
    for j in 0..size {
        copy::<V>(&mut out[j * ldo + j..], &a[j * lda + j..][..size - j]);
    }
}

/// y += x on `length` numbers, in whole registers: what follows them is slack.
#[inline(always)]
pub(crate) fn add<V: Vector>(y: &mut [f64], x: &[f64], length: usize) {
    let mut i = 0;
    while i < length {
        V::load(&y[i..]).add(V::load(&x[i..])).store(&mut y[i..]);
        i += V::N;
    }
}

/// Adds the squares of the numbers of x to two registers, of some of them more than once: enough to see if one has diverged.
#[inline(always)]
pub(crate) fn add_squares<V: Vector>(sums: &mut [V; 2], x: &[f64]) {
    if x.len() < V::N {
        for x in x {
            sums[0] = V::splat(*x).mul_add(V::splat(*x), sums[0]);
        }
        return;
    }
    let (last, mut i) = (x.len() - V::N, 0);
    while i < last {
        for sum in &mut *sums {
            let x = V::load(&x[i.min(last)..]);
            *sum = x.mul_add(x, *sum);
            i += V::N;
        }
    }
    let x = V::load(&x[last..]);
    sums[0] = x.mul_add(x, sums[0]);
}

/// y += α A x for a column-major A without slack.
#[inline(always)]
pub(crate) fn add_scaled_product(y: &mut [f64], alpha: f64, a: &[f64], x: &[f64]) {
    for (column, x) in a.chunks_exact(y.len().max(1)).zip(x) {
        let factor = alpha * x;
        for (y, a) in y.iter_mut().zip(column) {
            *y += a * factor;
        }
    }
}

/// xᵀ y.
#[inline(always)]
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// ‖x‖∞; NaN if an entry is.
#[inline(always)]
pub(crate) fn max_abs(x: &[f64]) -> f64 {
    let larger = |most: f64, x: f64| if x.abs() > most || x.is_nan() { x.abs() } else { most };
    let (eights, rest) = x.as_chunks::<8>();
    let mut most = [0.0; 8];
    for x in eights {
        for i in 0..8 {
            most[i] = larger(most[i], x[i]);
        }
    }
    most.iter().chain(rest).fold(0.0, |most, x| larger(most, *x))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::tests::at_each_level;
    use crate::vector::{Dense, Pair, at_level};
    use nalgebra::DMatrix;

    /// Entries of size one, sums of 30 of them: 1e-12 leaves room for rounding and nothing else.
    const TOLERANCE: f64 = 1e-12;

    fn entry(i: usize, j: usize) -> f64 {
        ((i * 31 + j * 17 + 5) % 23) as f64 / 23.0 - 0.4
    }

    /// A copy with slack rows.
    fn padded(a: &DMatrix<f64>) -> (Vec<f64>, usize) {
        let stride = a.nrows() + SLACK;
        let mut out = vec![0.0; stride * a.ncols()];
        for j in 0..a.ncols() {
            out[j * stride..][..a.nrows()].copy_from_slice(a.column(j).as_slice());
        }
        (out, stride)
    }

    /// Each of the products, of A with B.
    struct Products<'a> {
        a: &'a DMatrix<f64>,
        b: &'a DMatrix<f64>,
    }

    impl Dense for Products<'_> {
        #[inline(always)]
        fn run<V: Vector, const NR: usize>(self) {
            let (rows, columns, length) = (self.a.nrows(), self.b.nrows(), self.a.ncols());
            let expected = self.a * self.b.transpose();
            let ((a, lda), (b, ldb)) = (padded(self.a), padded(self.b));
            let (a, b) = (View { data: &a, stride: lda }, View { data: &b, stride: ldb });
            let mut c = vec![0.0; lda * columns];
            product::<V, NR>(&mut c, lda, [rows, columns, length], a, b);
            for (i, j) in (0..rows).flat_map(|i| (0..columns).map(move |j| (i, j))) {
                assert!((c[j * lda + i] - expected[(i, j)]).abs() < TOLERANCE);
            }
            if columns <= rows {
                let mut c = vec![1.0; lda * columns];
                add_product_lower::<V, NR>(&mut c, lda, [rows, columns, length], a, b);
                for (i, j) in (0..rows).flat_map(|i| (0..columns.min(i + 1)).map(move |j| (i, j))) {
                    assert!((c[j * lda + i] - expected[(i, j)] - 1.0).abs() < TOLERANCE);
                }
            }
            if columns == rows && length == rows {
                let (mut c, mut scratch) = (vec![1.0; lda * columns], vec![0.0; lda * columns]);
                add_transposed_product_lower::<V, NR>(&mut c, lda, rows, a, b, &mut scratch, lda);
                for (i, j) in (0..rows).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                    assert!((c[j * lda + i] - expected[(j, i)] - 1.0).abs() < TOLERANCE);
                }
            }
        }
    }

    #[test]
    fn products_match_nalgebra_for_every_edge() {
        at_each_level(|| {
            for rows in 1..20 {
                for columns in [1, 2, 3, 4, 5, 7, 8, 9, 12, 17, rows] {
                    for length in [0, 1, 6, 13, rows] {
                        let a = DMatrix::from_fn(rows, length, entry);
                        let b = DMatrix::from_fn(columns, length, |i, j| entry(j, i + 3));
                        at_level(Products { a: &a, b: &b });
                    }
                }
            }
        });
    }

    #[test]
    fn copies_are_exact_for_every_edge() {
        for n in 1..19 {
            let a = DMatrix::from_fn(n, n, |i, j| entry(i, 2 * j));
            let mut out = vec![0.0; (n + SLACK) * n];
            copy_symmetric::<Pair>(&mut out, n + SLACK, a.as_slice(), n, n);
            for (i, j) in (0..n).flat_map(|i| (0..=i).map(move |j| (i, j))) {
                assert!(out[j * (n + SLACK) + i] == a[(i, j)] && out[i * (n + SLACK) + j] == a[(i, j)]);
            }
            transpose::<Pair>(&mut out, n + SLACK, 2, a.as_slice(), n, 1..n, 0..n);
            for (i, j) in (1..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                assert_eq!(out[(i - 1) * (n + SLACK) + 2 + j], a[(i, j)]);
            }
        }
    }
}
