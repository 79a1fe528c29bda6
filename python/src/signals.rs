//! Signals that come while a call lasts, Ctrl-C above all: Python's handlers run within the call, and what they raise ends it.

use crate::arrays::class;
use condyle::optimal as rust;
use pyo3::prelude::*;
use pyo3::types::PyBool;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// How long calls that compute with the interpreter's lock, and batches, go on without looking for signals.
pub(crate) const SHORT: Duration = Duration::from_millis(10);

/// How long solves and simulations go on without looking for signals. To look they must wait for the interpreter's lock,
/// which another thread that computes in Python gives back after 5 ms.
pub(crate) const LONG: Duration = Duration::from_millis(25);

/// The signals that come while a call lasts.
pub(crate) struct Signals {
    period: Duration,
    looked: Instant,
    /// Whether the call is on the thread that gets signals; unknown until the first look.
    main: Option<bool>,
    /// What a handler has raised.
    raised: Option<PyErr>,
}

impl Signals {
    /// A call begins that looks for signals at this period.
    pub(crate) fn new(period: Duration) -> Self {
        Self { period, looked: Instant::now(), main: None, raised: None }
    }

    /// Whether it is time to look again.
    fn is_due(&mut self) -> bool {
        let now = Instant::now();
        let due = self.main != Some(false) && now.duration_since(self.looked) >= self.period;
        if due {
            self.looked = now;
        }
        due
    }

    /// Looks for signals if it is time to; an error is what a handler has raised.
    pub(crate) fn look(&mut self, py: Python<'_>) -> PyResult<()> {
        if self.is_due() { py.check_signals() } else { Ok(()) }
    }

    /// As `look`, in a call that has released the interpreter's lock: says whether to go on, and `finish` what was raised.
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

    /// The call has ended, by itself or because a handler has raised an error.
    pub(crate) fn finish(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

/// What may end a solve: signals, an error of what is written in Python, and who looks at its iterations.
pub(crate) struct Interruptions<'a> {
    pub(crate) signals: Signals,
    /// Whether there is such an error.
    pub(crate) failed: &'a (dyn Fn() -> bool + Sync),
    /// A function of each iteration, which ends the solve if it returns False.
    pub(crate) observer: Option<Py<PyAny>>,
    /// What it has raised.
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

/// An iteration as Python sees it.
pub(crate) fn record<'py>(py: Python<'py>, i: &rust::Iteration) -> PyResult<Bound<'py, PyAny>> {
    let iteration = class!(py, "Iteration")?;
    iteration.call1((i.iteration, i.cost, i.gap, i.stop, i.step, i.regularisation, i.d1, i.d2, i.feasible, i.accepted))
}
