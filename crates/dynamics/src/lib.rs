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
mod aba_hessian;
mod all_terms;
mod articulated_solve;
mod assembly;
mod batch;
mod centroidal;
mod centroidal_derivatives;
mod com;
mod constrained_derivatives;
mod constrained_dynamics;
mod constrained_equations;
mod constraint;
mod constraint_motion;
mod constraint_set;
mod coriolis;
mod crba;
mod data;
mod delassus;
mod differentiate;
mod divide_conquer;
mod energy;
mod forward_dynamics;
mod frame_derivatives;
mod frames;
mod impulse_dynamics;
mod inputs;
mod kinematics;
mod limbs;
mod minv;
mod parts;
mod passive;
mod regressor;
mod rnea;
mod rnea_derivatives;
mod rnea_hessian;
mod side_by_side;
pub mod simulation;
mod statics;
mod ties;
mod two_handles;
mod workspace;

pub use aba::aba;
pub use aba_derivatives::{AbaDerivatives, aba_derivatives};
pub use aba_hessian::{AbaHessian, aba_hessian};
pub use all_terms::{AllTerms, compute_all_terms};
pub use assembly::AssemblySize;
pub use batch::{Batch, BatchAbaDerivatives, BatchRneaDerivatives, Matrices, StateMatrix};
pub use centroidal::{CentroidalMap, CentroidalMapRate, centroidal_map, centroidal_map_rate};
pub use centroidal_derivatives::{CentroidalDerivatives, centroidal_derivatives};
pub use condyle_linalg::{Cholesky, ColumnTree, Ltdl};
pub use condyle_model::{
    Body, BodyId, DifferenceArgument, Error, Frame, FrameKind, IntegrateArgument, Joint, JointOptions, Limits, Mimic,
    MjcfOptions, Model, ModelBuilder, SdfOptions, UrdfOptions, WORLD, Warning, difference, difference_jacobian,
    distance, inertial_parameters, integrate, integrate_jacobian, interpolate, neutral, normalize,
    random_configuration, robots, transport,
};
pub use condyle_spatial::{
    Act, Constant, Cross, Force, Inertia, Mat3, Motion, Quaternion, Scalar, Se3, Sym3, Vec3, level, lie,
};
pub use constrained_derivatives::{ConstrainedDerivatives, constrained_dynamics_derivatives};
pub use constrained_dynamics::{Constrained, constrained_dynamics};
pub use constrained_equations::{ConstrainedEquations, constrained_dynamics_equations};
pub use constraint::{Constraint, ConstraintKind, Target};
pub use constraint_set::{ConstraintSet, Proximal};
pub use coriolis::coriolis_matrix;
pub use crba::crba;
pub use data::Data;
pub use differentiate::{LaneJacobian, StateFunction, gradient, hessian, jacobian};
pub use divide_conquer::DivideConquer;
pub use energy::{EnergyDerivatives, energy_derivatives};
pub use forward_dynamics::{Method, forward_dynamics};
pub use frames::{Accelerations, Placements, ReferenceFrame, Velocities};
pub use impulse_dynamics::{Impulse, ImpulseDerivatives, impulse_dynamics, impulse_dynamics_derivatives};
pub use inputs::Input;
pub use kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
pub use minv::minv;
pub use passive::{passive_torque, passive_torque_derivative};
pub use regressor::{joint_torque_regressor, kinetic_energy_regressor, potential_energy_regressor};
pub use rnea::{gravity, nonlinear_effects, rnea};
pub use rnea_derivatives::{CoriolisDerivatives, RneaDerivatives, coriolis_derivatives, rnea_derivatives};
pub use rnea_hessian::{RneaHessian, RneaSecondDerivatives, rnea_hessian, rnea_second_derivatives};
pub use statics::{static_torque, static_torque_derivative};
