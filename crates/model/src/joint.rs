//! Joints. All code that depends on the kind of a joint is in this file and its folder. `joint/group.rs` contains the
//! Lie groups of joint positions. `joint/kinematics.rs` contains the kinematics that the passes of algorithms use.
//!
//! A joint moves along some of the six unit motions of the body's frame. In the body's frame, these motions do not
//! depend on the position, so the motion subspace S is constant there. When a model is built, the axis of a revolute or
//! prismatic joint is turned to z. So inside the algorithms, S is the same for all joints of one kind.

mod group;
pub mod kinematics;
mod motion;
pub mod revolute_angles;

use alloc::borrow::ToOwned;
use alloc::string::String;
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Mat3, Motion, Scalar, Se3, Vec3};
pub use group::GroupJacobian;
pub use motion::{ClassicalMotion, JointMotion};

/// Kind of a joint, with its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Joint {
    /// One angle about an axis: q = \[θ\], v = \[θ̇\].
    Revolute {
        /// Axis: a unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One angle about an axis, without limits: q = [cos θ, sin θ], v = \[θ̇\].
    Continuous {
        /// Axis: a unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One length along an axis: q = \[d\], v = \[ḋ\].
    Prismatic {
        /// Axis: a unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// Screw: q = \[θ\], v = \[θ̇\], with `pitch` metres along the axis for each radian about the axis.
    Helical {
        /// Axis: a unit vector in the body's frame.
        axis: Vec3<f64>,
        /// Pitch (m/rad).
        pitch: f64,
    },
    /// Ball joint: q = quaternion (x, y, z, w), v = angular velocity in the body's frame.
    Spherical,
    /// Motion in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇].
    Planar,
    /// Three lengths: q = [x, y, z], v = q̇.
    Translation,
    /// Free body: q = [position, quaternion (x, y, z, w)], v = [linear, angular] in the body's frame.
    FreeFlyer,
}

/// Relation of a joint to the joint that it follows. The position of the follower is ratio · q + offset, where q is the
/// position of the leader.
///
/// Both joints have one degree of freedom, and the leader has its own coordinate. A continuous leader has q = [cos θ,
/// sin θ]. For such a leader, the ratio must be an integer, and the follower turns by ratio · θ + offset. If the
/// follower is continuous and the leader has one coordinate q, the follower turns by ratio · q + offset.
///
/// As described at [`ModelBuilder::mimic`](crate::ModelBuilder::mimic), the follower's limits of position and velocity,
/// damping, friction and armature act on the leader's coordinate. The armature is added as ratio² · armature. The
/// follower's spring acts on the leader's coordinate, too. The follower's limits of effort have no effect.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs)]
pub struct Mimic {
    pub ratio: f64,
    pub offset: f64,
}

/// Tolerance for the length of a normalized vector, due to rounding.
const UNIT: f64 = 1e-15;

impl Joint {
    /// Returns the name of the kind: `revolute`, `continuous`, `prismatic`, `helical`, `spherical`, `planar`,
    /// `translation` or `free-flyer`.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Revolute { .. } => "revolute",
            Self::Continuous { .. } => "continuous",
            Self::Prismatic { .. } => "prismatic",
            Self::Helical { .. } => "helical",
            Self::Spherical => "spherical",
            Self::Planar => "planar",
            Self::Translation => "translation",
            Self::FreeFlyer => "free-flyer",
        }
    }

    /// Returns the number of entries in a position of the joint.
    #[inline]
    pub fn nq(self) -> usize {
        match self {
            Self::Revolute { .. } | Self::Prismatic { .. } | Self::Helical { .. } => 1,
            Self::Continuous { .. } => 2,
            Self::Translation => 3,
            Self::Spherical | Self::Planar => 4,
            Self::FreeFlyer => 7,
        }
    }

    /// Returns the number of degrees of freedom, which is the number of entries in a velocity of the joint.
    #[inline]
    pub fn nv(self) -> usize {
        self.axes().len()
    }

    /// Returns the indices of the unit motions (linear x, y, z, angular x, y, z) along which the joint moves: the
    /// columns of the motion subspace S. (A helical joint also moves along z, by its pitch.)
    #[doc(hidden)]
    #[inline(always)]
    pub fn axes(self) -> &'static [usize] {
        match self {
            Self::Revolute { .. } | Self::Continuous { .. } | Self::Helical { .. } => &[5],
            Self::Prismatic { .. } => &[2],
            Self::Spherical => &[3, 4, 5],
            Self::Planar => &[0, 1, 5],
            Self::Translation => &[0, 1, 2],
            Self::FreeFlyer => &[0, 1, 2, 3, 4, 5],
        }
    }

    /// Returns the axis as a unit vector in the body's frame; `None` if the joint has no axis.
    pub fn axis(self) -> Option<Vec3<f64>> {
        match self {
            Self::Revolute { axis }
            | Self::Continuous { axis }
            | Self::Prismatic { axis }
            | Self::Helical { axis, .. } => Some(axis),
            _ => None,
        }
    }

    /// Returns the same joint with a unit vector as its axis. The error describes an invalid axis or pitch.
    pub(crate) fn normalized(self) -> Result<Self, String> {
        let Some(axis) = self.axis() else { return Ok(self) };
        let norm = axis.norm_squared().sqrt();
        if !norm.is_normal() {
            return Err(format!("axis ({}, {}, {}) is no direction", axis.x, axis.y, axis.z));
        }
        let unit = (norm - 1.0).abs() < UNIT; // keeps a unit vector unchanged
        let axis = if unit { axis } else { axis.scale(1.0 / norm) };
        match self {
            Self::Helical { pitch, .. } if !pitch.is_finite() => Err(format!("pitch {pitch} is not finite")),
            Self::Helical { pitch, .. } => Ok(Self::Helical { axis, pitch }),
            Self::Continuous { .. } => Ok(Self::Continuous { axis }),
            Self::Prismatic { .. } => Ok(Self::Prismatic { axis }),
            _ => Ok(Self::Revolute { axis }),
        }
    }

    /// Returns the rotation bRz from the frame used in algorithms, in which the joint's axis is z, to the body's frame.
    /// The third column of bRz is the joint's axis.
    ///
    /// If the axis is x, y or z, the result is a permutation of axes and hence exact. Otherwise, the result is the
    /// shortest rotation of z, or of −z, to the axis.
    #[doc(hidden)]
    pub fn axis_rotation(self) -> Mat3<f64> {
        let Some(a) = self.axis() else { return Mat3::identity() };
        let unit = |x, y, z| Vec3::new(x, y, z);
        if a == unit(0.0, 0.0, 1.0) {
            return Mat3::identity();
        }
        if a == unit(1.0, 0.0, 0.0) {
            return Mat3 { x: unit(0.0, 1.0, 0.0), y: unit(0.0, 0.0, 1.0), z: a };
        }
        if a == unit(0.0, 1.0, 0.0) {
            return Mat3 { x: unit(0.0, 0.0, 1.0), y: unit(1.0, 0.0, 0.0), z: a };
        }
        // Computes a basis with third axis a, without cancellation for any a. Source: Duff et al. (2017).
        let sign = 1f64.copysign(a.z);
        let s = -1.0 / (sign + a.z);
        let t = a.x * a.y * s;
        Mat3 {
            x: unit(1.0 + sign * a.x * a.x * s, sign * t, -sign * a.x),
            y: unit(t, sign + a.y * a.y * s, -a.y),
            z: a,
        }
    }

    /// Returns the kind of joint with which a follower is computed, or the reason why the joint cannot follow. The
    /// follower's position has the same form as the leader's position: (cos, sin), or one number.
    ///
    /// The (cos, sin) of a leader determines the leader's angle up to whole turns. So this pair also determines integer
    /// multiples of the angle up to whole turns. With any other ratio, the follower would jump whenever the leader
    /// completes a turn.
    pub(crate) fn as_follower(self, leader: Self, mimic: Mimic) -> Result<Self, String> {
        let turns = "a continuous joint's position is known up to whole turns only";
        match (leader, self) {
            (Self::Continuous { .. }, Self::Revolute { axis } | Self::Continuous { axis }) => {
                if mimic.ratio % 1.0 != 0.0 {
                    return Err(format!("mimic ratio {} is not a whole number, and {turns}", mimic.ratio));
                }
                Ok(Self::Continuous { axis })
            }
            (Self::Continuous { .. }, Self::Prismatic { .. } | Self::Helical { .. }) => {
                Err(format!("a slide or screw cannot follow a continuous joint: {turns}"))
            }
            _ if leader.nv() != 1 || self.nv() != 1 => {
                Err("mimic works between joints of one degree of freedom only".to_owned())
            }
            (_, Self::Continuous { axis }) => Ok(Self::Revolute { axis }),
            (_, joint) => Ok(joint),
        }
    }

    /// Returns whether the joint's pose is a pure rotation about z.
    #[doc(hidden)]
    pub fn turns_about_z(self) -> bool {
        matches!(self, Self::Revolute { .. } | Self::Continuous { .. })
    }

    /// Returns whether the Lie group of positions is commutative. If so, the Jacobians of q ⊕ v are the identity.
    #[doc(hidden)]
    pub fn commutes(self) -> bool {
        !matches!(self, Self::Spherical | Self::Planar | Self::FreeFlyer)
    }

    /// Returns whether the position of a follower is ratio · q + offset, where q is the leader's position.
    pub(crate) fn follows_by_sums(self) -> bool {
        !matches!(self, Self::Continuous { .. })
    }

    /// Returns whether both joints are computed by the same operations.
    pub(crate) fn is_computed_as(self, other: Self) -> bool {
        let pitch = |joint| if let Self::Helical { pitch, .. } = joint { pitch } else { 0.0 };
        core::mem::discriminant(&self) == core::mem::discriminant(&other) && pitch(self) == pitch(other)
    }

    /// Returns coordinate k of a follower's position. `q` begins with the leader's position.
    #[inline(always)]
    pub(crate) fn mimic_position<S: Scalar>(self, mimic: Mimic, q: &[S], k: usize) -> S {
        match self {
            Self::Continuous { .. } => multiple([q[0], q[1]], mimic.ratio)[k], // X_T contains the offset
            _ => q[k].mul_add(S::splat(mimic.ratio), S::splat(mimic.offset)),
        }
    }

    /// Returns the pose that represents the offset of a continuous follower, otherwise the identity. The pose is
    /// applied in the joint's frame whose z axis is the joint's axis.
    pub(crate) fn mimic_offset(self, mimic: Mimic) -> Se3<f64> {
        match self {
            Self::Continuous { .. } => {
                let (sin, cos) = mimic.offset.sin_cos();
                rotated_about_z(Se3::identity(), sin, cos)
            }
            _ => Se3::identity(),
        }
    }

    /// Returns column k of the joint's motion subspace S in the world's frame, for a joint whose body is at the pose
    /// oX.
    #[doc(hidden)]
    #[inline(always)]
    pub fn column<S: Scalar>(self, oX: &Se3<S>, k: usize) -> Motion<S> {
        let (R, p) = (oX.rotation, oX.translation);
        if let Self::Helical { pitch, .. } = self {
            return Motion::new(R.z.scale_add(S::splat(pitch), p.cross(R.z)), R.z);
        }
        match self.axes()[k] {
            0 => Motion::new(R.x, Vec3::zero()),
            1 => Motion::new(R.y, Vec3::zero()),
            2 => Motion::new(R.z, Vec3::zero()),
            3 => Motion::new(p.cross(R.x), R.x),
            4 => Motion::new(p.cross(R.y), R.y),
            _ => Self::column_about_z(oX),
        }
    }

    /// Returns the motion subspace of a joint that turns about z, which has a single column, in the world's frame.
    #[doc(hidden)]
    #[inline(always)]
    pub fn column_about_z<S: Scalar>(oX: &Se3<S>) -> Motion<S> {
        Motion::new(oX.translation.cross(oX.rotation.z), oX.rotation.z)
    }
}

