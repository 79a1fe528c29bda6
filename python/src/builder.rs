//! Models that are built body by body.

use crate::arrays::{numbers, pose, three};
use crate::exceptions::{exception, wrong_word};
use crate::inertial_parameters::read_inertia;
use crate::joint::Joint;
use crate::model::Model;
use condyle::{
    Inertia, JointOptions, Se3,
    tree::{Actuator, FrameKind, Mimic, Transmission},
};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

/// The identity of a body in a builder, returned by `ModelBuilder.body` and other methods. `WORLD` is valid in every
/// builder.
#[pyclass(frozen, module = "condyle")]
pub(crate) struct BodyId {
    inner: condyle::tree::BodyId,
    /// Identifying number of the builder that made the body; `None` for the world.
    builder: Option<u64>,
}

#[pymethods]
impl BodyId {
    /// Returns `condyle.WORLD` for the world, and `<condyle.BodyId>` for every other body.
    fn __repr__(&self) -> &'static str {
        if self.builder.is_none() { "condyle.WORLD" } else { "<condyle.BodyId>" }
    }
}

/// Returns the identity of the world, which is the parent of root joints.
pub(crate) fn world(py: Python<'_>) -> PyResult<&Py<BodyId>> {
    static WORLD: PyOnceLock<Py<BodyId>> = PyOnceLock::new();
    WORLD.get_or_try_init(py, || Py::new(py, BodyId { inner: condyle::WORLD, builder: None }))
}

/// A builder that makes a `Model` body by body, parents first.
///
/// Placements are homogeneous (4, 4) matrices; None is the identity. Inertias are `Inertia`; None is no mass.
/// A builder makes Pinocchio's composite, universal and spherical ZYX joints as a `chain` of bodies. The chain has the
/// same q and v, but each joint except the last adds a body without mass. `nbodies`, `names` and the rows of f_ext
/// include these bodies.
///
/// name: the name of the robot.
///
/// >>> from condyle import Inertia, Joint, ModelBuilder, WORLD
/// >>> rod = Inertia.from_com(1.0, [0.0, 0.0, -0.5], 0.08 * np.eye(3))
/// >>> elbow = np.eye(4)
/// >>> elbow[2, 3] = -1.0
/// >>> robot = ModelBuilder("double pendulum")
/// >>> upper = robot.body("upper", WORLD, Joint.revolute([0.0, 1.0, 0.0]), inertia=rod)
/// >>> lower = robot.body("lower", upper, Joint.revolute([0.0, 1.0, 0.0]), elbow, rod, damping=0.1)
/// >>> robot.frame("tip", lower, elbow)
/// >>> robot.build()
/// <condyle.Model 'double pendulum': 2 bodies, nq = 2, nv = 2>
#[pyclass(module = "condyle")]
pub(crate) struct ModelBuilder {
    /// The library's builder; `None` once the model is built.
    inner: Option<condyle::ModelBuilder>,
    name: String,
    /// Identifying number of this builder; no other builder has the same number.
    number: u64,
}

fn placed(argument: &str, value: Option<&Bound<'_, PyAny>>) -> PyResult<Se3<f64>> {
    value.map_or(Ok(Se3::identity()), |value| pose(argument, value))
}

fn massive(value: Option<&Bound<'_, PyAny>>) -> PyResult<Inertia<f64>> {
    value.map_or(Ok(Inertia::zero()), |value| read_inertia("inertia", value))
}

impl ModelBuilder {
    fn builder(&mut self) -> PyResult<&mut condyle::ModelBuilder> {
        self.inner.as_mut().ok_or_else(|| PyRuntimeError::new_err("the model is built; make another builder"))
    }

    fn body_of(&self, argument: &str, body: &Bound<'_, BodyId>) -> PyResult<condyle::tree::BodyId> {
        let BodyId { inner, builder } = body.get();
        if builder.is_none_or(|number| number == self.number) {
            return Ok(*inner);
        }
        Err(PyValueError::new_err(format!("{argument}: a body of another builder")))
    }

    fn added(&self, body: condyle::tree::BodyId) -> BodyId {
        BodyId { inner: body, builder: Some(self.number) }
    }
}

#[pymethods]
impl ModelBuilder {
    #[new]
    fn new(name: &str) -> Self {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        Self { inner: Some(condyle::ModelBuilder::new(name)), name: name.to_owned(), number }
    }

    /// Returns the robot's name, and whether the model is built.
    fn __repr__(&self) -> String {
        let built = if self.inner.is_none() { ", built" } else { "" };
        format!("<condyle.ModelBuilder '{}'{built}>", self.name)
    }

