//! Dense factorization M = L Lᵀ on any scalar, column-major, with L in the lower triangle.
//!
//! Source: Golub and Van Loan, *Matrix Computations* (4th edition), algorithm 4.2.1, column by column.

use crate::axpy::{axpy, dot};
use crate::check;
use condyle_spatial::{Dense, DenseMatrix, Matrix, Scalar, matrix, same_layout};

/// Replaces the lower triangle of M by L, as long as `go_on` returns `true`. Returns whether L is complete.
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
            axpy(-other[0], other, column); // column j of M minus L_jk times column k of L
        }
        let r = column[0].sqrt().recip();
        for x in column {
            *x = *x * r;
        }
    }
    true
}

/// Solves L Lᵀ x = b in place.
#[inline(always)]
fn solve<S: Scalar>(L: &[S], b: &mut [S]) {
    forward(L, b, 0);
    backward(L, b, 0);
}

/// Solves L y = b in place, where b is zero before index `start`.
#[inline(always)]
fn forward<S: Scalar>(L: &[S], b: &mut [S], start: usize) {
    let n = b.len();
    for j in start..n {
        let (x, rest) = b[j..].split_first_mut().expect("j < n");
        *x = *x / L[j * n + j];
        axpy(-*x, &L[j * n + j + 1..(j + 1) * n], rest);
    }
}

/// Solves Lᵀ x = y in place, for the entries of x from index `end` on.
#[inline(always)]
fn backward<S: Scalar>(L: &[S], b: &mut [S], end: usize) {
    let n = b.len();
    for j in (end..n).rev() {
        let x = b[j] - dot(&L[j * n + j + 1..(j + 1) * n], &b[j + 1..]);
        b[j] = x / L[j * n + j];
    }
}

/// Factorization M = L Lᵀ of any symmetric positive definite matrix.
///
/// [`factorize`](Self::factorize) and [`inverse`](Self::inverse) cost O(n³), [`solve`](Self::solve) costs O(n²).
/// [`new`](Self::new) allocates all memory. Source: Golub and Van Loan, algorithm 4.2.1. For the inertia matrix of a
/// robot, [`Ltdl`](crate::Ltdl) has the same methods and skips the zeros of the matrix.
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
    /// Factor L, in the lower triangle. Shape: n × n for a matrix of n rows. Written by: `factorize`.
    L: Matrix<S>,
}

same_layout!(Cholesky { L });

impl<S: Scalar> Cholesky<S> {
    /// Maximum number of rows n. With this many rows, a factor of `f64` numbers takes 128 MiB.
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

    /// Returns L, in the lower triangle. Entries above the diagonal have no meaning.
    pub fn lower(&self) -> &Matrix<S> {
        &self.L
    }

    /// Factorizes M = L Lᵀ, in O(n³). Only the lower triangle is read.
    ///
    /// M: n × n, symmetric, positive definite. If M is not positive definite, at least one entry of L is not finite.
    /// Allocates nothing.
    ///
    /// # Panics
    /// If `M` is not n × n.
    #[inline(always)]
    #[track_caller]
    pub fn factorize(&mut self, M: &DenseMatrix<S, impl Dense<S>>) {
        self.factorize_while(M, || true);
    }

    /// Factorizes as [`factorize`](Self::factorize) does, and calls `go_on` before each column. Stops if `go_on`
    /// returns `false`. Returns whether the factorization is complete.
    #[doc(hidden)]
    #[inline(always)]
    #[track_caller]
    pub fn factorize_while(&mut self, M: &DenseMatrix<S, impl Dense<S>>, go_on: impl FnMut() -> bool) -> bool {
        let n = self.L.nrows();
        assert!(M.shape() == (n, n), "M: expected {n} × {n}, found {:?}", M.shape());
        self.L.copy_from(M);
        factorize(self.L.as_mut_slice(), n, go_on)
    }

    /// Solves M x = b in place for the factorized n × n matrix M, in O(n²).
    ///
    /// b: n numbers, overwritten with x. Allocates nothing.
    ///
    /// # Panics
    /// If `b` does not have n numbers.
    #[inline(always)]
    #[track_caller]
    pub fn solve(&self, b: &mut [S]) {
        check("b", b.len(), self.L.nrows());
        solve(self.L.as_slice(), b);
    }

    /// Solves M X = B in place for the factorized n × n matrix M, column by column, each in O(n²).
    ///
    /// B: n rows, any number of columns, overwritten with X. Allocates nothing.
    ///
    /// # Panics
    /// If `B` does not have n rows.
    #[inline(always)]
    #[track_caller]
    pub fn solve_matrix(&self, B: &mut DenseMatrix<S, impl Dense<S>>) {
        check("B", B.nrows(), self.L.nrows());
        for column in B.as_mut_slice().chunks_exact_mut(self.L.nrows().max(1)) {
            solve(self.L.as_slice(), column);
        }
    }

    /// Computes X = M⁻¹ for the factorized n × n matrix M, in O(n³). X is the full symmetric matrix.
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

    /// Inverts as [`inverse`](Self::inverse) does, and calls `go_on` before each column. Stops if `go_on` returns
    /// `false`. Returns whether X is complete.
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
            backward(L, column, j); // computes the rows from j on; the rows above follow by symmetry
        }
        for j in 0..n {
            for k in 0..j {
                X[j * n + k] = X[k * n + j];
            }
        }
        true
    }
}
