//! Linear-quadratic problem, which is all that a solver knows of a horizon, and the sweep that solves it.

mod box_qp;
mod conditional_value;
mod forms;
mod gains;
mod inverse_dynamics_form;
mod knot;
mod segments;
mod step;
mod structure;
mod sweep;
mod workspace;

pub(crate) use gains::Gains;
pub(crate) use inverse_dynamics_form::InverseDynamicsForm;
pub(crate) use knot::DIVERGED;
pub use knot::{Hessian, KnotFeedback, LqKnot};
pub use step::SweepError;
pub(crate) use structure::LARGEST_BLOCK;
pub use structure::{DynamicsStructure, EulerBlock};
pub use sweep::Sweep;
