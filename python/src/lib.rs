//! The Python package `condyle`: its extension module `condyle._condyle`.
//!
//! `arrays` takes NumPy arrays in and gives them out, `model` shows a robot, `data` is the algorithms' scratch;
//! `algorithms`, `centroidal`, `configuration`, `kinematics` and `regressors` are the functions of the library, one to
//! one, and `optimal` is what `condyle.optimal` shows. The doc comments here are the docstrings that Python sees;
//! `condyle/_condyle.pyi` repeats them for editors, and a test holds the two together.
#![allow(non_snake_case)]
#![allow(clippy::too_many_arguments)] // a function in Python has as many as it needs

mod algorithms;
mod arrays;
mod centroidal;
mod configuration;
mod data;
mod exceptions;
mod kinematics;
mod model;
mod optimal;
mod regressors;
mod robots;

use pyo3::prelude::*;

/// Rigid-body dynamics with exact derivatives: the compiled part of `condyle`.
#[pymodule]
mod _condyle {
    use super::*;

    #[pymodule_export]
    use algorithms::{
        aba, aba_derivatives, coriolis_matrix, crba, gravity, minv, nonlinear_effects, rnea, rnea_derivatives,
        static_torque,
    };
    #[pymodule_export]
    use centroidal::{
        centroidal_map, centroidal_map_rate, centroidal_momentum, centroidal_momentum_rate, com, com_acceleration,
        com_jacobian, com_velocity, compute_all_terms, kinetic_energy, mechanical_energy, potential_energy,
    };
    #[pymodule_export]
    use configuration::{
        difference, difference_jacobian, distance, integrate, integrate_jacobian, interpolate, neutral, normalize,
        random_configuration, transport,
    };
    #[pymodule_export]
    use data::Data;
    #[pymodule_export]
    use exceptions::{Error, ModelError, ParseError, ProblemError};
    #[pymodule_export]
    use kinematics::{
        forward_kinematics, frame_acceleration, frame_classical_acceleration, frame_jacobian, frame_jacobian_rate,
        frame_placement, frame_velocity,
    };
    #[pymodule_export]
    use model::Model;
    #[pymodule_export]
    use optimal::{Activation, Cost, Fddp, FreeDynamics, Problem};
    #[pymodule_export]
    use regressors::{
        joint_torque_regressor, kinetic_energy_regressor, passive_torque, passive_torque_derivative,
        potential_energy_regressor,
    };
    #[pymodule_export]
    use robots::{arm7, humanoid, model_from_bytes, quadruped};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("ARM7", condyle::robots::ARM7)?;
        module.add("QUADRUPED", condyle::robots::QUADRUPED)?;
        module.add("HUMANOID", condyle::robots::HUMANOID)
    }
}
