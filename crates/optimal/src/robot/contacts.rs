//! The dynamics of a robot in contact with the world.

use super::actuation::Actuation;
use super::common::{Robot, robot_knot, robot_lanes, robot_positions};
use super::contact::{Contact, constraint_set, moved_by, offer};
use super::costs::Cost;
use super::elimination::Elimination;
use super::integrated::{ContinuousModel, Derivatives, Integrated, Integrator};
use super::lanes::{Held, Outcome, SideBySide};
use super::quadratic::Row;
use super::sight::Known;
use super::watch::{Offer, Scene, Signal, Slopes, add_matrix_row};
use crate::Error;
use crate::lq::LqNode;
use condyle_dynamics::{ConstraintSet, Data, Model, constrained_dynamics, constrained_dynamics_derivatives, gravity};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Forward dynamics of a robot in contact, and costs: q̈ and λ of M q̈ + h = S u + Jᵀλ, J q̈ + γ = 0.
#[derive(Clone, Debug)]
pub struct Contacts {
    pub(super) robot: Robot,
    set: ConstraintSet<f64>,
    data: Data<f64>,
    /// q̈ and λ of a single call.
    a: Vec<f64>,
    lambda: Vec<f64>,
    lanes: Option<SideBySide>,
    elimination: Option<Elimination>,
    /// ∂q̈/∂u. Shape: nv × nu, nothing if S selects.
    da_du: Vec<f64>,
}

/// A knot of a robot in contact, by default under its joints' efforts and by semi-implicit Euler:
///
/// ```text
/// [ M  Jᵀ ] [  q̈ ]   [ S u − h ]
/// [ J  −μ ] [ −λ ] = [ −γ      ],   v⁺ = v + q̈ Δt,   q⁺ = q ⊕ (v Δt + q̈ Δt²),   ℓ = Δt Σ w a(r)
/// ```
///
/// Any set of point and rigid contacts, also none. The damping μ makes J M⁻¹ Jᵀ + μ 1 regular where contacts are redundant.
/// These are Crocoddyl's rules (`DifferentialActionModelContactFwdDynamics`).
///
/// ```
/// use condyle_dynamics::{Constraint, robots};
/// use condyle_optimal::robot::{Activation, Contact, ContactDynamics, Cost, FrictionCone, Residual};
/// use std::sync::Arc;
/// let quadruped = Arc::new(robots::quadruped());
/// let contacts = ["LF_foot", "RH_foot"].map(|foot| {
///     let frame = quadruped.frame(foot).unwrap();
///     Contact::new(foot, Constraint { kd: 50.0, ..Constraint::point(frame) })
/// });
/// let cone = FrictionCone::new(0.7);
/// let (lower, upper) = cone.bounds();
/// let grip = Residual::FrictionCone { contact: "LF_foot".into(), cone };
/// let costs = vec![Cost::new("grip", 1e1, grip, Activation::Barrier { lower, upper })];
/// let trot = ContactDynamics::running(quadruped, &contacts, 0.02, costs)?;
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub type ContactDynamics = Integrated<Contacts>;

impl Contacts {
    /// Of a robot with some drives, in contact, with the damping μ.
    ///
    /// # Errors
    /// [`Error::Contact`] for a contact that does not fit, is named twice, or is singular beside another one on the same
    /// body without damping; [`Error::Cost`] for a term that does not fit; [`Error::Actuation`] for drives of another
    /// robot, or a robot with joints that move no mass.
    pub fn new(
        model: Arc<Model>,
        actuation: Actuation,
        contacts: &[Contact],
        damping: f64,
        costs: Vec<Cost>,
    ) -> Result<Self, Error> {
        let set = constraint_set(&model, contacts, damping)?;
        let own = Offer { nu: actuation.nu(), effort: true, ..Offer::default() };
        let (data, a) = (Data::new(&model), vec![0.0; model.nv()]);
        let lanes = SideBySide::new(&model, Some(Held { contacts, proximal: set.proximal }));
        let da_du = actuation.scratch();
        let moved_by = moved_by(&model, contacts);
        let robot = Robot::new(model, actuation, offer(own, contacts), costs)?;
        robot.check_regular()?;
        Ok(Self {
            elimination: robot.elimination(&moved_by),
            robot,
            lambda: vec![0.0; set.rows()],
            set,
            data,
            a,
            lanes,
            da_du,
        })
    }
}

impl ContactDynamics {
    /// A knot of Δt seconds, driven at every joint but a free-flyer at the root, by semi-implicit Euler, without damping.
    /// For other drives, integrators and damping see [`Contacts::new`] and [`Integrated::new`].
    ///
    /// # Errors
    /// As [`Contacts::new`], and [`Error::TimeStep`] if Δt is not above 0.
    pub fn running(model: Arc<Model>, contacts: &[Contact], dt: f64, costs: Vec<Cost>) -> Result<Self, Error> {
        let actuation = Actuation::joints(&model);
        let inner = Contacts::new(model, actuation, contacts, 0.0, costs)?;
        Self::new(inner, Integrator::SemiImplicitEuler, dt)
    }

