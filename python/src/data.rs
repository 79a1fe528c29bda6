//! The scratch of the algorithms, and what their arguments have in common.

use crate::arrays::{Input, matrix};
use crate::exceptions::ModelError;
use crate::model::Model;
use condyle::Force;
use nalgebra::DMatrix;
use numpy::Ix2;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Scratch and results of every algorithm, for one model: made once, used by one thread at a time.
///
/// It serves all models of the same bodies and joints, whatever their gravity, armature or inertias. No algorithm reads
/// what another left behind, so calls may come in any order. To use one from two threads at once is a `RuntimeError`;
/// with another robot's model, a `ValueError`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> condyle.Data(arm)
/// <condyle.Data of 'arm7'>
#[pyclass(module = "condyle")]
pub(crate) struct Data {
    pub(crate) inner: condyle::Data<f64>,
    pub(crate) forces: Vec<Force<f64>>,
    pub(crate) jacobian: DMatrix<f64>,
    structure: u64,
    name: String,
}

#[pymethods]
impl Data {
    #[new]
    fn new(model: &Bound<'_, Model>) -> Self {
        let Model { inner, structure } = model.get();
        Self {
            inner: condyle::Data::new(inner),
            forces: vec![Force::zero(); inner.bodies().len()],
            jacobian: DMatrix::zeros(6, inner.nv()),
            structure: *structure,
            name: inner.name().to_owned(),
        }
    }

    /// The robot's name.
    fn __repr__(&self) -> String {
        format!("<condyle.Data of '{}'>", self.name)
    }
}

/// The scratch for a call, if it is this model's and free.
pub(crate) fn scratch<'py>(model: &Model, data: &Bound<'py, Data>) -> PyResult<PyRefMut<'py, Data>> {
    let data = data
        .try_borrow_mut()
        .map_err(|_| PyRuntimeError::new_err("data: in use by another call; give each thread a Data of its own"))?;
    if data.structure != model.structure {
        let (made, given) = (&data.name, model.inner.name());
        return Err(PyValueError::new_err(format!("data: made for another model ('{made}'), not for this '{given}'")));
    }
    Ok(data)
}

/// That the inertia matrix of a robot has an inverse.
pub(crate) fn regular(model: &Model) -> PyResult<()> {
    match model.inner.warnings().iter().find(|w| matches!(w, condyle::Warning::Singular { .. })) {
        None => Ok(()),
        Some(singular) => Err(ModelError::new_err(singular.to_string())),
    }
}

/// The external forces of a call: one row for each body, or none at all.
pub(crate) fn external<'a>(
    forces: &'a mut [Force<f64>],
    f_ext: Option<&Bound<'_, PyAny>>,
) -> PyResult<&'a [Force<f64>]> {
    let Some(f_ext) = f_ext else { return Ok(&[]) };
    let rows: Input<'_, Ix2> = matrix("f_ext", f_ext, [forces.len(), 6])?;
    for (force, &row) in forces.iter_mut().zip(rows.as_chunks::<6>().0) {
        *force = row.into();
    }
    Ok(forces)
}

/// The members of `out` of a function that returns several arrays, or none of them.
pub(crate) fn members<'py, const N: usize>(
    out: Option<&Bound<'py, PyAny>>,
    names: &str,
) -> PyResult<[Option<Bound<'py, PyAny>>; N]> {
    let Some(out) = out else { return Ok([const { None }; N]) };
    let members: Vec<Bound<'py, PyAny>> = out.try_iter()?.collect::<PyResult<_>>()?;
    let found = members.len();
    let members: [Bound<'py, PyAny>; N] = members
        .try_into()
        .map_err(|_| PyValueError::new_err(format!("out: expected {N} arrays ({names}), found {found}")))?;
    Ok(members.map(Some))
}
