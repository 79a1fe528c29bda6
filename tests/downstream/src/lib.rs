//! The first day of a user: robots, points and forces, a plan, a controller and a simulation, by the façade alone.
#![deny(warnings)]

#[cfg(feature = "control")]
pub mod control;
pub mod kinematics;
#[cfg(test)]
mod panics;
pub mod simulation;
