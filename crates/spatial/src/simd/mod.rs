//! Vector instructions: detection of the SIMD level, lanes in registers, and the gate to code compiled for a level.

pub mod fused_f64;
pub mod gate;
pub mod kernel;
pub(crate) mod lanes;
pub mod level;
pub mod pack;
pub mod same_layout;

pub use fused_f64::FusedF64;
pub use kernel::Kernel;
