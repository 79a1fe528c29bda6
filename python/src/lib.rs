//! The Python package `condyle`: its extension module `condyle._condyle`.
//!
//! Each module uses only modules that are listed before it:
//! - `exceptions`, `signals` and `arrays`: exceptions of the package, interruption of long calls by signals, and NumPy
//!   arrays as arguments and results; `hyper_dual` numbers;
//! - `cached`, `joint`, `tree`, `inertial_parameters`, `model`, `robots`, `builder`: robots, their attributes, and the
//!   functions that make robots;
//! - `data` and `batch`: scratch memory of calls, and calls for many states; `functions`: code that all calls have in
//!   common;
//! - `algorithms`, `centroidal`, `configuration`, `constrained`, `kinematics`, `derivatives`, `factorisation`,
//!   `regressors`, `simulation`: one Python function or type for each function or type of the library;
//! - `spelling`: Pinocchio's functions, for the module `condyle.pinocchio`;
//! - `codegen`: robots as straight-line code, for the module `condyle.codegen`;
//! - `distances`: distances between shapes, for the module `condyle.distances`;
//! - `dlpack`: arrays on devices, for the module `condyle.cuda`;
//! - `optimal`, `wholebody`, `mpc`, `ik`: the modules `condyle.optimal`, `condyle.wholebody`, `condyle.mpc` and
//!   `condyle.ik`.
//!
//! The doc comments of Python classes and functions become docstrings; `stubs.py` writes these to
//! `condyle/_condyle.pyi`.
#![allow(non_snake_case)]
#![allow(clippy::too_many_arguments)] // Python functions may have many arguments

mod algorithms;
mod arrays;
mod batch;
mod builder;
mod cached;
mod casadi;
mod centroidal;
mod codegen;
mod configuration;
mod constrained;
mod data;
mod derivatives;
mod distances;
mod dlpack;
mod exceptions;
mod factorisation;
mod functions;
mod hyper_dual;
mod ik;
mod inertial_parameters;
mod joint;
mod kinematics;
mod made_for;
mod model;
mod mpc;
mod optimal;
mod pulled;
mod regressors;
mod robots;
mod signals;
mod simulation;
mod spelling;
mod tree;
mod wholebody;

use pyo3::exceptions::PyImportError;
use pyo3::prelude::*;

/// Rigid-body dynamics with exact derivatives: the compiled part of `condyle`.
#[pymodule]
mod _condyle {
    use super::*;

    #[pymodule_export]
    use algorithms::{
        aba, aba_derivatives, coriolis_matrix, crba, forward_dynamics, gravity, minv, nonlinear_effects, rnea,
        rnea_derivatives, static_torque,
    };
    #[pymodule_export]
    use builder::{BodyId, ModelBuilder};
    #[pymodule_export]
    use casadi::{casadi_hold, casadi_hold_knot, casadi_release};
    #[pymodule_export]
    use centroidal::{
        centroidal_map, centroidal_map_rate, centroidal_momentum, centroidal_momentum_rate, com, com_acceleration,
        com_jacobian, com_velocity, compute_all_terms, kinetic_energy, mechanical_energy, potential_energy,
    };
    #[pymodule_export]
    use codegen::generate;
    #[pymodule_export]
    use configuration::{
        difference, difference_jacobian, distance, integrate, integrate_jacobian, interpolate, neutral, normalize,
        random_configuration, transport,
    };
    #[pymodule_export]
    use constrained::{
        ConstraintSet, constrained_dynamics, constrained_dynamics_derivatives, constrained_dynamics_equations,
        impulse_dynamics, impulse_dynamics_derivatives,
    };
    #[pymodule_export]
    use data::Data;
    #[pymodule_export]
    use derivatives::{
        aba_hessian, aba_input_derivative, body_acceleration_derivatives, body_velocity_derivative,
        centroidal_derivatives, coriolis_derivatives, energy_derivatives, frame_acceleration_derivatives,
        frame_classical_acceleration_derivatives, frame_velocity_derivative, rnea_hessian, rnea_input_derivative,
        rnea_second_derivatives, static_torque_derivative,
    };
    #[pymodule_export]
    use distances::{FileCollisions, PreparedPairs};
    #[pymodule_export]
    use dlpack::{borrowed, lend};
    #[pymodule_export]
    use exceptions::{ControllerError, Error, ModelError, NotPhysicalError, ParseError, ProblemError};
    #[pymodule_export]
    use factorisation::{Cholesky, DivideConquer, Ltdl};
    #[pymodule_export]
    use hyper_dual::HyperDual;
    #[pymodule_export]
    use ik::{DifferentialIk, GlobalIk};
    #[pymodule_export]
    use inertial_parameters::{
        check, from_inertia, from_log_cholesky, log_cholesky, log_cholesky_jacobian, pseudo_inertia, to_inertia,
    };
    #[pymodule_export]
    use joint::Joint;
    #[pymodule_export]
    use kinematics::{
        body_acceleration, body_classical_acceleration, body_jacobian, body_jacobian_rate, body_point_jacobian,
        body_point_velocity, body_velocity, forward_kinematics, frame_acceleration, frame_classical_acceleration,
        frame_jacobian, frame_jacobian_rate, frame_placement, frame_point_jacobian, frame_point_velocity,
        frame_velocity,
    };
    #[pymodule_export]
    use model::{Model, model_from_bytes};
    #[pymodule_export]
    use mpc::{ArmMpc, Foot, Gait, JointPolicy, WholeBodyMpc};
    #[pymodule_export]
    use optimal::{
        Action, Activation, AugmentedLagrangian, ConstrainedAction, ContactDynamics, ContactInverseDynamics,
        ControlRate, Cost, DifferentialAction, Fddp, FreeDynamics, FreeInverseDynamics, FrictionCone, ImpulseDynamics,
        InteriorPoint, Limit, Lqr, Policy, Problem, Record, Residual, Schedule, Sensitivities, Sensitivity, Sweep,
        Unicycle, WrenchCone, rollout_many, solve_variations,
    };
    #[pymodule_export]
    use pulled::rnea_pull;
    #[pymodule_export]
    use regressors::{
        joint_torque_regressor, kinetic_energy_regressor, passive_torque, passive_torque_derivatives,
        potential_energy_regressor,
    };
    #[pymodule_export]
    use robots::{arm7, humanoid, quadruped};
    #[pymodule_export]
    use simulation::Simulation;
    #[pymodule_export]
    use spelling::{
        SpelledData, SpelledModel, centerOfMass, computeCentroidalMomentum, computeCoriolisMatrix,
        computeFrameJacobian, computeGeneralizedGravity, computeMinverse, crba as spelled_crba,
        difference as spelled_difference, forwardKinematics, framesForwardKinematics, getAcceleration,
        getClassicalAcceleration, getFrameAcceleration, getFrameClassicalAcceleration, getFrameJacobian,
        getFrameVelocity, getJointJacobian, getVelocity, integrate as spelled_integrate, jacobianCenterOfMass,
        nonLinearEffects, updateFramePlacements,
    };
    #[pymodule_export]
    use wholebody::{
        FrictionContact, Plan, Task, WholeBodyController, check_pose, check_rotations, controller_from_numbers,
    };

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        condyle::level::requested().map_err(|refused| PyImportError::new_err(refused.to_string()))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("LEVEL", condyle::level::level().name())?;
        module.add("WORLD", builder::world(module.py())?)?;
        module.add("ARM7", condyle::robots::ARM7)?;
        module.add("QUADRUPED", condyle::robots::QUADRUPED)?;
        module.add("HUMANOID", condyle::robots::HUMANOID)
    }
}
