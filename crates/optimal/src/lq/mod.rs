//! Linear-quadratic problem, which is all that a solver knows of a horizon, and the sweep that solves it.

mod box_qp;
mod conditional_value;
mod forms;
mod gains;
mod inverse_dynamics_form;
mod node;
mod segments;
mod step;
mod structure;
mod sweep;
mod workspace;

pub(crate) use gains::Gains;
pub(crate) use inverse_dynamics_form::InverseDynamicsForm;
pub(crate) use node::DIVERGED;
pub use node::{Hessian, LqKnot, LqNode};
pub use step::SweepError;
pub(crate) use structure::LARGEST_BLOCK;
pub use structure::{EulerBlock, Structure};
pub use sweep::Sweep;
