//! Passes that compute the limbs of one robot in parallel lanes. The schedule of [`condyle_model::limbs`] determines
//! the steps; each step computes four bodies.

mod constrained;
pub(crate) mod forces;
mod inverse;
mod lane_view;
pub(crate) mod lanes;
pub(crate) mod pass;

pub(crate) use condyle_model::limbs::{LANES, Plan};
pub(crate) use lane_view::LaneView;
