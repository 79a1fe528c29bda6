//! Functions of a robot for CasADi's `external`: exact values and derivatives without Python in the loop.
//!
//! `chart` has positions as CasADi sees them, `function` what is computed, `interface` CasADi's C interface to it: numbered
//! slots, each with the symbols of a function, its Jacobian, its reverse product and the Jacobian of that.

mod chart;
mod function;
mod interface;

use crate::constrained::constraint;
use crate::exceptions::{exception, wrong_word};
use crate::functions::{Argument, Reference};
use crate::model::{Model, frame_index};
use function::Kind;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// A slot of CasADi's interface that computes a function of a robot, held for the caller until `_casadi_release`.
///
/// function: 'rnea', 'aba', 'crba', 'forward_kinematics', 'frame_velocity', 'com', 'centroidal_momentum' or
/// 'constrained_dynamics'. Returns the name of its symbols.
#[pyfunction]
#[pyo3(name = "_casadi_hold", signature = (model, function, *, frame=None, reference=None, constraints=None))]
pub(crate) fn casadi_hold(
    model: &Bound<'_, Model>,
    function: &str,
    frame: Option<&Bound<'_, PyAny>>,
    reference: Option<&str>,
    constraints: Option<Vec<Bound<'_, PyAny>>>,
) -> PyResult<String> {
    let robot = &model.get().inner;
    let frame = || match frame {
        Some(frame) => frame_index(robot, frame),
        None => Err(PyValueError::new_err("frame: expected the name of a frame")),
    };
    let kind = match function {
        "rnea" => Kind::Rnea,
        "aba" => Kind::Aba,
        "crba" => Kind::Crba,
        "forward_kinematics" => Kind::FramePlacement { frame: frame()? },
        "frame_velocity" => Kind::FrameVelocity {
            frame: frame()?,
            reference: Reference::read("reference", reference.unwrap_or("local"), robot)?,
        },
        "com" => Kind::Com,
        "centroidal_momentum" => Kind::CentroidalMomentum,
        "constrained_dynamics" => {
            let given = constraints.unwrap_or_default();
            let constraints = given.iter().map(|given| constraint(robot, given)).collect::<PyResult<_>>()?;
            Kind::ConstrainedDynamics { constraints }
        }
        other => return Err(wrong_word("function", "a function of condyle.casadi", other)),
    };
    if matches!(kind, Kind::Aba | Kind::ConstrainedDynamics { .. }) {
        crate::functions::regular(robot)?;
    }
    interface::hold(robot, kind).map_err(exception)?.ok_or_else(|| {
        let message = format!("all {} functions for CasADi are in use: drop some of them", interface::SLOTS);
        PyValueError::new_err(message)
    })
}

/// The end of a hold: the slot lives on as long as CasADi has functions of it.
#[pyfunction]
#[pyo3(name = "_casadi_release")]
pub(crate) fn casadi_release(name: &str) {
    interface::release(name);
}
