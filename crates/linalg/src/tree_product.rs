//! Products X = −A B of square matrices. The zeros in the columns of B follow a tree.
#![allow(unsafe_code)]

use crate::axpy::axpy;
use crate::cast::{as_f64, as_f64_mut};
use crate::registers::{Narrow, Wide};
use crate::sparsity::NonzeroRows;
use condyle_spatial::Scalar;
use condyle_spatial::block::Block;
use condyle_spatial::gate::{Kernel, Level, level};
use condyle_spatial::kernel;
use core::marker::PhantomData;
use core::ops::Range;

/// Computes C = −A B, where column j of B is zero except in the rows of `nonzero_rows[j]`.
///
/// Four columns with the same rows, for example columns of one limb, are computed together. A group of their entries
/// stays in registers while the sums accumulate. For other columns, terms of four columns of A are added at once, so
/// each sum is loaded and stored only once per four terms.
#[inline(always)]
pub fn neg_product<S: Scalar>(A: &[S], B: &[S], C: &mut [S], nonzero_rows: &[NonzeroRows]) {
    minus_block_product(A, B, C, nonzero_rows, 0..nonzero_rows.len());
}

/// Computes the diagonal block `block` of C = −A B. In the columns of this block, B must be zero outside the rows of
/// the block.
#[inline(always)]
pub fn minus_block_product<S: Scalar>(
    A: &[S],
    B: &[S],
    C: &mut [S],
    nonzero_rows: &[NonzeroRows],
    block: Range<usize>,
) {
    let (n, mut j) = (nonzero_rows.len(), block.start);
    let Range { start, end } = block;
    while j < end {
        let NonzeroRows { rows, same_pattern } = &nonzero_rows[j];
        let many = if *same_pattern >= 4 { 4 } else { 1 };
        let (b, c) = (&B[j * n..(j + many) * n], &mut C[j * n..(j + many) * n]);
        match (many, size_of::<S>()) {
            (4, 64..) => four_columns::<S, 4>(A, b, c, rows, [n, start, end]),
            (4, 16..) => four_columns::<S, 2>(A, b, c, rows, [n, start, end]),
            (4, _) => four_columns::<S, 8>(A, b, c, rows, [n, start, end]),
            _ => {
                c[start..end].fill(S::zero());
                subtract_column(A, b, c, rows, start..end);
            }
        }
        j += many;
    }
}

/// Computes [`neg_product`] for two matrices B and one symmetric A. It reads A only once for both matrices. It is used
/// for scalars with lanes, whose matrices are too large for the L1 cache.
#[inline(always)]
fn neg_product_twice<S: Scalar>(A: &[S], B: [&[S]; 2], [C0, C1]: [&mut [S]; 2], nonzero_rows: &[NonzeroRows]) {
    let (n, mut j) = (nonzero_rows.len(), 0);
    while j < n {
        let NonzeroRows { rows, same_pattern } = &nonzero_rows[j];
        let many = (*same_pattern).min(4);
        let columns = j * n..(j + many) * n;
        let B = [&B[0][columns.clone()], &B[1][columns.clone()]];
        let C = [&mut C0[columns.clone()], &mut C1[columns]];
        let rows = Inside::new(rows, n);
        // M columns and N rows are chosen so that sums and operands fill the vector registers. There are 32 registers
        // of eight numbers, or 16 registers of four numbers.
        match (many, size_of::<S>()) {
            (4, 64..) => twice::<S, 4, 2>(A, B, C, rows),
            (4, _) => twice::<S, 4, 1>(A, B, C, rows),
            (3, 64..) => twice::<S, 3, 2>(A, B, C, rows),
            (3, _) => twice::<S, 3, 1>(A, B, C, rows),
            (2, 64..) => twice::<S, 2, 4>(A, B, C, rows),
            (2, _) => twice::<S, 2, 2>(A, B, C, rows),
            _ => twice::<S, 1, 4>(A, B, C, rows),
        }
        j += many;
    }
}

/// Row indices that were checked to be below n.
#[derive(Clone, Copy)]
struct Inside<'a> {
    rows: &'a [usize],
    n: usize,
}

impl<'a> Inside<'a> {
    /// Checks that each row index is below n.
    #[inline(always)]
    fn new(rows: &'a [usize], n: usize) -> Self {
        let mut last = 0;
        for &k in rows {
            last = last.max(k);
        }
        assert!(last < n, "a row index is too large");
        Self { rows, n }
    }
}

/// Returns entry k of a column of n numbers.
///
/// # Safety
/// k is one of the rows of an [`Inside`] that was checked against the length of `column`.
#[inline(always)]
unsafe fn entry<T: Copy>(column: &[T], k: usize) -> T {
    debug_assert!(k < column.len());
    // SAFETY: guaranteed by the caller.
    unsafe { *column.get_unchecked(k) }
}

