//! Schedules of the models of a horizon in time.

use super::problem::lock;
use crate::arrays::Give;
use crate::exceptions::{ProblemError, problem_error};
use condyle::optimal as rust;
use pyo3::prelude::*;
use std::sync::Mutex;

/// The models of a horizon in time: from each switching time on, knots have another model. A trot for example switches
/// between models that differ in their contacts.
///
/// `knots(t, count)` returns the models and durations of a horizon that begins at any time t, for `retime` of a solver.
/// Knots begin at times that do not depend on t, and no knot contains a switching time. The time between two switches
/// is divided into equal knots, whose duration is as near to the spacing as possible. Only the first knot of a horizon
/// differs: it begins at t. It takes the rest of the present knot, together with the next knot if the rest is at most
/// half the spacing and no switch follows. So later knots remain the same when the horizon moves. The number of knots
/// is constant, and the end of the horizon moves.
///
/// spacing: the duration of a knot (s).
/// model: the index of the model before the first switch.
///
/// Raises `ProblemError` if the spacing is not above 0.
///
/// >>> from condyle.optimal import Schedule
/// >>> schedule = Schedule(0.02, 0)
/// >>> schedule.switch(0.05, 1)
/// >>> schedule.switch(0.10, 0)
/// >>> models, durations = schedule.knots(0.015, 5)
/// >>> models, durations.round(6).tolist()
/// ([0, 0, 1, 1, 0], [0.015, 0.02, 0.025, 0.025, 0.02])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Schedule(Mutex<rust::Schedule>);

#[pymethods]
impl Schedule {
    #[new]
    #[pyo3(signature = (spacing, model=0))]
    fn new(spacing: f64, model: usize) -> PyResult<Self> {
        Ok(Self(Mutex::new(rust::Schedule::new(spacing, model).map_err(problem_error)?)))
    }

    /// Adds a switch. Switches at or after t are removed: a contact that occurs earlier than planned is a switch now,
    /// followed by the new switches.
    ///
    /// t: the time (s) from which on knots have the model.
    /// model: the index of the model.
    ///
    /// Raises `ProblemError` if t is not finite.
    fn switch(&self, t: f64, model: usize) -> PyResult<()> {
        lock("schedule", &self.0)?.switch(t, model).map_err(problem_error)
    }

    /// Forgets the switches before the present phase, so that the schedule does not grow.
    ///
    /// t: a time (s) in the present phase.
    fn forget(&self, t: f64) -> PyResult<()> {
        lock("schedule", &self.0)?.forget(t);
        Ok(())
    }

    /// Returns the index of the model at the time t (s).
    fn model(&self, t: f64) -> PyResult<usize> {
        Ok(lock("schedule", &self.0)?.model(t))
    }

    /// Returns the models and durations of the knots of a horizon: a list of indices and an array (s).
    ///
    /// t: the time (s) at which the horizon begins.
    /// count: the number of knots.
    ///
    /// Raises `ProblemError` if t is not finite.
    fn knots<'py>(&self, py: Python<'py>, t: f64, count: usize) -> PyResult<(Vec<usize>, Bound<'py, PyAny>)> {
        if !t.is_finite() {
            return Err(ProblemError::new_err(format!("t: expected a finite time, found {t}")));
        }
        let (mut models, mut durations) = (vec![0; count], vec![0.0; count]);
        lock("schedule", &self.0)?.write_knots(t, &mut models, &mut durations);
        Ok((models, durations.give(py, None)?))
    }

    /// The duration of a knot (s).
    #[getter]
    fn spacing(&self) -> PyResult<f64> {
        Ok(lock("schedule", &self.0)?.spacing())
    }

    /// The switches that are not forgotten: times (s), each with the model from this time on.
    #[getter]
    fn switches(&self) -> PyResult<Vec<(f64, usize)>> {
        Ok(lock("schedule", &self.0)?.switches().to_vec())
    }

    fn __repr__(&self) -> PyResult<String> {
        let schedule = lock("schedule", &self.0)?;
        let count = schedule.switches().len();
        Ok(format!("<condyle.optimal.Schedule of knots of {} s, {count} switches>", schedule.spacing()))
    }

    /// Returns the function and the arguments from which `pickle` makes an equal schedule.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let text = serde_json::to_string(&*lock("schedule", &slf.get().0)?);
        let text = text.map_err(|error| ProblemError::new_err(error.to_string()))?;
        Ok((slf.get_type().getattr("_from_text")?, (text,)))
    }

    #[staticmethod]
    fn _from_text(text: &str) -> PyResult<Self> {
        let schedule = serde_json::from_str(text).map_err(|error| ProblemError::new_err(error.to_string()))?;
        Ok(Self(Mutex::new(schedule)))
    }
}
