//! Definition of constraints: contacts between frames and the world, and loops that hold two frames together.

#[cfg(feature = "serde")]
use crate::constraints::written::Written;
use crate::passes::frames::ReferenceFrame;
use alloc::borrow::ToOwned;
use alloc::format;
use alloc::string::String;
use condyle_model::{Error, Model, ModelConstraint, ModelConstraintKind};
use condyle_spatial::{Constant, Mat3, Motion, Scalar, Se3, Vec3, same_layout};
use core::any::Any;

/// Kind of a constraint. The kind determines which motions of a frame the constraint prevents.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ConstraintKind {
    /// Point constraint: the origin of a frame is held. The constraint has three rows, and λ is a force.
    Point,
    /// Line constraint: the origin of a frame is held along one axis, the third column of
    /// [`axes`](ContactConstraint::axes). The constraint has one row.
    Line,
    /// Plane constraint: the origin of a frame is held along two axes, the first and the third column of
    /// [`axes`](ContactConstraint::axes). The constraint has two rows.
    Plane,
    /// Rigid constraint: the whole frame is held. The constraint has six rows, linear first, and λ is a force and a
    /// moment.
    Rigid,
}

impl ConstraintKind {
    /// Returns the number of rows of a constraint: 1 (line), 2 (plane), 3 (point) or 6 (rigid).
    pub fn rows(self) -> usize {
        match self {
            Self::Line => 1,
            Self::Plane => 2,
            Self::Point => 3,
            Self::Rigid => 6,
        }
    }
}

/// Target of a constraint: desired pose, velocity and acceleration of the constraint's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[repr(C)]
pub struct Target<S> {
    /// Desired pose of the frame in the other frame (the world for a contact). All kinds except rigid use only the
    /// translation of this pose.
    pub placement: Se3<S>,
    /// Desired velocity of the frame relative to the other frame, along the axes of the constraint's `reference` (m/s,
    /// rad/s).
    pub velocity: Motion<S>,
    /// Desired acceleration of the frame relative to the other frame, along the axes of the constraint's `reference`
    /// (m/s², rad/s²).
    pub acceleration: Motion<S>,
}

same_layout!(Target { placement, velocity, acceleration });

impl<S: Scalar> Target<S> {
    /// Returns the target at which both frames coincide and are at rest relative to each other.
    pub fn identity() -> Self {
        Self { placement: Se3::identity(), velocity: Motion::zero(), acceleration: Motion::zero() }
    }

    /// Returns an error message if the target's scalars are `f64` and the target is invalid; otherwise returns `None`.
    pub(crate) fn wrong(&self) -> Option<&'static str> {
        let Target { placement: X, velocity, acceleration } = (self as &dyn Any).downcast_ref::<Target<f64>>()?;
        let motions = velocity.to_array().into_iter().chain(acceleration.to_array());
        if X.translation.to_array().into_iter().chain(motions).any(|x| !x.is_finite()) {
            return Some("its target is not finite");
        }
        (!X.rotation.is_rotation()).then_some("its target's placement is no rotation and translation")
    }

    /// Converts the target to another scalar.
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

