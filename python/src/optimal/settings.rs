//! Settings of solvers: read from keywords, and shown as mappings.

use crate::arrays::found_type;
use crate::exceptions::wrong_word;
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyMappingProxy};
use std::time::Duration;

/// Sets the fields of a `Settings` that are given by name. Some fields are read by a special function.
macro_rules! set {
    ($settings:expr, $given:expr, { $($field:ident $(by $read:ident)?),* }) => {
        for (name, value) in $given.into_iter().flatten() {
            match name.extract::<String>()?.as_str() {
                $(stringify!($field) => set!($settings.$field, value, stringify!($field) $(, $read)?),)*
                other => {
                    let all = [$(stringify!($field)),*].join(", ");
                    let what = format!("settings: there is no setting '{other}'; there are {all}");
                    return Err(PyValueError::new_err(what));
                }
            }
        }
    };
    ($field:expr, $value:ident, $name:expr) => {
        match $value.extract() {
            Ok(value) => $field = value,
            Err(_) => return Err(wrong_setting($name, $field.expected(), &$value)),
        }
    };
    ($field:expr, $value:ident, $name:expr, $read:ident) => { $field = $read(&$value)? };
}

/// Defines two functions for a type of settings. The first sets the fields that are given by name; the second returns
/// all fields as a dict. A field in another form than in Rust names its reader and its writer.
macro_rules! named {
    ($kind:ty, $set:ident, $show:ident, { $($field:ident $(by $read:ident and $write:ident)?),* $(,)? }) => {
        pub(super) fn $set(s: &mut $kind, given: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
            set!(s, given, { $($field $(by $read)?),* });
            Ok(())
        }

        pub(super) fn $show<'py>(s: &$kind, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
            let all = PyDict::new(py);
            $(all.set_item(stringify!($field), named!(s.$field $(, $write)?))?;)*
            Ok(all)
        }
    };
    ($value:expr) => { $value };
    ($value:expr, $write:ident) => { $write($value) };
}

/// A type of setting, with a description of its valid values.
trait Setting {
    fn expected(&self) -> &'static str;
}

macro_rules! settings {
    ($($kind:ty: $expected:literal),*) => {$(
        impl Setting for $kind {
            fn expected(&self) -> &'static str {
                $expected
            }
        }
    )*};
}
settings!(
    bool: "True or False",
    usize: "a whole number, 0 or above",
    f64: "a number",
    Option<f64>: "a number or None"
);

/// Returns the error for a setting of another type, or for a negative number.
fn wrong_setting(name: &str, expected: &str, found: &Bound<'_, PyAny>) -> PyErr {
    let found = found.repr().map_or_else(|_| found_type(found), |found| found.to_string());
    PyValueError::new_err(format!("settings: {name}: expected {expected}, found {found}"))
}

fn method(given: &Bound<'_, PyAny>) -> PyResult<rust::DdpMethod> {
    match given.extract::<String>()?.as_str() {
        "fddp" => Ok(rust::DdpMethod::Fddp),
        "ddp" => Ok(rust::DdpMethod::Ddp),
        other => Err(wrong_word("method", "'fddp' or 'ddp'", other)),
    }
}

fn method_name(method: rust::DdpMethod) -> &'static str {
    method.name()
}

/// Reads a time limit in seconds; `None` and infinity mean no limit.
fn duration(given: &Bound<'_, PyAny>) -> PyResult<Option<Duration>> {
    let seconds: Option<f64> = given.extract()?;
    let wrong = |seconds| {
        PyValueError::new_err(format!(
            "time_budget: expected at least 0 seconds (and at most 1.8e19, or inf), found {seconds:e}"
        ))
    };
    let limit = seconds.filter(|&s| s != f64::INFINITY);
    limit.map(|s| Duration::try_from_secs_f64(s).map_err(|_| wrong(s))).transpose()
}

fn seconds(duration: Option<Duration>) -> Option<f64> {
    duration.map(|duration| duration.as_secs_f64())
}

named!(rust::Settings, set_fddp, show_fddp, {
    method by method and method_name, second_order, inverse_dynamics_form, project_warm_start,
    max_iterations, time_budget by duration and seconds, segments, threads,
    tolerance, tolerance_bounded, step_lengths, accept, accept_ascent, flat,
    regularisation_start, regularisation_min, regularisation_max, regularisation_factor,
    regularisation_decrease_above, regularisation_increase_below,
});

named!(rust::ConstraintSettings, set_constraints, show_constraints, {
    max_solves, tolerance, tolerance_dual, penalty_start, penalty_max, penalty_factor, restart,
});

named!(rust::InteriorPointSettings, set_interior_point, show_interior_point, {
    tolerance, max_iterations, barrier_start, tick_barrier, second_order, inverse_dynamics_form,
    time_budget by duration and seconds, threads, regularisation_min, regularisation_max,
});

/// Returns settings as a mapping that cannot be changed, because a change would have no effect on the solver.
pub(super) fn read_only(settings: Bound<'_, PyDict>) -> Bound<'_, PyMappingProxy> {
    PyMappingProxy::new(settings.py(), settings.as_mapping())
}

/// Returns a mapping of settings as a dict.
pub(super) fn dict<'py>(given: &Bound<'py, PyMapping>) -> PyResult<Bound<'py, PyDict>> {
    let copy = PyDict::new(given.py());
    copy.update(given)?;
    Ok(copy)
}
