//! Dynamics of a robot: free motion, motion in contact, inverse dynamics, and impacts.

pub(super) mod acceleration;
pub(super) mod batch;
pub(super) mod contact;
pub(super) mod free;
pub(super) mod group_kernel;
mod impact;
pub(super) mod impulse;
pub(super) mod inverse;
pub(super) mod inverse_contact;
pub(super) mod kkt_elimination;
mod limb_elimination;
pub(crate) mod robot;
mod sensitivities;
mod shared_data;
mod still;
