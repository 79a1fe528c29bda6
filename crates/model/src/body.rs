//! What a model is made of: bodies, frames, limits.

use crate::joint::{Joint, Mimic};
use alloc::string::String;
use alloc::vec::Vec;
use condyle_spatial::{Inertia, Se3};

/// A moving body (a link, with all that fixed joints merge into it) and the joint that carries it.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Body {
    /// The joint's name: how Pinocchio names the pair.
    pub joint_name: String,
    /// The link's name.
    pub name: String,
    /// The body on which the joint sits; smaller than this body's own number.
    pub parent: usize,
    /// The joint, from the parent to this body.
    pub joint: Joint,
    /// pXj: the joint's frame at position zero in the parent's frame.
    pub placement: Se3<f64>,
    /// The inertia, in the body's frame.
    pub inertia: Inertia<f64>,
    /// The place in q at which the joint's position begins.
    pub idx_q: usize,
    /// The place in v at which the joint's velocity begins.
    pub idx_v: usize,
    /// Set if the joint has no coordinate of its own and follows another one's.
    pub mimic: Option<Mimic>,
}

/// A frame fixed to a body.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frame {
    /// The name of the link or joint, or the user's.
    pub name: String,
    /// The origin of the frame: a link, a joint, or the user.
    pub kind: FrameKind,
    /// The body to which it is fixed; 0 is the world.
    pub body: usize,
    /// bXf: the frame in the body's frame.
    pub placement: Se3<f64>,
}

/// The origin of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub enum FrameKind {
    /// A link of the URDF.
    Link,
    /// A joint of the URDF: its frame on the child's side.
    Joint,
    /// Added by the user.
    User,
    /// One of the two frames of a [`ModelConstraint`](crate::ModelConstraint).
    Constraint,
}

/// The body or frame on which [`Model::with_frame`](crate::Model::with_frame) puts a frame; a name is one too (`"tool".into()`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameParent<'a> {
    /// Index of a body; 0 is the world.
    Body(usize),
    /// Index of a frame.
    Frame(usize),
    /// Name of a frame (a link's, else the user's, else a joint's), else of a body.
    Named(&'a str),
}

impl<'a> From<&'a str> for FrameParent<'a> {
    fn from(name: &'a str) -> Self {
        Self::Named(name)
    }
}

/// Limits of position, velocity and effort; infinite where there are none.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Limits {
    /// Least position, nq numbers (rad, m).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
    pub lower: Vec<f64>,
    /// Greatest position, nq numbers (rad, m).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub upper: Vec<f64>,
    /// Greatest speed, nv numbers (rad/s, m/s).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub velocity: Vec<f64>,
    /// Least effort, nv numbers (N m, N), as a rule negative.
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::lower"))]
    pub effort_lower: Vec<f64>,
    /// Greatest effort, nv numbers (N m, N).
    #[cfg_attr(feature = "serde", serde(with = "condyle_spatial::finite::upper"))]
    pub effort_upper: Vec<f64>,
}

impl Limits {
    /// Returns the greatest magnitude of effort, max(|lower|, |upper|), nv numbers (N m, N). Where a limit is symmetric it is
    /// the limit.
    pub fn effort(&self) -> Vec<f64> {
        self.effort_lower.iter().zip(&self.effort_upper).map(|(lower, upper)| lower.abs().max(upper.abs())).collect()
    }
}

/// Limits, losses and rotor of a joint; the default is none of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointOptions {
    /// Least and greatest position (rad, m), for joints with one coordinate.
    pub position: Option<(f64, f64)>,
    /// Greatest speed (rad/s, m/s).
    pub velocity: Option<f64>,
    /// Least and greatest effort (N m, N).
    pub effort: Option<(f64, f64)>,
    /// Viscous damping d₀ (N m s/rad, N s/m).
    pub damping: f64,
    /// Coefficients d₁ and d₂ of damping that grows with the speed: d(v) = d₀ + d₁|v| + d₂v². They have the units of damping
    /// per rad/s or m/s, and per its square.
    pub damping_polynomial: [f64; 2],
    /// Coulomb friction (N m, N).
    pub friction: f64,
    /// Inertia of the rotor as seen at the joint (kg m², kg). For a free joint it is also an apparent mass without weight, along the
    /// axes of its parent: see [`Model::with_armature`](crate::Model::with_armature).
    pub armature: f64,
}
