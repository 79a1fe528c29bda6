//! Policies: the feedback of a solution, which other threads can call while a solve runs.

use super::problem::{Problem, lock};
use crate::arrays::{Give, at_once, vector};
use crate::exceptions::{ProblemError, problem_error};
use condyle::optimal as rust;
use numpy::Ix1;
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};

/// The feedback u = ū + K (x ⊖ x̄) of the last published solution, as a function of time and state.
///
/// Another thread can call the policy at its own rate while a solve runs, without waiting for the solve: the solver
/// publishes a solution into memory that is not being read. `solver.publish(policy, start)` publishes the last solution
/// of a solver.
///
/// `policy(t, x)` returns the controls at the time t (s), on the clock of `start`, and at the state x: nu numbers,
/// moved into the bounds of the knot. x̄ is the plan's state at the time t, interpolated between two knots; ū and K are
/// the controls and gains of the knot. If x has a number that is not finite, u is ū without feedback. Before the first
/// knot, x̄ is the first state; after the horizon, x̄ is the last state. A call raises `ProblemError` if no solution was
/// published yet.
///
/// problem: the problem that the solver solves, of a robot.
///
/// Raises `ProblemError` if the terminal model does not belong to a robot.
///
/// >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Policy, Problem, Residual
/// >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
/// >>> knot = FreeDynamics(arm, 0.02, [Cost("effort", 1.0, Residual.control(np.zeros(7)))])
/// >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [Cost("rest", 1.0, Residual.state(x0))]))
/// >>> solver, policy = Fddp(problem), Policy(problem)
/// >>> solution = solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7)))
/// >>> solver.publish(policy, start=3.0)
/// >>> policy(3.01, x0 + 1e-3).shape
/// (7,)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Policy {
    pub(super) publisher: Mutex<rust::PolicyPublisher>,
    reader: Mutex<rust::Policy>,
    nx: usize,
}

#[pymethods]
impl Policy {
    #[new]
    fn new(problem: &Bound<'_, Problem>) -> PyResult<Self> {
        if problem.get().space.is_none() {
            return Err(ProblemError::new_err(
                "terminal: expected an action of a robot, whose states are interpolated",
            ));
        }
        let problem = lock("problem", &problem.get().inner)?;
        let publisher = rust::PolicyPublisher::new(&problem).map_err(problem_error)?;
        let reader = publisher.policy();
        Ok(Self { publisher: Mutex::new(publisher), reader: Mutex::new(reader), nx: problem.nx() })
    }

    fn __call__<'py>(&self, t: f64, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut u = Vec::new();
        let mut control = |x: &[f64]| {
            // only this method locks the reader, and it keeps the interpreter's lock meanwhile: no thread waits long
            let mut reader = self.reader.lock().unwrap_or_else(PoisonError::into_inner);
            reader.control_into(t, x, &mut u)
        };
        let point = match at_once::<Ix1>(x, &[self.nx]) {
            Some(x) => control(&x),
            None => control(&vector("x", x, self.nx)?),
        };
        point.ok_or_else(|| ProblemError::new_err("no solution was published yet: call solver.publish(policy)"))?;
        u.give(x.py(), None)
    }

    /// The time of the end of the published plan (s); None before the first plan. A plan is too old after this time.
    #[getter]
    fn end(&self) -> Option<f64> {
        self.reader.lock().unwrap_or_else(PoisonError::into_inner).end()
    }
}
