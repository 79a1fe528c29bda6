//! First steps of a user, with the crate `condyle` alone: robots, points and forces, a plan, a controller and a
//! simulation.
#![deny(warnings)]

#[cfg(feature = "control")]
pub mod control;
pub mod kinematics;
#[cfg(test)]
mod panics;
pub mod simulation;
