//! The frozen description of a robot.

use crate::configuration::Space;
use crate::error::Error;
use crate::joint::Joint;
use crate::limbs::Plan;
use crate::tree::{Column, Coupled, Node};
use crate::validate::Warning;
use condyle_spatial::{Act, Constant, Inertia, Scalar, Se3, Vec3};
use serde::{Deserialize, Serialize};
use std::any::Any;
use std::fmt;

/// A moving body (a link, with all that fixed joints merge into it) and the joint that carries it.
#[derive(Clone, Debug, Serialize, Deserialize)]
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
    /// Where the joint's position begins in q.
    pub idx_q: usize,
    /// Where the joint's velocity begins in v.
    pub idx_v: usize,
    /// Set if the joint has no coordinate of its own and follows another one's.
    pub mimic: Option<Mimic>,
}

/// How a joint follows another one: its position is ratio · q + offset, q being the leader's position.
///
/// Both have one degree of freedom, and the leader follows nobody. A continuous leader has q = [cos θ, sin θ]: ratio is
/// then a whole number, and what follows turns, by ratio · θ + offset. A continuous follower of a leader with one number
/// turns by ratio · q + offset.
///
/// The follower's armature counts, as ratio² · armature of the leader's coordinate. Its limits, damping and friction do
/// not: as in Pinocchio, those of a coordinate are its leader's alone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)]
pub struct Mimic {
    pub ratio: f64,
    pub offset: f64,
}

/// A frame fixed to a body.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Frame {
    /// The name of the link or joint, or the user's.
    pub name: String,
    /// Where it comes from.
    pub kind: FrameKind,
    /// The body to which it is fixed; 0 is the world.
    pub body: usize,
    /// bXf: the frame in the body's frame.
    pub placement: Se3<f64>,
}

/// Where a frame comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrameKind {
    /// A link of the URDF.
    Link,
    /// A joint of the URDF: its frame on the child's side.
    Joint,
    /// Added by the user.
    User,
}

/// Limits of position, velocity and effort; infinite where there are none.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// Least position, nq numbers (rad, m).
    #[serde(with = "condyle_spatial::finite::lower")]
    pub lower: Vec<f64>,
    /// Greatest position, nq numbers (rad, m).
    #[serde(with = "condyle_spatial::finite::upper")]
    pub upper: Vec<f64>,
    /// Greatest speed, nv numbers (rad/s, m/s).
    #[serde(with = "condyle_spatial::finite::upper")]
    pub velocity: Vec<f64>,
    /// Greatest effort, nv numbers (N m, N).
    #[serde(with = "condyle_spatial::finite::upper")]
    pub effort: Vec<f64>,
}

/// A robot: bodies, joints, frames, inertias, limits. Frozen, checked when built, shared between threads.
///
/// Body 0 is the world. The others stand parents first, depth first, siblings in the order of their joints' names (of
/// a URDF; as Pinocchio numbers them) or in which a builder was given them. `R` is the type of the constants: `f64`,
/// or a dual number for derivatives with respect to inertias ([`with_inertias`](Self::with_inertias)).
///
/// A model of plain numbers can be written to a file and read from it (serde). A file may be edited: what it says is
/// checked as in [`ModelBuilder::build`](crate::ModelBuilder::build) when it is read.
///
/// ```
/// let arm = condyle_model::robots::arm7();
/// assert_eq!((arm.nq(), arm.nv()), (7, 7));
/// assert_eq!(arm.frames()[arm.frame("tool")?].body, 7);
/// # Ok::<(), condyle_model::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Model<R = f64> {
    pub(crate) name: String,
    pub(crate) bodies: Vec<Body>,
    pub(crate) frames: Vec<Frame>,
    pub(crate) nq: usize,
    pub(crate) nv: usize,
    pub(crate) limits: Limits,
    pub(crate) damping: Vec<f64>,
    pub(crate) friction: Vec<f64>,
    pub(crate) armature: Vec<R>,
    pub(crate) gravity: Vec3<R>,
    pub(crate) nodes: Vec<Node<R>>,
    pub(crate) columns: Vec<Column>,
    pub(crate) support: Vec<usize>,
    /// The bodies, children before parents.
    pub(crate) finished: Vec<usize>,
    /// For each coordinate.
    pub(crate) coupled: Vec<Coupled>,
    /// All coordinates, in order.
    pub(crate) spaces: Vec<Space>,
    /// How single calls compute several bodies at once, if they do.
    pub(crate) limbs: Option<Plan>,
    pub(crate) warnings: Vec<Warning>,
    /// Bodies whose joints make M singular.
    pub(crate) singular: Vec<usize>,
    /// Tells trees apart: a hash of the parents, joints and coordinates.
    pub(crate) tree: u64,
}

