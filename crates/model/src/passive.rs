//! Passive forces: springs of joints and gravity compensation.

use alloc::vec::Vec;
use condyle_spatial::{Inertia, Scalar, Sym3, Vec3};

/// Spring of a joint. Δ is the displacement of the joint from the rest position of the spring. The spring exerts
///
/// ```text
/// τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ           (joints of one degree of freedom)
/// τ = −(k₀ + k₁ |Δ| + k₂ |Δ|²) Δ       (others)
/// ```
///
/// on the joint's degrees of freedom, as in MuJoCo. For a spherical joint, Δ is a rotation vector. A free or planar
/// joint has two displacements, each with its own norm |Δ|. One is the displacement of the origin, along the axes of
/// the parent. The other is a rotation. The spring acts in [`passive_torque`](https://docs.rs/condyle-dynamics) and in
/// simulations.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Spring {
    /// Index of the body that the joint carries.
    pub body: usize,
    /// Coefficients k₀, k₁ and k₂. The unit of k₀ is N m/rad or N/m. The units of k₁ and k₂ are the unit of k₀ per rad
    /// or m, and per square of rad or m.
    pub stiffness: [f64; 3],
    /// Position of the joint at which the spring is at rest. The length is the number of coordinates of the joint in q.
    pub rest: Vec<f64>,
}

/// Compensation of the weight of a body by an external force, as with MuJoCo's `gravcomp`. The compensated mass m has
/// its centre at c ([`carried`](Self::carried)), and the force −m g acts at c, with the gravity g.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GravityCompensation {
    /// Index of the body.
    pub body: usize,
    /// Ratio of the compensated weight to the body's weight; 1 compensates the whole weight. When the body's inertia
    /// changes, the compensated mass changes, too.
    pub ratio: f64,
    /// Mass that is compensated in addition (kg), because parts of the body have another ratio. The added mass is
    /// negative if the ratio of these parts is smaller. It does not change with the body's inertia.
    pub added_mass: f64,
    /// Added mass times its centre of mass, in the body's frame (kg m).
    pub added_mass_com: Vec3<f64>,
}

impl GravityCompensation {
    /// Returns the compensated mass and its centre, as an inertia without rotational part in the body's frame. `body`
    /// is the inertia of the body.
    pub fn carried<S: Scalar>(&self, body: Inertia<S>) -> Inertia<S> {
        let ratio = S::splat(self.ratio);
        Inertia {
            mass: body.mass * ratio + S::splat(self.added_mass),
            mass_com: body.mass_com.scale(ratio) + self.added_mass_com.lift(),
            rotational: Sym3::zero(),
        }
    }
}
