//! The dynamics of a robot that touches nothing.

use super::actuation::Actuation;
use super::common::{Robot, robot_knot, robot_lanes, robot_positions};
use super::costs::Cost;
use super::elimination::Elimination;
use super::integrated::{ContinuousModel, Derivatives, Integrated, Integrator};
use super::lanes::{Outcome, SideBySide};
use super::quadratic::Row;
use super::sight::Known;
use super::watch::{NoSlopes, Offer, Scene, Signal, Slopes, add_matrix_row};
use crate::Error;
use crate::lq::{Hessian, LqNode};
use condyle_dynamics::{Data, Model, aba, aba_derivatives, aba_hessian, gravity};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Forward dynamics of a robot that touches nothing: q̈ = aba(q, v, S u), and costs.
#[derive(Clone, Debug)]
pub struct Free {
    pub(super) robot: Robot,
    data: Data<f64>,
    /// q̈ of a single call.
    a: Vec<f64>,
    lanes: Option<SideBySide>,
    elimination: Option<Elimination>,
    /// Whether this is the end of a horizon, where nothing moves.
    still: bool,
    /// ∂q̈/∂u. Shape: nv × nu, nothing if S selects.
    da_du: Vec<f64>,
    /// Zeros, at the end of a horizon. Shape: nv × nv.
    zeros: DMatrix<f64>,
}

/// A knot of a robot that moves freely, by default under its joints' efforts and by semi-implicit Euler:
///
/// ```text
/// q̈ = aba(q, v, S u),   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// The state is x = (q, v). A terminal knot has no controls and no Δt: ℓ = Σ w a(r). These are Crocoddyl's rules.
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
pub type FreeDynamics = Integrated<Free>;

impl Free {
    /// Of a robot with some drives.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit, [`Error::Actuation`] for drives of another robot, or a robot with
    /// joints that move no mass.
    pub fn new(model: Arc<Model>, actuation: Actuation, costs: Vec<Cost>) -> Result<Self, Error> {
        let offer = Offer { nu: actuation.nu(), effort: true, ..Offer::default() };
        let free = Self::make(model, actuation, offer, costs)?;
        free.robot.check_regular()?;
        Ok(free)
    }

    fn make(model: Arc<Model>, actuation: Actuation, offer: Offer, costs: Vec<Cost>) -> Result<Self, Error> {
        let (nv, still) = (model.nv(), !offer.effort);
        let (data, da_du) = (Data::new(&model), actuation.scratch());
        let lanes = if still { None } else { SideBySide::new(&model, None) };
        let robot = Robot::new(model, actuation, offer, costs)?;
        Ok(Self {
            data,
            a: vec![0.0; nv],
            lanes,
            elimination: robot.elimination(&[]),
            da_du,
            robot,
            still,
            zeros: DMatrix::zeros(nv, nv),
        })
    }
}

impl FreeDynamics {
    /// A knot of Δt seconds, driven at every joint but a free-flyer at the root, by semi-implicit Euler. For other
    /// drives or integrators see [`Free::new`] and [`Integrated::new`].
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit, [`Error::TimeStep`] if Δt is not above 0, [`Error::Actuation`] for
    /// a robot with joints that move no mass.
    pub fn running(model: Arc<Model>, dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        let actuation = Actuation::joints(&model);
        Self::new(Free::new(model, actuation, costs)?, Integrator::SemiImplicitEuler, dt)
    }

    /// The knot after the last one. Terms of the control must have an empty reference: there is none.
    ///
    /// # Errors
    /// [`Error::Cost`] for a term that does not fit.
    pub fn terminal(model: Arc<Model>, costs: Vec<Cost>) -> Result<Self, Error> {
        let none = Actuation::none(&model);
        Ok(Self::end(Free::make(model, none, Offer::default(), costs)?))
    }

    /// The efforts that hold the robot still at a state, u = S⁺ g(q): the smallest ones that come nearest to it. Allocates.
    ///
    /// # Panics
    /// If `x` has not nq + nv numbers.
    pub fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        let Free { robot, data, .. } = &mut self.inner;
        let (nq, nx) = (robot.model.nq(), robot.model.nq() + robot.model.nv());
        assert!(x.len() == nx, "x: expected {nx} numbers, found {}", x.len());
        robot.actuation.hold(gravity(&robot.model, data, &x[..nq]), &DMatrix::zeros(0, robot.model.nv()))
    }
}

robot_knot!(FreeDynamics, inner);

