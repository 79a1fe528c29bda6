//! Steps of time: from accelerations to the next state.

use super::curvature::Curvature;
use super::euler;
use super::lanes::WORTHWHILE;
use super::limits::{Limits, limit_term};
use super::runge_kutta::RungeKutta;
use crate::ActionModel;
use crate::Error;
use crate::error::assert_length;
use crate::lq::{Hessian, LqNode};
use crate::problem::Visit;
use core::ops::Range;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Dynamics in continuous time: q̈ = a(q, v, u), ℓ̇ = ℓ(x, u), with x = (q, v).
///
/// [`Integrated`] makes a knot of it. The robot's are [`Free`](super::Free), [`Contacts`](super::Contacts) and
/// [`Inverse`](super::Inverse); write your own for anything that moves with accelerations.
///
/// ```
/// use condyle_optimal::robot::{ContinuousModel, Derivatives, Integrated, Integrator};
/// use condyle_optimal::{ActionModel, LqNode};
/// use nalgebra::DMatrix;
///
/// /// A mass on a spring, q̈ = u − q, with the cost ½ (q² + u²) per second.
/// struct Spring { da_dq: DMatrix<f64>, da_dv: DMatrix<f64>, a: [f64; 1] }
///
/// impl ContinuousModel for Spring {
///     fn nq(&self) -> usize { 1 }
///     fn nv(&self) -> usize { 1 }
///     fn nu(&self) -> usize { 1 }
///     fn calc(&mut self, _: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
///         self.a = [u[0] - x[0]];
///         (&self.a, 0.5 * (x[0] * x[0] + u[0] * u[0]))
///     }
///     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) -> Derivatives<'_> {
///         self.a = [u[0] - x[0]];
///         node.Q.copy_from_slice(&[scale, 0.0, 0.0, 0.0]);
///         (node.q[0], node.q[1], node.r[0], node.R[0]) = (scale * x[0], 0.0, scale * u[0], scale);
///         node.S.fill(0.0);
///         Derivatives { a: &self.a, da_dq: &self.da_dq, da_dv: &self.da_dv, da_du: &[1.0] }
///     }
/// }
///
/// let (da_dq, da_dv) = (DMatrix::from_element(1, 1, -1.0), DMatrix::zeros(1, 1));
/// let mut knot = Integrated::new(Spring { da_dq, da_dv, a: [0.0] }, Integrator::RungeKutta4, 0.1)?;
/// let mut next = [0.0; 2];
/// knot.calc(0, &[1.0, 0.0], &[0.0], &mut next);
/// assert!((next[0] - 0.1_f64.cos()).abs() < 1e-7);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub trait ContinuousModel: Send + 'static {
    /// The number of entries of a position q.
    fn nq(&self) -> usize;

    /// The number of entries of a velocity v.
    fn nv(&self) -> usize;

    /// The number of controls.
    fn nu(&self) -> usize;

    /// a(x, u) (nv numbers) and ℓ(x, u) at knot t of the horizon.
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64);

    /// The derivatives of a, and those of `scale` · ℓ into q, r, Q, S, R of the node, which are overwritten.
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], scale: f64, node: &mut LqNode) -> Derivatives<'_>;

    /// The second derivatives of ψ = μᵀ a(q ⊕ δq, v + δv, u + δu) into `hessian`, for nv numbers `mu`; returns the first ones
    /// of a. It gives none by default: a then counts as linear, whatever
    /// [`second_order`](crate::Settings::second_order) says.
    fn hessian(
        &mut self,
        t: usize,
        x: &[f64],
        u: &[f64],
        mu: &[f64],
        hessian: &mut Hessian,
    ) -> Option<Derivatives<'_>> {
        let _ = (t, x, u, mu, hessian);
        None
    }

    /// How many states [`prepare`](Self::prepare) takes at the price of few; 1 unless it uses vector lanes.
    fn lanes(&self) -> usize {
        1
    }

    /// Computes the dynamics of some states at these knots, at most [`lanes`](Self::lanes), side by side, so that the calls
    /// for each of them that follow need not. Nothing by default.
    fn prepare(&mut self, knots: &[usize], xs: &[f64], us: &[f64], wanted: Wanted) {
        let _ = (knots, xs, us, wanted);
    }

    /// For dynamics that can be written in implicit form: the most coordinates and the most rows of costs that this takes.
    #[doc(hidden)]
    fn implicit(&self) -> Option<[usize; 2]> {
        None
    }

    /// A knot in implicit form at the i-th state that was prepared for it, of Δt = `scale` seconds: a, unless there is no
    /// such form there.
    #[doc(hidden)]
    fn equations_prepared(
        &mut self,
        i: usize,
        t: usize,
        x: &[f64],
        u: &[f64],
        scale: f64,
        node: &mut LqNode,
    ) -> Option<&[f64]> {
        let _ = (i, t, x, u, scale, node);
        None
    }

    /// [`calc`](Self::calc) of the i-th state that was prepared.
    fn calc_prepared(&mut self, i: usize, t: usize, x: &[f64], u: &[f64]) -> (&[f64], f64) {
        let _ = i;
        self.calc(t, x, u)
    }

    /// [`calc_diff`](Self::calc_diff) of the i-th state that was prepared.
    fn calc_diff_prepared(
        &mut self,
        i: usize,
        t: usize,
        x: &[f64],
        u: &[f64],
        scale: f64,
        node: &mut LqNode,
    ) -> Derivatives<'_> {
        let _ = i;
        self.calc_diff(t, x, u, scale, node)
    }

    /// The horizon has moved on by a knot, see [`ActionModel::shift`]. Nothing by default.
    fn shift(&mut self) {}

    /// Its limits, if it is a robot's.
    #[doc(hidden)]
    fn limits(&mut self) -> Option<&mut Limits> {
        None
    }

    /// A copy that computes the same, for another thread; `None` by default: see [`ActionModel::fork`].
    fn fork(&self) -> Option<Self>
    where
        Self: Sized,
    {
        None
    }

    /// The coordinates of each group of positions that is no vector space, at most six a group: elsewhere q ⊕ δ is a sum.
    /// None by default.
    fn groups(&self) -> &[Range<usize>] {
        &[]
    }

    /// q ⊕ δq into `out` (nq).
    fn integrate(&self, q: &[f64], dq: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q[k] + dq[k]);
    }

    /// q₁ ⊖ q₀ into `out` (nv).
    fn difference(&self, q0: &[f64], q1: &[f64], out: &mut [f64]) {
        (0..out.len()).for_each(|k| out[k] = q1[k] - q0[k]);
    }

    /// ∂(q ⊕ δq)/∂q and ∂(q ⊕ δq)/∂δq, nv × nv each: the blocks of the [`groups`](Self::groups) are all that is read.
    fn integrate_jacobians(&self, dq: &[f64], by_q: &mut DMatrix<f64>, by_dq: &mut DMatrix<f64>) {
        let _ = (dq, by_q, by_dq);
    }

    /// The second derivatives of θ(δ, ε) = λᵀ((q ⊕ δ) ⊕ (δq + ε) ⊖ (q ⊕ δq)) at zero into `hessian`, by δ (its state) and ε
    /// (its control), nv numbers each: the blocks of the [`groups`](Self::groups) are all that is read. Says whether it
    /// did. It does not by default: where there are groups, a step then counts as linear, whatever
    /// [`second_order`](crate::Settings::second_order) says.
    fn integrate_hessian(&mut self, dq: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let _ = (dq, lambda, hessian);
        false
    }
}

