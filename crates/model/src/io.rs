//! Robots from files.

pub(crate) mod mjcf;
pub(crate) mod packages;
pub(crate) mod sdf;
pub(crate) mod urdf;
mod xml;
