//! The centre of mass, momentum and energies: the library's functions one to one.

use crate::arrays::{give, give_matrix, named_tuple, output, vector};
use crate::data::{Data, members, scratch};
use crate::model::Model;
use condyle::{CentroidalMapRate, Inertia};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyTuple, PyType};

/// Gives the inertia of a whole robot about its centre of mass out: [m 1, 0; 0, Ī].
fn give_inertia<'py>(
    py: Python<'py>,
    I: &Inertia<f64>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    output(py, out, &[6, 6], |x| {
        x.fill(0.0);
        for (k, column) in I.rotational.full().columns().into_iter().enumerate() {
            x[7 * k] = I.mass;
            x[6 * (3 + k) + 3..6 * (4 + k)].copy_from_slice(&column.to_array()); // symmetric: a column is a row
        }
    })
}

/// Gives what `centroidal_map_rate` returns.
fn give_map_rate<'py>(
    py: Python<'py>,
    map: &CentroidalMapRate<'_, f64>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let [Ag, dAg, hg, Ig, com, com_velocity, Jcom] = members(out, "Ag, dAg, hg, Ig, com, com_velocity, Jcom")?;
    let arrays = [
        give_matrix(py, map.Ag, Ag.as_ref())?,
        give_matrix(py, map.dAg, dAg.as_ref())?,
        give(py, &map.hg.to_array(), hg.as_ref())?,
        give_inertia(py, &map.Ig, Ig.as_ref())?,
        give(py, &map.com.to_array(), com.as_ref())?,
        give(py, &map.com_velocity.to_array(), com_velocity.as_ref())?,
        give_matrix(py, map.Jcom, Jcom.as_ref())?,
    ];
    named_tuple(py, &CLASS, "CentroidalMapRate")?.call1(PyTuple::new(py, arrays)?)
}

/// c, the centre of mass of the moving bodies, 3 numbers, in the world's frame (m); O(n).
///
/// q: nq numbers. What is fixed to the world does not count; not a number if nothing that moves has a mass.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> com = condyle.com(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(com[1]) < 1e-12)  # left and right weigh the same
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn com<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let numbers = condyle::forward_kinematics(&model.inner, &mut data.inner, &q).com();
    drop(q);
    give(py, &numbers.to_array(), out)
}

/// ċ, the velocity of the centre of mass of the moving bodies, 3 numbers, in the world's frame (m/s); O(n).
///
/// q: nq numbers; v: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn com_velocity<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let numbers = condyle::forward_velocities(&model.inner, &mut data.inner, &q, &v).com_velocity();
    drop((q, v));
    give(py, &numbers.to_array(), out)
}

/// c̈, the acceleration of the centre of mass of the moving bodies, 3 numbers, in the world's frame (m/s²), without
/// gravity; O(n).
///
/// q: nq numbers; v, a: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, out=None))]
pub(crate) fn com_acceleration<'py>(
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
    let numbers = condyle::forward_accelerations(&model.inner, &mut data.inner, &q, &v, &a).com_acceleration();
    drop((q, v, a));
    give(py, &numbers.to_array(), out)
}

/// Jcom(q), the Jacobian of the centre of mass: (3, nv), ċ = Jcom v; O(n).
///
/// q: nq numbers. It is a part of `centroidal_map`.
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn com_jacobian<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let Jcom = condyle::centroidal_map(&model.inner, &mut data.inner, &q).Jcom;
    drop(q);
    give_matrix(py, Jcom, out)
}

/// The centroidal momentum matrix Ag(q), hg = Ag v, and what it needs, in O(n), as `CentroidalMap(Ag, Ig, com,
/// Jcom)`.
///
/// q: nq numbers. What is fixed to the world does not count; not a number if nothing that moves has a mass. out: four
/// arrays, such as an earlier result.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> map = condyle.centroidal_map(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(map.Ag[0, 0] - quadruped.total_mass) < 1e-9)  # pushed forwards, all goes forwards
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn centroidal_map<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let map = condyle::centroidal_map(&model.inner, &mut data.inner, &q);
    drop(q);
    let [Ag, Ig, com, Jcom] = members(out, "Ag, Ig, com, Jcom")?;
    let arrays = [
        give_matrix(py, map.Ag, Ag.as_ref())?,
        give_inertia(py, &map.Ig, Ig.as_ref())?,
        give(py, &map.com.to_array(), com.as_ref())?,
        give_matrix(py, map.Jcom, Jcom.as_ref())?,
    ];
    named_tuple(py, &CLASS, "CentroidalMap")?.call1(PyTuple::new(py, arrays)?)
}