/// What [`ContinuousModel::prepare`] computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Wanted {
    /// Accelerations.
    Motion,
    /// And their derivatives.
    Derivatives,
    /// Accelerations and the equations that they satisfy, differentiated.
    #[doc(hidden)]
    Equations,
}

/// What [`ContinuousModel::calc_diff`] gives.
#[derive(Clone, Copy, Debug)]
pub struct Derivatives<'d> {
    /// a itself, nv numbers.
    pub a: &'d [f64],
    /// ∂a/∂q in the tangent space, nv × nv.
    pub da_dq: &'d DMatrix<f64>,
    /// ∂a/∂v, nv × nv.
    pub da_dv: &'d DMatrix<f64>,
    /// ∂a/∂u, nv × nu, column after column.
    pub da_du: &'d [f64],
}

/// How a knot steps through its time.
///
/// The stages of the Runge–Kutta methods add velocities of different points as if positions were a vector space, as
/// Crocoddyl's do; for a free-flyer they are therefore of first order in its rotation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Integrator {
    /// v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²): one evaluation; symplectic. Crocoddyl's `IntegratedActionModelEuler`.
    SemiImplicitEuler,
    /// The midpoint rule, 2 evaluations.
    #[serde(rename = "runge_kutta_2")]
    RungeKutta2,
    /// Heun's rule of third order, 3 evaluations.
    #[serde(rename = "runge_kutta_3")]
    RungeKutta3,
    /// The classical rule, 4 evaluations.
    #[serde(rename = "runge_kutta_4")]
    RungeKutta4,
}

