//! A robot whose accelerations are the controls, and whose efforts follow by inverse dynamics.

use super::actuation::Actuation;
use super::common::{Robot, robot_knot, robot_positions};
use super::costs::Cost;
use super::integrated::{ContinuousModel, Derivatives, Integrated, Integrator};
use super::quadratic::Row;
use super::sight::Known;
use super::watch::{Offer, Scene, Signal, Slopes, add_matrix_row};
use crate::Error;
use crate::lq::{Hessian, LqNode};
use condyle_dynamics::{Data, Model, RneaDerivatives, rnea, rnea_derivatives};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Inverse dynamics of a robot that touches nothing: q̈ = u, τ = rnea(q, v, u), and costs.
#[derive(Clone, Debug)]
pub struct Inverse {
    pub(super) robot: Robot,
    data: Data<f64>,
    /// q̈.
    a: Vec<f64>,
    /// ∂q̈/∂q = ∂q̈/∂v = 0 and ∂q̈/∂u = 1. Shape: nv × nv.
    zeros: DMatrix<f64>,
    identity: DMatrix<f64>,
}

/// A knot of a robot whose nv controls are its accelerations, by semi-implicit Euler:
///
/// ```text
/// q̈ = u,   τ = rnea(q, v, u),   v⁺ = v + u Δt,   q⁺ = q ⊕ (v Δt + u Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// No equation is solved, so that a knot costs less than one of [`FreeDynamics`](super::FreeDynamics); efforts are looked
/// at by [`Residual::JointEffort`](super::Residual::JointEffort), which is 0 where nothing drives a joint (a heavy weight
/// on the first six entries holds a floating base to that).
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::ActionModel;
/// use condyle_optimal::robot::{Activation, Cost, InverseDynamics, Residual};
/// use std::sync::Arc;
/// let effort = Residual::JointEffort { reference: vec![0.0; 7] };
/// let costs = vec![Cost::new("effort", 1.0, effort, Activation::Quadratic)];
/// let mut knot = InverseDynamics::running(Arc::new(robots::arm7()), 0.1, costs)?;
/// let mut next = [0.0; 14];
/// knot.calc(0, &[0.0; 14], &[1.0; 7], &mut next);
/// assert!((next[7] - 0.1).abs() < 1e-15 && (next[0] - 0.01).abs() < 1e-15);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type InverseDynamics = Integrated<Inverse>;

impl Inverse {
    /// Of a robot.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit.
    pub fn new(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        let nv = model.nv();
        let offer = Offer { nu: nv, effort: true, ..Offer::default() };
        let (data, zeros, identity) = (Data::new(&model), DMatrix::zeros(nv, nv), DMatrix::identity(nv, nv));
        let actuation = Actuation::all(&model);
        let robot = Robot::new(model, actuation, offer, costs)?;
        Ok(Self { robot, data, a: vec![0.0; nv], zeros, identity })
    }
}

impl InverseDynamics {
    /// A knot of Δt seconds by semi-implicit Euler. For other integrators see [`Inverse::new`] and [`Integrated::new`].
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit, [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        Self::new(Inverse::new(model, costs)?, Integrator::SemiImplicitEuler, dt)
    }
}

robot_knot!(InverseDynamics, inner);

impl ContinuousModel for Inverse {
    fn fork(&self) -> Option<Self> {
        Some(self.clone())
    }

    fn nq(&self) -> usize {
        self.robot.model.nq()
    }

    fn nv(&self) -> usize {
        self.robot.model.nv()
    }

    fn nu(&self) -> usize {
        self.robot.model.nv()
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
        let Self { robot, data, a, .. } = self;
        let (q, v) = x.split_at(robot.model.nq());
        a.copy_from_slice(u); // q̈ = u
        let tau = rnea(&robot.model, data, q, v, u, &[]);
        (a, robot.schedule.calc(t, &Scene { x, u, a: u, tau, lambda: &[] }, Known::Nothing))
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) -> Derivatives<'_> {
        let Self { robot, data, a, zeros, identity } = self;
        let (q, v) = x.split_at(robot.model.nq());
        a.copy_from_slice(u);
        robot.tau.copy_from_slice(rnea(&robot.model, data, q, v, u, &[]));
        let d = rnea_derivatives(&robot.model, data, q, v, u, &[]);
        let scene = Scene { x, u, a: u, tau: &robot.tau, lambda: &[] };
        robot.schedule.calc_diff(t, &scene, Known::Nothing, &InverseSlopes { d }, scale, node);
        Derivatives { a, da_dq: zeros, da_dv: zeros, da_du: identity.as_slice() }
    }

    /// Accelerations that are given do not curve.
    fn hessian(&mut self, _: usize, _: &[f64], u: &[f64], _: &[f64], hessian: &mut Hessian) -> Option<Derivatives<'_>> {
        let Self { a, zeros, identity, .. } = self;
        a.copy_from_slice(u);
        for part in [&mut hessian.xx, &mut hessian.xu, &mut hessian.uu] {
            part.fill(0.0);
        }
        Some(Derivatives { a, da_dq: zeros, da_dv: zeros, da_du: identity.as_slice() })
    }

    robot_positions!();
}

struct InverseSlopes<'a> {
    d: RneaDerivatives<'a, f64>,
}

impl Slopes for InverseSlopes<'_> {
    fn add_row(&self, signal: Signal, row: usize, c: f64, g: &mut Row<'_>) {
        let d = &self.d;
        match signal {
            Signal::Acceleration => g.u[row] += c,
            Signal::Effort => {
                add_matrix_row(d.dtau_dq, row, c, g.q);
                add_matrix_row(d.dtau_dv, row, c, g.v);
                add_matrix_row(d.dtau_da, row, c, g.u);
            }
            Signal::Force => {}
        }
    }
}
