//! Problems, made of actions of any kind.

use super::actions::{
    Boxed, ContactDynamics, Described, FreeDynamics, ImpulseDynamics, InverseDynamics, change, terms,
};
use super::costs::Cost;
use super::own::{Action, ConstrainedAction, Fault, Lqr};
use crate::arrays::{matrix, numbers, output, vector};
use crate::exceptions::{ProblemError, problem_error};
use crate::signals::{self, Interruptions, Signals};
use condyle::optimal as rust;
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::Observer;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The value behind a lock; an error if another call holds it.
pub(crate) fn lock<'a, T>(name: &str, value: &'a Mutex<T>) -> PyResult<MutexGuard<'a, T>> {
    value.try_lock().map_err(|_| PyRuntimeError::new_err(format!("{name}: in use by another call")))
}

/// The number of controls of a knot, if all knots have the same.
pub(super) fn common_nu(problem: &rust::Problem) -> Option<usize> {
    let nu = problem.nu(0);
    (0..problem.horizon()).all(|t| problem.nu(t) == nu).then_some(nu)
}

/// The controls of all knots, one after the other, from an array (N, nu) or a list of arrays.
pub(super) fn controls(problem: &rust::Problem, us: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    if let Some(nu) = common_nu(problem) {
        return Ok(matrix("us", us, [problem.horizon(), nu])?.to_vec());
    }
    let (found, expected) = (us.len()?, problem.horizon());
    if found != expected {
        return Err(PyValueError::new_err(format!("us: expected {expected} arrays, found {found}")));
    }
    let mut flat = Vec::new();
    for t in 0..expected {
        flat.extend_from_slice(&vector(&format!("us[{t}]"), &us.get_item(t)?, problem.nu(t))?);
    }
    Ok(flat)
}

/// A copy of an action of any kind. Errors of actions and constraints that are written in Python go to `fault`.
fn boxed(model: &Bound<'_, PyAny>, terminal: bool, fault: &Fault) -> PyResult<Boxed> {
    macro_rules! of_a_robot {
        ($($class:ident),*) => {$(
            if let Ok(action) = model.cast::<$class>() {
                return Ok(action.get().0.boxed());
            }
        )*};
    }
    of_a_robot!(FreeDynamics, ContactDynamics, ImpulseDynamics, InverseDynamics);
    let action: Box<dyn rust::ActionModel> = if let Ok(lqr) = model.cast::<Lqr>() {
        Box::new(lqr.get().0.clone())
    } else if let Ok(constrained) = model.cast::<ConstrainedAction>() {
        let constrained = constrained.get();
        constrained.boxed(boxed(constrained.action.bind(model.py()), terminal, fault)?.action, fault)
    } else if let Ok(action) = model.cast::<Action>() {
        action.get().boxed(terminal, fault)
    } else {
        let found = model.get_type().name()?;
        return Err(PyTypeError::new_err(format!("models: expected an action, found '{found}'")));
    };
    Ok(Boxed { action, described: None })
}

/// An optimal control problem: knots from x0, each served by one of some models, and a terminal one.
///
/// x0: the initial state, nx numbers.
/// models: a list of `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`, `InverseDynamics`, `Lqr`, `Action`,
///     `ConstrainedAction`.
/// stages: for each knot the index of its model; consecutive knots of one model are computed as a group.
/// terminal: the model of the end, without controls.
///
/// Raises `ProblemError` if they do not fit together, if x0 is not finite or a rotation in it has not the length 1 (up to
/// 1e-3), and for more than 2²⁰ knots, 4096 numbers in a state or in the controls of a knot, or 2²⁸ in the matrices [A B] of
/// all knots.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Problem {
    pub(super) inner: Mutex<rust::Problem>,
    /// The models, the terminal one last, as data where they are a robot's.
    described: Mutex<Vec<Option<Described>>>,
    /// The actions that are written in Python: the problem's copies of them compute with their functions.
    written: Vec<Py<PyAny>>,
    /// Their first error.
    fault: Fault,
}