/// Returns cos kθ and sin kθ for an integer k, given cos θ and sin θ. Computes (cos θ + i sin θ)ᵏ by repeated squaring.
/// The function is rarely used, so it is not inlined into the passes.
#[cold]
#[inline(never)]
fn multiple<S: Scalar>([cos, sin]: [S; 2], k: f64) -> [S; 2] {
    let mut result = [cos, sin];
    S::enter(Multiple(&mut result, k));
    result
}

struct Multiple<'a, S>(&'a mut [S; 2], f64);

impl<S: Scalar> Kernel for Multiple<'_, S> {
    #[inline(always)]
    fn run(self) {
        let Self(result, k) = self;
        let ([mut c, mut s], mut cos, mut sin) = (*result, S::one(), S::zero());
        let mut n = k.abs() as u64;
        while n > 0 {
            if n & 1 == 1 {
                (cos, sin) = (cos * c - sin * s, sin * c + cos * s);
            }
            (c, s) = (c * c - s * s, (c + c) * s);
            n >>= 1;
        }
        *result = [cos, if k < 0.0 { -sin } else { sin }];
    }
}

/// Returns the pose X_T, followed by a rotation about z.
#[inline(always)]
fn rotated_about_z<S: Scalar>(X_T: Se3<S>, sin: S, cos: S) -> Se3<S> {
    let Mat3 { x, y, z } = X_T.rotation;
    let rotation = Mat3 { x: x.scale_add(cos, y.scale(sin)), y: y.scale_add(cos, x.scale(-sin)), z };
    Se3::new(rotation, X_T.translation)
}
