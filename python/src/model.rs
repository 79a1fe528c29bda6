//! A robot as Python sees it.

use crate::arrays::{Give, class, found_type, pose, read_only, three, vector};
use crate::cached::{Attribute, Cached};
use crate::exceptions::{ModelError, exception};
use crate::inertial_parameters::{model_inertia, read_inertia};
use crate::joint::{Joint, kind, root};
use crate::tree::tree;
use condyle::{
    MjcfOptions, SdfOptions, Se3, UrdfOptions,
    regressors::inertial_parameters,
    tree::{FrameKind, FrameParent},
};
use pyo3::exceptions::{PyAttributeError, PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList, PyString};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::PathBuf;
use std::sync::Arc;

/// A robot: bodies, joints, frames, inertias, limits. It never changes and may be shared between threads.
///
/// Body 0 is the world. The others stand parents first, depth first, siblings in the order of their joints' names, as
/// Pinocchio numbers them. A model is read from a file, made by a `ModelBuilder`, or one of `condyle.robots`; it can be
/// pickled.
///
/// >>> arm = condyle.robots.arm7()
/// >>> arm.nq, arm.nv, arm.names[:3]
/// (7, 7, ['universe', 'joint1', 'joint2'])
#[pyclass(frozen, module = "condyle")]
pub(crate) struct Model {
    pub(crate) inner: Arc<condyle::Model>,
    /// A hash that is equal for models of the same bodies and joints, which can share a `Data`.
    pub(crate) structure: u64,
    cached: Cached,
}

impl From<condyle::Model> for Model {
    fn from(inner: condyle::Model) -> Self {
        let mut hasher = DefaultHasher::new();
        for b in inner.bodies() {
            (&b.joint_name, b.parent, kind(b.joint), b.idx_q, b.idx_v, b.mimic.is_some()).hash(&mut hasher);
        }
        Self { structure: hasher.finish(), inner: Arc::new(inner), cached: Cached::new() }
    }
}

/// The number of a frame that is given by name or by number.
pub(crate) fn frame_index(model: &condyle::Model, frame: &Bound<'_, PyAny>) -> PyResult<usize> {
    if let Ok(name) = frame.cast::<PyString>() {
        return model.frame(name.to_str()?).map_err(exception);
    }
    numbered("frame: expected a name", frame, 0, model.frames().len())
}

/// The number, from `least` on, of a body that is given by its joint's name or by number.
pub(crate) fn body_index(
    expected: &str,
    model: &condyle::Model,
    body: &Bound<'_, PyAny>,
    least: usize,
) -> PyResult<usize> {
    if let Ok(name) = body.cast::<PyString>() {
        return model.joint(name.to_str()?).map_err(exception);
    }
    numbered(expected, body, least, model.bodies().len())
}

/// The members of an argument that is a list of some things.
pub(crate) fn members_of<'py>(
    argument: &str,
    what: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let wrong = |found: String| PyTypeError::new_err(format!("{argument}: expected a list of {what}, found {found}"));
    // text is iterable, and so are named tuples such as a single constraint
    if given.is_instance_of::<PyString>() || given.is_instance_of::<PyBytes>() || given.hasattr("_fields")? {
        let found = given.repr()?;
        return Err(wrong(format!("{found}; write [{found}]")));
    }
    let members = given.try_iter().map_err(|_| wrong(found_type(given)))?;
    members.collect()
}

/// An index from `least` to below `count`.
fn numbered(expected: &str, given: &Bound<'_, PyAny>, least: usize, count: usize) -> PyResult<usize> {
    let wrong = |found: String| match count {
        _ if least < count => format!("{expected} or {least} to {}, found {found}", count - 1),
        _ => format!("{expected}, found {found}: the model has none"),
    };
    let index: isize = given.extract().map_err(|_| {
        let found = if given.is_none() { "None".to_owned() } else { found_type(given) };
        PyTypeError::new_err(wrong(found))
    })?;
    let inside = usize::try_from(index).ok().filter(|i| (least..count).contains(i));
    inside.ok_or_else(|| PyIndexError::new_err(wrong(index.to_string())))
}

