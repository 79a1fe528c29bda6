//! The policy of a controller as a Python class.

use crate::arrays::{Give, at_once, vector};
use condyle::mpc as rust;
use numpy::Ix1;
use pyo3::prelude::*;
use rust::EffortSource;
use std::sync::{Mutex, PoisonError};

/// The efforts of a robot's joints as a function of time and state: the feedback of the latest plan, within the limits
/// of the robot.
///
/// `policy(t, x)` returns the efforts of all joints but the free-flyer's, at the time t (s) and the state x = (q, v).
/// Another thread can call it while a plan is computed; a call never waits. All efforts are finite and within the
/// limits. After the end of the plan, after `stop()` or without a plan, the policy damps the joints. If x has a number
/// that is not finite, the policy returns the efforts of the plan without feedback. `source` tells which of these the
/// last call returned.
#[pyclass(frozen, module = "condyle.mpc")]
pub(crate) struct JointPolicy {
    inner: Mutex<(rust::Policy, EffortSource)>,
    nx: usize,
    nu: usize,
}

#[pymethods]
impl JointPolicy {
    fn __call__<'py>(&self, t: f64, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let mut tau = vec![0.0; self.nu];
        let mut control = |x: &[f64]| {
            let (policy, source) = &mut *self.inner.lock().unwrap_or_else(PoisonError::into_inner);
            *source = policy.control(t, x, &mut tau);
        };
        match at_once::<Ix1>(x, &[self.nx]) {
            Some(x) => control(&x),
            None => control(&vector("x", x, self.nx)?),
        }
        tau.give(x.py(), None)
    }

    /// Makes the policy damp the joints from now on, as an emergency stop, until `release`.
    fn stop(&self) {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).0.stop();
    }

    /// Makes the policy follow the plan again after `stop`.
    fn release(&self) {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).0.release();
    }

    /// The source of the efforts of the last call: 'plan', 'open_loop' (the plan without feedback) or 'damping'.
    #[getter]
    fn source(&self) -> &'static str {
        match self.inner.lock().unwrap_or_else(PoisonError::into_inner).1 {
            EffortSource::Plan => "plan",
            EffortSource::OpenLoop => "open_loop",
            _ => "damping",
        }
    }

    /// The time of the end of the plan (s); None before the first plan.
    #[getter]
    fn end(&self) -> Option<f64> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner).0.end()
    }
}

impl JointPolicy {
    /// Returns a policy that a controller has made, for states of nx numbers and nu efforts.
    pub(super) fn new(policy: rust::Policy, nx: usize, nu: usize) -> Self {
        Self { inner: Mutex::new((policy, EffortSource::Damping)), nx, nu }
    }
}
