//! Dynamics of a robot in contact with the world.

use super::acceleration::{InContact, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, rows_of};
use crate::robot::costs::Cost;
use crate::robot::integrators::{Integrated, Integrator};
use crate::robot::outputs::Capabilities;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Forward dynamics and costs of a robot in contact: q̈ and λ are the solution of M q̈ + h = S u + Jᵀλ and J q̈ + γ =
/// 0.
pub type ContactAcceleration = RobotAcceleration<InContact>;

/// Knot of a robot in contact. By default, the controls are joint efforts and the integrator is semi-implicit Euler:
///
/// ```text
/// [ M  Jᵀ ] [  q̈ ]   [ S u − h ]
/// [ J  −μ ] [ −λ ] = [ −γ      ],   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// Any set of point and rigid contacts is allowed, also an empty set. If contacts are redundant, a damping μ above 0
/// makes the matrix J M⁻¹ Jᵀ + μ 1 regular. The equations are the same as in Crocoddyl's
/// `DifferentialActionModelContactFwdDynamics`.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, robots};
/// use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FrictionCone, Residual};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let contacts = ["LF_foot", "RH_foot"].map(|foot| {
///     let frame = quadruped.frame(foot).unwrap();
///     Contact::new(foot, ContactConstraint { kd: 50.0, ..ContactConstraint::point(frame) })
/// });
/// let cone = FrictionCone::new(0.7);
/// let (lower, upper) = cone.bounds();
/// let grip = Residual::FrictionCone { contact: "LF_foot".into(), cone };
/// let costs = vec![Cost::new("grip", 1e1, grip, Activation::Barrier { lower, upper })];
/// let trot = ContactDynamics::running(quadruped, &contacts, 0.02, costs)?;
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type ContactDynamics = Integrated<ContactAcceleration>;

impl ContactAcceleration {
    /// Creates the dynamics of a robot in contact, with an actuation and the damping μ.
    ///
    /// # Errors
    /// - [`Error::Contact`] for a contact that does not fit the robot, has the name of another contact, or holds a
    ///   frame as another contact does. Without damping, also for a contact that is singular with other contacts on the
    ///   same body, such as a line in the plane of another contact.
    /// - [`Error::Setting`] for a damping below 0.
    /// - [`Error::Cost`] for a cost term that does not fit the robot.
    /// - [`Error::Actuation`] for the actuation of another robot, or a robot with joints that move no mass.
    pub fn new(
        model: Arc<Model>,
        actuation: Actuation,
        contacts: &[Contact],
        damping: f64,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        let nu = actuation.nu();
        let capabilities = Capabilities { nu, effort: true, contacts: rows_of(contacts), ..Capabilities::default() };
        let kind = DynamicsKind::Contact(contacts.to_vec(), damping);
        RobotDynamics::new(model, actuation, capabilities, kind, costs).map(Self::of)
    }
}

impl ContactDynamics {
    /// Creates a knot of Δt seconds with semi-implicit Euler and without damping. All joints have motors, except a
    /// free-flyer at the root. For other actuations, integrators and damping see [`ContactAcceleration::new`] and
    /// [`Integrated::new`].
    ///
    /// # Errors
    /// The errors of [`ContactAcceleration::new`], and [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, contacts: &[Contact], dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        let actuation = Actuation::joints(&model);
        let inner = ContactAcceleration::new(model, actuation, contacts, 0.0, costs)?;
        Self::new(inner, Integrator::SemiImplicitEuler, dt)
    }
}