impl Model {
    /// A number for each joint that has coordinates of its own; 0 for the others.
    fn of_joints(&self, get: impl Fn(&condyle::tree::Body) -> usize) -> Vec<usize> {
        let count = |(i, b): (usize, &condyle::tree::Body)| if i > 0 && b.mimic.is_none() { get(b) } else { 0 };
        self.inner.bodies().iter().enumerate().map(count).collect()
    }

    fn of_bodies<T>(&self, get: impl FnMut(&condyle::tree::Body) -> T) -> Vec<T> {
        self.inner.bodies().iter().map(get).collect()
    }

    /// Numbers of the model, in an array that nobody can write to.
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        instead: &str,
        numbers: impl FnOnce() -> Vec<f64>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, attribute, || read_only(py, &numbers()[..], instead))
    }
}

#[pymethods]
impl Model {
    /// A model from a URDF file.
    ///
    /// Fixed joints are merged into the body that they sit on and stay as frames. Meshes are never looked at.
    ///
    /// path: a path, as text or `os.PathLike`, or `package://name/path/in/the/package`.
    /// root_joint: the joint between the world and the root link, named `root_joint`: 'free_flyer', 'planar',
    ///     'spherical' or 'translation'; None fixes the root link to the world.
    /// mimic: whether joints with a `<mimic>` share the coordinate of the joint that they follow, instead of having
    ///     their own.
    /// strict: whether what is only odd (`warnings`) is an error.
    /// packages: folders that have packages in them, or are packages; before those that the environment names in
    ///     `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH`.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`.
    #[staticmethod]
    #[pyo3(signature = (path, root_joint=None, mimic=false, strict=false, packages=None))]
    fn from_urdf(
        path: PathBuf,
        root_joint: Option<&str>,
        mimic: bool,
        strict: bool,
        packages: Option<Vec<PathBuf>>,
    ) -> PyResult<Self> {
        let packages = packages.unwrap_or_default();
        let options = UrdfOptions { root_joint: root(root_joint)?, mimic, strict, packages, ..UrdfOptions::default() };
        Ok(condyle::Model::from_urdf(path, &options).map_err(exception)?.into())
    }

