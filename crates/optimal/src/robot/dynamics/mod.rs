//! Dynamics of a robot: knots that move freely, in contact, by given accelerations, or that jump.

mod batch;
pub(super) mod contact;
pub(super) mod free;
pub(super) mod impulse;
pub(super) mod inverse;
pub(super) mod inverse_contact;
pub(super) mod kkt_elimination;
pub(super) mod knots;
mod limb_elimination;
mod robot;
mod sensitivities;
