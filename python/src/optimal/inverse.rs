//! Actions of robots whose accelerations are controls.

use super::actions::{At, Limits, actuation, contacts, kept_at, knot};
use super::costs::{Cost, Limit};
use super::integrators;
use super::robot_action::{Reduced, RobotAction, WrittenAt, methods};
use crate::arrays::bounds;
use crate::model::Model;
use condyle::optimal::robot::{self, Dynamics};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A knot of a robot whose nv controls are its accelerations: q̈ = u, τ = rnea(q, v, u); otherwise as `FreeDynamics`.
///
/// model: the robot.
/// dt: Δt in seconds.
/// costs: a list of `Cost`; `Residual.joint_effort` looks at τ, `Residual.undriven_effort` at its part that nothing drives.
/// integrator, lower, upper, limits, controls: as of `FreeDynamics`.
///
/// Raises `ProblemError` for a cost or a limit that does not fit.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct InverseDynamics(pub(super) RobotAction<robot::InverseDynamics>);

methods! {
    /// The accelerations that hold the robot still: nv zeros.
    InverseDynamics::quasi_static;

    #[new]
    #[pyo3(signature = (
        model, dt, costs, integrator="semi_implicit_euler", lower=None, upper=None, limits=None, controls="constant"
    ))]
    fn new(
        model: &Bound<'_, Model>,
        dt: f64,
        costs: Vec<PyRef<'_, Cost>>,
        integrator: &str,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        limits: Limits<'_>,
        controls: &str,
    ) -> PyResult<Self> {
        let (integrator, controls) = (integrators::integrator(integrator)?, integrators::polynomial(controls)?);
        let kept = kept_at(model.py(), &costs, &None, &limits, &None);
        Ok(Self(RobotAction::new(model, kept, |model| {
            let bounds = bounds(model.nv(), lower, upper)?;
            Ok(knot(model, Dynamics::Inverse { integrator, dt }, (&costs, None), (limits, None), bounds, controls))
        })?))
    }
}

/// A knot of a robot in contact whose controls are its nv accelerations and the forces of its contacts: u = (q̈, λ), τ = M q̈
/// + h − Jᵀλ; otherwise as `FreeDynamics`.
///
/// Of itself it has a `Limit` to zero on the efforts that nothing drives, Nᵀτ = 0 with Nᵀ S = 0 (`undriven efforts`; of a
/// floating base the first 6), and on each contact's J q̈ + γ = 0 (`contact …`): `AugmentedLagrangian` holds them, to `Fddp`
/// alone they are costs. Nothing is inverted: contacts may be redundant. These are the rules of Crocoddyl's
/// `DifferentialActionModelContactInvDynamics`, and without contacts of `DifferentialActionModelFreeInvDynamics`.
///
/// model: the robot.
/// contacts: a dict of `ContactConstraint`s by name, the order of which is that of λ. May be empty.
/// dt: Δt in seconds.
/// costs: a list of `Cost`; `Residual.joint_effort` looks at τ, `Residual.contact_force` at λ.
/// costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as of `FreeDynamics`; the actuation says
///     which efforts there are, bounds are of all nv + rows controls.
///
/// Raises `ProblemError` for a contact, cost, limit or drives that do not fit.
///
/// >>> from condyle.optimal import ContactInverseDynamics
/// >>> quadruped = condyle.robots.quadruped()
/// >>> feet = {foot: condyle.ContactConstraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
/// >>> ContactInverseDynamics(quadruped, feet, 0.02, [])
/// <condyle.optimal.ContactInverseDynamics of 'quadruped', 0.02 s, nu 24, contacts LF_foot RH_foot>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ContactInverseDynamics(pub(super) RobotAction<robot::ContactInverseDynamics>);

methods! {
    /// No accelerations, and the forces among the smallest efforts and forces that hold the robot still at the state x:
    /// nv zeros and λ.
    ContactInverseDynamics::quasi_static;

    #[new]
    #[pyo3(signature = (
        model, contacts, dt, costs, costs_at=None, actuation=None, integrator="semi_implicit_euler", lower=None,
        upper=None, limits=None, limits_at=None, controls="constant"
    ))]
    fn new(
        model: &Bound<'_, Model>,
        contacts: &Bound<'_, PyDict>,
        dt: f64,
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
        let (integrator, controls) = (integrators::integrator(integrator)?, integrators::polynomial(controls)?);
        let kept = kept_at(model.py(), &costs, &costs_at, &limits, &limits_at);
        Ok(Self(RobotAction::new(model, kept, |model| {
            let ((actuation, _), contacts) = (self::actuation(model, actuation)?, self::contacts(model, contacts)?);
            let nu = model.nv() + contacts.iter().map(|contact| contact.constraint.kind.rows()).sum::<usize>();
            let dynamics = Dynamics::ContactInverse { contacts, actuation, integrator, dt };
            Ok(knot(model, dynamics, (&costs, costs_at), (limits, limits_at), bounds(nu, lower, upper)?, controls))
        })?))
    }
}
