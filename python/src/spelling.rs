//! The most frequently called functions of `condyle.pinocchio`. As in Pinocchio, these functions use results that an
//! earlier call stored in `data`.
//!
//! The functions are written in Rust, because for a small robot a Python wrapper would take longer than the
//! computation. The classes of `condyle.pinocchio` derive from the classes of this file.

use crate::algorithms;
use crate::arrays::{Computed, Give, Number, at_once, class};
use crate::centroidal::{centroidal_momentum, com, com_acceleration, com_jacobian, com_velocity};
use crate::configuration;
use crate::data::{Data, Holds, take};
use crate::exceptions::wrong_word;
use crate::kinematics::{forward_kinematics, frame_jacobian};
use crate::model::{Model, body_index};
use condyle::ReferenceFrame;
use numpy::Ix1;
use pyo3::exceptions::{PyAttributeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use pyo3::{ffi, intern};

/// A `condyle.Model` with Pinocchio's interface.
#[pyclass(name = "_SpelledModel", module = "condyle.pinocchio", frozen, subclass)]
pub(crate) struct SpelledModel {
    /// The wrapped `condyle.Model`.
    #[pyo3(get)]
    ours: Py<Model>,
}

#[pymethods]
impl SpelledModel {
    #[new]
    fn new(model: Py<Model>) -> Self {
        Self { ours: model }
    }
}

/// A `condyle.Data` with Pinocchio's interface, and the stored state for functions of a joint or a frame.
#[pyclass(name = "_SpelledData", module = "condyle.pinocchio", subclass)]
pub(crate) struct SpelledData {
    ours: Py<Data>,
    q: Vec<f64>,
    v: Vec<f64>,
    a: Vec<f64>,
    /// Number of the vectors q, v and a that were passed to the last call of `forwardKinematics`.
    given: usize,
    poses: Option<Py<PyAny>>,
    frame_poses: Option<Py<PyAny>>,
    com: Option<Py<PyAny>>,
    hg: Option<Py<PyAny>>,
}

#[pymethods]
impl SpelledData {
    #[new]
    fn new(model: &Bound<'_, SpelledModel>) -> PyResult<Self> {
        let (py, model) = (model.py(), &model.get().ours);
        let [nq, nv] = [model.get().inner.nq(), model.get().inner.nv()];
        let ours = Py::new(py, Data::new(model.bind(py), 1)?)?;
        let zero = |n| vec![0.0; n];
        let (q, v, a) = (zero(nq), zero(nv), zero(nv));
        Ok(Self { ours, q, v, a, given: 0, poses: None, frame_poses: None, com: None, hg: None })
    }

    /// The wrapped `condyle.Data`.
    #[getter]
    fn _ours<'py>(&self, py: Python<'py>) -> Bound<'py, Data> {
        self.ours.bind(py).clone()
    }

    /// q, v and a of the last `forwardKinematics`. Vectors that were not given are zeros.
    #[getter]
    fn _state<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        Ok((self.q.give(py, None)?, self.v.give(py, None)?, self.a.give(py, None)?))
    }

    /// The number of the vectors q, v and a that were passed to the last call of `forwardKinematics`.
    #[getter]
    fn _given(&self) -> usize {
        self.given
    }

    /// The poses of the bodies at the last `forwardKinematics`, (njoints, 4, 4).
    #[getter]
    fn _poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        made(py, &self.poses)
    }

    /// The poses of the bodies from which frames are computed, from the last `updateFramePlacements`, (njoints, 4, 4).
    #[getter]
    fn _frame_poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        made(py, &self.frame_poses)
    }

    /// The stored centre of mass, as a list with one array.
    #[getter]
    fn com<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 1]> {
        Ok([made(py, &self.com)?])
    }

    /// The stored centroidal momentum.
    #[getter]
    fn hg<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        made(py, &self.hg)
    }

    /// Stores a centre of mass and a centroidal momentum.
    fn _leave(&mut self, com: Py<PyAny>, hg: Py<PyAny>) {
        (self.com, self.hg) = (Some(com), Some(hg));
    }
}