    /// Adds a body and its joint.
    ///
    /// name: the name of the body, and also of the joint unless `joint_name` is given.
    /// parent: the body to which the joint is attached.
    /// placement: the joint's frame at position zero, in the parent's frame.
    /// inertia: in the body's frame, which is the joint's frame at position zero.
    /// position: (minimum, maximum) position (rad, m), for joints with one coordinate; None for no limits.
    /// velocity: maximum speed (rad/s, m/s); None for no limit.
    /// effort: maximum effort (N m, N), or (minimum, maximum); None for no limits.
    /// damping: viscous friction (N m s/rad, N s/m). friction: Coulomb friction (N m, N).
    /// damping_polynomial: (d₁, d₂) of the damping coefficient d₀ + d₁|v| + d₂v², with d₀ = damping.
    /// armature: rotor inertia as seen at the joint (kg m², kg).
    #[pyo3(signature = (
        name, parent, joint, placement=None, inertia=None, *, joint_name=None, position=None, velocity=None,
        effort=None, damping=0.0, friction=0.0, armature=0.0, damping_polynomial=(0.0, 0.0)
    ))]
    fn body(
        &mut self,
        name: &str,
        parent: &Bound<'_, BodyId>,
        joint: &Bound<'_, Joint>,
        placement: Option<&Bound<'_, PyAny>>,
        inertia: Option<&Bound<'_, PyAny>>,
        joint_name: Option<&str>,
        position: Option<(f64, f64)>,
        velocity: Option<f64>,
        effort: Option<Bound<'_, PyAny>>,
        damping: f64,
        friction: f64,
        armature: f64,
        damping_polynomial: (f64, f64),
    ) -> PyResult<BodyId> {
        let parent = self.body_of("parent", parent)?;
        let (placement, inertia) = (placed("placement", placement)?, massive(inertia)?);
        let damping_polynomial = damping_polynomial.into();
        let effort = effort.map(|effort| effort.extract().map(|most: f64| (-most, most)).or_else(|_| effort.extract()));
        let effort = effort.transpose()?;
        let options = JointOptions { position, velocity, effort, damping, damping_polynomial, friction, armature };
        let names = (name, joint_name.unwrap_or(name));
        let body = self.builder()?.body_with(names, parent, joint.get().0, placement, inertia, options);
        Ok(self.added(body))
    }

    /// Adds a body at the end of a chain of joints: a composite joint. The placement of each joint is relative to the
    /// frame of the previous joint.
    ///
    /// The coordinates of the joints follow one another in q and v. Bodies without mass, named `name#1`, `name#2`, and
    /// so on, connect the joints. Returns the last body, to which `inertia` belongs. A universal joint about unit
    /// vectors a and b is `[(Joint.revolute(a), placement), (Joint.revolute(b), None)]`.
    ///
    /// joints: a list of (joint, placement).
    #[pyo3(signature = (name, parent, joints, inertia=None))]
    fn chain(
        &mut self,
        name: &str,
        parent: &Bound<'_, BodyId>,
        joints: Vec<(Bound<'_, Joint>, Option<Bound<'_, PyAny>>)>,
        inertia: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<BodyId> {
        if joints.is_empty() {
            return Err(PyValueError::new_err("joints: expected at least one"));
        }
        let parent = self.body_of("parent", parent)?;
        let joint = |(joint, placement): &(Bound<'_, Joint>, Option<Bound<'_, PyAny>>)| {
            Ok((joint.get().0, placed("joints", placement.as_ref())?))
        };
        let joints = joints.iter().map(joint).collect::<PyResult<Vec<_>>>()?;
        let inertia = massive(inertia)?;
        let body = self.builder()?.chain(name, parent, &joints, inertia);
        Ok(self.added(body))
    }

    /// Adds a body on a ball joint that turns by q₀ about z, then by q₁ about the new y axis, then by q₂ about the new
    /// x axis; v = q̇.
    ///
    /// M is singular where q₁ = ±π/2. `Joint.spherical` has no singular position.
    #[pyo3(signature = (name, parent, placement=None, inertia=None))]
    fn spherical_zyx(
        &mut self,
        name: &str,
        parent: &Bound<'_, BodyId>,
        placement: Option<&Bound<'_, PyAny>>,
        inertia: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<BodyId> {
        let parent = self.body_of("parent", parent)?;
        let (placement, inertia) = (placed("placement", placement)?, massive(inertia)?);
        let body = self.builder()?.spherical_zyx(name, parent, placement, inertia);
        Ok(self.added(body))
    }

    /// Adds an inertia to a body. The inertia is given in its own frame, which has the pose `placement` in the body's
    /// frame.
    fn merge(
        &mut self,
        body: &Bound<'_, BodyId>,
        placement: Option<&Bound<'_, PyAny>>,
        inertia: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let body = self.body_of("body", body)?;
        let (placement, inertia) = (placed("placement", placement)?, read_inertia("inertia", inertia)?);
        self.builder()?.merge(body, placement, inertia);
        Ok(())
    }

    /// Adds a frame with the pose `placement` in the body's frame. kind: 'link', 'joint' or 'user'. Frames of different
    /// kinds may have the same name.
    #[pyo3(signature = (name, body, placement=None, kind="user"))]
    fn frame(
        &mut self,
        name: &str,
        body: &Bound<'_, BodyId>,
        placement: Option<&Bound<'_, PyAny>>,
        kind: &str,
    ) -> PyResult<()> {
        let (body, placement) = (self.body_of("body", body)?, placed("placement", placement)?);
        let kind = match kind {
            "link" => FrameKind::Link,
            "joint" => FrameKind::Joint,
            "user" => FrameKind::User,
            other => return Err(wrong_word("kind", "'link', 'joint' or 'user'", other)),
        };
        self.builder()?.frame_of_kind(name, kind, body, placement);
        Ok(())
    }

    /// Makes a joint follow another joint: the follower's position is ratio q + offset, where q is the leader's
    /// position. The follower has no coordinate in q.
    ///
    /// follower, leader: the bodies that the joints carry.
    #[pyo3(signature = (follower, leader, ratio=1.0, offset=0.0))]
    fn mimic(
        &mut self,
        follower: &Bound<'_, BodyId>,
        leader: &Bound<'_, BodyId>,
        ratio: f64,
        offset: f64,
    ) -> PyResult<()> {
        let (follower, leader) = (self.body_of("follower", follower)?, self.body_of("leader", leader)?);
        self.builder()?.mimic(follower, leader, Mimic { ratio, offset });
        Ok(())
    }

    /// Adds all bodies of another robot. The other robot's world has the pose `placement` in the frame of `parent`.
    /// `prefix` is added before all names of the other robot.
    ///
    /// >>> from condyle import ModelBuilder, WORLD
    /// >>> two = ModelBuilder("two arms")
    /// >>> for side, y in ("left_", 0.4), ("right_", -0.4):
    /// ...     at = np.eye(4)
    /// ...     at[1, 3] = y
    /// ...     two.append(WORLD, at, condyle.robots.arm7(), side)
    /// >>> two.build().nv
    /// 14
    #[pyo3(signature = (parent, placement, model, prefix=""))]
    fn append(
        &mut self,
        parent: &Bound<'_, BodyId>,
        placement: Option<&Bound<'_, PyAny>>,
        model: &Bound<'_, Model>,
        prefix: &str,
    ) -> PyResult<()> {
        let (parent, placement) = (self.body_of("parent", parent)?, placed("placement", placement)?);
        self.builder()?.append(parent, placement, &model.get().inner, prefix);
        Ok(())
    }

    /// Adds a spring to a joint: τ = −(k₀ + k₁ Δ + k₂ Δ²) Δ with the displacement Δ = q ⊖ rest. For joints with several
    /// degrees of freedom, the brackets contain |Δ| instead of Δ.
    ///
    /// body: the body that the joint carries. stiffness: k₀, or k₀, k₁ and k₂. rest: the joint's position at which the
    /// spring is at rest, with as many numbers as the joint has in q.
    ///
    /// >>> from condyle import Inertia, Joint, ModelBuilder, WORLD
    /// >>> robot = ModelBuilder("door")
    /// >>> door = robot.body("door", WORLD, Joint.revolute([0.0, 0.0, 1.0]), inertia=Inertia.from_sphere(5.0, 0.5))
    /// >>> robot.spring(door, 2.0, rest=[0.1])
    /// >>> robot.build().springs
    /// [Spring(joint='door', stiffness=[2., 0., 0.], rest=[0.1])]
    fn spring(
        &mut self,
        body: &Bound<'_, BodyId>,
        stiffness: &Bound<'_, PyAny>,
        rest: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        let body = self.body_of("body", body)?;
        let stiffness = match stiffness.extract::<f64>() {
            Ok(stiffness) => [stiffness, 0.0, 0.0],
            Err(_) => three("stiffness", stiffness)?.to_array(),
        };
        let rest: Vec<f64> = match rest.extract::<f64>() {
            Ok(rest) => vec![rest],
            Err(_) => numbers("rest", rest)?,
        };
        self.builder()?.spring(body, stiffness, &rest);
        Ok(())
    }

    /// Supports a fraction of a body's weight, as MuJoCo's `gravcomp` does: the force −ratio m g acts at the centre of
    /// mass. If the inertia of the body changes later, the force changes with the inertia.
    ///
    /// ratio: the supported fraction of the weight; 1 supports the whole weight.
    /// part: None for the whole body, or the inertia of the part of the body to which `ratio` applies. The inertia of
    ///     the body must include this inertia, which is given in a frame with the pose `placement` in the body's frame.
    #[pyo3(signature = (body, ratio=1.0, part=None, placement=None))]
    fn compensate_gravity(
        &mut self,
        body: &Bound<'_, BodyId>,
        ratio: f64,
        part: Option<&Bound<'_, PyAny>>,
        placement: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (body, placement) = (self.body_of("body", body)?, placed("placement", placement)?);
        match part {
            Some(part) => {
                let part = read_inertia("part", part)?;
                self.builder()?.compensate_gravity_of_part(body, placement, part, ratio);
            }
            None => self.builder()?.compensate_gravity(body, ratio),
        }
        Ok(())
    }

    /// Adds an actuator that drives a joint, or a tendon over several joints; see `Actuator`. Limits, armature and
    /// damping belong to the joints; an actuator does not change these values.
    ///
    /// joint: the body that the joint carries; or, for a tendon, a list of (body, coefficient).
    /// tendon: the tendon's name, if the actuator drives a tendon.
    /// gear: one to six numbers; None is 1. gain: the force per unit of control. None means kp if kp is not 0, else kv
    /// if kv is not 0. If both are 0, None means 1, as for a motor. control, force: (minimum, maximum); None for no
    /// limits.
    #[pyo3(signature = (
        name, joint, *, tendon=None, gear=None, gain=None, bias=0.0, kp=0.0, kv=0.0, control=None, force=None
    ))]
    fn actuator(
        &mut self,
        name: &str,
        joint: &Bound<'_, PyAny>,
        tendon: Option<&str>,
        gear: Option<&Bound<'_, PyAny>>,
        gain: Option<f64>,
        bias: f64,
        kp: f64,
        kv: f64,
        control: Option<(f64, f64)>,
        force: Option<(f64, f64)>,
    ) -> PyResult<()> {
        let transmission = match tendon {
            None => {
                let body = joint.cast::<BodyId>().map_err(|_| PyTypeError::new_err("joint: expected a BodyId"))?;
                Transmission::Joint { body: self.body_of("joint", body)? }
            }
            Some(tendon) => {
                let joints: Vec<(Bound<'_, BodyId>, f64)> = joint.extract()?;
                let joints = joints.iter().map(|(body, by)| Ok((self.body_of("joint", body)?, *by)));
                Transmission::Tendon { name: tendon.to_owned(), joints: joints.collect::<PyResult<_>>()? }
            }
        };
        let given: Vec<f64> = match gear.map(|gear| gear.extract::<f64>().map_err(|_| gear)) {
            None => vec![1.0],
            Some(Ok(gear)) => vec![gear],
            Some(Err(gear)) => numbers("gear", gear)?,
        };
        let mut gear = [0.0; 6];
        if given.len() > 6 {
            return Err(PyValueError::new_err(format!("gear: expected at most 6 numbers, found {}", given.len())));
        }
        gear[..given.len()].copy_from_slice(&given);
        let free = (f64::NEG_INFINITY, f64::INFINITY);
        let (control, force) = (control.unwrap_or(free), force.unwrap_or(free));
        let gain = gain.or([kp, kv, 1.0].into_iter().find(|gain| *gain != 0.0)).unwrap_or(1.0);
        let name = name.to_owned();
        self.builder()?.actuator(Actuator { name, transmission, gear, gain, bias, kp, kv, control, force });
        Ok(())
    }

    /// Sets the acceleration of free fall, 3 numbers in the world's frame (m/s²). The default is (0, 0, −9.81).
    fn gravity(&mut self, gravity: &Bound<'_, PyAny>) -> PyResult<()> {
        let gravity = three("gravity", gravity)?;
        self.builder()?.gravity(gravity);
        Ok(())
    }

    /// Builds the model, and checks all data. The bodies are numbered depth first, and siblings in the order of the
    /// calls that added them. The builder cannot be used afterwards.
    ///
    /// Raises `ModelError` for invalid names, axes, masses or limits, for numbers that are not finite, and for a mimic
    /// joint with an invalid leader.
    fn build(&mut self) -> PyResult<Model> {
        self.builder()?;
        let builder = self.inner.take().expect("was just looked at");
        Ok(builder.build().map_err(exception)?.into())
    }
}
