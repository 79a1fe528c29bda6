//! Joints: all that depends on the kind of a joint is in this file and its folder, the group of its positions in
//! `joint/group.rs`, what passes ask of it in `joint/kinematics.rs`.
//!
//! A joint moves along some of the six unit motions of the body's frame, and these stay the same in that frame whatever
//! its position: its motion subspace is constant in the body. The axis of a revolute or prismatic joint is turned to z
//! when the model is built, so that inside, S is the same for all of them.

mod group;
pub mod kinematics;
mod motion;
pub mod turns;

use alloc::borrow::ToOwned;
use alloc::string::String;
use condyle_spatial::simd::Kernel;
use condyle_spatial::{Mat3, Motion, Scalar, Se3, Vec3};
pub use group::GroupJacobian;
pub use motion::{ClassicalMotion, JointMotion};

/// The kind of a joint, with what it needs to know.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum Joint {
    /// One angle about an axis: q = \[θ\], v = \[θ̇\].
    Revolute {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One angle about an axis, without limits: q = [cos θ, sin θ], v = \[θ̇\].
    Continuous {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// One length along an axis: q = \[d\], v = \[ḋ\].
    Prismatic {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
    },
    /// A screw: q = \[θ\], v = \[θ̇\], with `pitch` metres along the axis for each radian about it.
    Helical {
        /// Unit vector in the body's frame.
        axis: Vec3<f64>,
        /// Metres per radian.
        pitch: f64,
    },
    /// A ball: q = quaternion (x, y, z, w), v = angular velocity in the body's frame.
    Spherical,
    /// Motion in the xy plane: q = [x, y, cos θ, sin θ], v = [ẋ, ẏ in the body's frame, θ̇].
    Planar,
    /// Three lengths: q = [x, y, z], v = q̇.
    Translation,
    /// A free body: q = [position, quaternion (x, y, z, w)], v = [linear, angular] in the body's frame.
    FreeFlyer,
}

/// A joint that follows another one: its position is ratio · q + offset, q being the leader's position.
///
/// Both have one degree of freedom, and the leader has its own coordinate. A continuous leader has q = [cos θ, sin θ]: ratio is
/// then a whole number, and what follows turns, by ratio · θ + offset. A continuous follower of a leader with one number
/// turns by ratio · q + offset.
///
/// The follower's armature counts, as ratio² · armature of the leader's coordinate, and so does its spring. Its limits, damping and
/// friction do not: as in Pinocchio, those of a coordinate are its leader's alone.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[allow(missing_docs)]
pub struct Mimic {
    pub ratio: f64,
    pub offset: f64,
}

/// The distance from 1 to which rounding takes the length of a vector that was divided by it.
const UNIT: f64 = 1e-15;

impl Joint {
    /// The kind's name: `revolute`, `continuous`, `prismatic`, `helical`, `spherical`, `planar`, `translation` or
    /// `free-flyer`.
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

    /// The number of entries of the position.
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

    /// The number of degrees of freedom: the entries of the velocity.
    #[inline]
    pub fn nv(self) -> usize {
        self.axes().len()
    }

    /// The unit motions of the frame (linear x, y, z, angular x, y, z) along which it moves: the columns of S. (A screw
    /// moves along z as well, by its pitch.)
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

    /// The axis of a joint that has one, as a unit vector in the body's frame.
    pub fn axis(self) -> Option<Vec3<f64>> {
        match self {
            Self::Revolute { axis }
            | Self::Continuous { axis }
            | Self::Prismatic { axis }
            | Self::Helical { axis, .. } => Some(axis),
            _ => None,
        }
    }

    /// The same joint about or along a unit vector, or what is wrong with its axis or pitch.
    pub(crate) fn normalized(self) -> Result<Self, String> {
        let Some(axis) = self.axis() else { return Ok(self) };
        let norm = axis.norm_squared().sqrt();
        if !norm.is_normal() {
            return Err(format!("axis ({}, {}, {}) is no direction", axis.x, axis.y, axis.z));
        }
        let unit = (norm - 1.0).abs() < UNIT; // to the last bit the same when it was normalised before
        let axis = if unit { axis } else { axis.scale(1.0 / norm) };
        match self {
            Self::Helical { pitch, .. } if !pitch.is_finite() => Err(format!("pitch {pitch} is not finite")),
            Self::Helical { pitch, .. } => Ok(Self::Helical { axis, pitch }),
            Self::Continuous { .. } => Ok(Self::Continuous { axis }),
            Self::Prismatic { .. } => Ok(Self::Prismatic { axis }),
            _ => Ok(Self::Revolute { axis }),
        }
    }

    /// The rotation bRz whose third column is the joint's axis: from the frame in which algorithms run to the body's.
    ///
    /// A permutation of axes, hence exact, for x, y and z; else the shortest rotation of z, or of −z, to the axis.
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
        // Duff et al. (2017): a basis with third axis a, without cancellation for any a.
        let sign = 1f64.copysign(a.z);
        let s = -1.0 / (sign + a.z);
        let t = a.x * a.y * s;
        Mat3 {
            x: unit(1.0 + sign * a.x * a.x * s, sign * t, -sign * a.x),
            y: unit(t, sign + a.y * a.y * s, -a.y),
            z: a,
        }
    }

    /// The kind as which a joint that follows another one is computed, or why it cannot follow. Its position has numbers of
    /// the leader's kind: (cos, sin), or one.
    ///
    /// The (cos, sin) of a leader tells its angle up to whole turns, and a whole multiple of it up to whole turns too;
    /// what else would follow jumps wherever the leader completes a turn.
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

    /// Whether its pose is a rotation about z, and nothing else.
    #[doc(hidden)]
    pub fn turns_about_z(self) -> bool {
        matches!(self, Self::Revolute { .. } | Self::Continuous { .. })
    }

    /// Whether the group of its positions is commutative, so that q ⊕ v has the Jacobian 1.
    #[doc(hidden)]
    pub fn commutes(self) -> bool {
        !matches!(self, Self::Spherical | Self::Planar | Self::FreeFlyer)
    }

    /// Whether the position of a joint that follows is ratio · q + offset of its leader's.
    pub(crate) fn follows_by_sums(self) -> bool {
        !matches!(self, Self::Continuous { .. })
    }

    /// Whether two joints are computed by the same operations.
    pub(crate) fn is_computed_as(self, other: Self) -> bool {
        let pitch = |joint| if let Self::Helical { pitch, .. } = joint { pitch } else { 0.0 };
        core::mem::discriminant(&self) == core::mem::discriminant(&other) && pitch(self) == pitch(other)
    }

    /// The k-th number of the position of a joint that follows; q begins with its leader's.
    #[inline(always)]
    pub(crate) fn mimic_position<S: Scalar>(self, mimic: Mimic, q: &[S], k: usize) -> S {
        match self {
            Self::Continuous { .. } => multiple([q[0], q[1]], mimic.ratio)[k], // its offset is part of X_T
            _ => q[k].mul_add(S::splat(mimic.ratio), S::splat(mimic.offset)),
        }
    }

    /// The part of a follower's offset that belongs to its placement: the pose by which its turned frame is moved.
    pub(crate) fn mimic_offset(self, mimic: Mimic) -> Se3<f64> {
        match self {
            Self::Continuous { .. } => {
                let (sin, cos) = mimic.offset.sin_cos();
                rotated_about_z(Se3::identity(), sin, cos)
            }
            _ => Se3::identity(),
        }
    }

    /// Column k of S of a joint whose body is at oX, in the world's frame.
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

    /// S of a joint that turns about z.
    #[doc(hidden)]
    #[inline(always)]
    pub fn column_about_z<S: Scalar>(oX: &Se3<S>) -> Motion<S> {
        Motion::new(oX.translation.cross(oX.rotation.z), oX.rotation.z)
    }
}

/// cos kθ and sin kθ from cos θ and sin θ, k a whole number: (cos θ + i sin θ)ᵏ by repeated squaring. It is rare, so it is
/// kept out of the passes.
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

/// X_T, then a rotation about z.
#[inline(always)]
fn rotated_about_z<S: Scalar>(X_T: Se3<S>, sin: S, cos: S) -> Se3<S> {
    let Mat3 { x, y, z } = X_T.rotation;
    let rotation = Mat3 { x: x.scale_add(cos, y.scale(sin)), y: y.scale_add(cos, x.scale(-sin)), z };
    Se3::new(rotation, X_T.translation)
}
