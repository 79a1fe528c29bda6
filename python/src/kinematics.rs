//! Where bodies and frames are and how they move: the library's functions one to one.

use crate::arrays::{give, give_matrix, give_pose, output, vector, write_pose};
use crate::data::{Data, scratch};
use crate::model::Model;
use condyle::ReferenceFrame;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The frame of reference with this name.
fn reference_frame(name: &str) -> PyResult<ReferenceFrame> {
    match name {
        "local" => Ok(ReferenceFrame::Local),
        "world" => Ok(ReferenceFrame::World),
        "local_world_aligned" => Ok(ReferenceFrame::LocalWorldAligned),
        other => {
            let expected = "expected 'local', 'world' or 'local_world_aligned'";
            Err(PyValueError::new_err(format!("reference: {expected}, found '{other}'")))
        }
    }
}

/// Where all bodies are: (nbodies, 4, 4), the pose of each body in the world as a homogeneous matrix; O(n).
///
/// q: nq numbers. Body i is the one that joint i carries, in the frame that the URDF gives it; body 0 is the world.
/// A frame's pose is that of its body times its placement: `poses[f.body] @ f.placement`; or see `frame_placement`.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> data = condyle.Data(quadruped)
/// >>> condyle.forward_kinematics(quadruped, data, condyle.neutral(quadruped)).shape
/// (14, 4, 4)
#[pyfunction]
#[pyo3(signature = (model, data, q, out=None))]
pub(crate) fn forward_kinematics<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let q = vector("q", q, model.inner.nq())?;
    let placements = condyle::forward_kinematics(&model.inner, &mut data.inner, &q);
    drop(q);
    output(py, out, &[model.inner.bodies().len(), 4, 4], |x| {
        for (body, x) in x.chunks_exact_mut(16).enumerate() {
            write_pose(&placements.body(body), x);
        }
    })
}

/// oXf, the pose of a frame in the world: (4, 4), a homogeneous matrix that takes coordinates in the frame to
/// coordinates in the world; O(n).
///
/// q: nq numbers; frame: its name or number.
///
/// >>> arm = condyle.robots.arm7()
/// >>> tool = condyle.frame_placement(arm, condyle.Data(arm), [0.0] * 7, "tool")
/// >>> bool(tool[2, 3] > 0.5)  # stretched upwards
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, frame, out=None))]
pub(crate) fn frame_placement<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let frame = model.frame_index(frame)?;
    let q = vector("q", q, model.inner.nq())?;
    let pose = condyle::forward_kinematics(&model.inner, &mut data.inner, &q).frame(frame);
    drop(q);
    give_pose(py, &pose, out)
}

/// The Jacobian J of a frame, (6, nv), linear rows first: the frame's velocity is J v.
///
/// q: nq numbers; frame: its name or number. reference: 'local', the velocity in the frame itself; 'world', that of
/// the body's point at the world's origin, along the world's axes; or 'local_world_aligned', that of the frame's
/// origin, along the world's axes.
///
/// >>> arm = condyle.robots.arm7()
/// >>> condyle.frame_jacobian(arm, condyle.Data(arm), [0.0] * 7, "tool", "local_world_aligned").shape
/// (6, 7)
#[pyfunction]
#[pyo3(signature = (model, data, q, frame, reference="local", out=None))]
pub(crate) fn frame_jacobian<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    reference: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let reference = reference_frame(reference)?;
    let frame = model.frame_index(frame)?;
    let q = vector("q", q, model.inner.nq())?;
    let Data { inner, jacobian, .. } = &mut *data;
    condyle::forward_kinematics(&model.inner, inner, &q).frame_jacobian(frame, reference, jacobian);
    drop(q);
    give_matrix(py, jacobian, out)
}

