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
