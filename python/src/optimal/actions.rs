//! Actions of robots; those of one's own are in `own.rs`.

use super::costs::{Cost, Limit};
use super::own::{Action, ConstrainedAction, Fault, Lqr};
use super::{exception, rust};
use crate::arrays::{Give, matrix, vector};
use crate::constrained::constraint;
use crate::functions::wrong_word;
use crate::model::Model as Robot;
use nalgebra::DMatrix;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rust::robot::{self, Actuation, ControlBounds, Dynamics, Integrator, Knot};
use rust::{ActionModel, NumDiff};
use std::any::Any;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A robot's action as data, if it can be put into a file.
#[derive(Clone)]
pub(super) struct Described {
    pub robot: Arc<condyle::Model>,
    pub knot: Knot,
}

/// A robot's action, as it is and as data.
struct RobotAction<A> {
    action: A,
    described: Described,
}

impl<A: ActionModel + Clone> RobotAction<A> {
    fn new(robot: &Bound<'_, Robot>, knot: impl FnOnce(&condyle::Model) -> PyResult<Knot>) -> PyResult<Self> {
        let robot = Arc::new(robot.get().inner.clone());
        let described = Described { knot: knot(&robot)?, robot };
        let action: Box<dyn Any> = described.build()?;
        Ok(Self { action: *action.downcast().expect("the class asks for its own kind of knot"), described })
    }

    fn boxed(&self) -> Boxed {
        Boxed {
            action: Box::new(self.action.clone()),
            kind: self.described.kind(),
            described: Some(self.described.clone()),
        }
    }
}

impl Described {
    /// With its action.
    pub(super) fn boxed(self) -> PyResult<Boxed> {
        Ok(Boxed { action: self.build()?, kind: self.kind(), described: Some(self) })
    }

    fn build(&self) -> PyResult<Box<dyn ActionModel>> {
        self.knot.build(&self.robot).map_err(exception)
    }

    /// Changes the weights of the terms called `name`.
    pub(super) fn set_weight(&mut self, name: &str, weight: f64) {
        let all = self.knot.costs.iter_mut().chain(self.knot.costs_at.values_mut().flatten());
        all.filter(|cost| cost.name == name).for_each(|cost| cost.weight = weight);
    }

    /// Knot t becomes knot t − 1.
    pub(super) fn shift(&mut self) {
        fn moved<T>(at: &mut BTreeMap<usize, T>) {
            *at = std::mem::take(at).into_iter().filter_map(|(t, own)| Some((t.checked_sub(1)?, own))).collect();
        }
        moved(&mut self.knot.costs_at);
        moved(&mut self.knot.limits_at);
    }

    fn kind(&self) -> Model {
        match self.knot.dynamics {
            Dynamics::Free { .. } | Dynamics::End => Model::Free,
            Dynamics::Contact { .. } => Model::Contact,
            Dynamics::Impulse { .. } => Model::Impulse,
            Dynamics::Inverse { .. } => Model::Inverse,
        }
    }
}

/// An action of a problem.
pub(super) struct Boxed {
    pub action: Box<dyn ActionModel>,
    pub kind: Model,
    pub described: Option<Described>,
}

/// What kind of action a model of a problem is.
#[derive(Clone, Copy)]
pub(super) enum Model {
    Free,
    Contact,
    Impulse,
    Inverse,
    Own,
}

impl Model {
    /// Changes a weight of model k, or of the terminal one; says whether there is such a term.
    pub(super) fn set_weight(self, problem: &mut rust::Problem, k: Option<usize>, name: &str, weight: f64) -> bool {
        self.change(problem, k, |robot| robot.set_weight(name, weight)).unwrap_or(false)
    }

    /// Changes a robot's model k, or the terminal one, if it is one, whatever constraints are around it.
    pub(super) fn change<T>(
        self,
        problem: &mut rust::Problem,
        k: Option<usize>,
        change: impl FnOnce(&mut dyn RobotKnot) -> T,
    ) -> Option<T> {
        fn find<A: ActionModel>(problem: &mut rust::Problem, k: Option<usize>) -> Option<&mut A> {
            match k {
                Some(k) => problem.model_mut(k),
                None => problem.terminal_mut(),
            }
        }
        fn inside<A: ActionModel>(problem: &mut rust::Problem, k: Option<usize>) -> Option<&mut A> {
            if find::<A>(problem, k).is_some() {
                return find(problem, k);
            }
            let mut around = find::<rust::Constrained>(problem, k)?;
            while around.action_mut::<A>().is_none() {
                around = around.action_mut()?;
            }
            around.action_mut()
        }
        let knot: &mut dyn RobotKnot = match self {
            Self::Free => inside::<robot::FreeDynamics>(problem, k)?,
            Self::Contact => inside::<robot::ContactDynamics>(problem, k)?,
            Self::Impulse => inside::<robot::ImpulseDynamics>(problem, k)?,
            Self::Inverse => inside::<robot::InverseDynamics>(problem, k)?,
            Self::Own => return None,
        };
        Some(change(knot))
    }
}