/// The velocity of a frame, 6 numbers: of its body's point at the origin of the reference (m/s), then of its
/// rotation (rad/s); O(n).
///
/// q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, [0.5] * 7
/// >>> J = condyle.frame_jacobian(arm, data, q, "tool")
/// >>> np.allclose(condyle.frame_velocity(arm, data, q, v, "tool"), J @ v)
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, frame, reference="local", out=None))]
pub(crate) fn frame_velocity<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    reference: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (frame, reference) = (model.frame_index(frame)?, reference_frame(reference)?);
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let motion = condyle::forward_velocities(&model.inner, &mut data.inner, &q, &v).frame_velocity(frame, reference);
    drop((q, v));
    give(py, &motion.to_array(), out)
}

/// The spatial acceleration of a frame, 6 numbers (m/s², then rad/s²), without gravity: the rate of its spatial
/// velocity, seen from the world, expressed in the reference; O(n).
///
/// q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, frame, reference="local", out=None))]
pub(crate) fn frame_acceleration<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    reference: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (frame, reference) = (model.frame_index(frame)?, reference_frame(reference)?);
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, a) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("a", a, nv)?);
    let motion =
        condyle::forward_accelerations(&model.inner, &mut data.inner, &q, &v, &a).frame_acceleration(frame, reference);
    drop((q, v, a));
    give(py, &motion.to_array(), out)
}

/// The classical acceleration of a frame, 6 numbers: v̇ + ω × v of its body's point at the origin of the reference
/// (m/s²), then of its rotation (rad/s²); in 'local_world_aligned' p̈ of the frame's origin; O(n).
///
/// q: nq numbers; v, a: nv; frame: its name or number; reference: as for `frame_jacobian`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v, a = condyle.Data(arm), [0.3] * 7, [0.5] * 7, [0.2] * 7
/// >>> J = condyle.frame_jacobian(arm, data, q, "tool", "local_world_aligned")
/// >>> dJ = condyle.frame_jacobian_rate(arm, data, q, v, "tool", "local_world_aligned")
/// >>> acceleration = condyle.frame_classical_acceleration(arm, data, q, v, a, "tool", "local_world_aligned")
/// >>> np.allclose(acceleration, J @ a + dJ @ v)
/// True
#[pyfunction]
#[pyo3(signature = (model, data, q, v, a, frame, reference="local", out=None))]
pub(crate) fn frame_classical_acceleration<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    a: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    reference: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (frame, reference) = (model.frame_index(frame)?, reference_frame(reference)?);
    let (nq, nv) = (model.inner.nq(), model.inner.nv());
    let (q, v, a) = (vector("q", q, nq)?, vector("v", v, nv)?, vector("a", a, nv)?);
    let motion = condyle::forward_accelerations(&model.inner, &mut data.inner, &q, &v, &a)
        .frame_classical_acceleration(frame, reference);
    drop((q, v, a));
    give(py, &motion.to_array(), out)
}

/// dJ/dt, the rate of a frame's Jacobian along v, (6, nv), linear rows first.
///
/// q: nq numbers; v: nv; frame: its name or number; reference: as for `frame_jacobian`. dJ v + J a is the spatial
/// acceleration in 'local' and 'world', and the classical one in 'local_world_aligned', whose origin moves with the
/// frame.
#[pyfunction]
#[pyo3(signature = (model, data, q, v, frame, reference="local", out=None))]
pub(crate) fn frame_jacobian_rate<'py>(
    model: &Bound<'py, Model>,
    data: &Bound<'py, Data>,
    q: &Bound<'py, PyAny>,
    v: &Bound<'py, PyAny>,
    frame: &Bound<'py, PyAny>,
    reference: &str,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (py, model) = (model.py(), model.get());
    let mut data = scratch(model, data)?;
    let (frame, reference) = (model.frame_index(frame)?, reference_frame(reference)?);
    let (q, v) = (vector("q", q, model.inner.nq())?, vector("v", v, model.inner.nv())?);
    let Data { inner, jacobian, .. } = &mut *data;
    condyle::forward_velocities(&model.inner, inner, &q, &v).frame_jacobian_rate(frame, reference, jacobian);
    drop((q, v));
    give_matrix(py, jacobian, out)
}
