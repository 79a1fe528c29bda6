//! Tests the first steps of a user who depends only on the crate `condyle`: robots, points and forces, a plan, a
//! controller and a simulation.
#![deny(warnings)]

#[cfg(feature = "control")]
pub mod control;
pub mod kinematics;
#[cfg(test)]
mod panics;
pub mod simulation;
