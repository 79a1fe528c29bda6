//! Inverse of a small symmetric matrix without factorization.

use condyle_spatial::{Dense, DenseMatrix, Scalar};

/// Computes X = M⁻¹ for at most `MOST` rows, in place in a copy A of M. For k = 0, 1, …, with the pivot d = 1/A_kk and
/// column c of the pivot:
///
/// ```text
/// A_ij ← A_ij − c_i d c_j,    A_ik ← c_i d,    A_kk ← −d:     from M to −M⁻¹
/// ```
///
/// Only the lower triangle of A is read. For scalars with SIMD lanes, only this triangle is computed. For single
/// numbers, whole columns are computed, including column k. A whole column fits in one register, and the loop needs no
/// exception for column k.
#[inline(always)]
pub fn gauss_jordan<S: Scalar, const MOST: usize>(
    M: &DenseMatrix<S, impl Dense<S>>,
    X: &mut DenseMatrix<S, impl Dense<S>>,
) {
    let n = X.nrows();
    assert!(M.nrows() == n && n <= MOST, "M: expected {n} × {n}, found {:?}", M.shape());
    let mut A = [[S::zero(); MOST]; MOST]; // stored column by column
    for (column, from) in A.iter_mut().zip(M.as_slice().chunks_exact(n.max(1))) {
        column[..n].copy_from_slice(from);
    }
    for k in 0..n {
        let (mut c, d) = (A[k], A[k][k].recip());
        for i in 0..k {
            c[i] = A[i][k];
        }
        let mut scaled = c;
        for i in 0..MOST {
            scaled[i] = c[i] * d;
        }
        for j in (0..n).filter(|&j| j != k || S::LANES == 1) {
            let (factor, rows) = (-scaled[j], if S::LANES == 1 { 0..MOST } else { j..n });
            for i in rows {
                A[j][i] = c[i].mul_add(factor, A[j][i]);
            }
        }
        for j in 0..k {
            A[j][k] = scaled[j];
        }
        A[k] = scaled;
        A[k][k] = -d;
    }
    for j in 0..n {
        for i in j..n {
            (X[(i, j)], X[(j, i)]) = (-A[j][i], -A[j][i]);
        }
    }
}