/// Returns a stored result; raises an `AttributeError` if the result was not computed yet.
fn made<'py>(py: Python<'py>, what: &Option<Py<PyAny>>) -> PyResult<Bound<'py, PyAny>> {
    what.as_ref().map(|what| what.bind(py).clone()).ok_or_else(|| PyAttributeError::new_err(()))
}

/// Copies the numbers of an argument, which is a vector or a matrix with one column.
fn copy(name: &str, given: &Bound<'_, PyAny>, to: &mut [f64]) -> PyResult<()> {
    if let Some(numbers) = at_once::<Ix1>(given, &[to.len()]) {
        to.copy_from_slice(&numbers);
        return Ok(());
    }
    let flat = given.py().import("numpy")?.call_method1("ravel", (given,))?;
    to.copy_from_slice(&f64::read::<Ix1>(name, &flat, &[to.len()])?);
    Ok(())
}

/// Returns the library's reference frame for a `ReferenceFrame` of Pinocchio.
fn reference(frame: Option<&Bound<'_, PyAny>>) -> PyResult<ReferenceFrame> {
    use ReferenceFrame::{Local, LocalWorldAligned, World};
    static NAMED: PyOnceLock<[(Py<PyAny>, ReferenceFrame); 3]> = PyOnceLock::new();
    let Some(frame) = frame else { return Ok(Local) };
    let py = frame.py();
    let named = NAMED.get_or_try_init(py, || {
        let class = py.import("condyle._spelling")?.getattr("ReferenceFrame")?;
        let one = |name, reference| PyResult::Ok((class.getattr(name)?.unbind(), reference));
        PyResult::Ok([one("LOCAL", Local)?, one("WORLD", World)?, one("LOCAL_WORLD_ALIGNED", LocalWorldAligned)?])
    })?;
    match named.iter().find(|(name, _)| frame.is(name)) {
        Some((_, reference)) => Ok(*reference),
        None => Err(wrong_word("frame", "LOCAL, WORLD or LOCAL_WORLD_ALIGNED", &frame.repr()?.to_string())),
    }
}

/// Returns the library's index of a frame; Pinocchio counts the world as frame 0.
fn frame_number(model: &condyle::Model, frame_id: isize) -> PyResult<usize> {
    let frames = model.frames().len();
    usize::try_from(frame_id - 1).ok().filter(|frame| *frame < frames).ok_or_else(|| {
        PyValueError::new_err(format!("frame_id: expected 1 to {frames}, found {frame_id}; universe does not move"))
    })
}

/// Returns the index of a joint's body.
fn joint_number(model: &condyle::Model, joint: &Bound<'_, PyAny>) -> PyResult<usize> {
    body_index("joint: expected a joint's name", model, joint, 0)
}

/// Creates a `Motion` or a `Force` of six numbers, without running Python code.
#[allow(unsafe_code)]
fn spatial<'py>(class: &Bound<'py, PyType>, numbers: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let (py, none) = (class.py(), std::ptr::null_mut());
    // SAFETY: the class is defined in Python and derives from `object`; this function is the `__new__` of `object`.
    let six = unsafe { Bound::from_owned_ptr_or_err(py, ffi::PyType_GenericNew(class.as_type_ptr(), none, none)) }?;
    six.setattr(intern!(py, "vector"), numbers)?;
    Ok(six)
}

