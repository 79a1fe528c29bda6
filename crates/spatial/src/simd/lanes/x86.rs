//! Lanes with AVX2 and FMA, and with AVX-512.

use super::{Element, Lanes, Register, instructions};
use crate::simd::kernel::{Kernel, narrow};
use crate::simd::level::{Level, assert_supported};
use crate::simd::pack::SimdToken;
use core::arch::x86_64::*;

/// Widest vector of `f64`.
pub(crate) type WideF64 = Lanes<f64, 8>;
/// Widest vector of `f32`.
pub(crate) type WideF32 = Lanes<f32, 16>;

/// Runs a kernel with the instructions of [`Level::Avx512`](crate::simd::level::Level::Avx512).
///
/// # Panics
/// If the processor does not have these instructions.
#[inline(always)]
fn wide(kernel: impl Kernel) {
    #[inline(never)]
    #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
    fn with_instructions(kernel: impl Kernel) {
        kernel.run();
    }
    assert_supported(Level::Avx512);
    // SAFETY: the processor has the instructions.
    unsafe { with_instructions(kernel) }
}

/// Implements `Register` for a register type, given the names of the instructions for this type.
macro_rules! register {
    (
        $register:ident of $n:literal $float:ident, $mask:ident, $enter:ident;
        $load:ident $store:ident $splat:ident $add:ident $sub:ident $mul:ident $div:ident $fmadd:ident $sqrt:ident
        $andnot:ident;
        $($others:tt)*
    ) => {
        impl Element<$n> for $float {
            type Register = $register;
        }
        impl Register<$float, $n> for $register {
            type Mask = $mask;

            instructions! {
                fn enter(kernel: impl Kernel) { $enter(kernel) }
                fn load(x: [$float; $n]) -> Self { $load(x.as_ptr()) }
                fn store(a: Self) -> [$float; $n] {{
                    let mut x = [0.0; $n];
                    $store(x.as_mut_ptr(), a);
                    x
                }}
                fn splat(x: $float) -> Self { $splat(x) }
                fn zero() -> Self { core::mem::zeroed() }
                fn add(a: Self, b: Self) -> Self { $add(a, b) }
                fn sub(a: Self, b: Self) -> Self { $sub(a, b) }
                fn mul(a: Self, b: Self) -> Self { $mul(a, b) }
                fn div(a: Self, b: Self) -> Self { $div(a, b) }
                fn mul_add(a: Self, b: Self, c: Self) -> Self { $fmadd(a, b, c) }
                fn sqrt(a: Self) -> Self { $sqrt(a) }
                fn neg(a: Self) -> Self { $sub($splat(-0.0), a) }
                fn abs(a: Self) -> Self { $andnot($splat(-0.0), a) }
                $($others)*
            }
        }
    };
}

/// Implements `Register` for an AVX2 register. A mask is a vector: all bits of a lane are 1 if the mask holds in this
/// lane, otherwise 0.
macro_rules! avx2 {
    (
        $register:ident of $n:literal $float:ident: $($alike:ident)*;
        $cmp:ident $blendv:ident $and:ident $or:ident $movemask:ident;
        $($transpose:tt)*
    ) => {
        register! {
            $register of $n $float, $register, narrow; $($alike)*;
            fn lt(a: Self, b: Self) -> Self { $cmp::<_CMP_LT_OQ>(a, b) }
            fn select(mask: Self, a: Self, b: Self) -> Self { $blendv(b, a, mask) }
            fn and(a: Self, b: Self) -> Self { $and(a, b) }
            fn or(a: Self, b: Self) -> Self { $or(a, b) }
            fn any(mask: Self) -> bool { $movemask(mask) != 0 }
            $($transpose)*
        }
    };
}

/// Implements `Register` for an AVX-512 register. A mask is an integer with one bit per lane.
macro_rules! avx512 {
    (
        $register:ident of $n:literal $float:ident, $mask:ident: $($alike:ident)*;
        $cmp:ident $blend:ident $load_first:ident $store_first:ident;
        $($transpose:tt)*
    ) => {
        register! {
            $register of $n $float, $mask, wide; $($alike)*;
            fn lt(a: Self, b: Self) -> $mask { $cmp::<_CMP_LT_OQ>(a, b) }
            fn select(mask: $mask, a: Self, b: Self) -> Self { $blend(mask, b, a) }
            fn and(a: $mask, b: $mask) -> $mask { a & b }
            fn or(a: $mask, b: $mask) -> $mask { a | b }
            fn any(mask: $mask) -> bool { mask != 0 }
            fn load_first(x: &[$float]) -> Self {{
                assert!(x.len() <= $n, "more numbers than lanes");
                $load_first((1_u32 << x.len()).wrapping_sub(1) as $mask, x.as_ptr())
            }}
            fn store_first(a: Self, to: &mut [$float]) {{
                assert!(to.len() <= $n, "more numbers than lanes");
                $store_first(to.as_mut_ptr(), (1_u32 << to.len()).wrapping_sub(1) as $mask, a)
            }}
            $($transpose)*
        }
    };
}

