//! Limbs of one robot in parallel lanes: passes over the schedule of [`condyle_model::limbs`], four bodies at a time.

mod constrained;
pub(crate) mod forces;
mod inverse;
mod lane_view;
pub(crate) mod lanes;
pub(crate) mod pass;

pub(crate) use condyle_model::limbs::{LANES, Plan};
pub(crate) use lane_view::LaneView;
