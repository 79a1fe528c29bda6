//! Solutions of many problems of one shape, several at a time in SIMD lanes or one by one.

use super::evaluation::named_controls;
use super::problem::{Problem, lock};
use super::solvers::{AugmentedLagrangian, Fddp, InteriorPoint};
use crate::arrays::{matrix, place, writable};
use crate::exceptions::problem_error;
use crate::signals::{self, Signals};
use condyle::optimal as rust;
use pyo3::exceptions::{PyArithmeticError, PyKeyError, PyLookupError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rust::{BatchFddp, ManyProblems, OneByOne, SingleSolver, Solution};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Names of the arrays of a solution that may be kept.
const ARRAYS: [&str; 4] = ["xs", "us", "K", "k"];

/// Names of the numbers of each solution that are always kept.
const NUMBERS: [&str; 3] = ["cost", "gap", "seconds"];

/// Numbers in a placement, a homogeneous matrix row by row.
const PLACEMENT: usize = 16;

/// Solves variations of a problem: see `condyle.optimal.solve_many` and `condyle.sweep`.
///
/// solver: an `Fddp`, `InteriorPoint` or `AugmentedLagrangian` of the nominal problem, with the settings of all solves.
/// count: the number V of variations.
/// data: arrays with a row for each variation: "x0" (V, nx), and lists of pairs (name, numbers): "references" and
///     "weights" of costs, with the numbers of all knots in a row; "contacts", placements (V, 3) or (V, 16). Also
///     "xs" and "us", the states and controls of a start for each variation, in a row.
/// start: the states and controls from which all variations start; None if `data` has a start for each variation.
/// vary: None, or a function of the problem and an item that changes the problem or returns another one.
/// items: the arguments of `vary`.
/// keep: the arrays of each solution to keep.
/// report: None, or a function that is called with the number of variations that have ended.
/// whole: whether the time budget of the solver applies to the whole call. If not, it applies to each solve.
///
/// Returns the columns of `Variations`, without `error`; the status of a variation that did not start is empty. Also
/// returns the exceptions of the variations that failed, as pairs (index, exception).
#[pyfunction(name = "_solve_many")]
#[pyo3(signature = (solver, count, data, start, vary, keep, threads, report, whole=false))]
pub(crate) fn solve_variations<'py>(
    py: Python<'py>,
    solver: &Bound<'py, PyAny>,
    count: usize,
    data: &Bound<'py, PyDict>,
    start: Option<[Bound<'py, PyAny>; 2]>,
    vary: Option<(Py<PyAny>, Py<PyList>)>,
    keep: Vec<String>,
    threads: usize,
    report: Option<Py<PyAny>>,
    whole: bool,
) -> PyResult<(Bound<'py, PyDict>, Errors)> {
    let shell = Shell::of(solver)?;
    let problem = shell.problem.get();
    let inner = lock("problem", &problem.inner)?;
    let (horizon, nx, ndx) = (inner.horizon(), inner.nx(), inner.ndx());
    let start = match &start {
        Some([xs, us]) => {
            let xs = matrix("start: xs", xs, [horizon + 1, nx])?.to_vec();
            Some([xs, named_controls("start: us", &inner, us)?])
        }
        None => None,
    };
    let batch = shell.batch(&inner, threads.min(count.max(1)), start, whole)?;
    let gains = (0..horizon).map(|t| inner.nu(t) * ndx).sum();
    let controls = inner.control_range(horizon).end;
    let sizes = [(horizon + 1) * nx, controls, gains, controls];
    drop(inner);

    let array = |key: &str, argument: &str, size: usize| -> PyResult<Option<Vec<f64>>> {
        let Some(numbers) = data.get_item(key)? else { return Ok(None) };
        Ok(Some(matrix(argument, &numbers, [count, size])?.to_vec()))
    };
    let starts = [array("xs", "start: xs", sizes[0])?, array("us", "start: us", sizes[1])?];
    let x0 = array("x0", "x0", nx)?;
    let [references, weights, placements] = ["references", "weights", "contacts"].map(|name| rows(data, name, count));
    let mut kept = Vec::new();
    for name in NUMBERS {
        kept.push((name, 1, place(py, None, &[count])?));
    }
    for (name, size) in ARRAYS.into_iter().zip(sizes).filter(|(name, _)| keep.iter().any(|kept| kept == name)) {
        kept.push((name, size, place(py, None, &[count, size])?));
    }
    let mut borrowed = kept.iter().map(|(_, _, array)| writable(array)).collect::<PyResult<Vec<_>>>()?;
    let mut arrays = Vec::new();
    for ((name, size, _), array) in kept.iter().zip(&mut borrowed) {
        let numbers = array.as_slice_mut()?;
        numbers.fill(f64::NAN);
        arrays.push((*name, *size, numbers));
    }
    let columns = Columns { status: vec![""; count], iterations: vec![0; count], arrays, errors: Vec::new() };
    let many = Many {
        shell: shell.problem,
        x0,
        starts,
        references: references?,
        weights: weights?,
        placements: placements?,
        vary,
        returned: Mutex::new(Vec::new()),
        columns: Mutex::new(columns),
        signals: Mutex::new((Signals::new(signals::LONG), None)),
        ended: AtomicUsize::new(0),
        is_stopped: AtomicBool::new(false),
        report,
    };
    let solved = py.detach(|| batch(count, &many).map(drop));
    let Many { columns, signals, .. } = many;
    let (signals, raised) = signals.into_inner().unwrap_or_else(PoisonError::into_inner);
    signals.finish()?;
    raised.map_or(Ok(()), Err)?;
    problem.raise()?;
    solved.map_err(problem_error)?;
    let Columns { status, iterations, mut errors, .. } = columns.into_inner().unwrap_or_else(PoisonError::into_inner);
    if let Some(k) = errors.iter().position(|(_, error)| !is_expected(py, error)) {
        return Err(errors.swap_remove(k).1);
    }
    drop(borrowed);
    let found = PyDict::new(py);
    found.set_item("status", status)?;
    found.set_item("iterations", iterations)?;
    for (name, _, array) in kept {
        found.set_item(name, array)?;
    }
    Ok((found, errors))
}

/// Function that solves a number of variations.
type Batch = Box<dyn FnOnce(usize, &Many<'_>) -> Result<usize, rust::Error> + Send>;

/// Nominal problem and settings of the solves, of any class of solvers.
struct Shell<'a> {
    problem: &'a Py<Problem>,
    solver: AnySolver<'a>,
}

/// Solver of any class.
enum AnySolver<'a> {
    Fddp(&'a Mutex<rust::Fddp>),
    InteriorPoint(&'a Mutex<rust::InteriorPoint>),
    AugmentedLagrangian(&'a Mutex<rust::AugmentedLagrangian>),
}

impl<'a> Shell<'a> {
    /// Returns the parts of a Python solver.
    fn of(solver: &'a Bound<'_, PyAny>) -> PyResult<Self> {
        Ok(if let Ok(solver) = solver.cast::<Fddp>() {
            Self { problem: &solver.get().problem, solver: AnySolver::Fddp(&solver.get().solver) }
        } else if let Ok(solver) = solver.cast::<InteriorPoint>() {
            Self { problem: &solver.get().problem, solver: AnySolver::InteriorPoint(&solver.get().solver) }
        } else {
            let solver = solver.cast::<AugmentedLagrangian>()?.get();
            Self { problem: &solver.problem, solver: AnySolver::AugmentedLagrangian(&solver.solver) }
        })
    }

    /// Returns a function that solves variations with these settings. FDDP solves several variations at a time in
    /// lanes, if no setting forbids this: segments, and a time budget of each solve. The time budget is the budget of
    /// all solves if `whole` is set.
    fn batch(
        &self,
        problem: &rust::Problem,
        threads: usize,
        start: Option<[Vec<f64>; 2]>,
        whole: bool,
    ) -> PyResult<Batch> {
        match &self.solver {
            AnySolver::Fddp(solver) => {
                let solver = lock("solver", solver)?;
                if solver.settings.segments > 1 || solver.settings.time_budget.is_some() && !whole {
                    return one_by_one(problem, threads, start, solver.clone(), whole, |s| &mut s.settings.time_budget);
                }
                let mut batch = BatchFddp::new(problem, threads).map_err(problem_error)?;
                batch.settings = solver.settings.clone();
                if let Some([xs, us]) = start {
                    batch.set_start(&xs, &us).map_err(problem_error)?;
                }
                Ok(Box::new(move |count, many| batch.solve(count, many)))
            }
            AnySolver::InteriorPoint(solver) => {
                let solver = lock("solver", solver)?.clone();
                one_by_one(problem, threads, start, solver, whole, |solver| &mut solver.settings.time_budget)
            }
            AnySolver::AugmentedLagrangian(solver) => {
                let solver = lock("solver", solver)?.clone();
                one_by_one(problem, threads, start, solver, whole, |solver| &mut solver.inner.time_budget)
            }
        }
    }
}

/// Returns a function that solves variations one by one on each thread. If `whole` is set, the solver's time budget
/// limits all solves together.
fn one_by_one<S: SingleSolver + 'static>(
    problem: &rust::Problem,
    threads: usize,
    start: Option<[Vec<f64>; 2]>,
    solver: S,
    whole: bool,
    budget: fn(&mut S) -> &mut Option<Duration>,
) -> PyResult<Batch> {
    let mut many = OneByOne::<S>::new(problem, threads).map_err(problem_error)?;
    many.solver = solver;
    if whole {
        many.time_budget = budget(&mut many.solver).take();
    }
    if let Some([xs, us]) = start {
        many.set_start(&xs, &us).map_err(problem_error)?;
    }
    Ok(Box::new(move |count, variations| many.solve(count, variations)))
}

/// Returns the numbers of each name in the list `name`, which has a row for each variation.
fn rows(data: &Bound<'_, PyDict>, name: &str, count: usize) -> PyResult<Vec<(String, Vec<f64>)>> {
    let mut all = Vec::new();
    let Some(list) = data.get_item(name)? else { return Ok(all) };
    for (cost, numbers) in list.extract::<Vec<(String, Bound<'_, PyAny>)>>()? {
        let columns = numbers.getattr("shape")?.get_item(1)?.extract()?;
        all.push((cost, matrix(name, &numbers, [count, columns])?.to_vec()));
    }
    Ok(all)
}

/// Variations that are being solved.
struct Many<'a> {
    /// Problem that is passed to `vary`.
    shell: &'a Py<Problem>,
    x0: Option<Vec<f64>>,
    /// States and controls from which each variation starts.
    starts: [Option<Vec<f64>>; 2],
    references: Vec<(String, Vec<f64>)>,
    weights: Vec<(String, Vec<f64>)>,
    /// Placements of contacts. For each variation 3 numbers of a position, or the 16 numbers of a homogeneous matrix.
    placements: Vec<(String, Vec<f64>)>,
    vary: Option<(Py<PyAny>, Py<PyList>)>,
    /// Problems that `vary` has returned, with the index of their variation, until they are solved.
    returned: Mutex<Vec<(usize, Py<Problem>)>>,
    columns: Mutex<Columns<'a>>,
    /// Checks for signals, and the exception that ends the call.
    signals: Mutex<(Signals, Option<PyErr>)>,
    /// Number of variations that have ended.
    ended: AtomicUsize,
    /// Whether an exception that is not the fault of a variation ends the call.
    is_stopped: AtomicBool,
    report: Option<Py<PyAny>>,
}

/// Exceptions of the variations that failed, with their indices.
type Errors = Vec<(usize, PyErr)>;

/// Columns of the results.
struct Columns<'a> {
    status: Vec<&'static str>,
    iterations: Vec<usize>,
    /// Name, numbers for each variation, and the numbers of all variations.
    arrays: Vec<(&'static str, usize, &'a mut [f64])>,
    errors: Errors,
}

