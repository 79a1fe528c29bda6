//! Lie group of the positions of a joint. `q ⊕ δ` multiplies q by the exponential of δ, where δ is in the body's frame.

use super::{Joint, rotated_about_z};
use condyle_spatial::Quaternion;
use condyle_spatial::lie::{self, MotionMap};
use condyle_spatial::{Motion, Scalar, Se3, Vec3};

impl Joint {
    /// Sets the position at which the body is at the frame of its joint.
    pub(crate) fn neutral(self, q: &mut [f64]) {
        q.fill(0.0);
        match self {
            Self::Continuous { .. } => q[0] = 1.0,
            Self::Spherical => q[3] = 1.0,
            Self::Planar => q[2] = 1.0,
            Self::FreeFlyer => q[6] = 1.0,
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {}
        }
    }

    /// Returns the range of the joint's coordinates that form a vector of length 1; `None` if the joint has no such
    /// coordinates.
    pub(crate) fn unit_part(self) -> Option<core::ops::Range<usize>> {
        match self {
            Self::Continuous { .. } => Some(0..2),
            Self::Planar => Some(2..4),
            Self::Spherical => Some(0..4),
            Self::FreeFlyer => Some(3..7),
            _ => None,
        }
    }

    /// Sets a uniformly distributed random position. Lengths and angles are between their limits, and rotations are
    /// drawn from the whole group.
    pub(crate) fn random(self, rng: &mut impl rand::Rng, lower: &[f64], upper: &[f64], q: &mut [f64]) {
        use rand::RngExt;
        for ((q, &lower), &upper) in q.iter_mut().zip(lower).zip(upper) {
            *q = lower + (upper - lower) * rng.random::<f64>();
        }
        let (sin, cos) = (core::f64::consts::TAU * rng.random::<f64>()).sin_cos();
        let mut rotate = |q: &mut [f64]| {
            // Draws a quaternion that is uniformly distributed on the unit sphere. Source: Shoemake (1992).
            let (u, a) = (rng.random::<f64>(), (core::f64::consts::TAU * rng.random::<f64>()).sin_cos());
            let (r, s) = ((1.0 - u).sqrt(), u.sqrt());
            q.copy_from_slice(&[r * sin, r * cos, s * a.0, s * a.1]);
        };
        match self {
            Self::Continuous { .. } => q.copy_from_slice(&[cos, sin]),
            Self::Planar => q[2..].copy_from_slice(&[cos, sin]),
            Self::Spherical => rotate(q),
            Self::FreeFlyer => rotate(&mut q[3..]),
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {}
        }
    }

