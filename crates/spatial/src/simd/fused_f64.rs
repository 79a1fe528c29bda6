//! Single number that is rounded in the same way as a number in a lane.
#![allow(unsafe_code)]

use crate::scalar::Scalar;
use crate::scalar::number::Number;
use crate::scalar::operators::operators;
use crate::simd::kernel::{Kernel, narrow};
use crate::simd::lanes::{Element, Lanes};
use crate::simd::level::{Level, NARROW, VECTORS, assert_supported, level};
use crate::simd::pack::Block;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Single `f64` that is rounded in the same way as a number in a lane: products and sums are fused if lanes fuse them.
/// WebAssembly does not fuse them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct FusedF64(pub f64);

impl FusedF64 {
    /// Reinterprets a slice of `f64` as a slice of `FusedF64`.
    #[inline(always)]
    pub fn of(x: &[f64]) -> &[Self] {
        // SAFETY: `FusedF64` is a transparent wrapper of `f64`.
        unsafe { core::slice::from_raw_parts(x.as_ptr().cast(), x.len()) }
    }

    /// Reinterprets a mutable slice of `f64` as a slice of `FusedF64`.
    #[inline(always)]
    pub fn of_mut(x: &mut [f64]) -> &mut [Self] {
        // SAFETY: `FusedF64` is a transparent wrapper of `f64`, and the slice is borrowed mutably.
        unsafe { core::slice::from_raw_parts_mut(x.as_mut_ptr().cast(), x.len()) }
    }
}

#[doc(hidden)]
impl Block for FusedF64 {
    type Number = f64;
    #[inline(always)]
    fn load(from: &[f64]) -> Self {
        Self(from[0])
    }
    #[inline(always)]
    fn store(self, to: &mut [f64]) {
        to[0] = self.0;
    }
    #[inline(always)]
    fn load_first(from: &[f64]) -> Self {
        Self(from.first().copied().unwrap_or_default())
    }
    #[inline(always)]
    fn store_first(self, to: &mut [f64]) {
        if let Some(first) = to.first_mut() {
            *first = self.0;
        }
    }
    #[inline(always)]
    fn transpose(_: &mut [Self]) {}
}

macro_rules! fused_operators {
    ($($trait:ident $name:ident),*) => {$(
        impl $trait for FusedF64 {
            type Output = Self;
            #[inline(always)]
            fn $name(self, o: Self) -> Self {
                Self(self.0.$name(o.0))
            }
        }
    )*};
}
fused_operators!(Add add, Sub sub, Mul mul, Div div);
operators!(FusedF64);

#[doc(hidden)]
impl Neg for FusedF64 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

#[doc(hidden)]
impl Scalar for FusedF64 {
    type Mask = bool;
    const LANES: usize = 1;
    const COMPILED: bool = VECTORS;

    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        assert!(level() > Level::Baseline, "there are no lanes at the baseline");
        narrow(kernel);
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(x)
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if cfg!(target_arch = "wasm32") {
            return self * b + c;
        }
        Self(self.0.mul_add(b.0, c.0))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Self(1.0 / self.0)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt())
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        if self.0.abs() <= f64::LARGEST {
            let ([sin], [cos]) = f64::near([self]);
            return (sin, cos);
        }
        let (sin, cos) = self.0.far();
        (Self(sin), Self(cos))
    }
    /// Uses two vectors of four numbers at a time. Code on `FusedF64` runs only at a SIMD level that has these vectors.
    #[inline(always)]
    fn sin_cos_of_all(angles: &mut [Self], cosines: &mut [Self]) {
        assert_supported(NARROW);
        let (angles, others) = angles.as_chunks_mut::<8>();
        let (cosines, other_cosines) = cosines.as_chunks_mut::<8>();
        for (x, y) in angles.iter_mut().zip(cosines) {
            let ((x, _), (y, _)) = (x.as_chunks_mut::<4>(), y.as_chunks_mut::<4>());
            let both = [Lanes::from_fused(&x[0]), Lanes::from_fused(&x[1])];
            let (sin, cos) = Lanes::<f64, 4>::sines_and_cosines(both);
            for k in 0..2 {
                (x[k], y[k]) = (sin[k].to_fused(), cos[k].to_fused());
            }
        }
        for (sin, cos) in others.iter_mut().zip(other_cosines) {
            (*sin, *cos) = sin.sin_cos();
        }
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        Self(self.0.atan2(x.0))
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs())
    }
    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self.0 < other.0
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

impl<const N: usize> Lanes<f64, N>
where
    f64: Element<N>,
{
    /// Creates a vector from one number per lane.
    #[inline(always)]
    pub fn from_fused(x: &[FusedF64; N]) -> Self {
        // SAFETY: `FusedF64` is a transparent wrapper of `f64`.
        Self::from_array(unsafe { *core::ptr::from_ref(x).cast() })
    }
    /// Returns the number in each lane.
    #[inline(always)]
    pub fn to_fused(self) -> [FusedF64; N] {
        let x = self.to_array();
        // SAFETY: `FusedF64` is a transparent wrapper of `f64`.
        unsafe { *core::ptr::from_ref(&x).cast() }
    }
}
