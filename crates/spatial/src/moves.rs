//! Numbers that change their lane, in vectors of four.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
use crate::lanes::Lanes;
#[cfg(target_arch = "x86_64")]
use core::arch::x86_64::*;

/// Which lane's number goes to which lane; a lane to which none goes becomes 0.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))]
pub struct Move {
    /// Of each lane, the two halves of the number that it gets.
    from: [i32; 8],
    /// All bits set in a lane that gets a number.
    to: [i64; 4],
}

impl Move {
    /// From lane to lane, for each pair.
    pub fn new(pairs: &[(usize, usize)]) -> Self {
        let mut this = Self { from: [0; 8], to: [0; 4] };
        for &(from, to) in pairs {
            (this.from[2 * to], this.from[2 * to + 1]) = (2 * from as i32, 2 * from as i32 + 1);
            this.to[to] = -1;
        }
        this
    }

    /// The numbers in their new lanes.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub fn apply(&self, x: Lanes<f64, 4>) -> Lanes<f64, 4> {
        // SAFETY: a vector of this kind exists, so the level is supported; the arrays have 32 bytes each.
        unsafe {
            let from = _mm256_loadu_si256(self.from.as_ptr().cast());
            let to = _mm256_loadu_ps(self.to.as_ptr().cast());
            let moved = _mm256_permutevar8x32_ps(_mm256_castpd_ps(x.0), from);
            Lanes(_mm256_castps_pd(_mm256_and_ps(moved, to)))
        }
    }
}

/// The sum of the numbers, in every lane.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn sum(x: Lanes<f64, 4>) -> Lanes<f64, 4> {
    // SAFETY: a vector of this kind exists, so the level is supported.
    unsafe {
        let pairs = _mm256_add_pd(x.0, _mm256_permute2f128_pd::<1>(x.0, x.0));
        Lanes(_mm256_add_pd(pairs, _mm256_permute_pd::<0b0101>(pairs)))
    }
}
