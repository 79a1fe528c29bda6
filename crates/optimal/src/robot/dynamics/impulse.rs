//! Impacts: knots without time and controls, at which velocities jump.

use super::batch::DynamicsKind;
use super::robot::{Parts, RobotDynamics, Work};
use super::sensitivities::DynamicsSensitivities;
use crate::ActionModel;
use crate::Error;
use crate::error::assert_length;
use crate::lq::LqKnot;
use crate::problem::Visit;
use crate::robot::actuation::Actuation;
use crate::robot::capabilities::{Capabilities, Output};
use crate::robot::contact::{Contact, check_contacts, constraint_set, rows_of};
use crate::robot::costs::Cost;
use crate::robot::knot::{KnotData, KnotState};
use crate::robot::on_demand::OnDemand;
use crate::robot::state::{state_difference, state_integrate};
use condyle_dynamics::{
    ConstraintSet, Data, Model, centroidal_derivatives, forward_velocities, impulse_dynamics,
    impulse_dynamics_derivatives,
};
use std::any::Any;
use std::sync::Arc;

/// A knot at which contacts set in, with the restitution ε and the damping μ:
///
/// ```text
/// q⁺ = q,   v⁺ = v − M⁻¹ Jᵀ (J M⁻¹ Jᵀ + μ 1)⁻¹ (1 + ε) J v,   ℓ = Σ w a(r)
/// ```
///
/// It takes no time and has no controls. Residuals look at the state before the impact. Of the contacts, frames and axes
/// count. These are Crocoddyl's rules (`ActionModelImpulseFwdDynamics`).
///
/// ```
/// use condyle_dynamics::{ContactConstraint, robots};
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Contact, ImpulseDynamics};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let foot = Contact::new("foot", ContactConstraint::point(quadruped.frame("LF_foot").unwrap()));
/// let mut touchdown = ImpulseDynamics::new(quadruped.clone(), &[foot], 0.0, 1e-12, vec![])?;
/// let (mut x, mut next) = (condyle_dynamics::neutral(&quadruped), vec![0.0; 37]);
/// x.extend([0.0; 18]);
/// x[19 + 2] = -1.0; // falling
/// touchdown.calc(0, &x, &[], &mut next);
/// assert!(next[19 + 2] > -1.0 && next[..19] == x[..19]);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct ImpulseDynamics {
    pub(super) robot: RobotDynamics,
    pub(super) contacts: Vec<Contact>,
    restitution: f64,
    damping: f64,
    set: OnDemand<ConstraintSet<f64>>,
    /// Zeros. Shape: nv.
    zero: Vec<f64>,
}

impl ImpulseDynamics {
    /// An impact of some contacts.
    ///
    /// # Errors
    /// [`Error::Contact`] for a contact that does not fit, is named twice, or is singular beside another one on the same
    /// body without damping, and for a restitution that is not from 0 to 1; [`Error::Cost`] for a term that does not fit.
    pub fn new(
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
        let (none, zero) = (Actuation::none(&model), vec![0.0; model.nv()]);
        let robot = RobotDynamics::new(model, none, capabilities, DynamicsKind::None, costs)?;
        Ok(Self { robot, contacts: contacts.to_vec(), restitution, damping, set: OnDemand::default(), zero })
    }

