//! Number types with which an algorithm can compute.

#[cfg(any(feature = "std", test))]
mod dual;
#[doc(hidden)]
pub mod elementary;
mod float;
#[doc(hidden)]
pub mod lane_dual;
pub(crate) mod number;
pub(crate) mod operators;
mod platform;
mod sin_cos;

use crate::simd::kernel::Kernel;
use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Number type: `f64`, `f32`, a dual number of num-dual, or several numbers in SIMD lanes.
///
/// Scalars have no order, so generic code cannot branch on a value. A branch would be wrong for lanes, because a
/// comparison can have a different result in each lane. A branch would also be wrong for dual numbers, because each
/// branch has its own derivative. Compare with [`lt`](Self::lt) and choose with [`select`](Self::select) instead.
///
/// ```
/// use condyle_spatial::Scalar;
/// fn hypot<S: Scalar>(x: S, y: S) -> S {
///     x.mul_add(x, y * y).sqrt()
/// }
/// assert_eq!(hypot(3.0, 4.0), 5.0);
/// let slope = hypot(num_dual::Dual64::new(3.0, 1.0), 4.0.into()).eps;
/// assert!((slope - 0.6).abs() < 1e-15); // ∂√(x² + y²)/∂x = x/√(x² + y²)
/// ```
pub trait Scalar:
    Copy
    + Debug
    + PartialEq
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + 'static
{
    /// Result of a comparison: `bool`, or one boolean per lane.
    type Mask: Copy;
    /// Number of lanes of one value.
    const LANES: usize;
    /// Whether the crates that define algorithms contain compiled code for this scalar. It is `true` for `f64` and its
    /// lanes.
    #[doc(hidden)]
    const COMPILED: bool = false;

    /// Runs a kernel that is compiled for the SIMD level of this scalar.
    #[doc(hidden)]
    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        kernel.run();
    }

    /// Returns the constant `x` in every lane, with derivative zero.
    fn splat(x: f64) -> Self;
    /// Returns self · b + c. The result is rounded once if the instruction set in use has fused products.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Returns 1 / self.
    fn recip(self) -> Self;
    /// Returns √self.
    fn sqrt(self) -> Self;
    /// Returns (sin self, cos self).
    fn sin_cos(self) -> (Self, Self);
    /// Replaces angles by their sines, and writes their cosines to `cosines`. The bits are the same as with
    /// [`sin_cos`](Self::sin_cos).
    #[doc(hidden)]
    #[inline(always)]
    fn sin_cos_of_all(angles: &mut [Self], cosines: &mut [Self]) {
        for (sin, cos) in angles.iter_mut().zip(cosines) {
            (*sin, *cos) = sin.sin_cos();
        }
    }
    /// Returns the angle of the point (x, self), in (−π, π].
    fn atan2(self, x: Self) -> Self;
    /// Returns |self|.
    fn abs(self) -> Self;
    /// Returns self. If operations are recorded, for example to generate code, the recorder does not move the sign of
    /// this number out of products. So sums with the same structure are also recorded with the same structure.
    #[doc(hidden)]
    #[inline(always)]
    fn kept(self) -> Self {
        self
    }
    /// Returns self < other.
    fn lt(self, other: Self) -> Self::Mask;
    /// Returns a in lanes in which the mask holds, and b in other lanes.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Returns whether both masks hold.
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns whether at least one of the masks holds.
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns whether a mask holds in every lane. Returns `false` while operations are being recorded, because the
    /// values of the lanes are then unknown.
    #[doc(hidden)]
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        Self::select(mask, Self::one(), Self::zero()) == Self::one()
    }
    /// Returns whether a mask holds in at least one lane. Returns `true` while operations are being recorded, because
    /// the values of the lanes are then unknown.
    #[doc(hidden)]
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        Self::select(mask, Self::zero(), Self::one()) != Self::one()
    }

    /// Returns 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// Returns 1.
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}

/// Constant of a model, which an algorithm converts to its scalar `S`.
///
/// Model constants are `f64` and can be used with any scalar. They can also have the type of the scalar: a model whose
/// inertias are dual numbers gives derivatives with respect to these inertias.
pub trait Constant<S>: Copy + Debug + Send + Sync + 'static {
    /// Converts this constant to the scalar.
    fn lift(self) -> S;
    /// Returns the constant `x`.
    fn of(x: f64) -> Self;
}

impl<S: Scalar> Constant<S> for f64 {
    #[inline(always)]
    fn lift(self) -> S {
        S::splat(self)
    }
    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }
}
