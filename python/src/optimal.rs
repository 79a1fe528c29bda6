//! Optimal control as Python sees it: the module `condyle.optimal`.

mod actions;
mod costs;

use crate::arrays::{matrix, named_tuple, output, vector};
use crate::exceptions::ProblemError;
pub(crate) use actions::{Action, ContactDynamics, FreeDynamics, ImpulseDynamics, InverseDynamics, Lqr};
use actions::{Boxed, Described, Fault, Model, Part};
use condyle::optimal as rust;
pub(crate) use costs::{Activation, Cost, FrictionCone, WrenchCone};
use nalgebra::DMatrix;
use pyo3::exceptions::{PyKeyError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use std::sync::{Arc, Mutex, MutexGuard};

fn exception(error: rust::Error) -> PyErr {
    ProblemError::new_err(error.to_string())
}

/// What is behind a lock that no other call may hold.
fn lock<'a, T>(name: &str, value: &'a Mutex<T>) -> PyResult<MutexGuard<'a, T>> {
    value.try_lock().map_err(|_| PyRuntimeError::new_err(format!("{name}: in use by another call")))
}

/// The numbers of a vector of any length.
fn numbers(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let length = value.len().map_err(|_| PyValueError::new_err(format!("{argument}: expected a list of numbers")))?;
    Ok(vector(argument, value, length)?.to_vec())
}

/// The number of controls of all knots, if it is the same.
fn common_nu(problem: &rust::Problem) -> Option<usize> {
    let nu = problem.nu(0);
    (0..problem.horizon()).all(|t| problem.nu(t) == nu).then_some(nu)
}

