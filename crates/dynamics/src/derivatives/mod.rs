//! Analytical derivatives of the passes. Each file contains one algorithm in the form of a pass.

pub(crate) mod aba_derivatives;
pub(crate) mod aba_hessian;
pub(crate) mod centroidal_derivatives;
mod frame_derivatives;
pub(crate) mod rnea_derivatives;
pub(crate) mod rnea_hessian;
pub(crate) mod tree_solve;
