//! Work that is compiled for the instructions of a level, and the doors through which it is entered.
#![allow(unsafe_code)]

/// Work that is to be compiled for a level: `run` is always inlined, and so takes the level of the function it stands in.
pub trait Kernel: Sized {
    /// The work.
    fn run(self);
}

/// Runs a kernel with the instructions of [`Real::Short`](crate::simd::pack::Real::Short): those of
/// [`Level::Avx2`](crate::simd::level::Level::Avx2), or of [`Level::Neon`](crate::simd::level::Level::Neon), which every 64-bit Arm has.
///
/// # Safety
/// The processor must have them.
#[inline(never)]
#[cfg_attr(target_arch = "x86_64", target_feature(enable = "avx2,fma"))]
pub unsafe fn short(kernel: impl Kernel) {
    kernel.run();
}
