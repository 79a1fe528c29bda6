//! Models into files, text, pickles, and other libraries.

use super::Model;
use crate::exceptions::{ModelError, ParseError, exception};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::PathBuf;

#[pymethods]
impl Model {
    /// Writes inertias, limits, damping, friction and armature into a copy of the URDF `original`, and all else as it is
    /// there.
    ///
    /// Only what differs from the original is edited, so an unchanged robot gives the same bytes. Reading the new file
    /// gives this model back, up to rounding. `original` may be `path`. Of several links that fixed joints merge, the one
    /// that the joint carries takes the difference. An armature becomes the rotor inertia of a `<transmission>`.
    ///
    /// path: the new file. original: the file that the robot was read from.
    ///
    /// Raises `ParseError` with the thing and both numbers if the file cannot say it, as an infinite limit, or is that of
    /// another robot.
    fn write_urdf(&self, path: PathBuf, original: PathBuf) -> PyResult<()> {
        self.inner.write_urdf(path, original).map_err(exception)
    }

    /// Writes the same into a copy of the MJCF `original`; see `write_urdf`.
    ///
    /// Bodies and joints that differ must be in the file itself, not in one that it includes. Limits of effort are written
    /// as `actuatorfrcrange` of the joint.
    ///
    /// path: the new file. original: the file that the robot was read from.
    ///
    /// Raises `ParseError` as `write_urdf` does.
    fn write_mjcf(&self, path: PathBuf, original: PathBuf) -> PyResult<()> {
        self.inner.write_mjcf(path, original).map_err(exception)
    }

    /// The model as JSON, with all digits; `from_json` gives an equal one. `null` stands for a limit that is infinite.
    ///
    /// The text may be edited: what it says is checked when it is read.
    ///
    /// >>> arm = condyle.robots.arm7()
    /// >>> condyle.Model.from_json(arm.to_json()).to_json() == arm.to_json()
    /// True
    fn to_json(&self) -> PyResult<String> {
        serde_json::to_string(&*self.inner).map_err(|e| ModelError::new_err(format!("cannot be written: {e}")))
    }

    /// A model from the JSON that `to_json` gives.
    ///
    /// Raises `ParseError`, with line and column.
    #[staticmethod]
    fn from_json(text: &str) -> PyResult<Self> {
        let model: condyle::Model =
            serde_json::from_str(text).map_err(|e| ParseError::new_err(format!("<string>: no model in JSON: {e}")))?;
        Ok(model.into())
    }

    /// The same robot as a `pinocchio.Model`, which needs Pinocchio 3 or later.
    ///
    /// Joints that follow others do so there too, unless they turn without limits.
    fn to_pinocchio<'py>(slf: Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("condyle._pinocchio_models")?;
        module.call_method1("to_pinocchio", (slf,))
    }

    /// Returns the parts of a pickle.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let py = slf.py();
        let bytes = postcard::to_extend(&*slf.get().inner, MAGIC.as_bytes().to_vec())
            .map_err(|e| ModelError::new_err(format!("cannot be pickled: {e}")))?;
        let make = py.import("condyle._condyle")?.getattr("_model_from_bytes")?;
        Ok((make, (PyBytes::new(py, &bytes),)))
    }
}

/// The beginning of a pickled model: the library's version, since the form may change from one to the next.
const MAGIC: &str = concat!("condyle ", env!("CARGO_PKG_VERSION"), "\n");

/// The model that a pickle holds.
#[pyfunction]
#[pyo3(name = "_model_from_bytes")]
pub(crate) fn model_from_bytes(data: &[u8]) -> PyResult<Model> {
    let Some(model) = data.strip_prefix(MAGIC.as_bytes()) else {
        let version = env!("CARGO_PKG_VERSION");
        return Err(ModelError::new_err(format!("the pickle is not of condyle {version}, or of no model")));
    };
    let model: condyle::Model =
        postcard::from_bytes(model).map_err(|e| ModelError::new_err(format!("the pickle is damaged: {e}")))?;
    Ok(model.into())
}
