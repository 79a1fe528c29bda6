//! Outcomes of solves with constraints, and multipliers by the name of their limit.

use crate::arrays::{Give, class, matrix};
use condyle::optimal as rust;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PySlice, PyTuple};

/// Converts an outcome to a Python object.
pub(super) fn give_outcome<'py>(py: Python<'py>, o: &rust::Outcome) -> PyResult<Bound<'py, PyAny>> {
    let multipliers = o.multipliers.iter().map(|y| y.give(py, None)).collect::<PyResult<Vec<_>>>()?;
    let worst = o.worst.as_ref().map(|worst| give_violation(py, worst)).transpose()?;
    let gave_way = o.gave_way.iter().map(|row| give_violation(py, row)).collect::<PyResult<Vec<_>>>()?;
    let named = PyDict::new(py);
    named.set_item("limits", limits(py, o)?)?;
    named.set_item("soft_cost", o.soft_cost)?;
    named.set_item("gave_way", PyTuple::new(py, gave_way)?)?;
    let numbers = (o.cost, o.primal, o.dual, multipliers, o.penalty, o.solves, o.iterations, worst, o.barrier);
    class!(py, "Outcome")?.call(numbers, Some(&named))
}

/// Returns the rows of each named limit: for each knot a slice, which is empty at a knot without the limit.
fn limits<'py>(py: Python<'py>, outcome: &rust::Outcome) -> PyResult<Bound<'py, PyDict>> {
    let limits = PyDict::new(py);
    for limit in &outcome.limits {
        if !limits.contains(&*limit.name)? {
            let knots = outcome.multipliers.len();
            limits.set_item(&*limit.name, PyList::new(py, (0..knots).map(|_| PySlice::new(py, 0, 0, 1)))?)?;
        }
        if let Some(knots) = limits.get_item(&*limit.name)? {
            let rows = PySlice::new(py, limit.rows.start as isize, limit.rows.end as isize, 1);
            knots.set_item(limit.knot, rows)?;
        }
    }
    Ok(limits)
}

/// Returns the multipliers of the limit `name` as a list for each knot, from an array with an equal number of columns
/// at all knots. For an unknown name, the lists are empty.
pub(super) fn multipliers_by_knot(
    problem: &mut rust::Problem,
    name: &str,
    values: &Bound<'_, PyAny>,
) -> PyResult<Vec<Vec<f64>>> {
    let mut counts = vec![0; problem.horizon() + 1];
    for limit in problem.limit_rows().iter().filter(|limit| &*limit.name == name) {
        counts[limit.knot] = limit.rows.len();
    }
    let most = counts.iter().copied().max().unwrap_or(0);
    if most == 0 {
        return Ok(vec![vec![]; counts.len()]);
    }
    let values = matrix(&format!("multipliers of `{name}`"), values, [counts.len(), most])?;
    Ok(counts.iter().zip(values.chunks(most)).map(|(&count, y)| y[..count].to_vec()).collect())
}

/// Converts a violated row to a Python object.
fn give_violation<'py>(py: Python<'py>, row: &rust::Violation) -> PyResult<Bound<'py, PyAny>> {
    let kind = match row.kind {
        rust::ViolationKind::Gap => "gap",
        rust::ViolationKind::ControlBound => "control_bound",
        _ => "constraint",
    };
    class!(py, "Violation")?.call1((
        kind,
        row.knot,
        row.row,
        row.name.as_deref(),
        row.entry,
        row.amount,
        row.what.as_deref(),
    ))
}
