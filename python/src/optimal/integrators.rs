//! Integrators and control polynomials, by name.

use crate::exceptions::wrong_word;
use condyle::optimal::robot::{ControlPolynomial, Integrator};
use pyo3::prelude::*;

/// Reads the integrator of a knot.
pub(super) fn integrator(name: &str) -> PyResult<Integrator> {
    match name {
        "semi_implicit_euler" => Ok(Integrator::SemiImplicitEuler),
        "runge_kutta_2" => Ok(Integrator::RungeKutta2),
        "runge_kutta_3" => Ok(Integrator::RungeKutta3),
        "runge_kutta_4" => Ok(Integrator::RungeKutta4),
        other => {
            let allowed = "'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'";
            Err(wrong_word("integrator", allowed, other))
        }
    }
}

/// Reads the polynomial that controls follow within a knot.
pub(super) fn polynomial(name: &str) -> PyResult<ControlPolynomial> {
    match name {
        "constant" => Ok(ControlPolynomial::Constant),
        "linear" => Ok(ControlPolynomial::Linear),
        "quadratic" => Ok(ControlPolynomial::Quadratic),
        other => Err(wrong_word("controls", "'constant', 'linear' or 'quadratic'", other)),
    }
}
