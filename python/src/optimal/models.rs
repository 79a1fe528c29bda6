//! Reads the models of a problem, which are actions of any kind.

use super::actions::{ContactDynamics, FreeDynamics, ImpulseDynamics};
use super::inverse::{ContactInverseDynamics, FreeInverseDynamics};
use super::own::{Action, ConstrainedAction, ControlRate, DifferentialAction, Fault, Lqr, Unicycle};
use super::robot_action::Boxed;
use condyle::optimal as rust;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// Copies an action of any kind. Errors of actions and constraints that are written in Python are stored in `fault`.
pub(super) fn boxed(model: &Bound<'_, PyAny>, terminal: bool, fault: &Fault) -> PyResult<Boxed> {
    macro_rules! of_a_robot {
        ($($class:ident),*) => {$(
            if let Ok(action) = model.cast::<$class>() {
                return Ok(action.get().0.boxed());
            }
        )*};
    }
    of_a_robot!(FreeDynamics, ContactDynamics, ImpulseDynamics, FreeInverseDynamics, ContactInverseDynamics);
    let action: Box<dyn rust::ActionModel> = if let Ok(lqr) = model.cast::<Lqr>() {
        Box::new(lqr.get().0.clone())
    } else if let Ok(unicycle) = model.cast::<Unicycle>() {
        Box::new(unicycle.get().0.clone())
    } else if let Ok(constrained) = model.cast::<ConstrainedAction>() {
        let constrained = constrained.get();
        constrained.boxed(boxed(constrained.action.bind(model.py()), terminal, fault)?.action, fault)
    } else if let Ok(rate) = model.cast::<ControlRate>() {
        let rate = rate.get();
        let Boxed { action, described } = boxed(rate.action.bind(model.py()), terminal, fault)?;
        let described = described.and_then(|described| described.with_change(rate.change()));
        return Ok(Boxed { action: rate.boxed(action)?, described });
    } else if let Ok(action) = model.cast::<Action>() {
        action.get().boxed(terminal, fault)
    } else if let Ok(action) = model.cast::<DifferentialAction>() {
        action.get().boxed(fault)?
    } else {
        let found = model.get_type().name()?;
        return Err(PyTypeError::new_err(format!("models: expected an action, found '{found}'")));
    };
    Ok(Boxed { action, described: None })
}

/// Returns the residuals of a robot's action that are written in Python.
pub(super) fn residuals(model: &Bound<'_, PyAny>) -> Vec<Py<PyAny>> {
    macro_rules! of_a_robot {
        ($($class:ident),*) => {$(
            if let Ok(action) = model.cast::<$class>() {
                return action.get().0.kept(model.py()).collect();
            }
        )*};
    }
    of_a_robot!(FreeDynamics, ContactDynamics, ImpulseDynamics, FreeInverseDynamics, ContactInverseDynamics);
    if let Ok(rate) = model.cast::<ControlRate>() {
        return residuals(rate.get().action.bind(model.py()));
    }
    Vec::new()
}
