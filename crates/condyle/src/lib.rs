//! Rigid-body dynamics of robots with exact derivatives, optimal control and whole-body control.
//!
//! # Where to begin
//!
//! A [`Model`] describes a robot. A model is read from a file or built in code, and never changes. A [`Data`] contains
//! the memory in which one thread computes. Every algorithm is a function of a `Model`, a `Data` and the state:
//!
//! ```
//! use condyle::{Data, aba, aba_derivatives, robots};
//!
//! let arm = robots::arm7(); // or Model::from_urdf, from_mjcf, from_sdf
//! let mut data = Data::new(&arm);
//! let (q, v, tau) = ([0.3; 7], [0.1; 7], [0.0; 7]);
//! let a = aba(&arm, &mut data, &q, &v, &tau, &[]).to_vec(); // q̈
//! let d = aba_derivatives(&arm, &mut data, &q, &v, &tau, &[]);
//! assert_eq!((a.len(), d.da_dq.shape()), (7, (7, 7))); // ∂q̈/∂q, and ∂q̈/∂v, ∂q̈/∂τ
//! ```
//!
//! The most common names are exported at the root of this crate. The other names are in modules by theme. [`dynamics`]
//! has all names of models and algorithms in one module.
//!
//! | theme | names |
//! | --- | --- |
//! | robots | [`Model`], [`ModelBuilder`], [`Joint`], [`Inertia`], [`Limits`], [`mod@tree`] |
//! | positions | [`integrate`], [`difference`], [`neutral`], [`random_configuration`], [`configuration`] |
//! | dynamics | [`rnea`], [`aba`], [`crba`], [`minv`], [`nonlinear_effects`], [`terms`], [`factors`] |
//! | frames | [`forward_kinematics`], [`Placements`], [`frame_jacobian`], [`kinematics`], [`centroidal`] |
//! | derivatives | [`rnea_derivatives`], [`aba_derivatives`], [`gradient`], [`hessian`], [`mod@derivatives`] |
//! | contacts, loops, impacts | [`ConstraintSet`], [`ContactConstraint`], [`constrained_dynamics`], [`constraints`] |
//! | distances | [`distances`]: `DistancePairs`, `Distances`, `Geometry`, `Shape` |
//! | many states | [`Batch`], [`batch`], [`level`] |
//! | simulation, identification | [`simulation`], [`regressors`] |
//! | algebra and numbers | [`Scalar`], [`Se3`], [`Motion`], [`Force`], [`spatial`], [`conventions`] |
#![cfg_attr(
    feature = "optimal",
    doc = "| optimal control | [`optimal`]: `Fddp`, `AugmentedLagrangian`, `InteriorPoint`, `Problem`, `robot` |"
)]
#![cfg_attr(feature = "mpc", doc = "| controllers at a rate | [`mpc`]: `WholeBodyMpc`, `Foot`, `Gait`, `Policy` |")]
#![cfg_attr(
    feature = "wholebody",
    doc = "| whole-body control | [`wholebody`]: `WholeBodyController`, `Task`, `Plan` |"
)]
#![cfg_attr(feature = "ik", doc = "| inverse kinematics | [`ik`]: `DifferentialIk`, `GlobalIk`, `Task` |")]
//!
#![cfg_attr(all(feature = "optimal", feature = "wholebody"), doc = include_str!("guide.md"))]
#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod conventions;
mod error;
#[cfg(all(feature = "optimal", feature = "wholebody"))]
mod plan;

pub use error::Error;
#[cfg(all(feature = "optimal", feature = "wholebody"))]
pub use plan::plan_of;

/// All names of models and algorithms in one module. The most common names are also at the root of this crate, and the
/// others in modules by theme.
#[doc(no_inline)]
pub use condyle_dynamics as dynamics;
#[cfg(feature = "ik")]
pub use condyle_ik as ik;
#[cfg(feature = "mpc")]
pub use condyle_mpc as mpc;
#[cfg(feature = "optimal")]
pub use condyle_optimal as optimal;
#[cfg(feature = "wholebody")]
pub use condyle_wholebody as wholebody;

/// Crates whose types appear in the public interface of this crate. They are re-exported in the versions that this
/// crate uses.
#[doc(no_inline)]
pub use condyle_dynamics::{nalgebra, num_dual, rand};

pub use condyle_dynamics::{
    Batch, ConstraintSet, ContactConstraint, Data, Error as ModelError, Force, Inertia, Joint, JointOptions, Limits,
    Model, ModelBuilder, Motion, Placements, ReferenceFrame, Scalar, Se3, Sym3, Vec3, WORLD, aba, aba_derivatives,
    constrained_dynamics, constrained_dynamics_derivatives, crba, difference, forward_accelerations,
    forward_kinematics, forward_velocities, frame_jacobian, gradient, hessian, integrate, jacobian, level, minv,
    neutral, nonlinear_effects, normalize, random_configuration, rnea, rnea_derivatives, simulation,
};
#[cfg(feature = "loaders")]
pub use condyle_dynamics::{MjcfOptions, SdfOptions, UrdfOptions, robots};