/// Computes the poses data.oMi; with v and a also the velocities data.v and the accelerations data.a, in the bodies'
/// frames.
#[pyfunction]
#[pyo3(signature = (model, data, q, v=None, a=None))]
pub(crate) fn forwardKinematics(
    model: &Bound<'_, SpelledModel>,
    data: &Bound<'_, SpelledData>,
    q: &Bound<'_, PyAny>,
    v: Option<&Bound<'_, PyAny>>,
    a: Option<&Bound<'_, PyAny>>,
) -> PyResult<()> {
    let (py, mut data) = (model.py(), data.try_borrow_mut()?);
    let poses = forward_kinematics(model.get().ours.bind(py), data.ours.bind(py), q, None)?;
    (data.given, data.poses) = (0, None); // the state is invalid until all results are stored
    let SpelledData { q: kept_q, v: kept_v, a: kept_a, .. } = &mut *data;
    copy("q", q, kept_q)?;
    for (name, given, kept) in [("v", v, kept_v), ("a", a, kept_a)] {
        match given {
            Some(given) => copy(name, given, kept)?,
            None => kept.fill(0.0),
        }
    }
    data.given = if a.is_some() { 3 } else { 1 + usize::from(v.is_some()) };
    data.poses = Some(poses.unbind());
    Ok(())
}

/// Computes the frames' poses data.oMf from the bodies' poses of the last forwardKinematics.
#[pyfunction]
pub(crate) fn updateFramePlacements(model: &Bound<'_, SpelledModel>, data: &Bound<'_, SpelledData>) -> PyResult<()> {
    let mut data = data.try_borrow_mut()?;
    data.frame_poses = data.poses.as_ref().map(|poses| poses.clone_ref(model.py()));
    Ok(())
}

/// Computes the bodies' poses data.oMi and the frames' poses data.oMf.
#[pyfunction]
pub(crate) fn framesForwardKinematics(
    model: &Bound<'_, SpelledModel>,
    data: &Bound<'_, SpelledData>,
    q: &Bound<'_, PyAny>,
) -> PyResult<()> {
    forwardKinematics(model, data, q, None, None)?;
    updateFramePlacements(model, data)
}

/// Returns the data; raises an error if no forwardKinematics has stored a state.
fn kept<'py>(data: &Bound<'py, SpelledData>) -> PyResult<PyRef<'py, SpelledData>> {
    let data = data.try_borrow()?;
    match data.given {
        0 => Err(PyValueError::new_err("data: expected a state, found none: call forwardKinematics before")),
        _ => Ok(data),
    }
}