/// What all knots of robots have.
pub(super) trait RobotKnot {
    fn set_weight(&mut self, name: &str, weight: f64) -> bool;
    fn set_costs(&mut self, t: usize, costs: Vec<robot::Cost>) -> Result<(), rust::Error>;
}

macro_rules! robot_knots {
    ($($knot:ident),*) => {$(
        impl RobotKnot for robot::$knot {
            fn set_weight(&mut self, name: &str, weight: f64) -> bool {
                self.set_weight(name, weight)
            }

            fn set_costs(&mut self, t: usize, costs: Vec<robot::Cost>) -> Result<(), rust::Error> {
                self.set_costs(t, costs)
            }
        }
    )*};
}
robot_knots!(FreeDynamics, ContactDynamics, ImpulseDynamics, InverseDynamics);

/// A copy of any action.
pub(super) fn boxed(model: &Bound<'_, PyAny>, faults: &mut Vec<Fault>) -> PyResult<Boxed> {
    if let Ok(free) = model.cast::<FreeDynamics>() {
        return Ok(free.get().0.boxed());
    }
    if let Ok(contact) = model.cast::<ContactDynamics>() {
        return Ok(contact.get().0.boxed());
    }
    if let Ok(impulse) = model.cast::<ImpulseDynamics>() {
        return Ok(impulse.get().0.boxed());
    }
    if let Ok(inverse) = model.cast::<InverseDynamics>() {
        return Ok(inverse.get().0.boxed());
    }
    let own = |action| Boxed { action, kind: Model::Own, described: None };
    if let Ok(lqr) = model.cast::<Lqr>() {
        return Ok(own(Box::new(lqr.get().0.clone())));
    }
    if let Ok(constrained) = model.cast::<ConstrainedAction>() {
        let (py, constrained) = (model.py(), constrained.get());
        let Boxed { action, kind, .. } = boxed(constrained.action.bind(py), faults)?;
        let constraint = constrained.constraint(py, &*action);
        faults.push(constraint.fault.clone());
        let action = Box::new(rust::Constrained::new(action, Box::new(constraint)));
        return Ok(Boxed { action, kind, described: None });
    }
    let Ok(action) = model.cast::<Action>() else {
        let found = model.get_type().name()?;
        return Err(PyTypeError::new_err(format!("models: expected an action, found '{found}'")));
    };
    let written = action.get().copy(model.py());
    faults.push(written.fault.clone());
    Ok(own(if written.calc_diff.is_some() { Box::new(written) } else { Box::new(NumDiff(written)) }))
}

