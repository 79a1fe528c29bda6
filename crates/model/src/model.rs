//! Immutable model of a robot.

use crate::actuator::Actuator;
use crate::body::{Body, Frame, FrameKind, Limits};
use crate::constraint::ModelConstraint;
use crate::error::Error;
use crate::joint::Joint;
use crate::keyframe::Keyframe;
use crate::limbs::Plan;
use crate::names::nearest;
use crate::passive::{GravityCompensation, Spring};
use crate::tree::{Column, Node, Tree, hash};
use crate::warning::Warning;
use alloc::borrow::ToOwned;
use alloc::string::String;
use alloc::sync::Arc;
use alloc::vec::Vec;
use condyle_linalg::ColumnTree;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_spatial::{Se3, Vec3};
use core::fmt;

/// Robot with bodies, joints, frames, inertias and limits. A model is checked when it is built. It is then immutable
/// and can be shared between threads.
///
/// Body 0 is the world. The other bodies are numbered depth first, parents first. Siblings of a URDF are sorted by the
/// names of their joints, as in Pinocchio. Siblings of a builder keep the order in which they were added. `R` is the
/// type of the constants: `f64`, or a dual number for derivatives with respect to inertias
/// ([`with_inertias`](Self::with_inertias)).
///
/// A model whose constants are `f64` can be written to a file and read from it (serde). A user may edit the file,
/// because a model that is read is checked as in [`ModelBuilder::build`](crate::ModelBuilder::build).
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
    pub(crate) limits: Limits,
    pub(crate) damping: Vec<f64>,
    pub(crate) friction: Vec<f64>,
    pub(crate) damping_polynomial: Vec<[f64; 2]>,
    pub(crate) springs: Vec<Spring>,
    pub(crate) gravity_compensation: Vec<GravityCompensation>,
    pub(crate) actuators: Vec<Actuator>,
    pub(crate) keyframes: Vec<Keyframe>,
    pub(crate) constraints: Vec<ModelConstraint>,
    pub(crate) armature: Vec<R>,
    /// First coordinate of each free joint that has armature along its linear coordinates. Written by: `validate`.
    pub(crate) free_armature: Vec<usize>,
    pub(crate) gravity: Vec3<R>,
    /// Tree of the robot with turned joint frames, which the passes of algorithms use.
    pub(crate) tree: Tree<R>,
    /// Plan with which a call for one state computes several bodies at once; `None` if the call computes the bodies one
    /// after another.
    pub(crate) limbs: Option<Plan>,
    /// Hash of all data on which plans of constraints depend: see `geometry_hash`.
    pub(crate) geometry: u64,
    /// Whether each body connects two joints of a chain and therefore has no mass on purpose.
    pub(crate) between: Vec<bool>,
    pub(crate) warnings: Vec<Warning>,
    /// Bodies whose joints make the inertia matrix singular.
    pub(crate) singular: Vec<usize>,
}

condyle_spatial::same_layout!(Model);

/// Copies the model into an `Arc`. So an object that owns an `Arc` of a model, such as a simulation, can be created
/// from `&model`.
impl<R: Clone> From<&Model<R>> for Arc<Model<R>> {
    fn from(model: &Model<R>) -> Self {
        Self::new(model.clone())
    }
}

