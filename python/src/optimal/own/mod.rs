//! Actions defined by the user: given as matrices, or written in Python.

mod action;
mod automatic;
mod constrained;
mod control_rate;
mod differential;
mod expansion;
mod functions;
mod lqr;
mod residual;
mod space;

pub(crate) use action::Action;
pub(super) use automatic::Way;
pub(crate) use constrained::ConstrainedAction;
pub(crate) use control_rate::ControlRate;
pub(crate) use differential::DifferentialAction;
pub(super) use functions::{Fault, Functions};
pub(super) use lqr::write;
pub(crate) use lqr::{Lqr, Unicycle};
pub(super) use residual::{OwnFunction, faults};
pub(super) use space::Space;

/// Maximum size of a state, a control or a constraint. The size is limited because matrices of these sizes are stored
/// for each knot.
pub(super) const MOST_SIZE: usize = condyle::optimal::LqKnot::MOST_SIZE;
