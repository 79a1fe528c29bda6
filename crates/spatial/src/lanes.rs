//! Several numbers side by side in one vector register.
//!
//! [`Lanes<f64, 4>`](Lanes) and `Lanes<f32, 8>` need AVX2 and FMA, `Lanes<f64, 8>` and `Lanes<f32, 16>` AVX-512, and
//! [`Fused`] is a single `f64` where products and sums are fused. They are for code that has been entered through a function
//! compiled for their [`Level`](crate::level::Level), which is the business of a dispatcher: anywhere else each operation
//! would be a function call, and on a processor without the instructions an illegal one. Every operation treats each lane
//! alone, so what one lane holds (not-a-numbers included) never reaches another.
#![allow(unsafe_code)]

pub use crate::fused::Fused;

/// A number of which vectors of N exist.
pub trait Element<const N: usize>: Copy + 'static {
    /// The register.
    type Vector: Copy;
}

/// N numbers side by side.
#[derive(Clone, Copy)]
#[repr(transparent)]
pub struct Lanes<T: Element<N>, const N: usize>(pub(crate) T::Vector);

/// Work that is to be compiled for a level: `run` is always inlined, and so takes the level of the function it stands in.
pub trait Kernel: Sized {
    /// The work.
    fn run(self);
    /// If it is work on `f64`, the same on [`Fused`], through [`avx2`]; called where the processor can.
    fn run_fused(self);
}

/// Runs a kernel with the instructions of [`Level::Avx2`](crate::level::Level::Avx2).
///
/// # Safety
/// The processor must have them.
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
pub unsafe fn avx2(kernel: impl Kernel) {
    kernel.run();
}

/// Runs a kernel with the instructions of [`Level::Avx512`](crate::level::Level::Avx512).
///
/// # Safety
/// The processor must have them.
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma"))]
pub unsafe fn avx512(kernel: impl Kernel) {
    kernel.run();
}

macro_rules! operators {
    ($type:ty) => {
        impl AddAssign for $type {
            #[inline(always)]
            fn add_assign(&mut self, o: Self) {
                *self = *self + o;
            }
        }
        impl SubAssign for $type {
            #[inline(always)]
            fn sub_assign(&mut self, o: Self) {
                *self = *self - o;
            }
        }
    };
}
pub(crate) use operators;

/// What depends on the kind of mask.
#[cfg(target_arch = "x86_64")]
macro_rules! masks {
    (
        $vector:ident, $mask:ident, $set1:ident $andnot:ident $sub:ident;
        lt($la:ident, $lb:ident): $lt:expr;
        select($sm:ident, $sa:ident, $sb:ident): $select:expr;
        and($aa:ident, $ab:ident): $and:expr;
        or($oa:ident, $ob:ident): $or:expr;
        any($am:ident): $any:expr
    ) => {
        use core::arch::x86_64::*;
        masks! { fn neg(x: $vector) -> $vector { $sub($set1(-0.0), x) } }
        masks! { fn abs(x: $vector) -> $vector { $andnot($set1(-0.0), x) } }
        masks! { fn lt($la: $vector, $lb: $vector) -> $mask { $lt } }
        masks! { fn select($sm: $mask, $sa: $vector, $sb: $vector) -> $vector { $select } }
        masks! { fn and($aa: $mask, $ab: $mask) -> $mask { $and } }
        masks! { fn or($oa: $mask, $ob: $mask) -> $mask { $or } }
        masks! { fn any($am: $mask) -> bool { $any } }
    };
    (fn $name:ident($($x:ident: $type:ty),*) -> $out:ty { $body:expr }) => {
        /// # Safety
        /// The processor must have the instructions.
        #[inline(always)]
        #[allow(unused_unsafe)]
        pub(super) unsafe fn $name($($x: $type),*) -> $out {
            // SAFETY: by the caller.
            unsafe { $body }
        }
    };
}

