//! A robot's action, and its serialisable description.

use super::residuals::{Residual, put_written, take_written};
use crate::arrays::{Give, vector};
use crate::exceptions::{ProblemError, problem_error};
use crate::model::Model;
use condyle::Se3;
use condyle::optimal as rust;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::ActionModel;
use rust::robot::{ControlChange, Dynamics, GeometryPair, Knot};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A robot's action as data that can be written to a file.
#[derive(Clone)]
pub(super) struct Described {
    pub robot: Arc<condyle::Model>,
    pub knot: Knot,
}

/// A robot's action and its description, without scratch memory for computations. A problem creates the scratch memory
/// once for all actions that differ only in their costs.
pub(super) struct RobotAction<A> {
    action: A,
    pub(super) described: Arc<Described>,
    model: Py<Model>,
    /// Residuals that are written in Python. These objects are reported to Python's garbage collector.
    kept: Vec<Py<PyAny>>,
}

impl<A: ActionModel + Clone> RobotAction<A> {
    pub(super) fn new(
        model: &Bound<'_, Model>,
        kept: Vec<Py<PyAny>>,
        knot: impl FnOnce(&Arc<condyle::Model>) -> PyResult<Knot>,
    ) -> PyResult<Self> {
        let robot = model.get().inner.clone();
        let described = Arc::new(Described { knot: knot(&robot)?, robot });
        let action: Box<dyn Any> = described.build()?;
        let action = *action.downcast().expect("the class asks for its own kind of knot");
        Ok(Self { action, described, model: model.clone().unbind(), kept })
    }

    /// Copies the action for a problem.
    pub(super) fn boxed(&self) -> Boxed {
        Boxed { action: Box::new(self.action.clone()), described: Some(self.described.clone()) }
    }

    /// Returns the controls that hold the robot still at the state x.
    pub(super) fn quasi_static<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = &self.described.robot;
        let state = vector("x", x, model.nq() + model.nv())?;
        ActionModel::quasi_static(&mut self.action.clone(), 0, &state).give(x.py(), None)
    }

    /// Iterates over the residuals that are written in Python.
    pub(super) fn kept(&self, py: Python<'_>) -> impl Iterator<Item = Py<PyAny>> {
        self.kept.iter().map(move |residual| residual.clone_ref(py))
    }

    pub(super) fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.kept.iter().try_for_each(|residual| visit.call(residual))
    }

    /// Returns a short description of the action.
    pub(super) fn repr(&self, class: &str) -> String {
        let Knot { dynamics, costs, limits, .. } = &self.described.knot;
        let duration = match (dynamics.dt(), dynamics) {
            (Some(dt), _) => format!("{dt} s"),
            (None, Dynamics::Impulse { .. }) => "an impact".to_owned(),
            (None, _) => "the end".to_owned(),
        };
        let contacts: Vec<_> = match dynamics {
            Dynamics::Contact { contacts, .. }
            | Dynamics::Impulse { contacts, .. }
            | Dynamics::ContactInverse { contacts, .. } => {
                contacts.iter().map(|contact| contact.name.as_str()).collect()
            }
            _ => vec![],
        };
        let list = |what: &str, names: Vec<&str>| match names.is_empty() {
            true => String::new(),
            false => format!(", {what} {}", names.join(" ")),
        };
        let (contacts, costs) = (list("contacts", contacts), list("costs", costs.iter().map(|c| &*c.name).collect()));
        let limits = list("limits", limits.iter().map(|limit| &*limit.name).collect());
        let robot = self.described.robot.name();
        format!("<condyle.optimal.{class} of '{robot}', {duration}, nu {}{contacts}{costs}{limits}>", self.action.nu())
    }

    /// Returns the function and the arguments from which `pickle` makes an equal action. The arguments are the robot,
    /// the knot as JSON, and the knot's residuals that are written in Python.
    pub(super) fn reduce<'py>(&self, object: &Bound<'py, PyAny>) -> PyResult<Reduced<'py>> {
        let (text, written) = self.described.knot_parts(object.py())?;
        Ok((object.get_type().getattr("_from_parts")?, (self.model.clone_ref(object.py()), text, written)))
    }

    /// Creates the action from the arguments that `reduce` returns.
    pub(super) fn from_parts(model: &Bound<'_, Model>, text: &str, written: &WrittenAt<'_>) -> PyResult<Self> {
        let kept = written.iter().map(|(_, residual)| residual.clone().into_any().unbind()).collect();
        Self::new(model, kept, |robot| knot_of(robot, text, written))
    }
}

