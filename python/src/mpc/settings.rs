//! Reads settings, and returns reports: the named tuples of `condyle._mpc`.

use crate::arrays::class;
use condyle::mpc as rust;
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
    let members = (status, report.time, solver, report.gap, report.cost, seconds[0], seconds[1], stands, command);
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

/// Reads `PlanLimits`.
pub(super) fn read_limits(given: &Bound<'_, PyAny>) -> PyResult<rust::PlanLimits> {
    let one = |name: &str| given.getattr(name)?.extract::<bool>();
    Ok(rust::PlanLimits { efforts: one("efforts")?, positions: one("positions")?, velocities: one("velocities")? })
}
