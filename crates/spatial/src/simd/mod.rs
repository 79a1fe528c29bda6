//! Vector instructions: detection of the SIMD level, lanes in registers, and the gate to code compiled for a level.

pub mod alike;
pub mod fused;
pub mod gate;
pub mod kernel;
pub(crate) mod lanes;
pub mod level;
pub mod pack;

pub use fused::Fused;
pub use kernel::Kernel;
