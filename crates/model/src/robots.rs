//! Robots of our own, embedded in the library: examples, tests and benches need no file.

use crate::io::urdf::UrdfOptions;
use crate::joint::Joint;
use crate::model::Model;

/// A seven-axis arm with a fixed base; its last frame is `tool`.
pub const ARM7: &str = include_str!("../models/arm7.urdf");
/// A quadruped of twelve joints with point feet `LF_foot`, `LH_foot`, `RF_foot`, `RH_foot`.
pub const QUADRUPED: &str = include_str!("../models/quadruped.urdf");
/// A humanoid of thirty-two joints with soles `left_sole`, `right_sole`.
pub const HUMANOID: &str = include_str!("../models/humanoid.urdf");

fn embedded(urdf: &str, root_joint: Option<Joint>) -> Model {
    Model::from_urdf_str(urdf, &UrdfOptions { root_joint, ..UrdfOptions::default() })
        .expect("the embedded robots are well-formed")
}

/// The model of [`ARM7`], nq = nv = 7.
pub fn arm7() -> Model {
    embedded(ARM7, None)
}

/// The model of [`QUADRUPED`] on a free-flyer, nq = 19, nv = 18.
pub fn quadruped() -> Model {
    embedded(QUADRUPED, Some(Joint::FreeFlyer))
}

/// The model of [`HUMANOID`] on a free-flyer, nq = 39, nv = 38.
pub fn humanoid() -> Model {
    embedded(HUMANOID, Some(Joint::FreeFlyer))
}
