//! Reads and writes the settings of a controller: `Settings` of `condyle._wholebody`.

use crate::arrays::{Give, class, numbers};
use crate::exceptions::wrong_word;
use crate::model::Model;
use crate::optimal::geometry_pairs;
use condyle::wholebody as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rust::{Backend, DistanceLimits, Formulation, Friction, JointLimits, Settings};

/// Reads gains, given as a pair.
pub(super) fn gains(argument: &str, given: &Bound<'_, PyAny>) -> PyResult<rust::Gains> {
    let wrong = |_| PyValueError::new_err(format!("{argument}: expected Gains(stiffness, damping)"));
    let (stiffness, damping) = given.extract().map_err(wrong)?;
    Ok(rust::Gains { stiffness, damping })
}

/// Reads the numbers of a member of `Settings`; `None` if the member is None.
fn list(given: &Bound<'_, PyAny>, prefix: &str, name: &str) -> PyResult<Option<Vec<f64>>> {
    let value = given.getattr(name)?;
    (!value.is_none()).then(|| numbers(&format!("{prefix}{name}"), &value)).transpose()
}

/// Reads limits of distances between geometries of a robot; `None` if they are None.
fn distances(model: &Bound<'_, Model>, given: &Bound<'_, PyAny>) -> PyResult<Option<DistanceLimits>> {
    if given.is_none() {
        return Ok(None);
    }
    Ok(Some(DistanceLimits {
        pairs: geometry_pairs(model, &given.getattr("pairs")?)?,
        minimum: given.getattr("minimum")?.extract()?,
        look_ahead: given.getattr("look_ahead")?.extract()?,
        max_acceleration: given.getattr("max_acceleration")?.extract()?,
        range: given.getattr("range")?.extract()?,
    }))
}

/// Converts settings for a robot to the library's type.
pub(super) fn read(model: &Bound<'_, Model>, given: &Bound<'_, PyAny>) -> PyResult<Settings> {
    let get = |name: &str| given.getattr(name);
    let friction = get("friction")?;
    let friction = match (friction.extract::<String>().as_deref(), friction.extract::<(usize, bool)>()) {
        (Ok("cone"), _) => Friction::Cone,
        (_, Ok((sides, inscribed))) => Friction::Pyramid { sides, inscribed },
        _ => {
            let message = format!("friction: expected 'cone' or Pyramid(sides, inscribed), found {}", friction.repr()?);
            return Err(PyValueError::new_err(message));
        }
    };
    let limits = get("joint_limits")?;
    let joint_limits = if limits.is_none() {
        None
    } else {
        let list = |name| list(&limits, "joint_limits.", name);
        Some(JointLimits {
            look_ahead: limits.getattr("look_ahead")?.extract()?,
            max_acceleration: limits.getattr("max_acceleration")?.extract()?,
            lower: list("lower")?,
            upper: list("upper")?,
            velocity: list("velocity")?,
        })
    };
    Ok(Settings {
        acceleration_weight: get("acceleration_weight")?.extract()?,
        force_weight: get("force_weight")?.extract()?,
        contact_gains: gains("contact_gains", &get("contact_gains")?)?,
        max_correction: get("max_correction")?.extract()?,
        friction,
        effort: list(given, "", "effort")?,
        joint_limits,
        distances: distances(model, &get("distances")?)?,
        hold_ticks: get("hold_ticks")?.extract()?,
        damping: get("damping")?.extract()?,
        backend: match get("backend")?.extract::<String>()?.as_str() {
            "interior_point" => Backend::InteriorPoint,
            "clarabel" => Backend::Clarabel,
            other => return Err(wrong_word("backend", "'interior_point' or 'clarabel'", other)),
        },
        formulation: match get("formulation")?.extract::<String>()?.as_str() {
            "condensed" => Formulation::Condensed,
            "full" => Formulation::Full,
            other => return Err(wrong_word("formulation", "'condensed' or 'full'", other)),
        },
        warm_start: get("warm_start")?.extract()?,
        tolerance: get("tolerance")?.extract()?,
        max_iterations: get("max_iterations")?.extract()?,
        time_limit: get("time_limit")?.extract()?,
    })
}

/// Converts gains to a Python `Gains`.
pub(super) fn give_gains(py: Python<'_>, gains: rust::Gains) -> PyResult<Bound<'_, PyAny>> {
    class!(py, "condyle._wholebody", "Gains")?.call1((gains.stiffness, gains.damping))
}

/// Converts settings to a Python `Settings`.
pub(super) fn give<'py>(py: Python<'py>, s: &Settings) -> PyResult<Bound<'py, PyAny>> {
    let list = |numbers: &Option<Vec<f64>>| numbers.as_ref().map(|x| x.give(py, None)).transpose();
    let friction = match s.friction {
        Friction::Pyramid { sides, inscribed } => {
            class!(py, "condyle._wholebody", "Pyramid")?.call1((sides, inscribed))?
        }
        _ => "cone".into_pyobject(py)?.into_any(),
    };
    let limits = |l: &JointLimits| {
        let (lower, upper, velocity) = (list(&l.lower)?, list(&l.upper)?, list(&l.velocity)?);
        let all = (l.look_ahead, l.max_acceleration, lower, upper, velocity);
        class!(py, "condyle._wholebody", "JointLimits")?.call1(all)
    };
    let distances = |l: &DistanceLimits| {
        let text = serde_json::to_string(&l.pairs).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let pairs = py.import("condyle.distances")?.call_method1("_read_pairs", (text,))?;
        let all = (pairs, l.minimum, l.look_ahead, l.max_acceleration, l.range);
        class!(py, "condyle.distances", "DistanceLimits")?.call1(all)
    };
    let all = [
        s.acceleration_weight.give(py, None)?,
        s.force_weight.give(py, None)?,
        give_gains(py, s.contact_gains)?,
        s.max_correction.give(py, None)?,
        friction,
        list(&s.effort)?.into_pyobject(py)?.into_any(),
        s.joint_limits.as_ref().map(limits).transpose()?.into_pyobject(py)?.into_any(),
        s.hold_ticks.into_pyobject(py)?.into_any(),
        s.damping.give(py, None)?,
        if s.backend == Backend::Clarabel { "clarabel" } else { "interior_point" }.into_pyobject(py)?.into_any(),
        if s.formulation == Formulation::Full { "full" } else { "condensed" }.into_pyobject(py)?.into_any(),
        s.warm_start.into_pyobject(py)?.to_owned().into_any(),
        s.tolerance.give(py, None)?,
        s.max_iterations.into_pyobject(py)?.into_any(),
        s.time_limit.give(py, None)?,
        s.distances.as_ref().map(distances).transpose()?.into_pyobject(py)?.into_any(),
    ];
    class!(py, "condyle._wholebody", "Settings")?.call1(pyo3::types::PyTuple::new(py, all)?)
}
