//! Trait of functions that are compiled for the instructions of a SIMD level, and the functions that call them.
#![allow(unsafe_code)]

use crate::simd::level::{NARROW, assert_supported};

/// Function, with its arguments, that is compiled for a SIMD level. `run` is always inlined, so `run` is compiled for
/// the SIMD level of the function that calls it.
pub trait Kernel: Sized {
    /// Runs the function on the arguments that `self` holds.
    fn run(self);
}

/// Runs a kernel with the instructions of [`Real::Narrow`](crate::simd::pack::Real::Narrow).
///
/// On x86-64, these instructions belong to [`Level::Avx2`](crate::simd::level::Level::Avx2). Other processors have only
/// one level.
///
/// # Panics
/// If the processor does not have these instructions.
#[inline(always)]
pub fn narrow(kernel: impl Kernel) {
    #[inline(never)]
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
    fn with_instructions(kernel: impl Kernel) {
        kernel.run();
    }
    assert_supported(NARROW);
    // SAFETY: the processor has the instructions.
    #[allow(unused_unsafe)] // except on x86-64, every processor has the instructions
    unsafe {
        with_instructions(kernel);
    }
}
