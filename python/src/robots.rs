//! Where models come from, apart from files: the robots of our own, and pickles.

use crate::exceptions::ModelError;
use crate::functions::wrong_word;
use crate::model::Model;
use condyle::{Joint, robots};
use pyo3::prelude::*;

/// The joint between the world and a root link.
pub(crate) fn root(root_joint: Option<&str>) -> PyResult<Option<Joint>> {
    match root_joint {
        None => Ok(None),
        Some("free_flyer") => Ok(Some(Joint::FreeFlyer)),
        Some("planar") => Ok(Some(Joint::Planar)),
        Some("spherical") => Ok(Some(Joint::Spherical)),
        Some("translation") => Ok(Some(Joint::Translation)),
        Some(other) => {
            Err(wrong_word("root_joint", "None, 'free_flyer', 'planar', 'spherical' or 'translation'", other))
        }
    }
}

/// What a pickled model begins with: the library's version, since the form may change from one to the next.
pub(crate) const MAGIC: &str = concat!("condyle ", env!("CARGO_PKG_VERSION"), "\n");

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

/// A seven-axis arm with a fixed base, nq = nv = 7; its last frame is `tool`.
///
/// >>> condyle.robots.arm7()
/// <condyle.Model 'arm7': 7 bodies, nq = 7, nv = 7>
#[pyfunction]
pub(crate) fn arm7() -> Model {
    robots::arm7().into()
}

/// A quadruped of twelve joints on a free-flyer, nq = 19, nv = 18, with point feet `LF_foot`, `LH_foot`, `RF_foot`,
/// `RH_foot`.
///
/// >>> condyle.robots.quadruped()
/// <condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>
#[pyfunction]
pub(crate) fn quadruped() -> Model {
    robots::quadruped().into()
}

/// A humanoid of thirty-two joints on a free-flyer, nq = 39, nv = 38, with soles `left_sole`, `right_sole`.
///
/// >>> condyle.robots.humanoid()
/// <condyle.Model 'humanoid': 33 bodies, nq = 39, nv = 38>
#[pyfunction]
pub(crate) fn humanoid() -> Model {
    robots::humanoid().into()
}
