//! Passive forces: springs of joints and gravity compensation.

use alloc::vec::Vec;
use condyle_spatial::Vec3;

/// Spring of a joint. With the displacement Δ from its rest position, it exerts
///
/// ```text
/// τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ           (joints of one degree of freedom)
/// τ = −(k₀ + k₁ |Δ| + k₂ |Δ|²) Δ       (others)
/// ```
///
/// on the joint's degrees of freedom, as in MuJoCo. For a spherical joint, Δ is a rotation vector. For a free or planar
/// joint, Δ is a displacement of the origin, along the axes of the parent, and a rotation, each with its own |Δ|. The
/// spring acts in [`passive_torque`](https://docs.rs/condyle-dynamics) and in simulations.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// Index of the body that the joint carries.
    pub body: usize,
    /// Coefficients k₀, k₁ and k₂ (k₀: N m/rad, N/m; k₁ and k₂: the same per rad or m, and per its square).
    pub stiffness: [f64; 3],
    /// Position of the joint at which the spring is at rest; it has the numbers that q has for the joint.
    pub rest: Vec<f64>,
}

/// Compensation of a part of a body's weight by an external force: MuJoCo's `gravcomp`. The force −g m acts at the
/// point `mass_com` / m of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GravityCompensation {
    /// Index of the body.
    pub body: usize,
    /// Mass m whose weight is compensated (kg): the sum of factor times mass over the parts of the body.
    pub mass: f64,
    /// Sum of factor times mass times centre of mass over the parts of the body, in the body's frame (kg m).
    pub mass_com: Vec3<f64>,
}
