//! The numbers an algorithm can run on.

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

/// A number: `f64`, `f32`, a dual number of num-dual, or several numbers side by side (lanes).
///
/// There is no order on scalars, so generic code cannot branch on a value, which is right for lanes (each has its own
/// answer) and for dual numbers (each branch has its own derivative) alike: compare with [`lt`](Self::lt), choose with
/// [`select`](Self::select).
///
/// ```
/// use condyle_spatial::Scalar;
/// fn hypot<S: Scalar>(x: S, y: S) -> S {
///     x.mul_add(x, y * y).sqrt()
/// }
/// assert_eq!(hypot(3.0, 4.0), 5.0);
/// assert!((hypot(num_dual::Dual64::new(3.0, 1.0), 4.0.into()).eps - 0.6).abs() < 1e-15); // ∂√(x² + y²)/∂x = x/√(x² + y²)
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
    /// The outcome of a comparison: `bool`, or one for each lane.
    type Mask: Copy;
    /// The number of numbers that lie side by side in one value.
    const LANES: usize;
    /// Whether the crates that own algorithms have compiled them for it: `f64` and its lanes.
    #[doc(hidden)]
    const COMPILED: bool = false;

    /// Runs a kernel on this scalar, compiled for its level.
    #[doc(hidden)]
    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        kernel.run();
    }

    /// The constant `x`, in every lane, without derivative.
    fn splat(x: f64) -> Self;
    /// self · b + c, fused where the instruction set in use has it.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// 1 / self.
    fn recip(self) -> Self;
    /// √self.
    fn sqrt(self) -> Self;
    /// (sin self, cos self).
    fn sin_cos(self) -> (Self, Self);
    /// The sines of some angles in their place, and their cosines; the bits of [`sin_cos`](Self::sin_cos).
    #[doc(hidden)]
    #[inline(always)]
    fn sin_cos_of_all(angles: &mut [Self], cosines: &mut [Self]) {
        for (sin, cos) in angles.iter_mut().zip(cosines) {
            (*sin, *cos) = sin.sin_cos();
        }
    }
    /// The angle of the point (x, self), in (−π, π].
    fn atan2(self, x: Self) -> Self;
    /// |self|.
    fn abs(self) -> Self;
    /// The same number; of a recorded one, a value whose sign is not taken out of products, so that sums which are alike are
    /// written alike.
    #[doc(hidden)]
    #[inline(always)]
    fn kept(self) -> Self {
        self
    }
    /// self < other.
    fn lt(self, other: Self) -> Self::Mask;
    /// a where the mask holds, b elsewhere.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Both masks hold.
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Whether at least one of the masks holds.
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Whether a mask holds in every lane; `false` also where that is not known, because a program is being recorded.
    #[doc(hidden)]
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        Self::select(mask, Self::one(), Self::zero()) == Self::one()
    }
    /// Whether a mask holds in some lane; `true` also where that is not known.
    #[doc(hidden)]
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        Self::select(mask, Self::zero(), Self::one()) != Self::one()
    }

    /// 0.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// 1.
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}

/// A constant of a model, as the scalar `S` of a pass sees it.
///
/// Model constants are `f64` and take part in a pass on any scalar. They can also be of the scalar's own type: a model
/// whose inertias are dual numbers gives the derivatives with respect to inertias.
pub trait Constant<S>: Copy + Debug + Send + Sync + 'static {
    /// This constant as a scalar.
    fn lift(self) -> S;
    /// The constant `x`.
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
