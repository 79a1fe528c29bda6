//! Optimal control as Python sees it: the module `condyle.optimal`.

use crate::arrays::{Give, matrix, named_tuple, output, pose, three, vector};
use crate::exceptions::ProblemError;
use crate::model::{Model, frame_index};
use condyle::optimal as rust;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};
use rust::robot;
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

/// How much a residual r costs.
///
/// >>> condyle.optimal.Activation.weighted([1.0, 0.0])
/// Weighted([1.0, 0.0])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Activation(robot::Activation);

#[pymethods]
impl Activation {
    /// ½ Σ rᵢ².
    #[staticmethod]
    fn quadratic() -> Self {
        Self(robot::Activation::Quadratic)
    }

    /// ½ Σ wᵢ rᵢ².
    #[staticmethod]
    fn weighted(w: &Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(Self(robot::Activation::Weighted(numbers("w", w)?)))
    }

    /// ½ Σ (excess of rᵢ over its bounds)²; infinite bounds are none.
    #[staticmethod]
    fn barrier(lower: &Bound<'_, PyAny>, upper: &Bound<'_, PyAny>) -> PyResult<Self> {
        let (lower, upper) = (numbers("lower", lower)?, numbers("upper", upper)?);
        Ok(Self(robot::Activation::Barrier { lower, upper }))
    }

    fn __repr__(&self) -> String {
        format!("{:?}", self.0)
    }
}

/// A term of a cost: weight times an activation of a residual. The activation is quadratic unless given.
///
/// >>> condyle.optimal.Cost.control("effort", 1e-3, [0.0] * 7)
/// <condyle.optimal.Cost 'effort', weight 0.001>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Cost(robot::Cost);

impl Cost {
    fn make(name: &str, weight: f64, residual: robot::Residual, activation: Option<&Bound<'_, Activation>>) -> Self {
        let activation = activation.map_or(robot::Activation::Quadratic, |a| a.get().0.clone());
        Self(robot::Cost::new(name, weight, residual, activation))
    }
}

#[pymethods]
impl Cost {
    /// r = x ⊖ reference, 2 nv numbers; reference = (q, v).
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn state(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        let reference = numbers("reference", reference)?;
        Ok(Self::make(name, weight, robot::Residual::State { reference }, activation))
    }

    /// r = u − reference, nu numbers.
    #[staticmethod]
    #[pyo3(signature = (name, weight, reference, activation=None))]
    fn control(
        name: &str,
        weight: f64,
        reference: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        let reference = numbers("reference", reference)?;
        Ok(Self::make(name, weight, robot::Residual::Control { reference }, activation))
    }

    /// r = log(target⁻¹ oMf), 6 numbers, of a frame of the model; target is a homogeneous 4 × 4 matrix.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target, activation=None))]
    fn frame_placement(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        let target = pose("target", target)?;
        let frame = frame_index(&model.get().inner, frame)?;
        Ok(Self::make(name, weight, robot::Residual::FramePlacement { frame, target }, activation))
    }

    /// r = p − target, 3 numbers in the world, of the origin of a frame of the model.
    #[staticmethod]
    #[pyo3(signature = (name, weight, model, frame, target, activation=None))]
    fn frame_translation(
        name: &str,
        weight: f64,
        model: &Bound<'_, Model>,
        frame: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        activation: Option<&Bound<'_, Activation>>,
    ) -> PyResult<Self> {
        let target = three("target", target)?;
        let frame = frame_index(&model.get().inner, frame)?;
        Ok(Self::make(name, weight, robot::Residual::FrameTranslation { frame, target }, activation))
    }

    fn __repr__(&self) -> String {
        format!("<condyle.optimal.Cost '{}', weight {}>", self.0.name, self.0.weight)
    }
}

/// A knot of a robot that moves freely under its joints' efforts, by semi-implicit Euler.
///
/// q̈ = aba(q, v, τ), v⁺ = v + q̈ Δt, q⁺ = q ⊕ (v Δt + q̈ Δt²), cost Δt Σ w a(r); the state is x = (q, v), the
/// controls are the efforts of all joints but a free-flyer at the root.
///
/// model: the robot.
/// dt: Δt in seconds, or None for a terminal knot: no controls, cost Σ w a(r).
/// costs: a list of `Cost`.
/// lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
///
/// Raises `ProblemError` for a cost that does not fit.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct FreeDynamics(robot::FreeDynamics);

#[pymethods]
impl FreeDynamics {
    #[new]
    #[pyo3(signature = (model, dt, costs, lower=None, upper=None))]
    fn new(
        model: &Bound<'_, Model>,
        dt: Option<f64>,
        costs: Vec<PyRef<'_, Cost>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let model = Arc::new(model.get().inner.clone());
        let costs = costs.iter().map(|c| c.0.clone()).collect();
        let action = match dt {
            Some(dt) => robot::FreeDynamics::running(model, dt, costs),
            None => robot::FreeDynamics::terminal(model, costs),
        };
        let action = action.map_err(exception)?;
        if lower.is_none() && upper.is_none() {
            return Ok(Self(action));
        }
        let nu = rust::ActionModel::nu(&action);
        let bound = |name, given: Option<&Bound<'_, PyAny>>, none: f64| match given {
            Some(numbers) => Ok(vector(name, numbers, nu)?.to_vec()),
            None => PyResult::Ok(vec![none; nu]),
        };
        let (lower, upper) = (bound("lower", lower, f64::NEG_INFINITY)?, bound("upper", upper, f64::INFINITY)?);
        Ok(Self(action.with_bounds(lower, upper)))
    }

    /// The efforts that hold the robot still at the state x, nu numbers.
    fn quasi_static<'py>(&self, py: Python<'py>, x: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = self.0.model();
        let x = vector("x", x, model.nq() + model.nv())?;
        self.0.clone().quasi_static(&x).give(py, None)
    }
}