    /// A model from a URDF in a string; see `from_urdf`.
    ///
    /// >>> text = condyle.robots.QUADRUPED
    /// >>> condyle.Model.from_urdf_str(text, root_joint="free_flyer").nv
    /// 18
    #[staticmethod]
    #[pyo3(signature = (text, root_joint=None, mimic=false, strict=false))]
    fn from_urdf_str(text: &str, root_joint: Option<&str>, mimic: bool, strict: bool) -> PyResult<Self> {
        let options = UrdfOptions { root_joint: root(root_joint)?, mimic, strict, ..UrdfOptions::default() };
        Ok(condyle::Model::from_urdf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from an MJCF file (MuJoCo) and the files that it includes.
    ///
    /// q and v read as MuJoCo's `qpos` and `qvel`, but that quaternions are x, y, z, w and a free joint's velocity is
    /// in the body's frame (MuJoCo: linear velocity in the world's). Several joints on one body become a chain, with
    /// bodies without mass, `name#1`, `name#2`, …, between them. What a tree of bodies cannot have is left out and
    /// stands in `warnings`.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// mimic: whether a `<joint>` of `<equality>` lets joint1 follow joint2, instead of being left out; its `polycoef`
    ///     must be linear.
    /// strict: whether what is only odd, or left out (`warnings`), is an error.
    /// weightless_meshes: whether the mass of a mesh, on a moving body without `<inertial>`, is left out and stands in
    ///     `warnings`, instead of being an error.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`.
    #[staticmethod]
    #[pyo3(signature = (path, mimic=false, strict=false, weightless_meshes=false))]
    fn from_mjcf(path: PathBuf, mimic: bool, strict: bool, weightless_meshes: bool) -> PyResult<Self> {
        let options = MjcfOptions { strict, mimic, weightless_meshes, ..MjcfOptions::default() };
        Ok(condyle::Model::from_mjcf(path, &options).map_err(exception)?.into())
    }

    /// A model from an MJCF in a string, which may not include files; see `from_mjcf`.
    ///
    /// >>> body = '<body><joint axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 -1" size="0.02" mass="2"/></body>'
    /// >>> condyle.Model.from_mjcf_str(f"<mujoco><worldbody>{body}</worldbody></mujoco>").total_mass
    /// 2.0
    #[staticmethod]
    #[pyo3(signature = (text, mimic=false, strict=false, weightless_meshes=false))]
    fn from_mjcf_str(text: &str, mimic: bool, strict: bool, weightless_meshes: bool) -> PyResult<Self> {
        let options = MjcfOptions { strict, mimic, weightless_meshes, ..MjcfOptions::default() };
        Ok(condyle::Model::from_mjcf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from an SDF file (Gazebo) that holds one model.
    ///
    /// Joints are walked breadth first from the root, in the order of the file; one that would give a link a second
    /// parent closes a loop: it is left out and stands in `warnings`. Universal joints become two revolute ones.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// root_joint: as for `from_urdf`.
    /// mimic: whether an axis with a `<mimic>` follows another one, instead of being free.
    /// strict: whether what is only odd, or left out (`warnings`), is an error.
    ///
    /// Raises `ParseError`, with file, line and element, or `ModelError`.
    #[staticmethod]
    #[pyo3(signature = (path, root_joint=None, mimic=false, strict=false))]
    fn from_sdf(path: PathBuf, root_joint: Option<&str>, mimic: bool, strict: bool) -> PyResult<Self> {
        let options = SdfOptions { root_joint: root(root_joint)?, mimic, strict, ..SdfOptions::default() };
        Ok(condyle::Model::from_sdf(path, &options).map_err(exception)?.into())
    }

    /// A model from an SDF in a string; see `from_sdf`.
    ///
    /// >>> link = '<link name="ball"><inertial><mass>2</mass></inertial></link>'
    /// >>> text = f'<sdf version="1.7"><model name="ball">{link}</model></sdf>'
    /// >>> condyle.Model.from_sdf_str(text, root_joint="free_flyer").nv
    /// 6
    #[staticmethod]
    #[pyo3(signature = (text, root_joint=None, mimic=false, strict=false))]
    fn from_sdf_str(text: &str, root_joint: Option<&str>, mimic: bool, strict: bool) -> PyResult<Self> {
        let options = SdfOptions { root_joint: root(root_joint)?, mimic, strict, ..SdfOptions::default() };
        Ok(condyle::Model::from_sdf_str(text, &options).map_err(exception)?.into())
    }

    /// A model from Pinocchio's, a `pinocchio.Model`: the same joints, bodies, frames, limits and losses, so that numbers are
    /// equal; `to_pinocchio` is the way back.
    ///
    /// Composite, universal and spherical ZYX joints become several ones, with bodies without mass between them. Limits of
    /// quaternions, cosines and sines are left out, and so are geometry and reference configurations.
    ///
    /// Raises `ModelError` if its joints do not stand depth first, as Pinocchio's readers of files number them, or are of a
    /// kind that is not here.
    #[staticmethod]
    fn from_pinocchio<'py>(model: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        model.py().import("condyle._pinocchio_models")?.call_method1("from_pinocchio", (model,))
    }

    /// The same robot as a `pinocchio.Model`, which needs Pinocchio 3 or later.
    ///
    /// What follows another joint does so there too, unless it turns without limits.
    fn to_pinocchio<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("condyle._pinocchio_models")?;
        module.call_method1("to_pinocchio", (slf,))
    }

    /// Warnings: what is odd about the robot although it could be loaded.
    ///
    /// Inertias that no body has, joints along which the inertia matrix is singular, what a loader left out.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.inner.warnings().iter().map(ToString::to_string).collect()
    }

    /// The bodies whose joints make M singular: `aba`, `minv` and `aba_derivatives` raise `ModelError`.
    #[getter]
    fn singular_joints(&self) -> Vec<usize> {
        self.inner.singular_joints().to_vec()
    }

    /// The robot's name.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    /// The number of coordinates of a position q.
    #[getter]
    fn nq(&self) -> usize {
        self.inner.nq()
    }

    /// The number of degrees of freedom: of the numbers in v, a, τ and in a tangent vector.
    #[getter]
    fn nv(&self) -> usize {
        self.inner.nv()
    }

    /// The number of bodies, the world included: of the rows of f_ext and of the result of `forward_kinematics`.
    #[getter]
    fn nbodies(&self) -> usize {
        self.inner.bodies().len()
    }

    /// The names of the joints, one for each body; 'universe' for the world.
    #[getter]
    fn names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Names, || Ok(self.of_bodies(|b| b.joint_name.clone())))
    }

    /// The names of the links that the joints carry; 'universe' for the world.
    #[getter]
    fn body_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::BodyNames, || Ok(self.of_bodies(|b| b.name.clone())))
    }

    /// The kind of each joint: 'revolute', 'continuous', 'prismatic', 'helical', 'spherical', 'planar',
    /// 'translation' or 'free_flyer'; 'universe' for the world.
    #[getter]
    fn joint_types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::JointTypes, || {
            let mut types = self.of_bodies(|b| kind(b.joint));
            types[0] = "universe";
            Ok(types)
        })
    }

    /// The joints, as `Joint`; None for the world.
    #[getter]
    fn joints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Joints, || {
            let bodies = self.inner.bodies().iter().enumerate();
            Ok(bodies.map(|(i, b)| (i > 0).then_some(Joint(b.joint))).collect())
        })
    }

    /// The body on which each joint sits; 0 is the world.
    #[getter]
    fn parents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Parents, || Ok(self.of_bodies(|b| b.parent)))
    }

    /// The index in q at which each joint's position begins; for a joint that mimics another, that of the other.
    #[getter]
    fn idx_qs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::IdxQs, || Ok(self.of_bodies(|b| b.idx_q)))
    }

    /// The index in v at which each joint's velocity begins; for a joint that mimics another, that of the other.
    #[getter]
    fn idx_vs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::IdxVs, || Ok(self.of_bodies(|b| b.idx_v)))
    }

    /// The number of coordinates that each joint has of its own: 0 if it mimics another joint, and 0 for the world.
    #[getter]
    fn nqs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Nqs, || Ok(self.of_joints(|b| b.joint.nq())))
    }

    /// The number of degrees of freedom that each joint has of its own: 0 if it mimics another joint, and 0 for the
    /// world.
    #[getter]
    fn nvs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Nvs, || Ok(self.of_joints(|b| b.joint.nv())))
    }

    /// The rule by which each joint follows another one, as `Mimic(ratio, offset)`; None for a joint that does not.
    #[getter]
    fn mimics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Mimics, || {
            let class = class!(py, "Mimic")?;
            let mimic = |b: &condyle::tree::Body| b.mimic.map(|m| class.call1((m.ratio, m.offset))).transpose();
            self.inner.bodies().iter().map(mimic).collect()
        })
    }

    /// The pose of each joint's frame, at position zero, in its parent body: (nbodies, 4, 4).
    #[getter]
    fn joint_placements<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, Attribute::JointPlacements, || read_only(py, &self.of_bodies(|b| b.placement)[..], ""))
    }

    /// The inertia of each body in the body's frame, with all that fixed joints merge into it, as `Inertia`.
    #[getter]
    fn inertias<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Inertias, || {
            self.inner.bodies().iter().map(|b| model_inertia(py, b.inertia)).collect()
        })
    }

    /// The inertial parameters π, which regressors are multiplied with: ten numbers for each body but the world, 10
    /// (nbodies − 1) in all. They are mass, mass times centre of mass, and xx, xy, yy, xz, yz, zz of the rotational
    /// inertia about the origin of the body's frame.
    #[getter]
    fn inertial_parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let bodies = || self.inner.bodies()[1..].iter();
        let pi = || bodies().flat_map(|b| inertial_parameters::from_inertia(b.inertia)).collect();
        self.numbers(py, Attribute::InertialParameters, "with_inertias", pi)
    }

    /// The limits of position, velocity and effort, as `Limits`; infinite where there are none.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.cached.value(py, Attribute::Limits, || {
            let limits = self.inner.limits();
            let condyle::Limits { lower, upper, velocity, effort_lower, effort_upper } = limits;
            let give = |numbers: &[f64]| read_only(py, numbers, "with_limits");
            let effort = (give(&limits.effort())?, give(effort_lower)?, give(effort_upper)?);
            class!(py, "Limits")?.call1((give(lower)?, give(upper)?, give(velocity)?, effort.0, effort.1, effort.2))
        })
    }

    /// The viscous damping of each degree of freedom, nv numbers (N m s/rad, N s/m). It acts only in `passive_torque`
    /// and where a `Simulation` is asked for it.
    #[getter]
    fn damping<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Damping, "", || self.inner.damping().to_vec())
    }

    /// The Coulomb friction of each degree of freedom, nv numbers (N m, N). It acts only in `passive_torque` and where
    /// a `Simulation` is asked for it.
    #[getter]
    fn friction<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Friction, "", || self.inner.friction().to_vec())
    }

    /// The inertia of the rotor as seen at each joint, nv numbers (kg m², kg): a part of M in every algorithm.
    #[getter]
    fn armature<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Armature, "with_armature", || self.inner.armature().to_vec())
    }

    /// The constraints of the robot's file beside its tree, by name: loops as `ContactConstraint`, without stabilisation, and
    /// coupled joints as `Coupling`.
    ///
    /// The algorithms of a tree leave loops open. `constrained_dynamics` closes those that a `ConstraintSet` has:
    ///
    /// >>> robot = condyle.robots.quadruped()
    /// >>> loops = [c for c in robot.constraints().values() if isinstance(c, condyle.ContactConstraint)]
    /// >>> stiff = [c._replace(kp=400.0, kd=40.0) for c in loops]  # an error of position decays within 0.1 s
    /// >>> condyle.ConstraintSet(robot, stiff, mu=1e-8, iterations=5)
    /// <condyle.ConstraintSet of 'quadruped': 0 constraints, 0 rows>
    fn constraints<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        crate::constrained::of_model(py, &self.inner)
    }

    /// The acceleration of free fall, in the world's frame (m/s²), 3 numbers.
    #[getter]
    fn gravity<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.numbers(py, Attribute::Gravity, "with_gravity", || self.inner.gravity().to_array().to_vec())
    }

    /// The mass of all bodies, with that of what is fixed to the world (kg).
    #[getter]
    fn total_mass(&self) -> f64 {
        self.inner.total_mass()
    }

    /// The frames, as `Frame(name, kind, body, placement)`: two for each joint of the URDF, fixed ones too, the joint's
    /// and the link's.
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Frames, || {
            let class = class!(py, "Frame")?;
            let frame = |f: &condyle::tree::Frame| {
                let kind = match f.kind {
                    FrameKind::Link => "link",
                    FrameKind::Joint => "joint",
                    FrameKind::User => "user",
                    other => unreachable!("{other:?}: a kind of frame without a word for it"),
                };
                class.call1((f.name.as_str(), kind, f.body, read_only(py, &f.placement, "")?))
            };
            self.inner.frames().iter().map(frame).collect()
        })
    }

    /// The number of the frame with this name: a link's, else the user's, else a joint's.
    ///
    /// Raises `ModelError`, with the nearest name.
    fn frame(&self, name: &str) -> PyResult<usize> {
        self.inner.frame(name).map_err(exception)
    }

    /// The number of the body that the joint with this name carries.
    ///
    /// Raises `ModelError`, with the nearest name.
    fn joint(&self, name: &str) -> PyResult<usize> {
        self.inner.joint(name).map_err(exception)
    }

    /// The same robot under another gravity (m/s², 3 numbers, in the world's frame).
    ///
    /// Raises `ModelError` if it is not finite.
    fn with_gravity(&self, gravity: &Bound<'_, PyAny>) -> PyResult<Self> {
        let gravity = three("gravity", gravity)?;
        Ok((*self.inner).clone().with_gravity(gravity).map_err(exception)?.into())
    }

    /// The same robot with another armature, nv numbers (kg m², kg).
    ///
    /// Raises `ModelError` if one is negative or not finite.
    fn with_armature(&self, armature: &Bound<'_, PyAny>) -> PyResult<Self> {
        let armature = vector("armature", armature, self.inner.nv())?;
        Ok((*self.inner).clone().with_armature(&armature).map_err(exception)?.into())
    }

    /// The same robot with other limits of position (nq numbers), velocity and effort (nv each); None leaves them as they
    /// are, and infinite numbers are none.
    ///
    /// effort: greatest magnitude; sets both `effort_lower` and `effort_upper`, and goes with neither of them.
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

    /// The same robot with other inertias, one for each body as `inertias` gives them, the world's first. What is odd about
    /// them is in its `warnings` and `singular_joints`.
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

    /// The same robot with one more frame of the user's, the last one of `frames`. All other numbers stay as they are.
    ///
    /// name: the new frame's name; parent: the name or number of the frame on which it is put, or the name of a body; None is
    /// the world; placement: the new frame in the parent's, a homogeneous (4, 4) matrix; None is the identity.
    ///
    /// Raises `ModelError` if the parent does not exist, the placement is no rotation and translation, or the user has a frame
    /// of this name already.
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

    /// The same robot with some joints locked where they are at q.
    ///
    /// Their bodies are merged into those that carry them and stay as frames. A joint that follows a locked one is
    /// locked with it.
    ///
    /// joints: a list of names or numbers of bodies.
    /// q: nq numbers.
    ///
    /// >>> condyle.robots.arm7().lock(["joint4", 6], [0.0] * 7).names
    /// ['universe', 'joint1', 'joint2', 'joint3', 'joint5', 'joint7']
    ///
    /// Raises `ModelError`, also for a `q` that is not finite or in which a rotation has not the length 1 (up to 1e-3).
    fn lock(&self, joints: &Bound<'_, PyAny>, q: &Bound<'_, PyAny>) -> PyResult<Self> {
        let joints = members_of("joints", "names or numbers of bodies", joints)?;
        let joints = joints
            .iter()
            .map(|joint| body_index("joints: expected names", &self.inner, joint, 1))
            .collect::<PyResult<Vec<_>>>()?;
        let q = vector("q", q, self.inner.nq())?;
        Ok(self.inner.lock(&joints, &q).map_err(exception)?.into())
    }

    /// This robot with another one on a frame of it, as a new model.
    ///
    /// Its bodies are numbered behind all that the body which carries them has carried before, as Pinocchio's `appendModel` does;
    /// name and gravity are this one's.
    ///
    /// frame: the name or number of a frame; None is the world.
    /// model: the other robot.
    /// placement: its world in the frame, a homogeneous (4, 4) matrix; None is the identity.
    /// prefix: put before all its names.
    ///
    /// >>> quadruped, arm = condyle.robots.quadruped(), condyle.robots.arm7()
    /// >>> quadruped.append("trunk", arm, prefix="arm_").names[13:16]
    /// ['RH_KFE', 'arm_joint1', 'arm_joint2']
    ///
    /// Raises `ModelError`: two bodies, joints or frames of one name.
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

    /// The same robot with one more joint that follows another one, its position being ratio q + offset, in place of a
    /// coordinate of its own. Its limits are those of the one that it follows.
    ///
    /// follower, leader: the joints' names, or the numbers of their bodies.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> arm.with_mimic("joint4", "joint2", ratio=-2.0).nv
    /// 6
    ///
    /// Raises `ModelError` if they are not of one degree of freedom, or a joint would follow one that follows.
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

    /// The named positions of an SRDF file, its `<group_state>`s: a dictionary of q by name, nq numbers each.
    ///
    /// Joints that a state does not mention stay as in `neutral`; a joint that turns without limits may have its angle. States
    /// of one name, of several groups, are one position. All else in the file is ignored.
    ///
    /// path: a path, as text or `os.PathLike`.
    /// strict: whether joints that the robot has not are errors; SRDFs are often shared by robots with fewer joints.
    ///
    /// Raises `ParseError`, with file, line and element.
    #[pyo3(signature = (path, strict=false))]
    fn reference_configurations<'py>(
        &self,
        py: Python<'py>,
        path: PathBuf,
        strict: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        positions(py, self.inner.reference_configurations(path, strict))
    }

    /// The named positions of an SRDF in a string; see `reference_configurations`.
    ///
    /// >>> joint = '<joint name="joint4" value="-1.2"/>'
    /// >>> srdf = f'<robot name="arm7"><group_state name="bent" group="arm">{joint}</group_state></robot>'
    /// >>> condyle.robots.arm7().reference_configurations_str(srdf)
    /// {'bent': array([ 0. ,  0. ,  0. , -1.2,  0. ,  0. ,  0. ])}
    #[pyo3(signature = (text, strict=false))]
    fn reference_configurations_str<'py>(
        &self,
        py: Python<'py>,
        text: &str,
        strict: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        positions(py, self.inner.reference_configurations_str(text, strict))
    }

    /// The tree of bodies as text: each joint with its kind and where its coordinates stand in q and v, and the body that it
    /// carries; frames: whether the names of other frames stand with the bodies.
    ///
    /// >>> print(condyle.robots.quadruped().lock(range(2, 14), condyle.neutral(condyle.robots.quadruped())).tree())
    /// universe
    /// └─ root_joint: free_flyer, q[0:7], v[0:6] → trunk, 30.000 kg
    #[pyo3(signature = (frames=false))]
    fn tree(&self, frames: bool) -> String {
        tree(&self.inner, frames)
    }

    /// The robot's name and size in one line.
    /// Nothing can be set: a model never changes.
    fn __setattr__(slf: &Bound<'_, Self>, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        if !slf.hasattr(name)? {
            return Err(PyAttributeError::new_err(format!("'condyle.Model' object has no attribute '{name}'")));
        }
        let other = match name {
            "limits" | "gravity" | "armature" | "inertias" => format!("model.with_{name}(...)"),
            "inertial_parameters" => "model.with_inertias(...)".to_owned(),
            _ => "a ModelBuilder".to_owned(),
        };
        Err(PyAttributeError::new_err(format!("{name}: read-only: a model never changes; {other} makes another one")))
    }

    fn __repr__(&self) -> String {
        let m = &self.inner;
        format!("<condyle.Model '{}': {} bodies, nq = {}, nv = {}>", m.name(), m.bodies().len() - 1, m.nq(), m.nv())
    }

    /// A table of the joints.
    fn __str__(&self) -> String {
        self.inner.to_string().trim_end().to_owned()
    }

    /// The model itself: it never changes.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    /// The model itself: it never changes.
    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo;
        slf
    }

    /// The parts of a pickle.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let py = slf.py();
        let bytes = postcard::to_extend(&*slf.get().inner, MAGIC.as_bytes().to_vec())
            .map_err(|e| ModelError::new_err(format!("cannot be pickled: {e}")))?;
        let make = py.import("condyle._condyle")?.getattr("_model_from_bytes")?;
        Ok((make, (PyBytes::new(py, &bytes),)))
    }
}

/// Named positions as Python sees them.
fn positions(
    py: Python<'_>,
    read: Result<Vec<(String, Vec<f64>)>, condyle::ModelError>,
) -> PyResult<Bound<'_, PyDict>> {
    let positions = PyDict::new(py);
    for (name, q) in read.map_err(exception)? {
        positions.set_item(name, q.give(py, None)?)?;
    }
    Ok(positions)
}

/// The beginning of a pickled model: the library's version, since the form may change from one to the next.
const MAGIC: &str = concat!("condyle ", env!("CARGO_PKG_VERSION"), "\n");

/// The model that a pickle holds.
#[pyfunction]
#[pyo3(name = "_model_from_bytes")]
pub(crate) fn model_from_bytes(data: &[u8]) -> PyResult<Model> {
    let Some(model) = data.strip_prefix(MAGIC.as_bytes()) else {
        let version = env!("CARGO_PKG_VERSION");
        return Err(ModelError::new_err(format!("the pickle is not of condyle {version}, or of no model")));
    };
    let model: condyle::Model =
        postcard::from_bytes(model).map_err(|e| ModelError::new_err(format!("the pickle is damaged: {e}")))?;
    Ok(model.into())
}