impl<R> Model<R> {
    /// Returns the robot's name.
    #[inline]
    pub fn name(&self) -> &str {
        &self.name
    }
    /// Returns nq, the number of entries of a position q.
    #[inline(always)]
    pub fn nq(&self) -> usize {
        self.tree.nq
    }
    /// Returns nv, the number of degrees of freedom. This is the number of entries of v, a, τ and of a tangent vector.
    #[inline(always)]
    pub fn nv(&self) -> usize {
        self.tree.nv
    }
    /// Returns all bodies; body 0 is the world.
    #[inline(always)]
    pub fn bodies(&self) -> &[Body] {
        &self.bodies
    }
    /// Returns all frames.
    #[inline(always)]
    pub fn frames(&self) -> &[Frame] {
        &self.frames
    }
    /// Returns the limits.
    #[inline]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }
    /// Returns the viscous damping of each degree of freedom (N m s/rad, N s/m). The damping is stored, but not applied
    /// by default.
    #[inline]
    pub fn damping(&self) -> &[f64] {
        &self.damping
    }
    /// Returns the Coulomb friction of each degree of freedom (N m, N). The friction is stored, but not applied by
    /// default.
    #[inline]
    pub fn friction(&self) -> &[f64] {
        &self.friction
    }
    /// Returns the coefficients d₁ and d₂ of the damping of each degree of freedom. The damping is d(v) = d₀ + d₁|v| +
    /// d₂v², where d₀ is [`damping`](Self::damping). The coefficients are stored, but not applied by default.
    #[inline]
    pub fn damping_polynomial(&self) -> &[[f64; 2]] {
        &self.damping_polynomial
    }
    /// Returns the springs of joints. The springs are stored, but not applied by default.
    #[inline]
    pub fn springs(&self) -> &[Spring] {
        &self.springs
    }
    /// Returns the bodies whose weight is compensated, entirely or in part. The compensation is stored, but not applied
    /// by default.
    #[inline]
    pub fn gravity_compensation(&self) -> &[GravityCompensation] {
        &self.gravity_compensation
    }
    /// Returns the actuators.
    #[inline]
    pub fn actuators(&self) -> &[Actuator] {
        &self.actuators
    }
    /// Returns the named states.
    #[inline]
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }
    /// Returns the constraints that the robot has in addition to its tree: loops and coupled joints. Algorithms for
    /// trees ignore these constraints.
    #[inline]
    pub fn constraints(&self) -> &[ModelConstraint] {
        &self.constraints
    }
    /// Returns the armature: the inertia of the rotor, reflected to each joint (kg m², kg). Every algorithm includes
    /// the armature in the inertia matrix.
    #[inline(always)]
    pub fn armature(&self) -> &[R] {
        &self.armature
    }
    /// Returns the acceleration of gravity, in the world's frame (m/s²).
    #[inline(always)]
    pub fn gravity(&self) -> &Vec3<R> {
        &self.gravity
    }
    /// Returns the total mass of all bodies and of links that are fixed to the world (kg).
    pub fn total_mass(&self) -> f64 {
        self.bodies.iter().map(|b| b.inertia.mass).sum()
    }
    /// Returns whether some joints share a coordinate.
    #[inline(always)]
    pub fn has_mimic(&self) -> bool {
        self.tree.has_mimic()
    }

    /// Returns the index of the frame with this name. Frames of links are searched first, then frames of the user, of
    /// joints, and of constraints.
    ///
    /// # Errors
    /// Returns [`Error::UnknownFrame`], with the nearest name.
    pub fn frame(&self, name: &str) -> Result<usize, Error> {
        let find = |kind| self.frames.iter().position(|f| f.name == name && f.kind == kind);
        [FrameKind::Link, FrameKind::User, FrameKind::Joint, FrameKind::Constraint]
            .into_iter()
            .find_map(find)
            .ok_or_else(|| {
                let nearest = nearest(name, self.frames.iter().map(|f| f.name.as_str()));
                Error::UnknownFrame { name: name.to_owned(), nearest }
            })
    }

    /// Returns the index of the body that the joint with this name carries.
    ///
    /// # Errors
    /// Returns [`Error::UnknownJoint`], with the nearest name.
    pub fn joint(&self, name: &str) -> Result<usize, Error> {
        self.bodies.iter().skip(1).position(|b| b.joint_name == name).map(|i| i + 1).ok_or_else(|| {
            let nearest = nearest(name, self.bodies.iter().skip(1).map(|b| b.joint_name.as_str()));
            Error::UnknownJoint { name: name.to_owned(), nearest }
        })
    }
}

