//! Reads settings, and returns reports: the named tuples of `condyle._mpc`.

use crate::arrays::class;
use condyle::mpc as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use rust::TickStatus;

/// Returns a report as the named tuple `Report`.
pub(super) fn give_report<'py>(py: Python<'py>, report: &rust::Report) -> PyResult<Bound<'py, PyAny>> {
    let status = match report.status {
        TickStatus::NoPlan => "no_plan",
        TickStatus::Planned => "planned",
        TickStatus::Fallback => "fallback",
        TickStatus::InvalidState => "invalid_state",
        TickStatus::Restarted => "restarted",
        _ => "failed",
    };
    let solver = report.solver.map(|status| status.to_string());
    let seconds = [report.references, report.solve].map(|time| time.as_secs_f64());
    let stands = PyTuple::new(py, &report.stands)?;
    let command = PyTuple::new(py, report.command)?;
    let (time, iterations, [references, solve]) = (report.time, report.iterations, seconds);
    let members = (status, time, solver, iterations, report.gap, report.cost, references, solve, stands, command);
    class!(py, "condyle._mpc", "Report")?.call1(members)
}

/// Reads `Weights`.
pub(super) fn read_weights(given: &Bound<'_, PyAny>) -> PyResult<rust::Weights> {
    let one = |name: &str| given.getattr(name)?.extract::<f64>();
    let two = |name: &str| given.getattr(name)?.extract::<[f64; 2]>();
    Ok(rust::Weights {
        place: one("place")?,
        height: one("height")?,
        tilt: one("tilt")?,
        heading: one("heading")?,
        forwards: one("forwards")?,
        sideways: one("sideways")?,
        vertical: one("vertical")?,
        rotation: one("rotation")?,
        legs: two("legs")?,
        upper_body: two("upper_body")?,
        effort: one("effort")?,
        swing: two("swing")?,
        level: one("level")?,
        end: one("end")?,
    })
}

/// Reads `ArmWeights`.
pub(super) fn read_arm_weights(given: &Bound<'_, PyAny>) -> PyResult<rust::ArmWeights> {
    let one = |name: &str| given.getattr(name)?.extract::<f64>();
    Ok(rust::ArmWeights {
        position: one("position")?,
        rotation: one("rotation")?,
        posture: one("posture")?,
        velocity: one("velocity")?,
        effort: one("effort")?,
    })
}

/// Limits that a plan keeps: the word 'model', `PlanLimits`, or None.
pub(super) struct Limits(pub rust::PlanLimits);

impl Limits {
    /// All limits of the model.
    pub(super) const MODEL: Self = Self(rust::PlanLimits { efforts: true, positions: true, velocities: true });
}

impl<'py> FromPyObject<'_, 'py> for Limits {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if given.is_none() {
            return Ok(Self(rust::PlanLimits { efforts: false, positions: false, velocities: false }));
        }
        if let Ok(word) = given.extract::<String>() {
            return match &*word {
                "model" => Ok(Self::MODEL),
                _ => {
                    Err(PyValueError::new_err(format!("limits: expected 'model', PlanLimits or None, found '{word}'")))
                }
            };
        }
        let one = |name: &str| given.getattr(name)?.extract::<bool>();
        let [efforts, positions, velocities] = [one("efforts")?, one("positions")?, one("velocities")?];
        Ok(Self(rust::PlanLimits { efforts, positions, velocities }))
    }
}

/// Time of a change of the gait: the word 'next', or a time (s).
pub(super) struct ChangeTime(pub Option<f64>);

impl<'py> FromPyObject<'_, 'py> for ChangeTime {
    type Error = PyErr;

    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        match given.extract::<String>() {
            Ok(word) if word == "next" => Ok(Self(None)),
            Ok(word) => Err(PyValueError::new_err(format!("at: expected 'next' or a time, found '{word}'"))),
            Err(_) => Ok(Self(Some(given.extract()?))),
        }
    }
}