#[pymethods]
impl Problem {
    #[new]
    fn new(
        x0: &Bound<'_, PyAny>,
        models: Vec<Bound<'_, PyAny>>,
        stages: Vec<usize>,
        terminal: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let fault = Fault::default();
        let ends = models.iter().map(|model| (model, false)).chain([(terminal, true)]);
        let all = ends.map(|(model, end)| boxed(model, end, &fault)).collect::<PyResult<Vec<_>>>()?;
        let is_written =
            |model: &&Bound<'_, PyAny>| model.cast::<Action>().is_ok() || model.cast::<ConstrainedAction>().is_ok();
        let written = models.iter().chain([terminal]).filter(is_written).map(|model| model.clone().unbind());
        Self::make(numbers("x0", x0)?, all, stages, written.collect(), fault)
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.written.iter().try_for_each(|action| visit.call(action))
    }

    /// A problem of a robot from the text that `to_json` gave.
    ///
    /// Raises `ProblemError` for a text that is none, for what does not fit together in it, and for sizes beyond the limits
    /// that `Problem` has.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let data: rust::robot::RobotProblem =
            serde_json::from_str(text).map_err(|error| ProblemError::new_err(format!("no problem: {error}")))?;
        let robot = Arc::new(data.model);
        if data.knots.iter().any(|knot| knot.dynamics == rust::robot::Dynamics::End) {
            return Err(problem_error(rust::Error::TimeStep { dt: 0.0 }));
        }
        let knots = data.knots.into_iter().chain([data.terminal]);
        let all = knots.map(|knot| Described { robot: robot.clone(), knot }.boxed()).collect::<PyResult<Vec<_>>>()?;
        Self::make(data.x0, all, data.stages, Vec::new(), Fault::default())
    }

    /// The problem and its robot as JSON, with the present initial state, weights and stages. An infinite bound is
    /// null.
    ///
    /// Raises `ProblemError` if an action is an `Lqr`, an `Action` or a `ConstrainedAction`, or knots are of different
    /// robots.
    fn to_json(&self) -> PyResult<String> {
        let problem = lock("problem", &self.inner)?;
        let described = lock("problem", &self.described)?;
        let models = described.len() - 1;
        let wrong = |k: usize, what: &str| {
            let name = if k < models { format!("models[{k}]") } else { "terminal".to_owned() };
            ProblemError::new_err(format!("{name}: {what}"))
        };
        let mut knots = Vec::new();
        let mut first: Option<(&Arc<condyle::Model>, Vec<u8>)> = None;
        for (k, described) in described.iter().enumerate() {
            let Some(Described { robot, knot }) = described else {
                return Err(wrong(k, "expected an action of a robot, which alone can be JSON"));
            };
            let bytes = postcard::to_allocvec(&**robot).map_err(|error| ProblemError::new_err(error.to_string()))?;
            match &first {
                None => first = Some((robot, bytes)),
                Some((_, other)) if *other == bytes => {}
                Some(_) => return Err(wrong(k, "expected the robot of the first model, found another one")),
            }
            if k < models && knot.dynamics == rust::robot::Dynamics::End {
                return Err(wrong(k, "expected a knot with a duration"));
            }
            knots.push(knot.clone());
        }
        let terminal = knots.pop().expect("the terminal one is there");
        let (model, _) = first.expect("the terminal one is there");
        let (x0, stages) = (problem.x0().to_vec(), problem.stages().to_vec());
        let data = rust::robot::RobotProblem { model: (**model).clone(), x0, knots, stages, terminal };
        serde_json::to_string(&data).map_err(|error| ProblemError::new_err(error.to_string()))
    }

    /// The parts of a pickle, by way of JSON.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((slf.get_type().getattr("from_json")?, (slf.get().to_json()?,)))
    }

    /// The number of knots before the terminal one, N.
    #[getter]
    fn horizon(&self) -> PyResult<usize> {
        Ok(lock("problem", &self.inner)?.horizon())
    }

    /// Sets the initial state, nx numbers, as an MPC does before each solve.
    ///
    /// Raises `ProblemError` for a number that is not finite, and for a rotation whose length is not 1 (up to 1e-3).
    fn set_x0(&self, x0: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let x0 = vector("x0", x0, problem.nx())?;
        problem.set_x0(&x0).map_err(problem_error)
    }

    /// Changes the weight of the terms called `name`, between solves: of all knots, the terminal one included.
    ///
    /// Raises `KeyError` if there is no such term, `ProblemError` if the weight is negative or not finite.
    fn set_weight(&self, name: &str, weight: f64) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let mut described = lock("problem", &self.described)?;
        let mut found = false;
        for k in (0..described.len() - 1).map(Some).chain([None]) {
            let set = change!(&mut problem, k, |knot| knot.set_weight(name, weight)).unwrap_or(Ok(false));
            found |= set.map_err(problem_error)?;
        }
        described.iter_mut().flatten().for_each(|described| described.set_weight(name, weight));
        if found { Ok(()) } else { Err(PyKeyError::new_err(format!("no knot has a cost '{name}'"))) }
    }

    /// Gives a knot costs of its own, between solves: an MPC's new targets. They move with their knot at a `shift`.
    ///
    /// knot: its number, 0 to N; N is the terminal one.
    /// costs: a list of `Cost`.
    ///
    /// Raises `ProblemError` for a term that does not fit, and if the knot's action is not of a robot.
    fn set_costs(&self, knot: usize, costs: Vec<PyRef<'_, Cost>>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let horizon = problem.horizon();
        if knot > horizon {
            return Err(ProblemError::new_err(format!("knot {knot}: expected 0 to {horizon}")));
        }
        let k = problem.stages().get(knot).copied();
        let mut described = lock("problem", &self.described)?;
        let last = described.len() - 1;
        let described = &mut described[k.unwrap_or(last)];
        let costs = terms(&costs);
        let Some(set) = change!(&mut problem, k, |action| action.set_costs(knot, costs.clone())) else {
            return Err(ProblemError::new_err(format!("knot {knot}: expected an action of a robot")));
        };
        set.map_err(problem_error)?;
        if let Some(described) = described {
            described.knot.costs_at.insert(knot, costs);
        }
        Ok(())
    }

    /// The states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).
    ///
    /// us: (N, nu), or a list of N arrays where knots differ in nu.
    ///
    /// Other threads run meanwhile; what a handler of a signal raises, as KeyboardInterrupt, ends it between knots.
    fn rollout<'py>(&self, py: Python<'py>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.inner)?;
        let us = controls(&problem, us)?;
        let failed = || self.has_failed();
        let mut interruptions = Interruptions { signals: Signals::new(signals::SHORT), failed: &failed };
        let inner = &mut *problem;
        let xs = py.detach(|| inner.rollout_while(&us, || Observer::go_on(&mut &mut interruptions)));
        let raised = self.raise();
        interruptions.signals.finish()?;
        raised?;
        let xs = xs.map_err(problem_error)?;
        output(py, None, &[problem.horizon() + 1, problem.nx()], |out| out.copy_from_slice(&xs))
    }
}

impl Problem {
    /// A problem of models, the terminal one last.
    fn make(
        x0: Vec<f64>,
        all: Vec<Boxed>,
        stages: Vec<usize>,
        written: Vec<Py<PyAny>>,
        fault: Fault,
    ) -> PyResult<Self> {
        let (mut actions, described): (Vec<_>, _) = all.into_iter().map(|b| (b.action, b.described)).unzip();
        let end = actions.pop().expect("the terminal one is there");
        let problem = rust::Problem::new(x0, actions, stages, end).map_err(problem_error)?;
        Ok(Self { inner: Mutex::new(problem), described: Mutex::new(described), written, fault })
    }

    /// Moves the data of the models on by a knot.
    pub(super) fn describe_shift(&self) -> PyResult<()> {
        let mut described = lock("problem", &self.described)?;
        let models = described.len() - 1;
        described[..models].iter_mut().flatten().for_each(Described::shift);
        Ok(())
    }

    /// Raises the error of an action that is written in Python, if there is one.
    pub(super) fn raise(&self) -> PyResult<()> {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    /// Whether there is such an error.
    pub(super) fn has_failed(&self) -> bool {
        self.fault.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }
}
