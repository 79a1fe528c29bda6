//! Kinematics of joints: the placement and the motion of a body, and the joint efforts of a force.

use super::revolute_angles::RevoluteAngles;
use super::{Joint, JointMotion, rotated_about_z};
use crate::layout::Layout;
use condyle_spatial::{Act, Array, Force, Motion, Quaternion, Scalar, Se3, Vec3, same_layout};

/// Sines and cosines of the angles of all joints: see [`Joint::sin_cos`]. Entries of bodies without such an angle, and
/// entries after the last body, have no meaning.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct JointSinCos<S> {
    /// Sine of the angle of each joint. Length: the number of bodies, rounded up to a multiple of `STEP`. Written by:
    /// `Joint::sin_cos`.
    pub sin: Array<S>,
    /// Cosine of the angle of each joint. Length: the same as for `sin`. Written by: `Joint::sin_cos`.
    pub cos: Array<S>,
}

same_layout!(JointSinCos { sin, cos });

impl<S: Scalar> JointSinCos<S> {
    /// Number of entries that are computed at once. These entries fill two vectors.
    pub const STEP: usize = if S::LANES == 1 { 8 } else { 2 };

    /// Allocates entries for `bodies` bodies, including the world.
    pub fn new(bodies: usize) -> Self {
        let n = bodies.next_multiple_of(Self::STEP);
        Self { sin: vec![S::zero(); n].into(), cos: vec![S::zero(); n].into() }
    }
}

#[doc(hidden)]
impl Joint {
    /// Computes the sines and cosines of the angles of all joints that turn about z, several at once.
    #[inline(always)]
    pub fn sin_cos<L: Layout>(l: &L, q: &[L::S], JointSinCos { sin, cos }: &mut JointSinCos<L::S>) {
        let (RevoluteAngles { runs, followers, circles }, sin, cos) = (l.revolute_angles(), &mut sin[..], &mut cos[..]);
        for &[first, at, count] in runs {
            sin[first..first + count].copy_from_slice(&q[at..at + count]);
        }
        for &i in followers {
            sin[i] = l.position(q, i, 0);
        }
        L::S::sin_cos_of_all(sin, cos);
        for &i in circles {
            (sin[i], cos[i]) = Self::sin_cos_in(l, i, q);
        }
    }

    /// Computes the sines and cosines of the angles of the given joints, in the order of these joints.
    #[inline(always)]
    pub fn sin_cos_of<L: Layout>(l: &L, joints: &[usize], q: &[L::S], sin: &mut [L::S], cos: &mut [L::S]) {
        for (k, &i) in joints.iter().enumerate() {
            if let Self::Revolute { .. } | Self::Helical { .. } = l.joint(i) {
                sin[k] = l.position(q, i, 0);
            }
        }
        L::S::sin_cos_of_all(sin, cos);
        for (k, &i) in joints.iter().enumerate() {
            if let Self::Continuous { .. } | Self::Planar = l.joint(i) {
                (sin[k], cos[k]) = Self::sin_cos_in(l, i, q);
            }
        }
    }

    /// Returns the sine and cosine of a joint whose position in q is (cos, sin).
    #[inline(always)]
    fn sin_cos_in<L: Layout>(l: &L, i: usize, q: &[L::S]) -> (L::S, L::S) {
        let at = if let Self::Planar = l.joint(i) { 2 } else { 0 };
        (l.position(q, i, at + 1), l.position(q, i, at))
    }

    /// Returns the pose λXi = X_T X_J(q) of body i in the frame of its parent λ. X_T is the constant placement of the
    /// joint, and X_J(q) is the pose of the joint.
    #[inline(always)]
    pub fn placement<L: Layout>(l: &L, i: usize, q: &[L::S]) -> Se3<L::S> {
        let (sin, cos) = match l.joint(i) {
            Self::Revolute { .. } | Self::Helical { .. } => l.position(q, i, 0).sin_cos(),
            Self::Continuous { .. } | Self::Planar => Self::sin_cos_in(l, i, q),
            _ => (L::S::zero(), L::S::one()),
        };
        Self::placement_with(l, i, q, sin, cos)
    }

