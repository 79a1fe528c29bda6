//! Methods of a model that return a changed copy.

use super::{Model, body_index, frame_index, members_of};
use crate::arrays::{matrix, pose, three, vector};
use crate::exceptions::exception;
use crate::inertial_parameters::read_inertia;
use condyle::{Se3, tree::FrameParent};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;

#[pymethods]
impl Model {
    /// Returns the same robot with another gravity (m/s², 3 numbers, in the world's frame).
    ///
    /// Raises `ModelError` if the gravity is not finite.
    fn with_gravity(&self, gravity: &Bound<'_, PyAny>) -> PyResult<Self> {
        let gravity = three("gravity", gravity)?;
        Ok((*self.inner).clone().with_gravity(gravity).map_err(exception)?.into())
    }

    /// Returns the same robot with another armature, nv numbers (kg m², kg).
    ///
    /// Raises `ModelError` if a number is negative or not finite.
    fn with_armature(&self, armature: &Bound<'_, PyAny>) -> PyResult<Self> {
        let armature = vector("armature", armature, self.inner.nv())?;
        Ok((*self.inner).clone().with_armature(&armature).map_err(exception)?.into())
    }

    /// Returns the same robot with another viscous damping, nv numbers (N m s/rad, N s/m).
    ///
    /// polynomial: d₁ and d₂ of the damping d(v) = d₀ + d₁|v| + d₂v² of each degree of freedom, (nv, 2). None keeps the
    /// old coefficients.
    ///
    /// Raises `ModelError` if a number is not finite, or a damping is negative.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> arm.with_damping([0.1] * 7).damping[0].item()
    /// 0.1
    #[pyo3(signature = (damping, polynomial=None))]
    fn with_damping(&self, damping: &Bound<'_, PyAny>, polynomial: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let nv = self.inner.nv();
        let mut model = (*self.inner).clone().with_damping(&vector("damping", damping, nv)?).map_err(exception)?;
        if let Some(polynomial) = polynomial {
            let polynomial = matrix("polynomial", polynomial, [nv, 2])?;
            model = model.with_damping_polynomial(polynomial.as_chunks().0).map_err(exception)?;
        }
        Ok(model.into())
    }

    /// Returns the same robot with another Coulomb friction, nv numbers (N m, N).
    ///
    /// Raises `ModelError` if a number is negative or not finite.
    fn with_friction(&self, friction: &Bound<'_, PyAny>) -> PyResult<Self> {
        let friction = vector("friction", friction, self.inner.nv())?;
        Ok((*self.inner).clone().with_friction(&friction).map_err(exception)?.into())
    }

    /// Returns the same robot with other limits of position (nq numbers), velocity and effort (nv each). None keeps the
    /// old limits; an infinite number removes a limit.
    ///
    /// effort: maximum magnitude; sets both `effort_lower` and `effort_upper`, and cannot be combined with either.
    ///
    /// Raises `ModelError` if a lower limit is above an upper one, or a limit of velocity is negative.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> arm.with_limits(effort=0.5 * arm.limits.effort).limits.effort[0].item()
    /// 43.5
    #[pyo3(signature = (lower=None, upper=None, velocity=None, effort=None, *, effort_lower=None, effort_upper=None))]
    fn with_limits(
        &self,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        effort: Option<&Bound<'_, PyAny>>,
        effort_lower: Option<&Bound<'_, PyAny>>,
        effort_upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        if effort.is_some() && (effort_lower.is_some() || effort_upper.is_some()) {
            return Err(PyTypeError::new_err("effort: sets both sides, so effort_lower and effort_upper must be None"));
        }
        let mut limits = self.inner.limits().clone();
        if let Some(effort) = effort {
            let effort = vector("effort", effort, self.inner.nv())?.to_vec();
            limits.effort_lower = effort.iter().map(|effort| -effort).collect();
            limits.effort_upper = effort;
        }
        for (name, given, limit) in [
            ("lower", lower, &mut limits.lower),
            ("upper", upper, &mut limits.upper),
            ("velocity", velocity, &mut limits.velocity),
            ("effort_lower", effort_lower, &mut limits.effort_lower),
            ("effort_upper", effort_upper, &mut limits.effort_upper),
        ] {
            if let Some(given) = given {
                *limit = vector(name, given, limit.len())?.to_vec();
            }
        }
        Ok((*self.inner).clone().with_limits(limits).map_err(exception)?.into())
    }

    /// Returns the same robot with other inertias: a list like `inertias`, with one `Inertia` for each body, beginning
    /// with the world. Implausible values are reported in the `warnings` and `singular_joints` of the result.
    ///
    /// Raises `ModelError` if a mass is negative or a number is not finite.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> twice = [I._replace(mass=2.0 * I.mass, rotational=2.0 * I.rotational) for I in arm.inertias]
    /// >>> heavier = arm.with_inertias(twice)
    /// >>> heavier.total_mass == 2.0 * arm.total_mass
    /// True
    fn with_inertias(&self, inertias: &Bound<'_, PyAny>) -> PyResult<Self> {
        let inertias = members_of("inertias", "`Inertia`s", inertias)?;
        let (expected, found) = (self.inner.bodies().len(), inertias.len());
        if found != expected {
            return Err(PyValueError::new_err(format!("inertias: expected {expected}, found {found}")));
        }
        let inertias = inertias.iter().map(|I| read_inertia("inertias", I)).collect::<PyResult<Vec<_>>>()?;
        Ok(self.inner.with_inertias(|body, _| inertias[body]).map_err(exception)?.into())
    }

