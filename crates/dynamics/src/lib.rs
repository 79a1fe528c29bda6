//! Robot models, rigid-body algorithms and their exact derivatives.
//!
//! A [`Model`] is immutable and can be shared. A [`Data`] is the scratch of one thread. An algorithm is a function of a
//! `Model`, a `Data` and the state:
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
//! Every function is generic over the [`Scalar`] and allocates nothing. The results of a call do not depend on earlier
//! calls. `CONVENTIONS` below defines frames and the order of numbers.
//!
//! # Features
//! All features are on by default.
//!
//! - `loaders`: readers of robot files, and the module `robots`.
//! - `meshes`: masses and inertias of meshes in MJCF.
//! - `serde`: models and constraints in serde's formats.
//! - `threads`: computation on several threads, by rayon.
//! - `std`: the standard library, which all other features except `serde` need, and derivatives of user-defined
//!   functions (`jacobian`, `LaneJacobian`, …).
//!
//! Without `std`, the crate needs `alloc`, and the feature `libm` for floating-point functions. The crate then runs
//! without an operating system (`examples/embedded` in the repository).
#![doc = include_str!("../CONVENTIONS.md")]
#![cfg_attr(docsrs, feature(doc_cfg))]
#![cfg_attr(not(any(feature = "std", test)), no_std)]
#![allow(non_snake_case)]

#[cfg_attr(not(any(feature = "std", test)), macro_use)]
extern crate alloc;

mod batch;
mod calls;
mod constraints;
mod data;
mod derivatives;
#[cfg(feature = "std")]
mod differentiate;
mod divide_conquer;
mod lanes;
mod passes;
#[doc(hidden)]
pub mod selection;
pub mod simulation;
mod workspace;

pub use batch::centroidal::{BatchAllTerms, BatchCentroidalMap, BatchCentroidalMapRate};
pub use batch::constrained::{
    BatchConstrained, BatchConstrainedDerivatives, BatchConstrainedEquations, BatchImpulse, BatchImpulseDerivatives,
};
pub use batch::constraints::BatchConstraints;
pub use batch::derivatives::{
    BatchAbaDerivatives, BatchAbaHessian, BatchCentroidalDerivatives, BatchCoriolisDerivatives, BatchEnergyDerivatives,
    BatchPassiveDerivatives, BatchRneaDerivatives, BatchRneaHessian,
};
pub use batch::kinematics::BatchAccelerationDerivatives;
pub use batch::results::{Matrices, Poses};
pub use batch::state_matrix::StateMatrix;
pub use batch::{Batch, BatchNumber, BatchWriter};
pub use calls::centroidal::{centroidal_map, centroidal_map_rate, compute_all_terms};
pub use calls::constrained_dynamics::{
    Constrained, ConstrainedDerivatives, ConstrainedEquations, constrained_dynamics, constrained_dynamics_derivatives,
    constrained_dynamics_equations,
};
pub use calls::constrained_inverse::{
    ConstrainedInverse, ConstrainedInverseDerivatives, constrained_inverse_dynamics,
    constrained_inverse_dynamics_derivatives,
};
#[doc(hidden)]
pub use calls::constrained_inverse::{EquationsAt, constrained_equations_at};
pub use calls::derivatives::{
    AbaDerivatives, CoriolisDerivatives, RneaDerivatives, aba_derivatives, centroidal_derivatives,
    coriolis_derivatives, energy_derivatives, rnea_derivatives, static_torque_derivative,
};
pub use calls::forward_dynamics::{aba, forward_dynamics};
pub use calls::impulse_dynamics::{Impulse, ImpulseDerivatives, impulse_dynamics, impulse_dynamics_derivatives};
pub use calls::inertia::{crba, minv};
pub use calls::inverse_dynamics::{coriolis_matrix, gravity, nonlinear_effects, rnea, static_torque};
pub use calls::kinematics::{
    body_jacobian, forward_accelerations, forward_kinematics, forward_velocities, frame_jacobian,
};
#[doc(hidden)]
pub use calls::kinematics::{body_jacobian_strided, frame_jacobian_strided};
pub use calls::parameter_derivatives::Input;
pub use calls::regressor::{joint_torque_regressor, kinetic_energy_regressor, potential_energy_regressor};
pub use calls::second_derivatives::{
    AbaHessian, RneaHessian, RneaSecondDerivatives, aba_hessian, rnea_hessian, rnea_second_derivatives,
};
pub use condyle_linalg::{Cholesky, ColumnTree, Ltdl};
pub use condyle_model::{
    Actuator, Body, BodyId, DifferenceArgument, Error, Frame, FrameKind, FrameParent, GravityCompensation,
    IntegrateArgument, Joint, JointOptions, Keyframe, Limits, Mimic, Model, ModelBuilder, ModelConstraint,
    ModelConstraintKind, Place, Spring, Transmission, WORLD, Warning, WarningKind, difference, difference_jacobian,
    distance, inertial_parameters, integrate, integrate_jacobian, interpolate, neutral, normalize,
    random_configuration, transport,
};
#[doc(hidden)]
pub use condyle_model::{
    GroupJacobian, PositionFault, ROTATION_ROUNDING, commuting_difference, difference_jacobian_groups,
    integrate_jacobian_groups, unit_fault,
};
#[cfg(feature = "loaders")]
pub use condyle_model::{MjcfOptions, SdfOptions, UrdfOptions, robots};
pub use condyle_spatial::{
    Act, Constant, Cross, Dense, DenseMatrix, Force, Inertia, Mat3, Matrix, Motion, Quaternion, Scalar, Se3, Sym3,
    Vec3, level, lie,
};
pub use constraints::constraint::{ConstraintKind, ContactConstraint, Target};
pub use constraints::constraint_set::ConstraintSet;
pub use constraints::plan::ProximalSettings;
pub use data::Data;
pub use derivatives::centroidal_derivatives::CentroidalDerivatives;
#[cfg(feature = "std")]
pub use differentiate::{LaneJacobian, StateFunction, gradient, hessian, jacobian};
pub use divide_conquer::DivideConquer;
pub use divide_conquer::assembly::AssemblySize;
/// Crates whose types are part of the public interface, in the versions that this crate uses.
#[cfg(feature = "std")]
pub use num_dual;
pub use {nalgebra, rand};

pub use passes::all_terms::AllTerms;
pub use passes::centroidal::{CentroidalMap, CentroidalMapRate};
pub use passes::energy::EnergyDerivatives;
pub use passes::factored_dynamics::ForwardDynamicsMethod;
pub use passes::frames::{Accelerations, Placements, ReferenceFrame, Velocities};
#[doc(hidden)]
pub use passes::free_armature::{add_armature_bias, subtract_armature_bias};
pub use passes::passive::{passive_torque, passive_torque_derivatives};

/// Code block of the README, run as a doctest.
#[cfg(all(doctest, feature = "loaders", feature = "threads"))]
#[doc = include_str!("../README.md")]
mod readme {}
