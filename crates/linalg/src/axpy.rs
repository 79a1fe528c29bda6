//! Sums over vectors: y += s x and xᵀ y.

use condyle_spatial::Scalar;

/// Computes y += s x.
#[inline(always)]
pub fn axpy<S: Scalar>(s: S, x: &[S], y: &mut [S]) {
    for (y, &x) in y.iter_mut().zip(x) {
        *y = x.mul_add(s, *y);
    }
}

/// Computes Σ xₖ yₖ as four partial sums. The four additions of a loop step do not depend on each other, so the
/// processor can execute them at the same time.
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
