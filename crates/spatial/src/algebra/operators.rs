//! Operators of vectors: products with scalars, indices, sums and norms. They are short forms of methods of [`Vec3`],
//! [`Motion`] and [`Force`].

use crate::algebra::motion::{Force, Motion};
use crate::algebra::quaternion::Quaternion;
use crate::algebra::se3::Se3;
use crate::algebra::vector::{Mat3, Vec3};
use crate::scalar::Scalar;
use core::iter::Sum;
use core::ops::{Div, DivAssign, Index, IndexMut, Mul, MulAssign};

/// Implements the product with a scalar and the quotient by a scalar, for a struct with a method `scale`. A factor to
/// the left of `*` has the type `f64`, so literals need no type suffix.
macro_rules! impl_scalar_product {
    ($type:ident) => {
        impl<S: Scalar> Mul<S> for $type<S> {
            type Output = Self;
            /// Multiplies each component by s.
            #[inline(always)]
            fn mul(self, s: S) -> Self {
                self.scale(s)
            }
        }
        impl<S: Scalar> MulAssign<S> for $type<S> {
            #[inline(always)]
            fn mul_assign(&mut self, s: S) {
                *self = self.scale(s);
            }
        }
        impl<S: Scalar> Div<S> for $type<S> {
            type Output = Self;
            /// Multiplies each component by 1/s.
            #[inline(always)]
            fn div(self, s: S) -> Self {
                self.scale(s.recip())
            }
        }
        impl<S: Scalar> DivAssign<S> for $type<S> {
            #[inline(always)]
            fn div_assign(&mut self, s: S) {
                *self = *self / s;
            }
        }
        impl Mul<$type<f64>> for f64 {
            type Output = $type<f64>;
            /// Multiplies each component by the factor to the left of `*`.
            #[inline(always)]
            fn mul(self, x: $type<f64>) -> $type<f64> {
                x.scale(self)
            }
        }
    };
}
impl_scalar_product!(Vec3);
impl_scalar_product!(Mat3);
impl_scalar_product!(Motion);
impl_scalar_product!(Force);

/// Implements access by index in flattened order, sums of iterators, and zero as the default value.
macro_rules! impl_components {
    ($type:ident, $n:literal: $($i:literal => $($field:ident).+),*) => {
        impl<S> Index<usize> for $type<S> {
            type Output = S;
            #[doc = concat!("Component i in flattened order, i below ", $n, ".\n\n# Panics\nIf i is ", $n, " or more.")]
            #[inline(always)]
            #[track_caller]
            fn index(&self, i: usize) -> &S {
                match i {
                    $($i => &self.$($field).+,)*
                    _ => outside(i, $n),
                }
            }
        }
        impl<S> IndexMut<usize> for $type<S> {
            #[inline(always)]
            #[track_caller]
            fn index_mut(&mut self, i: usize) -> &mut S {
                match i {
                    $($i => &mut self.$($field).+,)*
                    _ => outside(i, $n),
                }
            }
        }
        impl<S: Scalar> Default for $type<S> {
            /// Returns the zero vector.
            #[inline(always)]
            fn default() -> Self {
                Self::zero()
            }
        }
        impl<S: Scalar> Sum for $type<S> {
            #[inline(always)]
            fn sum<I: Iterator<Item = Self>>(all: I) -> Self {
                all.fold(Self::zero(), |sum, x| sum + x)
            }
        }
    };
}
impl_components!(Vec3, 3: 0 => x, 1 => y, 2 => z);
impl_components!(
    Motion, 6: 0 => linear.x, 1 => linear.y, 2 => linear.z, 3 => angular.x, 4 => angular.y, 5 => angular.z
);
impl_components!(Force, 6: 0 => linear.x, 1 => linear.y, 2 => linear.z, 3 => angular.x, 4 => angular.y, 5 => angular.z);

/// Panics because an index is too large.
#[cold]
#[inline(never)]
#[track_caller]
fn outside(i: usize, n: usize) -> ! {
    panic!("index: expected a number below {n}, found {i}");
}

impl<S: Scalar> Vec3<S> {
    /// Returns |a| = √(a · a). Its derivative at a = 0 is not finite.
    ///
    /// ```
    /// use condyle_spatial::Vec3;
    /// let (a, b) = (Vec3::new(3.0, 4.0, 0.0), Vec3::from([0.0, 0.0, 2.0]));
    /// assert_eq!((a.norm(), (2.0 * a - b / 2.0)[2]), (5.0, -1.0));
    /// assert_eq!([a, b].into_iter().sum::<Vec3<f64>>(), a + b);
    /// ```
    #[inline(always)]
    pub fn norm(self) -> S {
        self.norm_squared().sqrt()
    }
}

macro_rules! impl_norm {
    ($type:ident, $units:literal) => {
        impl<S: Scalar> $type<S> {
            #[doc = concat!("The sum of the squares of all six numbers. It adds ", $units, ".")]
            #[inline(always)]
            pub fn norm_squared(self) -> S {
                self.linear.dot_add(self.linear, self.angular.norm_squared())
            }
            #[doc = concat!("√ of the sum of the squares of all six numbers. It adds ", $units, ".")]
            #[inline(always)]
            pub fn norm(self) -> S {
                self.norm_squared().sqrt()
            }
        }
    };
}
impl_norm!(Motion, "m²/s² and rad²/s², so it suits errors and tolerances only");
impl_norm!(Force, "N² and N² m², so it suits errors and tolerances only");

impl<S: Scalar> Default for Se3<S> {
    /// Returns the identity.
    #[inline(always)]
    fn default() -> Self {
        Self::identity()
    }
}

impl<S: Scalar> Default for Quaternion<S> {
    /// Returns the identity.
    #[inline(always)]
    fn default() -> Self {
        Self::identity()
    }
}
