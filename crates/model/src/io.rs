//! Files of robots: URDF, MJCF, SDF, and those of serde.

mod description;
pub(crate) mod mjcf;
mod packages;
pub(crate) mod sdf;
pub(crate) mod urdf;
mod xml;