/// Exception of a variation.
struct Excluded(PyErr);

impl From<rust::Error> for Excluded {
    fn from(error: rust::Error) -> Self {
        Self(problem_error(error))
    }
}

impl From<PyErr> for Excluded {
    fn from(error: PyErr) -> Self {
        Self(error)
    }
}

impl Many<'_> {
    /// Calls `vary` for variation i. `problem` is exchanged with the problem of the Python object meanwhile. If `vary`
    /// returns another problem, `problem` is exchanged with it until it is solved.
    fn change(&self, i: usize, problem: &mut rust::Problem) -> PyResult<()> {
        let Some((vary, items)) = &self.vary else { return Ok(()) };
        // locked before the interpreter, so that no other thread exchanges problems while `vary` runs
        let mut returned = self.returned.lock().unwrap_or_else(PoisonError::into_inner);
        let exchange = |object: &Py<Problem>, problem: &mut rust::Problem| -> PyResult<()> {
            std::mem::swap(&mut *lock("problem", &object.get().inner)?, problem);
            Ok(())
        };
        let result: PyResult<Option<Py<Problem>>> = Python::attach(|py| {
            exchange(self.shell, problem)?;
            let described = lock("problem", &self.shell.get().described)?.clone();
            let result = items.bind(py).get_item(i).and_then(|item| vary.call1(py, (self.shell, item)));
            exchange(self.shell, problem)?;
            *lock("problem", &self.shell.get().described)? = described; // `vary` may have changed the descriptions
            let result = result?;
            if result.is_none(py) || result.is(self.shell) {
                return Ok(None);
            }
            let other = result
                .bind(py)
                .cast::<Problem>()
                .map_err(|_| PyTypeError::new_err("vary: expected a Problem or None to be returned"))?;
            Ok(Some(other.clone().unbind()))
        });
        if let Some(other) = result? {
            exchange(&other, problem)?;
            returned.push((i, other));
        }
        Ok(())
    }
}

