//! Floating-point functions of the platform: they come from the standard library or, without it, from the crate libm.

/// Float with functions that go beyond basic arithmetic.
pub(super) trait Platform: Copy {
    /// Returns self · b + c, rounded once.
    fn fused(self, b: Self, c: Self) -> Self;
    /// Returns √self.
    fn root(self) -> Self;
    /// Returns (sin self, cos self).
    fn sine_cosine(self) -> (Self, Self);
    /// Returns the angle of the point (x, self).
    fn angle(self, x: Self) -> Self;
}

macro_rules! platform {
    ($($float:ident: $fused:ident $root:ident $sine_cosine:ident $angle:ident),*) => {$(
        #[cfg(feature = "std")]
        impl Platform for $float {
            #[inline(always)]
            fn fused(self, b: Self, c: Self) -> Self {
                self.mul_add(b, c)
            }
            #[inline(always)]
            fn root(self) -> Self {
                self.sqrt()
            }
            #[inline(always)]
            fn sine_cosine(self) -> (Self, Self) {
                self.sin_cos()
            }
            #[inline(always)]
            fn angle(self, x: Self) -> Self {
                self.atan2(x)
            }
        }
        #[cfg(not(feature = "std"))]
        impl Platform for $float {
            #[inline(always)]
            fn fused(self, b: Self, c: Self) -> Self {
                libm::$fused(self, b, c)
            }
            #[inline(always)]
            fn root(self) -> Self {
                libm::$root(self)
            }
            #[inline(always)]
            fn sine_cosine(self) -> (Self, Self) {
                libm::$sine_cosine(self)
            }
            #[inline(always)]
            fn angle(self, x: Self) -> Self {
                libm::$angle(self, x)
            }
        }
    )*};
}
platform!(f64: fma sqrt sincos atan2, f32: fmaf sqrtf sincosf atan2f);