/// Defines functions that return a motion of a joint's body or of a frame at the last forwardKinematics.
macro_rules! motions {
    ($(
        $(#[$doc:meta])*
        $name:ident($of:ident: $Of:ty, $number:ident): $method:ident of $pass:ident($($kept:ident),*);
    )*) => {$(
        $(#[$doc])*
        #[pyfunction]
        #[pyo3(signature = (model, data, $of, frame=None))]
        pub(crate) fn $name<'py>(
            model: &Bound<'py, SpelledModel>,
            data: &Bound<'py, SpelledData>,
            $of: $Of,
            frame: Option<&Bound<'py, PyAny>>,
        ) -> PyResult<Bound<'py, PyAny>> {
            let (py, data, robot) = (model.py(), kept(data)?, model.get().ours.get());
            let (number, reference) = ($number(&robot.inner, $of)?, reference(frame)?);
            let mut scratch = take(robot, data.ours.bind(py))?;
            let scratch = Holds::<f64>::held(&mut *scratch, &robot.inner)?;
            let motion = condyle::dynamics::$pass(&robot.inner, scratch, $(&data.$kept),*).$method(number, reference);
            spatial(class!(py, "condyle._spelling", "Motion")?, &motion.give(py, None)?)
        }
    )*};
}
motions! {
    /// Returns the velocity of a joint's body at the last forwardKinematics.
    getVelocity(joint: &Bound<'py, PyAny>, joint_number): body_velocity of forward_velocities(q, v);
    /// Returns the spatial acceleration of a joint's body at the last forwardKinematics.
    getAcceleration(joint: &Bound<'py, PyAny>, joint_number): body_acceleration of forward_accelerations(q, v, a);
    /// Returns r̈ and ω̇ of a joint's body at the last forwardKinematics.
    getClassicalAcceleration(joint: &Bound<'py, PyAny>, joint_number):
        body_classical_acceleration of forward_accelerations(q, v, a);
    /// Returns the velocity of a frame at the last forwardKinematics.
    getFrameVelocity(frame_id: isize, frame_number): frame_velocity of forward_velocities(q, v);
    /// Returns the spatial acceleration of a frame at the last forwardKinematics.
    getFrameAcceleration(frame_id: isize, frame_number): frame_acceleration of forward_accelerations(q, v, a);
    /// Returns r̈ and ω̇ of a frame at the last forwardKinematics.
    getFrameClassicalAcceleration(frame_id: isize, frame_number):
        frame_classical_acceleration of forward_accelerations(q, v, a);
}

/// Type of `condyle::dynamics::body_jacobian_strided` and its variant for frames: its arguments are the model, q, the
/// body or frame, the reference frame, J, and the strides of J.
type FillJacobian = fn(&condyle::Model, &[f64], usize, ReferenceFrame, &mut [f64], [usize; 2]);

/// Returns the Jacobian of a joint's body or of a frame at the last computeJointJacobians.
fn kept_jacobian<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    number: impl FnOnce(&condyle::Model) -> PyResult<usize>,
    frame: &Bound<'py, PyAny>,
    fill: FillJacobian,
) -> PyResult<Bound<'py, PyAny>> {
    let (data, robot) = (kept(data)?, model.get().ours.get());
    take(robot, data.ours.bind(model.py()))?; // raises an error if the data belongs to another robot
    let robot = &robot.inner;
    let (number, reference) = (number(robot)?, reference(Some(frame))?);
    let fill = |J: &mut [f64]| fill(robot, &data.q, number, reference, J, [robot.nv(), 1]);
    Computed::new([6, robot.nv()], fill).give(model.py(), None)
}

/// Returns the Jacobian of a joint's body at the last computeJointJacobians, (6, nv).
#[pyfunction]
pub(crate) fn getJointJacobian<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    joint: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    kept_jacobian(model, data, |robot| joint_number(robot, joint), frame, condyle::dynamics::body_jacobian_strided)
}

/// Returns the Jacobian of a frame at the last computeJointJacobians, (6, nv).
#[pyfunction]
pub(crate) fn getFrameJacobian<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    frame_id: isize,
    frame: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    kept_jacobian(model, data, |robot| frame_number(robot, frame_id), frame, condyle::dynamics::frame_jacobian_strided)
}

/// Computes the Jacobian of a frame, (6, nv).
#[pyfunction]
#[pyo3(signature = (model, data, q, frame_id, frame=None))]
pub(crate) fn computeFrameJacobian<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    q: &Bound<'py, PyAny>,
    frame_id: isize,
    frame: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, ours) = (model.py(), &model.get().ours);
    let number = frame_number(&ours.get().inner, frame_id)?.into_pyobject(py)?.into_any();
    let word = match reference(frame)? {
        ReferenceFrame::Local => "local",
        ReferenceFrame::World => "world",
        ReferenceFrame::LocalWorldAligned => "local_world_aligned",
    };
    frame_jacobian(ours.bind(py), data.try_borrow()?.ours.bind(py), q, &number, word, None)
}

/// Computes the centre of mass, also stored as data.com[0]. With v, also computes data.vcom[0]; with v and a, also
/// data.acom[0].
#[pyfunction]
#[pyo3(signature = (model, data, q, v=None, a=None))]
pub(crate) fn centerOfMass<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    q: &Bound<'py, PyAny>,
    v: Option<&Bound<'py, PyAny>>,
    a: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, ours) = (model.py(), model.get().ours.bind(model.py()));
    let mut kept = data.try_borrow_mut()?;
    let center = com(ours, kept.ours.bind(py), q, None)?;
    kept.com = Some(center.clone().unbind());
    if let Some(v) = v {
        data.setattr("vcom", [com_velocity(ours, kept.ours.bind(py), q, v, None)?])?;
        if let Some(a) = a {
            data.setattr("acom", [com_acceleration(ours, kept.ours.bind(py), q, v, a, None)?])?;
        }
    }
    Ok(center)
}

