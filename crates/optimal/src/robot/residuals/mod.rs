//! Residuals, which costs and limits read, and their computation.

pub(super) mod autodiff;
pub(super) mod cones;
pub(super) mod distance;
pub(super) mod gravity_residual;
pub(super) mod kernel;
pub(super) mod layout;
pub(super) mod own;
pub(super) mod residual;
pub(super) mod rows;
pub(super) mod target;
pub(super) mod terms;
pub(super) mod view;
