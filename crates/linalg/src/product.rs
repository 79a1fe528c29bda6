//! Products and sums of matrices.
#![allow(unsafe_code)]
use crate::compiled::compiled;
use crate::registers::Vector;
use crate::tile::{SLACK, Store, View, column_block, holds, tile_rows};

compiled! {
    /// Computes C = A Bᵀ, for `shape` = [rows of A, rows of B, columns of A and B]. C has padding rows.
    pub fn product<V, COLUMNS>(c: &mut [f64], ldc: usize, shape: [usize; 3], a: View<'_>, b: View<'_>) {
        whole::<V, COLUMNS, false>(c, ldc, shape, a, b, Store::Set);
    }

    /// Computes C += A Bᵀ, with `shape` as for [`product`]. C has padding rows.
    pub fn add_product<V, COLUMNS>(c: &mut [f64], ldc: usize, shape: [usize; 3], a: View<'_>, b: View<'_>) {
        whole::<V, COLUMNS, false>(c, ldc, shape, a, b, Store::Add);
    }

    /// Computes the lower triangle of C += A Bᵀ, with `shape` as for [`product`]. Some entries above the diagonal
    /// change as well. C has padding rows.
    pub fn add_product_lower<V, COLUMNS>(c: &mut [f64], ldc: usize, shape: [usize; 3], a: View<'_>, b: View<'_>) {
        whole::<V, COLUMNS, true>(c, ldc, shape, a, b, Store::Add);
    }

    /// Computes the lower triangle of C += (A Bᵀ)ᵀ for square A and B with `size` rows. `scratch` (stride `lds`, `size`
    /// columns, padding rows) then contains the upper triangle of A Bᵀ.
    pub fn add_transposed_product_lower<V, COLUMNS>(
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
            let width = COLUMNS.min(size - j);
            column_block::<V, COLUMNS>(scratch, lds, 0..j + width, j, width, a, b, size, Store::Set);
            j += COLUMNS;
        }
        for j in 0..size {
            for i in j..size {
                c[j * ldc + i] += scratch[i * lds + j];
            }
        }
    }

    /// Computes C = A Bᵀ for an A with `rows` rows and an upper triangular B with n rows; `shape` = [rows, n]. C has
    /// padding rows.
    pub fn product_with_upper<V, COLUMNS>(c: &mut [f64], ldc: usize, shape: [usize; 2], a: View<'_>, b: View<'_>) {
        let [rows, n] = shape;
        from_diagonal::<V, COLUMNS, false>(c, ldc, [rows, n], a, b);
    }

    /// Computes the lower triangle of C = A Bᵀ for an upper triangular A; A and B have n rows and n columns. Some
    /// entries above the diagonal change as well. C has padding rows.
    pub fn product_of_upper_lower<V, COLUMNS>(c: &mut [f64], ldc: usize, n: usize, a: View<'_>, b: View<'_>) {
        from_diagonal::<V, COLUMNS, true>(c, ldc, [n, n], a, b);
    }

    /// Computes C = A Bᵀ for a C without padding rows, with `shape` as for [`product`]. If some rows of A are also rows
    /// of B, symmetric entries of C for these rows have the same bits.
    pub fn product_without_slack<V, COLUMNS>(
        c: &mut [f64],
        ldc: usize,
        shape: [usize; 3],
        a: View<'_>,
        b: View<'_>,
    ) {
        let ([rows, columns, length], mut j) = (shape, 0);
        while j < columns {
            let (width, mut i) = (COLUMNS.min(columns - j), 0);
            while i < rows {
                if rows - i >= 2 * V::N {
                    let tile = tile_rows::<V, 2, COLUMNS>(a, i, b, j, length);
                    for jj in 0..COLUMNS {
                        if jj < width {
                            let to = &mut c[(j + jj) * ldc + i..][..2 * V::N];
                            tile[jj][0].store(to);
                            tile[jj][1].store(&mut to[V::N..]);
                        }
                    }
                    i += 2 * V::N;
                    continue;
                }
                if rows >= V::N {
                    i = i.min(rows - V::N); // the last strip overlaps the strip before it
                }
                let tile = tile_rows::<V, 1, COLUMNS>(a, i, b, j, length);
                for jj in 0..COLUMNS {
                    if jj < width {
                        let to = &mut c[(j + jj) * ldc + i..];
                        if rows >= V::N {
                            tile[jj][0].store(to);
                            continue;
                        }
                        let mut numbers = [0.0; SLACK];
                        tile[jj][0].store(&mut numbers);
                        for k in 0..V::N {
                            if k < rows {
                                to[k] = numbers[k]; // copies one number at a time, to avoid a function call
                            }
                        }
                    }
                }
                i += V::N;
            }
            j += COLUMNS;
        }
    }

    /// Computes C += A on `rows` rows and `columns` columns, in whole registers. Both matrices have padding rows; the
    /// padding of C changes.
    pub fn add_matrix<V, COLUMNS>(c: &mut [f64], ldc: usize, a: View<'_>, shape: [usize; 2]) {
        let [rows, columns] = shape;
        for j in 0..columns {
            let (c, a, mut i) = (&mut c[j * ldc..], &a.data[j * a.stride..], 0);
            while i < rows {
                V::load(&c[i..]).add(V::load(&a[i..])).store(&mut c[i..]);
                i += V::N;
            }
        }
    }
}

