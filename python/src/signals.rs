//! Signals during a call, such as Ctrl-C: Python's signal handlers run within the call, and an exception of a handler
//! ends the call.

use crate::arrays::class;
use condyle::optimal as rust;
use pyo3::prelude::*;
use pyo3::types::PyBool;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Time between checks for signals, for batches and for calls that keep the interpreter's lock.
pub(crate) const SHORT: Duration = Duration::from_millis(10);

/// Time between checks for signals, for solves and simulations. A check must wait for the interpreter's lock. Another
/// thread that runs Python code releases the lock after 5 ms.
pub(crate) const LONG: Duration = Duration::from_millis(25);

/// Regular checks for signals during a call.
pub(crate) struct Signals {
    period: Duration,
    looked: Instant,
    /// Whether the call runs on the thread that receives signals; `None` until the first check.
    main: Option<bool>,
    /// Exception that a handler has raised.
    raised: Option<PyErr>,
}

impl Signals {
    /// Creates the checks of a call, one after each period.
    pub(crate) fn new(period: Duration) -> Self {
        Self { period, looked: Instant::now(), main: None, raised: None }
    }

    /// Returns whether the next check is due.
    fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let due = self.main != Some(false) && now.duration_since(self.looked) >= self.period;
        if due {
            self.looked = now;
        }
        due
    }

    /// Checks for signals if a check is due; returns the exception of a handler as an error.
    pub(crate) fn look(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.is_due() { py.check_signals() } else { Ok(()) }
    }

    /// Checks for signals if a check is due, for a call that has released the interpreter's lock. Returns whether the
    /// call shall continue; `finish` returns the exception.
    pub(crate) fn go_on(&mut self) -> ControlFlow<()> {
        if self.raised.is_some() {
            return ControlFlow::Break(());
        }
        if !self.is_due() {
            return ControlFlow::Continue(());
        }
        let looked = Python::attach(|py| {
            if self.main.is_none() {
                let threads = py.import("threading")?;
                self.main = Some(threads.call_method0("current_thread")?.is(&threads.call_method0("main_thread")?));
            }
            py.check_signals()
        });
        match looked {
            Ok(()) => ControlFlow::Continue(()),
            Err(raised) => {
                self.raised = Some(raised);
                ControlFlow::Break(())
            }
        }
    }

    /// Ends the call; returns the exception of a handler, if there is one.
    pub(crate) fn finish(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

/// Causes that may end a solve: signals, an error of a Python function, and the observer of its iterations.
pub(crate) struct Interruptions<'a> {
    pub(crate) signals: Signals,
    /// Returns whether a Python function has failed.
    pub(crate) failed: &'a (dyn Fn() -> bool + Sync),
    /// Function called after each iteration. The solve ends if the function returns False.
    pub(crate) observer: Option<Py<PyAny>>,
    /// Exception that the observer has raised.
    pub(crate) raised: Option<PyErr>,
}

impl rust::Observer for &mut Interruptions<'_> {
    fn iteration(&mut self, now: &rust::Iteration) -> ControlFlow<()> {
        if let Some(observer) = &self.observer {
            let seen = Python::attach(|py| {
                let result = observer.call1(py, (record(py, now)?,))?;
                Ok(result.bind(py).is(PyBool::new(py, false).as_any()))
            });
            match seen {
                Ok(false) => {}
                Ok(true) => return ControlFlow::Break(()),
                Err(error) => {
                    self.raised = Some(error);
                    return ControlFlow::Break(());
                }
            }
        }
        self.go_on()
    }

    fn go_on(&mut self) -> ControlFlow<()> {
        if self.raised.is_some() || (self.failed)() { ControlFlow::Break(()) } else { self.signals.go_on() }
    }
}

/// Converts an iteration to a Python object.
pub(crate) fn record<'py>(py: Python<'py>, i: &rust::Iteration) -> PyResult<Bound<'py, PyAny>> {
    let iteration = class!(py, "Iteration")?;
    iteration.call1((i.iteration, i.cost, i.gap, i.stop, i.step, i.regularisation, i.d1, i.d2, i.feasible, i.accepted))
}
