//! Actions of robots: `FreeDynamics`, `ContactDynamics`, `ImpulseDynamics`.

use super::costs::{Cost, Limit};
use super::integrators;
use super::robot_action::{Reduced, RobotAction, WrittenAt, methods};
use crate::arrays::{bounds, matrix};
use crate::constrained::constraint;
use crate::model::Model;
use condyle::optimal as rust;
use nalgebra::DMatrix;
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rust::robot::{self, Actuation, ControlBounds, ControlPolynomial, Dynamics, Knot};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Returns the actuation matrix S if it is given, and the number of controls. Without S, every joint is driven except a
/// free-flyer at the root.
pub(super) fn actuation(
    model: &condyle::Model,
    map: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Option<DMatrix<f64>>, usize)> {
    let Some(map) = map else { return Ok((None, Actuation::joints(model).nu())) };
    let shape: Vec<usize> = map.getattr("shape").and_then(|shape| shape.extract()).unwrap_or_default();
    let &[_, nu] = shape.as_slice() else {
        return Err(PyValueError::new_err("actuation: expected an array of shape (nv, nu)"));
    };
    Ok((Some(matrix("actuation", map, [model.nv(), nu])?.to_matrix()), nu))
}

pub(super) fn terms(model: &Arc<condyle::Model>, costs: &[PyRef<'_, Cost>]) -> Vec<robot::Cost> {
    costs.iter().map(|cost| cost.of(model)).collect()
}

/// Costs or limits that apply at single knots, by the index of the knot.
pub(super) type At<'py, T> = Option<BTreeMap<usize, Vec<PyRef<'py, T>>>>;

/// Limits that apply at all knots; `None` if there are no limits.
pub(super) type Limits<'py> = Option<Vec<PyRef<'py, Limit>>>;

/// Collects the residuals that are written in Python, from costs and limits.
pub(super) fn kept_at(
    py: Python<'_>,
    costs: &[PyRef<'_, Cost>],
    costs_at: &At<'_, Cost>,
    limits: &Limits<'_>,
    limits_at: &At<'_, Limit>,
) -> Vec<Py<PyAny>> {
    let costs = costs.iter().chain(costs_at.iter().flat_map(|at| at.values().flatten()));
    let limits = limits.iter().flatten().chain(limits_at.iter().flat_map(|at| at.values().flatten()));
    costs.filter_map(|cost| cost.own(py)).chain(limits.filter_map(|limit| limit.own(py))).collect()
}

fn limits(model: &Arc<condyle::Model>, limits: Limits<'_>) -> Vec<robot::Limit> {
    limits.into_iter().flatten().map(|limit| limit.of(model)).collect()
}

/// Reads contacts by name; residuals refer to a contact by this name.
pub(super) fn contacts(model: &condyle::Model, contacts: &Bound<'_, PyDict>) -> PyResult<Vec<robot::Contact>> {
    let contact = |(name, given): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        Ok(robot::Contact::new(&name.extract::<String>()?, constraint(model, &given)?))
    };
    contacts.iter().map(contact).collect()
}

/// Creates the description of a knot.
pub(super) fn knot(
    model: &Arc<condyle::Model>,
    dynamics: Dynamics,
    (costs, costs_at): (&[PyRef<'_, Cost>], At<'_, Cost>),
    (all, limits_at): (Limits<'_>, At<'_, Limit>),
    bounds: Option<[Vec<f64>; 2]>,
    controls: ControlPolynomial,
) -> Knot {
    let costs_at = costs_at.into_iter().flatten().map(|(t, costs)| (t, terms(model, &costs))).collect();
    let limits_at = limits_at.into_iter().flatten().map(|(t, those)| (t, limits(model, Some(those)))).collect();
    let bounds = bounds.map(|[lower, upper]| ControlBounds { lower, upper });
    let (costs, limits) = (terms(model, costs), limits(model, all));
    Knot { dynamics, costs, costs_at, limits, limits_at, bounds, controls, change: None }
}

/// A knot of a robot that moves freely under its joints' efforts.
///
/// q̈ = aba(q, v, S u). With semi-implicit Euler, v⁺ = v + q̈ Δt and q⁺ = q ⊕ (v Δt + q̈ Δt²). The cost is Δt Σ w a(r)
/// over all `Cost`s, with weight w, activation a and residual r. The state is x = (q, v).
///
/// model: the robot.
/// dt: Δt in seconds, or None for a terminal knot, which has no controls and the cost Σ w a(r).
/// costs: a list of `Cost`.
/// costs_at: lists of `Cost` by index of the knot. At these knots they replace `costs`, so one action can serve all
///     knots of a contact phase.
/// actuation: S, (nv, nu); by default each joint has a control, except a free-flyer at the root.
/// integrator: 'semi_implicit_euler', 'runge_kutta_2', 'runge_kutta_3' or 'runge_kutta_4'.
/// lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
/// limits: a list of `Limit`, or None; `InteriorPoint` and `AugmentedLagrangian` enforce them.
/// limits_at: lists of `Limit` by index of the knot. At these knots they replace `limits`.
/// controls: the polynomial that the controls follow within a knot: 'constant', 'linear' or 'quadratic'. The knot then
///     has nu, 2 nu or 3 nu controls: one value of u; values at the times 0 and Δt/2; or values at 0, Δt/2 and Δt
///     ('runge_kutta_3': 0, Δt/3 and 2 Δt/3). Bounds apply to each of these values.
///
/// Raises `ProblemError` for a cost, a limit or an actuation that does not fit the robot.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct FreeDynamics(pub(super) RobotAction<robot::FreeDynamics>);

methods! {
    /// Returns the efforts that hold the robot still at the state x, nu numbers.
    FreeDynamics::quasi_static;

    #[new]
    #[pyo3(signature = (
        model, dt, costs, costs_at=None, actuation=None, integrator="semi_implicit_euler", lower=None, upper=None,
        limits=None, limits_at=None, controls="constant"
    ))]
    fn new(
        model: &Bound<'_, Model>,
        dt: Option<f64>,
        costs: Vec<PyRef<'_, Cost>>,
        costs_at: At<'_, Cost>,
        actuation: Option<&Bound<'_, PyAny>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        limits: Limits<'_>,
        limits_at: At<'_, Limit>,
        controls: &str,
    ) -> PyResult<Self> {
        let Some(dt) = dt else {
            let kept = kept_at(model.py(), &costs, &None, &limits, &None);
            let end = |model: &_| {
                Ok(Knot { limits: self::limits(model, limits), ..Knot::new(Dynamics::Terminal, terms(model, &costs)) })
            };
            return Ok(Self(RobotAction::new(model, kept, end)?));
        };
        let (integrator, controls) = (integrators::integrator(integrator)?, integrators::polynomial(controls)?);
        let kept = kept_at(model.py(), &costs, &costs_at, &limits, &limits_at);
        Ok(Self(RobotAction::new(model, kept, |model| {
            let (actuation, nu) = self::actuation(model, actuation)?;
            let dynamics = Dynamics::Free { actuation, integrator, dt };
            Ok(knot(model, dynamics, (&costs, costs_at), (limits, limits_at), bounds(nu, lower, upper)?, controls))
        })?))
    }
}