/// Controls, flat: of an array (N, nu), or of a list of arrays.
fn controls(problem: &rust::Problem, us: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
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

/// An array for all knots if they have as many controls, or else a list of arrays; `numbers` are of one knot.
fn by_knot<'py>(
    py: Python<'py>,
    problem: &rust::Problem,
    inner: &[usize],
    numbers: impl Fn(usize, &mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    let horizon = problem.horizon();
    let shape = |nu: usize| [&[nu], inner].concat();
    if let Some(nu) = common_nu(problem) {
        let each = nu * inner.iter().product::<usize>();
        return output(py, None, &[&[horizon], &shape(nu)[..]].concat(), |out| {
            (0..horizon).for_each(|t| numbers(t, &mut out[t * each..(t + 1) * each]));
        });
    }
    let arrays = (0..horizon).map(|t| output(py, None, &shape(problem.nu(t)), |out| numbers(t, out)));
    Ok(PyList::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?.into_any())
}

fn row_major(K: &DMatrix<f64>, out: &mut [f64]) {
    for r in 0..K.nrows() {
        for c in 0..K.ncols() {
            out[r * K.ncols() + c] = K[(r, c)];
        }
    }
}

/// An optimal control problem: knots from x0, each served by one of some models, and a terminal one.
///
/// x0: the initial state, nx numbers.
/// models: a list of `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`, `InverseDynamics`, `Lqr`, `Action`.
/// stages: for each knot the index of its model; consecutive knots of one model are computed as a group.
/// terminal: the model of the end, without controls.
///
/// Raises `ProblemError` if they do not fit together.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Problem {
    inner: Mutex<rust::Problem>,
    models: Vec<Model>,
    terminal: Model,
    /// The models and the terminal one as data, where they are a robot's.
    described: Mutex<Vec<Option<Described>>>,
    /// What the actions written in Python raised.
    faults: Vec<Fault>,
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
        let mut faults = Vec::new();
        let all = models.iter().chain([terminal]).map(|model| actions::boxed(model, &mut faults));
        let all = all.collect::<PyResult<Vec<_>>>()?;
        Self::make(numbers("x0", x0)?, all, stages, faults)
    }

    /// A problem of a robot from the text that `to_json` gave.
    ///
    /// Raises `ProblemError` for a text that is none, and for what does not fit together in it.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let data: rust::robot::RobotProblem =
            serde_json::from_str(text).map_err(|error| ProblemError::new_err(format!("no problem: {error}")))?;
        let robot = Arc::new(data.model);
        let knots = data.knots.into_iter().map(|knot| Part::Knot(Box::new(knot)));
        let parts = knots.chain([Part::Terminal(data.terminal)]);
        let all = parts.map(|part| Described { robot: robot.clone(), part }.boxed()).collect::<PyResult<Vec<_>>>()?;
        Self::make(data.x0, all, data.stages, Vec::new())
    }

    /// The problem and its robot as JSON, with the present initial state, weights and stages; no bound is null.
    ///
    /// Raises `ProblemError` if an action is an `Lqr` or an `Action`, or knots are of different robots.
    fn to_json(&self) -> PyResult<String> {
        let problem = lock("problem", &self.inner)?;
        let described = lock("problem", &self.described)?;
        let wrong = |k: usize, what: &str| {
            let name = if k < self.models.len() { format!("models[{k}]") } else { "terminal".to_owned() };
            ProblemError::new_err(format!("{name}: {what}"))
        };
        let (mut knots, mut terminal) = (Vec::new(), Vec::new());
        let mut first: Option<(&Arc<condyle::Model>, Vec<u8>)> = None;
        for (k, described) in described.iter().enumerate() {
            let Some(Described { robot, part }) = described else {
                return Err(wrong(k, "expected an action of a robot, which alone can be JSON"));
            };
            let bytes = postcard::to_allocvec(&**robot).map_err(|error| ProblemError::new_err(error.to_string()))?;
            match &first {
                None => first = Some((robot, bytes)),
                Some((_, other)) if *other == bytes => {}
                Some(_) => return Err(wrong(k, "expected the robot of the first model, found another one")),
            }
            match (part, k < self.models.len()) {
                (Part::Knot(knot), true) => knots.push((**knot).clone()),
                (Part::Terminal(costs), false) => terminal.clone_from(costs),
                (Part::Terminal(_), true) => return Err(wrong(k, "expected a knot with a duration")),
                (Part::Knot(_), false) => return Err(wrong(k, "expected a knot without a duration")),
            }
        }
        let (model, _) = first.expect("the terminal one is there");
        let (x0, stages) = (problem.x0().to_vec(), problem.stages().to_vec());
        let data = rust::robot::RobotProblem { model: (**model).clone(), x0, knots, stages, terminal };
        serde_json::to_string(&data).map_err(|error| ProblemError::new_err(error.to_string()))
    }

    /// For `pickle`: by way of JSON.
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
    /// Raises `ProblemError` for a number that is not finite.
    fn set_x0(&self, x0: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let x0 = vector("x0", x0, problem.nx())?;
        problem.set_x0(&x0).map_err(exception)
    }

    /// Changes the weight of the terms called `name`, between solves: of all knots, the terminal one included.
    ///
    /// Raises `KeyError` if there is no such term.
    fn set_weight(&self, name: &str, weight: f64) -> PyResult<()> {
        let mut problem = lock("problem", &self.inner)?;
        let mut found = false;
        for (k, kind) in self.models.iter().enumerate() {
            found |= kind.set_weight(&mut problem, Some(k), name, weight);
        }
        found |= self.terminal.set_weight(&mut problem, None, name, weight);
        for described in lock("problem", &self.described)?.iter_mut().flatten() {
            described.set_weight(name, weight);
        }
        if found { Ok(()) } else { Err(PyKeyError::new_err(format!("no knot has a cost '{name}'"))) }
    }

    /// The states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).
    ///
    /// us: (N, nu), or a list of N arrays where knots differ in nu.
    fn rollout<'py>(&self, py: Python<'py>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.inner)?;
        let us = controls(&problem, us)?;
        let xs = problem.rollout(&us).map_err(exception)?;
        self.raise()?;
        output(py, None, &[problem.horizon() + 1, problem.nx()], |out| out.copy_from_slice(&xs))
    }
}