impl ContinuousModel for Free {
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
        self.robot.actuation.nu()
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
        let Self { robot, data, .. } = self;
        if self.still {
            let scene = Scene { x, u, a: &[], tau: &[], lambda: &[] };
            return (&[], robot.schedule.calc(t, &scene, Known::Nothing));
        }
        robot.actuation.effort(u, &mut robot.tau); // τ = S u
        let (q, v) = x.split_at(robot.model.nq());
        self.a.copy_from_slice(aba(&robot.model, data, q, v, &robot.tau, &[]));
        let scene = Scene { x, u, a: &self.a, tau: &robot.tau, lambda: &[] };
        (&self.a, robot.schedule.calc(t, &scene, Known::Placed(data)))
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) -> Derivatives<'_> {
        let Self { robot, data, zeros, .. } = self;
        if self.still {
            let scene = Scene { x, u, a: &[], tau: &[], lambda: &[] };
            robot.schedule.calc_diff(t, &scene, Known::Nothing, &NoSlopes, scale, node);
            return Derivatives { a: &[], da_dq: zeros, da_dv: zeros, da_du: &[] };
        }
        robot.actuation.effort(u, &mut robot.tau);
        let (q, v) = x.split_at(robot.model.nq());
        let d = aba_derivatives(&robot.model, data, q, v, &robot.tau, &[]);
        let scene = Scene { x, u, a: d.a, tau: &robot.tau, lambda: &[] };
        let slopes = FreeSlopes { da: [d.da_dq, d.da_dv, d.da_dtau], actuation: &robot.actuation };
        robot.schedule.calc_diff(t, &scene, Known::Nothing, &slopes, scale, node);
        let da_du = robot.actuation.columns(d.da_dtau, &mut self.da_du); // M⁻¹ S
        Derivatives { a: d.a, da_dq: d.da_dq, da_dv: d.da_dv, da_du }
    }

    robot_lanes!();

    fn calc_prepared(&mut self, i: usize, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
        let Self { robot, lanes: Some(lanes), .. } = self else { return self.calc(t, x, u) };
        let outcome = &lanes.outcomes[i];
        let a = &outcome.a;
        robot.actuation.effort(u, &mut robot.tau);
        let scene = Scene { x, u, a, tau: &robot.tau, lambda: &[] };
        (a, robot.schedule.calc(t, &scene, outcome.known()))
    }

    fn calc_diff_prepared(
        &mut self,
        i: usize,
        t: usize,
        x: &[f64],
        u: &[f64],
        scale: f64,
        node: &mut LqNode,
    ) -> Derivatives<'_> {
        let Self { robot, lanes: Some(lanes), .. } = self else { return self.calc_diff(t, x, u, scale, node) };
        let outcome = &lanes.outcomes[i];
        let Outcome { a, da, .. } = outcome;
        robot.actuation.effort(u, &mut robot.tau);
        let scene = Scene { x, u, a, tau: &robot.tau, lambda: &[] };
        let slopes = FreeSlopes { da: da.each_ref(), actuation: &robot.actuation };
        robot.schedule.calc_diff(t, &scene, outcome.known(), &slopes, scale, node);
        let da_du = robot.actuation.columns(&da[2], &mut self.da_du);
        Derivatives { a, da_dq: &da[0], da_dv: &da[1], da_du }
    }

    fn hessian(
        &mut self,
        _: usize,
        x: &[f64],
        u: &[f64],
        mu: &[f64],
        hessian: &mut Hessian,
    ) -> Option<Derivatives<'_>> {
        let Self { robot, data, .. } = self;
        robot.actuation.effort(u, &mut robot.tau);
        let (nv, (q, v)) = (robot.model.nv(), x.split_at(robot.model.nq()));
        let d = aba_hessian(&robot.model, data, q, v, &robot.tau, &[], mu);
        for c in 0..nv {
            for r in 0..nv {
                hessian.xx[(r, c)] = d.dqdq[(r, c)];
                hessian.xx[(nv + r, c)] = d.dvdq[(r, c)];
                hessian.xx[(c, nv + r)] = d.dvdq[(r, c)];
                hessian.xx[(nv + r, nv + c)] = d.dvdv[(r, c)];
            }
            let column = &d.dtaudq.as_slice()[c * nv..][..nv];
            for k in 0..u.len() {
                hessian.xu[(c, k)] = robot.actuation.along(k, column); // Sᵀ ∂²ψ/∂τ∂q
                hessian.xu[(nv + c, k)] = 0.0;
            }
        }
        hessian.uu.fill(0.0);
        let first = d.first;
        let da_du = robot.actuation.columns(first.da_dtau, &mut self.da_du);
        Some(Derivatives { a: first.a, da_dq: first.da_dq, da_dv: first.da_dv, da_du })
    }

    robot_positions!();
}

struct FreeSlopes<'a> {
    /// ∂q̈/∂q, ∂q̈/∂v, ∂q̈/∂τ.
    da: [&'a DMatrix<f64>; 3],
    actuation: &'a Actuation,
}

impl Slopes for FreeSlopes<'_> {
    fn add_row(&self, signal: Signal, row: usize, c: f64, g: &mut Row<'_>) {
        let [by_q, by_v, by_tau] = self.da;
        match signal {
            Signal::Acceleration => {
                add_matrix_row(by_q, row, c, g.q);
                add_matrix_row(by_v, row, c, g.v);
                self.actuation.add_product_row(by_tau, row, c, g.u);
            }
            Signal::Effort => self.actuation.add_row(row, c, g.u),
            Signal::Force => {}
        }
    }
}
