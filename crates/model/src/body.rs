//! Bodies, frames and limits of a model.

use crate::joint::{Joint, Mimic};
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Inertia, Se3};

/// Moving body, and the joint that carries it. The body consists of a link and everything that fixed joints attach to
/// this link.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Body {
    /// Name of the joint. Pinocchio uses this name for the joint and the body together.
    pub joint_name: String,
    /// Name of the link.
    pub name: String,
    /// Index of the body that carries the joint. This index is smaller than the index of the body itself.
    pub parent: usize,
    /// Joint from the parent to this body.
    pub joint: Joint,
    /// pXj: pose of the joint's frame at position zero, in the parent's frame.
    pub placement: Se3<f64>,
    /// Inertia in the body's frame.
    pub inertia: Inertia<f64>,
    /// Index in q of the joint's first coordinate.
    pub idx_q: usize,
    /// Index in v of the joint's first degree of freedom.
    pub idx_v: usize,
    /// Relation to the leading joint, if the body's joint follows another joint and has no coordinate of its own.
    pub mimic: Option<Mimic>,
}

/// Frame that is fixed to a body.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frame {
    /// Name of the link or joint, or a name chosen by the user.
    pub name: String,
    /// Item from which the frame comes: a link, a joint, the user, or a constraint.
    pub kind: FrameKind,
    /// Index of the body to which the frame is fixed; 0 is the world.
    pub body: usize,
    /// bXf: pose of the frame in the body's frame.
    pub placement: Se3<f64>,
}

/// Source of a frame: a link or joint of the robot's file, the user, or a constraint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum FrameKind {
    /// Link of the robot's file.
    Link,
    /// Joint of the robot's file. The frame is fixed to the child link of the joint.
    Joint,
    /// Frame added by the user.
    User,
    /// One of the two frames of a [`ModelConstraint`](crate::ModelConstraint).
    Constraint,
}

/// Body or frame to which [`Model::with_frame`](crate::Model::with_frame) attaches a new frame. A name can be converted
/// to a `FrameParent` (`"tool".into()`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameParent<'a> {
    /// Index of a body; 0 is the world.
    Body(usize),
    /// Index of a frame.
    Frame(usize),
    /// Name of a frame or body. The name is searched among links, frames of the user, and joints, in this order, and
    /// then among bodies.
    Named(&'a str),
}

impl<'a> From<&'a str> for FrameParent<'a> {
    fn from(name: &'a str) -> Self {
        Self::Named(name)
    }
}

/// Limits of position, velocity and effort. A missing limit is infinite.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Lower limits of position, nq numbers (rad, m).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
    pub lower: Vec<f64>,
    /// Upper limits of position, nq numbers (rad, m).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub upper: Vec<f64>,
    /// Limits of speed, nv numbers (rad/s, m/s).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub velocity: Vec<f64>,
    /// Lower limits of effort, nv numbers (N m, N), usually negative. In a file without them, they are minus the upper
    /// limits.
    #[cfg_attr(feature = "serde", serde(default, with = "condyle_spatial::finite::lower"))]
    pub effort_lower: Vec<f64>,
    /// Upper limits of effort, nv numbers (N m, N). A file may also call them `effort`.
    #[cfg_attr(feature = "serde", serde(alias = "effort", with = "condyle_spatial::finite::upper"))]
    pub effort_upper: Vec<f64>,
}

impl Limits {
    /// Returns the greatest allowed magnitudes of effort, max(|lower|, |upper|), nv numbers (N m, N).
    pub fn effort(&self) -> Vec<f64> {
        self.effort_lower.iter().zip(&self.effort_upper).map(|(lower, upper)| lower.abs().max(upper.abs())).collect()
    }
}

/// Limits, damping, friction and rotor inertia of a joint. By default, there are no limits, and all other values are 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointOptions {
    /// Lower and upper limit of position (rad, m), for joints with one coordinate.
    pub position: Option<(f64, f64)>,
    /// Limit of speed (rad/s, m/s).
    pub velocity: Option<f64>,
    /// Lower and upper limit of effort (N m, N).
    pub effort: Option<(f64, f64)>,
    /// Viscous damping d₀ (N m s/rad, N s/m).
    pub damping: f64,
    /// Coefficients d₁ and d₂ of a damping that depends on the speed: d(v) = d₀ + d₁|v| + d₂v². The unit of d₁ is the
    /// unit of d₀ per rad/s or m/s. The unit of d₂ is the unit of d₀ per square of rad/s or m/s.
    pub damping_polynomial: [f64; 2],
    /// Coulomb friction (N m, N).
    pub friction: f64,
    /// Inertia of the rotor, reflected to the joint (kg m², kg). For a free joint, this inertia also acts as a mass
    /// without weight, along the axes of the joint's parent: see [`Model::with_armature`](crate::Model::with_armature).
    pub armature: f64,
}
