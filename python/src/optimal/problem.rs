//! Problems, made of actions of any kind.

mod knot_models;
mod parameters;

use super::actions::terms;
use super::costs::Cost;
use super::evaluation::{by_knot, controls, evaluate, gaps};
use super::models::{boxed, residuals};
use super::own::{Fault, faults};
use super::recorder::{Recorder, kept};
use super::references;
use super::robot_action::{Described, WrittenAt, change, knot_of};
use super::sweep::give;
use crate::arrays::{in_place, matrix, numbers, output, vector};
use crate::constrained::{aim, gains};
use crate::exceptions::{ProblemError, problem_error};
use crate::model::Model;
use crate::signals::{self, Interruptions, Signals};
use condyle::optimal as rust;
use numpy::Ix1;
use pyo3::exceptions::{PyKeyError, PyRuntimeError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyList;
use rust::Observer;
use rust::record::{Call, ContactChange};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

/// Locks a value; returns an error if another call holds the lock.
pub(crate) fn lock<'a, T>(name: &str, value: &'a Mutex<T>) -> PyResult<MutexGuard<'a, T>> {
    value.try_lock().map_err(|_| PyRuntimeError::new_err(format!("{name}: in use by another call")))
}

/// An optimal control problem: a sequence of knots that begins at the state x0, and a terminal knot. Each knot has one
/// of the models.
///
/// x0: the initial state, nx numbers.
/// models: a list of `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`, `FreeInverseDynamics`,
///     `ContactInverseDynamics`, `Action`, `DifferentialAction`, `ConstrainedAction`, `ControlRate`, `Lqr`,
///     `Unicycle`.
/// knot_models: for each knot, the index of the knot's model; None if knot t has model t. Consecutive knots are
///     computed as a group in two cases: they have the same model, or their models belong to one robot and differ only
///     in costs and limits.
/// terminal: the model of the terminal knot, without controls.
///
/// Raises `ProblemError` if the models do not fit together, or if x0 is not finite or contains a rotation whose length
/// is not 1 (up to 1e-3). Also raises `ProblemError` for more than 2²⁰ knots, and for more than 4096 numbers in a state
/// or in the controls of a knot. The matrices [A B], the derivatives of the next states, may have at most 2²⁸ numbers
/// in all knots together.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Problem {
    pub(super) inner: Mutex<rust::Problem>,
    /// Descriptions of the models of robots, the terminal model last; `None` for other models.
    pub(super) described: Mutex<Vec<Option<Arc<Described>>>>,
    /// The models that do not belong to a robot, as the objects that the user passed, the terminal model last. The
    /// problem's copies of these models call the functions of the objects.
    pub(super) objects: Mutex<Vec<Option<Py<PyAny>>>>,
    /// Residuals of robots that are written in Python, as the user passed them.
    written: Mutex<Vec<Py<PyAny>>>,
    /// The first error of an action that is written in Python.
    fault: Fault,
    /// Variables for the first error of each residual that is written in Python.
    faults: Mutex<Vec<Fault>>,
    /// Number of times that the horizon was shifted.
    moved: AtomicUsize,
    /// States of a robot's problem, which need no lock. `None` for other problems, whose Python functions only
    /// `objects` reports to the garbage collector.
    pub(super) space: Option<rust::StateSpace>,
    /// Whether costs were changed in place, so that the descriptions of the models contain old numbers.
    is_outdated: AtomicBool,
    /// Record of all calls that change this problem, if there is one.
    pub(super) recorder: Recorder,
}

#[pymethods]
impl Problem {
    #[new]
    fn new(
        x0: &Bound<'_, PyAny>,
        models: Vec<Bound<'_, PyAny>>,
        knot_models: Option<Vec<usize>>,
        terminal: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let knot_models = knot_models.unwrap_or_else(|| (0..models.len()).collect());
        let fault = Fault::default();
        let ends = models.iter().map(|model| (model, false)).chain([(terminal, true)]);
        let all = ends.map(|(model, end)| boxed(model, end, &fault)).collect::<PyResult<Vec<_>>>()?;
        let each = models.iter().chain([terminal]);
        let objects = each.clone().zip(&all).map(|(model, boxed)| match boxed.described {
            None => Some(model.clone().unbind()),
            Some(_) => None,
        });
        let (objects, written) = (objects.collect(), each.flat_map(residuals).collect());
        Self::make(numbers("x0", x0)?, all, knot_models, (objects, written), fault)
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        // no Python code runs while the objects are locked
        if let Ok(objects) = self.objects.try_lock() {
            objects.iter().try_for_each(|object| visit.call(object))?;
        }
        let written = self.written.try_lock();
        written.map_or(Ok(()), |written| written.iter().try_for_each(|action| visit.call(action)))
    }

