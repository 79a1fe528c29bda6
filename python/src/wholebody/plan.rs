//! Planned motions.

use crate::arrays::{Input, matrix, numbers, output, tensor, vector};
use crate::exceptions::controller_error;
use crate::made_for::MadeFor;
use crate::model::Model;
use condyle::Joint;
use condyle::wholebody as rust;
use numpy::ndarray::Dimension;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::PlanData;

/// A planned motion with N + 1 knots: states at given times, efforts and gains between these times, and the contacts
/// that touch in each interval.
///
/// `WholeBodyController.track` converts a plan to references. Between knots, q is interpolated with constant velocity
/// (as by `interpolate`), v linearly, and a = Δv / Δt. Two knots may have the same time: then the velocity jumps at
/// this time (an impact).
///
/// model: the robot.
/// times: N + 1 times in ascending order (s); two consecutive times may be equal.
/// states: (q, v) of the knots, (N + 1, nq + nv).
/// touches: for each interval between two knots, which of the controller's contacts touch, (N, contacts).
/// controls: for each interval between two knots, the efforts of the actuated coordinates (all coordinates except a
///     free-flyer's), (N, nu); None for no controls.
/// gains: K of u = ū + K (x ⊖ x̄), (N, nu, 2 nv); None for no gains.
/// fade: the time (s) during which a contact is loaded after it begins to touch, and unloaded before it stops touching.
///
/// Raises `ControllerError` for numbers that are not finite, for times that decrease, and for states whose quaternions
/// or pairs (cos, sin) do not have length 1.
///
/// >>> from condyle.wholebody import Plan
/// >>> robot = condyle.robots.quadruped()
/// >>> x = np.r_[condyle.neutral(robot), np.zeros(18)]
/// >>> plan = Plan(robot, [0.0, 0.5], [x, x], touches=np.ones((1, 4)))  # half a second on all feet
/// >>> plan.span, plan.activation(0, 0.2)
/// ((0.0, 0.5), 1.0)
#[pyclass(frozen, module = "condyle.wholebody")]
pub(crate) struct Plan {
    pub(super) inner: rust::Plan,
    pub(super) made_for: MadeFor,
    pub(super) contacts: usize,
    /// The number of controls in each interval.
    nu: usize,
    model: Py<Model>,
}

/// Returns the number of columns of a list of lists with `rows` rows.
fn lengths(argument: &str, given: &Bound<'_, PyAny>, rows: usize) -> PyResult<usize> {
    let shape: Vec<usize> = given.py().import("numpy")?.call_method1("shape", (given,))?.extract()?;
    match shape[..] {
        [first, second] if first == rows => Ok(second),
        _ => Err(PyValueError::new_err(format!("{argument}: expected shape ({rows}, contacts), found {shape:?}"))),
    }
}

impl Plan {
    /// Returns a plan of a robot for this number of contacts.
    pub(crate) fn from_rust(model: &Bound<'_, Model>, inner: rust::Plan, contacts: usize) -> Self {
        let nu = inner.controls();
        Self { inner, made_for: MadeFor::with_geometry(model.get()), contacts, nu, model: model.clone().unbind() }
    }
}

