//! The class `Model`, a robot in Python: the tree, the names and the frames. The submodules contain the other methods
//! of `Model`.

mod files;
mod numbers;
mod variants;
mod writers;

pub(crate) use writers::model_from_bytes;

use crate::arrays::{class, found_type, read_only};
use crate::cached::{Attribute, Cached};
use crate::exceptions::exception;
use crate::joint::{Joint, kind};
use crate::tree::tree;
use condyle::tree::{FrameKind, Warning};
use pyo3::exceptions::{PyAttributeError, PyIndexError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList, PyString};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

/// A robot: bodies, joints, frames, inertias, limits. A model never changes and may be shared between threads.
///
/// Body 0 is the world. The other bodies are numbered as in Pinocchio: depth first, parents before children, and
/// siblings by the names of their joints. A model is read from a file, built by a `ModelBuilder`, or taken from
/// `condyle.robots`; a model can be pickled.
///
/// >>> arm = condyle.robots.arm7()
/// >>> arm.nq, arm.nv, arm.names[:3]
/// (7, 7, ['universe', 'joint1', 'joint2'])
#[pyclass(frozen, module = "condyle")]
pub(crate) struct Model {
    pub(crate) inner: Arc<condyle::Model>,
    /// Hash that is equal for models with the same bodies and joints, which can share a `Data`.
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

/// Returns the index of a frame that is given by name or by index.
pub(crate) fn frame_index(model: &condyle::Model, frame: &Bound<'_, PyAny>) -> PyResult<usize> {
    if let Ok(name) = frame.cast::<PyString>() {
        return model.frame(name.to_str()?).map_err(exception);
    }
    numbered("frame: expected a name", frame, 0, model.frames().len())
}

/// Returns the index, at least `least`, of a body that is given by its joint's name or by index.
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

/// Returns the items of an argument that is a list; `what` names the items in error messages.
pub(crate) fn members_of<'py>(
    argument: &str,
    what: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let wrong = |found: String| PyTypeError::new_err(format!("{argument}: expected a list of {what}, found {found}"));
    // refuse text and named tuples, such as a single constraint: they are iterable, but are not lists of items
    if given.is_instance_of::<PyString>() || given.is_instance_of::<PyBytes>() || given.hasattr("_fields")? {
        let found = given.repr()?;
        return Err(wrong(format!("{found}; write [{found}]")));
    }
    let members = given.try_iter().map_err(|_| wrong(found_type(given)))?;
    members.collect()
}

/// Reads an index that is at least `least` and below `count`.
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
    /// Returns one number for each joint: the result of `get`, or 0 for the world and for mimic joints.
    fn of_joints(&self, get: impl Fn(&condyle::tree::Body) -> usize) -> Vec<usize> {
        let count = |(i, b): (usize, &condyle::tree::Body)| if i > 0 && b.mimic.is_none() { get(b) } else { 0 };
        self.inner.bodies().iter().enumerate().map(count).collect()
    }

    fn of_bodies<T>(&self, get: impl FnMut(&condyle::tree::Body) -> T) -> Vec<T> {
        self.inner.bodies().iter().map(get).collect()
    }
}