/// A knot of a robot in contact: M q̈ + h = S u + Jᵀλ and J q̈ + γ = 0, with the contact forces λ, the Jacobian J of
/// the contacts, and γ as for `constrained_dynamics`. Integrator and cost are as for `FreeDynamics`.
///
/// model: the robot.
/// contacts: a dict of `ContactConstraint`s by name, which may be empty. Residuals refer to a contact by this name.
/// dt: Δt in seconds.
/// costs: a list of `Cost`.
/// damping: μ in J M⁻¹ Jᵀ + μ 1 (1/kg), which makes this matrix invertible for redundant contacts.
/// costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as for `FreeDynamics`.
///
/// Raises `ProblemError` for a contact, cost, limit or actuation that does not fit the robot, and for two contacts on
/// one body without damping.
///
/// >>> from condyle.optimal import ContactDynamics
/// >>> quadruped = condyle.robots.quadruped()
/// >>> feet = {foot: condyle.ContactConstraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
/// >>> trot = ContactDynamics(quadruped, feet, 0.02, [])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ContactDynamics(pub(super) RobotAction<robot::ContactDynamics>);

methods! {
    /// Returns the controls that hold the robot still at the state x, nu numbers. Among all solutions, controls and
    /// contact forces together have the smallest norm.
    ContactDynamics::quasi_static;

    #[new]
    #[pyo3(signature = (
        model, contacts, dt, costs, damping=0.0, costs_at=None, actuation=None, integrator="semi_implicit_euler",
        lower=None, upper=None, limits=None, limits_at=None, controls="constant"
    ))]
    fn new(
        model: &Bound<'_, Model>,
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
        controls: &str,
    ) -> PyResult<Self> {
        let (integrator, controls) = (integrators::integrator(integrator)?, integrators::polynomial(controls)?);
        let kept = kept_at(model.py(), &costs, &costs_at, &limits, &limits_at);
        Ok(Self(RobotAction::new(model, kept, |model| {
            let ((actuation, nu), contacts) = (self::actuation(model, actuation)?, self::contacts(model, contacts)?);
            let dynamics = Dynamics::Contact { contacts, damping, actuation, integrator, dt };
            Ok(knot(model, dynamics, (&costs, costs_at), (limits, limits_at), bounds(nu, lower, upper)?, controls))
        })?))
    }
}

/// A knot at which contacts begin with an impact: q⁺ = q, v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v, with the
/// inertia matrix M and the Jacobian J of the contacts. The cost is Σ w a(r), as for `FreeDynamics` without Δt.
///
/// An impact has no controls.
///
/// model: the robot.
/// contacts: a dict of `ContactConstraint`s by name.
/// costs: a list of `Cost`, which are evaluated at the state before the impact.
/// restitution: ε, 0 to 1.
/// damping: μ (1/kg).
/// limits: a list of `Limit`, or None; limits are also evaluated at the state before the impact.
///
/// Raises `ProblemError` as `ContactDynamics` does.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ImpulseDynamics(pub(super) RobotAction<robot::ImpulseDynamics>);

methods! {
    /// Returns an empty array, since an impact has no controls.
    ImpulseDynamics::quasi_static;

    #[new]
    #[pyo3(signature = (model, contacts, costs, restitution=0.0, damping=0.0, limits=None))]
    fn new(
        model: &Bound<'_, Model>,
        contacts: &Bound<'_, PyDict>,
        costs: Vec<PyRef<'_, Cost>>,
        restitution: f64,
        damping: f64,
        limits: Limits<'_>,
    ) -> PyResult<Self> {
        let kept = kept_at(model.py(), &costs, &None, &limits, &None);
        Ok(Self(RobotAction::new(model, kept, |model| {
            let contacts = self::contacts(model, contacts)?;
            let dynamics = Dynamics::Impulse { contacts, restitution, damping };
            Ok(knot(model, dynamics, (&costs, None), (limits, None), None, ControlPolynomial::Constant))
        })?))
    }
}