/// Computes the sums of `subtract_column` for M columns and N rows at a time. A is symmetric, so its columns are read
/// as rows.
#[inline(always)]
fn twice<S: Scalar, const M: usize, const N: usize>(A: &[S], B: [&[S]; 2], C: [&mut [S]; 2], rows: Inside<'_>) {
    let (Inside { rows, n }, [B0, B1], [C0, C1]) = (rows, B, C);
    let mut b = [[&B0[..n]; 2]; M];
    for x in 0..M {
        b[x] = [&B0[x * n..][..n], &B1[x * n..][..n]];
    }
    let mut i = 0;
    while i < n {
        let mut a = [&A[..n]; N];
        for y in 0..N {
            a[y] = &A[(i + y).min(n - 1) * n..][..n];
        }
        let mut c = [[[S::zero(); 2]; M]; N];
        for &k in rows {
            // SAFETY: `k` is one of the rows, and all columns have n numbers.
            unsafe {
                let mut minus_a = [S::zero(); N];
                for y in 0..N {
                    minus_a[y] = -entry(a[y], k);
                }
                for x in 0..M {
                    for z in 0..2 {
                        let b = entry(b[x][z], k);
                        for y in 0..N {
                            c[y][x][z] = minus_a[y].mul_add(b, c[y][x][z]);
                        }
                    }
                }
            }
        }
        for y in 0..N.min(n - i) {
            for x in 0..M {
                C0[x * n + i + y] = c[y][x][0];
                C1[x * n + i + y] = c[y][x][1];
            }
        }
        i += N;
    }
}

/// Computes c −= A b on the rows `of_c` of c, where b is zero except in the rows `rows`.
#[inline(always)]
pub fn subtract_column<S: Scalar>(A: &[S], b: &[S], c: &mut [S], rows: &[usize], of_c: Range<usize>) {
    let (n, A) = (c.len(), &A[of_c.start..]);
    let c = &mut c[of_c];
    let m = c.len();
    let (fours, rest) = rows.as_chunks::<4>();
    for &[k0, k1, k2, k3] in fours {
        let (a0, a1) = (&A[k0 * n..k0 * n + m], &A[k1 * n..k1 * n + m]);
        let (a2, a3) = (&A[k2 * n..k2 * n + m], &A[k3 * n..k3 * n + m]);
        let (b0, b1, b2, b3) = (-b[k0], -b[k1], -b[k2], -b[k3]);
        for i in 0..m {
            c[i] = a3[i].mul_add(b3, a2[i].mul_add(b2, a1[i].mul_add(b1, a0[i].mul_add(b0, c[i]))));
        }
    }
    for &k in rest {
        axpy(-b[k], &A[k * n..k * n + m], c);
    }
}

/// Computes the sums of `subtract_column` for four columns. The order of the terms is the same as in `subtract_column`,
/// so the results have the same bits.
#[inline(always)]
fn four_columns<S: Scalar, const N: usize>(A: &[S], B: &[S], C: &mut [S], rows: &[usize], [n, start, end]: [usize; 3]) {
    let (b0, b1, b2, b3) = (&B[..n], &B[n..2 * n], &B[2 * n..3 * n], &B[3 * n..4 * n]);
    let mut i = start;
    while i + N <= end {
        let mut c = [[S::zero(); N]; 4];
        for &k in rows {
            let a = &A[k * n + i..k * n + i + N];
            let b = [-b0[k], -b1[k], -b2[k], -b3[k]];
            for y in 0..4 {
                for x in 0..N {
                    c[y][x] = a[x].mul_add(b[y], c[y][x]);
                }
            }
        }
        for y in 0..4 {
            C[y * n + i..y * n + i + N].copy_from_slice(&c[y]);
        }
        i += N;
    }
    while i < end {
        let mut c = [S::zero(); 4];
        for &k in rows {
            let a = A[k * n + i];
            let b = [-b0[k], -b1[k], -b2[k], -b3[k]];
            for y in 0..4 {
                c[y] = a.mul_add(b[y], c[y]);
            }
        }
        for y in 0..4 {
            C[y * n + i] = c[y];
        }
        i += 1;
    }
}

/// Computes X = −A B for two matrices B and one symmetric A. Column j of each B is zero except in the rows of
/// `nonzero_rows[j]`.
#[inline]
pub fn neg_products<S: Scalar>(A: &[S], B: [&[S]; 2], X: [&mut [S]; 2], nonzero_rows: &[NonzeroRows]) {
    let [X0, X1] = X;
    if nonzero_rows.len() >= 4
        && level() > Level::Baseline
        && let (Some(A), Some(B0), Some(B1)) = (as_f64(A), as_f64(B[0]), as_f64(B[1]))
        && let (Some(X0), Some(X1)) = (as_f64_mut(X0), as_f64_mut(X1))
    {
        return in_registers(A, [B0, B1], [X0, X1], nonzero_rows);
    }
    run_serially(A, B, [X0, X1], nonzero_rows);
}

