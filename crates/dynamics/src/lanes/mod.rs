//! Passes in lanes: they compute several bodies of one state at once.

pub(crate) mod limbs;