/// Computes X = A₁ + s B₁ and Y = A₂ + s (X + B₂) for A = [A₁; A₂] and B = [B₁; B₂]. This function is inlined. `shape`
/// = [rows of X, columns]. Copies of X are written to OUT at the offsets `of_x`, and copies of Y at the offsets `of_y`.
#[inline(always)]
pub fn add_in_turn<V: Vector, const MX: usize, const MY: usize>(
    out: &mut [f64],
    ldo: usize,
    (of_x, of_y): ([usize; MX], [usize; MY]),
    a: View<'_>,
    b: View<'_>,
    s: f64,
    shape: [usize; 2],
) {
    let [rows, columns] = shape;
    if columns == 0 || rows == 0 {
        return;
    }
    let places = of_x.iter().chain(&of_y).all(|&at| at <= out.len() && holds(&out[at..], ldo, shape));
    let inside = [a, b].iter().all(|x| holds(x.data, x.stride, [2 * rows, columns]));
    assert!(places && inside, "a matrix ends before the last of its entries");
    let (width, last) = (V::N.min(rows), rows.saturating_sub(V::N));
    let (step, mut i) = (V::splat(s), 0);
    loop {
        for j in 0..columns {
            let (from_a, from_b, to) = (j * a.stride + i, j * b.stride + i, j * ldo + i);
            if width < V::N {
                for i in 0..rows {
                    let x = b.data[from_b + i] * s + a.data[from_a + i];
                    let y = (x + b.data[from_b + rows + i]) * s + a.data[from_a + rows + i];
                    of_x.iter().for_each(|at| out[at + to + i] = x);
                    of_y.iter().for_each(|at| out[at + to + i] = y);
                }
                continue;
            }
            // SAFETY: the register starts at row i ≤ `rows` − `V::N` of a column that was found to be in bounds.
            unsafe {
                let load = |x: &[f64], at: usize| V::load(x.get_unchecked(at..at + V::N));
                let x = load(b.data, from_b).mul_add(step, load(a.data, from_a));
                let y = x.add(load(b.data, from_b + rows)).mul_add(step, load(a.data, from_a + rows));
                for k in 0..MX {
                    let at = of_x[k] + to;
                    x.store(out.get_unchecked_mut(at..at + V::N));
                }
                for k in 0..MY {
                    let at = of_y[k] + to;
                    y.store(out.get_unchecked_mut(at..at + V::N));
                }
            }
        }
        if i >= last {
            return;
        }
        i = (i + V::N).min(last); // the last register may overlap the register before it
    }
}

/// Computes OUT = A + B on `rows` rows and `columns` columns. This function is inlined.
#[inline(always)]
pub fn add_blocks<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, b: View<'_>, shape: [usize; 2]) {
    let [rows, columns] = shape;
    if columns == 0 || rows == 0 {
        return;
    }
    let inside = [a, b].iter().all(|x| holds(x.data, x.stride, shape)) && holds(out, ldo, shape);
    assert!(inside, "a matrix ends before the last of its entries");
    let last = rows.saturating_sub(V::N);
    for j in 0..columns {
        let (from_a, from_b, to, mut i) = (j * a.stride, j * b.stride, j * ldo, 0);
        if rows < V::N {
            for i in 0..rows {
                out[to + i] = a.data[from_a + i] + b.data[from_b + i];
            }
            continue;
        }
        loop {
            // SAFETY: the register starts at row i ≤ `rows` − `V::N` of a column that was found to be in bounds.
            unsafe {
                let load = |x: &[f64], at: usize| V::load(x.get_unchecked(at..at + V::N));
                let sum = load(a.data, from_a + i).add(load(b.data, from_b + i));
                sum.store(out.get_unchecked_mut(to + i..to + i + V::N));
            }
            if i >= last {
                break;
            }
            i = (i + V::N).min(last);
        }
    }
}

/// Computes C ← A Bᵀ in blocks of columns; with LOWER, only the rows from the block's diagonal on. `how` selects
/// whether the product is set, added or subtracted.
#[inline(always)]
fn whole<V: Vector, const COLUMNS: usize, const LOWER: bool>(
    c: &mut [f64],
    ldc: usize,
    [rows, columns, length]: [usize; 3],
    a: View<'_>,
    b: View<'_>,
    how: Store,
) {
    let mut j = 0;
    while j < columns {
        let first = if LOWER { j } else { 0 };
        column_block::<V, COLUMNS>(c, ldc, first..rows, j, COLUMNS.min(columns - j), a, b, length, how);
        j += COLUMNS;
    }
}

/// Computes C ← A Bᵀ, where the entry (i, j) is a sum over k. For a block of columns of C that begins with column j,
/// the sums begin with k = j. With LOWER, computes only the rows from j on.
#[inline(always)]
fn from_diagonal<V: Vector, const COLUMNS: usize, const LOWER: bool>(
    c: &mut [f64],
    ldc: usize,
    [rows, n]: [usize; 2],
    a: View<'_>,
    b: View<'_>,
) {
    let mut j = 0;
    while j < n {
        let (first, width) = (if LOWER { j } else { 0 }, COLUMNS.min(n - j));
        let (a, b) = (View { data: &a.data[j * a.stride..], ..a }, View { data: &b.data[j * b.stride..], ..b });
        column_block::<V, COLUMNS>(c, ldc, first..rows, j, width, a, b, n - j, Store::Set);
        j += COLUMNS;
    }
}
