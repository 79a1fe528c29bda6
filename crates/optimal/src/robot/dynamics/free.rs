//! Dynamics of a robot without contacts.

use super::acceleration::{Free, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::costs::Cost;
use crate::robot::integrators::{Integrated, Integrator};
use crate::robot::outputs::Capabilities;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Forward dynamics q̈ = aba(q, v, S u) and costs of a robot without contacts (aba: articulated-body algorithm).
pub type FreeAcceleration = RobotAcceleration<Free>;

/// Knot of a robot that moves freely. By default, the controls are joint efforts and the integrator is semi-implicit
/// Euler:
///
/// ```text
/// q̈ = aba(q, v, S u),   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// The state is x = (q, v). A terminal knot has no controls and no Δt: ℓ = Σ w a(r). The equations are the same as in
/// Crocoddyl.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Actuation, FreeDynamics, Integrator};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let mut fall = FreeDynamics::running(quadruped.clone(), 0.1, vec![])?;
/// let (mut x, mut next) = (condyle_dynamics::neutral(&quadruped), vec![0.0; 37]);
/// x.extend([0.0; 18]);
/// fall.calc(0, &x, &[0.0; 12], &mut next);
/// assert!((next[2] + 9.81 * 0.01).abs() < 1e-12); // −g Δt²
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type FreeDynamics = Integrated<FreeAcceleration>;

impl FreeAcceleration {
    /// Creates the dynamics of a robot with an actuation.
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot; [`Error::Actuation`] for the actuation of another
    /// robot, or a robot with joints that move no mass.
    pub fn new(model: Arc<Model>, actuation: Actuation, costs: Vec<Cost>) -> Result<Self, Error> {
        let capabilities = Capabilities { nu: actuation.nu(), effort: true, ..Capabilities::default() };
        RobotDynamics::new(model, actuation, capabilities, DynamicsKind::Free, costs).map(Self::of)
    }
}

impl FreeDynamics {
    /// Creates a knot of Δt seconds with semi-implicit Euler. All joints have motors, except a free-flyer at the root.
    /// For other actuations or integrators see [`FreeAcceleration::new`] and [`Integrated::new`].
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot, [`Error::TimeStep`] if Δt is not above 0,
    /// [`Error::Actuation`] for a robot with joints that move no mass.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        let actuation = Actuation::joints(&model);
        Self::new(FreeAcceleration::new(model, actuation, costs)?, Integrator::SemiImplicitEuler, dt)
    }

    /// Creates the terminal knot. A control residual must have an empty reference, because a terminal knot has no
    /// controls.
    ///
    /// # Errors
    /// [`Error::Cost`] for a cost term that does not fit the robot.
    pub fn terminal(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        let none = Actuation::none(&model);
        let robot = RobotDynamics::new(model, none, Capabilities::default(), DynamicsKind::None, costs)?;
        Ok(Self::without_time(FreeAcceleration::of(robot)))
    }
}
