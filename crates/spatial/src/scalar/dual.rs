//! `Scalar` for the number types of num-dual: exact derivatives of every function that is generic over [`Scalar`].
//!
//! Dual types can be nested: `Dual<Dual64>` carries second derivatives, and so on. Comparisons use only the real part.

use super::{Constant, Scalar};
use nalgebra::Const;
use num_dual::{Dual, Dual2, Dual3, DualNum, DualVec, HyperDual, HyperHyperDual};

macro_rules! impl_dual {
    ($($dual:ty $(, $n:ident)?);* $(;)?) => {$(
        impl<T: Scalar<Mask = bool> + DualNum $(, const $n: usize)?> Scalar for $dual
        where
            Self: DualNum<InnerDual = T> + Copy,
        {
            type Mask = bool;
            const LANES: usize = T::LANES;

            #[inline]
            fn splat(x: f64) -> Self {
                <Self as DualNum>::from_re(T::splat(x))
            }
            #[inline]
            fn mul_add(self, b: Self, c: Self) -> Self {
                self * b + c
            }
            #[inline]
            fn recip(self) -> Self {
                DualNum::recip(&self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                DualNum::sqrt(&self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                DualNum::sin_cos(&self)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                // Divides the smaller coordinate by the larger one. num-dual's own `atan2` divides by x even if x is 0.
                let steep = Scalar::abs(x.re).lt(Scalar::abs(self.re));
                let mut angle = if steep { -(x / self).atan() } else { (self / x).atan() };
                angle.re = Scalar::atan2(self.re, x.re);
                angle
            }
            #[inline]
            fn abs(self) -> Self {
                if self.re.lt(Scalar::zero()) { -self } else { self }
            }
            #[inline]
            fn lt(self, other: Self) -> bool {
                self.re.lt(other.re)
            }
            #[inline]
            fn select(mask: bool, a: Self, b: Self) -> Self {
                if mask { a } else { b }
            }
            #[inline]
            fn and(a: bool, b: bool) -> bool {
                a && b
            }
            #[inline]
            fn or(a: bool, b: bool) -> bool {
                a || b
            }
        }

        impl<T: Scalar<Mask = bool> + DualNum $(, const $n: usize)?> Constant<$dual> for $dual
        where
            Self: DualNum<InnerDual = T> + Copy,
        {
            #[inline]
            fn lift(self) -> Self {
                self
            }
            #[inline]
            fn of(x: f64) -> Self {
                Self::splat(x)
            }
        }
    )*};
}
impl_dual!(
    Dual<T>;
    Dual2<T>;
    Dual3<T>;
    HyperDual<T>;
    HyperHyperDual<T>;
    DualVec<T, Const<N>>, N;
);
