//! The space of positions, and its tangent vectors.

use crate::arrays::{give, give_matrix, matrix, vector};
use crate::model::Model;
use condyle::{DifferenceArgument, IntegrateArgument};
use nalgebra::DMatrix;
use numpy::{PyUntypedArray, PyUntypedArrayMethods};
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

/// q₀ ⊕ t (q₁ ⊖ q₀): from q₀ at t = 0 to q₁ at t = 1 at a constant velocity, nq numbers.
///
/// q0, q1: nq numbers; t: a number, beyond 0 and 1 too.
///
/// >>> condyle.interpolate(condyle.robots.arm7(), [0.0] * 7, [1.0] * 7, 0.25)
/// array([0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25])
#[pyfunction]
#[pyo3(signature = (model, q0, q1, t, out=None))]
pub(crate) fn interpolate<'py>(
    model: &Bound<'py, Model>,
    q0: &Bound<'py, PyAny>,
    q1: &Bound<'py, PyAny>,
    t: f64,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), &model.get().inner);
    let (q0, q1) = (vector("q0", q0, model.nq())?, vector("q1", q1, model.nq())?);
    let (mut tangent, mut q) = (vec![0.0; model.nv()], vec![0.0; model.nq()]);
    condyle::interpolate(model, &q0, &q1, t, &mut tangent, &mut q);
    drop((q0, q1));
    give(py, &q, out)
}

/// ‖q₁ ⊖ q₀‖, with lengths (m) and angles (rad) counted alike.
///
/// q0, q1: nq numbers.
#[pyfunction]
pub(crate) fn distance(model: &Bound<'_, Model>, q0: &Bound<'_, PyAny>, q1: &Bound<'_, PyAny>) -> PyResult<f64> {
    let model = &model.get().inner;
    let (q0, q1) = (vector("q0", q0, model.nq())?, vector("q1", q1, model.nq())?);
    Ok(condyle::distance(model, &q0, &q1, &mut vec![0.0; model.nv()]))
}

/// q with its quaternions and pairs (cos, sin) brought back to length 1, nq numbers; q itself stays unless it is
/// `out`.
///
/// q: nq numbers.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q = condyle.neutral(quadruped)
/// >>> q[6] = 2.0
/// >>> np.array_equal(condyle.normalize(quadruped, q), condyle.neutral(quadruped))
/// True
#[pyfunction]
#[pyo3(signature = (model, q, out=None))]
pub(crate) fn normalize<'py>(
    model: &Bound<'py, Model>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), &model.get().inner);
    let mut q = vector("q", q, model.nq())?.to_vec();
    condyle::normalize(model, &mut q);
    give(py, &q, out)
}

/// The columns of X, tangent vectors at q ⊕ v, taken to the tangent space at q: (∂(q ⊕ v)/∂q)⁻¹ X.
///
/// v: nv numbers; X: a matrix of nv rows. Pinocchio's `dIntegrateTransport` multiplies with ∂(q ⊕ v)/∂q itself: it is
/// `transport` with −v.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> v = np.full(18, 0.1)
/// >>> J = condyle.integrate_jacobian(quadruped, v, "position")
/// >>> np.allclose(condyle.transport(quadruped, v, J), np.eye(18))
/// True
#[pyfunction]
#[pyo3(signature = (model, v, X, out=None))]
pub(crate) fn transport<'py>(
    model: &Bound<'py, Model>,
    v: &Bound<'py, PyAny>,
    X: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), &model.get().inner);
    let v = vector("v", v, model.nv())?;
    let X = py.import("numpy")?.call_method1("asarray", (X,)).unwrap_or_else(|_| X.clone()); // `matrix` says why not
    let columns = X.cast::<PyUntypedArray>().ok().and_then(|x| x.shape().get(1).copied()).unwrap_or(1);
    let mut moved = DMatrix::from_row_slice(model.nv(), columns, &matrix("X", &X, [model.nv(), columns])?);
    condyle::transport(model, &v, &mut moved);
    drop(v);
    give_matrix(py, &moved, out)
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
