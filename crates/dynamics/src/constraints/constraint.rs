//! What constraints are: frames that touch the world, and frames of two bodies that are held together.

use crate::passes::frames::ReferenceFrame;
use alloc::borrow::ToOwned;
use condyle_model::{Error, Model, ModelConstraint, ModelConstraintKind};
use condyle_spatial::{Constant, Mat3, Motion, Scalar, Se3, alike};
use core::any::Any;

/// The motion that a constraint holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConstraintKind {
    /// The origin of a frame: three rows, a force.
    Point,
    /// The origin of a frame along one axis, the third of [`axes`](ContactConstraint::axes): one row.
    Line,
    /// The origin of a frame along two axes, the first and the third of [`axes`](ContactConstraint::axes): two rows.
    Plane,
    /// A frame: six rows, a force and a moment, linear first.
    Rigid,
}

impl ConstraintKind {
    /// 1 (line), 2 (plane), 3 (point) or 6 (rigid).
    pub fn rows(self) -> usize {
        match self {
            Self::Line => 1,
            Self::Plane => 2,
            Self::Point => 3,
            Self::Rigid => 6,
        }
    }
}

/// The target of a constraint: where its frame should be, and how it should move there.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Target<S> {
    /// The wanted pose of the frame in the other frame (the world for a contact); of all but rigid ones, the translation
    /// alone.
    pub placement: Se3<S>,
    /// The wanted velocity relative to the other frame, in the reference frame (m/s, rad/s).
    pub velocity: Motion<S>,
    /// The wanted acceleration relative to the other frame, in the reference frame (m/s², rad/s²).
    pub acceleration: Motion<S>,
}

alike!(Target { placement, velocity, acceleration });

impl<S: Scalar> Target<S> {
    /// Both frames in one place, at rest.
    pub fn identity() -> Self {
        Self { placement: Se3::identity(), velocity: Motion::zero(), acceleration: Motion::zero() }
    }

    /// A message for a target of plain numbers that is none.
    pub(crate) fn wrong(&self) -> Option<&'static str> {
        let Target { placement: X, velocity, acceleration } = (self as &dyn Any).downcast_ref::<Target<f64>>()?;
        let motions = velocity.to_array().into_iter().chain(acceleration.to_array());
        if X.translation.to_array().into_iter().chain(motions).any(|x| !x.is_finite()) {
            return Some("its target is not finite");
        }
        (!X.rotation.is_rotation()).then_some("its target's placement is no rotation and translation")
    }

    /// The same target on another scalar.
    pub fn lift<T: Scalar>(self) -> Target<T>
    where
        S: Constant<T>,
    {
        Target {
            placement: self.placement.lift(),
            velocity: self.velocity.lift(),
            acceleration: self.acceleration.lift(),
        }
    }
}

