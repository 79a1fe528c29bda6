//! Built-in robots.

use crate::model::Model;
use condyle::robots;
use pyo3::prelude::*;

/// Returns a seven-axis arm with a fixed base, nq = nv = 7; its last frame is `tool`.
///
/// >>> condyle.robots.arm7()
/// <condyle.Model 'arm7': 7 bodies, nq = 7, nv = 7>
#[pyfunction]
pub(crate) fn arm7() -> Model {
    robots::arm7().into()
}

/// Returns a quadruped with twelve joints on a free-flyer, nq = 19, nv = 18, with point feet `LF_foot`, `LH_foot`,
/// `RF_foot`, `RH_foot`.
///
/// >>> condyle.robots.quadruped()
/// <condyle.Model 'quadruped': 13 bodies, nq = 19, nv = 18>
#[pyfunction]
pub(crate) fn quadruped() -> Model {
    robots::quadruped().into()
}

/// Returns a humanoid with thirty-two joints on a free-flyer, nq = 39, nv = 38, with soles `left_sole`, `right_sole`.
///
/// >>> condyle.robots.humanoid()
/// <condyle.Model 'humanoid': 33 bodies, nq = 39, nv = 38>
#[pyfunction]
pub(crate) fn humanoid() -> Model {
    robots::humanoid().into()
}
