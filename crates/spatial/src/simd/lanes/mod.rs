//! SIMD lanes: several numbers in one or two vector registers.
//!
//! [`Lanes<f64, 4>`](Lanes) and `Lanes<f32, 8>` need AVX2 with FMA, NEON, or SIMD128. With NEON and SIMD128, each
//! vector uses two registers. `Lanes<f64, 8>` and `Lanes<f32, 16>` need AVX-512. [`FusedF64`](super::FusedF64) is a
//! single `f64` with fused products and sums.
//!
//! Use these types only in code that was entered through a function compiled for their
//! [`Level`](crate::simd::level::Level). In other code, each operation would be a function call, and an illegal
//! instruction on a processor without this level. Therefore, code can name these types only with a
//! [`SimdToken`](crate::simd::pack::SimdToken).
//!
//! Every operation treats each lane separately. The content of one lane, even NaN, never affects another lane.
//!
//! Each architecture implements [`Register`] in its own file: x86.rs, neon.rs or wasm.rs.
#![allow(unsafe_code)]

use crate::scalar::number::Number;
use crate::scalar::operators::operators;
use crate::scalar::{Constant, Scalar};
use crate::simd::kernel::Kernel;
use crate::simd::level::VECTORS;
use core::fmt;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
pub use processor::moves;
pub(crate) use processor::{WideF32, WideF64};

#[cfg_attr(target_arch = "x86_64", path = "x86.rs")]
#[cfg_attr(target_arch = "aarch64", path = "neon.rs")]
#[cfg_attr(all(target_arch = "wasm32", target_feature = "simd128"), path = "wasm.rs")]
#[cfg_attr(
    not(any(
        target_arch = "x86_64",
        target_arch = "aarch64",
        all(target_arch = "wasm32", target_feature = "simd128")
    )),
    path = "array.rs"
)]
mod processor;

/// Number type for which vectors of N lanes exist.
pub trait Element<const N: usize>: Number {
    /// Register, or pair of registers, that holds the vector.
    type Register: Register<Self, N>;
}

/// N numbers in one or two vector registers. The registers are used only in code that is compiled for their SIMD level
/// and that runs on a processor with this level.
pub trait Register<T: Number, const N: usize>: Copy + Send + Sync + 'static {
    /// Result of a comparison: one truth value per lane.
    type Mask: Copy;

    /// Runs a kernel with the instructions of these registers.
    fn enter(kernel: impl Kernel);
    /// Loads the numbers of an array.
    fn load(x: [T; N]) -> Self;
    /// Returns the lanes as an array.
    fn store(a: Self) -> [T; N];
    /// Loads the numbers of a slice of at most N numbers; the other lanes are 0.
    #[inline(always)]
    fn load_first(x: &[T]) -> Self {
        let mut all = [T::zero(); N];
        for k in 0..N {
            if k < x.len() {
                all[k] = x[k];
            }
        }
        Self::load(all)
    }
    /// Writes the first lanes to a slice of at most N numbers.
    #[inline(always)]
    fn store_first(a: Self, to: &mut [T]) {
        let all = Self::store(a);
        for k in 0..N {
            if k < to.len() {
                to[k] = all[k];
            }
        }
    }
    /// Returns x in every lane.
    fn splat(x: T) -> Self;
    /// Returns 0 in every lane. Code that is compiled for any processor fills workspaces with this value. In such code,
    /// each instruction for these registers would be a function call; [`splat`](Self::splat) uses such an instruction.
    /// Setting all bits to zero needs no such instruction.
    fn zero() -> Self;
    /// Returns a + b.
    fn add(a: Self, b: Self) -> Self;
    /// Returns a − b.
    fn sub(a: Self, b: Self) -> Self;
    /// Returns a b.
    fn mul(a: Self, b: Self) -> Self;
    /// Returns a / b.
    fn div(a: Self, b: Self) -> Self;
    /// Returns a b + c, rounded once. WebAssembly does not have such an instruction and rounds twice.
    fn mul_add(a: Self, b: Self, c: Self) -> Self;
    /// Returns √a.
    fn sqrt(a: Self) -> Self;
    /// Returns −a.
    fn neg(a: Self) -> Self;
    /// Returns |a|.
    fn abs(a: Self) -> Self;
    /// Returns a < b.
    fn lt(a: Self, b: Self) -> Self::Mask;
    /// Returns a in lanes in which the mask holds, and b in other lanes.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;
    /// Returns whether both masks hold.
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns whether at least one of the masks holds.
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Returns whether the mask holds in at least one lane.
    fn any(mask: Self::Mask) -> bool;
    /// Transposes N rows: number i of row k becomes number k of row i.
    #[inline(always)]
    fn transpose(rows: &mut [Self; N]) {
        let mut to = [[T::zero(); N]; N];
        for k in 0..N {
            let from = Self::store(rows[k]);
            for i in 0..N {
                to[i][k] = from[i];
            }
        }
        for i in 0..N {
            rows[i] = Self::load(to[i]);
        }
    }
}

