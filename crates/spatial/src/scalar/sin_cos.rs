//! Sine and cosine of floats and of SIMD lanes. Both use the same sequence of sums and products without branches, so a
//! lane and a single number give the same bits.
//!
//! The argument is split into x = n π/2 + r with |r| ≤ π/4. n π/2 is subtracted in three parts (Cody and Waite,
//! *Software manual for the elementary functions*, 1980). The product of n with each part except the last is exact,
//! because these parts are short. Sine and cosine of r are polynomials with the coefficients of Moshier's Cephes
//! library. In `f64`, for |x| up to 1e5, the error is at most 2.3e-16. The sine of −0 is 0.

use super::Scalar;
use super::number::Number;
use super::platform::Platform;

/// Constants for one floating-point precision.
struct Precision<const T: usize> {
    /// Three parts whose sum is π/2, the largest first.
    parts: [f64; 3],
    /// Constant 1.5 · 2ᵐ, where m is the number of fraction bits of the format. Adding this constant to a number and
    /// subtracting it again rounds the number to an integer.
    magic: f64,
    /// Coefficients of (sin r − r)/r³ as a polynomial in r², highest power first.
    sin: [f64; T],
    /// Coefficients of (cos r − 1 + r²/2)/r⁴ as a polynomial in r², highest power first.
    cos: [f64; T],
}

const DOUBLE: Precision<6> = Precision {
    parts: [1.570_796_251_296_997, 7.549_789_415_861_596e-8, 5.390_302_858_158_119e-15],
    magic: 6_755_399_441_055_744.0,
    sin: [
        1.589_623_015_765_465_6e-10,
        -2.505_074_776_285_780_7e-8,
        2.755_731_362_138_572_2e-6,
        -1.984_126_982_958_954e-4,
        8.333_333_333_322_118e-3,
        -1.666_666_666_666_663e-1,
    ],
    cos: [
        -1.135_853_652_138_768_2e-11,
        2.087_570_084_197_473e-9,
        -2.755_731_417_929_674e-7,
        2.480_158_728_885_170_4e-5,
        -1.388_888_888_887_305_6e-3,
        4.166_666_666_666_659_5e-2,
    ],
};

const SINGLE: Precision<3> = Precision {
    parts: [1.570_312_5, 4.837_512_969_970_703e-4, 7.549_789_954_891_882e-8],
    magic: 12_582_912.0,
    sin: [-1.951_529_589_1e-4, 8.332_160_873_6e-3, -1.666_665_461_1e-1],
    cos: [2.443_315_711_809_948e-5, -1.388_731_625_493_765e-3, 4.166_664_568_298_827e-2],
};

/// Evaluates the polynomial with coefficients c, highest power first, at each z.
#[inline(always)]
fn polynomial<S: Scalar, const T: usize, const N: usize>(c: &[f64; T], z: [S; N]) -> [S; N] {
    let mut sum = [S::splat(c[0]); N];
    for &c in &c[1..] {
        for k in 0..N {
            sum[k] = sum[k].mul_add(z[k], S::splat(c));
        }
    }
    sum
}

#[inline(always)]
fn reduced<S: Scalar, const T: usize, const N: usize>(x: [S; N], of: &Precision<T>) -> ([S; N], [S; N]) {
    let (one, magic, to_quadrants) = (S::one(), S::splat(of.magic), S::splat(core::f64::consts::FRAC_2_PI));
    let (mut n, mut r, mut z) = (x, x, x);
    for k in 0..N {
        n[k] = (x[k] * to_quadrants + magic) - magic; // rounded to an integer
        for part in of.parts {
            r[k] = n[k].mul_add(S::splat(-part), r[k]); // r = x − n π/2
        }
        z[k] = r[k] * r[k];
    }
    let (mut sin, mut cos) = (polynomial(&of.sin, z), polynomial(&of.cos, z));
    for k in 0..N {
        let (r, z) = (r[k], z[k]);
        let s = (sin[k] * z).mul_add(r, r); // r + r³ P(r²)
        let c = (cos[k] * z).mul_add(z, z.mul_add(S::splat(-0.5), one)); // 1 − r²/2 + r⁴ Q(r²)
        // m is the quadrant: n modulo 4, between −2 and 2.
        let m = (n[k].mul_add(S::splat(0.25), magic) - magic).mul_add(S::splat(-4.0), n[k]);
        // One of cos(m π/2) and sin(m π/2) is 0 and the other is ±1, so products with them are exact.
        let along = one - m.abs();
        let across = m.mul_add(along, m);
        sin[k] = across.mul_add(c, along * s);
        cos[k] = along.mul_add(c, -(across * s));
    }
    (sin, cos)
}

macro_rules! number {
    ($float:ident: $precision:ident up to $largest:literal) => {
        impl Number for $float {
            /// Largest |x| for which the three parts of π/2 are exact enough.
            const LARGEST: f64 = $largest;

            #[inline(always)]
            fn near<S: Scalar, const N: usize>(x: [S; N]) -> ([S; N], [S; N]) {
                reduced(x, &$precision)
            }
            #[inline(always)]
            fn far(self) -> (Self, Self) {
                Platform::sine_cosine(self)
            }
        }
    };
}
number!(f64: DOUBLE up to 1e5);
number!(f32: SINGLE up to 8192.0);