    /// Reads a robot's problem from the text that `to_json` returned.
    ///
    /// Raises `ProblemError` if the text is not a problem, if models, states or costs do not fit together, or if a size
    /// is beyond the limits of `Problem`.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        Self::from_data(
            serde_json::from_str(text).map_err(|error| ProblemError::new_err(format!("no problem: {error}")))?,
        )
    }

    /// Returns the problem and its robot as JSON, with the current initial state, weights and models of its knots. An
    /// infinite bound is written as null.
    ///
    /// Raises `ProblemError` if an action is an `Lqr`, an `Action`, a `ConstrainedAction` or a `ControlRate` around one
    /// of these, or if knots belong to different robots.
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&self.data()?).map_err(|error| ProblemError::new_err(error.to_string()))
    }

    /// Returns the function and the arguments from which `pickle` makes an equal problem. Knots of robots are stored as
    /// JSON, other knots as the objects that the user passed.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        this.describe()?;
        let described = lock("problem", &this.described)?;
        let problem = lock("problem", &this.inner)?;
        let (knot_models, added) = Self::separate_durations(&problem, &described);
        let last = described.len() - 1;
        let of_added = added.iter().map(|(k, dt)| {
            let of = described[*k].as_ref().expect("only robots have other durations");
            (None, Some(Arc::new(of.with_duration(*dt))))
        });
        let objects = lock("problem", &this.objects)?;
        let pairs = objects.iter().map(Option::as_ref).zip(described.iter().cloned());
        let mut all: Vec<_> = pairs.collect();
        all.splice(last..last, of_added);
        let mut robots: Vec<(&Arc<condyle::Model>, Bound<'py, Model>)> = Vec::new();
        let mut parts = Vec::new();
        for (object, described) in &all {
            let Some(described) = described.as_deref() else {
                parts.push(object.map_or_else(|| py.None(), |object| object.clone_ref(py)));
                continue;
            };
            let robot = &described.robot;
            if !robots.iter().any(|(known, _)| Arc::ptr_eq(known, robot)) {
                robots.push((robot, Bound::new(py, Model::from((**robot).clone()))?));
            }
            let model = robots.iter().find(|(known, _)| Arc::ptr_eq(known, robot)).map(|(_, model)| model.clone());
            let (text, written) = described.knot_parts(py)?;
            parts.push((model, text, written).into_pyobject(py)?.into_any().unbind());
        }
        let arguments = (problem.x0().to_vec(), parts, knot_models);
        Ok((slf.get_type().getattr("_from_parts")?, arguments).into_pyobject(py)?.into_any())
    }

    #[staticmethod]
    fn _from_parts(x0: Vec<f64>, parts: Vec<Bound<'_, PyAny>>, knot_models: Vec<usize>) -> PyResult<Self> {
        let (fault, last) = (Fault::default(), parts.len().saturating_sub(1));
        let (mut all, mut objects, mut kept) = (Vec::new(), Vec::new(), Vec::new());
        for (k, part) in parts.iter().enumerate() {
            if let Ok((model, text, written)) = part.extract::<(Bound<'_, Model>, String, WrittenAt<'_>)>() {
                let robot = model.get().inner.clone();
                let knot = knot_of(&robot, &text, &written)?;
                kept.extend(written.into_iter().map(|(_, residual)| residual.into_any().unbind()));
                all.push(Described { robot, knot }.boxed()?);
                objects.push(None);
            } else {
                all.push(boxed(part, k == last, &fault)?);
                objects.push(Some(part.clone().unbind()));
            }
        }
        if all.is_empty() {
            return Err(ProblemError::new_err("parts: expected at least a terminal model"));
        }
        Self::make(x0, all, knot_models, (objects, kept), fault)
    }

    /// The number N of knots before the terminal knot.
    #[getter]
    fn horizon(&self) -> PyResult<usize> {
        Ok(lock("problem", &self.inner)?.horizon())
    }

    /// The number of entries of a state.
    #[getter]
    fn nx(&self) -> PyResult<usize> {
        Ok(lock("problem", &self.inner)?.nx())
    }

    /// The number of entries of a change of a state.
    #[getter]
    fn ndx(&self) -> PyResult<usize> {
        Ok(lock("problem", &self.inner)?.ndx())
    }

    /// The initial state, nx numbers; `set_x0` sets it.
    #[getter]
    fn x0<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let inner = lock("problem", &self.inner)?;
        output(py, None, &[inner.nx()], |out| out.copy_from_slice(inner.x0()))
    }

    /// Sets the initial state, nx numbers, as an MPC does before each solve.
    ///
    /// Raises `ProblemError` for a number that is not finite, and for a rotation whose length is not 1 (up to 1e-3).
    fn set_x0(&self, x0: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let x0 = in_place::<Ix1>("x0", x0, &[problem.nx()])?;
        self.recorder.note(|| Call::SetX0 { x0: kept(&x0) });
        problem.set_x0(&x0).map_err(problem_error)
    }

    /// Changes the weight of all cost terms with this name, in all knots including the terminal knot. Call this method
    /// between solves.
    ///
    /// weight: the weight of all knots, or N + 1 weights, one for each knot. Weights of knots without the term are
    ///     ignored. With one weight for each knot, each knot gets separate costs, as in `set_references`.
    ///
    /// Raises `KeyError` if no term has this name, and `ProblemError` if the weight is negative or not finite.
    fn set_weight(&self, name: &str, weight: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let Ok(weight) = weight.extract::<f64>() else {
            self.is_outdated.store(true, Ordering::Relaxed);
            return references::set_weights(&self.recorder, &mut problem, name, weight);
        };
        self.recorder.note(|| Call::SetWeight { name: name.to_owned(), weight });
        let mut described = lock("problem", &self.described)?;
        let mut found = false;
        for k in (0..described.len() - 1).map(Some).chain([None]) {
            let set = change!(&mut problem, k, |knot| knot.set_weight(name, weight)).unwrap_or(Ok(false));
            found |= set.map_err(problem_error)?;
        }
        described.iter_mut().flatten().for_each(|described| Arc::make_mut(described).set_weight(name, weight));
        if found { Ok(()) } else { Err(PyKeyError::new_err(format!("no knot has a cost '{name}'"))) }
    }

    /// Returns the targets of the cost with this name at all knots: a copy of shape (N + 1, n) for a target of n
    /// numbers, (N + 1, 3, 3) for rotations, and (N + 1, 4, 4) for placements. Rows of knots without this cost are NaN.
    ///
    /// Raises `KeyError` if no knot has this cost, or if its residual has no target.
    fn references<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        references::get(py, &mut *lock("problem", &self.inner)?, name)
    }

    /// Writes new targets of the cost with this name at all knots, without making new costs. An MPC calls this in
    /// each period, between solves.
    ///
    /// name: the name of the cost.
    /// values: the targets, in the shape that `references` returns. Row t belongs to knot t, and row N to the terminal
    ///     knot. Rows of knots without this cost are ignored.
    ///
    /// A knot that shares its costs with other knots first gets separate costs with the same terms. They move with the
    /// knot in a `shift`. Later calls write in place and allocate nothing; 25 knots of a quadruped take a few
    /// microseconds.
    ///
    /// Raises `KeyError` as `references` does, and `ProblemError` if a target is not finite or not a rotation. Then the
    /// knots before the one in the message have their new targets.
    fn set_references(&self, name: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        self.is_outdated.store(true, Ordering::Relaxed);
        references::set(&self.recorder, &mut *lock("problem", &self.inner)?, name, values)
    }

    /// Sets the placements of a geometry in `Residual.distances`, in costs and limits, at all knots: for example of an
    /// obstacle that moves while the plan is executed. Call this method between solves.
    ///
    /// name: the name of the `Geometry`.
    /// placements: the poses (N + 1, 4, 4) in the world, or in the frame of the geometry, at the knots 0 … N.
    ///
    /// Knots with this geometry get separate costs and limits, which move with the knot in `shift`.
    ///
    /// Raises `KeyError` if no pair has this geometry, and `ProblemError` for a placement that is no pose.
    fn set_placements(&self, name: &str, placements: &Bound<'_, PyAny>) -> PyResult<()> {
        self.is_outdated.store(true, Ordering::Relaxed);
        let mut problem = lock("problem", &self.inner)?;
        let all = references::set_placements(&self.recorder, &mut problem, name, placements)?;
        let mut described = lock("problem", &self.described)?;
        let last = described.len() - 1;
        for (t, placement) in all.into_iter().enumerate() {
            let model = problem.knot_models().get(t).copied();
            if let Some(described) = &mut described[model.unwrap_or(last)] {
                Arc::make_mut(described).place(model.map(|_| t), name, placement);
            }
        }
        Ok(())
    }

    /// Writes new weights of the entries of the residual, for a cost with `Activation.weighted` or
    /// `weighted_barrier`, at all knots. Call this method between solves.
    ///
    /// name: the name of the cost.
    /// weights: the weights, (N + 1, n); otherwise as for `set_references`.
    ///
    /// Raises `KeyError` if no knot has this cost, and `ProblemError` if its activation has no weights, or a weight is
    /// negative or not finite.
    fn set_entry_weights(&self, name: &str, weights: &Bound<'_, PyAny>) -> PyResult<()> {
        self.is_outdated.store(true, Ordering::Relaxed);
        references::set_entry_weights(&self.recorder, &mut *lock("problem", &self.inner)?, name, weights)
    }

    /// Changes targets and gains of the contact with this name at all knots that have it, without making new models.
    /// Call this method between solves.
    ///
    /// contact: the name of the contact.
    /// placement, velocity, acceleration, kp, kd: as in `ContactConstraint`; None keeps the old value.
    ///
    /// Contacts belong to the dynamics, which the knots of a stance share. Knots with another target, such as the next
    /// foothold, need a model of their own.
    ///
    /// Raises `KeyError` if no knot has this contact, and `ProblemError` for invalid numbers.
    #[pyo3(signature = (contact, placement=None, velocity=None, acceleration=None, kp=None, kd=None))]
    fn set_contact(
        &self,
        contact: &str,
        placement: Option<&Bound<'_, PyAny>>,
        velocity: Option<&Bound<'_, PyAny>>,
        acceleration: Option<&Bound<'_, PyAny>>,
        kp: Option<&Bound<'_, PyAny>>,
        kd: Option<f64>,
    ) -> PyResult<()> {
        let mut read = condyle::constraints::Target::identity();
        aim(&mut read, placement, velocity, acceleration)?;
        let kp = kp.map(gains).transpose()?;
        let change = ContactChange {
            placement: placement.map(|_| read.placement),
            velocity: velocity.map(|_| read.velocity),
            acceleration: acceleration.map(|_| read.acceleration),
            kp,
            kd,
        };
        self.recorder.note(|| Call::SetContact { contact: contact.to_owned(), change: Box::new(change.clone()) });
        let change = |to: &mut condyle::ContactConstraint| change.apply(to);
        if !lock("problem", &self.inner)?.change_contacts(contact, change).map_err(problem_error)? {
            return Err(PyKeyError::new_err(format!("no knot has a contact '{contact}'")));
        }
        let mut described = lock("problem", &self.described)?;
        for described in described.iter_mut().flatten().map(Arc::make_mut) {
            if let Some(own) = described.knot.contact_mut(contact) {
                change(&mut own.constraint);
            }
        }
        Ok(())
    }

    /// Replaces the costs of a single knot, for example by costs with new targets of an MPC. In a `shift`, these costs
    /// move with the knot. Call this method between solves.
    ///
    /// knot: the index of the knot, 0 to N; N is the terminal knot.
    /// costs: a list of `Cost`.
    ///
    /// Raises `ProblemError` if a term does not fit the robot, or if the knot's action does not belong to a robot.
    fn set_costs(&self, py: Python<'_>, knot: usize, costs: Vec<PyRef<'_, Cost>>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let horizon = problem.horizon();
        if knot > horizon {
            return Err(ProblemError::new_err(format!("knot {knot}: expected 0 to {horizon}")));
        }
        let k = problem.knot_models().get(knot).copied();
        let mut described = lock("problem", &self.described)?;
        let last = described.len() - 1;
        let described = &mut described[k.unwrap_or(last)];
        let Some(model) = described.as_ref().map(|described| described.robot.clone()) else {
            return Err(ProblemError::new_err(format!("knot {knot}: expected an action of a robot")));
        };
        let own: Vec<_> = costs.iter().filter_map(|cost| cost.own(py)).collect();
        let costs = terms(&model, &costs);
        self.recorder.note(|| Call::SetCosts { knot, costs: costs.clone() });
        let Some(set) = change!(&mut problem, k, |action| action.set_costs(knot, costs.clone())) else {
            return Err(ProblemError::new_err(format!("knot {knot}: expected an action of a robot")));
        };
        set.map_err(problem_error)?;
        if let Some(described) = described {
            let described = Arc::make_mut(described);
            described.knot.costs_at.insert(knot, costs);
            lock("problem", &self.faults)?.extend(faults(&described.knot));
        }
        lock("problem", &self.written)?.extend(own);
        Ok(())
    }

    /// Replaces the model of a knot, as an MPC does when a contact is made earlier than planned. Call this method
    /// between solves. The solver's next iterations do not allocate.
    ///
    /// knot: the index of the knot, 0 to N − 1.
    /// model: the new model, whose state and controls have the same sizes as in the old model. Costs that the model has
    ///     for single knots belong to the knots of this problem with the same index.
    ///
    /// Raises `ProblemError` if the model does not fit.
    fn set_knot(&self, py: Python<'_>, knot: usize, model: &Bound<'_, PyAny>) -> PyResult<()> {
        let new = boxed(model, false, &self.fault)?;
        let object = new.described.is_none().then(|| model.clone().unbind());
        self.replace(py, knot, new, object, residuals(model))
    }

    /// Sets the duration of a single knot; the knot's model keeps its duration at all other knots. Call this method
    /// between solves. The solver's next iterations do not allocate.
    ///
    /// knot: the index of the knot, 0 to N − 1.
    /// dt: the duration (s).
    ///
    /// Raises `ProblemError` if dt is not above 0, or if the knot's action does not belong to a robot or is an impact.
    fn set_duration(&self, knot: usize, dt: f64) -> PyResult<()> {
        let (mut problem, described) = (lock("problem", &self.inner)?, lock("problem", &self.described)?);
        let own = problem.knot_models().get(knot).and_then(|&k| described[k].as_deref());
        if own.is_none_or(|own| own.knot.dynamics.dt().is_none()) {
            return Err(ProblemError::new_err(format!("knot {knot}: expected an action of a robot with a duration")));
        }
        self.recorder.note(|| Call::SetDuration { knot, dt });
        problem.set_duration(knot, dt).map_err(problem_error)
    }

    /// Sets the models and durations of all knots, before the first solve. Later, `retime` of a solver also moves its
    /// solution.
    ///
    /// knot_models: the index of the model of each knot, N indices.
    /// durations: the duration (s) of each knot, N numbers, 0 for an impact.
    ///
    /// A knot whose model changes has the costs and limits that its new model has for all knots.
    ///
    /// Raises `ProblemError` for an unknown model, for a duration that is not above 0 or not 0 at an impact, and for a
    /// new duration of an action that does not belong to a robot. Then nothing changes.
    fn set_knots(&self, knot_models: Vec<usize>, durations: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let durations = vector("durations", durations, knot_models.len())?;
        self.check_durations(&problem, &knot_models, &durations)?;
        let before = problem.knot_models().to_vec();
        self.recorder.note(|| Call::SetKnots { knot_models: knot_models.clone(), durations: kept(&durations) });
        problem.set_knots(&knot_models, &durations).map_err(problem_error)?;
        self.describe_knots(0, &before, &knot_models)
    }

    /// Computes the quasi-static controls of all knots, which hold the state of each knot still as well as possible:
    /// (N, nu), or a list of N arrays if knots differ in nu. The controls of robots are computed by statics, the
    /// controls of other actions by Newton's method.
    ///
    /// xs: states, (N + 1, nx).
    fn quasi_static<'py>(&self, py: Python<'py>, xs: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.inner)?;
        let xs = matrix("xs", xs, [problem.horizon() + 1, problem.nx()])?;
        let us = problem.quasi_static(&xs).map_err(problem_error)?;
        self.raise()?;
        by_knot(py, &problem, &[], |t, out| out.copy_from_slice(&us[problem.control_range(t)]))
    }

    /// Computes the cost of given states and controls, and the results of the dynamics for these states and controls,
    /// as an `Evaluation`.
    ///
    /// xs: states, (N + 1, nx), which need not satisfy the dynamics.
    /// us: controls, (N, nu), or a list of N arrays if knots differ in nu.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        xs: &Bound<'_, PyAny>,
        us: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.inner)?;
        let xs = matrix("xs", xs, [problem.horizon() + 1, problem.nx()])?;
        let us = controls(&problem, us)?;
        let evaluation = evaluate(py, &mut problem, &xs, &us)?;
        self.raise()?;
        Ok(evaluation)
    }

    /// Computes the evaluation of a solution; an error if the horizon was shifted after the solve.
    fn _evaluate<'py>(
        &self,
        py: Python<'py>,
        xs: &Bound<'_, PyAny>,
        us: &Bound<'_, PyAny>,
        moved: usize,
    ) -> PyResult<Bound<'py, PyAny>> {
        if moved != self.moved() {
            let what =
                "the horizon has moved on since this solution: ask for its forces, accelerations and efforts before";
            return Err(ProblemError::new_err(what));
        }
        self.evaluate(py, xs, us)
    }

    /// Computes the state at a fraction of the way from x0 to x1. Locks nothing, so it can run during a solve.
    fn _between<'py>(&self, x0: &Bound<'py, PyAny>, x1: &Bound<'py, PyAny>, s: f64) -> PyResult<Bound<'py, PyAny>> {
        let Some(space) = &self.space else {
            return Err(ProblemError::new_err(
                "terminal: expected an action of a robot, whose states are interpolated",
            ));
        };
        let py = x0.py();
        let (x0, x1) = (vector("x0", x0, space.nx())?, vector("x1", x1, space.nx())?);
        let mut dx = vec![0.0; space.ndx()];
        output(py, None, &[space.nx()], |x| space.between([&x0, &x1], s, &mut dx, x))
    }

    /// Computes the linear-quadratic approximation of the problem around states and controls: a list of N + 1
    /// `LqKnot`s, which a `Sweep` solves.
    ///
    /// xs, us: as for `evaluate`.
    fn derivatives<'py>(
        &self,
        py: Python<'py>,
        xs: &Bound<'_, PyAny>,
        us: &Bound<'_, PyAny>,
    ) -> PyResult<Bound<'py, PyList>> {
        let mut problem = lock("problem", &self.inner)?;
        let (horizon, nx, ndx) = (problem.horizon(), problem.nx(), problem.ndx());
        let xs = matrix("xs", xs, [horizon + 1, nx])?;
        let us = controls(&problem, us)?;
        let (mut lq_knots, mut next, mut costs) = (problem.lq_knots(), vec![0.0; horizon * nx], vec![0.0; horizon + 1]);
        problem.calc(&xs, &us, &mut next, &mut costs);
        problem.calc_diff(&xs, &us, &mut lq_knots);
        self.raise()?;
        // an LQ knot stores the gap at the next state
        for (knot, gap) in lq_knots.iter_mut().zip(gaps(&problem, &xs, &next)[ndx..].chunks_exact(ndx)) {
            knot.f.copy_from_slice(gap);
        }
        give(py, &lq_knots)
    }

    fn __repr__(&self) -> PyResult<String> {
        let problem = lock("problem", &self.inner)?;
        let described = lock("problem", &self.described)?;
        let (nx, ndx, models) = (problem.nx(), problem.ndx(), described.len() - 1);
        let robot = described.iter().flatten().next().map(|described| format!(" of '{}'", described.robot.name()));
        let robot = robot.unwrap_or_default();
        let (horizon, plural) = (problem.horizon(), if models == 1 { "" } else { "s" });
        Ok(format!("<condyle.optimal.Problem{robot}: {horizon} knots, {models} model{plural}, nx {nx}, ndx {ndx}>"))
    }

    /// Computes the states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).
    ///
    /// us: controls, (N, nu), or a list of N arrays if knots differ in nu.
    ///
    /// Other threads can run meanwhile. An exception of a signal handler, such as KeyboardInterrupt, stops the rollout
    /// between knots.
    fn rollout<'py>(&self, py: Python<'py>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.inner)?;
        let us = controls(&problem, us)?;
        let failed = || self.has_failed();
        let signals = Signals::new(signals::SHORT);
        let mut interruptions = Interruptions { signals, failed: &failed, observer: None, raised: None };
        let inner = &mut *problem;
        let xs = py.detach(|| inner.rollout_while(&us, || Observer::go_on(&mut &mut interruptions)));
        let raised = self.raise();
        interruptions.signals.finish()?;
        raised?;
        let xs = xs.map_err(problem_error)?;
        output(py, None, &[problem.horizon() + 1, problem.nx()], |out| out.copy_from_slice(&xs))
    }
}
