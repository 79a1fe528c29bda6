//! Impacts: knots without duration and without controls, at which velocities jump.

use super::acceleration::{InImpact, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, check_contacts, rows_of};
use crate::robot::costs::Cost;
use crate::robot::integrators::Integrated;
use crate::robot::outputs::Capabilities;
use condyle_dynamics::Model;
use std::sync::Arc;

/// Impact: a knot at which contacts begin. It has the coefficient of restitution ε and the damping μ:
///
/// ```text
/// q⁺ = q,   v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v,   ℓ = Σ w a(r)
/// ```
///
/// An impact has no duration and no controls. Residuals are functions of the state before the impact. Only the frame
/// and the axes of each contact are used. The equations are the same as in Crocoddyl's `ActionModelImpulseFwdDynamics`.
///
/// ```
/// use condyle_dynamics::{ContactConstraint, robots};
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Contact, ImpulseDynamics};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let foot = Contact::new("foot", ContactConstraint::point(quadruped.frame("LF_foot").unwrap()));
/// let mut touchdown = ImpulseDynamics::instant(quadruped.clone(), &[foot], 0.0, 1e-12, vec![])?;
/// let (mut x, mut next) = (condyle_dynamics::neutral(&quadruped), vec![0.0; 37]);
/// x.extend([0.0; 18]);
/// x[19 + 2] = -1.0; // falling
/// touchdown.calc(0, &x, &[], &mut next);
/// assert!(next[19 + 2] > -1.0 && next[..19] == x[..19]);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type ImpulseDynamics = Integrated<RobotAcceleration<InImpact>>;

impl ImpulseDynamics {
    /// Creates the knot of an impact at which `contacts` begin.
    ///
    /// # Errors
    /// - [`Error::Contact`] for a contact that does not fit the robot, has the name of another contact, or holds a
    ///   frame as another contact does. Without damping, also for a contact that is singular with other contacts on the
    ///   same body, such as a line in the plane of another contact.
    /// - [`Error::Setting`] for a restitution outside 0 to 1 or a damping below 0.
    /// - [`Error::Cost`] for a cost term that does not fit the robot.
    /// - [`Error::Actuation`] for a robot with joints that move no mass.
    pub fn instant(
        model: Arc<Model>,
        contacts: &[Contact],
        restitution: f64,
        damping: f64,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        if !(0.0..=1.0).contains(&restitution) {
            return Err(Error::Setting { name: "restitution", value: restitution, allowed: "from 0 to 1" });
        }
        check_contacts(&model, contacts, damping)?;
        let capabilities = Capabilities { impulse: true, contacts: rows_of(contacts), ..Capabilities::default() };
        let (none, kind) =
            (Actuation::none(&model), DynamicsKind::Impact { contacts: contacts.to_vec(), restitution, damping });
        RobotDynamics::new(model, none, capabilities, kind, costs)
            .map(|robot| Self::impact(RobotAcceleration::of(robot)))
    }
}
