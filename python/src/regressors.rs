//! Dynamics and energies as linear functions of the inertial parameters, and the losses of joints: the library's
//! functions one to one.

use crate::arrays::{give, give_matrix, vector};
use crate::data::{Data, scratch};
use crate::model::Model;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Y(q, v, a) with τ = Y π: (nv, 10 (nbodies − 1)), `rnea` as a linear function of `Model.inertial_parameters`; O(n
/// depth).
///
/// q: nq numbers; v, a: nv. Ten columns for each body but the world. With the rotors τ = Y π + armature a.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7
/// >>> Y = condyle.joint_torque_regressor(arm, data, q, v, a)
/// >>> np.allclose(Y @ arm.inertial_parameters, condyle.rnea(arm, data, q, v, a))
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, out=None))]
pub(crate) fn joint_torque_regressor<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, a) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("a", a, nv)?);
    let Y = condyle::joint_torque_regressor(&model.inner, &mut data.inner, &q, &v, &a);
    drop((q, v, a));
    give_matrix(py, Y, out)
}

/// y(q, v) with T = y · π: 10 (nbodies − 1) numbers, `kinetic_energy` as a linear function of
/// `Model.inertial_parameters`, without the rotors; O(n).
///
/// q: nq numbers; v: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn kinetic_energy_regressor<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let y = condyle::kinetic_energy_regressor(&model.inner, &mut data.inner, &q, &v);
    drop((q, v));
    give(py, y, out)
}

/// y(q) with V = y · π: 10 (nbodies − 1) numbers, `potential_energy` as a linear function of
/// `Model.inertial_parameters`; O(n).
///
/// q: nq numbers.
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn potential_energy_regressor<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let y = condyle::potential_energy_regressor(&model.inner, &mut data.inner, &q);
    drop(q);
    give(py, y, out)
}

/// A positive speed.
fn positive(smoothing: f64) -> PyResult<f64> {
    if smoothing > 0.0 {
        return Ok(smoothing);
    }
    Err(PyValueError::new_err(format!("smoothing: expected a positive speed, found {smoothing}")))
}

/// τ = −d v − f tanh(v/ε): the efforts of the joints' own damping d and smoothed friction f, nv numbers (N m, N);
/// O(n).
///
/// v: nv numbers; smoothing: ε > 0, the speed (rad/s, m/s) at which friction is 76 % of f. No other function knows of
/// them: whoever wants them adds them to τ.
///
/// >>> arm = condyle.robots.arm7()
/// >>> v = np.ones(7)
/// >>> np.allclose(condyle.passive_torque(arm, v, 1e-3), -arm.damping - arm.friction)
/// True
#[pyfunction]
#[pyo3(signature = (model, v, smoothing, out=None))]
pub(crate) fn passive_torque<'py>(
    model: &Bound<'py, Model>,
    v: &Bound<'py, PyAny>,
    smoothing: f64,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model, smoothing) = (model.py(), &model.get().inner, positive(smoothing)?);
    let v = vector("v", v, model.nv())?;
    let mut numbers = vec![0.0; model.nv()];
    condyle::passive_torque(model, &v, smoothing, &mut numbers);
    drop(v);
    give(py, &numbers, out)
}

/// ∂τ/∂v = −d − f/ε (1 − tanh²(v/ε)) of `passive_torque`: nv numbers, the diagonal of a matrix without other
/// entries; O(n).
///
/// v: nv numbers; smoothing: ε > 0 (rad/s, m/s).
#[pyfunction]
#[pyo3(signature = (model, v, smoothing, out=None))]
pub(crate) fn passive_torque_derivative<'py>(
    model: &Bound<'py, Model>,
    v: &Bound<'py, PyAny>,
    smoothing: f64,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model, smoothing) = (model.py(), &model.get().inner, positive(smoothing)?);
    let v = vector("v", v, model.nv())?;
    let mut numbers = vec![0.0; model.nv()];
    condyle::passive_torque_derivative(model, &v, smoothing, &mut numbers);
    drop(v);
    give(py, &numbers, out)
}
