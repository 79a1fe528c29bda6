//! Vector instructions: which there are, numbers side by side in registers, and the one gate to code that is compiled for them.

pub mod alike;
pub mod fused;
pub mod gate;
pub mod kernel;
pub(crate) mod lanes;
pub mod level;
pub mod pack;

pub use fused::Fused;
pub use kernel::Kernel;
