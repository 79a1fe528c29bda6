//! Vectors, motions, forces, inertias and poses.

pub(crate) mod inertia;
pub mod lie;
pub(crate) mod motion;
pub(crate) mod quaternion;
pub(crate) mod se3;
pub(crate) mod vector;
