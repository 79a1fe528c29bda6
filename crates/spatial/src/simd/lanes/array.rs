//! Lanes for processors whose vector instructions this crate does not support. These lanes are arrays, which the
//! compiler may vectorize. No SIMD level uses them, but with them, code that is written for lanes also compiles on such
//! processors.

use super::{Element, Lanes, Register};
use crate::scalar::number::Number;
use crate::simd::kernel::Kernel;
use crate::simd::pack::SimdToken;

/// Widest vector of `f64`.
pub(crate) type WideF64 = Lanes<f64, 4>;
/// Widest vector of `f32`.
pub(crate) type WideF32 = Lanes<f32, 8>;
impl Element<4> for f64 {
    type Register = [Self; 4];
}
impl Element<8> for f32 {
    type Register = [Self; 8];
}

/// Defines functions that compute lane k of the result from lane k of the arguments.
macro_rules! each {
    ($(fn $name:ident($($x:ident: $type:ty),*) -> $out:ty = [$first:expr; $k:ident => $lane:expr])*) => {$(
        #[inline(always)]
        fn $name($($x: $type),*) -> $out {
            let mut out = [$first; N];
            for $k in 0..N {
                out[$k] = $lane;
            }
            out
        }
    )*};
}

impl<T: Number, const N: usize> Register<T, N> for [T; N] {
    type Mask = [bool; N];

    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        kernel.run();
    }
    #[inline(always)]
    fn any(mask: [bool; N]) -> bool {
        mask != [false; N]
    }
    each! {
        fn load(x: [T; N]) -> Self = [T::zero(); k => x[k]]
        fn store(a: Self) -> [T; N] = [T::zero(); k => a[k]]
        fn splat(x: T) -> Self = [x; _k => x]
        fn zero() -> Self = [T::zero(); _k => T::zero()]
        fn add(a: Self, b: Self) -> Self = [T::zero(); k => a[k] + b[k]]
        fn sub(a: Self, b: Self) -> Self = [T::zero(); k => a[k] - b[k]]
        fn mul(a: Self, b: Self) -> Self = [T::zero(); k => a[k] * b[k]]
        fn div(a: Self, b: Self) -> Self = [T::zero(); k => a[k] / b[k]]
        fn mul_add(a: Self, b: Self, c: Self) -> Self = [T::zero(); k => a[k].mul_add(b[k], c[k])]
        fn sqrt(a: Self) -> Self = [T::zero(); k => a[k].sqrt()]
        fn neg(a: Self) -> Self = [T::zero(); k => -a[k]]
        fn abs(a: Self) -> Self = [T::zero(); k => a[k].abs()]
        fn lt(a: Self, b: Self) -> [bool; N] = [false; k => a[k].lt(b[k])]
        fn select(mask: [bool; N], a: Self, b: Self) -> Self = [T::zero(); k => if mask[k] { a[k] } else { b[k] }]
        fn and(a: [bool; N], b: [bool; N]) -> [bool; N] = [false; k => a[k] && b[k]]
        fn or(a: [bool; N], b: [bool; N]) -> [bool; N] = [false; k => a[k] || b[k]]
    }
}

/// Functions that move numbers between the lanes of a vector of four.
pub mod moves {
    use super::{Lanes, SimdToken};

    /// Assignment of source lanes to target lanes. A target lane without a source becomes 0.
    #[derive(Clone, Copy, Debug)]
    pub struct Move {
        /// Source lane of each target lane; 4 if the target lane has no source.
        from: [usize; 4],
    }

    impl Move {
        /// Creates a move from pairs (source lane, target lane).
        pub fn new(pairs: &[(usize, usize)]) -> Self {
            let mut this = Self { from: [4; 4] };
            for &(from, to) in pairs {
                this.from[to] = from;
            }
            this
        }

        /// Returns the numbers in their new lanes.
        #[inline(always)]
        pub fn apply<W: SimdToken>(&self, x: Lanes<f64, 4>) -> Lanes<f64, 4> {
            let [a, b, c, d] = x.0;
            let numbers = [a, b, c, d, 0.0];
            Lanes(self.from.map(|k| numbers[k]))
        }
    }

    /// Returns the sum of the numbers in every lane: (x₀ + x₂) + (x₁ + x₃).
    #[inline(always)]
    pub fn sum<W: SimdToken>(x: Lanes<f64, 4>) -> Lanes<f64, 4> {
        let [a, b, c, d] = x.0;
        Lanes([(a + c) + (b + d); 4])
    }
}