/// Vector of N numbers.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Lanes<T: Element<N>, const N: usize>(T::Register);

/// Defines functions that consist of vector instructions of the processor.
#[allow(unused_macros)] // unused on targets without vector instructions
macro_rules! instructions {
    ($($(#[$doc:meta])* fn $name:ident($($x:ident: $type:ty),*) $(-> $out:ty)? { $body:expr })*) => {$(
        $(#[$doc])*
        #[inline(always)]
        #[allow(unused_unsafe)]
        fn $name($($x: $type),*) $(-> $out)? {
            // SAFETY: the processor has the SIMD level, because only code entered through `Scalar::enter` holds these
            // vectors.
            unsafe { $body }
        }
    )*};
}
#[allow(unused_imports)]
use instructions;

macro_rules! register_operators {
    ($($trait:ident $name:ident),*) => {$(
        impl<T: Element<N>, const N: usize> $trait for Lanes<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, o: Self) -> Self {
                Self(T::Register::$name(self.0, o.0))
            }
        }
    )*};
}
register_operators!(Add add, Sub sub, Mul mul, Div div);
operators!(Lanes<T, N>, T: Element<N>, const N: usize);

#[doc(hidden)]
impl<T: Element<N>, const N: usize> Neg for Lanes<T, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(T::Register::neg(self.0))
    }
}

#[doc(hidden)]
impl<T: Element<N>, const N: usize> PartialEq for Lanes<T, N> {
    fn eq(&self, o: &Self) -> bool {
        self.to_array() == o.to_array()
    }
}

#[doc(hidden)]
impl<T: Element<N>, const N: usize> fmt::Debug for Lanes<T, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_array().fmt(f)
    }
}

impl<T: Element<N>, const N: usize> Lanes<T, N> {
    /// Creates a vector from one number per lane.
    #[inline(always)]
    pub fn from_array(x: [T; N]) -> Self {
        Self(T::Register::load(x))
    }
    /// Returns the number in each lane.
    #[inline(always)]
    pub fn to_array(self) -> [T; N] {
        T::Register::store(self.0)
    }
    /// Loads the numbers of a slice of at most N numbers; the other lanes are 0.
    #[inline(always)]
    pub(crate) fn load_first(x: &[T]) -> Self {
        Self(T::Register::load_first(x))
    }
    /// Writes the first lanes to a slice of at most N numbers.
    #[inline(always)]
    pub(crate) fn store_first(self, to: &mut [T]) {
        T::Register::store_first(self.0, to);
    }
    /// Transposes N vectors: number i of vector k becomes number k of vector i.
    #[inline(always)]
    pub(crate) fn transpose(rows: &mut [Self; N]) {
        // SAFETY: `Lanes` is a transparent wrapper of its register.
        T::Register::transpose(unsafe { &mut *core::ptr::from_mut(rows).cast() });
    }
    /// Computes (sin x, cos x) for each of K vectors x.
    #[inline(always)]
    pub(crate) fn sines_and_cosines<const K: usize>(x: [Self; K]) -> ([Self; K], [Self; K]) {
        let largest = Self::splat(T::LARGEST);
        let mut beyond = largest.lt(x[0].abs());
        for k in 1..K {
            beyond = Self::or(beyond, largest.lt(x[k].abs()));
        }
        let (mut sin, mut cos) = T::near(x);
        if Self::any(beyond) {
            for k in 0..K {
                let ((s, c), beyond) = (x[k].each(T::far), largest.lt(x[k].abs()));
                (sin[k], cos[k]) = (Self::select(beyond, s, sin[k]), Self::select(beyond, c, cos[k]));
            }
        }
        (sin, cos)
    }
    /// Applies a function of one number to the number in each lane.
    #[inline(always)]
    fn each(self, f: fn(T) -> (T, T)) -> (Self, Self) {
        let x = self.to_array();
        let (mut a, mut b) = (x, x);
        for k in 0..N {
            (a[k], b[k]) = f(x[k]);
        }
        (Self::from_array(a), Self::from_array(b))
    }
}

