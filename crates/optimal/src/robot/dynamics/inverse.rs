//! Dynamics of a robot whose controls are its accelerations. Inverse dynamics compute the efforts.

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

/// Inverse dynamics q̈ = u, τ = rnea(q, v, u) and costs of a robot without contacts (rnea: recursive Newton–Euler
/// algorithm).
pub type ControlledAcceleration = RobotAcceleration<Controlled>;

/// Knot of a robot whose nv controls are its accelerations. The default integrator is semi-implicit Euler:
///
/// ```text
/// q̈ = u,   τ = rnea(q, v, u),   v⁺ = v + u Δt,   q⁺ = q ⊕ (v Δt + u Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// No equation is solved, so a knot takes less time than a knot of [`FreeDynamics`](crate::robot::FreeDynamics).
/// [`Residual::JointEffort`](crate::robot::Residual::JointEffort) reads the efforts. The efforts of a floating base
/// without motors must be 0. A [`Limit`](crate::robot::Limit) of
/// [`Residual::UndrivenEffort`](crate::robot::Residual::UndrivenEffort) enforces this. For a robot in contact, and for
/// other actuations, see [`ContactInverseDynamics`](crate::robot::ContactInverseDynamics).
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
    /// Creates the dynamics of a robot whose controls are the accelerations of all coordinates.
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot.
    pub fn new(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        let (nu, undriven) = (model.nv(), Actuation::joints(&model).undriven());
        let capabilities = Capabilities { nu, effort: true, inverse: true, undriven, ..Capabilities::default() };
        let actuation = Actuation::all(&model);
        RobotDynamics::new(model, actuation, capabilities, DynamicsKind::Inverse, costs).map(Self::of)
    }
}

impl FreeInverseDynamics {
    /// Creates a knot of Δt seconds with semi-implicit Euler. For other integrators see [`ControlledAcceleration::new`]
    /// and [`Integrated::new`].
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot, [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        Self::new(ControlledAcceleration::new(model, costs)?, Integrator::SemiImplicitEuler, dt)
    }
}