impl ManyProblems for Many<'_> {
    type Error = Excluded;

    fn start(&self, i: usize, problem: &mut rust::Problem, xs: &mut [f64], us: &mut [f64]) -> Result<(), Excluded> {
        let nx = problem.nx();
        self.change(i, problem)?;
        let row = |numbers: &[f64], count: usize| i * (numbers.len() / count)..(i + 1) * (numbers.len() / count);
        let count = self.columns.lock().unwrap_or_else(PoisonError::into_inner).status.len();
        for (to, starts) in [&mut *xs, us].into_iter().zip(&self.starts) {
            if let Some(starts) = starts {
                to.copy_from_slice(&starts[row(starts, count)]);
            }
        }
        if let Some(x0) = &self.x0 {
            problem.set_x0(&x0[row(x0, count)])?;
        }
        for (name, numbers) in &self.references {
            found("cost", name, problem.set_references(name, &numbers[row(numbers, count)])?)?;
        }
        for (name, numbers) in &self.weights {
            found("cost", name, problem.set_weights(name, &numbers[row(numbers, count)])?)?;
        }
        for (name, numbers) in &self.placements {
            let numbers = &numbers[row(numbers, count)];
            let change = |contact: &mut condyle::ContactConstraint| place_contact(contact, numbers);
            found("contact", name, problem.change_contacts(name, change)?)?;
        }
        if problem.nx() == nx && xs.len() >= nx {
            xs[..nx].copy_from_slice(problem.x0());
        }
        Ok(())
    }

    fn solved(&self, i: usize, problem: &mut rust::Problem, result: Result<&Solution, Excluded>) {
        let mut returned = self.returned.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(k) = returned.iter().position(|(index, _)| *index == i) {
            let (_, other) = returned.swap_remove(k);
            if let Ok(mut inner) = other.get().inner.lock() {
                std::mem::swap(&mut *inner, problem);
            }
            Python::attach(|_| drop(other));
        }
        drop(returned);
        self.ended.fetch_add(1, Ordering::Relaxed);
        if let Err(Excluded(error)) = &result
            && !Python::attach(|py| is_expected(py, error))
        {
            self.is_stopped.store(true, Ordering::Relaxed);
        }
        let mut columns = self.columns.lock().unwrap_or_else(PoisonError::into_inner);
        let solution = match result {
            Ok(solution) => solution,
            Err(Excluded(error)) => {
                columns.status[i] = "error";
                return columns.errors.push((i, error));
            }
        };
        columns.status[i] = solution.status.name();
        columns.iterations[i] = solution.trace.len();
        for (name, size, numbers) in &mut columns.arrays {
            let to = &mut numbers[i * *size..][..*size];
            match *name {
                "cost" => to[0] = solution.cost,
                "gap" => to[0] = solution.gap,
                "seconds" => to[0] = solution.timings.total.as_secs_f64(),
                "xs" => to.copy_from_slice(&solution.xs),
                "us" => to.copy_from_slice(&solution.us),
                "k" => to.iter_mut().zip(solution.k.iter().flat_map(|k| k.iter())).for_each(|(to, k)| *to = *k),
                _ => {
                    let rows = solution.K.iter().flat_map(|K| K.row_iter());
                    let numbers = rows.flat_map(|row| row.iter().copied().collect::<Vec<_>>());
                    to.iter_mut().zip(numbers).for_each(|(to, K)| *to = K);
                }
            }
        }
    }

    fn go_on(&self) -> ControlFlow<()> {
        if self.is_stopped.load(Ordering::Relaxed) || self.shell.get().has_failed() {
            return ControlFlow::Break(());
        }
        let Ok(mut signals) = self.signals.try_lock() else { return ControlFlow::Continue(()) };
        let (signals, raised) = &mut *signals;
        if let Some(report) = &self.report {
            *raised = Python::attach(|py| report.call1(py, (self.ended.load(Ordering::Relaxed),)).err());
        }
        if raised.is_some() { ControlFlow::Break(()) } else { signals.go_on() }
    }
}

