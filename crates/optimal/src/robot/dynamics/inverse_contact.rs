//! Dynamics of a robot in contact whose controls are accelerations and contact forces. Inverse dynamics compute the
//! efforts.

use super::acceleration::{ControlledInContact, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, rows_of};
use crate::robot::costs::Cost;
use crate::robot::integrators::{Integrated, Integrator};
use crate::robot::limits::Limit;
use crate::robot::outputs::Capabilities;
use crate::robot::residuals::residual::Residual;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Inverse dynamics and costs of a robot in contact: (q̈, λ) = u and τ = M q̈ + h − Jᵀλ, with the conditions Nᵀτ = 0
/// and J q̈ + γ = 0.
pub type ControlledContactAcceleration = RobotAcceleration<ControlledInContact>;

/// Knot of a robot in contact whose controls are its nv accelerations and its contact forces. The default integrator is
/// semi-implicit Euler:
///
/// ```text
/// (q̈, λ) = u,   τ = M q̈ + h − Jᵀλ,   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// Nᵀτ = 0        no effort without a motor (Nᵀ S = 0; for a floating base, the first 6 rows of τ)
/// J q̈ + γ = 0    no acceleration of contacts
/// ```
///
/// The last two equations are [`Limit`]s, called `undriven efforts` and `contact …`. Every such knot has these limits;
/// they precede the user's limits. [`AugmentedLagrangian`](crate::AugmentedLagrangian) enforces them; for
/// [`Fddp`](crate::Fddp) alone they are costs. No matrix is inverted, so contacts may be redundant and M may be
/// singular. Solutions are the same as with [`ContactDynamics`](crate::robot::ContactDynamics), which takes fewer
/// iterations but does not support every robot. Without contacts, the knot is a
/// [`FreeInverseDynamics`](crate::robot::FreeInverseDynamics) with an actuation. The equations are the same as in
/// Crocoddyl's `DifferentialActionModelContactInvDynamics` and, without contacts,
/// `DifferentialActionModelFreeInvDynamics`.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, robots};
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Contact, ContactInverseDynamics};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let contacts = ["LF_foot", "RH_foot"].map(|foot| {
///     let frame = quadruped.frame(foot).unwrap();
///     Contact::new(foot, ContactConstraint { kd: 50.0, ..ContactConstraint::point(frame) })
/// });
/// let trot = ContactInverseDynamics::running(quadruped, &contacts, 0.02, vec![])?;
/// assert_eq!(trot.nu(), 18 + 6);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type ContactInverseDynamics = Integrated<ControlledContactAcceleration>;

impl ControlledContactAcceleration {
    /// Creates the dynamics of a robot in contact, with an actuation.
    ///
    /// # Errors
    /// [`Error::Contact`] for a contact that does not fit the robot, or has the name of another contact;
    /// [`Error::Cost`] for a cost term that does not fit the robot; [`Error::Actuation`] for the actuation of another
    /// robot.
    pub fn new(model: Arc<Model>, actuation: Actuation, contacts: &[Contact], costs: Vec<Cost>) -> Result<Self, Error> {
        actuation.check(&model)?;
        let (all, named, undriven) = (Actuation::all(&model), rows_of(contacts), actuation.undriven());
        let drives = (!undriven.is_empty()).then(|| Limit::equality("undriven efforts", Residual::UndrivenEffort));
        let holds = named.iter().map(|(contact, _)| {
            Limit::equality(&format!("contact {contact}"), Residual::ContactAcceleration { contact: contact.clone() })
        });
        let limits = drives.into_iter().chain(holds).collect();
        let nu = model.nv() + named.last().map_or(0, |(_, rows)| rows.end);
        let capabilities =
            Capabilities { nu, effort: true, inverse: true, undriven, contacts: named, ..Capabilities::default() };
        let kind = DynamicsKind::ContactInverse(contacts.to_vec(), actuation);
        let mut robot = RobotDynamics::new(model, all, capabilities, kind, costs)?;
        robot.terms.require(limits)?;
        Ok(Self::of(robot))
    }
}

impl ContactInverseDynamics {
    /// Creates a knot of Δt seconds with semi-implicit Euler. All joints have motors, except a free-flyer at the root.
    /// For other actuations and integrators see [`ControlledContactAcceleration::new`] and [`Integrated::new`].
    ///
    /// # Errors
    /// The errors of [`ControlledContactAcceleration::new`], and [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, contacts: &[Contact], dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        let actuation = Actuation::joints(&model);
        let inner = ControlledContactAcceleration::new(model, actuation, contacts, costs)?;
        Self::new(inner, Integrator::SemiImplicitEuler, dt)
    }
}