/// An optimal control problem: knots from x0, each served by one of some models, and a terminal one.
///
/// x0: the initial state, nx numbers.
/// models: a list of `FreeDynamics`.
/// stages: for each knot the index of its model; consecutive knots of one model are computed as a group.
/// terminal: the `FreeDynamics` of the end.
///
/// Raises `ProblemError` if they do not fit together.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Problem(Mutex<rust::Problem>);

#[pymethods]
impl Problem {
    #[new]
    fn new(
        x0: &Bound<'_, PyAny>,
        models: Vec<PyRef<'_, FreeDynamics>>,
        stages: Vec<usize>,
        terminal: PyRef<'_, FreeDynamics>,
    ) -> PyResult<Self> {
        let models = models.iter().map(|m| Box::new(m.0.clone()) as Box<dyn rust::ActionModel>).collect();
        let terminal = Box::new(terminal.0.clone());
        let problem = rust::Problem::new(numbers("x0", x0)?, models, stages, terminal).map_err(exception)?;
        Ok(Self(Mutex::new(problem)))
    }

    /// The number of knots before the terminal one, N.
    #[getter]
    fn horizon(&self) -> PyResult<usize> {
        Ok(lock("problem", &self.0)?.horizon())
    }

    /// Sets the initial state, nx numbers, as an MPC does before each solve.
    ///
    /// Raises `ProblemError` for a number that is not finite.
    fn set_x0(&self, x0: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut problem = lock("problem", &self.0)?;
        let x0 = vector("x0", x0, problem.nx())?;
        problem.set_x0(&x0).map_err(exception)
    }

    /// The states x₀ … x_N that follow from the initial state under controls us, (N + 1, nx).
    fn rollout<'py>(&self, py: Python<'py>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.0)?;
        let us = matrix("us", us, [problem.horizon(), problem.nu(0)])?;
        let xs = problem.rollout(&us).map_err(exception)?;
        output(py, None, &[problem.horizon() + 1, problem.nx()], |out| out.copy_from_slice(&xs))
    }
}

/// Differential dynamic programming, feasibility-driven or not, with Crocoddyl's rules and constants.
///
/// Where controls are bounded, these are those of its box solvers.
///
/// problem: what is solved; the solver allocates for its shape once.
/// settings: `method`, "fddp" (default: trials keep a part of the gaps) or "ddp" (every trial is a plain rollout);
///     `second_order`, whether the curvature of the dynamics counts (where the models give it; full DDP); and
///     any of `max_iterations`, `tolerance`, `tolerance_bounded` (where controls are bounded), `step_lengths`,
///     `accept`, `accept_ascent`, `flat`, `regularisation_start`, `regularisation_min`, `regularisation_max`,
///     `regularisation_factor`, `regularisation_decrease_above`, `regularisation_increase_below`,
///     `time_budget` (s; a solve without time to go on returns what it has, with the status "time_limit").
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
        let mut solver = rust::Fddp::new(&*lock("problem", &problem.get().0)?);
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
    /// us: controls, (N, nu).
    ///
    /// Raises `ProblemError` for numbers or settings that make no sense. How the solve ended is the solution's status.
    fn solve<'py>(&self, py: Python<'py>, xs: &Bound<'_, PyAny>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.problem.get().0)?;
        let mut solver = lock("solver", &self.solver)?;
        let xs = matrix("xs", xs, [problem.horizon() + 1, problem.nx()])?.to_vec();
        let us = matrix("us", us, [problem.horizon(), problem.nu(0)])?.to_vec();
        let (problem, solver) = (&mut *problem, &mut *solver);
        py.detach(|| solver.solve(problem, &xs, &us).map(|_| ())).map_err(exception)?;
        give(py, problem, solver.solution())
    }

    /// Solves the problem from the last solution: with a new initial state, or shifted. Returns a `Solution`.
    ///
    /// Raises `ProblemError` as `solve`.
    fn resume<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut problem = lock("problem", &self.problem.get().0)?;
        let mut solver = lock("solver", &self.solver)?;
        let (problem, solver) = (&mut *problem, &mut *solver);
        py.detach(|| solver.resume(problem).map(|_| ())).map_err(exception)?;
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
        let mut problem = lock("problem", &self.problem.get().0)?;
        let mut solver = lock("solver", &self.solver)?;
        problem.shift(last).map_err(exception)?;
        solver.shift(&mut problem).map_err(exception)
    }
}

/// A solution as Python sees it.
fn give<'py>(py: Python<'py>, problem: &rust::Problem, s: &rust::Solution) -> PyResult<Bound<'py, PyAny>> {
    let (horizon, nx, ndx, nu) = (problem.horizon(), problem.nx(), problem.ndx(), problem.nu(0));
    let gains = output(py, None, &[horizon, nu, ndx], |out| {
        for (t, K) in s.K.iter().enumerate() {
            for r in 0..nu {
                for c in 0..ndx {
                    out[(t * nu + r) * ndx + c] = K[(r, c)];
                }
            }
        }
    })?;
    let k: Vec<f64> = s.k.iter().flat_map(|k| k.iter().copied()).collect();
    static ITERATION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
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
    named_tuple(py, &SOLUTION, "Solution")?.call1((
        output(py, None, &[horizon + 1, nx], |out| out.copy_from_slice(&s.xs))?,
        output(py, None, &[horizon, nu], |out| out.copy_from_slice(&s.us))?,
        gains,
        output(py, None, &[horizon, nu], |out| out.copy_from_slice(&k))?,
        s.cost,
        s.gap,
        s.feasible,
        status,
        trace,
    ))
}
