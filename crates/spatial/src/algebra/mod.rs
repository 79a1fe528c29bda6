//! Vectors, motions, forces, inertias and poses.

mod conversions;
pub(crate) mod inertia;
pub mod lie;
pub(crate) mod motion;
mod operators;
pub(crate) mod quaternion;
pub(crate) mod se3;
pub(crate) mod vector;
