//! Linear-quadratic problem of a horizon, and the sweep that solves it.

mod box_qp;
mod conditional_value;
mod feedback;
mod forms;
mod forward;
mod knot;
mod lane_step;
mod lanes;
mod row_terms;
mod rows;
mod segments;
mod step;
mod structure;
mod sweep;
mod workspace;

pub(crate) use feedback::Gains;
pub use feedback::KnotFeedback;
pub(crate) use forms::CurvatureFn;
pub(crate) use forward::Forward;
pub(crate) use knot::DIVERGED;
pub use knot::{Hessian, LqKnot};
pub(crate) use lanes::{LaneResult, LaneSweep, MOST_LANES, lane_sweep};
pub(crate) use row_terms::RowTerms;
pub(crate) use rows::MOST_FORMS;
pub use rows::{ConstraintRow, ConstraintRows};
pub use step::SweepError;
pub(crate) use step::SweepOutput;
pub use structure::{DynamicsStructure, EulerBlock};
pub(crate) use structure::{InverseDynamicsForm, LARGEST_BLOCK};
pub use sweep::Sweep;
