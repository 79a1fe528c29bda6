//! Passive forces: springs of joints and gravity compensation.

use alloc::vec::Vec;
use condyle_spatial::{Inertia, Scalar, Sym3, Vec3};

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

/// Compensation of the weight of a body by an external force: MuJoCo's `gravcomp`. With the compensated mass m and its
/// centre c ([`carried`](Self::carried)), the force −m g acts at c.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GravityCompensation {
    /// Index of the body.
    pub body: usize,
    /// Ratio of the body's weight that is compensated; 1 compensates all of it. The compensated mass follows when the
    /// body's inertia changes.
    pub ratio: f64,
    /// Mass that is compensated in addition (kg), for parts of the body with another ratio. It is negative if their
    /// ratio is smaller, and stays when the body's inertia changes.
    pub added_mass: f64,
    /// Added mass times its centre of mass, in the body's frame (kg m).
    pub added_mass_com: Vec3<f64>,
}

impl GravityCompensation {
    /// Returns the compensated mass and its centre as an inertia without rotational part, for the body's inertia. Both
    /// are in the body's frame.
    pub fn carried<S: Scalar>(&self, body: Inertia<S>) -> Inertia<S> {
        let ratio = S::splat(self.ratio);
        Inertia {
            mass: body.mass * ratio + S::splat(self.added_mass),
            mass_com: body.mass_com.scale(ratio) + self.added_mass_com.lift(),
            rotational: Sym3::zero(),
        }
    }
}
