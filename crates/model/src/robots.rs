//! Built-in robots, so that examples, tests and benchmarks need no files.

use crate::io::urdf::UrdfOptions;
use crate::joint::Joint;
use crate::model::Model;

/// URDF of a seven-axis arm with a fixed base; its last frame is `tool`.
pub const ARM7: &str = include_str!("../models/arm7.urdf");
/// URDF of a quadruped with twelve joints and the point feet `LF_foot`, `LH_foot`, `RF_foot`, `RH_foot`.
pub const QUADRUPED: &str = include_str!("../models/quadruped.urdf");
/// URDF of a humanoid with thirty-two joints and the soles `left_sole`, `right_sole`.
pub const HUMANOID: &str = include_str!("../models/humanoid.urdf");

fn embedded(urdf: &str, root_joint: Option<Joint>) -> Model {
    Model::from_urdf_str(urdf, &UrdfOptions { root_joint, ..UrdfOptions::default() })
        .expect("the embedded robots are well-formed")
}

/// Returns the model of [`ARM7`], nq = nv = 7.
pub fn arm7() -> Model {
    embedded(ARM7, None)
}

/// Returns the model of [`QUADRUPED`] on a free-flyer, nq = 19, nv = 18.
pub fn quadruped() -> Model {
    embedded(QUADRUPED, Some(Joint::FreeFlyer))
}

/// Returns the model of [`HUMANOID`] on a free-flyer, nq = 39, nv = 38.
pub fn humanoid() -> Model {
    embedded(HUMANOID, Some(Joint::FreeFlyer))
}