    /// The smallest controls and forces that hold the robot still at a state, (u, λ) = [S Jᵀ]⁺ g(q): u of them. Allocates.
    ///
    /// # Panics
    /// If `x` has not nq + nv numbers.
    pub fn quasi_static(&mut self, x: &[f64]) -> Vec<f64> {
        let Contacts { robot, set, data, .. } = &mut self.inner;
        let (nq, nv) = (robot.model.nq(), robot.model.nv());
        assert!(x.len() == nq + nv, "x: expected {} numbers, found {}", nq + nv, x.len());
        robot.tau.fill(0.0);
        constrained_dynamics(&robot.model, data, set, &x[..nq], &x[nq..], &robot.tau, &[]);
        let mut J = DMatrix::zeros(set.rows(), nv);
        set.jacobian(&mut J);
        robot.actuation.hold(gravity(&robot.model, data, &x[..nq]), &J)
    }
}

robot_knot!(ContactDynamics, inner);

impl ContinuousModel for Contacts {
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
        let Self { robot, set, data, .. } = self;
        robot.actuation.effort(u, &mut robot.tau); // τ = S u
        let (q, v) = x.split_at(robot.model.nq());
        let d = constrained_dynamics(&robot.model, data, set, q, v, &robot.tau, &[]);
        self.a.copy_from_slice(d.a);
        self.lambda.copy_from_slice(d.lambda);
        let scene = Scene { x, u, a: &self.a, tau: &robot.tau, lambda: &self.lambda };
        (&self.a, robot.schedule.calc(t, &scene, Known::Placed(data)))
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) -> Derivatives<'_> {
        let Self { robot, set, data, .. } = self;
        robot.actuation.effort(u, &mut robot.tau);
        let (q, v) = x.split_at(robot.model.nq());
        let d = constrained_dynamics_derivatives(&robot.model, data, set, q, v, &robot.tau, &[]);
        let scene = Scene { x, u, a: d.a, tau: &robot.tau, lambda: d.lambda };
        let da = [d.da_dq, d.da_dv, d.da_dtau];
        let dlambda = [d.dlambda_dq, d.dlambda_dv, d.dlambda_dtau];
        robot.schedule.calc_diff(
            t,
            &scene,
            Known::Nothing,
            &ContactSlopes { da, dlambda, actuation: &robot.actuation },
            scale,
            node,
        );
        let da_du = robot.actuation.columns(d.da_dtau, &mut self.da_du); // P S
        Derivatives { a: d.a, da_dq: d.da_dq, da_dv: d.da_dv, da_du }
    }

    robot_lanes!();

    fn calc_prepared(&mut self, i: usize, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
        let Self { robot, lanes: Some(lanes), .. } = self else { return self.calc(t, x, u) };
        let outcome = &lanes.outcomes[i];
        let Outcome { a, lambda, .. } = outcome;
        robot.actuation.effort(u, &mut robot.tau);
        let scene = Scene { x, u, a, tau: &robot.tau, lambda };
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
        let Outcome { a, lambda, da, dlambda, .. } = outcome;
        robot.actuation.effort(u, &mut robot.tau);
        let scene = Scene { x, u, a, tau: &robot.tau, lambda };
        let slopes = ContactSlopes { da: da.each_ref(), dlambda: dlambda.each_ref(), actuation: &robot.actuation };
        robot.schedule.calc_diff(t, &scene, outcome.known(), &slopes, scale, node);
        let da_du = robot.actuation.columns(&da[2], &mut self.da_du);
        Derivatives { a, da_dq: &da[0], da_dv: &da[1], da_du }
    }

    robot_positions!();
}

struct ContactSlopes<'a> {
    /// ∂q̈/∂q, ∂q̈/∂v, ∂q̈/∂τ.
    da: [&'a DMatrix<f64>; 3],
    /// ∂λ/∂q, ∂λ/∂v, ∂λ/∂τ.
    dlambda: [&'a DMatrix<f64>; 3],
    actuation: &'a Actuation,
}

impl Slopes for ContactSlopes<'_> {
    fn add_row(&self, signal: Signal, row: usize, c: f64, g: &mut Row<'_>) {
        let [by_q, by_v, by_tau] = match signal {
            Signal::Acceleration => self.da,
            Signal::Force => self.dlambda,
            Signal::Effort => return self.actuation.add_row(row, c, g.u),
        };
        add_matrix_row(by_q, row, c, g.q);
        add_matrix_row(by_v, row, c, g.v);
        self.actuation.add_product_row(by_tau, row, c, g.u);
    }
}
