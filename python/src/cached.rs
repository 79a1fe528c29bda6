//! What a model shows of itself, made when it is first asked for: it never changes.

use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyList, PyTuple};

/// The attributes that are made once.
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

/// The attributes that were asked for.
pub(crate) struct Cached([PyOnceLock<Py<PyAny>>; Attribute::Frames as usize + 1]);

impl Cached {
    pub(crate) fn new() -> Self {
        Self([const { PyOnceLock::new() }; _])
    }

    /// A value, which nobody can change.
    pub(crate) fn value<'py>(
        &self,
        py: Python<'py>,
        attribute: Attribute,
        make: impl FnOnce() -> PyResult<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let value = self.0[attribute as usize].get_or_try_init(py, || make().map(Bound::unbind))?;
        Ok(value.bind(py).clone())
    }

    /// A list of the caller's own, of what is made once.
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