/// Sets the position of a contact's target, or its placement from a homogeneous matrix.
fn place_contact(contact: &mut condyle::ContactConstraint, numbers: &[f64]) {
    let placement = &mut contact.target.placement;
    if numbers.len() < PLACEMENT {
        placement.translation = condyle::Vec3::new(numbers[0], numbers[1], numbers[2]);
        return;
    }
    let column = |k: usize| condyle::Vec3::new(numbers[k], numbers[4 + k], numbers[8 + k]);
    placement.rotation = condyle::spatial::Mat3 { x: column(0), y: column(1), z: column(2) };
    placement.translation = column(3);
}

/// Returns an error for a cost or a contact that no knot has.
fn found(kind: &str, name: &str, exists: bool) -> PyResult<()> {
    if exists { Ok(()) } else { Err(PyKeyError::new_err(format!("no knot has a {kind} '{name}'"))) }
}

/// Returns whether an exception is the fault of a variation, and does not end the call.
fn is_expected(py: Python<'_>, error: &PyErr) -> bool {
    error.is_instance_of::<PyArithmeticError>(py)
        || error.is_instance_of::<PyLookupError>(py)
        || error.is_instance_of::<PyTypeError>(py)
        || error.is_instance_of::<PyValueError>(py)
        || error.is_instance_of::<crate::exceptions::Error>(py)
}