#[pymethods]
impl Model {
    /// The warnings about the robot and its file, as `ModelWarning`: text with the attributes `kind`, `file` and
    /// `line`.
    ///
    /// Warnings report implausible inertias and limits, joints that make the inertia matrix singular, unknown names in
    /// the file, and contents that a model cannot represent.
    #[getter]
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Warnings, || {
            let class = class!(py, "ModelWarning")?;
            let warning = |w: &Warning| {
                let place = w.place().map(|place| (&*place.file, place.line)).unzip();
                class.call1((w.to_string(), w.kind().name(), w.subject(), place.0, place.1))
            };
            self.inner.warnings().iter().map(warning).collect()
        })
    }

    /// The bodies whose joints make M singular; for such a model `aba`, `minv` and `aba_derivatives` raise
    /// `ModelError`.
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

    /// The number of degrees of freedom, which is the length of v, a, τ and tangent vectors.
    #[getter]
    fn nv(&self) -> usize {
        self.inner.nv()
    }

    /// The number of bodies, the world included. This is also the number of rows of f_ext and of the result of
    /// `forward_kinematics`.
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

    /// The parent body of each joint; 0 is the world.
    #[getter]
    fn parents<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Parents, || Ok(self.of_bodies(|b| b.parent)))
    }

    /// The index in q at which each joint's position begins. For a mimic joint this is the index of its leader.
    #[getter]
    fn idx_qs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::IdxQs, || Ok(self.of_bodies(|b| b.idx_q)))
    }

    /// The index in v at which each joint's velocity begins. For a mimic joint this is the index of its leader.
    #[getter]
    fn idx_vs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::IdxVs, || Ok(self.of_bodies(|b| b.idx_v)))
    }

    /// The number of coordinates that each joint has in q: 0 for mimic joints and for the world.
    #[getter]
    fn nqs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Nqs, || Ok(self.of_joints(|b| b.joint.nq())))
    }

    /// The number of coordinates that each joint has in v: 0 for mimic joints and for the world.
    #[getter]
    fn nvs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Nvs, || Ok(self.of_joints(|b| b.joint.nv())))
    }

    /// The rule by which each mimic joint follows another joint, as `Mimic(ratio, offset)`; None for other joints.
    #[getter]
    fn mimics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Mimics, || {
            let class = class!(py, "Mimic")?;
            let mimic = |b: &condyle::tree::Body| b.mimic.map(|m| class.call1((m.ratio, m.offset))).transpose();
            self.inner.bodies().iter().map(mimic).collect()
        })
    }

    /// The frames, as `Frame(name, kind, body, placement)`. For each joint of the URDF, also a fixed joint, there are
    /// two frames: the joint's frame and the frame of its child link.
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        self.cached.list(py, Attribute::Frames, || {
            let class = class!(py, "Frame")?;
            let frame = |f: &condyle::tree::Frame| {
                let kind = match f.kind {
                    FrameKind::Link => "link",
                    FrameKind::Joint => "joint",
                    FrameKind::User => "user",
                    FrameKind::Constraint => "constraint",
                    other => unreachable!("{other:?}: a kind of frame without a word for it"),
                };
                class.call1((f.name.as_str(), kind, f.body, read_only(py, &f.placement, "")?))
            };
            self.inner.frames().iter().map(frame).collect()
        })
    }

    /// Returns the index of the frame with this name. If frames of several kinds have the name, a link's frame is
    /// preferred, then a user's frame, then a joint's frame.
    ///
    /// Raises `ModelError` if the name does not exist; the message suggests the most similar name.
    fn frame(&self, name: &str) -> PyResult<usize> {
        self.inner.frame(name).map_err(exception)
    }

    /// Returns the index of the body that the joint with this name carries.
    ///
    /// Raises `ModelError` if the name does not exist; the message suggests the most similar name.
    fn joint(&self, name: &str) -> PyResult<usize> {
        self.inner.joint(name).map_err(exception)
    }

    /// Returns the tree of bodies as text: each joint with its kind, its indices in q and v, and the body that it
    /// carries. frames: whether to list the other frames of each body, too.
    ///
    /// >>> print(condyle.robots.quadruped().lock(range(2, 14), condyle.neutral(condyle.robots.quadruped())).tree())
    /// universe
    /// └─ root_joint: free_flyer, q[0:7], v[0:6] → trunk, 30.000 kg
    #[pyo3(signature = (frames=false))]
    fn tree(&self, frames: bool) -> String {
        tree(&self.inner, frames)
    }

    /// Raises an `AttributeError`: a model never changes.
    fn __setattr__(slf: &Bound<'_, Self>, name: &str, _value: &Bound<'_, PyAny>) -> PyResult<()> {
        if !slf.hasattr(name)? {
            return Err(PyAttributeError::new_err(format!("'condyle.Model' object has no attribute '{name}'")));
        }
        let other = match name {
            "limits" | "gravity" | "armature" | "damping" | "friction" | "inertias" => {
                format!("model.with_{name}(...)")
            }
            "damping_polynomial" => "model.with_damping(...)".to_owned(),
            "inertial_parameters" => "model.with_inertias(...)".to_owned(),
            _ => "a ModelBuilder".to_owned(),
        };
        Err(PyAttributeError::new_err(format!("{name}: read-only: a model never changes; {other} makes another one")))
    }

    /// Returns the robot's name and size in one line.
    fn __repr__(&self) -> String {
        let m = &self.inner;
        format!("<condyle.Model '{}': {} bodies, nq = {}, nv = {}>", m.name(), m.bodies().len() - 1, m.nq(), m.nv())
    }

    /// Returns a table of the joints.
    fn __str__(&self) -> String {
        self.inner.to_string().trim_end().to_owned()
    }

    /// Returns the model itself, since a model never changes.
    fn __copy__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    /// Returns the model itself, since a model never changes.
    fn __deepcopy__<'py>(slf: Bound<'py, Self>, memo: &Bound<'py, PyAny>) -> Bound<'py, Self> {
        let _ = memo;
        slf
    }
}
