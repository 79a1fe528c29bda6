//! The scratch of the algorithms.

use crate::hyper_dual::Hyper;
use crate::model::Model;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;

/// Scratch and results of every algorithm, for one model: made once, used by one thread at a time.
///
/// It serves all models of the same bodies and joints, whatever their gravity, armature or inertias. No algorithm reads
/// what another left behind, so calls may come in any order. To use one from two threads at once is a `RuntimeError`;
/// with another robot's model, a `ValueError`.
///
/// Functions called with many states at once, q of shape (N, nq), compute several of them side by side in vector
/// registers, and on so many threads.
///
/// >>> arm = condyle.robots.arm7()
/// >>> condyle.Data(arm)
/// <condyle.Data of 'arm7'>
#[pyclass(module = "condyle")]
pub(crate) struct Data {
    pub(crate) inner: condyle::Data<f64>,
    structure: u64,
    name: String,
    threads: usize,
    /// For hyper-dual numbers, once they were asked for.
    pub(crate) dual: Option<Box<condyle::Data<Hyper>>>,
    /// For as many states as were asked for at most.
    batch: Option<Box<condyle::Batch>>,
}

#[pymethods]
impl Data {
    #[new]
    #[pyo3(signature = (model, threads = 1))]
    fn new(model: &Bound<'_, Model>, threads: usize) -> PyResult<Self> {
        if threads == 0 {
            return Err(PyValueError::new_err("threads: expected at least 1, found 0"));
        }
        let Model { inner, structure } = model.get();
        let (structure, name) = (*structure, inner.name().to_owned());
        Ok(Self { inner: condyle::Data::new(inner), structure, name, threads, dual: None, batch: None })
    }

    /// The robot's name.
    fn __repr__(&self) -> String {
        format!("<condyle.Data of '{}'>", self.name)
    }
}

impl Data {
    /// Room for so many states.
    pub(crate) fn batch(&mut self, model: &condyle::Model, states: usize) -> &mut condyle::Batch {
        let enough = self.batch.take().filter(|batch| batch.capacity() >= states);
        let threads = self.threads;
        self.batch.insert(enough.unwrap_or_else(|| Box::new(condyle::Batch::new(model, states, threads))))
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
