//! Copies of matrices: whole matrices, triangles and transposes.
#![allow(unsafe_code)]

use crate::compiled::{compiled, narrow};
use crate::registers::Vector;
use crate::tile::{SLACK, View, holds};
use crate::vectors::copy;

narrow! {
    /// Copies A to OUT; A has `rows` rows and `columns` columns.
    pub fn copy_matrix<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        copy_block::<V>(out, ldo, a, shape);
    }

    /// Writes to OUT the symmetric matrix whose lower triangle is in A, and shifts rows and columns cyclically. Row i
    /// becomes row (i + `turn`) mod `size`; columns are shifted in the same way. A and OUT have `size` rows and padding
    /// rows. The padding of OUT changes.
    pub fn copy_symmetric_turned<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize, turn: usize) {
        turned::<V>(out, ldo, a, [size - turn, turn]);
    }

    /// Copies A to OUT on `rows` rows and `columns` columns, unless OUT is empty. Returns Σ aᵢⱼ², in which some entries
    /// may be counted two or three times. Callers use this sum only to detect divergence.
    pub fn copy_with_squares<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) -> f64 {
        match out.is_empty() {
            true => squares::<V, false>(out, 0, a, shape),
            false => squares::<V, true>(out, ldo, a, shape),
        }
    }
}

compiled! {
    /// Copies the lower triangle of A to OUT. Both matrices are square with `size` rows.
    pub fn copy_lower<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
        lower::<V>(out, ldo, a, size);
    }

    /// Writes to OUT the symmetric matrix of `size` rows whose lower triangle is in A.
    pub fn copy_symmetric<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
        // Transposes the lower triangle of A into the upper triangle of OUT, a block of columns at a time. Entries
        // above the diagonal of A are transposed, too, into the lower triangle of OUT, which `lower` then overwrites.
        let (width, mut j) = (V::N.min(size), 0);
        while j < size {
            let from = j.min(size - width);
            let block = View { data: &a.data[from * a.stride + from..], ..a };
            transposed::<V, false>(&mut out[from * ldo + from..], ldo, block, [size - from, width]);
            j += V::N;
        }
        lower::<V>(out, ldo, a, size);
    }

    /// Computes OUT = Aᵀ, for an A with `rows` rows and `columns` columns.
    pub fn transpose<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        transposed::<V, false>(out, ldo, a, shape);
    }

    /// Computes OUT = −Aᵀ, for an A with `rows` rows and `columns` columns.
    pub fn transpose_negated<V, COLUMNS>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
        transposed::<V, true>(out, ldo, a, shape);
    }
}

/// Copies A to OUT; A has `rows` rows and `columns` columns. This function is inlined and calls no function.
#[inline(always)]
pub fn copy_block<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
    let [rows, columns] = shape;
    if columns == 0 {
        return;
    }
    assert!(holds(a.data, a.stride, shape) && holds(out, ldo, shape), "a matrix ends before the last of its entries");
    if rows < V::N {
        for j in 0..columns {
            copy::<V>(&mut out[j * ldo..][..rows], &a.data[j * a.stride..][..rows]);
        }
        return;
    }
    // Copies the rows of two registers in all columns, then the rows of the next two registers. The last registers may
    // overlap the registers before them.
    let (last, mut i) = (rows - V::N, 0);
    loop {
        let (k, mut at, mut from) = ((i + V::N).min(last), 0, 0);
        for _ in 0..columns {
            // SAFETY: each register is in a column that was found to be in bounds.
            unsafe {
                move_register::<V>(out, at + i, a.data, from + i);
                move_register::<V>(out, at + k, a.data, from + k);
            }
            (at, from) = (at + ldo, from + a.stride);
        }
        if k == last {
            return;
        }
        i = (k + V::N).min(last);
    }
}

/// Copies a register of N numbers from offset `from` in `x` to offset `at` in `to`.
///
/// # Safety
/// `to` has N numbers from offset `at` on, and `x` has N numbers from offset `from` on.
#[inline(always)]
unsafe fn move_register<V: Vector>(to: &mut [f64], at: usize, x: &[f64], from: usize) {
    debug_assert!(at + V::N <= to.len() && from + V::N <= x.len());
    // SAFETY: guaranteed by the caller.
    unsafe { V::load(x.get_unchecked(from..from + V::N)).store(to.get_unchecked_mut(at..at + V::N)) };
}

