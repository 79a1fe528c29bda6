//! The space of positions, and its tangent vectors.

use crate::arrays::{give, give_matrix, vector};
use crate::model::Model;
use condyle::{DifferenceArgument, IntegrateArgument};
use nalgebra::DMatrix;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use rand::SeedableRng;
use rand::rngs::StdRng;

/// The position in which every body is at its joint's frame, nq numbers: zeros, and rotations by nothing.
///
/// >>> condyle.neutral(condyle.robots.quadruped())[:7]
/// array([0., 0., 0., 0., 0., 0., 1.])
#[pyfunction]
pub(crate) fn neutral<'py>(model: &Bound<'py, Model>) -> PyResult<Bound<'py, PyAny>> {
    give(model.py(), &condyle::neutral(&model.get().inner), None)
}

/// A position drawn uniformly, nq numbers: between its limits, within ±3 (rad, m) where a coordinate has none, over
/// the whole group for rotations.
///
/// seed: a number below 2⁶⁴; the same one gives the same position. None draws afresh.
#[pyfunction]
#[pyo3(signature = (model, seed=None))]
pub(crate) fn random_configuration<'py>(model: &Bound<'py, Model>, seed: Option<u64>) -> PyResult<Bound<'py, PyAny>> {
    let mut rng = StdRng::seed_from_u64(seed.unwrap_or_else(rand::random));
    give(model.py(), &condyle::random_configuration(&model.get().inner, &mut rng), None)
}

/// q ⊕ v: the position after moving with the velocity v for one unit of time, nq numbers.
///
/// q: nq numbers; v: nv.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q0 = condyle.neutral(quadruped)
/// >>> q1 = condyle.integrate(quadruped, q0, np.full(18, 0.1))
/// >>> np.allclose(condyle.difference(quadruped, q0, q1), 0.1)
/// True
#[pyfunction]
#[pyo3(signature = (model, q, v, out=None))]
pub(crate) fn integrate<'py>(
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), &model.get().inner);
    let (q, v) = (vector("q", q, model.nq())?, vector("v", v, model.nv())?);
    let mut moved = vec![0.0; model.nq()];
    condyle::integrate(model, &q, &v, &mut moved);
    drop((q, v));
    give(py, &moved, out)
}

/// q₁ ⊖ q₀: the tangent vector v with q₀ ⊕ v = q₁, of rotations the shortest one; nv numbers.
///
/// q0, q1: nq numbers.
#[pyfunction]
#[pyo3(signature = (model, q0, q1, out=None))]
pub(crate) fn difference<'py>(
    model: &Bound<'py, Model>,
    q0: &Bound<'py, PyAny>,
    q1: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), &model.get().inner);
    let (q0, q1) = (vector("q0", q0, model.nq())?, vector("q1", q1, model.nq())?);
    let mut v = vec![0.0; model.nv()];
    condyle::difference(model, &q0, &q1, &mut v);
    drop((q0, q1));
    give(py, &v, out)
}

/// ∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v: (nv, nv), block-diagonal, between tangent spaces; it does not depend on q.
///
/// v: nv numbers; argument: 'position' for q or 'velocity' for v.
#[pyfunction]
#[pyo3(signature = (model, v, argument, out=None))]
pub(crate) fn integrate_jacobian<'py>(
    model: &Bound<'py, Model>,
    v: &Bound<'py, PyAny>,
    argument: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let argument = match argument {
        "position" => IntegrateArgument::Position,
        "velocity" => IntegrateArgument::Velocity,
        other => return Err(wrong_argument("'position' or 'velocity'", other)),
    };
    let (py, model) = (model.py(), &model.get().inner);
    let v = vector("v", v, model.nv())?;
    let mut J = DMatrix::zeros(model.nv(), model.nv());
    condyle::integrate_jacobian(model, &v, argument, &mut J);
    drop(v);
    give_matrix(py, &J, out)
}

/// ∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁: (nv, nv), block-diagonal, between tangent spaces; of the positions it needs
/// their difference only.
///
/// d: q₁ ⊖ q₀, nv numbers; argument: 'from' for q₀ or 'to' for q₁.
#[pyfunction]
#[pyo3(signature = (model, d, argument, out=None))]
pub(crate) fn difference_jacobian<'py>(
    model: &Bound<'py, Model>,
    d: &Bound<'py, PyAny>,
    argument: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let argument = match argument {
        "from" => DifferenceArgument::From,
        "to" => DifferenceArgument::To,
        other => return Err(wrong_argument("'from' or 'to'", other)),
    };
    let (py, model) = (model.py(), &model.get().inner);
    let d = vector("d", d, model.nv())?;
    let mut J = DMatrix::zeros(model.nv(), model.nv());
    condyle::difference_jacobian(model, &d, argument, &mut J);
    drop(d);
    give_matrix(py, &J, out)
}

fn wrong_argument(expected: &str, found: &str) -> PyErr {
    PyValueError::new_err(format!("argument: expected {expected}, found '{found}'"))
}