    /// Returns the same robot with one more frame of kind 'user', which is the last of `frames`. All other contents are
    /// unchanged.
    ///
    /// name: the new frame's name; parent: the name or index of the frame to which the new frame is attached, or the
    /// name of a body; None is the world; placement: the pose of the new frame in the parent's frame, a homogeneous (4,
    /// 4) matrix; None is the identity.
    ///
    /// Raises `ModelError` if the parent does not exist, the placement is not a homogeneous matrix, or another frame of
    /// kind 'user' has this name.
    ///
    /// >>> tip = np.eye(4)
    /// >>> tip[2, 3] = 0.1
    /// >>> arm = condyle.robots.arm7().with_frame("tip", "tool", tip)
    /// >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.3] * 7, "tip").shape
    /// (6, 7)
    #[pyo3(signature = (name, parent, placement=None))]
    fn with_frame(
        &self,
        name: &str,
        parent: Option<&Bound<'_, PyAny>>,
        placement: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let placement = placement.map_or(Ok(Se3::identity()), |placement| pose("placement", placement))?;
        let text: String;
        let parent = match parent {
            None => FrameParent::Body(0),
            Some(parent) if parent.is_instance_of::<PyString>() => {
                text = parent.extract()?;
                FrameParent::Named(&text)
            }
            Some(parent) => FrameParent::Frame(frame_index(&self.inner, parent)?),
        };
        Ok(self.inner.with_frame(name, parent, placement).map_err(exception)?.into())
    }

    /// Returns the same robot with some joints locked at their positions in q.
    ///
    /// The bodies of locked joints are merged into their parent bodies and remain as frames. A mimic joint is locked
    /// together with the joint that it follows. A locked joint still contributes to the length of a tendon. If a linear
    /// coupling connects a locked joint to another joint, the other joint is locked, too. Warnings about the file are
    /// kept.
    ///
    /// joints: a list of names or indices of bodies.
    /// q: position, nq numbers.
    ///
    /// >>> condyle.robots.arm7().lock(["joint4", 6], [0.0] * 7).names
    /// ['universe', 'joint1', 'joint2', 'joint3', 'joint5', 'joint7']
    ///
    /// Raises `ModelError` if a joint does not exist, or if `q` is not finite or contains a rotation whose length is
    /// not 1 (up to 1e-3).
    fn lock(&self, joints: &Bound<'_, PyAny>, q: &Bound<'_, PyAny>) -> PyResult<Self> {
        let joints = members_of("joints", "names or numbers of bodies", joints)?;
        let joints = joints
            .iter()
            .map(|joint| body_index("joints: expected names", &self.inner, joint, 1))
            .collect::<PyResult<Vec<_>>>()?;
        let q = vector("q", q, self.inner.nq())?;
        Ok(self.inner.lock(&joints, &q).map_err(exception)?.into())
    }

    /// Returns a new model: this robot with another robot attached to one of its frames.
    ///
    /// The new bodies are numbered as by Pinocchio's `appendModel`: after all existing descendants of the body to which
    /// they are attached. The result has the name and the gravity of this robot.
    ///
    /// frame: the name or index of a frame; None is the world.
    /// model: the other robot.
    /// placement: the pose of the other robot's world in the frame, a homogeneous (4, 4) matrix; None is the identity.
    /// prefix: text added before all names of the other robot.
    ///
    /// >>> quadruped, arm = condyle.robots.quadruped(), condyle.robots.arm7()
    /// >>> quadruped.append("trunk", arm, prefix="arm_").names[13:16]
    /// ['RH_KFE', 'arm_joint1', 'arm_joint2']
    ///
    /// Raises `ModelError` if two bodies, joints or frames have the same name.
    #[pyo3(signature = (frame, model, placement=None, prefix=""))]
    fn append(
        &self,
        frame: Option<&Bound<'_, PyAny>>,
        model: &Bound<'_, Self>,
        placement: Option<&Bound<'_, PyAny>>,
        prefix: &str,
    ) -> PyResult<Self> {
        let fXw = placement.map_or(Ok(Se3::identity()), |placement| pose("placement", placement))?;
        let (body, bXf) = match frame {
            None => (0, Se3::identity()),
            Some(frame) => {
                let frame = &self.inner.frames()[frame_index(&self.inner, frame)?];
                (frame.body, frame.placement)
            }
        };
        Ok(self.inner.append(body, bXf * fXw, &model.get().inner, prefix).map_err(exception)?.into())
    }

    /// Returns the same robot with one more mimic joint: the follower's position is ratio q + offset, where q is the
    /// leader's position. The follower has no coordinate in q. The limits of the leader's coordinate then apply to both
    /// joints.
    ///
    /// follower, leader: the joints' names, or the indices of their bodies.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> arm.with_mimic("joint4", "joint2", ratio=-2.0).nv
    /// 6
    ///
    /// Raises `ModelError` if a joint does not have exactly one degree of freedom, the leader is itself a mimic joint,
    /// or another joint follows the follower.
    #[pyo3(signature = (follower, leader, ratio=1.0, offset=0.0))]
    fn with_mimic(
        &self,
        follower: &Bound<'_, PyAny>,
        leader: &Bound<'_, PyAny>,
        ratio: f64,
        offset: f64,
    ) -> PyResult<Self> {
        let follower = body_index("follower: expected a joint's name", &self.inner, follower, 1)?;
        let leader = body_index("leader: expected a joint's name", &self.inner, leader, 1)?;
        Ok(self.inner.with_mimic(follower, leader, condyle::tree::Mimic { ratio, offset }).map_err(exception)?.into())
    }
}