/// Copies the transpose of a block of N rows and N columns (N numbers fill a register), or minus the transpose, from
/// offset `from` in `x` to offset `at` in `to`.
///
/// # Safety
/// Both slices have N numbers in each of N columns: `to` from offset `at` on, `x` from offset `from` on.
#[inline(always)]
unsafe fn move_transposed<V: Vector, const NEGATED: bool>(
    to: &mut [f64],
    at: usize,
    ldo: usize,
    x: &[f64],
    from: usize,
    ldx: usize,
) {
    let mut block = [V::splat(0.0); SLACK];
    for k in 0..V::N {
        let from = from + k * ldx;
        debug_assert!(from + V::N <= x.len());
        // SAFETY: guaranteed by the caller.
        let x = V::load(unsafe { x.get_unchecked(from..from + V::N) });
        block[k] = if NEGATED { x.mul(V::splat(-1.0)) } else { x };
    }
    V::transpose(&mut block[..V::N]);
    for k in 0..V::N {
        let at = at + k * ldo;
        debug_assert!(at + V::N <= to.len());
        // SAFETY: guaranteed by the caller.
        block[k].store(unsafe { to.get_unchecked_mut(at..at + V::N) });
    }
}

/// Returns the first row of the block after the block that starts at row i. Returns `size`, the number of rows, if
/// there is no further block.
#[inline(always)]
fn next_block<V: Vector>(i: usize, size: usize) -> usize {
    if i + V::N >= size { size } else { (i + V::N).min(size - V::N) }
}

/// Copies a block of N rows and N columns (N numbers fill a register) to offset `at[0]` in `to`, and the transpose of
/// the block to offset `at[1]`.
///
/// # Safety
/// Both offsets meet the conditions of [`move_transposed`].
#[inline(always)]
unsafe fn move_both<V: Vector>(to: &mut [f64], at: [usize; 2], ldo: usize, x: &[f64], from: usize, ldx: usize) {
    for k in 0..V::N {
        // SAFETY: guaranteed by the caller.
        unsafe { move_register::<V>(to, at[0] + k * ldo, x, from + k * ldx) };
    }
    // SAFETY: guaranteed by the caller.
    unsafe { move_transposed::<V, false>(to, at[1], ldo, x, from, ldx) };
}

/// Implements [`copy_symmetric_turned`]. The lower triangle of A is [VV ·; QV QQ]. The block VV has `split` rows, the
/// block QQ has `turn` rows, and the dot stands for entries that are not used. The result is the full matrix [QQ QV; VQ
/// VV] with VQ = QVᵀ.
#[inline(always)]
fn turned<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, [split, turn]: [usize; 2]) {
    let (size, View { data: x, stride }) = (split + turn, a);
    if size == 0 {
        return;
    }
    let reached = [size + V::N - 1, size];
    assert!(holds(x, stride, reached) && holds(out, ldo, reached), "a matrix ends before the last of its entries");
    if split < V::N || (1..V::N).contains(&turn) {
        let place = |i: usize| if i < split { i + turn } else { i - split };
        for j in 0..size {
            for i in j..size {
                let (row, column, entry) = (place(i), place(j), x[j * stride + i]);
                (out[column * ldo + row], out[row * ldo + column]) = (entry, entry);
            }
        }
        return;
    }
    // The triangles VV and QQ are copied in square blocks. The last block may overlap the block before it.
    for (to, from, size) in [(turn, 0, split), (0, split, turn)] {
        let (to, from, mut j) = (to * (ldo + 1), from * (stride + 1), 0);
        while j < size {
            let (at, from) = (to + j * (ldo + 1), from + j * (stride + 1));
            // SAFETY: both matrices have `size` columns, each with `size` rows and `V::N` − 1 padding rows.
            unsafe { move_transposed::<V, false>(out, at, ldo, x, from, stride) };
            for k in 0..V::N {
                // Copies the column from the diagonal down, because the transposed block is valid only above the
                // diagonal. Numbers after the last row are padding, or are written again later.
                // SAFETY: both matrices have `size` columns, each with `size` rows and `V::N` − 1 padding rows.
                unsafe { move_register::<V>(out, at + k * (ldo + 1), x, from + k * (stride + 1)) };
            }
            let mut i = next_block::<V>(j, size);
            while i < size {
                let (low, high, from) = (to + j * ldo + i, to + i * ldo + j, from - j + i);
                // SAFETY: all offsets are in columns with `size` rows and `V::N` − 1 padding rows.
                unsafe { move_both::<V>(out, [low, high], ldo, x, from, stride) };
                i = next_block::<V>(i, size);
            }
            j = next_block::<V>(j, size);
        }
    }
    let mut j = if turn > 0 { 0 } else { split };
    while j < split {
        let mut i = 0;
        while i < turn {
            let (from, places) = (j * stride + split + i, [(turn + j) * ldo + i, i * ldo + turn + j]);
            // SAFETY: all offsets are in columns with `size` rows and `V::N` − 1 padding rows.
            unsafe { move_both::<V>(out, places, ldo, x, from, stride) }; // writes the blocks QV and VQ
            i = next_block::<V>(i, turn);
        }
        j = next_block::<V>(j, split);
    }
}