/// Constraint of a contact between a frame and the world, or of a kinematic loop that two frames close.
///
/// Frame 1 is `frame`. Frame 2 is at the target's placement in the other frame. X = ₂X₁ is the pose of frame 1 in frame
/// 2; p₁ and p₂ are the origins of the two frames. v and a are the velocity and acceleration of frame 1 relative to the
/// other body; v* and a* are the target's velocity and acceleration. The constraint requires
///
/// ```text
/// a − a* + kd (v − v*) + kp e = 0,      e = log X (rigid), p₁ − p₂ (point)
/// ```
///
/// If the gains kp differ along the axes, kp e is the product of gain and error along each axis of `reference`.
///
/// The equation above is Baumgarte's stabilisation: the error of position and velocity decays as ë + kd ė + kp e = 0.
/// All quantities are at the frame's origin, along the axes of `frame` ([`Local`](ReferenceFrame::Local)) or of the
/// world ([`LocalWorldAligned`](ReferenceFrame::LocalWorldAligned)). The force λ of the constraint is expressed in the
/// same axes. λ acts on the body of `frame`, and −λ acts on the other body or the world.
///
/// The acceleration of a point is its classical acceleration, and the acceleration of a rigid frame is its spatial
/// acceleration. For a rigid loop in `Local`, the acceleration a is the rate of the six numbers of the relative
/// velocity v. For a rigid loop in `LocalWorldAligned`, a is the difference of the two spatial accelerations; both
/// definitions agree if v = 0. Signs, gains and axes agree with Pinocchio's `RigidConstraintModel`, whose second
/// placement is the other frame's placement times the target. For contacts, signs, gains and axes also agree with
/// Crocoddyl's `ContactModel3D` and `ContactModel6D`.
///
/// A line or plane contact holds a point only along some columns of `axes`: along e₃ (line), or along e₁ and e₃
/// (plane). The columns e₁, e₂, e₃ are expressed in the axes of `reference`. The other directions are free. Crocoddyl's
/// `ContactModel1D` with a `rotation` and a reference x* is the line with `axes` = rotationᵀ and the target rotation ·
/// (0, 0, x*). Crocoddyl's `ContactModel2D` is the plane in `Local`. However, if kp is not 0, `ContactModel2D` measures
/// the position error along the world's x and z axes.
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
#[cfg_attr(feature = "serde", serde(from = "Written", into = "Written"))]
pub struct ContactConstraint {
    /// Index of the frame that is held.
    pub frame: usize,
    /// Index of the other frame, to which `frame` is held; `None` for the world.
    pub other: Option<usize>,
    /// Kind of the constraint: it holds a point, a point along one or two axes, or the whole frame.
    pub kind: ConstraintKind,
    /// Axes e₁, e₂, e₃ of a line or plane constraint, as columns expressed in the axes of `reference`. For other kinds,
    /// this matrix is the identity.
    pub axes: Mat3<f64>,
    /// Axes of the constraint's rows and of its force λ: `Local` or `LocalWorldAligned`.
    pub reference: ReferenceFrame,
    /// Gain of the position error (1/s²), the same for all axes.
    pub kp: f64,
    /// Gains of the position error (1/s²) along each axis of `reference`, linear, then angular, which replace `kp`;
    /// `None` if all axes have the gain `kp`. For example, a foot with the gains (0, 0, kp, 0, 0, 0) in
    /// `LocalWorldAligned` returns to its height and not to its place on the ground. All kinds except rigid use only
    /// the linear gains. In JSON, `kp` is then a list of three or six numbers.
    pub kp_axes: Option<[f64; 6]>,
    /// Gain of the velocity error (1/s).
    pub kd: f64,
    /// Desired placement, velocity and acceleration of the frame. The target can be changed later
    /// ([`ConstraintSet::set_target`](crate::ConstraintSet::set_target)).
    pub target: Target<f64>,
}

impl ContactConstraint {
    /// Returns a point contact of a frame's origin with the world, in `Local`, without stabilisation.
    pub fn point(frame: usize) -> Self {
        let reference = ReferenceFrame::Local;
        let target = Target::identity();
        let axes = Mat3::identity();
        Self {
            frame,
            other: None,
            kind: ConstraintKind::Point,
            axes,
            reference,
            kp: 0.0,
            kp_axes: None,
            kd: 0.0,
            target,
        }
    }

    /// Returns a contact that holds a frame's origin to the world along the frame's z axis only, without stabilisation.
    pub fn line(frame: usize) -> Self {
        Self { kind: ConstraintKind::Line, ..Self::point(frame) }
    }

    /// Returns a contact that holds a frame's origin to the world along the frame's x and z axes, without
    /// stabilisation.
    pub fn plane(frame: usize) -> Self {
        Self { kind: ConstraintKind::Plane, ..Self::point(frame) }
    }

    /// Returns a rigid contact of a frame with the world, in `Local`, without stabilisation.
    pub fn rigid(frame: usize) -> Self {
        Self { kind: ConstraintKind::Rigid, ..Self::point(frame) }
    }

