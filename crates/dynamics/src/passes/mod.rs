//! Passes of the algorithms. Each file contains one recursion over the bodies.
//!
//! A pass depends only on its [`Layout`](condyle_model::layout::Layout) and its workspace. It does not use `Data`, does
//! not check arguments, and contains no code for limbs or batches. The kernels of a pass visit one body after the
//! other.

pub(crate) mod aba;
pub(crate) mod all_terms;
pub(crate) mod answers;
pub(crate) mod centroidal;
mod com;
pub(crate) mod coriolis;
pub(crate) mod crba;
pub(crate) mod energy;
pub(crate) mod factored_dynamics;
pub(crate) mod frames;
pub(crate) mod free_armature;
mod gravity_compensation;
pub(crate) mod kinematics;
pub(crate) mod minv;
pub(crate) mod passive;
pub(crate) mod path_jacobian;
mod points;
pub(crate) mod regressor;
pub(crate) mod rnea;
mod springs;
pub(crate) mod statics;
