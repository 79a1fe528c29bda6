//! Rollouts of many control sequences.

use super::evaluation::common_nu;
use super::problem::{Problem, lock};
use crate::arrays::{class, matrix, place, tensor, vector, writable};
use crate::exceptions::problem_error;
use crate::signals::{self, Signals};
use condyle::optimal as rust;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rust::{RolloutResults, Rollouts};

/// Number of sequences between two checks for signals.
const CHUNK: usize = 256;

/// Simulates many control sequences on the dynamics of a problem, with the costs of the problem.
///
/// Several sequences are computed together in SIMD lanes. The result of a sequence does not depend on the other ones.
///
/// problem: the problem. Its initial state is used where x0 is None.
/// us: the controls of B sequences, (B, N, nu); or (B, Σ nu), where the controls of all knots follow one another, as
///     for knots that differ in nu. Controls are not moved into their bounds.
/// x0: the initial state of all sequences, nx numbers; or of each sequence, (B, nx); None is the problem's.
/// states: whether to return the states.
/// gradients: whether to return the gradients of the costs.
/// threads: the number of threads.
///
/// Returns `ManyRollouts`. A sequence that diverges has an infinite cost and does not affect the others: its numbers
/// are not finite or exceed 1e30.
///
/// Other Python threads can run meanwhile. An exception of a signal handler, such as KeyboardInterrupt, ends the call.
///
/// Raises `ProblemError` if x0 is not finite or contains a rotation whose length is not 1, and for an `Action` or
/// another action written in Python, which cannot be copied.
///
/// >>> from condyle.optimal import Cost, FreeDynamics, Problem, Residual, rollout_many
/// >>> arm, x0 = condyle.robots.arm7(), np.zeros(14)
/// >>> effort = Cost("effort", 1e-4, Residual.control(np.zeros(7)))
/// >>> problem = Problem(x0, [FreeDynamics(arm, 0.02, [effort])], [0] * 25, FreeDynamics(arm, None, []))
/// >>> us = np.random.default_rng(0).normal(size=(1000, 25, 7))
/// >>> found = rollout_many(problem, us, gradients=True)
/// >>> found.costs.shape, found.xs.shape, found.du.shape
/// ((1000,), (1000, 26, 14), (1000, 25, 7))
#[pyfunction]
#[pyo3(signature = (problem, us, x0=None, *, states=true, gradients=false, threads=1))]
pub(crate) fn rollout_many<'py>(
    py: Python<'py>,
    problem: &Problem,
    us: &Bound<'py, PyAny>,
    x0: Option<&Bound<'py, PyAny>>,
    states: bool,
    gradients: bool,
    threads: i64,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(threads) = usize::try_from(threads).ok().filter(|threads| *threads > 0) else {
        return Err(PyValueError::new_err(format!("threads: expected at least 1, found {threads}")));
    };
    let inner = lock("problem", &problem.inner)?;
    let (horizon, nx, ndx) = (inner.horizon(), inner.nx(), inner.ndx());
    let length = inner.control_range(horizon).end;
    let us_shape = shape_of("us", us)?;
    let count = us_shape.first().copied().unwrap_or(0);
    let us_nu = common_nu(&inner).filter(|_| us_shape.len() != 2);
    let us: Vec<f64> = match us_nu {
        Some(nu) => tensor("us", us, [count, horizon, nu])?.to_vec(),
        None => matrix("us", us, [count, length])?.to_vec(),
    };
    let x0 = match x0 {
        None => inner.x0().to_vec(),
        Some(x0) if shape_of("x0", x0)?.len() == 2 => matrix("x0", x0, [count, nx])?.to_vec(),
        Some(x0) => vector("x0", x0, nx)?.to_vec(),
    };
    let mut rollouts = Rollouts::new(&inner, threads.min(count.max(1))).map_err(problem_error)?;
    drop(inner);

    let place = |wanted: bool, shape: &[usize]| wanted.then(|| place(py, None, shape)).transpose();
    let controls = us_nu.map_or(vec![count, length], |nu| vec![count, horizon, nu]);
    let arrays = [
        place(true, &[count])?,
        place(states, &[count, horizon + 1, nx])?,
        place(gradients, &controls)?,
        place(gradients, &[count, ndx])?,
    ];
    let mut borrowed = Vec::new();
    for array in &arrays {
        borrowed.push(array.as_ref().map(writable).transpose()?);
    }
    let mut slices: [&mut [f64]; 4] = Default::default();
    for (slice, array) in slices.iter_mut().zip(&mut borrowed) {
        if let Some(array) = array {
            *slice = array.as_slice_mut()?;
        }
    }
    let mut signals = Signals::new(signals::LONG);
    let done = py.detach(|| -> Result<(), rust::Error> {
        for first in (0..count).step_by(CHUNK) {
            let size = CHUNK.min(count - first);
            let [costs, xs, du, dx0] = slices.each_mut().map(|rest| {
                let each = rest.len() / (count - first);
                rest.split_off_mut(..size * each).unwrap_or_default()
            });
            let x0 = if x0.len() == nx { &x0[..] } else { &x0[first * nx..][..size * nx] };
            rollouts.run(x0, &us[first * length..][..size * length], RolloutResults { costs, xs, du, dx0 })?;
            if problem.has_failed() || signals.go_on().is_break() {
                break;
            }
        }
        Ok(())
    });
    problem.raise()?;
    signals.finish()?;
    done.map_err(problem_error)?;
    drop(borrowed);
    class!(py, "ManyRollouts")?.call1(PyTuple::new(py, arrays)?)
}

/// Returns the shape of an array, or of the array that NumPy makes from lists.
fn shape_of(argument: &str, values: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
    let py = values.py();
    if values.is_none() {
        return Err(PyTypeError::new_err(format!("{argument}: expected an array of real numbers, found None")));
    }
    let array = py.import("numpy")?.call_method1("asarray", (values,)).map_err(|error| {
        match error.is_instance_of::<PyValueError>(py) {
            true => PyValueError::new_err(format!("{argument}: {}", error.value(py))),
            false => error,
        }
    })?;
    array.getattr("shape")?.extract()
}