    /// Converts a constraint of a model's file to a contact constraint in `Local`, without stabilisation. Returns
    /// `None` for a coupling of joints, which does not hold a frame.
    ///
    /// [`Model::constraints`] lists the loops of the model's file. The algorithms for trees ignore these loops, and
    /// [`constrained_dynamics`](crate::constrained_dynamics()) closes them. A position error, for example in the
    /// initial state, decays with the gains kp and kd.
    ///
    /// ```
    /// use condyle_dynamics::{ConstraintSet, ContactConstraint, Data, Inertia, Joint, ModelBuilder, ProximalSettings,
    /// Se3};
    /// use condyle_dynamics::{Sym3, Vec3, WORLD, constrained_dynamics, forward_kinematics, integrate};
    /// // a four-bar linkage: two cranks on the world, and a coupler on the first one, which a pin holds to the second
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
    /// loops.proximal = ProximalSettings { mu: 1e-8, iterations: 5 }; // the third row of a pin in a plane is redundant
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

    /// Returns the bodies of both frames. Fails if this constraint is invalid or repeats one of the earlier constraints
    /// `before`.
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
        if let Some(what) = wrong_gains(self.kp, self.kp_axes.as_ref(), self.kd) {
            return wrong(what);
        }
        if let Some(what) = self.target.wrong() {
            return wrong(what.to_owned());
        }
        if let Some(what) = wrong_axes(&self.axes) {
            return wrong(what);
        }
        if matches!(self.kind, ConstraintKind::Point | ConstraintKind::Rigid) && self.axes != Mat3::identity() {
            return wrong("its axes must be the identity: only lines and planes have axes of their own".to_owned());
        }
        if let Some(twin) = before.iter().position(|c| c.repeats(self)) {
            return wrong(format!("it holds frame `{}` as constraint {twin} does already", frame.name));
        }
        Ok(bodies)
    }

    /// Returns whether both constraints hold the same frame to the same other frame in the same way: both hold a point
    /// or a whole frame, or a point along the same directions. A [`ConstraintSet`](crate::ConstraintSet) refuses such
    /// constraints.
    ///
    /// ```
    /// use condyle_dynamics::{ContactConstraint, Mat3, Vec3};
    /// let up = ContactConstraint::line(3);
    /// let turned = Mat3 { x: Vec3::new(0.0, 1.0, 0.0), y: Vec3::new(1.0, 0.0, 0.0), z: Vec3::new(0.0, 0.0, -1.0) };
    /// assert!(up.repeats(&ContactConstraint { axes: turned, ..up }));
    /// assert!(!up.repeats(&ContactConstraint::plane(3)));
    /// ```
    pub fn repeats(&self, other: &Self) -> bool {
        let held = |c: &Self| (c.frame, c.other, c.kind);
        let parallel = |a: Vec3<f64>, b: Vec3<f64>| a.cross(b).norm_squared() < SAME_DIRECTION * SAME_DIRECTION;
        let (a, b, aligned) = (&self.axes, &other.axes, self.reference == other.reference);
        held(self) == held(other)
            && match self.kind {
                ConstraintKind::Line => aligned && parallel(a.z, b.z),
                ConstraintKind::Plane => aligned && parallel(a.y, b.y),
                ConstraintKind::Point | ConstraintKind::Rigid => true,
            }
    }
}

/// Largest sine of the angle between two directions that count as the same. It is larger than the errors of axes that a
/// file gives with six digits, and an angle at which forces along both directions are useless.
const SAME_DIRECTION: f64 = 1e-5;

/// Returns an error message if the axes of a constraint are no rotation.
fn wrong_axes(axes: &Mat3<f64>) -> Option<String> {
    let error = axes.rotation_error();
    if axes.is_rotation() {
        None
    } else if !error.is_finite() {
        Some("its axes are not finite".to_owned())
    } else if (Mat3 { z: -axes.z, ..*axes }).is_rotation() {
        Some("its axes are left-handed: expected e₁ × e₂ = e₃, found −e₃".to_owned())
    } else {
        Some(format!("its axes are no unit vectors at right angles: the largest deviation is {error:.1e}"))
    }
}

/// Returns an error message if a gain is negative or not finite.
pub(crate) fn wrong_gains(kp: f64, kp_axes: Option<&[f64; 6]>, kd: f64) -> Option<String> {
    let axes = kp_axes.into_iter().flatten().map(|gain| ("kp_axes", *gain));
    let mut gains = [("kp", kp), ("kd", kd)].into_iter().chain(axes);
    let (name, gain) = gains.find(|(_, gain)| !(gain.is_finite() && *gain >= 0.0))?;
    Some(format!("{name} must be a number of at least 0, found {gain}"))
}