/// Implements [`copy_with_squares`].
#[inline(always)]
fn squares<V: Vector, const COPY: bool>(out: &mut [f64], ldo: usize, a: View<'_>, [rows, columns]: [usize; 2]) -> f64 {
    if rows == 0 || columns == 0 {
        return 0.0;
    }
    let inside = holds(a.data, a.stride, [rows, columns]) && (!COPY || holds(out, ldo, [rows, columns]));
    assert!(inside, "a matrix ends before the last of its entries");
    let mut sums = [V::splat(0.0); 2];
    for j in 0..if rows < V::N { columns } else { 0 } {
        for i in 0..rows {
            let x = a.data[j * a.stride + i];
            sums[0] = V::splat(x).mul_add(V::splat(x), sums[0]);
            if COPY {
                out[j * ldo + i] = x;
            }
        }
    }
    let (last, mut i) = (rows.saturating_sub(V::N), 0);
    while i <= last && rows >= V::N {
        let (k, mut at, mut from) = ((i + V::N).min(last), 0, 0);
        for _ in 0..columns {
            for (sum, i) in sums.iter_mut().zip([i, k]) {
                // SAFETY: the register is in a column that was found to be in bounds.
                unsafe {
                    let x = V::load(a.data.get_unchecked(from + i..from + i + V::N));
                    *sum = x.mul_add(x, *sum);
                    if COPY {
                        x.store(out.get_unchecked_mut(at + i..at + i + V::N));
                    }
                }
            }
            (at, from) = (at + ldo, from + a.stride);
        }
        i = if k == last { rows } else { (k + V::N).min(last) };
    }
    let mut numbers = [0.0; SLACK];
    sums[0].add(sums[1]).store(&mut numbers);
    numbers.iter().sum()
}

#[inline(always)]
fn lower<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, size: usize) {
    if size == 0 {
        return;
    }
    let inside = holds(a.data, a.stride, [size; 2]) && holds(out, ldo, [size; 2]);
    assert!(inside, "a matrix ends before the last of its entries");
    for j in 0..size {
        let (at, from, rows) = (j * ldo + j, j * a.stride + j, size - j);
        // SAFETY: both slices are column j from the diagonal on, and this column was found to be in bounds.
        let (to, x) = unsafe { (out.get_unchecked_mut(at..at + rows), a.data.get_unchecked(from..from + rows)) };
        copy::<V>(to, x);
    }
}

/// Computes OUT = Aᵀ; A has `rows` rows and `columns` columns. This function is inlined.
#[inline(always)]
pub fn transpose_block<V: Vector>(out: &mut [f64], ldo: usize, a: View<'_>, shape: [usize; 2]) {
    transposed::<V, false>(out, ldo, a, shape);
}

/// Computes OUT = Aᵀ, or OUT = −Aᵀ with NEGATED.
#[inline(always)]
fn transposed<V: Vector, const NEGATED: bool>(out: &mut [f64], ldo: usize, a: View<'_>, [rows, columns]: [usize; 2]) {
    if columns == 0 {
        return;
    }
    if rows < V::N || columns < V::N {
        for j in 0..columns {
            for i in 0..rows {
                let x = a.data[j * a.stride + i];
                out[i * ldo + j] = if NEGATED { -x } else { x };
            }
        }
        return;
    }
    let inside = holds(a.data, a.stride, [rows, columns]) && holds(out, ldo, [columns, rows]);
    assert!(inside, "a matrix ends before the last of its entries");
    // A is transposed in square blocks. The last block may overlap the block before it.
    let mut j = 0;
    loop {
        let mut i = 0;
        loop {
            // SAFETY: the rows and columns of a block are within the matrix, which is in bounds.
            unsafe { move_transposed::<V, NEGATED>(out, i * ldo + j, ldo, a.data, j * a.stride + i, a.stride) };
            if i + V::N >= rows {
                break;
            }
            i = (i + V::N).min(rows - V::N);
        }
        if j + V::N >= columns {
            break;
        }
        j = (j + V::N).min(columns - V::N);
    }
}
