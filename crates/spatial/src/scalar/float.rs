//! `Scalar` for `f64` and `f32`.

use super::Scalar;
use super::number::Number;
use super::platform::Platform;

macro_rules! impl_float {
    ($($float:ident $compiled:literal),*) => {$(
        impl Scalar for $float {
            type Mask = bool;
            const LANES: usize = 1;
            const COMPILED: bool = $compiled;

            #[inline(always)]
            fn splat(x: f64) -> Self {
                x as $float
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // Without the FMA instruction, a fused product is a library call. Such a call takes thirty times as
                // long as a product and a sum, rounded separately.
                if cfg!(any(target_feature = "fma", target_arch = "aarch64")) {
                    Platform::fused(self, b, c)
                } else {
                    self * b + c
                }
            }
            #[inline(always)]
            fn recip(self) -> Self {
                1.0 / self
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Platform::root(self)
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                if $float::abs(self) <= Self::LARGEST as $float {
                    let ([sin], [cos]) = Self::near([self]);
                    return (sin, cos);
                }
                self.far()
            }
            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                Platform::angle(self, x)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $float::abs(self)
            }
            #[inline(always)]
            fn lt(self, other: Self) -> bool {
                self < other
            }
            #[inline(always)]
            fn select(mask: bool, a: Self, b: Self) -> Self {
                if mask { a } else { b }
            }
            #[inline(always)]
            fn and(a: bool, b: bool) -> bool {
                a && b
            }
            #[inline(always)]
            fn or(a: bool, b: bool) -> bool {
                a || b
            }
        }
    )*};
}
impl_float!(f64 true, f32 false);
