//! Sums over vectors: y += s x and xᵀ y.

use condyle_spatial::Scalar;

/// Computes y += s x.
#[inline(always)]
pub fn axpy<S: Scalar>(s: S, x: &[S], y: &mut [S]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y = x.mul_add(s, *y);
    }
}

/// Computes Σ xₖ yₖ as four independent partial sums, so that the four additions of a step are independent of each
/// other.
#[inline(always)]
pub fn dot<S: Scalar>(x: &[S], y: &[S]) -> S {
    let n = x.len();
    let y = &y[..n];
    let mut sums = [S::zero(); 4];
    let mut k = 0;
    while k + 4 <= n {
        for j in 0..4 {
            sums[j] = x[k + j].mul_add(y[k + j], sums[j]);
        }
        k += 4;
    }
    for k in k..n {
        sums[0] = x[k].mul_add(y[k], sums[0]);
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
