//! One solve: its observer, the signals that interrupt it, and the errors of Python functions.

use super::evaluation::{controls, solution as give};
use super::problem::{Problem, lock};
use super::recorder::{address, kept};
use crate::arrays::matrix;
use crate::exceptions::problem_error;
use crate::signals::{self, Interruptions, Signals};
use condyle::optimal as rust;
use pyo3::prelude::*;
use rust::record::{Call, Recorded};
use std::sync::Mutex;

/// The output that a user wants after each iteration of a solve.
#[derive(Default)]
pub(super) struct Observer<'py> {
    pub(super) callback: Option<Bound<'py, PyAny>>,
    pub(super) verbose: bool,
    pub(super) progress: bool,
}

impl Observer<'_> {
    /// Returns a function that the solve calls after each iteration; `None` if the user wants no output.
    fn start(&self, py: Python<'_>) -> PyResult<Option<Py<PyAny>>> {
        let Self { callback, verbose, progress } = self;
        match (callback, verbose | progress) {
            (None, false) => Ok(None),
            (Some(callback), false) => Ok(Some(callback.clone().unbind())),
            _ => {
                let reporter = py.import("condyle._report")?.getattr("Reporter")?;
                Ok(Some(reporter.call1((callback, *verbose, *progress))?.unbind()))
            }
        }
    }
}

/// The trajectory from which a solve starts.
pub(super) enum Start<'a, 'py> {
    /// A warm start (xs, us).
    From([&'a Bound<'py, PyAny>; 2]),
    /// The last trajectory, by the given call.
    Last(Call),
}

/// Runs a solve, and records it if there is a record. Other Python threads can run meanwhile.
pub(super) fn run<'py, S: Send + Recorded>(
    py: Python<'py>,
    problem: &Py<Problem>,
    solver: &Mutex<S>,
    start: Start<'_, '_>,
    observer: Observer<'py>,
    solve: impl for<'a> FnOnce(
        &'a mut S,
        &mut rust::Problem,
        [&[f64]; 2],
        &mut Interruptions<'_>,
    ) -> Result<&'a rust::Solution, rust::Error>
    + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let mut inner = lock("problem", &problem.get().inner)?;
    let (recorder, recorded) = (&problem.get().recorder, address(solver));
    let mut solver = lock("solver", solver)?;
    let (mut x, mut u) = (vec![], vec![]);
    if let Start::From([xs, us]) = start {
        x = matrix("xs", xs, [inner.horizon() + 1, inner.nx()])?.to_vec();
        u = controls(&inner, us)?;
    }
    let (inner, solver) = (&mut *inner, &mut *solver);
    let solved = |interruptions: &mut Interruptions<'_>| solve(solver, inner, [&x, &u], interruptions).map(drop);
    let result = observe(py, problem, observer, solved);
    recorder.note_tick(recorded, result.is_ok().then_some(&*solver), || match start {
        Start::From(_) => Call::Solve { xs: kept(&x), us: kept(&u) },
        Start::Last(call) => call,
    });
    result?;
    give(py, problem, inner, solver.solution())
}

/// Runs a call of a solver that signals and errors of Python functions may end. Other Python threads can run meanwhile.
pub(super) fn observe<'py, T: Send>(
    py: Python<'py>,
    problem: &Py<Problem>,
    observer: Observer<'py>,
    call: impl FnOnce(&mut Interruptions<'_>) -> Result<T, rust::Error> + Send,
) -> PyResult<T> {
    let closes = observer.verbose || observer.progress;
    let failed = || problem.get().has_failed();
    let signals = Signals::new(signals::LONG);
    let mut interruptions = Interruptions { signals, failed: &failed, observer: observer.start(py)?, raised: None };
    let result = py.detach(|| call(&mut interruptions));
    let raised = problem.get().raise(); // called in every case: it also clears the stored error
    let Interruptions { signals, observer, raised: by_observer, .. } = interruptions;
    if let Some(observer) = observer.filter(|_| closes) {
        observer.call_method0(py, "close")?;
    }
    signals.finish()?;
    raised?;
    by_observer.map_or(Ok(()), Err)?;
    result.map_err(problem_error)
}