/// A contact of a frame with the world, or a loop that two frames close.
///
/// With the frame's pose X = ₂X₁ in the other frame moved to the target, its velocity v and acceleration a relative to
/// the other body, the constraint asks for
///
/// ```text
/// a − a* + kd (v − v*) + kp e = 0,      e = log X (rigid), the axes of frame 1 applied to p₁ − p₂ (point)
/// ```
///
/// which is Baumgarte's stabilisation: the error of position and velocity decays as ë + kd ė + kp e = 0. All is expressed
/// along the axes of `frame` ([`Local`](ReferenceFrame::Local)) or of the world
/// ([`LocalWorldAligned`](ReferenceFrame::LocalWorldAligned)), at the frame's origin, and so is the force λ with which
/// the constraint acts on the body of `frame`; on the other body, or the world, acts −λ.
///
/// A point's acceleration is the classical one, a rigid frame's the spatial one; a rigid loop in `Local` takes the rate
/// of v's six numbers, in `LocalWorldAligned` the difference of the spatial accelerations, which is the same where v = 0.
/// Signs, gains and axes are those of Pinocchio's `RigidConstraintModel` (whose second placement is the other frame's
/// times the target) and, for contacts, of Crocoddyl's `ContactModel3D` and `ContactModel6D`.
///
/// A contact along a line or in a plane has some rows of a point's, along the columns e₁, e₂, e₃ of `axes`, which stand in
/// the axes of `reference`: e₃ (line), or e₁ and e₃ (plane); the other directions are free. Crocoddyl's `ContactModel1D`
/// with a `rotation` and a reference x* is the line with `axes` = rotationᵀ and the target rotation · (0, 0, x*); its
/// `ContactModel2D` is the plane in `Local` (with kp, it takes the error of position along the world's x and z).
///
/// Source: Baumgarte, *Stabilization of constraints and integrals of motion in dynamical systems* (1972).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, robots};
/// let quadruped = robots::quadruped();
/// let foot = quadruped.frame("LF_foot")?;
/// let contact = ContactConstraint { kd: 50.0, ..ContactConstraint::point(foot) };
/// assert_eq!(contact.kind.rows(), 3);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ContactConstraint {
    /// The number of the frame that is held.
    pub frame: usize,
    /// The number of the frame that it is held to; the world if there is none.
    pub other: Option<usize>,
    /// A point, some directions of it, or the whole frame.
    pub kind: ConstraintKind,
    /// The axes of a line or a plane, as columns along those of `reference`; 1 for all others.
    #[cfg_attr(feature = "serde", serde(default = "Mat3::identity"))]
    pub axes: Mat3<f64>,
    /// Along which axes the rows and λ are: `Local` or `LocalWorldAligned`.
    pub reference: ReferenceFrame,
    /// How fast an error of position decays (1/s²).
    pub kp: f64,
    /// How fast an error of velocity decays (1/s).
    pub kd: f64,
    /// The place and motion that are aimed at; can be changed later
    /// ([`ConstraintSet::set_target`](crate::ConstraintSet::set_target)).
    pub target: Target<f64>,
}

impl ContactConstraint {
    /// A point contact of a frame's origin with the world, in `Local`, without stabilisation.
    pub fn point(frame: usize) -> Self {
        let reference = ReferenceFrame::Local;
        let target = Target::identity();
        let axes = Mat3::identity();
        Self { frame, other: None, kind: ConstraintKind::Point, axes, reference, kp: 0.0, kd: 0.0, target }
    }

    /// A contact of a frame's origin with the world along the frame's z alone, without stabilisation.
    pub fn line(frame: usize) -> Self {
        Self { kind: ConstraintKind::Line, ..Self::point(frame) }
    }

    /// A contact of a frame's origin with the world along the frame's x and z, without stabilisation.
    pub fn plane(frame: usize) -> Self {
        Self { kind: ConstraintKind::Plane, ..Self::point(frame) }
    }

    /// A rigid contact of a frame with the world, in `Local`, without stabilisation.
    pub fn rigid(frame: usize) -> Self {
        Self { kind: ConstraintKind::Rigid, ..Self::point(frame) }
    }

