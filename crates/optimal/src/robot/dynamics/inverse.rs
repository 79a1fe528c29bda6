//! Dynamics of a robot whose accelerations are the controls, and whose efforts follow by inverse dynamics.

use super::acceleration::{Controlled, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::costs::Cost;
use crate::robot::integrators::{Integrated, Integrator};
use crate::robot::outputs::Capabilities;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Inverse dynamics of a robot that touches nothing: q̈ = u, τ = rnea(q, v, u), and costs.
pub type ControlledAcceleration = RobotAcceleration<Controlled>;

/// Knot of a robot whose nv controls are its accelerations, by semi-implicit Euler:
///
/// ```text
/// q̈ = u,   τ = rnea(q, v, u),   v⁺ = v + u Δt,   q⁺ = q ⊕ (v Δt + u Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// No equation is solved, so that a knot costs less than one of [`FreeDynamics`](crate::robot::FreeDynamics). Efforts
/// are looked at by [`Residual::JointEffort`](crate::robot::Residual::JointEffort); where nothing drives a floating
/// base they must be 0, which a [`Limit`](crate::robot::Limit) of
/// [`Residual::UndrivenEffort`](crate::robot::Residual::UndrivenEffort) holds. For a robot in contact, and with other
/// drives, see [`ContactInverseDynamics`](crate::robot::ContactInverseDynamics).
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Activation, Cost, FreeInverseDynamics, Residual};
/// use std::sync::Arc;
/// let effort = Residual::JointEffort { reference: vec![0.0; 7] };
/// let costs = vec![Cost::new("effort", 1.0, effort, Activation::Quadratic)];
/// let mut knot = FreeInverseDynamics::running(Arc::new(robots::arm7()), 0.1, costs)?;
/// let mut next = [0.0; 14];
/// knot.calc(0, &[0.0; 14], &[1.0; 7], &mut next);
/// assert!((next[7] - 0.1).abs() < 1e-15 && (next[0] - 0.01).abs() < 1e-15);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type FreeInverseDynamics = Integrated<ControlledAcceleration>;

impl ControlledAcceleration {
    /// Returns a robot that is driven at every coordinate.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit.
    pub fn new(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        let (nu, undriven) = (model.nv(), Actuation::joints(&model).undriven());
        let capabilities = Capabilities { nu, effort: true, inverse: true, undriven, ..Capabilities::default() };
        let actuation = Actuation::all(&model);
        RobotDynamics::new(model, actuation, capabilities, DynamicsKind::Inverse, costs).map(Self::of)
    }
}

impl FreeInverseDynamics {
    /// Returns a knot of Δt seconds by semi-implicit Euler. For other integrators see [`ControlledAcceleration::new`]
    /// and [`Integrated::new`].
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit, [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        Self::new(ControlledAcceleration::new(model, costs)?, Integrator::SemiImplicitEuler, dt)
    }
}