/// Second type to which the constant `[T; N]` can be converted. Without a second type, type inference would select the
/// lane type. Only code with a [`SimdToken`](crate::simd::pack::SimdToken) may name the lane type.
#[derive(Clone, Copy)]
pub struct NotALane<T, const N: usize>([T; N]);

#[doc(hidden)]
impl<T: Number, const N: usize> Constant<NotALane<T, N>> for [T; N] {
    fn lift(self) -> NotALane<T, N> {
        NotALane(self)
    }
    fn of(x: f64) -> Self {
        [T::splat(x); N]
    }
}

/// Model constant that has a different value in each lane.
#[doc(hidden)]
impl<T: Element<N>, const N: usize> Constant<Lanes<T, N>> for [T; N] {
    #[inline(always)]
    fn lift(self) -> Lanes<T, N> {
        Lanes::from_array(self)
    }
    fn of(x: f64) -> Self {
        [T::splat(x); N]
    }
}

#[doc(hidden)]
impl<T: Element<N>, const N: usize> Scalar for Lanes<T, N> {
    type Mask = <T::Register as Register<T, N>>::Mask;
    const LANES: usize = N;
    const COMPILED: bool = T::COMPILED && VECTORS;

    #[inline(always)]
    fn enter(kernel: impl Kernel) {
        T::Register::enter(kernel);
    }
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self(T::Register::splat(T::splat(x)))
    }
    #[inline(always)]
    fn zero() -> Self {
        Self(T::Register::zero())
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(T::Register::mul_add(self.0, b.0, c.0))
    }
    #[inline(always)]
    fn recip(self) -> Self {
        Self::splat(1.0) / self
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(T::Register::sqrt(self.0))
    }
    #[inline(always)]
    fn sin_cos(self) -> (Self, Self) {
        let ([sin], [cos]) = Self::sines_and_cosines([self]);
        (sin, cos)
    }
    /// Computes two vectors at a time.
    #[inline(always)]
    fn sin_cos_of_all(angles: &mut [Self], cosines: &mut [Self]) {
        let (angles, others) = angles.as_chunks_mut::<2>();
        let (cosines, other_cosines) = cosines.as_chunks_mut::<2>();
        for (x, y) in angles.iter_mut().zip(cosines) {
            (*x, *y) = Self::sines_and_cosines(*x);
        }
        for (sin, cos) in others.iter_mut().zip(other_cosines) {
            (*sin, *cos) = sin.sin_cos();
        }
    }
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        let (y, x) = (self.to_array(), x.to_array());
        let mut angle = y;
        for k in 0..N {
            angle[k] = y[k].atan2(x[k]);
        }
        Self::from_array(angle)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Self(T::Register::abs(self.0))
    }
    #[inline(always)]
    fn lt(self, o: Self) -> Self::Mask {
        T::Register::lt(self.0, o.0)
    }
    #[inline(always)]
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self {
        Self(T::Register::select(mask, a.0, b.0))
    }
    #[inline(always)]
    fn and(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        T::Register::and(a, b)
    }
    #[inline(always)]
    fn or(a: Self::Mask, b: Self::Mask) -> Self::Mask {
        T::Register::or(a, b)
    }
    #[inline(always)]
    fn all(mask: Self::Mask) -> bool {
        !Self::any(Self::zero().lt(Self::select(mask, Self::zero(), Self::one())))
    }
    #[inline(always)]
    fn any(mask: Self::Mask) -> bool {
        T::Register::any(mask)
    }
}
