//! A single knot of a problem.

use super::models::{boxed, residuals};
use super::own::{Action, ConstrainedAction, ControlRate, DifferentialAction, Fault, Lqr, Unicycle};
use super::problem::{Problem, lock};
use super::robot_action::Described;
use crate::exceptions::{ProblemError, problem_error};
use condyle::optimal as rust;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::sync::Arc;

/// A single knot, without the limits and bounds that a solver enforces.
pub(crate) struct Alone {
    pub(crate) action: Box<dyn rust::ActionModel>,
    pub(crate) robot: Option<Arc<condyle::Model>>,
    /// Whether the knot is terminal, so that it has no next state.
    pub(crate) end: bool,
    /// Text that identifies this knot among all knots of the robot.
    pub(crate) text: String,
}

/// Returns knot t of an action or of a problem. If t is `None`, `of` must be an action, and the result computes all
/// knots of this action.
pub(crate) fn alone(of: &Bound<'_, PyAny>, t: Option<usize>) -> PyResult<Alone> {
    let Ok(problem) = of.cast::<Problem>() else { return action_alone(of, t) };
    let (py, problem) = (of.py(), problem.get());
    let (inner, described) = (lock("problem", &problem.inner)?, lock("problem", &problem.described)?);
    let horizon = inner.horizon();
    let Some(t) = t else {
        return Err(ProblemError::new_err("t: expected the number of a knot of the problem, found None"));
    };
    let k = match inner.knot_models().get(t) {
        Some(&k) => k,
        None if t == horizon => described.len() - 1,
        None => return Err(ProblemError::new_err(format!("t: expected 0 to {horizon}, found {t}"))),
    };
    let mut alone = match (&described[k], &lock("problem", &problem.objects)?[k]) {
        (Some(described), _) => robot_alone(described, Some(t))?,
        (None, Some(object)) => action_alone(object.bind(py), Some(t))?,
        (None, None) => unreachable!("a model is a robot's or an object"),
    };
    alone.end |= t == horizon;
    Ok(alone)
}

fn action_alone(of: &Bound<'_, PyAny>, t: Option<usize>) -> PyResult<Alone> {
    let alone = |action, text| Ok(Alone { action, robot: None, end: false, text });
    if let Ok(lqr) = of.cast::<Lqr>() {
        let lqr = &lqr.get().0;
        return alone(Box::new(lqr.clone()), format!("{lqr:?}"));
    }
    if let Ok(unicycle) = of.cast::<Unicycle>() {
        let unicycle = &unicycle.get().0;
        return alone(Box::new(unicycle.clone()), format!("{unicycle:?}"));
    }
    if let Ok(constrained) = of.cast::<ConstrainedAction>() {
        return action_alone(constrained.get().action.bind(of.py()), t);
    }
    if of.is_instance_of::<ControlRate>() {
        return Err(control_rate_error());
    }
    if of.is_instance_of::<Action>() || of.is_instance_of::<DifferentialAction>() || !residuals(of).is_empty() {
        let found = of.get_type().name()?;
        return Err(ProblemError::new_err(format!(
            "action: this {found} is written in Python, which CasADi does not call: write it as CasADi's expressions"
        )));
    }
    match boxed(of, false, &Fault::default()).ok().and_then(|boxed| boxed.described) {
        Some(described) => robot_alone(&described, t),
        None => {
            let found = of.get_type().name()?;
            Err(PyTypeError::new_err(format!("action: expected an action or a Problem, found '{found}'")))
        }
    }
}

fn control_rate_error() -> PyErr {
    let what = "action: a ControlRate is no function of CasADi: use its action, and add the cost in CasADi";
    ProblemError::new_err(what)
}

fn robot_alone(Described { robot, knot }: &Described, t: Option<usize>) -> PyResult<Alone> {
    if knot.change.is_some() {
        return Err(control_rate_error());
    }
    let mut knot = knot.clone();
    if let Some(t) = t {
        knot.costs = knot.costs_at.remove(&t).unwrap_or(knot.costs);
        knot.costs_at.clear();
    }
    (knot.limits, knot.bounds) = (vec![], None);
    knot.limits_at.clear();
    let text = serde_json::to_string(&knot)
        .map_err(|error| ProblemError::new_err(format!("this knot cannot be a function of CasADi: {error}")))?;
    let action = knot.build(robot).map_err(problem_error)?;
    let end = action.is_terminal();
    Ok(Alone { action, robot: Some(robot.clone()), end, text })
}