impl Problem {
    /// Of models, the terminal one last.
    fn make(x0: Vec<f64>, mut all: Vec<Boxed>, stages: Vec<usize>, faults: Vec<Fault>) -> PyResult<Self> {
        let described = Mutex::new(all.iter().map(|boxed| boxed.described.clone()).collect());
        let Boxed { action: end, kind: terminal, .. } = all.pop().expect("the terminal one is there");
        let (actions, models) = all.into_iter().map(|boxed| (boxed.action, boxed.kind)).unzip();
        let problem = rust::Problem::new(x0, actions, stages, end).map_err(exception)?;
        Ok(Self { inner: Mutex::new(problem), models, terminal, described, faults })
    }

    /// Raises what an action written in Python raised.
    fn raise(&self) -> PyResult<()> {
        self.faults.iter().find_map(|fault| fault.lock().ok()?.take()).map_or(Ok(()), Err)
    }
}

/// Differential dynamic programming, feasibility-driven or not, with Crocoddyl's rules and constants.
///
/// Where controls are bounded, these are those of its box solvers.
///
/// problem: what is solved; the solver allocates for its shape once.
/// settings: `method`, "fddp" (default: trials keep a part of the gaps) or "ddp" (every trial is a plain rollout);
///     `second_order`, whether the curvature of the dynamics counts (where the models give it; full DDP);
///     `implicit`, whether robots' knots come to the sweep as equations of inverse dynamics where that is possible
///     (default: yes; the same steps in less time); and
///     any of `max_iterations`, `tolerance`, `tolerance_bounded` (where controls are bounded), `step_lengths`,
///     `accept`, `accept_ascent`, `flat`, `regularisation_start`, `regularisation_min`, `regularisation_max`,
///     `regularisation_factor`, `regularisation_decrease_above`, `regularisation_increase_below`,
///     `time_budget` (s; a solve without time to go on returns what it has, with the status "time_limit"),
///     `segments` (of the horizon on which a sweep works at the same time, in as many threads as there are; 1 unless
///     given, for one thread. Results are the same but for rounding, and to the last bit for any number of threads),
///     `threads` (on which derivatives of a robot are computed, 1 unless given; the same to the last bit).
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Fddp {
    problem: Py<Problem>,
    solver: Mutex<rust::Fddp>,
}

#[pymethods]
impl Fddp {
    #[new]
    #[pyo3(signature = (problem, **settings))]
    fn new(problem: Bound<'_, Problem>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut solver = rust::Fddp::new(&*lock("problem", &problem.get().inner)?);
        for (name, value) in settings.into_iter().flatten() {
            let name: String = name.extract()?;
            let s = &mut solver.settings;
            let number = match name.as_str() {
                "max_iterations" => {
                    s.max_iterations = value.extract()?;
                    continue;
                }
                "second_order" => {
                    s.second_order = value.extract()?;
                    continue;
                }
                "implicit" => {
                    s.implicit = value.extract()?;
                    continue;
                }
                "segments" => {
                    s.segments = value.extract()?;
                    continue;
                }
                "threads" => {
                    s.threads = value.extract()?;
                    continue;
                }
                "step_lengths" => {
                    s.step_lengths = value.extract()?;
                    continue;
                }
                "method" => {
                    s.method = match value.extract::<String>()?.as_str() {
                        "fddp" => rust::Method::Fddp,
                        "ddp" => rust::Method::Ddp,
                        other => {
                            return Err(PyValueError::new_err(format!(
                                "method: expected 'fddp' or 'ddp', found '{other}'"
                            )));
                        }
                    };
                    continue;
                }
                "time_budget" => {
                    let seconds: Option<f64> = value.extract()?;
                    let duration = |s| std::time::Duration::try_from_secs_f64(s);
                    let duration = seconds.map(duration).transpose().map_err(|_| {
                        PyValueError::new_err(format!("time_budget: expected at least 0 seconds, found {seconds:?}"))
                    })?;
                    s.time_budget = duration;
                    continue;
                }
                "tolerance" => &mut s.tolerance,
                "tolerance_bounded" => &mut s.tolerance_bounded,
                "accept" => &mut s.accept,
                "accept_ascent" => &mut s.accept_ascent,
                "flat" => &mut s.flat,
                "regularisation_start" => &mut s.regularisation_start,
                "regularisation_min" => &mut s.regularisation_min,
                "regularisation_max" => &mut s.regularisation_max,
                "regularisation_factor" => &mut s.regularisation_factor,
                "regularisation_decrease_above" => &mut s.regularisation_decrease_above,
                "regularisation_increase_below" => &mut s.regularisation_increase_below,
                _ => return Err(PyValueError::new_err(format!("settings: there is no setting '{name}'"))),
            };
            *number = value.extract()?;
        }
        Ok(Self { problem: problem.unbind(), solver: Mutex::new(solver) })
    }

