//! The scratch of the algorithms.

use crate::model::Model;
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
    structure: u64,
    name: String,
}

#[pymethods]
impl Data {
    #[new]
    fn new(model: &Bound<'_, Model>) -> Self {
        let Model { inner, structure } = model.get();
        Self { inner: condyle::Data::new(inner), structure: *structure, name: inner.name().to_owned() }
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
