//! Public functions of this crate. Each function checks its arguments, selects an algorithm
//! ([`selection`](crate::selection)), and runs passes on [`Data`](crate::Data).

pub(crate) mod centroidal;
pub(crate) mod constrained_dynamics;
pub(crate) mod constrained_inverse;
pub(crate) mod derivatives;
mod differentiated;
pub(crate) mod forward_dynamics;
pub(crate) mod impulse_dynamics;
pub(crate) mod inertia;
pub(crate) mod inverse_dynamics;
pub(crate) mod kinematics;
mod limbs;
mod limbs_constrained;
pub(crate) mod parameter_derivatives;
pub(crate) mod regressor;
pub(crate) mod second_derivatives;
