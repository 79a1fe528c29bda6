//! Dynamics and energies as linear functions of the inertial parameters.
//!
//! π stacks the ten [parameters](crate::inertial_parameters) of each body, the world left out. All that follows is one
//! bilinear form: ⟨m, I w⟩ = y(m, w) · π_i. With velocity v, acceleration a and a column S of a joint on the way to the
//! body, all in the body's frame,
//!
//! ```text
//! τ_S = ⟨S, I a + v ×* I v⟩ = (y(S, a) − y(v × S, v)) · π_i,     T_i = ½ y(v, v) · π_i
//! ```
//!
//! Source: Atkeson, An, Hollerbach, *Estimation of inertial parameters of manipulator loads and links* (1986);
//! the form y makes the 6 × 10 matrices of that paper superfluous.

use crate::workspace::{Size, filled, zero_matrix};
use alloc::vec::Vec;
use condyle_spatial::{Cross, Motion, Scalar};
use nalgebra::DMatrix;

/// The number of numbers that describe the inertia of a body.
pub(crate) const PARAMETERS: usize = 10;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// Y. Shape: nv × 10 (bodies − 1). Written by: `joint_torque_regressor`.
    pub torque: DMatrix<S>,
    /// Shape: 10 (bodies − 1). Written by: `kinetic_energy_regressor`.
    pub kinetic: Vec<S>,
    /// Shape: 10 (bodies − 1). Written by: `potential_energy_regressor`.
    pub potential: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        let parameters = PARAMETERS * (size.bodies - 1);
        Self {
            torque: zero_matrix(size.nv, parameters),
            kinetic: filled(S::zero, parameters),
            potential: filled(S::zero, parameters),
        }
    }
}

/// y(m, w), the ten numbers with ⟨m, I w⟩ = y · π; symmetric in m and w.
#[inline(always)]
pub(crate) fn pairing<S: Scalar>(m: Motion<S>, w: Motion<S>) -> [S; PARAMETERS] {
    let (a, b) = (m.angular, w.angular);
    let h = m.linear.cross(b) + w.linear.cross(a); // ⟨m_v, −h × w_ω⟩ + ⟨m_ω, h × w_v⟩
    [
        m.linear.dot(w.linear), // m m_v · w_v
        h.x,
        h.y,
        h.z,
        a.x * b.x, // m_ω · Ī w_ω
        a.x.mul_add(b.y, a.y * b.x),
        a.y * b.y,
        a.x.mul_add(b.z, a.z * b.x),
        a.y.mul_add(b.z, a.z * b.y),
        a.z * b.z,
    ]
}

/// y(S, a) − y(v × S, v): the effort at a column S of a body with velocity v and acceleration a, per parameter.
#[inline(always)]
pub(crate) fn effort<S: Scalar>(column: Motion<S>, v: Motion<S>, a: Motion<S>) -> [S; PARAMETERS] {
    let (linear, quadratic) = (pairing(column, a), pairing(v.cross(column), v));
    core::array::from_fn(|k| linear[k] - quadratic[k])
}
