//! Lanes: passes that compute several bodies of one state at a time.

pub(crate) mod limbs;