#[pymethods]
impl Plan {
    #[new]
    #[pyo3(signature = (model, times, states, touches, controls=None, gains=None, fade=0.0))]
    fn new(
        model: &Bound<'_, Model>,
        times: &Bound<'_, PyAny>,
        states: &Bound<'_, PyAny>,
        touches: &Bound<'_, PyAny>,
        controls: Option<&Bound<'_, PyAny>>,
        gains: Option<&Bound<'_, PyAny>>,
        fade: f64,
    ) -> PyResult<Self> {
        fn flat<D: Dimension>(numbers: Option<Input<'_, D>>) -> Vec<f64> {
            numbers.map_or_else(Vec::new, |numbers| numbers.to_vec())
        }
        let robot = &model.get().inner;
        let (nx, nv) = (robot.nq() + robot.nv(), robot.nv());
        let nu = nv - 6 * robot.bodies()[1..].iter().filter(|body| body.joint == Joint::FreeFlyer).count();
        let times = numbers("times", times)?;
        let steps = times.len().saturating_sub(1);
        let contacts = lengths("touches", touches, steps)?;
        let data = PlanData {
            states: matrix("states", states, [times.len(), nx])?.to_vec(),
            controls: flat(controls.map(|u| matrix("controls", u, [steps, nu])).transpose()?),
            gains: flat(gains.map(|K| tensor("gains", K, [steps, nu, 2 * nv])).transpose()?),
            touches: matrix("touches", touches, [steps, contacts])?.iter().map(|&x| x != 0.0).collect(),
            fade,
            times,
        };
        let inner = rust::Plan::new(robot, contacts, data).map_err(controller_error)?;
        Ok(Self::from_rust(model, inner, contacts))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.model)
    }

    /// The times of the first and the last knot (s).
    #[getter]
    fn span(&self) -> (f64, f64) {
        let [begin, end] = self.inner.span();
        (begin, end)
    }

    /// Returns the activation of a contact at a time: 0 while the contact does not touch, a ramp after the contact
    /// begins and before it ends, else 1. contact: the index of the contact.
    fn activation(&self, contact: usize, t: f64) -> PyResult<f64> {
        if contact >= self.contacts {
            return Err(PyIndexError::new_err(format!(
                "contact: expected less than {}, found {contact}",
                self.contacts
            )));
        }
        Ok(self.inner.activation(contact, t))
    }

    /// Computes the efforts τ = ū + K (x ⊖ x̄) of the plan's controls and gains at a state, nv numbers. The efforts of
    /// a free-flyer are 0.
    ///
    /// t: the time (s); q: position, nq numbers; v: velocity, nv numbers.
    ///
    /// Raises `ValueError` if the plan has no controls, and `ModelError` for a state that is not finite or whose
    /// quaternions or pairs (cos, sin) do not have length 1.
    #[pyo3(signature = (t, q, v, out=None))]
    fn feedback<'py>(
        &self,
        py: Python<'py>,
        t: f64,
        q: &Bound<'_, PyAny>,
        v: &Bound<'_, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let robot = &self.model.get().inner;
        let (q, v) = (vector("q", q, robot.nq())?, vector("v", v, robot.nv())?);
        if self.inner.data().controls.is_empty() && self.nu > 0 {
            return Err(PyValueError::new_err("controls: the plan has none"));
        }
        let mut efforts = vec![0.0; robot.nv()];
        self.inner.feedback(t, &q, &v, &mut efforts).map_err(controller_error)?;
        output(py, out, &[robot.nv()], |tau| tau.copy_from_slice(&efforts))
    }

    /// Returns the class and the arguments from which `pickle` makes an equal plan: the arrays from which the plan was
    /// made.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let (py, this) = (slf.py(), slf.get());
        let PlanData { times, states, controls, gains, touches, fade } = this.inner.data();
        let (robot, steps) = (&this.model.get().inner, times.len() - 1);
        let give = |numbers: &[f64], shape: &[usize]| output(py, None, shape, |out| out.copy_from_slice(numbers));
        let some = |numbers: &[f64], shape: &[usize]| (!numbers.is_empty()).then(|| give(numbers, shape)).transpose();
        let touches: Vec<f64> = touches.iter().map(|&touches| f64::from(u8::from(touches))).collect();
        let arguments = (
            this.model.clone_ref(py),
            give(times, &[times.len()])?,
            give(states, &[times.len(), robot.nq() + robot.nv()])?,
            give(&touches, &[steps, this.contacts])?,
            some(controls, &[steps, this.nu])?,
            some(gains, &[steps, this.nu, 2 * robot.nv()])?,
            fade,
        );
        Ok((slf.get_type().into_any(), arguments.into_pyobject(py)?.into_any()))
    }

    fn __repr__(&self) -> String {
        let ([begin, end], knots) = (self.inner.span(), self.inner.data().times.len());
        format!("<condyle.wholebody.Plan of {knots} knots and {} contacts, {begin} s to {end} s>", self.contacts)
    }
}
