//! Robot models, rigid-body algorithms and their exact derivatives.
//!
//! A [`Model`] is frozen and shared; a [`Data`] is one thread's scratch; an algorithm is a function of both:
//!
//! ```
//! use condyle_dynamics::{Data, aba, robots};
//! let quadruped = robots::quadruped();
//! let mut data = Data::new(&quadruped);
//! let q = condyle_dynamics::neutral(&quadruped);
//! let a = aba(&quadruped, &mut data, &q, &[0.0; 18], &[0.0; 18], &[]);
//! assert!((a[2] + 9.81).abs() < 1e-12); // it falls
//! ```
//!
//! Every function is generic over the [`Scalar`], allocates nothing, fills all that it returns, and is right whatever
//! ran before. `CONVENTIONS` below says in which frames and order numbers are.
#![doc = include_str!("../CONVENTIONS.md")]
#![allow(non_snake_case)]

mod aba;
mod aba_derivatives;
mod builder;
mod cholesky;
mod configuration;
mod crba;
mod data;
mod error;
mod joint;
mod kinematics;
mod layout;
mod minv;
mod model;
mod rnea;
mod rnea_derivatives;
pub mod robots;
mod urdf;

pub use aba::aba;
pub use aba_derivatives::{AbaDerivatives, aba_derivatives};
pub use builder::{BodyId, JointOptions, ModelBuilder, WORLD};
pub use condyle_spatial::{
    Act, Constant, Cross, Force, Inertia, Mat3, Motion, Quaternion, Scalar, Se3, Sym3, Vec3, lie,
};
pub use configuration::{
    DifferenceArgument, IntegrateArgument, difference, difference_jacobian, integrate, integrate_jacobian, neutral,
    random_configuration,
};
pub use crba::crba;
pub use data::Data;
pub use error::Error;
pub use joint::Joint;
pub use kinematics::{Placements, ReferenceFrame, forward_kinematics};
pub use minv::minv;
pub use model::{Body, Frame, FrameKind, Limits, Mimic, Model};
pub use rnea::{gravity, nonlinear_effects, rnea};
pub use rnea_derivatives::{RneaDerivatives, rnea_derivatives};
pub use urdf::UrdfOptions;
