//! Dense factorisation A = L U for any scalar type, without row exchanges. Matrices are stored by columns.
//!
//! The variational integrator factorises matrices M + O(h), with the inertia matrix M and the step length h. M is
//! positive definite, so the symmetric part of M + O(h) is positive definite, too, if the step is short. Then
//! elimination without row exchanges is stable (Golub and Van Loan, *Matrix Computations*, section 4.3.2).

use condyle_linalg::axpy::axpy;
use condyle_spatial::Scalar;

/// Replaces A by its factors: U in the upper triangle, and L without its unit diagonal in the lower triangle.
pub(super) fn factorize<S: Scalar>(A: &mut [S], n: usize) {
    for j in 0..n {
        let (left, rest) = A.split_at_mut(j * n);
        let column = &mut rest[..n];
        for k in 0..j {
            let (x, L) = (column[k], &left[k * n..][..n]);
            axpy(-x, &L[k + 1..], &mut column[k + 1..]); // A_ij − Σ L_ik U_kj
        }
        let r = column[j].recip();
        for x in &mut column[j + 1..] {
            *x = *x * r;
        }
    }
}

/// Replaces b by the solution x of L U x = b.
pub(super) fn solve<S: Scalar>(LU: &[S], b: &mut [S]) {
    let n = b.len();
    for j in 0..n {
        let (x, column) = (b[j], &LU[j * n..][..n]);
        axpy(-x, &column[j + 1..], &mut b[j + 1..]);
    }
    for j in (0..n).rev() {
        let column = &LU[j * n..][..n];
        b[j] = b[j] / column[j];
        let x = b[j];
        axpy(-x, &column[..j], &mut b[..j]);
    }
}