kernel! {
    /// Computes [`minus_products`] for any scalar, one entry after another.
    fn run_serially<S>(A: &[S], B: [&[S]; 2], X: [&mut [S]; 2], nonzero_rows: &[NonzeroRows]) {
        if S::LANES > 1 {
            neg_product_twice(A, B, X, nonzero_rows);
        } else {
            let [X0, X1] = X;
            for (B, X) in [(B[0], X0), (B[1], X1)] {
                neg_product(A, B, X, nonzero_rows);
            }
        }
    }
}

/// Computes [`minus_products`] for `f64`, in the vector registers of the SIMD level.
fn in_registers(A: &[f64], B: [&[f64]; 2], X: [&mut [f64]; 2], nonzero_rows: &[NonzeroRows]) {
    if level() >= Level::Avx512 && nonzero_rows.len() >= 8 {
        Wide::enter(InRegisters::<Wide> { A, B, X, nonzero_rows, vector: PhantomData });
    } else {
        Narrow::enter(InRegisters::<Narrow> { A, B, X, nonzero_rows, vector: PhantomData });
    }
}

/// Number of columns of B that are computed together.
const SIDE: usize = 4;
/// Number of operations that the processor executes at the same time. A loop with fewer independent sums takes as long
/// as a loop with this number of sums.
const UNDER_WAY: usize = 8;

/// Implements [`minus_products`] in vector registers.
///
/// The sums of a group of rows in up to four columns of X accumulate in registers. `run` selects the number of rows in
/// a group. The last group ends at the last row and may overlap the group before it; entries in the overlap are
/// computed twice. The terms of each entry are added in the same order as in `neg_product`.
struct InRegisters<'a, V> {
    A: &'a [f64],
    B: [&'a [f64]; 2],
    X: [&'a mut [f64]; 2],
    nonzero_rows: &'a [NonzeroRows],
    vector: PhantomData<V>,
}

impl<V: Block<Number = f64>> Kernel for InRegisters<'_, V> {
    #[inline(always)]
    fn run(mut self) {
        let n = self.nonzero_rows.len();
        // Selects the number of vectors of a column that stay in registers, such that the number of operations is
        // smallest. In case of a tie, selects the largest number of vectors.
        let (mut best, mut least) = (1, usize::MAX);
        for many in 1..=3 {
            let cost = n.div_ceil(many * V::LANES) * UNDER_WAY.max(many * SIDE);
            if many * V::LANES <= n && cost <= least {
                (best, least) = (many, cost);
            }
        }
        match best {
            1 => self.all::<1>(),
            2 => self.all::<2>(),
            _ => self.all::<3>(),
        }
    }
}

impl<V: Block<Number = f64>> InRegisters<'_, V> {
    #[inline(always)]
    fn all<const N: usize>(&mut self) {
        let mut j = 0;
        while j < self.nonzero_rows.len() {
            let NonzeroRows { rows, same_pattern } = &self.nonzero_rows[j];
            // Index k counts the columns j, …, j + `same` − 1 of the first matrix, then the same columns of the second
            // matrix.
            let (same, mut k) = (*same_pattern, 0);
            let rows = Inside::new(rows, self.nonzero_rows.len());
            while k < 2 * same {
                let at = |k: usize| (k / same, j + k % same);
                match 2 * same - k {
                    4.. => self.columns::<4, N>([at(k), at(k + 1), at(k + 2), at(k + 3)], rows),
                    2.. => self.columns::<2, N>([at(k), at(k + 1)], rows),
                    _ => self.columns::<1, N>([at(k)], rows),
                }
                k += if 2 * same - k >= 4 { 4 } else { 2 };
            }
            j += same;
        }
    }

    /// Computes M columns of X; `which` contains the index of the matrix and the index of the column for each.
    #[inline(always)]
    fn columns<const M: usize, const N: usize>(&mut self, which: [(usize, usize); M], rows: Inside<'_>) {
        let (Inside { rows, n }, wide) = (rows, N * V::LANES);
        let (A, mut b) = (&self.A[..n * n], [&self.B[0][..n]; M]);
        for m in 0..M {
            b[m] = &self.B[which[m].0][which[m].1 * n..][..n];
        }
        let mut i = 0;
        while i < n {
            let start = i.min(n - wide);
            let mut sums = [[V::zero(); N]; M];
            for &k in rows {
                debug_assert!(k * n + start + wide <= A.len());
                // SAFETY: `k` is one of the rows of A, which has n columns of n numbers, and start + wide ≤ n.
                let column = unsafe { A.get_unchecked(k * n + start..k * n + start + wide) };
                let mut minus_a = [V::zero(); N];
                for x in 0..N {
                    minus_a[x] = -V::load(&column[x * V::LANES..]);
                }
                for m in 0..M {
                    // SAFETY: `k` is one of the rows, and the column has n numbers.
                    let b = V::splat(unsafe { entry(b[m], k) });
                    for x in 0..N {
                        sums[m][x] = minus_a[x].mul_add(b, sums[m][x]);
                    }
                }
            }
            for m in 0..M {
                let X = &mut self.X[which[m].0][which[m].1 * n + start..][..wide];
                for x in 0..N {
                    sums[m][x].store(&mut X[x * V::LANES..]);
                }
            }
            i += wide;
        }
    }
}
