//! Checks that an object made for one robot is used only with matching robots.

use crate::model::Model;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The models with which an object may be used: the model for which it was made, and all models with the same bodies
/// and joints.
pub(crate) struct MadeFor {
    structure: u64,
    /// Hash of the placements of joints and frames; `None` if the placements are not compared.
    geometry: Option<u64>,
    /// Name of the model for which the object was made.
    pub(crate) name: String,
}

impl MadeFor {
    pub(crate) fn new(model: &Model) -> Self {
        Self { structure: model.structure, geometry: None, name: model.inner.name().to_owned() }
    }

    /// Creates a check that accepts only models with the same bodies and joints and with equal placements of joints and
    /// frames.
    pub(crate) fn with_geometry(model: &Model) -> Self {
        Self { geometry: Some(model.inner.geometry_hash()), ..Self::new(model) }
    }

    /// Raises a `ValueError` if the model does not match; `argument` is the name of the argument that contains the
    /// object.
    pub(crate) fn check(&self, argument: &str, model: &Model) -> PyResult<()> {
        let elsewhere = self.geometry.is_some_and(|geometry| geometry != model.inner.geometry_hash());
        if self.structure == model.structure && !elsewhere {
            return Ok(());
        }
        let (made, given) = (&self.name, model.inner.name());
        let why = if self.structure == model.structure { ", whose joints or frames are elsewhere" } else { "" };
        Err(PyValueError::new_err(format!(
            "{argument}: made for another model ('{made}'), not for this '{given}'{why}"
        )))
    }
}