fn integrator(name: &str) -> PyResult<Integrator> {
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

/// S, if one is given: otherwise every joint but a free-flyer at the root is driven; and the number of controls.
fn actuation(model: &condyle::Model, map: Option<&Bound<'_, PyAny>>) -> PyResult<(Option<DMatrix<f64>>, usize)> {
    let Some(map) = map else { return Ok((None, Actuation::joints(model).nu())) };
    let shape: Vec<usize> = map.getattr("shape").and_then(|shape| shape.extract()).unwrap_or_default();
    let &[_, nu] = shape.as_slice() else {
        return Err(PyValueError::new_err("actuation: expected an array of shape (nv, nu)"));
    };
    Ok((Some(matrix("actuation", map, [model.nv(), nu])?.to_matrix()), nu))
}

pub(super) fn terms(costs: &[PyRef<'_, Cost>]) -> Vec<robot::Cost> {
    costs.iter().map(|c| c.0.clone()).collect()
}

/// Costs, or limits, of single knots.
type At<'py, T> = Option<BTreeMap<usize, Vec<PyRef<'py, T>>>>;

/// Limits of all knots, if there are any.
type Limits<'py> = Option<Vec<PyRef<'py, Limit>>>;

fn limits(limits: Limits<'_>) -> Vec<robot::Limit> {
    limits.into_iter().flatten().map(|limit| limit.0.clone()).collect()
}

/// Contacts with the names that residuals call them by.
fn contacts(model: &condyle::Model, contacts: &Bound<'_, PyDict>) -> PyResult<Vec<robot::Contact>> {
    let contact = |(name, given): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        Ok(robot::Contact::new(&name.extract::<String>()?, constraint(model, &given)?))
    };
    contacts.iter().map(contact).collect()
}

/// Bounds on nu controls, if there are any.
pub(super) fn bounds(
    nu: usize,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<[Vec<f64>; 2]>> {
    let bound = |name, given: Option<&Bound<'_, PyAny>>, none: f64| match given {
        Some(numbers) => Ok(vector(name, numbers, nu)?.to_vec()),
        None => PyResult::Ok(vec![none; nu]),
    };
    if lower.is_none() && upper.is_none() {
        return Ok(None);
    }
    Ok(Some([bound("lower", lower, f64::NEG_INFINITY)?, bound("upper", upper, f64::INFINITY)?]))
}

/// A knot as data.
fn knot(
    dynamics: Dynamics,
    (costs, costs_at): (&[PyRef<'_, Cost>], At<'_, Cost>),
    (all, limits_at): (Limits<'_>, At<'_, Limit>),
    bounds: Option<[Vec<f64>; 2]>,
) -> Knot {
    let costs_at = costs_at.into_iter().flatten().map(|(t, costs)| (t, terms(&costs))).collect();
    let limits_at = limits_at.into_iter().flatten().map(|(t, those)| (t, limits(Some(those)))).collect();
    let bounds = bounds.map(|[lower, upper]| ControlBounds { lower, upper });
    Knot { dynamics, costs: terms(costs), costs_at, limits: limits(all), limits_at, bounds }
}

/// A knot of a robot that moves freely under its joints' efforts.
///
/// q̈ = aba(q, v, S u); by semi-implicit Euler v⁺ = v + q̈ Δt, q⁺ = q ⊕ (v Δt + q̈ Δt²), cost Δt Σ w a(r); the state is
/// x = (q, v).
///
/// model: the robot.
/// dt: Δt in seconds, or None for a terminal knot: no controls, cost Σ w a(r).
/// costs: a list of `Cost`.
/// costs_at: lists of `Cost` by the number of a knot, for knots with costs of their own; so one action serves a phase.
/// actuation: S, (nv, nu); by default each joint but a free-flyer at the root has a control.
/// integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
/// lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
/// limits: a list of `Limit`, or None; `AugmentedLagrangian` holds them.
/// limits_at: lists of `Limit` by the number of a knot, for knots with limits of their own.
///
/// Raises `ProblemError` for a cost, a limit or drives that do not fit.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct FreeDynamics(RobotAction<robot::FreeDynamics>);

#[pymethods]
impl FreeDynamics {
    #[new]
    #[pyo3(signature = (model, dt, costs, costs_at=None, actuation=None, integrator="semi_implicit_euler", lower=None, upper=None, limits=None, limits_at=None))]
    fn new(
        model: &Bound<'_, Robot>,
        dt: Option<f64>,
        costs: Vec<PyRef<'_, Cost>>,
        costs_at: At<'_, Cost>,
        actuation: Option<&Bound<'_, PyAny>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        limits: Limits<'_>,
        limits_at: At<'_, Limit>,
    ) -> PyResult<Self> {
        let Some(dt) = dt else {
            let end = |_: &_| Ok(Knot { limits: self::limits(limits), ..Knot::new(Dynamics::End, terms(&costs)) });
            return Ok(Self(RobotAction::new(model, end)?));
        };
        let integrator = self::integrator(integrator)?;
        Ok(Self(RobotAction::new(model, |model| {
            let (actuation, nu) = self::actuation(model, actuation)?;
            let dynamics = Dynamics::Free { actuation, integrator, dt };
            Ok(knot(dynamics, (&costs, costs_at), (limits, limits_at), bounds(nu, lower, upper)?))
        })?))
    }

    /// The efforts that hold the robot still at the state x, nu numbers.
    fn quasi_static<'py>(&self, py: Python<'py>, x: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = &self.0.described.robot;
        let x = vector("x", x, model.nq() + model.nv())?;
        self.0.action.clone().quasi_static(&x).give(py, None)
    }
}

/// A knot of a robot in contact: M q̈ + h = S u + Jᵀλ, J q̈ + γ = 0; otherwise as `FreeDynamics`.
///
/// model: the robot.
/// contacts: a dict of `Constraint`s by name; residuals call them by these names. May be empty.
/// dt: Δt in seconds.
/// costs: a list of `Cost`.
/// damping: μ of J M⁻¹ Jᵀ + μ 1 (1/kg), for redundant contacts.
/// costs_at, actuation, integrator, lower, upper, limits, limits_at: as of `FreeDynamics`.
///
/// Raises `ProblemError` for a contact, cost, limit or drives that do not fit, and two contacts on one body without
/// damping.
///
/// >>> from condyle.optimal import ContactDynamics
/// >>> quadruped = condyle.robots.quadruped()
/// >>> feet = {foot: condyle.Constraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
/// >>> trot = ContactDynamics(quadruped, feet, 0.02, [])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ContactDynamics(RobotAction<robot::ContactDynamics>);

#[pymethods]
impl ContactDynamics {
    #[new]
    #[pyo3(signature = (model, contacts, dt, costs, damping=0.0, costs_at=None, actuation=None, integrator="semi_implicit_euler", lower=None, upper=None, limits=None, limits_at=None))]
    fn new(
        model: &Bound<'_, Robot>,
        contacts: &Bound<'_, PyDict>,
        dt: f64,
        costs: Vec<PyRef<'_, Cost>>,
        damping: f64,
        costs_at: At<'_, Cost>,
        actuation: Option<&Bound<'_, PyAny>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        limits: Limits<'_>,
        limits_at: At<'_, Limit>,
    ) -> PyResult<Self> {
        let integrator = self::integrator(integrator)?;
        Ok(Self(RobotAction::new(model, |model| {
            let ((actuation, nu), contacts) = (self::actuation(model, actuation)?, self::contacts(model, contacts)?);
            let dynamics = Dynamics::Contact { contacts, damping, actuation, integrator, dt };
            Ok(knot(dynamics, (&costs, costs_at), (limits, limits_at), bounds(nu, lower, upper)?))
        })?))
    }

    /// The smallest controls and forces that hold the robot still at the state x: nu controls of them.
    fn quasi_static<'py>(&self, py: Python<'py>, x: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let model = &self.0.described.robot;
        let x = vector("x", x, model.nq() + model.nv())?;
        self.0.action.clone().quasi_static(&x).give(py, None)
    }
}

