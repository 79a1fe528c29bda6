//! Impacts: knots without time and controls, at which velocities jump.

use super::actuation::Actuation;
use super::common::{Robot, robot_knot};
use super::contact::{Contact, constraint_set, offer};
use super::costs::Cost;
use super::quadratic::Row;
use super::sight::Known;
use super::state::{state_difference, state_integrate};
use super::watch::{Offer, Scene, Signal, Slopes, add_matrix_row};
use crate::ActionModel;
use crate::Error;
use crate::lq::LqNode;
use crate::problem::Visit;
use condyle_dynamics::{
    ConstraintSet, Data, ImpulseDerivatives, Model, impulse_dynamics, impulse_dynamics_derivatives,
};
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
/// use condyle_dynamics::{Constraint, robots};
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Contact, ImpulseDynamics};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let foot = Contact::new("foot", Constraint::point(quadruped.frame("LF_foot").unwrap()));
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
    robot: Robot,
    set: ConstraintSet<f64>,
    data: Data<f64>,
    restitution: f64,
    /// v⁺ − v.
    change: Vec<f64>,
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
        let set = constraint_set(&model, contacts, damping)?;
        let own = Offer { impulse: true, ..Offer::default() };
        let (data, change) = (Data::new(&model), vec![0.0; model.nv()]);
        let none = Actuation::none(&model);
        let robot = Robot::new(model, none, offer(own, contacts), costs)?;
        robot.check_regular()?;
        Ok(Self { robot, set, data, restitution, change })
    }
}

robot_knot!(ImpulseDynamics);

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
        self.robot.schedule.shift();
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        self.robot.schedule.limits.visit(t, visit);
    }

    fn fork(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(self.clone()))
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let Self { robot, set, data, change, .. } = self;
        let (q, v) = x.split_at(robot.model.nq());
        let after = impulse_dynamics(&robot.model, data, set, q, v, self.restitution);
        let (q_next, v_next) = next.split_at_mut(q.len());
        q_next.copy_from_slice(q);
        v_next.copy_from_slice(after.v);
        (0..v.len()).for_each(|k| change[k] = after.v[k] - v[k]);
        let cost = robot.schedule.calc(t, &Scene { x, u, a: change, tau: &[], lambda: after.lambda }, Known::Nothing);
        cost + robot.schedule.limits.term
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        let Self { robot, set, data, change, .. } = self;
        let nv = robot.model.nv();
        let (q, v) = x.split_at(robot.model.nq());
        let d = impulse_dynamics_derivatives(&robot.model, data, set, q, v, self.restitution);
        (0..nv).for_each(|k| change[k] = d.v[k] - v[k]);
        let scene = Scene { x, u, a: change, tau: &[], lambda: d.lambda };
        robot.schedule.calc_diff(t, &scene, Known::Nothing, &ImpulseSlopes { d }, 1.0, node);
        // A = [1, 0; ∂v⁺/∂q, ∂v⁺/∂v]: that of an Euler step that takes no time
        node.structure.set_euler(0.0, &[]);
        node.A.view_mut((0, 0), (nv, nv)).fill_with_identity();
        node.A.view_mut((0, nv), (nv, nv)).fill(0.0);
        node.A.view_mut((nv, 0), (nv, nv)).copy_from(d.dv_dq);
        node.A.view_mut((nv, nv), (nv, nv)).copy_from(d.dv_dv);
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        state_integrate(&self.robot.model, x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        state_difference(&self.robot.model, x0, x1, out);
    }
}

struct ImpulseSlopes<'a> {
    d: ImpulseDerivatives<'a, f64>,
}

impl Slopes for ImpulseSlopes<'_> {
    fn add_row(&self, signal: Signal, row: usize, c: f64, g: &mut Row<'_>) {
        let d = &self.d;
        match signal {
            Signal::Acceleration => {
                add_matrix_row(d.dv_dq, row, c, g.q);
                add_matrix_row(d.dv_dv, row, c, g.v);
                g.v[row] -= c; // ∂(v⁺ − v)
            }
            Signal::Force => {
                add_matrix_row(d.dlambda_dq, row, c, g.q);
                add_matrix_row(d.dlambda_dv, row, c, g.v);
            }
            Signal::Effort => {}
        }
    }
}
