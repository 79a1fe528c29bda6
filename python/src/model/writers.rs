//! Methods that convert a model to files, text, pickles, and models of other libraries.

use super::Model;
use crate::exceptions::{ModelError, ParseError, exception};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

#[pymethods]
impl Model {
    /// Writes inertias, limits, damping, friction and armature into a copy of the URDF `original`. All other contents
    /// stay the same.
    ///
    /// Only values that differ from the original are edited, so an unchanged robot gives the same bytes. Reading the
    /// new file gives this model again, up to rounding. `original` and `path` may be the same file. If fixed joints
    /// merge several links into one body, changes of the body's inertia are written to the link that the moving joint
    /// carries. An armature becomes the rotor inertia of a `<transmission>`.
    ///
    /// path: the new file. original: the file from which the robot was read.
    ///
    /// Raises `ParseError` if the format cannot express a value, such as an infinite limit, or if the file belongs to
    /// another robot. The message contains the element and both numbers.
    fn write_urdf(&self, path: PathBuf, original: PathBuf) -> PyResult<()> {
        self.inner.write_urdf(path, original).map_err(exception)
    }

    /// Writes the numbers that `write_urdf` writes into a copy of the MJCF `original`.
    ///
    /// Changed bodies and joints must be in the file itself, not in an included file. Effort limits are written as
    /// `actuatorfrcrange` of the joint.
    ///
    /// path: the new file. original: the file from which the robot was read.
    ///
    /// Raises `ParseError` as `write_urdf` does.
    fn write_mjcf(&self, path: PathBuf, original: PathBuf) -> PyResult<()> {
        self.inner.write_mjcf(path, original).map_err(exception)
    }

    /// Returns the model as JSON, with all digits; `from_json` returns an equal model. An infinite limit is written as
    /// `null`.
    ///
    /// The text may be edited; `from_json` checks its contents.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> condyle.Model.from_json(arm.to_json()).to_json() == arm.to_json()
    /// True
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&*self.inner).map_err(|e| ModelError::new_err(format!("cannot be written: {e}")))
    }

    /// Reads a model from the JSON that `to_json` returns.
    ///
    /// Raises `ParseError` for an invalid text; the error contains line and column.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let model: condyle::Model =
            serde_json::from_str(text).map_err(|e| ParseError::new_err(format!("<string>: no model in JSON: {e}")))?;
        Ok(model.into())
    }

    /// Returns the same robot as a `pinocchio.Model`; requires Pinocchio 3 or later.
    ///
    /// Mimic joints remain mimic joints; a mimic joint that turns without limits is an error. Springs, damping that
    /// depends on the speed, gravity compensation, actuators, keyframes and constraints are left out. Each item that is
    /// left out causes a `UserWarning`, whose argument is a `ModelWarning`.
    fn to_pinocchio<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("condyle._pinocchio_models")?;
        module.call_method1("to_pinocchio", (slf,))
    }

    /// Returns the function and the bytes from which `pickle` makes an equal model.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let py = slf.py();
        let bytes = postcard::to_extend(&*slf.get().inner, MAGIC.as_bytes().to_vec())
            .map_err(|e| ModelError::new_err(format!("cannot be pickled: {e}")))?;
        let make = py.import("condyle._condyle")?.getattr("_model_from_bytes")?;
        Ok((make, (PyBytes::new(py, &bytes),)))
    }
}

/// First bytes of a pickled model, with the library's version: the format may change between versions.
const MAGIC: &str = concat!("condyle ", env!("CARGO_PKG_VERSION"), "\n");

/// Creates the model from the bytes of a pickle.
#[pyfunction]
#[pyo3(name = "_model_from_bytes")]
pub(crate) fn model_from_bytes(data: &[u8]) -> PyResult<Model> {
    let Some(model) = data.strip_prefix(MAGIC.as_bytes()) else {
        let version = env!("CARGO_PKG_VERSION");
        return Err(ModelError::new_err(format!(
            "pickle was not written by condyle {version}, or does not contain a Model"
        )));
    };
    let model: condyle::Model =
        postcard::from_bytes(model).map_err(|e| ModelError::new_err(format!("the pickle is damaged: {e}")))?;
    Ok(model.into())
}
