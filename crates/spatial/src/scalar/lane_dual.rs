//! Dual numbers over SIMD lanes. One pass computes derivatives in several directions, or of several states: one per
//! lane.

use super::operators::operators;
use super::{Constant, Scalar};
use crate::simd::kernel::Kernel;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Dual number x + x′ε with ε² = 0, where x and x′ are vectors. Each lane has a value and the derivative of this value.
///
/// num-dual's types cannot be used here. Their components need an order, a conversion into one number, and functions
/// that branch on this number. Lanes have no such order, conversion or functions. The rules of differentiation are the
/// same as num-dual's.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct LaneDual<S> {
    /// Value of each lane.
    pub re: S,
    /// Derivative of each lane.
    pub eps: S,
}

impl<S: Scalar> LaneDual<S> {
    /// Returns f(x) and f′(x) x′, given `value` = f(x) and `slope` = f′(x).
    #[inline(always)]
    fn chain(self, value: S, slope: S) -> Self {
        Self { re: value, eps: slope * self.eps }
    }
}

impl<S: Scalar> Add for LaneDual<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, o: Self) -> Self {
        Self { re: self.re + o.re, eps: self.eps + o.eps }
    }
}

impl<S: Scalar> Sub for LaneDual<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, o: Self) -> Self {
        Self { re: self.re - o.re, eps: self.eps - o.eps }
    }
}

impl<S: Scalar> Mul for LaneDual<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self { re: self.re * o.re, eps: self.re.mul_add(o.eps, self.eps * o.re) }
    }
}

impl<S: Scalar> Div for LaneDual<S> {
    type Output = Self;
    #[inline(always)]
    fn div(self, o: Self) -> Self {
        let re = self.re / o.re;
        Self { re, eps: (self.eps - re * o.eps) / o.re } // (x/y)′ = (x′ − (x/y) y′)/y
    }
}

impl<S: Scalar> Neg for LaneDual<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { re: -self.re, eps: -self.eps }
    }
}

operators!(LaneDual<S>, S: Scalar);

#[doc(hidden)]
impl<S: Scalar> Scalar for LaneDual<S> {
    type Mask = S::Mask;
    const LANES: usize = S::LANES;

    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        S::enter(kernel);
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self { re: S::splat(x), eps: S::zero() }
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self { re: self.re.mul_add(b.re, c.re), eps: self.re.mul_add(b.eps, self.eps.mul_add(b.re, c.eps)) }
    }
    #[inline(always)]
    fn recip(self) -> Self {
        let re = self.re.recip();
        self.chain(re, -(re * re))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        let re = self.re.sqrt();
        self.chain(re, (re + re).recip())
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.re.sin_cos();
        (self.chain(sin, cos), self.chain(cos, -sin))
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        // (x y′ − y x′)/(x² + y²), computed with quotients that do not overflow
        let scale = S::select(x.re.abs().lt(self.re.abs()), self.re, x.re);
        let (sin, cos) = (self.re / scale, x.re / scale);
        let slope = (cos * self.eps - sin * x.eps) / (scale * sin.mul_add(sin, cos * cos));
        Self { re: self.re.atan2(x.re), eps: slope }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        let negative = self.re.lt(S::zero());
        Self { re: self.re.abs(), eps: S::select(negative, -self.eps, self.eps) }
    }
    #[inline(always)]
    fn lt(self, other: Self) -> S::Mask {
        self.re.lt(other.re)
    }
    #[inline(always)]
    fn select(mask: S::Mask, a: Self, b: Self) -> Self {
        Self { re: S::select(mask, a.re, b.re), eps: S::select(mask, a.eps, b.eps) }
    }
    #[inline(always)]
    fn and(a: S::Mask, b: S::Mask) -> S::Mask {
        S::and(a, b)
    }
    #[inline(always)]
    fn or(a: S::Mask, b: S::Mask) -> S::Mask {
        S::or(a, b)
    }
    #[inline(always)]
    fn all(mask: S::Mask) -> bool {
        S::all(mask)
    }
    #[inline(always)]
    fn any(mask: S::Mask) -> bool {
        S::any(mask)
    }
}

#[doc(hidden)]
impl<S: Scalar> Constant<LaneDual<S>> for LaneDual<S> {
    #[inline(always)]
    fn lift(self) -> Self {
        self
    }
    #[inline(always)]
    fn of(x: f64) -> Self {
        Self::splat(x)
    }
}