/// A function that creates an object, and the arguments of this function.
pub(super) type Reduced<'py> = (Bound<'py, PyAny>, (Py<Model>, String, WrittenAt<'py>));

/// Residuals of a knot that are written in Python, with their indices.
pub(super) type WrittenAt<'py> = Vec<(usize, Bound<'py, Residual>)>;

/// Creates a knot from the arguments that a pickle contains.
pub(super) fn knot_of(robot: &Arc<condyle::Model>, text: &str, written: &WrittenAt<'_>) -> PyResult<Knot> {
    let wrong = |error| ProblemError::new_err(format!("no knot: {error}"));
    let mut knot = serde_json::from_str(text).map_err(wrong)?;
    put_written(&mut knot, robot, written)?;
    Ok(knot)
}

impl Described {
    /// Returns the data of the knot for a pickle: JSON, and the residuals that are written in Python.
    pub(super) fn knot_parts<'py>(&self, py: Python<'py>) -> PyResult<(String, WrittenAt<'py>)> {
        let mut knot = self.knot.clone();
        let written = take_written(&mut knot);
        let text = serde_json::to_string(&knot).map_err(|error| ProblemError::new_err(error.to_string()))?;
        let objects = written.into_iter().map(|(place, residual)| Ok((place, Bound::new(py, residual)?)));
        Ok((text, objects.collect::<PyResult<_>>()?))
    }

    /// Creates the described action.
    pub(super) fn boxed(self) -> PyResult<Boxed> {
        Ok(Boxed { action: self.build()?, described: Some(Arc::new(self)) })
    }

    fn build(&self) -> PyResult<Box<dyn ActionModel>> {
        self.knot.build(&self.robot).map_err(problem_error)
    }

    /// Changes the weights of the terms with this name; the caller has checked the weight.
    pub(super) fn set_weight(&mut self, name: &str, weight: f64) {
        let all = self.knot.costs.iter_mut().chain(self.knot.costs_at.values_mut().flatten());
        all.filter(|cost| cost.name == name).for_each(|cost| cost.weight = weight);
    }

    /// Sets the placement of a geometry in the limits of knot t, or in the common limits if t is `None`.
    pub(super) fn place(&mut self, t: Option<usize>, name: &str, placement: Se3<f64>) {
        let Knot { limits, limits_at, .. } = &mut self.knot;
        let of = t.and_then(|t| limits_at.get(&t)).unwrap_or(limits);
        let has = |pair: &GeometryPair| pair.first.name == name || pair.second.name == name;
        if !of.iter().any(
            |limit| matches!(&limit.residual, rust::robot::Residual::Distances { pairs, .. } if pairs.iter().any(has)),
        ) {
            return;
        }
        let own = match t {
            Some(t) => limits_at.entry(t).or_insert_with(|| limits.clone()),
            None => limits,
        };
        for limit in own {
            let rust::robot::Residual::Distances { pairs, .. } = &mut limit.residual else { continue };
            let geometries = pairs.iter_mut().flat_map(|pair| [&mut pair.first, &mut pair.second]);
            geometries.filter(|geometry| geometry.name == name).for_each(|geometry| geometry.placement = placement);
        }
    }

    /// Moves the costs and limits of knot t to knot t − 1.
    pub(super) fn shift(&mut self) {
        fn moved<T>(at: &mut BTreeMap<usize, T>) {
            *at = std::mem::take(at).into_iter().filter_map(|(t, own)| Some((t.checked_sub(1)?, own))).collect();
        }
        moved(&mut self.knot.costs_at);
        moved(&mut self.knot.limits_at);
    }

    /// Removes the costs and limits of knot t.
    pub(super) fn release(&mut self, t: usize) {
        self.knot.costs_at.remove(&t);
        self.knot.limits_at.remove(&t);
    }

    /// Returns the same action with the duration `dt` (s).
    pub(super) fn with_duration(&self, dt: f64) -> Self {
        let mut copy = self.clone();
        copy.knot.dynamics.set_dt(dt);
        copy
    }

    /// Returns the same action with a cost of the change of its controls; `None` if it has one already, because a
    /// description has at most one.
    pub(super) fn with_change(&self, change: ControlChange) -> Option<Arc<Self>> {
        let (robot, knot) = (self.robot.clone(), Knot { change: Some(change), ..self.knot.clone() });
        self.knot.change.is_none().then(|| Arc::new(Self { robot, knot }))
    }

    /// Returns whether a shift changes the action, because some costs or limits apply at single knots.
    pub(super) fn moves(&self) -> bool {
        !(self.knot.costs_at.is_empty() && self.knot.limits_at.is_empty())
    }
}