/// Computes the centroidal momentum, also stored as data.hg.
#[pyfunction]
pub(crate) fn computeCentroidalMomentum<'py>(
    model: &Bound<'py, SpelledModel>,
    data: &Bound<'py, SpelledData>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, robot, mut data) = (model.py(), model.get().ours.get(), data.try_borrow_mut()?);
    let at_once = |x, length| at_once::<Ix1>(x, &[length]);
    let numbers = match (at_once(q, robot.inner.nq()), at_once(v, robot.inner.nv())) {
        (Some(q), Some(v)) => {
            let mut scratch = take(robot, data.ours.bind(py))?;
            let scratch = Holds::<f64>::held(&mut *scratch, &robot.inner)?;
            condyle::forward_velocities(&robot.inner, scratch, &q, &v).centroidal_momentum().give(py, None)?
        }
        _ => centroidal_momentum(model.get().ours.bind(py), data.ours.bind(py), q, v, None)?,
    };
    let hg = spatial(class!(py, "condyle._spelling", "Force")?, &numbers)?;
    data.hg = Some(hg.clone().unbind());
    Ok(hg)
}

/// Defines functions whose result is also stored in `data`, under a name.
macro_rules! left {
    ($($(#[$doc:meta])* $name:literal $function:ident($($arg:ident),*) = $call:path => $left:literal;)*) => {$(
        $(#[$doc])*
        #[pyfunction(name = $name)]
        pub(crate) fn $function<'py>(
            model: &Bound<'py, SpelledModel>,
            data: &Bound<'py, SpelledData>,
            $($arg: &Bound<'py, PyAny>),*
        ) -> PyResult<Bound<'py, PyAny>> {
            let py = model.py();
            let result = $call(model.get().ours.bind(py), data.try_borrow()?.ours.bind(py), $($arg,)* None)?;
            data.setattr(intern!(py, $left), &result)?;
            Ok(result)
        }
    )*};
}
left! {
    /// Computes the inertia matrix M with both triangles, also stored as data.M.
    "_spelled_crba" crba(q) = algorithms::crba => "M";
    /// Computes the inverse M⁻¹ of the inertia matrix, also stored as data.Minv.
    "computeMinverse" computeMinverse(q) = algorithms::minv => "Minv";
    /// Computes the nonlinear effects C v + g, also stored as data.nle.
    "nonLinearEffects" nonLinearEffects(q, v) = algorithms::nonlinear_effects => "nle";
    /// Computes the gravity efforts g, also stored as data.g.
    "computeGeneralizedGravity" computeGeneralizedGravity(q) = algorithms::gravity => "g";
    /// Computes the Coriolis matrix C, also stored as data.C. C v + g = h, with gravity efforts g and nonlinear effects
    /// h; Ṁ − 2 C is skew-symmetric, with the inertia matrix M.
    "computeCoriolisMatrix" computeCoriolisMatrix(q, v) = algorithms::coriolis_matrix => "C";
    /// Computes the Jacobian of the centre of mass, (3, nv), also stored as data.Jcom.
    "jacobianCenterOfMass" jacobianCenterOfMass(q) = com_jacobian => "Jcom";
}

/// Computes the position q ⊕ v.
#[pyfunction(name = "_spelled_integrate")]
pub(crate) fn integrate<'py>(
    model: &Bound<'py, SpelledModel>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    configuration::integrate(model.get().ours.bind(model.py()), q, v, None)
}

/// Computes the tangent vector q₁ ⊖ q₀.
#[pyfunction(name = "_spelled_difference")]
pub(crate) fn difference<'py>(
    model: &Bound<'py, SpelledModel>,
    q0: &Bound<'py, PyAny>,
    q1: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    configuration::difference(model.get().ours.bind(model.py()), q0, q1, None)
}
