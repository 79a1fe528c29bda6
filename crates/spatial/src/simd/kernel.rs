//! Work that is compiled for the instructions of a level, and the doors through which it is entered.
#![allow(unsafe_code)]

use crate::simd::level::{SHORT, assert_supported};

/// Work that is to be compiled for a level: `run` is always inlined, and so takes the level of the function it stands in.
pub trait Kernel: Sized {
    /// The work.
    fn run(self);
}

/// Runs a kernel with the instructions of [`Real::Short`](crate::simd::pack::Real::Short): those of
/// [`Level::Avx2`](crate::simd::level::Level::Avx2), or where the processor is of another kind, of its only level.
///
/// # Panics
/// If the processor does not have them.
#[inline(always)]
pub fn short(kernel: impl Kernel) {
    #[inline(never)]
    #[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
    fn with_instructions(kernel: impl Kernel) {
        kernel.run();
    }
    assert_supported(SHORT);
    // SAFETY: the processor has the instructions.
    #[allow(unused_unsafe)] // elsewhere than on x86-64 every processor has them
    unsafe {
        with_instructions(kernel);
    }
}
