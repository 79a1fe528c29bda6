//! Impacts: knots without time and controls, at which velocities jump.

use super::acceleration::{InImpact, RobotAcceleration};
use super::batch::DynamicsKind;
use super::robot::RobotDynamics;
use crate::Error;
use crate::robot::actuation::Actuation;
use crate::robot::contact::{Contact, check_contacts, constraint_set, rows_of};
use crate::robot::costs::Cost;
use crate::robot::integrators::Integrated;
use crate::robot::knot_data::{Capabilities, KnotData};
use crate::robot::residuals::terms::KnotTerms;
use condyle_dynamics::{
    ConstraintSet, Data, Model, centroidal_derivatives, forward_velocities, impulse_dynamics,
    impulse_dynamics_derivatives,
};
use std::sync::Arc;

/// Knot at which contacts are made, with the restitution ε and the damping μ:
///
/// ```text
/// q⁺ = q,   v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v,   ℓ = Σ w a(r)
/// ```
///
/// It takes no time and has no controls. Residuals are functions of the state before the impact. Only the frames and axes
/// of the contacts count. These are Crocoddyl's rules (`ActionModelImpulseFwdDynamics`).
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
    /// Creates the knot of an impact of some contacts.
    ///
    /// # Errors
    /// [`Error::Contact`] for a contact that does not fit, is named twice, or is singular with another one on the same
    /// body without damping, and for a restitution that is not from 0 to 1; [`Error::Cost`] for a term that does not fit;
    /// [`Error::Actuation`] for a robot with joints that move no mass.
    pub fn instant(
        model: Arc<Model>,
        contacts: &[Contact],
        restitution: f64,
        damping: f64,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        if !(0.0..=1.0).contains(&restitution) {
            let what = format!("ε is {restitution}, not from 0 to 1");
            return Err(Error::Contact { name: "restitution".to_owned(), what });
        }
        check_contacts(&model, contacts, damping)?;
        let capabilities = Capabilities { impulse: true, contacts: rows_of(contacts), ..Capabilities::default() };
        let (none, kind) =
            (Actuation::none(&model), DynamicsKind::Impact { contacts: contacts.to_vec(), restitution, damping });
        RobotDynamics::new(model, none, capabilities, kind, costs)
            .map(|robot| Self::impact(RobotAcceleration::of(robot)))
    }
}

/// Impact of some contacts, with its workspace.
#[derive(Debug)]
pub(super) struct Impact {
    set: ConstraintSet<f64>,
    restitution: f64,
    /// Zeros. Shape: nv.
    zero: Vec<f64>,
}

impl Impact {
    /// Allocates the workspace for dynamics that are an impact.
    pub(super) fn new(model: &Model, kind: &DynamicsKind) -> Option<Self> {
        let DynamicsKind::Impact { contacts, restitution, damping } = kind else { return None };
        let set = constraint_set(model, contacts, *damping).expect("was checked when it was given");
        Some(Self { set, restitution: *restitution, zero: vec![0.0; model.nv()] })
    }

    /// Computes v⁺ − v and the impulses at a state, with their derivatives if `slopes` is set, and what the terms need of
    /// them.
    pub(super) fn run(
        &mut self,
        model: &Model,
        data: &mut Data<f64>,
        x: &[f64],
        terms: KnotTerms<'_>,
        slopes: bool,
        to: &mut KnotData,
    ) {
        let (Self { set, restitution, zero }, (q, v)) = (self, x.split_at(model.nq()));
        if slopes {
            let d = impulse_dynamics_derivatives(model, data, set, q, v, *restitution);
            write_change(v, d.v, d.lambda, to);
            let KnotData { da: [by_q, by_v, _], dlambda: [force_by_q, force_by_v, _], .. } = to;
            by_q.copy_from(d.dv_dq);
            by_v.copy_from(d.dv_dv);
            by_v.iter_mut().step_by(v.len() + 1).for_each(|x| *x -= 1.0); // ∂(v⁺ − v)/∂v
            force_by_q.copy_from(d.dlambda_dq);
            force_by_v.copy_from(d.dlambda_dv);
        } else {
            let after = impulse_dynamics(model, data, set, q, v, *restitution);
            write_change(v, after.v, after.lambda, to);
        }
        if terms.layout().requirements.impulse_com {
            write_com_change(model, data, [q, zero], slopes, to);
        }
    }
}

fn write_change(v: &[f64], after: &[f64], lambda: &[f64], to: &mut KnotData) {
    (0..v.len()).for_each(|k| to.a[k] = after[k] - v[k]);
    to.lambda.copy_from_slice(lambda);
}

/// Writes J_c (v⁺ − v), and its derivatives if they are asked for.
fn write_com_change(model: &Model, data: &mut Data<f64>, [q, zero]: [&[f64]; 2], slopes: bool, to: &mut KnotData) {
    let KnotData { a: change, residuals, .. } = to;
    residuals.com_change = forward_velocities(model, data, q, change).com_velocity().to_array();
    if slopes {
        let d = centroidal_derivatives(model, data, q, change, zero);
        residuals.dcom_change[0].copy_from(d.dvcom_dq);
        residuals.dcom_change[1].copy_from(d.dcom_dq);
    }
}