/// A knot of Δt seconds of a [`ContinuousModel`], or the end, where time stands still and the cost is ℓ itself.
#[derive(Clone, Debug)]
pub struct Integrated<M> {
    pub(super) inner: M,
    /// Δt; none at a terminal knot.
    dt: Option<f64>,
    method: Method,
    /// The least and the greatest controls.
    bounds: Option<[Vec<f64>; 2]>,
    /// v Δt + a Δt².
    pub(super) dq: Vec<f64>,
    /// ∂(q ⊕ dq)/∂q and ∂(q ⊕ dq)/∂dq.
    pub(super) transport: DMatrix<f64>,
    pub(super) exp: DMatrix<f64>,
    curvature: Curvature,
}

#[derive(Clone, Debug)]
enum Method {
    Euler,
    RungeKutta(Box<RungeKutta>),
}

impl<M: ContinuousModel> Integrated<M> {
    /// A knot of Δt seconds.
    ///
    /// # Errors
    /// [`Error::TimeStep`] if Δt is not above 0.
    pub fn new(model: M, integrator: Integrator, dt: f64) -> Result<Self, Error> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::TimeStep { dt });
        }
        Ok(Self::make(model, Some(dt), integrator))
    }

    /// The end of a horizon, for a model without controls.
    ///
    /// # Panics
    /// If the model has controls.
    pub fn end(model: M) -> Self {
        assert!(model.nu() == 0, "model: a terminal one has no controls, found {}", model.nu());
        Self::make(model, None, Integrator::SemiImplicitEuler)
    }

    fn make(model: M, dt: Option<f64>, integrator: Integrator) -> Self {
        let (nq, nv, nu) = (model.nq(), model.nv(), model.nu());
        let stages = match integrator {
            Integrator::SemiImplicitEuler => 1,
            Integrator::RungeKutta2 => 2,
            Integrator::RungeKutta3 => 3,
            Integrator::RungeKutta4 => 4,
        };
        let method = match stages {
            1 => Method::Euler,
            _ => Method::RungeKutta(Box::new(RungeKutta::new(stages, nq, nv, nu))),
        };
        let (square, curvature) = (DMatrix::zeros(nv, nv), Curvature::new(&model));
        let (transport, exp) = (square.clone(), square);
        Self { inner: model, dt, method, bounds: None, dq: vec![0.0; nv], transport, exp, curvature }
    }

    /// The same with bounds on the controls, infinite where there is none.
    ///
    /// # Panics
    /// If there are not nu numbers of each.
    #[must_use]
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        assert_length("lower", lower.len(), self.inner.nu());
        assert_length("upper", upper.len(), self.inner.nu());
        self.bounds = Some([lower, upper]);
        self
    }

    /// What is integrated.
    pub fn inner(&self) -> &M {
        &self.inner
    }

    /// What is integrated, to change it.
    pub fn inner_mut(&mut self) -> &mut M {
        &mut self.inner
    }
}

impl<M: ContinuousModel> ActionModel for Integrated<M> {
    fn nx(&self) -> usize {
        self.inner.nq() + self.inner.nv()
    }

    fn ndx(&self) -> usize {
        2 * self.inner.nv()
    }

    fn nu(&self) -> usize {
        self.inner.nu()
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        self.bounds.as_ref().map(|[lower, upper]| (lower.as_slice(), upper.as_slice()))
    }

    fn lanes(&self) -> usize {
        match (self.dt, &self.method) {
            (Some(_), Method::Euler) => self.inner.lanes(),
            _ => 1,
        }
    }

    fn shift(&mut self) {
        self.inner.shift();
    }

    fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
        match (self.dt, &self.method) {
            (Some(_), Method::Euler) => self.inner.implicit(),
            _ => None,
        }
    }

    fn fork(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(Self {
            inner: self.inner.fork()?,
            dt: self.dt,
            method: self.method.clone(),
            bounds: self.bounds.clone(),
            dq: self.dq.clone(),
            transport: self.transport.clone(),
            exp: self.exp.clone(),
            curvature: self.curvature.clone(),
        }))
    }

    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        let (nx, nu, lanes) = (self.nx(), self.nu(), self.lanes());
        assert_length("xs", xs.len(), knots.len() * nx);
        assert_length("us", us.len(), knots.len() * nu);
        assert_length("next", next.len(), knots.len() * nx);
        assert_length("costs", costs.len(), knots.len());
        for from in (0..knots.len()).step_by(lanes) {
            let to = (from + lanes).min(knots.len());
            let side_by_side = to - from >= WORTHWHILE;
            if side_by_side {
                let (xs, us) = (&xs[from * nx..to * nx], &us[from * nu..to * nu]);
                self.inner.prepare(&knots[from..to], xs, us, Wanted::Motion);
            }
            for i in from..to {
                let (x, u, next) = (&xs[i * nx..][..nx], &us[i * nu..][..nu], &mut next[i * nx..][..nx]);
                costs[i] = match self.dt {
                    Some(dt) if side_by_side => {
                        let lane = Some(i - from);
                        euler::calc(&mut self.inner, lane, dt, knots[i], x, u, &mut self.dq, next)
                    }
                    _ => self.calc(knots[i], x, u, next),
                };
            }
        }
    }

    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], nodes: &mut [LqNode]) {
        let (nx, nu, lanes) = (self.nx(), self.nu(), self.lanes());
        assert_length("xs", xs.len(), knots.len() * nx);
        assert_length("us", us.len(), knots.len() * nu);
        assert_length("nodes", nodes.len(), knots.len());
        for from in (0..knots.len()).step_by(lanes) {
            let to = (from + lanes).min(knots.len());
            let implicit = self.inverse_dynamics_form().is_some() && nodes[from].inverse_dynamics.wanted;
            let side_by_side = implicit || to - from >= WORTHWHILE;
            if side_by_side {
                let wanted = if implicit { Wanted::Equations } else { Wanted::Derivatives };
                let (xs, us) = (&xs[from * nx..to * nx], &us[from * nu..to * nu]);
                self.inner.prepare(&knots[from..to], xs, us, wanted);
            }
            for i in from..to {
                let (x, u, node) = (&xs[i * nx..][..nx], &us[i * nu..][..nu], &mut nodes[i]);
                match self.dt {
                    Some(dt) if side_by_side => {
                        let Self { inner, dq, transport, exp, .. } = self;
                        let (lane, exp) = (i - from, [transport, exp]);
                        if !implicit {
                            euler::calc_diff(inner, Some(lane), dt, knots[i], x, u, dq, exp, node);
                        } else if !euler::calc_implicit(inner, lane, dt, knots[i], x, u, dq, exp, node) {
                            self.calc_diff(knots[i], x, u, node);
                        }
                    }
                    _ => self.calc_diff(knots[i], x, u, node),
                }
            }
        }
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        match (self.dt, &mut self.method) {
            (None, _) => self.inner.calc(t, x, u).1 + limit_term(&mut self.inner),
            (Some(dt), Method::Euler) => euler::calc(&mut self.inner, None, dt, t, x, u, &mut self.dq, next),
            (Some(dt), Method::RungeKutta(method)) => method.calc(&mut self.inner, dt, t, x, u, next),
        }
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        let Some(dt) = self.dt else {
            self.inner.calc_diff(t, x, u, 1.0, node);
            return;
        };
        let Self { inner, dq, transport, exp, .. } = self;
        match &mut self.method {
            Method::Euler => euler::calc_diff(inner, None, dt, t, x, u, dq, [transport, exp], node),
            Method::RungeKutta(method) => method.calc_diff(inner, dt, t, x, u, [transport, exp], node),
        }
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(limits) = self.inner.limits() {
            limits.visit(t, visit);
        }
    }

    /// By semi-implicit Euler: see `curvature.rs`.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let Self { inner, dt: Some(dt), method: Method::Euler, dq, transport, exp, curvature, .. } = self else {
            return false;
        };
        curvature.run(inner, *dt, t, x, u, lambda, dq, [transport, exp], hessian)
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        let (nq, nv) = (self.inner.nq(), self.inner.nv());
        self.inner.integrate(&x[..nq], &dx[..nv], &mut out[..nq]);
        (0..nv).for_each(|k| out[nq + k] = x[nq + k] + dx[nv + k]);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        let (nq, nv) = (self.inner.nq(), self.inner.nv());
        self.inner.difference(&x0[..nq], &x1[..nq], &mut out[..nv]);
        (0..nv).for_each(|k| out[nv + k] = x1[nq + k] - x0[nq + k]);
    }
}
