//! Records of a controller's calls, and their replay.

use super::problem::{Problem, lock};
use super::recorder::{Shared, address};
use super::settings::{show_constraints, show_fddp, show_interior_point};
use super::solvers::{AugmentedLagrangian, Fddp, InteriorPoint};
use crate::arrays::{Give, class, output};
use crate::exceptions::{ProblemError, problem_error};
use condyle::optimal as rust;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rust::record::{Call, Recorded, SolverSettings};
use rust::robot::{Residual, RobotProblem};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// A record of a controller: all calls that change its problem or its solver, from the first `solve` on, and the result
/// of each tick. A replay makes the same calls on a new problem and gives the same results, bit for bit.
///
/// A record begins when it is made, before the first `solve`, and ends with `stop`. It contains the problem and the
/// settings at the beginning. Each call that solves (`solve`, `resume` or `tick`) ends a tick. `record[k]` returns tick
/// k as a `RecordedTick`: its calls with their arguments, states, controls and status. Recording copies the arguments
/// and results, about 20 kB in each tick of a quadruped with 25 knots.
///
/// Results have the same bits only on processors with the same vector extensions. A solve that its `time_budget`, a
/// callback or a signal ends early depends on the time, so its replay may differ.
///
/// solver: a solver of a robot's problem, which has not solved yet. Only calls of this solver are recorded.
///
/// Raises `ProblemError` if the problem cannot be written as JSON (see `Problem.to_json`).
///
/// >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Record, Residual
/// >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
/// >>> knot = FreeDynamics(arm, 0.02, [Cost("effort", 1.0, Residual.control(np.zeros(7)))])
/// >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [Cost("rest", 1.0, Residual.state(x0))]))
/// >>> solver = Fddp(problem, max_iterations=2)
/// >>> record = Record(solver)
/// >>> solution = solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7)))
/// >>> solver.shift(0)
/// >>> problem.set_x0(x0 + 0.01)
/// >>> solution = solver.resume()
/// >>> record.stop()
/// >>> [name for name, arguments in record[1].calls], record.replay()
/// (['shift', 'set_x0', 'resume'], None)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Record {
    inner: Shared,
    /// The problem whose calls are recorded now.
    problem: Mutex<Option<Py<Problem>>>,
    /// The number of controls of all models of the problem; `None` if models differ.
    nu: Option<usize>,
}

impl Record {
    fn from_inner(inner: rust::record::Record, problem: Option<Py<Problem>>) -> PyResult<Self> {
        let start = inner.problem();
        let models = start.knots.iter().map(|knot| Ok(knot.build(&Arc::new(start.model.clone()))?.nu()));
        let nus = models.collect::<Result<Vec<_>, _>>().map_err(problem_error)?;
        let nu = nus.first().copied().filter(|nu| nus.iter().all(|other| other == nu));
        Ok(Self { inner: Arc::new(Mutex::new(inner)), problem: Mutex::new(problem), nu })
    }

    /// Begins a record of one class of solvers.
    fn attach<S: Recorded>(py: Python<'_>, problem: &Py<Problem>, solver: &Mutex<S>) -> PyResult<Self> {
        let start = problem.get().data()?;
        let settings = lock("solver", solver)?.settings();
        let record = Self::from_inner(rust::record::Record::new(start, settings), Some(problem.clone_ref(py)))?;
        problem.get().recorder.begin(address(solver), &record.inner);
        Ok(record)
    }
}

#[pymethods]
impl Record {
    #[new]
    fn new(solver: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = solver.py();
        if let Ok(solver) = solver.cast::<InteriorPoint>() {
            return Self::attach(py, &solver.get().problem, &solver.get().solver);
        }
        if let Ok(solver) = solver.cast::<Fddp>() {
            return Self::attach(py, &solver.get().problem, &solver.get().solver);
        }
        let solver = solver.cast::<AugmentedLagrangian>()?.get();
        Self::attach(py, &solver.problem, &solver.solver)
    }

    /// Ends the record. Later calls are not recorded.
    fn stop(&self) {
        let problem = self.problem.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(problem) = problem {
            problem.get().recorder.end(&self.inner);
        }
    }

    /// Writes the record to a file, as JSON. Arrays are written as base64 of their bytes, so that no bit is lost.
    ///
    /// Raises `OSError` if the file cannot be written, and `ProblemError` if a model has a residual that is written in
    /// Python.
    fn save(&self, path: PathBuf) -> PyResult<()> {
        let text = serde_json::to_string(&*lock("record", &self.inner)?);
        Ok(std::fs::write(path, text.map_err(|error| ProblemError::new_err(error.to_string()))?)?)
    }

    /// Reads a record from a file that `save` has written.
    ///
    /// Raises `OSError` if the file cannot be read, and `ProblemError` if it contains no record, or a record of another
    /// version.
    #[staticmethod]
    fn load(path: PathBuf) -> PyResult<Self> {
        let text = std::fs::read_to_string(path)?;
        let inner =
            serde_json::from_str(&text).map_err(|error| ProblemError::new_err(format!("no record: {error}")))?;
        Self::from_inner(inner, None)
    }