/// The operators and the `Scalar` of a vector.
#[cfg(target_arch = "x86_64")]
macro_rules! lanes {
    (
        $float:ident by $n:literal, $enter:ident, $vector:ident, $mask:ident, $sin_cos:ident up to $largest:ident;
        $m:ident $set1:ident $loadu:ident $storeu:ident $add:ident $sub:ident $mul:ident $div:ident $fmadd:ident $sqrt:ident
    ) => {
        impl Element<$n> for $float {
            type Vector = $vector;
        }
        impl Lanes<$float, $n> {
            /// One number for each lane.
            #[inline(always)]
            pub fn from_array(x: [$float; $n]) -> Self {
                // SAFETY: x has as many numbers as are read; the level is supported, see the head of the file.
                Self(unsafe { $loadu(x.as_ptr()) })
            }
            /// The number in each lane.
            #[inline(always)]
            pub fn to_array(self) -> [$float; $n] {
                let mut x = [0.0; $n];
                // SAFETY: x has as many numbers as are written; the level is supported, see the head of the file.
                unsafe { $storeu(x.as_mut_ptr(), self.0) };
                x
            }
            /// Each lane alone, by a function of one number.
            #[inline(always)]
            fn each(self, f: fn($float) -> ($float, $float)) -> (Self, Self) {
                let x = self.to_array();
                let (mut a, mut b) = (x, x);
                for k in 0..$n {
                    (a[k], b[k]) = f(x[k]);
                }
                (Self::from_array(a), Self::from_array(b))
            }
        }
        impl Add for Lanes<$float, $n> {
            type Output = Self;
            #[inline(always)]
            fn add(self, o: Self) -> Self {
                // SAFETY: the level is supported, see the head of the file; so below.
                Self(unsafe { $add(self.0, o.0) })
            }
        }
        impl Sub for Lanes<$float, $n> {
            type Output = Self;
            #[inline(always)]
            fn sub(self, o: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $sub(self.0, o.0) })
            }
        }
        impl Mul for Lanes<$float, $n> {
            type Output = Self;
            #[inline(always)]
            fn mul(self, o: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $mul(self.0, o.0) })
            }
        }
        impl Div for Lanes<$float, $n> {
            type Output = Self;
            #[inline(always)]
            fn div(self, o: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $div(self.0, o.0) })
            }
        }
        impl Neg for Lanes<$float, $n> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $m::neg(self.0) })
            }
        }
        operators!(Lanes<$float, $n>);
        impl PartialEq for Lanes<$float, $n> {
            fn eq(&self, o: &Self) -> bool {
                self.to_array() == o.to_array()
            }
        }
        impl fmt::Debug for Lanes<$float, $n> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.to_array().fmt(f)
            }
        }
        /// A constant of its own in each lane.
        impl Constant<Lanes<$float, $n>> for [$float; $n] {
            #[inline(always)]
            fn lift(self) -> Lanes<$float, $n> {
                Lanes::<$float, $n>::from_array(self)
            }
            fn of(x: f64) -> Self {
                [x as $float; $n]
            }
        }
        impl Scalar for Lanes<$float, $n> {
            type Mask = $mask;
            const LANES: usize = $n;

            #[inline(always)]
            fn enter(kernel: impl Kernel) {
                // SAFETY: a number of this kind exists, so the level is supported, see the head of the file.
                unsafe { $enter(kernel) }
            }

            #[inline(always)]
            fn splat(x: f64) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $set1(x as $float) })
            }
            #[inline(always)]
            fn mul_add(self, b: Self, c: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $fmadd(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn recip(self) -> Self {
                Self::splat(1.0) / self
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn sin_cos(self) -> (Self, Self) {
                let beyond = Self::splat(sin_cos::$largest).lt(self.abs());
                // SAFETY: as for `add`.
                if unsafe { $m::any(beyond) } {
                    let (sin, cos) = self.each($float::sin_cos);
                    let (s, c) = sin_cos::$sin_cos(self);
                    return (Self::select(beyond, sin, s), Self::select(beyond, cos, c));
                }
                sin_cos::$sin_cos(self)
            }
            #[inline(always)]
            fn atan2(self, x: Self) -> Self {
                let (y, x) = (self.to_array(), x.to_array());
                let mut angle = y;
                for k in 0..$n {
                    angle[k] = y[k].atan2(x[k]);
                }
                Self::from_array(angle)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $m::abs(self.0) })
            }
            #[inline(always)]
            fn lt(self, o: Self) -> $mask {
                // SAFETY: as for `add`.
                unsafe { $m::lt(self.0, o.0) }
            }
            #[inline(always)]
            fn select(mask: $mask, a: Self, b: Self) -> Self {
                // SAFETY: as for `add`.
                Self(unsafe { $m::select(mask, a.0, b.0) })
            }
            #[inline(always)]
            fn and(a: $mask, b: $mask) -> $mask {
                // SAFETY: as for `add`.
                unsafe { $m::and(a, b) }
            }
            #[inline(always)]
            fn or(a: $mask, b: $mask) -> $mask {
                // SAFETY: as for `add`.
                unsafe { $m::or(a, b) }
            }
        }
    };
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    use super::{Element, Fused, Kernel, Lanes, avx2, avx512};
    use crate::scalar::{Constant, Scalar};
    use crate::sin_cos;
    use core::arch::x86_64::*;
    use core::fmt;
    use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

    /// A mask is a vector with all bits of a lane set or none.
    macro_rules! avx2 {
        (
            $float:ident by $n:literal, $vector:ident, $sin_cos:ident up to $largest:ident, $m:ident, $($p:ident)*;
            $set1:ident $andnot:ident $sub:ident $cmp:ident $blendv:ident $and:ident $or:ident $movemask:ident
        ) => {
            mod $m {
                masks! {
                    $vector, $vector, $set1 $andnot $sub;
                    lt(a, b): $cmp::<_CMP_LT_OQ>(a, b);
                    select(mask, a, b): $blendv(b, a, mask);
                    and(a, b): $and(a, b);
                    or(a, b): $or(a, b);
                    any(mask): $movemask(mask) != 0
                }
            }
            lanes! { $float by $n, avx2, $vector, $vector, $sin_cos up to $largest; $m $set1 $($p)* }
        };
    }
    avx2! {
        f64 by 4, __m256d, double up to LARGEST, f64x4,
        _mm256_loadu_pd _mm256_storeu_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd _mm256_fmadd_pd _mm256_sqrt_pd;
        _mm256_set1_pd _mm256_andnot_pd _mm256_sub_pd _mm256_cmp_pd _mm256_blendv_pd _mm256_and_pd _mm256_or_pd _mm256_movemask_pd
    }
    avx2! {
        f32 by 8, __m256, single up to LARGEST_SINGLE, f32x8,
        _mm256_loadu_ps _mm256_storeu_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps _mm256_fmadd_ps _mm256_sqrt_ps;
        _mm256_set1_ps _mm256_andnot_ps _mm256_sub_ps _mm256_cmp_ps _mm256_blendv_ps _mm256_and_ps _mm256_or_ps _mm256_movemask_ps
    }

    impl Lanes<f64, 4> {
        /// Four single numbers, one for each lane.
        #[inline(always)]
        pub fn from_fused(x: &[Fused; 4]) -> Self {
            // SAFETY: `Fused` is a transparent wrapper of `f64`; the level is supported, see the head of the file.
            Self(unsafe { _mm256_loadu_pd(x.as_ptr().cast()) })
        }
        /// The single number in each lane.
        #[inline(always)]
        pub fn to_fused(self) -> [Fused; 4] {
            let mut x = [Fused(0.0); 4];
            // SAFETY: as for `from_fused`.
            unsafe { _mm256_storeu_pd(x.as_mut_ptr().cast(), self.0) };
            x
        }
    }

    /// A mask is a number with a bit for each lane.
    macro_rules! avx512 {
        (
            $float:ident by $n:literal, $vector:ident, $mask:ident, $sin_cos:ident up to $largest:ident, $m:ident, $($p:ident)*;
            $set1:ident $andnot:ident $sub:ident $cmp:ident $blend:ident
        ) => {
            mod $m {
                masks! {
                    $vector, $mask, $set1 $andnot $sub;
                    lt(a, b): $cmp::<_CMP_LT_OQ>(a, b);
                    select(mask, a, b): $blend(mask, b, a);
                    and(a, b): a & b;
                    or(a, b): a | b;
                    any(mask): mask != 0
                }
            }
            lanes! { $float by $n, avx512, $vector, $mask, $sin_cos up to $largest; $m $set1 $($p)* }
        };
    }
    avx512! {
        f64 by 8, __m512d, __mmask8, double up to LARGEST, f64x8,
        _mm512_loadu_pd _mm512_storeu_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd _mm512_fmadd_pd _mm512_sqrt_pd;
        _mm512_set1_pd _mm512_andnot_pd _mm512_sub_pd _mm512_cmp_pd_mask _mm512_mask_blend_pd
    }
    avx512! {
        f32 by 16, __m512, __mmask16, single up to LARGEST_SINGLE, f32x16,
        _mm512_loadu_ps _mm512_storeu_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps _mm512_fmadd_ps _mm512_sqrt_ps;
        _mm512_set1_ps _mm512_andnot_ps _mm512_sub_ps _mm512_cmp_ps_mask _mm512_mask_blend_ps
    }
}