    /// Solves the problem from a warm start, and returns a `Solution`. Other threads run meanwhile.
    ///
    /// xs: states, (N + 1, nx); they need not satisfy the dynamics.
    /// us: controls, (N, nu), or a list of N arrays where knots differ in nu.
    ///
    /// Raises `ProblemError` for numbers or settings that make no sense, and what an `Action` raises. How the solve
    /// ended is the solution's status.
    fn solve<'py>(&self, py: Python<'py>, xs: &Bound<'_, PyAny>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut solver = lock("solver", &self.solver)?;
        let xs = matrix("xs", xs, [problem.horizon() + 1, problem.nx()])?.to_vec();
        let us = controls(&problem, us)?;
        let (problem, solver) = (&mut *problem, &mut *solver);
        py.detach(|| solver.solve(problem, &xs, &us).map(|_| ())).map_err(exception)?;
        self.problem.get().raise()?;
        give(py, problem, solver.solution())
    }

    /// Solves the problem from the last solution: with a new initial state, or shifted. Returns a `Solution`.
    ///
    /// Raises `ProblemError` as `solve`.
    fn resume<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut solver = lock("solver", &self.solver)?;
        let (problem, solver) = (&mut *problem, &mut *solver);
        py.detach(|| solver.resume(problem).map(|_| ())).map_err(exception)?;
        self.problem.get().raise()?;
        give(py, problem, solver.solution())
    }

    /// Moves the horizon of the problem on by a knot, as an MPC does after each step, and the last solution with it.
    ///
    /// `resume` then starts from there. Knot t becomes knot t − 1; the last one is served by a model of the problem.
    ///
    /// last: the index of that model.
    ///
    /// Raises `ProblemError` if there is no such model.
    fn shift(&self, last: usize) -> PyResult<()> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut solver = lock("solver", &self.solver)?;
        problem.shift(last).map_err(exception)?;
        solver.shift(&mut problem).map_err(exception)?;
        self.problem.get().raise()
    }
}

/// A solution as Python sees it.
fn give<'py>(py: Python<'py>, problem: &rust::Problem, s: &rust::Solution) -> PyResult<Bound<'py, PyAny>> {
    let (horizon, nx, ndx) = (problem.horizon(), problem.nx(), problem.ndx());
    static ITERATION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    static TIMINGS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    static SOLUTION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let iteration = named_tuple(py, &ITERATION, "Iteration")?;
    let record = |i: &rust::Iteration| {
        iteration.call1((
            i.iteration,
            i.cost,
            i.gap,
            i.stop,
            i.step,
            i.regularisation,
            i.d1,
            i.d2,
            i.feasible,
            i.accepted,
        ))
    };
    let trace = s.trace.iter().map(record).collect::<PyResult<Vec<_>>>()?;
    let status = match s.status {
        rust::Status::Converged => "converged",
        rust::Status::MaxIterations => "max_iterations",
        rust::Status::TimeLimit => "time_limit",
        rust::Status::RegularisationLimit => "regularisation_limit",
        _ => "not_finite",
    };
    let t = &s.timings;
    let timings = [t.calc, t.calc_diff, t.sweep, t.rollout, t.total].map(|phase| phase.as_secs_f64());
    let timings = named_tuple(py, &TIMINGS, "Timings")?.call1(PyTuple::new(py, timings)?)?;
    named_tuple(py, &SOLUTION, "Solution")?.call1((
        output(py, None, &[horizon + 1, nx], |out| out.copy_from_slice(&s.xs))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.u(t)))?,
        by_knot(py, problem, &[ndx], |t, out| row_major(&s.K[t], out))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.k[t].as_slice()))?,
        s.cost,
        s.gap,
        s.feasible,
        status,
        trace,
        timings,
    ))
}