    /// Returns a new problem and a new solver, as they were at the beginning of the record.
    fn start<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, Problem>, Bound<'py, PyAny>)> {
        let (start, settings) = {
            let record = lock("record", &self.inner)?;
            (record.problem().clone(), record.solver().clone())
        };
        let problem = Bound::new(py, Problem::from_data(start)?)?;
        let (class, settings, inner) = match &settings {
            SolverSettings::Fddp { settings } => (py.get_type::<Fddp>(), show_fddp(settings, py)?, None),
            SolverSettings::InteriorPoint { settings } => {
                (py.get_type::<InteriorPoint>(), show_interior_point(settings, py)?, None)
            }
            SolverSettings::AugmentedLagrangian { settings, inner } => {
                let inner = Some(show_fddp(inner, py)?);
                (py.get_type::<AugmentedLagrangian>(), show_constraints(settings, py)?, inner)
            }
            _ => return Err(ProblemError::new_err("solver: of a later version")),
        };
        let solver = class.call_method1("_make", (&problem, inner, settings))?;
        Ok((problem, solver))
    }

    /// Makes all calls on a new problem, and compares the results with the record. Returns the first `Difference`, or
    /// None if all bits are the same. Other threads can run meanwhile.
    ///
    /// Raises `ProblemError` if a call that solves fails, for example because the record began after the first solve.
    fn replay<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let record = lock("record", &self.inner)?.clone();
        let found = py.detach(|| record.replay()).map_err(problem_error)?;
        found.map(|found| class!(py, "Difference")?.call1((found.tick, found.array, found.largest))).transpose()
    }

    fn __len__(&self) -> PyResult<usize> {
        Ok(lock("record", &self.inner)?.ticks().len())
    }

    fn __getitem__<'py>(&self, py: Python<'py>, k: isize) -> PyResult<Bound<'py, PyAny>> {
        let record = lock("record", &self.inner)?;
        let ticks = record.ticks();
        let index = if k < 0 { k + ticks.len() as isize } else { k };
        let tick = usize::try_from(index).ok().and_then(|k| ticks.get(k));
        let tick = tick.ok_or_else(|| PyIndexError::new_err(format!("tick {k}: the record has {}", ticks.len())))?;
        let give = Given { py, start: record.problem(), solver: record.solver(), nu: self.nu };
        let calls = tick.calls.iter().map(|call| give.call(call)).collect::<PyResult<Vec<_>>>()?;
        class!(py, "RecordedTick")?.call1((
            PyList::new(py, calls)?,
            tick.status.name(),
            give.states(&tick.xs)?,
            give.controls(&tick.us)?,
        ))
    }

    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("<condyle.optimal.Record: {} ticks>", self.__len__()?))
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.problem.try_lock().map_or(Ok(()), |problem| visit.call(&*problem))
    }
}

/// Converter of calls to Python.
struct Given<'a, 'py> {
    py: Python<'py>,
    start: &'a RobotProblem,
    solver: &'a SolverSettings,
    nu: Option<usize>,
}

