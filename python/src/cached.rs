//! Attributes of a model as Python objects, made on first access and then kept, since a model never changes.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};

/// Attributes of a model whose Python objects are made once.
#[derive(Clone, Copy)]
pub(crate) enum Attribute {
    Names,
    BodyNames,
    JointTypes,
    Joints,
    Parents,
    IdxQs,
    IdxVs,
    Nqs,
    Nvs,
    Mimics,
    JointPlacements,
    Inertias,
    InertialParameters,
    Limits,
    Damping,
    DampingPolynomial,
    Springs,
    GravityCompensation,
    Actuators,
    Friction,
    Armature,
    Gravity,
    Warnings,
    Frames,
}

/// The Python objects of the attributes that were accessed so far.
pub(crate) struct Cached([PyOnceLock<Py<PyAny>>; Attribute::Frames as usize + 1]);

impl Cached {
    pub(crate) fn new() -> Self {
        Self([const { PyOnceLock::new() }; _])
    }

    /// Returns an immutable value, made on first access.
    pub(crate) fn value<'py>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        make: impl FnOnce() -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let value = self.0[attribute as usize].get_or_try_init(py, || make().map(Bound::unbind))?;
        Ok(value.bind(py).clone())
    }

    /// Returns a new list, which the caller may change, of items made on first access.
    pub(crate) fn list<'py, T>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        make: impl FnOnce() -> PyResult<Vec<T>>,
    ) -> PyResult<Bound<'py, PyList>>
    where
        T: IntoPyObject<'py>,
    {
        let tuple = self.value(py, attribute, || Ok(PyTuple::new(py, make()?)?.into_any()))?;
        Ok(tuple.cast_into::<PyTuple>()?.to_list())
    }
}
