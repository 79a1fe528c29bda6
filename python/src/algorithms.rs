//! Dynamics and its derivatives: the library's functions one to one.
//!
//! Each call takes microseconds and keeps the interpreter's lock; it borrows its `Data` before it looks at any other
//! argument, so that a second use of the same one, from wherever, is an error.

use crate::arrays::{give, give_matrix, named_tuple, vector};
use crate::data::{Data, external, members, regular, scratch};
use crate::model::Model;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyTuple, PyType};

/// τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i: the joint efforts that make the robot accelerate with a, in O(n); nv
/// numbers (N m, N).
///
/// q: nq numbers; v, a: nv; f_ext: (nbodies, 6), a force on each body (N, then N m), acting at the body's origin and
/// expressed in its frame, row 0 being the world's.
///
/// >>> arm = condyle.robots.arm7()
/// >>> tau = condyle.rnea(arm, condyle.Data(arm), [0.3] * 7, [0.0] * 7, [0.0] * 7)
/// >>> bool(abs(tau[0]) < 1e-9)  # gravity does not turn a vertical axis
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, f_ext=None, out=None))]
pub(crate) fn rnea<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    f_ext: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let Data { inner, forces, .. } = &mut *data;
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, a) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("a", a, nv)?);
    let tau = condyle::rnea(&model.inner, inner, &q, &v, &a, external(forces, f_ext)?);
    drop((q, v, a));
    give(py, tau, out)
}

/// q̈ = M(q)⁻¹ (τ − h(q, v) + Σ Jᵢᵀ f_ext,i): how the robot accelerates, nv numbers (rad/s², m/s²); O(n).
///
/// q: nq numbers; v, tau: nv; f_ext: as for `rnea`.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q, zero = condyle.neutral(quadruped), [0.0] * 18
/// >>> a = condyle.aba(quadruped, condyle.Data(quadruped), q, zero, zero)
/// >>> bool(abs(a[2] + 9.81) < 1e-12)  # it falls
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, tau, f_ext=None, out=None))]
pub(crate) fn aba<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    tau: &Bound<'py, PyAny>,
    f_ext: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    regular(model)?;
    let mut data = scratch(model, data)?;
    let Data { inner, forces, .. } = &mut *data;
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, tau) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("tau", tau, nv)?);
    let a = condyle::aba(&model.inner, inner, &q, &v, &tau, external(forces, f_ext)?);
    drop((q, v, tau));
    give(py, a, out)
}

/// M(q), the joint-space inertia matrix: (nv, nv), symmetric, both triangles filled, armature included; O(n depth).
///
/// q: nq numbers. τ = M a + h; the kinetic energy is ½ vᵀ M v.
///
/// >>> arm = condyle.robots.arm7()
/// >>> M = condyle.crba(arm, condyle.Data(arm), [0.3] * 7)
/// >>> bool(np.linalg.eigvalsh(M).min() > 0.0)
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn crba<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let M = condyle::crba(&model.inner, &mut data.inner, &q);
    drop(q);
    give_matrix(py, M, out)
}

/// M(q)⁻¹: (nv, nv), symmetric, both triangles filled; without forming M.
///
/// q: nq numbers.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q = condyle.Data(arm), [0.3] * 7
/// >>> np.allclose(condyle.minv(arm, data, q) @ condyle.crba(arm, data, q), np.eye(7))
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn minv<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    regular(model)?;
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let Minv = condyle::minv(&model.inner, &mut data.inner, &q);
    drop(q);
    give_matrix(py, Minv, out)
}

/// h(q, v) = C(q, v) v + g(q): the efforts that keep the velocity as it is, nv numbers; `rnea` with a = 0.
///
/// q: nq numbers; v: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn nonlinear_effects<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let h = condyle::nonlinear_effects(&model.inner, &mut data.inner, &q, &v);
    drop((q, v));
    give(py, h, out)
}

/// g(q): the efforts that hold the robot still, nv numbers; `rnea` with v = a = 0.
///
/// q: nq numbers.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> g = condyle.gravity(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(g[2] - 9.81 * quadruped.total_mass) < 1e-9)  # the base carries the weight
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn gravity<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let g = condyle::gravity(&model.inner, &mut data.inner, &q);
    drop(q);
    give(py, g, out)
}

