//! References of a whole horizon: targets and weights of one cost at all knots.

use super::recorder::{Recorder, kept};
use super::robot_action::{Described, change};
use crate::arrays::{check_last_row, in_place, matrix, output, vector};
use crate::exceptions::problem_error;
use condyle::optimal as rust;
use condyle::{Se3, Vec3, spatial::Mat3};
use numpy::{Ix2, Ix3};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use rust::record::Call;
use rust::robot::Target;
use std::sync::Arc;

/// Returns the error for a cost that no knot has.
fn no_cost(name: &str) -> PyErr {
    PyKeyError::new_err(format!("no knot has a cost '{name}'"))
}

/// Returns an error unless a cost was found.
fn found(name: &str, found: Result<bool, rust::Error>) -> PyResult<()> {
    if found.map_err(problem_error)? { Ok(()) } else { Err(no_cost(name)) }
}

/// Returns the shape of a target of the cost called `name`, from the first knot that has this cost.
fn shape_of(problem: &mut rust::Problem, name: &str) -> PyResult<[usize; 2]> {
    let mut exists = false;
    for t in 0..=problem.horizon() {
        let Some(cost) = problem.cost_at_mut(t, name) else { continue };
        exists = true;
        match cost.target() {
            Some(Target::Rotation(_)) => return Ok([3, 3]),
            Some(Target::Placement(_)) => return Ok([4, 4]),
            Some(target) => return Ok([target.size(), 0]),
            None => {}
        }
    }
    match exists {
        true => Err(PyKeyError::new_err(format!("the residual of the cost '{name}' has no target"))),
        false => Err(no_cost(name)),
    }
}

/// Returns the targets of the cost called `name` at all knots.
pub(super) fn get<'py>(py: Python<'py>, problem: &mut rust::Problem, name: &str) -> PyResult<Bound<'py, PyAny>> {
    let rows = problem.horizon() + 1;
    let shape = match shape_of(problem, name)? {
        [n, 0] => vec![rows, n],
        [n, m] => vec![rows, n, m],
    };
    let (numbers, _) = problem.references(name).expect("a knot has this cost");
    output(py, None, &shape, |to| to.copy_from_slice(&numbers))
}

/// Sets the targets of the cost called `name` at all knots.
pub(super) fn set(
    recorder: &Recorder,
    problem: &mut rust::Problem,
    name: &str,
    values: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let (rows, shape) = (problem.horizon() + 1, shape_of(problem, name)?);
    let mut write = |values: &[f64]| {
        recorder.note(|| Call::SetReferences { name: name.to_owned(), values: kept(values) });
        found(name, problem.set_references(name, values))
    };
    match shape {
        [n, 0] => write(&in_place::<Ix2>("values", values, &[rows, n])?),
        [n, m] => write(&in_place::<Ix3>("values", values, &[rows, n, m])?),
    }
}

/// Sets the placements of the geometry called `name` at all knots. Returns them.
pub(super) fn set_placements(
    recorder: &Recorder,
    problem: &mut rust::Problem,
    name: &str,
    placements: &Bound<'_, PyAny>,
) -> PyResult<Vec<Se3<f64>>> {
    let rows = problem.horizon() + 1;
    let values = in_place::<Ix3>("placements", placements, &[rows, 4, 4])?;
    let column = |m: &[f64], j: usize| Vec3::new(m[j], m[4 + j], m[8 + j]);
    let mut all = Vec::with_capacity(rows);
    for (knot, m) in values.chunks_exact(16).enumerate() {
        if m[12..] != [0.0, 0.0, 0.0, 1.0] {
            check_last_row(&format!("placements[{knot}]"), &m[12..])?;
        }
        let rotation = Mat3 { x: column(m, 0), y: column(m, 1), z: column(m, 2) };
        all.push(Se3::new(rotation, column(m, 3)));
    }
    recorder.note(|| Call::SetPlacements { name: name.to_owned(), values: kept(&values) });
    match problem.set_placements(name, &all).map_err(problem_error)? {
        true => Ok(all),
        false => Err(PyKeyError::new_err(format!("no pair of distances has a geometry '{name}'"))),
    }
}

/// Sets the weights of the cost called `name` at all knots.
pub(super) fn set_weights(
    recorder: &Recorder,
    problem: &mut rust::Problem,
    name: &str,
    weights: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let weights = vector("weight", weights, problem.horizon() + 1)?;
    recorder.note(|| Call::SetWeights { name: name.to_owned(), weights: kept(&weights) });
    found(name, problem.set_weights(name, &weights))
}

/// Sets the weights of the entries of the cost called `name` at all knots.
pub(super) fn set_entry_weights(
    recorder: &Recorder,
    problem: &mut rust::Problem,
    name: &str,
    weights: &Bound<'_, PyAny>,
) -> PyResult<()> {
    let columns = weights.getattr("shape").and_then(|shape| shape.get_item(1)?.extract::<usize>()).unwrap_or(1);
    let weights = matrix("weights", weights, [problem.horizon() + 1, columns])?;
    recorder.note(|| Call::SetEntryWeights { name: name.to_owned(), weights: kept(&weights) });
    found(name, problem.set_entry_weights(name, &weights))
}

/// Copies the present costs of all robots to the descriptions of the models.
pub(super) fn describe(problem: &mut rust::Problem, described: &mut [Option<Arc<Described>>]) {
    let last = described.len() - 1;
    for (k, described) in described.iter_mut().enumerate() {
        let Some(described) = described else { continue };
        let k = (k < last).then_some(k);
        let costs = change!(problem, k, |action| {
            let common = action.costs_mut().terms().to_vec();
            (common, action.separate_costs().map(|(t, costs)| (t, costs.terms().to_vec())).collect())
        });
        if let Some((common, separate)) = costs {
            let knot = &mut Arc::make_mut(described).knot;
            (knot.costs, knot.costs_at) = (common, separate);
        }
    }
}