avx2! {
    __m256d of 4 f64:
    _mm256_loadu_pd _mm256_storeu_pd _mm256_set1_pd _mm256_add_pd _mm256_sub_pd _mm256_mul_pd _mm256_div_pd
    _mm256_fmadd_pd _mm256_sqrt_pd _mm256_andnot_pd;
    _mm256_cmp_pd _mm256_blendv_pd _mm256_and_pd _mm256_or_pd _mm256_movemask_pd;
    fn transpose(rows: &mut [Self; 4]) {{
        let [a, b, c, d] = *rows;
        let (even, odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b)); // numbers 0, 2 and 1, 3 of rows 0, 1
        let (even2, odd2) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d)); // numbers 0, 2 and 1, 3 of rows 2, 3
        *rows = [
            _mm256_permute2f128_pd::<0x20>(even, even2),
            _mm256_permute2f128_pd::<0x20>(odd, odd2),
            _mm256_permute2f128_pd::<0x31>(even, even2),
            _mm256_permute2f128_pd::<0x31>(odd, odd2),
        ];
    }}
}
avx2! {
    __m256 of 8 f32:
    _mm256_loadu_ps _mm256_storeu_ps _mm256_set1_ps _mm256_add_ps _mm256_sub_ps _mm256_mul_ps _mm256_div_ps
    _mm256_fmadd_ps _mm256_sqrt_ps _mm256_andnot_ps;
    _mm256_cmp_ps _mm256_blendv_ps _mm256_and_ps _mm256_or_ps _mm256_movemask_ps;
}
avx512! {
    __m512d of 8 f64, __mmask8:
    _mm512_loadu_pd _mm512_storeu_pd _mm512_set1_pd _mm512_add_pd _mm512_sub_pd _mm512_mul_pd _mm512_div_pd
    _mm512_fmadd_pd _mm512_sqrt_pd _mm512_andnot_pd;
    _mm512_cmp_pd_mask _mm512_mask_blend_pd _mm512_maskz_loadu_pd _mm512_mask_storeu_pd;
    fn transpose(rows: &mut [Self; 8]) {{
        let [a, b, c, d, e, f, g, h] = *rows;
        let even = [
            _mm512_unpacklo_pd(a, b),
            _mm512_unpacklo_pd(c, d),
            _mm512_unpacklo_pd(e, f),
            _mm512_unpacklo_pd(g, h),
        ];
        let odd = [
            _mm512_unpackhi_pd(a, b),
            _mm512_unpackhi_pd(c, d),
            _mm512_unpackhi_pd(e, f),
            _mm512_unpackhi_pd(g, h),
        ];
        let ([a, c, e, g], [b, d, f, h]) = (columns(even), columns(odd));
        *rows = [a, b, c, d, e, f, g, h];
    }}
}
avx512! {
    __m512 of 16 f32, __mmask16:
    _mm512_loadu_ps _mm512_storeu_ps _mm512_set1_ps _mm512_add_ps _mm512_sub_ps _mm512_mul_ps _mm512_div_ps
    _mm512_fmadd_ps _mm512_sqrt_ps _mm512_andnot_ps;
    _mm512_cmp_ps_mask _mm512_mask_blend_ps _mm512_maskz_loadu_ps _mm512_mask_storeu_ps;
}

instructions! {
    /// Returns numbers k, k + 2, k + 4 and k + 6 of eight rows. Each given vector contains numbers k, k + 2, … of two
    /// rows.
    fn columns(x: [__m512d; 4]) -> [__m512d; 4] {{
        let (low, high) = (_mm512_shuffle_f64x2::<0x88>(x[0], x[1]), _mm512_shuffle_f64x2::<0x88>(x[2], x[3]));
        let (low2, high2) = (_mm512_shuffle_f64x2::<0xdd>(x[0], x[1]), _mm512_shuffle_f64x2::<0xdd>(x[2], x[3]));
        [
            _mm512_shuffle_f64x2::<0x88>(low, high),
            _mm512_shuffle_f64x2::<0x88>(low2, high2),
            _mm512_shuffle_f64x2::<0xdd>(low, high),
            _mm512_shuffle_f64x2::<0xdd>(low2, high2),
        ]
    }}
}

/// Functions that move numbers between the lanes of a vector of four.
pub mod moves {
    use super::*;

    /// Assignment of source lanes to target lanes. A target lane without a source becomes 0.
    #[derive(Clone, Copy, Debug)]
    pub struct Move {
        /// Indices of the two 32-bit halves of the source number, for each target lane.
        from: [i32; 8],
        /// Mask: all bits of a lane are 1 if this lane receives a number, otherwise 0.
        to: [i64; 4],
    }

    impl Move {
        /// Creates a move from pairs (source lane, target lane).
        pub fn new(pairs: &[(usize, usize)]) -> Self {
            let mut this = Self { from: [0; 8], to: [0; 4] };
            for &(from, to) in pairs {
                (this.from[2 * to], this.from[2 * to + 1]) = (2 * from as i32, 2 * from as i32 + 1);
                this.to[to] = -1;
            }
            this
        }

        /// Returns the numbers in their new lanes.
        #[inline(always)]
        pub fn apply<W: SimdToken>(&self, x: Lanes<f64, 4>) -> Lanes<f64, 4> {
            // SAFETY: the argument is a vector, so the processor has its SIMD level. Each array has 32 bytes.
            unsafe {
                let from = _mm256_loadu_si256(self.from.as_ptr().cast());
                let to = _mm256_loadu_ps(self.to.as_ptr().cast());
                let moved = _mm256_permutevar8x32_ps(_mm256_castpd_ps(x.0), from);
                Lanes(_mm256_castps_pd(_mm256_and_ps(moved, to)))
            }
        }
    }

    /// Returns the sum of the numbers in every lane: (x₀ + x₂) + (x₁ + x₃).
    #[inline(always)]
    pub fn sum<W: SimdToken>(x: Lanes<f64, 4>) -> Lanes<f64, 4> {
        // SAFETY: the argument is a vector, so the processor has its SIMD level.
        unsafe {
            let pairs = _mm256_add_pd(x.0, _mm256_permute2f128_pd::<1>(x.0, x.0));
            Lanes(_mm256_add_pd(pairs, _mm256_permute_pd::<0b0101>(pairs)))
        }
    }
}