impl<'py> Given<'_, 'py> {
    fn array(&self, shape: &[usize], numbers: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        output(self.py, None, shape, |to| to.copy_from_slice(numbers))
    }

    /// Returns numbers as a matrix with the given number of rows.
    fn rows(&self, rows: usize, numbers: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        self.array(&[rows, numbers.len() / rows.max(1)], numbers)
    }

    fn states(&self, xs: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        self.rows(self.start.knot_models.len() + 1, xs)
    }

    fn controls(&self, us: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let horizon = self.start.knot_models.len();
        match self.nu.filter(|nu| nu * horizon == us.len()) {
            Some(nu) => self.array(&[horizon, nu], us),
            None => self.array(&[us.len()], us),
        }
    }

    /// Returns targets in the shape that `Problem.set_references` takes.
    fn targets(&self, name: &str, values: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.start.knot_models.len() + 1;
        let knots = self.start.knots.iter().chain([&self.start.terminal]);
        let mut costs = knots.flat_map(|knot| knot.costs.iter().chain(knot.costs_at.values().flatten()));
        let side = match costs.find(|cost| cost.name == name).map(|cost| &cost.residual) {
            Some(Residual::FrameRotation { .. }) => 3,
            Some(Residual::FramePlacement { .. }) => 4,
            _ => return self.rows(rows, values),
        };
        self.array(&[rows, side, side], values)
    }

    /// Returns the name of the method and a dict of its arguments.
    fn call(&self, call: &Call) -> PyResult<(&'static str, Bound<'py, PyDict>)> {
        let (py, to) = (self.py, PyDict::new(self.py));
        let knots = self.start.knot_models.len() + 1;
        let json = |text: Result<String, serde_json::Error>| text.map_err(|e| PyValueError::new_err(e.to_string()));
        let name = match call {
            Call::SetX0 { x0 } => {
                to.set_item("x0", self.array(&[x0.len()], x0)?)?;
                "set_x0"
            }
            Call::SetReferences { name, values } => {
                to.set_item("name", name)?;
                to.set_item("values", self.targets(name, values)?)?;
                "set_references"
            }
            Call::SetPlacements { name, values } => {
                to.set_item("name", name)?;
                to.set_item("placements", self.array(&[knots, 4, 4], values)?)?;
                "set_placements"
            }
            Call::SetWeight { name, weight } => {
                to.set_item("name", name)?;
                to.set_item("weight", weight)?;
                "set_weight"
            }
            Call::SetWeights { name, weights } => {
                to.set_item("name", name)?;
                to.set_item("weight", self.array(&[knots], weights)?)?;
                "set_weight"
            }
            Call::SetEntryWeights { name, weights } => {
                to.set_item("name", name)?;
                to.set_item("weights", self.rows(knots, weights)?)?;
                "set_entry_weights"
            }
            Call::SetParameter { name, values } => {
                to.set_item("parameter", name)?;
                to.set_item("values", self.array(&[values.len()], values)?)?;
                "set_parameter"
            }
            Call::SetContact { contact, change } => {
                to.set_item("contact", contact)?;
                let six = |motion: &condyle::Motion<f64>| motion.to_array().as_slice().give(py, None);
                to.set_item("placement", change.placement.map(|placement| placement.give(py, None)).transpose()?)?;
                to.set_item("velocity", change.velocity.as_ref().map(six).transpose()?)?;
                to.set_item("acceleration", change.acceleration.as_ref().map(six).transpose()?)?;
                match change.kp {
                    Some((_, Some(each))) => to.set_item("kp", each.as_slice().give(py, None)?)?,
                    kp => to.set_item("kp", kp.map(|(kp, _)| kp))?,
                }
                to.set_item("kd", change.kd)?;
                "set_contact"
            }
            Call::SetCosts { knot, costs } => {
                to.set_item("knot", knot)?;
                to.set_item("costs", json(serde_json::to_string(costs))?)?;
                "set_costs"
            }
            Call::SetKnot { knot, model } => {
                to.set_item("knot", knot)?;
                to.set_item("model", json(serde_json::to_string(model))?)?;
                "set_knot"
            }
            Call::SetDuration { knot, dt } => {
                to.set_item("knot", knot)?;
                to.set_item("dt", dt)?;
                "set_duration"
            }
            Call::SetKnots { knot_models, durations } => {
                to.set_item("knot_models", knot_models)?;
                to.set_item("durations", self.array(&[durations.len()], durations)?)?;
                "set_knots"
            }
            Call::Retime { elapsed, knot_models, durations } => {
                to.set_item("elapsed", elapsed)?;
                to.set_item("knot_models", knot_models)?;
                to.set_item("durations", self.array(&[durations.len()], durations)?)?;
                "retime"
            }
            Call::Reset { x0 } => {
                to.set_item("x0", self.array(&[x0.len()], x0)?)?;
                "reset"
            }
            Call::Prepare { sweeps } => {
                if matches!(self.solver, SolverSettings::InteriorPoint { .. }) {
                    to.set_item("sweeps", sweeps)?;
                }
                "prepare"
            }
            Call::Feedback { x0, most } => {
                to.set_item("x0", self.array(&[x0.len()], x0)?)?;
                if matches!(self.solver, SolverSettings::Fddp { .. }) {
                    to.set_item("most", most)?;
                }
                "feedback"
            }
            Call::Shift { last } => {
                to.set_item("last", last)?;
                "shift"
            }
            Call::Configure { settings } => {
                let (settings, inner) = match &**settings {
                    SolverSettings::Fddp { settings } => (show_fddp(settings, py)?, None),
                    SolverSettings::InteriorPoint { settings } => (show_interior_point(settings, py)?, None),
                    SolverSettings::AugmentedLagrangian { settings, inner } => {
                        (show_constraints(settings, py)?, Some(show_fddp(inner, py)?))
                    }
                    _ => return Err(ProblemError::new_err("settings: of a later version")),
                };
                to.set_item("settings", settings)?;
                if let Some(inner) = inner {
                    to.set_item("inner", inner)?;
                }
                "settings"
            }
            Call::SetMultipliers { name, values } => {
                to.set_item("name", name)?;
                let most = values.iter().map(|y| y.len()).max().unwrap_or(0);
                let mut all = vec![0.0; knots * most];
                for (row, y) in all.chunks_exact_mut(most.max(1)).zip(values) {
                    row[..y.len()].copy_from_slice(y);
                }
                to.set_item("values", self.array(&[knots, most], &all)?)?;
                "set_multipliers"
            }
            Call::Solve { xs, us } => {
                to.set_item("xs", self.states(xs)?)?;
                to.set_item("us", self.controls(us)?)?;
                "solve"
            }
            Call::Resume => "resume",
            Call::ResumeToFullStep { most } => {
                to.set_item("stop", "full_step")?;
                to.set_item("most", most)?;
                "resume"
            }
            Call::Tick { sweeps } => {
                to.set_item("sweeps", sweeps)?;
                "tick"
            }
            _ => return Err(ProblemError::new_err("call: of a later version")),
        };
        Ok((name, to))
    }
}
