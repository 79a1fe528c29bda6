//! Poses, and their action on motions, forces, inertias and points.

use crate::algebra::motion::{Force, Motion};
use crate::algebra::vector::{Mat3, Vec3, impl_lift};
use crate::scalar::{Constant, Scalar};
use core::ops::Mul;

/// Pose aXb of frame b in frame a. It maps coordinates in b to coordinates in a.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Se3<S> {
    /// Rotation aRb. Its columns are the axes of b in coordinates of a.
    pub rotation: Mat3<S>,
    /// Origin of frame b in coordinates of frame a (m).
    pub translation: Vec3<S>,
}
impl_lift!(Se3 { rotation, translation });

/// Action of a pose on the coordinates of a value of type `T`.
pub trait Act<T> {
    /// Maps coordinates in b to coordinates in a, for the pose aXb.
    fn act(&self, x: T) -> T;
    /// Maps coordinates in a to coordinates in b, for the pose aXb.
    fn act_inv(&self, x: T) -> T;
}

impl<S: Scalar> Se3<S> {
    /// Returns the identity: the pose of a frame in itself.
    #[inline(always)]
    pub fn identity() -> Self {
        Self { rotation: Mat3::identity(), translation: Vec3::zero() }
    }
    /// Creates a pose from rotation and translation.
    #[inline(always)]
    pub fn new(rotation: Mat3<S>, translation: Vec3<S>) -> Self {
        Self { rotation, translation }
    }
    /// Returns bXa = (aXb)⁻¹.
    #[inline(always)]
    pub fn inverse(self) -> Self {
        let Rt = self.rotation.transpose();
        Self { rotation: Rt, translation: -(Rt * self.translation) }
    }
}

impl<S: Scalar> Mul for Se3<S> {
    type Output = Self;
    /// Returns aXc = aXb bXc.
    #[inline(always)]
    fn mul(self, o: Self) -> Self {
        Self {
            rotation: self.rotation * o.rotation,
            translation: self.rotation.mul_add(o.translation, self.translation),
        }
    }
}

impl<S: Scalar> Act<Motion<S>> for Se3<S> {
    /// Returns [R v + p × R ω; R ω] for the motion m = [v; ω] and the pose (R, p).
    #[inline(always)]
    fn act(&self, m: Motion<S>) -> Motion<S> {
        let angular = self.rotation * m.angular;
        Motion { linear: self.translation.cross_add(angular, self.rotation * m.linear), angular }
    }
    /// Returns [Rᵀ(v − p × ω); Rᵀ ω] for the motion m = [v; ω] and the pose (R, p).
    #[inline(always)]
    fn act_inv(&self, m: Motion<S>) -> Motion<S> {
        Motion {
            linear: self.rotation.transpose_mul(m.angular.cross_add(self.translation, m.linear)),
            angular: self.rotation.transpose_mul(m.angular),
        }
    }
}

impl<S: Scalar> Act<Force<S>> for Se3<S> {
    /// Returns [R f; R n + p × R f] for a force f with the moment n and the pose (R, p).
    #[inline(always)]
    fn act(&self, f: Force<S>) -> Force<S> {
        let linear = self.rotation * f.linear;
        Force { linear, angular: self.translation.cross_add(linear, self.rotation * f.angular) }
    }
    /// Returns [Rᵀ f; Rᵀ(n − p × f)] for a force f with the moment n and the pose (R, p).
    #[inline(always)]
    fn act_inv(&self, f: Force<S>) -> Force<S> {
        Force {
            linear: self.rotation.transpose_mul(f.linear),
            angular: self.rotation.transpose_mul(f.linear.cross_add(self.translation, f.angular)),
        }
    }
}

/// Action of a pose on a point.
impl<S: Scalar> Act<Vec3<S>> for Se3<S> {
    /// Returns R x + p for the pose (R, p).
    #[inline(always)]
    fn act(&self, x: Vec3<S>) -> Vec3<S> {
        self.rotation.mul_add(x, self.translation)
    }
    /// Returns Rᵀ(x − p) for the pose (R, p).
    #[inline(always)]
    fn act_inv(&self, x: Vec3<S>) -> Vec3<S> {
        self.rotation.transpose_mul(x - self.translation)
    }
}
