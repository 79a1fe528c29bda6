//! Lanes with SIMD128 of WebAssembly. A vector occupies two registers, as with NEON. There are no fused products:
//! `mul_add` rounds the product before the sum, for lanes and for single numbers.

use super::{Element, Lanes, Register, instructions};
use crate::simd::kernel::{Kernel, narrow};
use crate::simd::pack::SimdToken;
use core::arch::wasm32::*;

/// Widest vector of `f64`.
pub(crate) type WideF64 = Lanes<f64, 4>;
/// Widest vector of `f32`.
pub(crate) type WideF32 = Lanes<f32, 8>;

/// Mask of two registers: all bits of a lane are 1 if the mask holds in this lane, otherwise 0.
#[derive(Clone, Copy)]
pub struct Mask(v128, v128);

macro_rules! pair {
    (
        $pair:ident of $n:literal $float:ident:
        $splat:ident $add:ident $sub:ident $mul:ident $div:ident $sqrt:ident $neg:ident $abs:ident $lt:ident;
        $($transpose:tt)*
    ) => {
        /// Vector of numbers in two registers.
        #[derive(Clone, Copy)]
        pub struct $pair(v128, v128);

        impl Element<$n> for $float {
            type Register = $pair;
        }
        impl Register<$float, $n> for $pair {
            type Mask = Mask;

            instructions! {
                fn enter(kernel: impl Kernel) { narrow(kernel) }
                fn load(x: [$float; $n]) -> Self {
                    $pair(v128_load(x.as_ptr().cast()), v128_load(x[$n / 2..].as_ptr().cast()))
                }
                fn store(a: Self) -> [$float; $n] {{
                    let mut x = [0.0; $n];
                    v128_store(x.as_mut_ptr().cast(), a.0);
                    v128_store(x[$n / 2..].as_mut_ptr().cast(), a.1);
                    x
                }}
                fn splat(x: $float) -> Self { $pair($splat(x), $splat(x)) }
                fn zero() -> Self { core::mem::zeroed() }
                fn add(a: Self, b: Self) -> Self { $pair($add(a.0, b.0), $add(a.1, b.1)) }
                fn sub(a: Self, b: Self) -> Self { $pair($sub(a.0, b.0), $sub(a.1, b.1)) }
                fn mul(a: Self, b: Self) -> Self { $pair($mul(a.0, b.0), $mul(a.1, b.1)) }
                fn div(a: Self, b: Self) -> Self { $pair($div(a.0, b.0), $div(a.1, b.1)) }
                fn mul_add(a: Self, b: Self, c: Self) -> Self {
                    $pair($add($mul(a.0, b.0), c.0), $add($mul(a.1, b.1), c.1))
                }
                fn sqrt(a: Self) -> Self { $pair($sqrt(a.0), $sqrt(a.1)) }
                fn neg(a: Self) -> Self { $pair($neg(a.0), $neg(a.1)) }
                fn abs(a: Self) -> Self { $pair($abs(a.0), $abs(a.1)) }
                fn lt(a: Self, b: Self) -> Mask { Mask($lt(a.0, b.0), $lt(a.1, b.1)) }
                fn select(mask: Mask, a: Self, b: Self) -> Self {
                    $pair(v128_bitselect(a.0, b.0, mask.0), v128_bitselect(a.1, b.1, mask.1))
                }
                fn and(a: Mask, b: Mask) -> Mask { Mask(v128_and(a.0, b.0), v128_and(a.1, b.1)) }
                fn or(a: Mask, b: Mask) -> Mask { Mask(v128_or(a.0, b.0), v128_or(a.1, b.1)) }
                fn any(mask: Mask) -> bool { v128_any_true(v128_or(mask.0, mask.1)) }
                $($transpose)*
            }
        }
    };
}

pair! {
    Doubles of 4 f64:
    f64x2_splat f64x2_add f64x2_sub f64x2_mul f64x2_div f64x2_sqrt f64x2_neg f64x2_abs f64x2_lt;
    fn transpose(rows: &mut [Self; 4]) {{
        let [a, b, c, d] = *rows;
        *rows = [
            Doubles(i64x2_shuffle::<0, 2>(a.0, b.0), i64x2_shuffle::<0, 2>(c.0, d.0)),
            Doubles(i64x2_shuffle::<1, 3>(a.0, b.0), i64x2_shuffle::<1, 3>(c.0, d.0)),
            Doubles(i64x2_shuffle::<0, 2>(a.1, b.1), i64x2_shuffle::<0, 2>(c.1, d.1)),
            Doubles(i64x2_shuffle::<1, 3>(a.1, b.1), i64x2_shuffle::<1, 3>(c.1, d.1)),
        ];
    }}
}
pair! {
    Floats of 8 f32:
    f32x4_splat f32x4_add f32x4_sub f32x4_mul f32x4_div f32x4_sqrt f32x4_neg f32x4_abs f32x4_lt;
}

/// Functions that move numbers between the lanes of a vector of four.
pub mod moves {
    use super::*;

    /// Assignment of source lanes to target lanes. A target lane without a source becomes 0.
    #[derive(Clone, Copy, Debug)]
    pub struct Move {
        /// Indices of the eight bytes of the source number, for each source register and target lane. If the source
        /// number is not in this register, the indices are outside the register.
        from: [[[u8; 8]; 4]; 2],
    }

    impl Move {
        /// Creates a move from pairs (source lane, target lane).
        pub fn new(pairs: &[(usize, usize)]) -> Self {
            let mut this = Self { from: [[[u8::MAX; 8]; 4]; 2] };
            for &(from, to) in pairs {
                this.from[from / 2][to] = core::array::from_fn(|byte| (8 * (from % 2) + byte) as u8);
            }
            this
        }

        /// Returns the numbers in their new lanes.
        #[inline(always)]
        pub fn apply<W: SimdToken>(&self, x: Lanes<f64, 4>) -> Lanes<f64, 4> {
            let [first, second] = &self.from;
            // SAFETY: the load reads 16 bytes: two rows of eight bytes.
            let bytes = |rows: &[[u8; 8]]| unsafe { v128_load(rows[..2].as_ptr().cast()) };
            let half = |rows: [&[[u8; 8]]; 2]| {
                v128_or(u8x16_swizzle(x.0.0, bytes(rows[0])), u8x16_swizzle(x.0.1, bytes(rows[1])))
            };
            Lanes(Doubles(half([&first[..2], &second[..2]]), half([&first[2..], &second[2..]])))
        }
    }

    /// Returns the sum of the numbers in every lane: (x₀ + x₂) + (x₁ + x₃).
    #[inline(always)]
    pub fn sum<W: SimdToken>(x: Lanes<f64, 4>) -> Lanes<f64, 4> {
        let pairs = f64x2_add(x.0.0, x.0.1);
        let sum = f64x2_add(pairs, i64x2_shuffle::<1, 0>(pairs, pairs));
        Lanes(Doubles(sum, sum))
    }
}