impl<R> Model<R> {
    /// The robot's name.
    #[inline]
    pub fn name(&self) -> &str {
        &self.name
    }
    /// How many numbers a position q has.
    #[inline(always)]
    pub fn nq(&self) -> usize {
        self.nq
    }
    /// How many degrees of freedom there are: the numbers of v, a, τ and of a tangent vector.
    #[inline(always)]
    pub fn nv(&self) -> usize {
        self.nv
    }
    /// All bodies; number 0 is the world.
    #[inline(always)]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }
    /// All frames.
    #[inline(always)]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }
    /// The limits.
    #[inline]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }
    /// Viscous damping of each degree of freedom (N m s/rad, N s/m): stored, used by no algorithm unasked.
    #[inline]
    pub fn damping(&self) -> &[f64] {
        &self.damping
    }
    /// Coulomb friction of each degree of freedom (N m, N): stored, used by no algorithm unasked.
    #[inline]
    pub fn friction(&self) -> &[f64] {
        &self.friction
    }
    /// Inertia of the rotor as seen at each joint (kg m², kg), part of M in every algorithm.
    #[inline(always)]
    pub fn armature(&self) -> &[R] {
        &self.armature
    }
    /// The acceleration of free fall, in the world's frame (m/s²).
    #[inline(always)]
    pub fn gravity(&self) -> &Vec3<R> {
        &self.gravity
    }
    /// Mass of all bodies, of what is fixed to the world too (kg).
    pub fn total_mass(&self) -> f64 {
        self.bodies.iter().map(|b| b.inertia.mass).sum()
    }
    /// Whether some joints share a coordinate.
    #[inline(always)]
    pub fn has_mimic(&self) -> bool {
        self.columns.len() != self.nv
    }

    /// The same robot under another gravity (m/s², in the world's frame).
    #[must_use]
    pub fn with_gravity(mut self, gravity: Vec3<R>) -> Self {
        self.gravity = gravity;
        self
    }

    /// The number of the frame with this name: a link's, else the user's, else a joint's.
    ///
    /// # Errors
    /// [`Error::UnknownFrame`], with the nearest name.
    pub fn frame(&self, name: &str) -> Result<usize, Error> {
        let find = |kind| self.frames.iter().position(|f| f.name == name && f.kind == kind);
        [FrameKind::Link, FrameKind::User, FrameKind::Joint].into_iter().find_map(find).ok_or_else(|| {
            let nearest = nearest(name, self.frames.iter().map(|f| f.name.as_str()));
            Error::UnknownFrame { name: name.to_owned(), nearest }
        })
    }

    /// The number of the body that the joint with this name carries.
    ///
    /// # Errors
    /// [`Error::UnknownJoint`], with the nearest name.
    pub fn joint(&self, name: &str) -> Result<usize, Error> {
        self.bodies.iter().skip(1).position(|b| b.joint_name == name).map(|i| i + 1).ok_or_else(|| {
            let nearest = nearest(name, self.bodies.iter().skip(1).map(|b| b.joint_name.as_str()));
            Error::UnknownJoint { name: name.to_owned(), nearest }
        })
    }
}

/// What the passes of algorithms are told.
#[doc(hidden)]
impl<R> Model<R> {
    /// The bodies as passes see them.
    #[inline(always)]
    pub fn nodes(&self) -> &[Node<R>] {
        &self.nodes
    }
    /// The degrees of freedom of all joints.
    #[inline(always)]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }
    /// The columns from the root to a body's joint, its own last.
    #[inline(always)]
    pub fn support(&self, node: &Node<R>) -> &[usize] {
        &self.support[node.support..node.support + node.depth]
    }
    /// How many pairs there are of a body and a column from the root to its joint.
    #[inline(always)]
    pub fn support_len(&self) -> usize {
        self.support.len()
    }
    /// Of each coordinate, those that its motion needs efforts of.
    #[inline(always)]
    pub fn coupled(&self) -> &[Coupled] {
        &self.coupled
    }
    /// How single calls compute several bodies at once, if they do.
    #[inline(always)]
    pub fn limbs(&self) -> Option<&Plan> {
        self.limbs.as_ref()
    }
    /// A hash of the parents, joints and coordinates: tells trees apart.
    #[inline(always)]
    pub fn tree(&self) -> u64 {
        self.tree
    }
}

/// The most similar of some names (optimal string alignment distance).
pub(crate) fn nearest<'a>(name: &str, names: impl Iterator<Item = &'a str>) -> String {
    names.min_by_key(|n| strsim::osa_distance(n, name)).unwrap_or_default().to_owned()
}