/// A knot at which contacts set in: q⁺ = q, v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v, cost Σ w a(r).
///
/// There are no controls.
///
/// model: the robot.
/// contacts: a dict of `Constraint`s by name.
/// costs: a list of `Cost`; they look at the state before the impact.
/// restitution: ε, 0 to 1.
/// damping: μ (1/kg).
/// limits: a list of `Limit`, or None; they too look at the state before the impact.
///
/// Raises `ProblemError` as `ContactDynamics` does.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ImpulseDynamics(RobotAction<robot::ImpulseDynamics>);

#[pymethods]
impl ImpulseDynamics {
    #[new]
    #[pyo3(signature = (model, contacts, costs, restitution=0.0, damping=0.0, limits=None))]
    fn new(
        model: &Bound<'_, Robot>,
        contacts: &Bound<'_, PyDict>,
        costs: Vec<PyRef<'_, Cost>>,
        restitution: f64,
        damping: f64,
        limits: Limits<'_>,
    ) -> PyResult<Self> {
        Ok(Self(RobotAction::new(model, |model| {
            let contacts = self::contacts(model, contacts)?;
            let dynamics = Dynamics::Impulse { contacts, restitution, damping };
            Ok(knot(dynamics, (&costs, None), (limits, None), None))
        })?))
    }
}

/// A knot of a robot whose nv controls are its accelerations: q̈ = u, τ = rnea(q, v, u); otherwise as `FreeDynamics`.
///
/// model: the robot.
/// dt: Δt in seconds.
/// costs: a list of `Cost`; `Residual.joint_effort` looks at τ.
/// integrator, lower, upper, limits: as of `FreeDynamics`.
///
/// Raises `ProblemError` for a cost or a limit that does not fit.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct InverseDynamics(RobotAction<robot::InverseDynamics>);

#[pymethods]
impl InverseDynamics {
    #[new]
    #[pyo3(signature = (model, dt, costs, integrator="semi_implicit_euler", lower=None, upper=None, limits=None))]
    fn new(
        model: &Bound<'_, Robot>,
        dt: f64,
        costs: Vec<PyRef<'_, Cost>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        limits: Limits<'_>,
    ) -> PyResult<Self> {
        let integrator = self::integrator(integrator)?;
        Ok(Self(RobotAction::new(model, |model| {
            let bounds = bounds(model.nv(), lower, upper)?;
            Ok(knot(Dynamics::Inverse { integrator, dt }, (&costs, None), (limits, None), bounds))
        })?))
    }
}
