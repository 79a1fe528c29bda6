//! Differential dynamic programming, feasibility-driven or not.

mod best;
mod clock;
mod fddp;
mod rollout;
mod search;
mod settings;
mod shift;
mod solution;

pub use fddp::Fddp;
pub use settings::{DdpMethod, Settings};
pub use solution::{Iteration, Solution, Status, Timings};