    /// Returns the pose λXi = X_T X_J(q) of body i in the frame of its parent λ, given the sine and cosine of its
    /// joint's angle. X_T is the constant placement of the joint, and X_J(q) is the pose of the joint.
    #[inline(always)]
    pub fn placement_with<L: Layout>(l: &L, i: usize, q: &[L::S], sin: L::S, cos: L::S) -> Se3<L::S> {
        Self::placement_on(l, i, l.placement(i), q, sin, cos)
    }

    /// Returns X_T X_J(q) of joint i, for any pose X_T.
    #[inline(always)]
    pub fn placement_on<L: Layout>(l: &L, i: usize, X_T: Se3<L::S>, q: &[L::S], sin: L::S, cos: L::S) -> Se3<L::S> {
        match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => rotated_about_z(X_T, sin, cos),
            Self::Prismatic { .. } => {
                let d = l.position(q, i, 0);
                Se3::new(X_T.rotation, X_T.rotation.z.scale_add(d, X_T.translation))
            }
            Self::Helical { pitch, .. } => {
                let X = rotated_about_z(X_T, sin, cos);
                let d = l.position(q, i, 0) * L::S::splat(pitch);
                Se3::new(X.rotation, X.rotation.z.scale_add(d, X_T.translation))
            }
            Self::Spherical => {
                let R = quaternion(l, i, q, 0).to_rotation();
                Se3::new(X_T.rotation * R, X_T.translation)
            }
            Self::Planar => {
                let p = Vec3::new(l.position(q, i, 0), l.position(q, i, 1), L::S::zero());
                let X = rotated_about_z(X_T, sin, cos);
                Se3::new(X.rotation, X_T.act(p))
            }
            Self::Translation => Se3::new(X_T.rotation, X_T.act(point(l, i, q))),
            Self::FreeFlyer => X_T * Se3::new(quaternion(l, i, q, 3).to_rotation(), point(l, i, q)),
        }
    }

    /// Returns the motion S v of joint i in the body's frame. S is the motion subspace of the joint, and v contains
    /// velocities or accelerations.
    #[inline(always)]
    pub fn motion<L: Layout>(l: &L, i: usize, v: &[L::S]) -> JointMotion<L::S> {
        match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => JointMotion::Revolute(l.joint_velocity(v, i, 0)),
            Self::Prismatic { .. } => JointMotion::Prismatic(l.joint_velocity(v, i, 0)),
            Self::Helical { pitch, .. } => {
                let (o, x) = (L::S::zero(), l.joint_velocity(v, i, 0));
                JointMotion::General(Motion::new(Vec3::new(o, o, x * L::S::splat(pitch)), Vec3::new(o, o, x)))
            }
            joint => {
                let mut m = [L::S::zero(); 6];
                for (k, &axis) in joint.axes().iter().enumerate() {
                    m[axis] = l.joint_velocity(v, i, k);
                }
                JointMotion::General(m.into())
            }
        }
    }

    /// Adds the effort Sᵀ f of joint i to the coordinates τ. S is the joint's motion subspace, and f is the force on
    /// its body.
    #[inline(always)]
    pub fn project<L: Layout>(l: &L, i: usize, f: Force<L::S>, tau: &mut [L::S]) {
        match l.joint(i) {
            Self::Revolute { .. } | Self::Continuous { .. } => l.add_joint_effort(tau, i, 0, f.angular.z),
            Self::Prismatic { .. } => l.add_joint_effort(tau, i, 0, f.linear.z),
            Self::Helical { pitch, .. } => {
                l.add_joint_effort(tau, i, 0, f.linear.z.mul_add(L::S::splat(pitch), f.angular.z));
            }
            joint => {
                let f = f.to_array();
                for (k, &axis) in joint.axes().iter().enumerate() {
                    l.add_joint_effort(tau, i, k, f[axis]);
                }
            }
        }
    }
}

#[inline(always)]
fn quaternion<L: Layout>(l: &L, i: usize, q: &[L::S], at: usize) -> Quaternion<L::S> {
    Quaternion::new(l.position(q, i, at), l.position(q, i, at + 1), l.position(q, i, at + 2), l.position(q, i, at + 3))
}

#[inline(always)]
fn point<L: Layout>(l: &L, i: usize, q: &[L::S]) -> Vec3<L::S> {
    Vec3::new(l.position(q, i, 0), l.position(q, i, 1), l.position(q, i, 2))
}
