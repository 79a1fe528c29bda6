//! Actions of robots whose controls include the accelerations.

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

/// A knot of a robot whose nv controls are the robot's accelerations: q̈ = u, τ = rnea(q, v, u). Integrator and cost
/// are as for `FreeDynamics`.
///
/// model: the robot.
/// dt: Δt in seconds.
/// costs: a list of `Cost`. In these costs, `Residual.joint_effort` depends on τ, and `Residual.undriven_effort` on the
///     efforts without actuators.
/// integrator, lower, upper, limits, controls: as for `FreeDynamics`.
///
/// Raises `ProblemError` for a cost or a limit that does not fit the robot.
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct FreeInverseDynamics(pub(super) RobotAction<robot::FreeInverseDynamics>);

methods! {
    /// Returns the accelerations that hold the robot still: nv zeros.
    FreeInverseDynamics::quasi_static;

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

/// A knot of a robot in contact, whose controls are the nv accelerations of the robot and the forces of its contacts: u
/// = (q̈, λ), and τ = M q̈ + h − Jᵀλ. Integrator and cost are as for `FreeDynamics`.
///
/// By default the knot has two kinds of `Limit`, which keep a residual at zero. The limit named `undriven efforts`
/// keeps Nᵀτ = 0. The columns of N are the directions without actuators, Nᵀ S = 0 with the actuation S. For a floating
/// base, Nᵀτ are the first 6 efforts. A limit named `contact` and the contact's name keeps J q̈ + γ = 0, as in
/// `constrained_dynamics`. `InteriorPoint` and `AugmentedLagrangian` enforce both limits; `Fddp` without
/// `AugmentedLagrangian` treats them as costs. No matrix is inverted, so contacts may be redundant. The equations are
/// the same as in Crocoddyl's `DifferentialActionModelContactInvDynamics`, and without contacts as in
/// `DifferentialActionModelFreeInvDynamics`.
///
/// model: the robot.
/// contacts: a dict of `ContactConstraint`s by name, which also defines the order of λ. The dict may be empty.
/// dt: Δt in seconds.
/// costs: a list of `Cost`. In these costs, `Residual.joint_effort` depends on τ, and `Residual.contact_force` on λ.
/// costs_at, actuation, integrator, lower, upper, limits, limits_at, controls: as for `FreeDynamics`. The actuation
/// defines which efforts have actuators. Bounds apply to all controls: nv accelerations and the rows of λ.
///
/// Raises `ProblemError` for a contact, cost, limit or actuation that does not fit the robot.
///
/// >>> from condyle.optimal import ContactInverseDynamics
/// >>> quadruped = condyle.robots.quadruped()
/// >>> feet = {foot: condyle.ContactConstraint(foot, "point", kd=50.0) for foot in ("LF_foot", "RH_foot")}
/// >>> ContactInverseDynamics(quadruped, feet, 0.02, [])
/// <condyle.optimal.ContactInverseDynamics of 'quadruped', 0.02 s, nu 24, contacts LF_foot RH_foot>
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ContactInverseDynamics(pub(super) RobotAction<robot::ContactInverseDynamics>);

methods! {
    /// Returns the controls that hold the robot still at the state x: nv zeros, the accelerations, and the contact
    /// forces λ. Among all solutions, efforts and forces together have the smallest norm.
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
