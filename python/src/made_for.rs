//! Which robots something may be used with that was made for one.

use crate::model::Model;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The models that something was made for: one, and all others of the same bodies and joints.
pub(crate) struct MadeFor {
    structure: u64,
    /// The hash of the places of joints and frames, where they matter.
    geometry: Option<u64>,
    /// The name of the model that it was made for.
    pub(crate) name: String,
}

impl MadeFor {
    pub(crate) fn new(model: &Model) -> Self {
        Self { structure: model.structure, geometry: None, name: model.inner.name().to_owned() }
    }

    /// The models of the same bodies and joints whose joints and frames are in the same places.
    pub(crate) fn with_geometry(model: &Model) -> Self {
        Self { geometry: Some(model.inner.geometry_hash()), ..Self::new(model) }
    }

    /// Raises a `ValueError` if the model is another one; `argument` names what was made.
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