/// Ag(q), its rate along v, and the centroidal momentum hg = Ag v, in O(n), as
/// `CentroidalMapRate(Ag, dAg, hg, Ig, com, com_velocity, Jcom)`; the rate of hg is Ag a + dAg v.
///
/// q: nq numbers; v: nv. What is fixed to the world does not count; not a number if nothing that moves has a mass. out:
/// seven arrays, such as an earlier result.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn centroidal_map_rate<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let map = condyle::centroidal_map_rate(&model.inner, &mut data.inner, &q, &v);
    drop((q, v));
    give_map_rate(py, &map, out)
}

/// hg, the momentum of the moving bodies about their centre of mass, along the world's axes: 6 numbers (kg m/s, then
/// kg m²/s); O(n).
///
/// q: nq numbers; v: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, out=None))]
pub(crate) fn centroidal_momentum<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let numbers = condyle::forward_velocities(&model.inner, &mut data.inner, &q, &v).centroidal_momentum();
    drop((q, v));
    give(py, &numbers.to_array(), out)
}

/// The rate of hg, along the world's axes: 6 numbers (N, then N m), the weight and the external forces about the
/// centre of mass; O(n).
///
/// q: nq numbers; v, a: nv.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, out=None))]
pub(crate) fn centroidal_momentum_rate<'py>(
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
    let numbers = condyle::forward_accelerations(&model.inner, &mut data.inner, &q, &v, &a).centroidal_momentum_rate();
    drop((q, v, a));
    give(py, &numbers.to_array(), out)
}

/// T = ½ vᵀ M(q) v, the kinetic energy of the moving bodies and the rotors (J); O(n).
///
/// q: nq numbers; v: nv.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, np.full(7, 0.5)
/// >>> np.isclose(condyle.kinetic_energy(arm, data, q, v), 0.5 * v @ condyle.crba(arm, data, q) @ v).item()
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v))]
pub(crate) fn kinetic_energy<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
) -> PyResult<f64> {
    let model = model.get();
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    Ok(condyle::forward_velocities(&model.inner, &mut data.inner, &q, &v).kinetic_energy())
}

/// V = −m gᵀ c(q), the potential energy of the moving bodies under gravity (J), 0 at the world's origin; O(n).
///
/// q: nq numbers.
#[pyfunction]
#[pyo3(signature = (model, data, q))]
pub(crate) fn potential_energy<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
) -> PyResult<f64> {
    let model = model.get();
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    Ok(condyle::forward_kinematics(&model.inner, &mut data.inner, &q).potential_energy())
}

/// E = T + V, the mechanical energy (J); O(n).
///
/// q: nq numbers; v: nv. Its rate is the power of the efforts and the external forces.
#[pyfunction]
#[pyo3(signature = (model, data, q, v))]
pub(crate) fn mechanical_energy<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
) -> PyResult<f64> {
    let model = model.get();
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    Ok(condyle::forward_velocities(&model.inner, &mut data.inner, &q, &v).mechanical_energy())
}

/// What the equations of motion are made of, from one pass to the tips and one back, in O(n depth), as
/// `AllTerms(M, h, centroidal, kinetic_energy, potential_energy)`.
///
/// q: nq numbers; v: nv. The numbers are those of `crba`, `nonlinear_effects`, `centroidal_map_rate`,
/// `kinetic_energy` and `potential_energy`, up to rounding.
///
/// >>> arm = condyle.robots.arm7()
/// >>> terms = condyle.compute_all_terms(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7)
/// >>> terms.M.shape, terms.h.shape, terms.centroidal.Ag.shape
/// ((7, 7), (7,), (6, 7))
#[pyfunction]
#[pyo3(signature = (model, data, q, v))]
pub(crate) fn compute_all_terms<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let terms = condyle::compute_all_terms(&model.inner, &mut data.inner, &q, &v);
    drop((q, v));
    named_tuple(py, &CLASS, "AllTerms")?.call1((
        give_matrix(py, terms.M, None)?,
        give(py, terms.h, None)?,
        give_map_rate(py, &terms.centroidal, None)?,
        terms.kinetic_energy,
        terms.potential_energy,
    ))
}