/// Results of a [`Batch`] of states.
pub mod batch {
    pub use condyle_dynamics::{
        BatchAbaDerivatives, BatchAbaHessian, BatchAccelerationDerivatives, BatchAllTerms, BatchCentroidalDerivatives,
        BatchCentroidalMap, BatchCentroidalMapRate, BatchConstrained, BatchConstrainedDerivatives,
        BatchConstrainedEquations, BatchConstraints, BatchCoriolisDerivatives, BatchEnergyDerivatives, BatchImpulse,
        BatchImpulseDerivatives, BatchNumber, BatchRneaDerivatives, BatchRneaHessian, BatchWriter, Matrices, Poses,
        StateMatrix,
    };
}

/// Centroidal momentum, the map from velocities to this momentum, and derivatives of both.
pub mod centroidal {
    pub use condyle_dynamics::{
        CentroidalDerivatives, CentroidalMap, CentroidalMapRate, centroidal_derivatives, centroidal_map,
        centroidal_map_rate,
    };
}

/// Positions as elements of the joints' Lie groups: Jacobians of ⊕ and ⊖, distances, and interpolation.
pub mod configuration {
    pub use condyle_dynamics::{
        DifferenceArgument, IntegrateArgument, difference_jacobian, distance, integrate_jacobian, interpolate,
        transport,
    };
}

/// Impacts, inverse dynamics under constraints, and the types of constraints and of results under constraints.
pub mod constraints {
    pub use condyle_dynamics::{
        Constrained, ConstrainedDerivatives, ConstrainedEquations, ConstrainedInverse, ConstrainedInverseDerivatives,
        ConstraintKind, Impulse, ImpulseDerivatives, ProximalSettings, Target, constrained_dynamics_equations,
        constrained_inverse_dynamics, constrained_inverse_dynamics_derivatives, impulse_dynamics,
        impulse_dynamics_derivatives,
    };
}

/// Types of first and second derivatives, and functions that differentiate further terms.
pub mod derivatives {
    pub use condyle_dynamics::{
        AbaDerivatives, AbaHessian, CoriolisDerivatives, EnergyDerivatives, Input, LaneJacobian, RneaDerivatives,
        RneaHessian, RneaSecondDerivatives, StateFunction, aba_hessian, coriolis_derivatives, energy_derivatives,
        passive_torque_derivatives, rnea_hessian, rnea_second_derivatives, static_torque_derivative,
    };
}

pub use condyle_dynamics::distances;

/// Forward dynamics by divide and conquer, for chains of hundreds of bodies on several threads.
pub mod divide_conquer {
    pub use condyle_dynamics::{AssemblySize, DivideConquer};
}

/// Factorisations of the inertia matrix, and forward dynamics computed from these factors.
pub mod factors {
    pub use condyle_dynamics::{Cholesky, ColumnTree, ForwardDynamicsMethod, Ltdl, forward_dynamics};
}

/// Velocities and accelerations of bodies and frames.
pub mod kinematics {
    pub use condyle_dynamics::{Accelerations, Velocities, body_jacobian};
}

/// Regressors of efforts and energies, and inertial parameters.
pub mod regressors {
    pub use condyle_dynamics::{
        inertial_parameters, joint_torque_regressor, kinetic_energy_regressor, potential_energy_regressor,
    };
}

/// Rotations, exponentials and logarithms, dense matrices, and the traits of spatial algebra.
pub mod spatial {
    pub use condyle_dynamics::{Act, Constant, Cross, Dense, DenseMatrix, Mat3, Matrix, Quaternion, lie};
}

/// Functions for Coriolis, gravity and passive efforts, and one function that computes all terms of the equations of
/// motion.
pub mod terms {
    pub use condyle_dynamics::{AllTerms, compute_all_terms, coriolis_matrix, gravity, passive_torque, static_torque};
}

/// Types for the elements of a robot's description.
pub mod tree {
    pub use condyle_dynamics::{
        Actuator, Body, BodyId, Frame, FrameKind, FrameParent, GravityCompensation, Keyframe, Mimic, ModelConstraint,
        ModelConstraintKind, Place, Spring, Transmission, Warning, WarningKind,
    };
}

/// Rust code blocks of the README and of the book, run as doctests.
#[cfg(doctest)]
mod book {
    #[doc = include_str!("../../../README.md")]
    mod readme {}
    #[doc = include_str!("../../../docs/inspect.md")]
    mod inspect {}
    #[doc = include_str!("../../../docs/simulate.md")]
    mod simulate {}
    #[doc = include_str!("../../../docs/differentiate.md")]
    mod differentiate {}
    #[doc = include_str!("../../../docs/deploy.md")]
    mod deploy {}
    #[doc = include_str!("../../../docs/lanes.md")]
    mod lanes {}
    #[doc = include_str!("../../../docs/derivatives.md")]
    mod derivatives {}
    #[doc = include_str!("../../../docs/conversions.md")]
    mod conversions {}
}