    /// Computes q ⊕ v: the position reached from q by moving with v for one unit of time.
    #[inline(always)]
    pub(crate) fn integrate<S: Scalar>(self, q: &[S], v: &[S], out: &mut [S]) {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {
                for k in 0..q.len() {
                    out[k] = q[k] + v[k];
                }
            }
            Self::Continuous { .. } => {
                let (sin, cos) = v[0].sin_cos();
                let (c, s) = (q[0] * cos - q[1] * sin, q[1] * cos + q[0] * sin);
                let r = (c * c + s * s).sqrt().recip();
                (out[0], out[1]) = (c * r, s * r);
            }
            _ => {
                let (R, p) = self.pose(q);
                let (dR, dp) = lie::exp6(self.twist(v));
                // The quaternions r and −r are the same rotation. Selects the sign for which the result is nearer to q.
                let sign = S::select(dR.scalar.lt(S::zero()), -S::one(), S::one());
                let dR = Quaternion { vector: dR.vector.scale(sign), scalar: dR.scalar * sign };
                self.set_pose((R * dR).normalize(), p + R.to_rotation() * dp, out);
            }
        }
    }

    /// Computes q₁ ⊖ q₀: the tangent vector v with q₀ ⊕ v = q₁.
    #[doc(hidden)]
    #[inline(always)]
    pub fn difference<S: Scalar>(self, q0: &[S], q1: &[S], out: &mut [S]) {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } | Self::Translation => {
                for k in 0..q0.len() {
                    out[k] = q1[k] - q0[k];
                }
            }
            Self::Continuous { .. } => {
                out[0] = (q0[0] * q1[1] - q0[1] * q1[0]).atan2(q0[0] * q1[0] + q0[1] * q1[1]);
            }
            _ => {
                let ((R0, p0), (R1, p1)) = (self.pose(q0), self.pose(q1));
                let relative = R0.to_rotation().transpose_mul(p1 - p0);
                let d = lie::log6((R0.conjugate() * R1).normalize(), relative).to_array();
                for (out, &axis) in out.iter_mut().zip(self.axes()) {
                    *out = d[axis];
                }
            }
        }
    }

    /// Returns a Jacobian of the joint's group at the tangent vector v, as a map of twists. Returns `None` if the
    /// Jacobian is the identity.
    #[doc(hidden)]
    #[inline(always)]
    pub fn jacobian<S: Scalar>(self, which: GroupJacobian, v: &[S]) -> Option<MotionMap<S>> {
        if self.commutes() {
            return None;
        }
        let twist = self.twist(v);
        Some(match which {
            GroupJacobian::Exp => lie::jexp6(twist),
            GroupJacobian::Log => lie::jlog6(twist),
            GroupJacobian::Transport => {
                let (R, p) = lie::exp6(-twist);
                MotionMap::adjoint(Se3::new(R.to_rotation(), p))
            }
        })
    }

    /// Computes the Jacobian of [`jacobian`](Self::jacobian), column after column, for a joint whose group is not
    /// commutative.
    #[doc(hidden)]
    #[inline(always)]
    pub fn jacobian_columns<S: Scalar>(self, which: GroupJacobian, v: &[S], to: &mut [S]) {
        let (Some(map), axes) = (self.jacobian(which, v), self.axes()) else { return };
        let columns = map.columns();
        for (k, &column) in axes.iter().enumerate() {
            let column = columns[column].to_array();
            for (i, &row) in axes.iter().enumerate() {
                to[k * axes.len() + i] = column[row];
            }
        }
    }

    /// Converts a tangent vector to a twist of the body.
    #[inline(always)]
    fn twist<S: Scalar>(self, v: &[S]) -> Motion<S> {
        let mut m = [S::zero(); 6];
        for (k, &axis) in self.axes().iter().enumerate() {
            m[axis] = v[k];
        }
        m.into()
    }

    /// Returns the pose X_J(q) of a joint whose group is not commutative.
    #[inline(always)]
    fn pose<S: Scalar>(self, q: &[S]) -> (Quaternion<S>, Vec3<S>) {
        match self {
            Self::Spherical => (Quaternion::new(q[0], q[1], q[2], q[3]), Vec3::zero()),
            Self::Planar => {
                let o = S::zero();
                let R = rotated_about_z(Se3::identity(), q[3], q[2]).rotation;
                (Quaternion::from_rotation(R), Vec3::new(q[0], q[1], o))
            }
            _ => (Quaternion::new(q[3], q[4], q[5], q[6]), Vec3::new(q[0], q[1], q[2])),
        }
    }

    /// Sets q to the position that has a given pose. This function is the inverse of `pose`.
    #[inline(always)]
    fn set_pose<S: Scalar>(self, R: Quaternion<S>, p: Vec3<S>, q: &mut [S]) {
        let (u, w) = (R.vector, R.scalar);
        let two = S::splat(2.0);
        match self {
            Self::Spherical => q.copy_from_slice(&[u.x, u.y, u.z, w]),
            Self::Planar => q.copy_from_slice(&[p.x, p.y, w * w - u.z * u.z, two * w * u.z]),
            _ => q.copy_from_slice(&[p.x, p.y, p.z, u.x, u.y, u.z, w]),
        }
    }
}

/// Kind of Jacobian of a joint's Lie group, for integration and differences of positions.
#[derive(Clone, Copy)]
pub enum GroupJacobian {
    /// Derivative ∂(q ⊕ v)/∂v.
    Exp,
    /// Derivative ∂(q₁ ⊖ q₀)/∂q₁ at q₁ ⊖ q₀ = v.
    Log,
    /// Derivative ∂(q ⊕ v)/∂q.
    Transport,
}
