//! tanh and exp of a [`Scalar`], computed with the arithmetic of the scalar. So floats, lanes and dual numbers use the
//! same source code. The logarithm of an `f64` comes from the platform.

use crate::scalar::Scalar;

/// Bound on |x| above which tanh x is ±1 to the last bit of an `f64`.
const SATURATED: f64 = 20.0;
/// Number of times that an argument is halved before its series is summed.
const HALVINGS: u32 = 6;
/// Factor 1/64: an argument is multiplied by this factor before its series is summed.
const SCALE: f64 = 1.0 / (1u32 << HALVINGS) as f64;

/// Computes tanh x, with an error of a few units in the last place of x. It evaluates a continued fraction at x/64 and
/// then applies tanh 2y = 2 tanh y / (1 + tanh² y) six times. This doubling does not amplify relative errors. Beyond
/// ±20, the result is ±1 and its derivative is 0.
#[inline(always)]
pub fn tanh<S: Scalar>(x: S) -> S {
    let inside = x.abs().lt(S::splat(SATURATED));
    let y = S::select(inside, x, S::zero()) * S::splat(SCALE);
    let t = y * y;
    // Evaluates Lambert's (1768) continued fraction y/(1 + y²/(3 + y²/(5 + … y²/13))) as one quotient of polynomials.
    let above = (t + S::splat(378.0)).mul_add(t, S::splat(17_325.0)).mul_add(t, S::splat(135_135.0));
    let below = t.mul_add(S::splat(28.0), S::splat(3150.0));
    let below = below.mul_add(t, S::splat(62_370.0)).mul_add(t, S::splat(135_135.0));
    let mut tanh = y * above / below;
    for _ in 0..HALVINGS {
        tanh = (tanh + tanh) / tanh.mul_add(tanh, S::one());
    }
    S::select(inside, tanh, S::select(x.lt(S::zero()), -S::one(), S::one()))
}

/// Computes exp x for |x| up to 64, with an error of about 1 + |x| units in the last place. It sums the series of
/// exp(x/64) − 1 and then applies e²ʸ − 1 = (eʸ − 1)(2 + (eʸ − 1)) six times.
#[inline(always)]
pub fn exp<S: Scalar>(x: S) -> S {
    let negative = x.lt(S::zero());
    let y = S::select(negative, -x, x) * S::splat(SCALE);
    let mut sum = S::one();
    for k in (2..=18).rev() {
        sum = (y * S::splat(1.0 / f64::from(k))).mul_add(sum, S::one()); // (eʸ − 1)/y = 1 + y/2 (1 + y/3 (1 + …))
    }
    let mut expm1 = y * sum;
    for _ in 0..HALVINGS {
        expm1 = expm1 * (expm1 + S::splat(2.0));
    }
    let exp = expm1 + S::one();
    S::select(negative, exp.recip(), exp)
}

/// Computes ln x.
pub fn ln(x: f64) -> f64 {
    #[cfg(feature = "std")]
    return x.ln();
    #[cfg(not(feature = "std"))]
    return libm::log(x);
}
