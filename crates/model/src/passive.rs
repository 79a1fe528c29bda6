//! Forces that act without being asked: springs of joints and gravity compensation.

use alloc::vec::Vec;
use condyle_spatial::Vec3;

/// Spring of a joint. With the displacement Δ from its rest it acts with
///
/// ```text
/// τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ           (joints of one degree of freedom)
/// τ = −(k₀ + k₁ |Δ| + k₂ |Δ|²) Δ       (others)
/// ```
///
/// on the joint's degrees of freedom, as in MuJoCo. A spherical joint has a rotation vector Δ. A free or planar joint has a
/// displacement of its origin, along the axes of the parent, and a rotation, each with its own |Δ|. It acts in [`passive_torque`](https://docs.rs/condyle-dynamics) and in simulations.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// Index of the body that the joint carries.
    pub body: usize,
    /// Coefficients k₀, k₁ and k₂ (N m/rad, N/m, and these per rad or m, and per its square).
    pub stiffness: [f64; 3],
    /// Position of the joint at which the spring is at rest, as many numbers as q has for the joint.
    pub rest: Vec<f64>,
}

/// Part of a body's weight that is carried by an unseen hand: MuJoCo's `gravcomp`. The force −g m acts at the point
/// `mass_com` / m of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GravityCompensation {
    /// Index of the body.
    pub body: usize,
    /// Mass m whose weight is carried (kg): the sum of factor times mass over what the body is made of.
    pub mass: f64,
    /// Sum of factor times mass times centre of mass, in the body's frame (kg m).
    pub mass_com: Vec3<f64>,
}
