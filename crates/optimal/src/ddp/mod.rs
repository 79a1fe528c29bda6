//! Differential dynamic programming, feasibility-driven or not.

mod best;
mod clock;
mod fddp;
mod iterations;
mod observer;
mod progress;
mod recover;
mod rollout;
mod search;
mod settings;
mod shift;
mod solution;

pub(crate) use clock::Recent;
pub use fddp::Fddp;
pub(crate) use fddp::Rules;
pub(crate) use observer::Unobserved;
pub use observer::{Observer, Verdict};
pub use settings::{DdpMethod, Settings};
pub use solution::{Iteration, Solution, Status, Timings};
