//! Solution of a small symmetric system of equations. A column of its matrix fits in one register.

use condyle_spatial::{Dense, DenseMatrix, Scalar};

/// Solves M x = b for at most `MOST` rows; b is overwritten with x.
///
/// Computes M = L D Lᵀ column by column and, in the same loop, y = L⁻¹ b:
///
/// ```text
/// l = A_k / d_k,    A_j ← A_j − l_j A_k  (j > k),    y ← y − y_k l,    z_k = y_k / d_k
/// x_k = z_k − Σ l_ik x_i  (i > k)
/// ```
///
/// Whole columns are computed, so loops have no remainder. The entries above the diagonal are never read. M must be
/// positive definite: there is no pivoting. Source: Golub and Van Loan, *Matrix Computations* (4th edition), section
/// 4.1.
#[inline(always)]
pub fn small_solve<S: Scalar, const MOST: usize>(M: &DenseMatrix<S, impl Dense<S>>, b: &mut [S]) {
    let n = b.len();
    assert!(M.shape() == (n, n) && n <= MOST, "M: expected {n} × {n}, at most {MOST}, found {:?}", M.shape());
    let mut A = [[S::zero(); MOST]; MOST]; // columns of M, which become the columns of L
    for (column, from) in A.iter_mut().zip(M.as_slice().chunks_exact(n.max(1))) {
        column[..n].copy_from_slice(from);
    }
    let mut y = [S::zero(); MOST];
    y[..n].copy_from_slice(b);
    for k in 0..n {
        let (column, d) = (A[k], A[k][k].recip());
        let mut l = column;
        l.iter_mut().for_each(|x| *x = *x * d);
        for (j, A_j) in A.iter_mut().enumerate().take(n).skip(k + 1) {
            for i in 0..MOST {
                A_j[i] = column[i].mul_add(-l[j], A_j[i]);
            }
        }
        b[k] = y[k] * d;
        let y_k = y[k];
        for i in 0..MOST {
            y[i] = l[i].mul_add(-y_k, y[i]);
        }
        A[k] = l;
    }
    for k in (0..n).rev() {
        for i in k + 1..n {
            b[k] = A[k][i].mul_add(-b[i], b[k]);
        }
    }
}
