//! Attributes of a model as Python objects. The objects are made on first access and then kept, since a model never
//! changes.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};

/// An attribute of a model whose Python object is made once, on first access.
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

/// The Python objects of a model's attributes; an object is empty until the first access to its attribute.
pub(crate) struct Cached([PyOnceLock<Py<PyAny>>; Attribute::Frames as usize + 1]);

impl Cached {
    pub(crate) fn new() -> Self {
        Self([const { PyOnceLock::new() }; _])
    }

    /// Returns the immutable value of an attribute. `make` creates the value on first access.
    pub(crate) fn value<'py>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        make: impl FnOnce() -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let value = self.0[attribute as usize].get_or_try_init(py, || make().map(Bound::unbind))?;
        Ok(value.bind(py).clone())
    }

    /// Returns a new list with the items of an attribute; the caller may change the list. `make` creates the items on
    /// first access.
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