/// An action for a problem, with its description if the action can be written to a file.
pub(super) struct Boxed {
    pub action: Box<dyn ActionModel>,
    pub described: Option<Arc<Described>>,
}

/// Returns the action of type A in model k of a problem, or in the terminal model if k is `None`. The action may be
/// inside a constrained action or a control rate.
pub(super) fn inside<A: ActionModel>(problem: &mut rust::Problem, k: Option<usize>) -> Option<&mut A> {
    fn find<A: ActionModel>(problem: &mut rust::Problem, k: Option<usize>) -> Option<&mut A> {
        match k {
            Some(k) => problem.model_mut(k),
            None => problem.terminal_mut(),
        }
    }
    if find::<A>(problem, k).is_some() {
        return find(problem, k);
    }
    /// Returns the action of type A that an action wraps.
    fn inner<A: ActionModel>(around: &mut dyn ActionModel) -> Option<&mut A> {
        let action = around.inner_mut()?;
        let any: &dyn Any = action;
        if !any.is::<A>() {
            return inner(action);
        }
        let any: &mut dyn Any = action;
        any.downcast_mut()
    }
    if find::<rust::ControlRate>(problem, k).is_some() {
        return inner(find::<rust::ControlRate>(problem, k)?);
    }
    inner(find::<rust::Constrained>(problem, k)?)
}

/// Changes a robot's action in a problem, which `inside` finds. Returns `None` if the action does not belong to a
/// robot.
macro_rules! change {
    ($problem:expr, $k:expr, |$knot:ident| $change:expr) => {
        change!(
            $problem, $k, |$knot| $change;
            FreeDynamics, ContactDynamics, ImpulseDynamics, FreeInverseDynamics, ContactInverseDynamics
        )
    };
    ($problem:expr, $k:expr, |$knot:ident| $change:expr; $($class:ident),*) => {
        $(if let Some($knot) = $crate::optimal::robot_action::inside::<condyle::optimal::robot::$class>($problem, $k) {
            Some($change)
        } else)* {
            None
        }
    };
}
pub(super) use change;

/// Defines the methods of a class that contains a [`RobotAction`]: `quasi_static` with its documentation, methods of
/// this class only, and methods of all such classes.
macro_rules! methods {
    ($(#[doc = $gives:literal])+ $class:ident::quasi_static; $($own:tt)*) => {
        #[pymethods]
        impl $class {
            $($own)*

            $(#[doc = $gives])+
            fn quasi_static<'py>(&self, x: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
                self.0.quasi_static(x)
            }

            fn __repr__(&self) -> String {
                self.0.repr(stringify!($class))
            }

            fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
                self.0.traverse(&visit)
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Reduced<'py>> {
                slf.get().0.reduce(slf)
            }

            #[staticmethod]
            fn _from_parts(model: &Bound<'_, Model>, text: &str, written: WrittenAt<'_>) -> PyResult<Self> {
                Ok(Self(RobotAction::from_parts(model, text, &written)?))
            }
        }
    };
}
pub(super) use methods;