impl Model {
    /// The same robot with another armature, one number for each degree of freedom (kg m², kg).
    ///
    /// # Panics
    /// If `armature` has not nv numbers.
    #[must_use]
    pub fn with_armature(mut self, armature: &[f64]) -> Self {
        crate::check("armature", armature.len(), self.nv);
        self.armature.copy_from_slice(armature);
        self.find_singular();
        self
    }

    /// The same robot with constants of another type, its inertias given by a function of (body, inertia).
    ///
    /// With dual numbers, every algorithm then gives derivatives with respect to inertial parameters. [`Body::inertia`]
    /// is a plain number: it follows if the new ones are.
    ///
    /// ```
    /// use condyle_model::robots;
    /// use condyle_spatial::Inertia;
    /// use num_dual::Dual64;
    /// // ∂/∂(mass of the last body): seed that one number
    /// let arm = robots::arm7();
    /// let dual = arm.with_inertias(|body, I| Inertia::<Dual64> {
    ///     mass: Dual64::new(I.mass, if body == 7 { 1.0 } else { 0.0 }),
    ///     ..I.lift()
    /// });
    /// assert_eq!(dual.nv(), arm.nv()); // rnea(&dual, …) gives ∂τ/∂m with τ
    /// ```
    pub fn with_inertias<T: Scalar + Constant<T>>(
        &self,
        mut inertia: impl FnMut(usize, Inertia<f64>) -> Inertia<T>,
    ) -> Model<T> {
        let mut bodies = self.bodies.clone();
        let replace = |(i, b): (usize, &mut Body)| {
            let I = inertia(i, b.inertia);
            if let Some(&plain) = (&I as &dyn Any).downcast_ref::<Inertia<f64>>() {
                b.inertia = plain;
            }
            I
        };
        let inertias: Vec<Inertia<T>> = bodies.iter_mut().enumerate().map(replace).collect();
        let node = |(i, n): (usize, &Node<f64>)| Node {
            joint: n.joint,
            parent: n.parent,
            idx_q: n.idx_q,
            idx_v: n.idx_v,
            mimic: n.mimic,
            column: n.column,
            support: n.support,
            depth: n.depth,
            level: n.level,
            finished: n.finished,
            placement: n.placement.lift(),
            inertia: Se3::new(n.reframing, Vec3::zero()).lift().act_inv(inertias[i]),
            reframing: n.reframing,
        };
        let mut model = Model {
            nodes: self.nodes.iter().enumerate().map(node).collect(),
            armature: self.armature.iter().map(|&a| T::of(a)).collect(),
            gravity: self.gravity.lift(),
            name: self.name.clone(),
            bodies,
            frames: self.frames.clone(),
            limits: self.limits.clone(),
            damping: self.damping.clone(),
            friction: self.friction.clone(),
            columns: self.columns.clone(),
            support: self.support.clone(),
            finished: self.finished.clone(),
            coupled: self.coupled.clone(),
            spaces: self.spaces.clone(),
            limbs: None,
            warnings: self.warnings.clone(),
            singular: self.singular.clone(),
            nq: self.nq,
            nv: self.nv,
            tree: self.tree,
        };
        if let Some(plain) = (&mut model as &mut dyn Any).downcast_mut::<Model>() {
            plain.limbs = self.limbs.as_ref().and_then(|_| Plan::new(plain));
        }
        model
    }
}

impl<R> fmt::Display for Model<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} bodies, nq = {}, nv = {}, {} frames, {:.3} kg",
            self.name,
            self.bodies.len() - 1,
            self.nq,
            self.nv,
            self.frames.len(),
            self.total_mass()
        )?;
        for (i, b) in self.bodies.iter().enumerate().skip(1) {
            let kind = match b.joint {
                Joint::Revolute { .. } => "revolute",
                Joint::Continuous { .. } => "continuous",
                Joint::Prismatic { .. } => "prismatic",
                Joint::Helical { .. } => "helical",
                Joint::Spherical => "spherical",
                Joint::Planar => "planar",
                Joint::Translation => "translation",
                Joint::FreeFlyer => "free-flyer",
            };
            write!(f, "  {i:3}  {:<28} {kind:<12} on {:<3} q {:<3} v {:<3}", b.joint_name, b.parent, b.idx_q, b.idx_v)?;
            if let Some(mimic) = b.mimic {
                write!(f, " follows: {} q + {}", mimic.ratio, mimic.offset)?;
            } else if b.joint.nq() == 1 && self.limits.lower[b.idx_q].is_finite() {
                write!(f, " [{}, {}]", self.limits.lower[b.idx_q], self.limits.upper[b.idx_q])?;
            }
            writeln!(f)?;
        }
        Ok(())
    }
}
