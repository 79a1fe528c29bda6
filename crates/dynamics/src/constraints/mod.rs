//! Constraints: contacts and loops, the plans of constraints in a model, and the passes of dynamics under constraints.

pub(crate) mod constrained_derivatives;
pub(crate) mod constrained_dynamics;
pub(crate) mod constraint;
pub(crate) mod constraint_lanes;
pub(crate) mod constraint_motion;
pub(crate) mod constraint_set;
mod delassus;
pub(crate) mod impulse_dynamics;
pub(crate) mod islands;
pub(crate) mod kkt_derivatives;
pub(crate) mod plan;
#[cfg(feature = "serde")]
mod written;
