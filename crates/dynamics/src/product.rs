//! X = −A B of single numbers in vector registers, where the columns of B have the zeros of the tree.
//!
//! As many entries of four columns of X as there are registers for stay there while their sums grow. The last of them begin
//! where they still fit, and so are had twice. Each entry is the same sum in the same order as in
//! `aba_derivatives::minus_product`.

use crate::dispatch::{Long, Short, is, renamed};
use condyle_linalg::sparsity::NonzeroRows;
use condyle_spatial::Scalar;
use condyle_spatial::block::Block;
use condyle_spatial::lanes::Kernel;
use condyle_spatial::level::{Level, level};
use core::marker::PhantomData;

/// How many columns of B go together.
const SIDE: usize = 4;
/// How many operations are under way at any time: fewer sums than that take no less time.
const UNDER_WAY: usize = 8;

/// X = −A B for two matrices B, if this is the way to take; whether it is.
#[inline]
pub(crate) fn minus_products<S: Scalar>(A: &[S], B: [&[S]; 2], X: [&mut [S]; 2], coupled: &[NonzeroRows]) -> bool {
    if !is::<S, f64>() || level() == Level::Baseline || coupled.len() < 4 {
        return false;
    }
    // SAFETY: S is f64.
    #[allow(unsafe_code)]
    let (A, B, X): (&[f64], [&[f64]; 2], [&mut [f64]; 2]) = unsafe { (renamed(A), renamed(B), renamed(X)) };
    multiply(A, B, X, coupled);
    true
}

fn multiply(A: &[f64], B: [&[f64]; 2], X: [&mut [f64]; 2], coupled: &[NonzeroRows]) {
    if level() >= Level::Avx512 && coupled.len() >= 8 {
        Long::enter(Products::<Long> { A, B, X, nonzero_rows: coupled, vector: PhantomData });
    } else {
        Short::enter(Products::<Short> { A, B, X, nonzero_rows: coupled, vector: PhantomData });
    }
}

struct Products<'a, V> {
    A: &'a [f64],
    B: [&'a [f64]; 2],
    X: [&'a mut [f64]; 2],
    nonzero_rows: &'a [NonzeroRows],
    vector: PhantomData<V>,
}

impl<V: Block<Number = f64>> Kernel for Products<'_, V> {
    #[inline(always)]
    fn run(mut self) {
        let n = self.nonzero_rows.len();
        // how many vectors of a column stay in registers: for the fewest operations, the most
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

impl<V: Block<Number = f64>> Products<'_, V> {
    #[inline(always)]
    fn all<const N: usize>(&mut self) {
        let mut j = 0;
        while j < self.nonzero_rows.len() {
            let NonzeroRows { rows, same_pattern } = &self.nonzero_rows[j];
            // columns j, …, j + same − 1 of the one matrix, then of the other
            let (same, mut k) = (*same_pattern, 0);
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

    /// Some columns of X: of which matrix, and which.
    #[inline(always)]
    fn columns<const M: usize, const N: usize>(&mut self, which: [(usize, usize); M], rows: &[usize]) {
        let (n, wide) = (self.nonzero_rows.len(), N * V::LANES);
        let mut b = [&self.B[0][..n]; M];
        for m in 0..M {
            b[m] = &self.B[which[m].0][which[m].1 * n..][..n];
        }
        let mut i = 0;
        while i < n {
            let start = i.min(n - wide);
            let mut sums = [[V::zero(); N]; M];
            for &k in rows {
                let column = &self.A[k * n + start..][..wide];
                let mut a = [V::zero(); N];
                for x in 0..N {
                    a[x] = V::load(&column[x * V::LANES..]);
                }
                for m in 0..M {
                    let b = V::splat(-b[m][k]);
                    for x in 0..N {
                        sums[m][x] = a[x].mul_add(b, sums[m][x]);
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