    /// Computes v⁺ − v and the impulses at a state, with their derivatives if these are asked for, and what the residuals
    /// see.
    #[track_caller]
    fn evaluate(&mut self, t: usize, x: &[f64], slopes: bool) {
        let Self { robot, contacts, damping, set, restitution, zero } = self;
        assert_length("x", x.len(), robot.model.nq() + robot.model.nv());
        let Parts { model, terms, work: Work { single, data, .. }, .. } = robot.parts();
        let set = set.get(|| made_constraints(model, contacts, *damping));
        let ((q, v), knot) = (x.split_at(model.nq()), &mut data[0]);
        knot.residuals.reserve(v.len(), terms.layouts());
        if slopes {
            let d = impulse_dynamics_derivatives(model, &mut single.data, set, q, v, *restitution);
            write_change(v, d.v, d.lambda, knot);
            let KnotData { da: [by_q, by_v, _], dlambda: [force_by_q, force_by_v, _], .. } = knot;
            by_q.copy_from(d.dv_dq);
            by_v.copy_from(d.dv_dv);
            by_v.iter_mut().step_by(v.len() + 1).for_each(|x| *x -= 1.0); // ∂(v⁺ − v)/∂v
            force_by_q.copy_from(d.dlambda_dq);
            force_by_v.copy_from(d.dlambda_dv);
        } else {
            let after = impulse_dynamics(model, &mut single.data, set, q, v, *restitution);
            write_change(v, after.v, after.lambda, knot);
        }
        if terms.at(t).layout().requirements.impulse_com {
            write_com_change(model, &mut single.data, [q, zero], slopes, knot);
        }
        single.run_residuals_at(model, t, x, terms, slopes, knot);
    }
}

/// The constraints of contacts that were checked.
fn made_constraints(model: &Model, contacts: &[Contact], damping: f64) -> ConstraintSet<f64> {
    constraint_set(model, contacts, damping).expect("was checked when it was given")
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

impl ActionModel for ImpulseDynamics {
    fn nx(&self) -> usize {
        self.robot.model.nq() + self.robot.model.nv()
    }

    fn ndx(&self) -> usize {
        2 * self.robot.model.nv()
    }

    fn nu(&self) -> usize {
        0
    }

    fn shift(&mut self) {
        self.robot.terms.shift();
    }

    fn reserve(&mut self) {
        self.robot.reserve();
        let Self { robot: RobotDynamics { model, .. }, contacts, damping, set, .. } = self;
        set.get(|| made_constraints(model, contacts, *damping));
    }

    fn merge(&mut self, other: &mut dyn ActionModel) -> bool {
        let other: &mut dyn Any = other;
        let Some(other) = other.downcast_mut::<Self>() else { return false };
        let same =
            (&self.contacts, self.restitution, self.damping) == (&other.contacts, other.restitution, other.damping);
        same && self.robot.merge(&mut other.robot)
    }

    fn choose(&mut self, model: usize) {
        self.robot.terms.choose(model);
    }

    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.robot.terms.serve(t, horizon, model);
    }

    fn outputs(&mut self, t: usize, x: &[f64], _: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        self.evaluate(t, x, false);
        self.robot.outputs(0, show);
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        self.robot.terms.limits.visit(t, visit);
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(self.clone()))
    }

    #[track_caller]
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.evaluate(t, x, false);
        assert_length("next", next.len(), x.len());
        let Parts { model, terms, work: Work { data, .. }, .. } = self.robot.parts();
        let (nq, data) = (model.nq(), &data[0]);
        next.copy_from_slice(x);
        (0..model.nv()).for_each(|k| next[nq + k] += data.a[k]);
        terms.calc(t, KnotState { x, u, data }) + terms.limits.term
    }

    #[track_caller]
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.evaluate(t, x, true);
        let Parts { model, actuation, terms, work: Work { data, .. }, .. } = self.robot.parts();
        let (nv, data) = (model.nv(), &data[0]);
        let sensitivities = DynamicsSensitivities { given: Output::Effort, data, actuation };
        terms.calc_diff(t, KnotState { x, u, data }, &sensitivities, 1.0, knot);
        // A = [1, 0; ∂v⁺/∂q, ∂v⁺/∂v]: that of an Euler step that takes no time
        knot.structure.set_euler(0.0, &[]);
        knot.A.fill_with_identity();
        let [by_q, by_v, _] = &data.da;
        let mut below = knot.A.rows_mut(nv, nv);
        below.columns_mut(0, nv).copy_from(by_q);
        below.columns_mut(nv, nv).zip_apply(by_v, |a, change| *a += change);
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        let model = &self.robot.model;
        model.check_position(&x[..model.nq()]).map_err(|error| error.to_string())
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        state_integrate(&self.robot.model, x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        state_difference(&self.robot.model, x0, x1, out);
    }
}
