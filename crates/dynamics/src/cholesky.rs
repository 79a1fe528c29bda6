//! A dense Cholesky factor on any scalar: M = L Lᵀ, stored by columns, L in the lower triangle.

use condyle_spatial::Scalar;

/// L in place of the lower triangle of M.
pub(crate) fn factorize<S: Scalar>(M: &mut [S], n: usize) {
    for j in 0..n {
        let (left, rest) = M.split_at_mut(j * n);
        let column = &mut rest[..n];
        for k in 0..j {
            let x = left[k * n + j];
            for i in j..n {
                column[i] -= left[k * n + i] * x; // M_ij − Σ L_ik L_jk
            }
        }
        let r = column[j].sqrt().recip();
        for x in &mut column[j..] {
            *x = *x * r;
        }
    }
}

/// x in place of b: L Lᵀ x = b.
pub(crate) fn solve<S: Scalar>(L: &[S], b: &mut [S]) {
    let n = b.len();
    for j in 0..n {
        b[j] = b[j] / L[j * n + j];
        for i in j + 1..n {
            let x = b[j];
            b[i] -= L[j * n + i] * x;
        }
    }
    for j in (0..n).rev() {
        for i in j + 1..n {
            let x = b[i];
            b[j] -= L[j * n + i] * x;
        }
        b[j] = b[j] / L[j * n + j];
    }
}