/// τ = g(q) − Σ Jᵢᵀ f_ext,i: the efforts that hold the robot still under external forces, nv numbers (N m, N); O(n).
///
/// q: nq numbers; f_ext: as for `rnea`. It is `rnea` with v = a = 0.
#[pyfunction]
#[pyo3(signature = (model, data, q, f_ext=None, out=None))]
pub(crate) fn static_torque<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    f_ext: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let Data { inner, forces, .. } = &mut *data;
    let q = vector("q", q, model.inner.nq())?;
    let tau = condyle::static_torque(&model.inner, inner, &q, external(forces, f_ext)?);
    drop(q);
    give(py, tau, out)
}

/// C(q, v), the Coriolis matrix by Christoffel symbols: (nv, nv), C v = h − g, Ṁ = C + Cᵀ; O(n depth).
///
/// q: nq numbers; v: nv.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.1] * 7
/// >>> h, g = condyle.nonlinear_effects(arm, data, q, v), condyle.gravity(arm, data, q)
/// >>> np.allclose(condyle.coriolis_matrix(arm, data, q, v) @ v, h - g)
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn coriolis_matrix<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let C = condyle::coriolis_matrix(&model.inner, &mut data.inner, &q, &v);
    drop((q, v));
    give_matrix(py, C, out)
}

/// The derivatives of `rnea` with respect to q, v and a, exact, in O(n depth), as
/// `RneaDerivatives(dtau_dq, dtau_dv, dtau_da)`, each (nv, nv).
///
/// q: nq numbers; v, a: nv; f_ext: as for `rnea`, moving with the bodies. ∂/∂q is taken in the tangent space: the
/// change of τ when q moves to `integrate(q, δ)`, per δ. out: three arrays, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> dtau_dq, dtau_dv, dtau_da = condyle.rnea_derivatives(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7, [0.2] * 7)
/// >>> dtau_dq.shape
/// (7, 7)
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, f_ext=None, out=None))]
pub(crate) fn rnea_derivatives<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    f_ext: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let Data { inner, forces, .. } = &mut *data;
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, a) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("a", a, nv)?);
    let d = condyle::rnea_derivatives(&model.inner, inner, &q, &v, &a, external(forces, f_ext)?);
    drop((q, v, a));
    let [dq, dv, da] = members(out, "dtau_dq, dtau_dv, dtau_da")?;
    let arrays = [
        give_matrix(py, d.dtau_dq, dq.as_ref())?,
        give_matrix(py, d.dtau_dv, dv.as_ref())?,
        give_matrix(py, d.dtau_da, da.as_ref())?,
    ];
    named_tuple(py, &CLASS, "RneaDerivatives")?.call1(PyTuple::new(py, arrays)?)
}

/// `aba` and its derivatives with respect to q, v and τ, exact, as `AbaDerivatives(a, da_dq, da_dv, da_dtau)`: nv
/// numbers and three matrices (nv, nv).
///
/// q: nq numbers; v, tau: nv; f_ext: as for `rnea`, moving with the bodies. ∂/∂q is taken in the tangent space: the
/// change of q̈ when q moves to `integrate(q, δ)`, per δ. out: four arrays, such as an earlier result.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data = condyle.Data(arm)
/// >>> d = condyle.aba_derivatives(arm, data, [0.3] * 7, [0.1] * 7, [1.0] * 7)
/// >>> np.array_equal(d.da_dtau, condyle.minv(arm, data, [0.3] * 7))
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, tau, f_ext=None, out=None))]
pub(crate) fn aba_derivatives<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    tau: &Bound<'py, PyAny>,
    f_ext: Option<&Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let (py, model) = (model.py(), model.get());
    regular(model)?;
    let mut data = scratch(model, data)?;
    let Data { inner, forces, .. } = &mut *data;
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, tau) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("tau", tau, nv)?);
    let d = condyle::aba_derivatives(&model.inner, inner, &q, &v, &tau, external(forces, f_ext)?);
    drop((q, v, tau));
    let [a, dq, dv, dtau] = members(out, "a, da_dq, da_dv, da_dtau")?;
    let arrays = [
        give(py, d.a, a.as_ref())?,
        give_matrix(py, d.da_dq, dq.as_ref())?,
        give_matrix(py, d.da_dv, dv.as_ref())?,
        give_matrix(py, d.da_dtau, dtau.as_ref())?,
    ];
    named_tuple(py, &CLASS, "AbaDerivatives")?.call1(PyTuple::new(py, arrays)?)
}
