//! The Python package `condyle`: its extension module `condyle._condyle`.
//!
//! `arrays` takes NumPy arrays in and gives them out, `model` shows a robot, `algorithms` and `configuration` are the
//! functions of the library, one to one, and `optimal` is what `condyle.optimal` shows. The doc comments here are the
//! docstrings that Python sees; `condyle/_condyle.pyi` repeats them for editors, and a test holds the two together.
#![allow(non_snake_case)]

mod algorithms;
mod arrays;
mod configuration;
mod model;
mod optimal;

use pyo3::prelude::*;

/// Rigid-body dynamics with exact derivatives: the compiled part of `condyle`.
#[pymodule]
mod _condyle {
    use super::*;

    #[pymodule_export]
    use algorithms::{
        Data, aba, aba_derivatives, crba, forward_kinematics, frame_jacobian, frame_placement, gravity, minv,
        nonlinear_effects, rnea, rnea_derivatives,
    };
    #[pymodule_export]
    use configuration::{
        difference, difference_jacobian, integrate, integrate_jacobian, neutral, random_configuration,
    };
    #[pymodule_export]
    use exceptions::{Error, ModelError, ParseError, ProblemError};
    #[pymodule_export]
    use model::{Model, arm7, humanoid, model_from_bytes, quadruped};
    #[pymodule_export]
    use optimal::{Activation, Cost, Fddp, FreeDynamics, Problem};

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("ARM7", condyle::robots::ARM7)?;
        module.add("QUADRUPED", condyle::robots::QUADRUPED)?;
        module.add("HUMANOID", condyle::robots::HUMANOID)
    }
}
