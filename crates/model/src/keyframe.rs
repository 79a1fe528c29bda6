//! Named states of a robot.

use alloc::string::String;
use alloc::vec::Vec;

/// Named state in a robot's file, such as `home`.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Keyframe {
    /// Name of the state.
    pub name: String,
    /// Position q, nq numbers.
    pub q: Vec<f64>,
    /// Velocity v, nv numbers.
    pub v: Vec<f64>,
    /// Control of each of the model's [`actuators`](crate::Model::actuators), in their order; 0 if the file contains no
    /// control.
    #[cfg_attr(feature = "serde", serde(default))]
    pub control: Vec<f64>,
}
