//! Positions of a robot that have names.

use alloc::string::String;
use alloc::vec::Vec;

/// State with a name that a robot's file has, such as `home`.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Keyframe {
    /// Name.
    pub name: String,
    /// Position, nq numbers.
    pub q: Vec<f64>,
    /// Velocity, nv numbers.
    pub v: Vec<f64>,
    /// Control of each of the model's [`actuators`](crate::Model::actuators), in their order; 0 where the file has none.
    #[cfg_attr(feature = "serde", serde(default))]
    pub control: Vec<f64>,
}
