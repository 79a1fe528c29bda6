//! Lanes with NEON, which every 64-bit Arm processor has. A vector occupies two registers, so it has as many lanes as a
//! vector of AVX2. Therefore NEON and AVX2 use the same source code and the same assignment of limbs to lanes.

use super::{Element, Lanes, Register, instructions};
use crate::simd::kernel::{Kernel, narrow};
use crate::simd::pack::SimdToken;
use core::arch::aarch64::*;

/// Widest vector of `f64`.
pub(crate) type WideF64 = Lanes<f64, 4>;
/// Widest vector of `f32`.
pub(crate) type WideF32 = Lanes<f32, 8>;

/// Implements `Register` for a pair of registers. A mask is two vectors: all bits of a lane are 1 if the mask holds in
/// this lane, otherwise 0.
macro_rules! pair {
    (
        $pair:ident of $n:literal $float:ident, $mask:ident:
        $load:ident $store:ident $splat:ident $add:ident $sub:ident $mul:ident $div:ident $fma:ident $sqrt:ident
        $neg:ident
        $abs:ident $lt:ident $select:ident $and:ident $or:ident $max:ident;
        $($transpose:tt)*
    ) => {
        impl Element<$n> for $float {
            type Register = $pair;
        }
        impl Register<$float, $n> for $pair {
            type Mask = $mask;

            instructions! {
                fn enter(kernel: impl Kernel) { narrow(kernel) }
                fn load(x: [$float; $n]) -> Self { $pair($load(x.as_ptr()), $load(x[$n / 2..].as_ptr())) }
                fn store(a: Self) -> [$float; $n] {{
                    let mut x = [0.0; $n];
                    $store(x.as_mut_ptr(), a.0);
                    $store(x[$n / 2..].as_mut_ptr(), a.1);
                    x
                }}
                fn splat(x: $float) -> Self { $pair($splat(x), $splat(x)) }
                fn zero() -> Self { core::mem::zeroed() }
                fn add(a: Self, b: Self) -> Self { $pair($add(a.0, b.0), $add(a.1, b.1)) }
                fn sub(a: Self, b: Self) -> Self { $pair($sub(a.0, b.0), $sub(a.1, b.1)) }
                fn mul(a: Self, b: Self) -> Self { $pair($mul(a.0, b.0), $mul(a.1, b.1)) }
                fn div(a: Self, b: Self) -> Self { $pair($div(a.0, b.0), $div(a.1, b.1)) }
                fn mul_add(a: Self, b: Self, c: Self) -> Self { $pair($fma(c.0, a.0, b.0), $fma(c.1, a.1, b.1)) }
                fn sqrt(a: Self) -> Self { $pair($sqrt(a.0), $sqrt(a.1)) }
                fn neg(a: Self) -> Self { $pair($neg(a.0), $neg(a.1)) }
                fn abs(a: Self) -> Self { $pair($abs(a.0), $abs(a.1)) }
                fn lt(a: Self, b: Self) -> $mask { $mask($lt(a.0, b.0), $lt(a.1, b.1)) }
                fn select(mask: $mask, a: Self, b: Self) -> Self {
                    $pair($select(mask.0, a.0, b.0), $select(mask.1, a.1, b.1))
                }
                fn and(a: $mask, b: $mask) -> $mask { $mask($and(a.0, b.0), $and(a.1, b.1)) }
                fn or(a: $mask, b: $mask) -> $mask { $mask($or(a.0, b.0), $or(a.1, b.1)) }
                fn any(mask: $mask) -> bool { $max($or(mask.0, mask.1)) != 0 }
                $($transpose)*
            }
        }
    };
}

instructions! {
    /// Returns the largest of the four 32-bit halves of two 64-bit numbers.
    fn largest_half(x: uint64x2_t) -> u32 { vmaxvq_u32(vreinterpretq_u32_u64(x)) }
}

pair! {
    float64x2x2_t of 4 f64, uint64x2x2_t:
    vld1q_f64 vst1q_f64 vdupq_n_f64 vaddq_f64 vsubq_f64 vmulq_f64 vdivq_f64 vfmaq_f64 vsqrtq_f64 vnegq_f64
    vabsq_f64 vcltq_f64 vbslq_f64 vandq_u64 vorrq_u64 largest_half;
    fn transpose(rows: &mut [Self; 4]) {{
        let [a, b, c, d] = *rows;
        *rows = [
            float64x2x2_t(vzip1q_f64(a.0, b.0), vzip1q_f64(c.0, d.0)),
            float64x2x2_t(vzip2q_f64(a.0, b.0), vzip2q_f64(c.0, d.0)),
            float64x2x2_t(vzip1q_f64(a.1, b.1), vzip1q_f64(c.1, d.1)),
            float64x2x2_t(vzip2q_f64(a.1, b.1), vzip2q_f64(c.1, d.1)),
        ];
    }}
}
pair! {
    float32x4x2_t of 8 f32, uint32x4x2_t:
    vld1q_f32 vst1q_f32 vdupq_n_f32 vaddq_f32 vsubq_f32 vmulq_f32 vdivq_f32 vfmaq_f32 vsqrtq_f32 vnegq_f32
    vabsq_f32 vcltq_f32 vbslq_f32 vandq_u32 vorrq_u32 vmaxvq_u32;
}

/// Functions that move numbers between the lanes of a vector of four.
pub mod moves {
    use super::*;

    /// Assignment of source lanes to target lanes. A target lane without a source becomes 0.
    #[derive(Clone, Copy, Debug)]
    pub struct Move {
        /// Indices of the eight bytes of the source number, for each target lane. If a target lane has no source, the
        /// indices are outside the vector.
        from: [[u8; 8]; 4],
    }

    impl Move {
        /// Creates a move from pairs (source lane, target lane).
        pub fn new(pairs: &[(usize, usize)]) -> Self {
            let mut this = Self { from: [[u8::MAX; 8]; 4] };
            for &(from, to) in pairs {
                this.from[to] = core::array::from_fn(|byte| (8 * from + byte) as u8);
            }
            this
        }

        /// Returns the numbers in their new lanes.
        #[inline(always)]
        pub fn apply<W: SimdToken>(&self, x: Lanes<f64, 4>) -> Lanes<f64, 4> {
            // SAFETY: the argument is a vector, so the processor has its SIMD level. Two rows of the array have 16
            // bytes.
            unsafe {
                let bytes = uint8x16x2_t(vreinterpretq_u8_f64(x.0.0), vreinterpretq_u8_f64(x.0.1));
                let first = vqtbl2q_u8(bytes, vld1q_u8(self.from.as_ptr().cast()));
                let second = vqtbl2q_u8(bytes, vld1q_u8(self.from[2..].as_ptr().cast()));
                Lanes(float64x2x2_t(vreinterpretq_f64_u8(first), vreinterpretq_f64_u8(second)))
            }
        }
    }

    /// Returns the sum of the numbers in every lane: (x₀ + x₂) + (x₁ + x₃).
    #[inline(always)]
    pub fn sum<W: SimdToken>(x: Lanes<f64, 4>) -> Lanes<f64, 4> {
        // SAFETY: the argument is a vector, so the processor has its SIMD level.
        unsafe {
            let pairs = vaddq_f64(x.0.0, x.0.1);
            let sum = vpaddq_f64(pairs, pairs);
            Lanes(float64x2x2_t(sum, sum))
        }
    }
}