    /// The constraint of a model's file, in `Local`, without stabilisation; `None` for a coupling of joints, which holds no frame.
    ///
    /// A model lists the loops of its file ([`Model::constraints`]) and leaves them open: the algorithms of a tree do not know
    /// them. With [`constrained_dynamics`](crate::constrained_dynamics()) they are closed. An error of position, as the first state
    /// may have it, decays with the gains kp and kd.
    ///
    /// ```
    /// use condyle_dynamics::{ConstraintSet, ContactConstraint, Data, Inertia, Joint, ModelBuilder, Proximal, Se3, Sym3};
    /// use condyle_dynamics::{Vec3, WORLD, constrained_dynamics, forward_kinematics, integrate};
    /// // a four-bar linkage: two cranks on the world, and a coupler on the first one that a pin holds to the second one
    /// let at = |x, z| Se3 { translation: Vec3::new(x, 0.0, z), ..Se3::identity() };
    /// let hinge = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    /// let bar = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, 0.5), Sym3::diagonal(0.1));
    /// let mut robot = ModelBuilder::new("four-bar");
    /// let crank = robot.body("crank", WORLD, hinge, at(0.0, 0.0), bar);
    /// let coupler = robot.body("coupler", crank, hinge, at(0.0, 1.0), bar);
    /// let rocker = robot.body("rocker", WORLD, hinge, at(1.0, 0.0), bar);
    /// robot.constraint_point("pin", [(coupler, at(1.0, 0.0)), (rocker, at(0.0, 1.0))]);
    /// let robot = robot.build()?;
    ///
    /// let stiff = |loop_: ContactConstraint| ContactConstraint { kp: 400.0, kd: 40.0, ..loop_ };
    /// let loops: Vec<_> = robot.constraints().iter().filter_map(ContactConstraint::of).map(stiff).collect();
    /// let (mut loops, mut data) = (ConstraintSet::new(&robot, &loops)?, Data::new(&robot));
    /// loops.proximal = Proximal { mu: 1e-8, iterations: 5 }; // the third row of a pin in a plane is redundant
    /// let (mut q, mut v, dt) = (vec![0.0; 3], vec![0.0; 3], 1e-3);
    /// for _ in 0..1000 {
    ///     let a = constrained_dynamics(&robot, &mut data, &mut loops, &q, &v, &[1.0, 0.0, 0.0], &[]).a;
    ///     v.iter_mut().zip(a).for_each(|(v, a)| *v += dt * a);
    ///     let (way, before): (Vec<f64>, _) = (v.iter().map(|v| dt * v).collect(), q.clone());
    ///     integrate(&robot, &before, &way, &mut q);
    /// }
    /// let placements = forward_kinematics(&robot, &mut data, &q);
    /// let ends = ["pin#1", "pin#2"].map(|name| placements.frame(robot.frame(name).unwrap()).translation);
    /// assert!(q[0].abs() > 0.1 && (ends[0] - ends[1]).norm_squared() < 1e-6); // it has moved, and the loop is closed
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    pub fn of(constraint: &ModelConstraint) -> Option<Self> {
        let (frames, kind) = match constraint.kind {
            ModelConstraintKind::Point { frames } => (frames, ConstraintKind::Point),
            ModelConstraintKind::Rigid { frames } => (frames, ConstraintKind::Rigid),
            _ => return None,
        };
        Some(Self { kind, other: Some(frames[1]), ..Self::point(frames[0]) })
    }

    /// The bodies of both frames, unless something is wrong with this constraint or with it beside the ones before.
    pub(crate) fn bodies<R>(&self, model: &Model<R>, before: &[Self]) -> Result<[usize; 2], Error> {
        let wrong = |what| Err(Error::Constraint { constraint: before.len(), what });
        let frames = model.frames().len();
        if let Some(frame) = [Some(self.frame), self.other].into_iter().flatten().find(|&f| f >= frames) {
            return wrong(format!("there is no frame {frame}: the model has {frames}"));
        }
        let frame = &model.frames()[self.frame];
        let bodies = [frame.body, self.other.map_or(0, |other| model.frames()[other].body)];
        if bodies[0] == bodies[1] {
            let other = self.other.map_or("world", |other| &model.frames()[other].name);
            return wrong(format!("frames `{}` and `{other}` do not move relative to each other", frame.name));
        }
        if self.reference == ReferenceFrame::World {
            return wrong("its reference must be `local` or `local_world_aligned`, found `world`".to_owned());
        }
        for (name, gain) in [("kp", self.kp), ("kd", self.kd)] {
            if !(gain.is_finite() && gain >= 0.0) {
                return wrong(format!("{name} must be a number of at least 0, found {gain}"));
            }
        }
        if let Some(what) = self.target.wrong() {
            return wrong(what.to_owned());
        }
        if !self.axes.is_rotation() {
            return wrong("its axes are no rotation: expected three unit vectors at right angles".to_owned());
        }
        if matches!(self.kind, ConstraintKind::Point | ConstraintKind::Rigid) && self.axes != Mat3::identity() {
            return wrong("its axes must be the identity: only lines and planes have axes of their own".to_owned());
        }
        let what = |c: &Self| (c.frame, c.other, c.kind, c.axes);
        let same = |c: &Self| what(c) == what(self);
        if let Some(twin) = before.iter().position(same) {
            return wrong(format!("it holds frame `{}` as constraint {twin} does already", frame.name));
        }
        Ok(bodies)
    }
}
