//! The dense factorisation M = L Lᵀ on any scalar, stored by columns, L in the lower triangle.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (4th edition), algorithm 4.2.1, column by column.

use crate::axpy::{axpy, dot};
use crate::check;
use condyle_spatial::{Dense, DenseMatrix, Matrix, Scalar, alike, matrix};

/// L in place of the lower triangle of M, as long as it is to go on; says whether it is done.
#[inline(always)]
fn factorize<S: Scalar>(M: &mut [S], n: usize, mut go_on: impl FnMut() -> bool) -> bool {
    for j in 0..n {
        if !go_on() {
            return false;
        }
        let (left, rest) = M.split_at_mut(j * n);
        let column = &mut rest[j..n];
        for k in 0..j {
            let other = &left[k * n + j..(k + 1) * n];
            axpy(-other[0], other, column); // M_ij − Σ L_ik L_jk
        }
        let r = column[0].sqrt().recip();
        for x in column {
            *x = *x * r;
        }
    }
    true
}

/// x in place of b: L Lᵀ x = b.
#[inline(always)]
fn solve<S: Scalar>(L: &[S], b: &mut [S]) {
    forward(L, b, 0);
    backward(L, b, 0);
}

/// y in place of b: L y = b, where b is zero before `start`.
#[inline(always)]
fn forward<S: Scalar>(L: &[S], b: &mut [S], start: usize) {
    let n = b.len();
    for j in start..n {
        let (x, rest) = b[j..].split_first_mut().expect("j < n");
        *x = *x / L[j * n + j];
        axpy(-*x, &L[j * n + j + 1..(j + 1) * n], rest);
    }
}

/// x in place of y from `end` on: Lᵀ x = y.
#[inline(always)]
fn backward<S: Scalar>(L: &[S], b: &mut [S], end: usize) {
    let n = b.len();
    for j in (end..n).rev() {
        let x = b[j] - dot(&L[j * n + j + 1..(j + 1) * n], &b[j + 1..]);
        b[j] = x / L[j * n + j];
    }
}

/// M = L Lᵀ of any symmetric positive definite matrix.
///
/// [`factorize`](Self::factorize) and [`inverse`](Self::inverse) cost O(n³), [`solve`](Self::solve) O(n²). All memory is
/// allocated by [`new`](Self::new). Source: Golub and Van Loan, algorithm 4.2.1. For the inertia matrix of a robot,
/// [`Ltdl`](crate::Ltdl) has the same verbs and uses the zeros.
///
/// ```
/// use condyle_linalg::Cholesky;
/// use nalgebra::dmatrix;
/// let mut factor = Cholesky::new(2);
/// factor.factorize(&dmatrix![4.0, 2.0; 2.0, 5.0]);
/// let mut x = [8.0, 12.0];
/// factor.solve(&mut x);
/// assert_eq!(x, [1.0, 2.0]);
/// ```
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Cholesky<S> {
    /// L, in the lower triangle. Shape: n × n. Written by: `factorize`.
    L: Matrix<S>,
}

alike!(Cholesky { L });

impl<S: Scalar> Cholesky<S> {
    /// The most rows: of doubles, the factor is then 128 MiB.
    pub const MOST_ROWS: usize = 4096;

    /// Allocates the factor of an n × n matrix.
    ///
    /// # Panics
    /// If n is above [`MOST_ROWS`](Self::MOST_ROWS).
    #[track_caller]
    pub fn new(n: usize) -> Self {
        assert!(n <= Self::MOST_ROWS, "n: expected at most {} rows, found {n}", Self::MOST_ROWS);
        Self { L: matrix(n, n, S::zero()) }
    }

    /// L, in the lower triangle; what stands above the diagonal has no meaning.
    pub fn lower(&self) -> &Matrix<S> {
        &self.L
    }

    /// M = L Lᵀ, in O(n³). Only the lower triangle is read.
    ///
    /// M: n × n, symmetric, positive definite; if it is not, some entries of L are not finite. Allocates nothing.
    ///
    /// # Panics
    /// If `M` is not n × n.
    #[inline(always)]
    #[track_caller]
    pub fn factorize(&mut self, M: &DenseMatrix<S, impl Dense<S>>) {
        self.factorize_while(M, || true);
    }

    /// As [`factorize`](Self::factorize), with a function that is asked before each column whether to go on; says whether
    /// the factor is done.
    #[doc(hidden)]
    #[inline(always)]
    #[track_caller]
    pub fn factorize_while(&mut self, M: &DenseMatrix<S, impl Dense<S>>, go_on: impl FnMut() -> bool) -> bool {
        let n = self.L.nrows();
        assert!(M.shape() == (n, n), "M: expected {n} × {n}, found {:?}", M.shape());
        self.L.copy_from(M);
        factorize(self.L.as_mut_slice(), n, go_on)
    }

    /// x = M⁻¹ b in place of b, in O(n²).
    ///
    /// b: n numbers. Allocates nothing.
    ///
    /// # Panics
    /// If `b` has not n numbers.
    #[inline(always)]
    #[track_caller]
    pub fn solve(&self, b: &mut [S]) {
        check("b", b.len(), self.L.nrows());
        solve(self.L.as_slice(), b);
    }

    /// X = M⁻¹ B in place of B, column by column, each in O(n²).
    ///
    /// B: n rows, any number of columns. Allocates nothing.
    ///
    /// # Panics
    /// If `B` has not n rows.
    #[inline(always)]
    #[track_caller]
    pub fn solve_matrix(&self, B: &mut DenseMatrix<S, impl Dense<S>>) {
        check("B", B.nrows(), self.L.nrows());
        for column in B.as_mut_slice().chunks_exact_mut(self.L.nrows().max(1)) {
            solve(self.L.as_slice(), column);
        }
    }

    /// X = M⁻¹, the full symmetric matrix, in O(n³).
    ///
    /// X: n × n, overwritten. Allocates nothing.
    ///
    /// # Panics
    /// If `X` is not n × n.
    #[inline(always)]
    #[track_caller]
    pub fn inverse(&self, X: &mut DenseMatrix<S, impl Dense<S>>) {
        self.inverse_while(X, || true);
    }

    /// As [`inverse`](Self::inverse), with a function that is asked before each column whether to go on; says whether X is
    /// done.
    #[doc(hidden)]
    #[inline(always)]
    #[track_caller]
    pub fn inverse_while(&self, X: &mut DenseMatrix<S, impl Dense<S>>, mut go_on: impl FnMut() -> bool) -> bool {
        let n = self.L.nrows();
        assert!(X.shape() == (n, n), "X: expected {n} × {n}, found {:?}", X.shape());
        let (L, X) = (self.L.as_slice(), X.as_mut_slice());
        for j in 0..n {
            if !go_on() {
                return false;
            }
            let column = &mut X[j * n..(j + 1) * n];
            column.fill(S::zero());
            column[j] = S::one();
            forward(L, column, j);
            backward(L, column, j); // the rows from j on; the others by symmetry
        }
        for j in 0..n {
            for k in 0..j {
                X[j * n + k] = X[k * n + j];
            }
        }
        true
    }
}