/// Methods with which passes of algorithms read the model.
#[doc(hidden)]
impl<R> Model<R> {
    /// Returns the bodies with turned joint frames, which the passes of algorithms use.
    #[inline(always)]
    pub fn nodes(&self) -> &[Node<R>] {
        &self.tree.nodes
    }
    /// Returns the degrees of freedom of all joints.
    #[inline(always)]
    pub fn columns(&self) -> &[Column] {
        &self.tree.columns
    }
    /// Returns the columns from the root to the joint of a body. The columns of this joint come last.
    #[inline(always)]
    pub fn support(&self, node: &Node<R>) -> &[usize] {
        self.tree.support(node)
    }
    /// Returns the number of all pairs of a body and a column on the path from the root to the body's joint.
    #[inline(always)]
    pub fn support_len(&self) -> usize {
        self.tree.support.len()
    }
    /// Returns the nonzero rows of each column of the inertia matrix. Row i of column j is nonzero if an acceleration
    /// of coordinate j needs an effort in coordinate i.
    #[inline(always)]
    pub fn nonzero_rows(&self) -> &[NonzeroRows] {
        &self.tree.nonzero_rows
    }
    /// Returns the floating bodies: bodies that a free joint connects to the world.
    pub fn floating(&self) -> impl Iterator<Item = usize> {
        let floats = |&i: &usize| self.nodes()[i].parent == 0 && self.nodes()[i].joint == Joint::FreeFlyer;
        (1..self.nodes().len()).filter(floats)
    }
    /// Returns the first coordinate of each free joint that has armature along its linear coordinates. This armature is
    /// an apparent mass along the axes of the parent.
    #[inline(always)]
    pub fn free_armature(&self) -> &[usize] {
        &self.free_armature
    }
    /// Returns the bodies in the order in which their subtrees are closed, children before parents.
    #[inline(always)]
    pub fn closed(&self) -> &[usize] {
        &self.tree.closed
    }
    /// Returns the plan with which a call for one state computes several bodies at once; `None` if the call computes
    /// the bodies one after another.
    #[inline(always)]
    pub fn limbs(&self) -> Option<&Plan> {
        self.limbs.as_ref()
    }
    /// Returns a hash of the parents, kinds of joints and coordinates. Different trees have different hashes.
    #[inline(always)]
    pub fn tree_hash(&self) -> u64 {
        self.tree.hash
    }
    /// Returns a hash of the tree and of the placements of its joints and frames. The hash does not depend on inertias,
    /// armature, gravity, limits and names. It stays the same when a robot is written and read again.
    #[inline(always)]
    pub fn geometry_hash(&self) -> u64 {
        self.geometry
    }
}

impl Model {
    /// Computes the hash of the tree and of the placements of its joints and frames.
    pub(crate) fn hash_geometry(&self) -> u64 {
        let pose = |X: Se3<f64>| X.rotation.columns().into_iter().chain([X.translation]).flat_map(Vec3::to_array);
        let bodies = self.bodies.iter().flat_map(|b| {
            let (axis, mimic) =
                (b.joint.axis().unwrap_or(Vec3::zero()), b.mimic.map_or([0.0; 2], |m| [m.ratio, m.offset]));
            let pitch = if let Joint::Helical { pitch, .. } = b.joint { pitch } else { 0.0 };
            pose(b.placement).chain(axis.to_array()).chain(mimic).chain([pitch])
        });
        let frames = self.frames.iter().flat_map(|f| pose(f.placement).chain([f.body as f64]));
        hash([self.tree.hash].into_iter().chain(bodies.chain(frames).map(f64::to_bits)))
    }
}

/// Tree of the inertia matrix M. The columns of the tree are the degrees of freedom of the joints, and the rows are the
/// coordinates.
impl<R> ColumnTree for Model<R> {
    fn rows(&self) -> usize {
        self.nv()
    }
    fn columns(&self) -> usize {
        self.tree.columns.len()
    }
    fn parent(&self, c: usize) -> Option<usize> {
        self.tree.columns[c].parent
    }
    fn row(&self, c: usize) -> usize {
        self.tree.columns[c].coordinate
    }
}

impl<R> fmt::Display for Model<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}: {} bodies, nq = {}, nv = {}, {} frames, {:.3} kg",
            self.name,
            self.bodies.len() - 1,
            self.nq(),
            self.nv(),
            self.frames.len(),
            self.total_mass()
        )?;
        for (i, b) in self.bodies.iter().enumerate().skip(1) {
            let kind = b.joint.kind();
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
