//! Passes that compute several bodies of one state at once, one body per lane.

pub(crate) mod limbs;
