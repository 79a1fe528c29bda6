//! Functions of a robot for CasADi's `external`: exact values and derivatives without Python in the loop.
//!
//! `chart` handles positions in CasADi's coordinates. `computation` defines the interface of a function. `function` and
//! `robot` contain the functions of a robot; `lanes` computes inverse and forward dynamics for several states. `knot`
//! contains the knots of optimal control problems. `bound` converts numbers to CasADi's coordinates. `interface` is
//! CasADi's C interface: numbered slots. Each slot has four symbols: a function, its Jacobian J, the product Jᵀλ with
//! multipliers λ, and the Jacobian of this product.

mod bound;
mod chart;
mod computation;
mod function;
mod interface;
mod knot;
mod lanes;
mod robot;

use crate::constrained::constraint;
use crate::exceptions::{ProblemError, exception, wrong_word};
use crate::functions::{Argument, Reference};
use crate::model::{Model, frame_index};
use crate::optimal::{Alone, alone};
use computation::Computation;
use function::Kind;
use knot::KnotFunction;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use robot::RobotFunction;

/// Holds a slot of CasADi's interface that computes a function of a robot, until `_casadi_release`.
///
/// function: 'rnea', 'aba', 'crba', 'forward_kinematics', 'frame_velocity', 'com', 'centroidal_momentum' or
/// 'constrained_dynamics'. states: number of states per call; arguments and results contain the columns of all states,
/// one state after the other.
///
/// Returns the name of the slot, from which CasADi derives the names of the symbols.
#[pyfunction]
#[pyo3(name = "_casadi_hold", signature = (model, function, *, states, frame=None, reference=None, constraints=None))]
pub(crate) fn casadi_hold(
    model: &Bound<'_, Model>,
    function: &str,
    states: &Bound<'_, PyAny>,
    frame: Option<&Bound<'_, PyAny>>,
    reference: Option<&str>,
    constraints: Option<Vec<Bound<'_, PyAny>>>,
) -> PyResult<String> {
    let (robot, states) = (&model.get().inner, count_of_states(states)?);
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
    let mut key = format!("{states} {kind:?}").into_bytes();
    key.extend(postcard::to_allocvec(&**robot).unwrap_or_default());
    named(interface::hold(key, states, || Ok(Box::new(RobotFunction::new(robot, kind)?))).map_err(exception)?)
}

/// Reads and checks the number of states of a function.
fn count_of_states(given: &Bound<'_, PyAny>) -> PyResult<usize> {
    const MOST: usize = 1 << 16;
    match given.extract() {
        Ok(states) if (1..=MOST).contains(&states) => Ok(states),
        _ => Err(PyValueError::new_err(format!("states: expected a number from 1 to {MOST}, found {}", given.repr()?))),
    }
}

/// Holds a slot until `_casadi_release`. The slot computes the next state and the cost of knot t of an action or of a
/// problem. Without t, the index of the knot is an argument of the function.
#[pyfunction]
#[pyo3(name = "_casadi_hold_knot", signature = (of, t))]
pub(crate) fn casadi_hold_knot(of: &Bound<'_, PyAny>, t: Option<usize>) -> PyResult<String> {
    let Alone { action, robot, end, text } = alone(of, t)?;
    let mut key = format!("{} {end} {text}", t.is_some()).into_bytes(); // `text` contains the costs of knot t
    let robot = robot.as_deref();
    key.extend(robot.and_then(|robot| postcard::to_allocvec(robot).ok()).unwrap_or_default());
    let knot: Box<dyn Computation> = match KnotFunction::new(action, robot, t, end) {
        Some(knot) => Box::new(knot),
        None => {
            let what = "action: it has parts that are written in Python, which CasADi does not call";
            return Err(ProblemError::new_err(what));
        }
    };
    named(interface::hold(key, 1, || Ok(knot)).map_err(exception)?)
}

/// Returns the name of a slot, or an error if all slots are taken.
fn named(slot: Option<String>) -> PyResult<String> {
    slot.ok_or_else(|| {
        let message = format!("all {} functions for CasADi are in use: drop some of them", interface::SLOTS);
        PyValueError::new_err(message)
    })
}

/// Ends a hold of a slot; the slot stays in use as long as CasADi has objects for the slot's functions.
#[pyfunction]
#[pyo3(name = "_casadi_release")]
pub(crate) fn casadi_release(name: &str) {
    interface::release(name);
}
