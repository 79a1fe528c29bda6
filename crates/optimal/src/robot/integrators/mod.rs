//! Integrators: from accelerations to the next state, and knots of some duration.

mod controls;
mod curvature;
mod euler;
mod integrator;
mod retraction;
mod runge_kutta;

use super::continuous::{ContinuousModel, Evaluation, KnotInput, limit_term};
use super::on_demand::OnDemand;
use crate::ActionModel;
use crate::Error;
use crate::error::assert_length;
use crate::lq::{Hessian, LqKnot};
use crate::problem::{Visit, quasi_static};
pub use controls::ControlPolynomial;
use controls::widen;
use curvature::Curvature;
pub use integrator::Integrator;
use retraction::Retraction;
use runge_kutta::RungeKutta;
use std::any::Any;

/// A knot of Δt seconds of a [`ContinuousModel`], or the end, where time stands still and the cost is ℓ itself.
#[derive(Clone, Debug)]
pub struct Integrated<M> {
    inner: M,
    method: Method,
    controls: ControlPolynomial,
    /// The least and the greatest controls.
    bounds: Option<[Vec<f64>; 2]>,
    work: OnDemand<Work>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    /// The end of a horizon, where time stands still.
    Terminal,
    /// A semi-implicit Euler step of Δt.
    Euler(f64),
    /// A Runge–Kutta step of Δt, of so many stages.
    RungeKutta(f64, usize),
}

/// The memory of a step.
#[derive(Debug)]
struct Work {
    retraction: Retraction,
    curvature: Curvature,
    runge_kutta: Option<RungeKutta>,
    /// A step by its first controls, where there are others.
    first: Option<Box<LqKnot>>,
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
        let method = match integrator {
            Integrator::SemiImplicitEuler => Method::Euler(dt),
            Integrator::RungeKutta2 => Method::RungeKutta(dt, 2),
            Integrator::RungeKutta3 => Method::RungeKutta(dt, 3),
            Integrator::RungeKutta4 => Method::RungeKutta(dt, 4),
        };
        let (controls, work) = (ControlPolynomial::Constant, OnDemand::default());
        Ok(Self { inner: model, method, controls, bounds: None, work })
    }

    /// The end of a horizon, for a model without controls.
    ///
    /// # Panics
    /// If the model has controls.
    #[track_caller]
    pub fn without_time(model: M) -> Self {
        assert!(model.nu() == 0, "`model` has {} controls, expected 0 at the end", model.nu());
        let (controls, work) = (ControlPolynomial::Constant, OnDemand::default());
        Self { inner: model, method: Method::Terminal, controls, bounds: None, work }
    }

    /// The model, the rule of a step, and its memory.
    fn parts(&mut self) -> (&mut M, Method, &mut Work) {
        let Self { inner, method, controls, work, .. } = self;
        let work = work.get(|| {
            let runge_kutta = match *method {
                Method::RungeKutta(_, stages) => Some(RungeKutta::new(stages, inner, *controls)),
                _ => None,
            };
            let (retraction, curvature) = (Retraction::new(inner.nv()), Curvature::new(inner));
            let first = (!controls.is_constant() && runge_kutta.is_none())
                .then(|| Box::new(LqKnot::zeros(2 * inner.nv(), inner.nu())));
            Work { retraction, curvature, runge_kutta, first }
        });
        (inner, *method, work)
    }

    /// The same knot with controls that follow a polynomial through its time; the end has no controls and stays as it is.
    /// Bounds, also those given before, hold at each node of the polynomial.
    #[must_use]
    pub fn with_controls(mut self, controls: ControlPolynomial) -> Self {
        if self.method != Method::Terminal {
            (self.controls, self.work) = (controls, OnDemand::default());
        }
        let (nu, nodes) = (self.inner.nu(), self.controls.nodes());
        self.bounds = self.bounds.map(|bounds| bounds.map(|bound| bound[..nu].repeat(nodes)));
        self
    }

    /// The same knot with bounds on the controls u of its model, infinite where there is none.
    ///
    /// # Panics
    /// If there are not as many numbers of each as the model has controls.
    #[must_use]
    #[track_caller]
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        assert_length("lower", lower.len(), self.inner.nu());
        assert_length("upper", upper.len(), self.inner.nu());
        let nodes = self.controls.nodes();
        self.bounds = Some([lower.repeat(nodes), upper.repeat(nodes)]);
        self
    }

    /// The model that is integrated.
    pub fn inner(&self) -> &M {
        &self.inner
    }

    /// The model that is integrated, to change it.
    pub fn inner_mut(&mut self) -> &mut M {
        &mut self.inner
    }

    /// Prepares the states of a group, as many at a time as there are lanes, and calls a function for each of them with its
    /// number in the group. Runge–Kutta methods prepare each stage.
    #[track_caller]
    fn each(
        &mut self,
        knots: &[usize],
        xs: &[f64],
        us: &[f64],
        what: Evaluation,
        mut visit: impl FnMut(&mut Self, KnotInput<'_>, usize),
    ) {
        let (nx, nu, lanes) = (self.nx(), self.nu(), self.lanes());
        assert_length("xs", xs.len(), knots.len() * nx);
        assert_length("us", us.len(), knots.len() * nu);
        for from in (0..knots.len()).step_by(lanes) {
            let to = (from + lanes).min(knots.len());
            if !matches!(self.method, Method::RungeKutta(..)) {
                let controls = &us[from * nu..][..(to - from) * self.inner.nu()]; // one knot, unless they are constant
                self.inner.prepare(&knots[from..to], &xs[from * nx..to * nx], controls, what);
            }
            for i in from..to {
                let (x, u) = (&xs[i * nx..][..nx], &us[i * nu..][..nu]);
                let u = if matches!(self.method, Method::RungeKutta(..)) { u } else { &u[..self.inner.nu()] }; // u(0)
                visit(self, KnotInput { lane: i - from, t: knots[i], x, u }, i);
            }
        }
    }

    /// Writes the derivatives of a group in inverse-dynamics form, from the motion that the knots know, or else from its own.
    fn write_equations(&mut self, knots: &[usize], xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        let (nx, nu, lanes, size) = (self.nx(), self.nu(), self.lanes(), self.motion_size());
        for (k, lq_knots) in lq_knots.chunks_mut(lanes).enumerate() {
            let (from, count) = (k * lanes, lq_knots.len());
            let (knots, xs, us) =
                (&knots[from..][..count], &xs[from * nx..][..count * nx], &us[from * nu..][..count * nu]);
            if lq_knots.iter().all(|knot| knot.inverse_dynamics.knows_motion) {
                for (lane, knot) in lq_knots.iter().enumerate() {
                    self.inner.set_motion(lane, &knot.inverse_dynamics.motion[..size]);
                }
            } else {
                self.inner.prepare(knots, xs, us, Evaluation::Motion);
            }
            self.inner.prepare(knots, xs, us, Evaluation::Equations);
            for (lane, (knot, &t)) in lq_knots.iter_mut().zip(knots).enumerate() {
                let (x, u) = (&xs[lane * nx..][..nx], &us[lane * nu..][..nu]);
                self.differentiate(KnotInput { lane, t, x, u }, knot);
            }
        }
    }

    /// Panics if a state or controls have a wrong length.
    #[track_caller]
    fn assert_knot(&self, x: &[f64], u: &[f64]) {
        assert_length("x", x.len(), self.nx());
        assert_length("u", u.len(), self.nu());
    }

    /// Whether a step is one of semi-implicit Euler with controls that stay the same.
    fn is_simple_step(&self) -> bool {
        matches!(self.method, Method::Euler(_)) && self.controls.is_constant()
    }

    /// Writes the next state of a prepared one; returns the cost.
    fn step(&mut self, input: KnotInput<'_>, next: &mut [f64]) -> f64 {
        match self.parts() {
            (inner, Method::Euler(dt), work) => euler::calc(inner, input, dt, &mut work.retraction, next),
            (inner, Method::RungeKutta(dt, _), Work { runge_kutta: Some(method), .. }) => {
                method.calc(inner, input, dt, next)
            }
            (inner, ..) => inner.calc(input).1 + limit_term(inner),
        }
    }

    /// Writes the derivatives at a prepared state.
    fn differentiate(&mut self, input: KnotInput<'_>, knot: &mut LqKnot) {
        match self.parts() {
            (inner, Method::Euler(dt), Work { retraction, first: Some(first), .. }) => {
                euler::calc_diff(inner, input, dt, retraction, first);
                widen(first, knot);
            }
            (inner, Method::Euler(dt), work) => euler::calc_diff(inner, input, dt, &mut work.retraction, knot),
            (inner, Method::RungeKutta(dt, _), Work { runge_kutta: Some(method), retraction, .. }) => {
                method.calc_diff(inner, input, dt, retraction, knot);
            }
            (inner, ..) => _ = inner.calc_diff(input, 1.0, knot),
        }
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
        self.controls.nodes() * self.inner.nu()
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        self.bounds.as_ref().map(|[lower, upper]| (lower.as_slice(), upper.as_slice()))
    }

    fn is_terminal(&self) -> bool {
        self.method == Method::Terminal
    }

    fn lanes(&self) -> usize {
        if self.is_simple_step() { self.inner.lanes() } else { 1 }
    }

    fn shift(&mut self) {
        self.inner.shift();
    }

    fn reserve(&mut self) {
        self.inner.reserve();
        self.parts();
    }

    fn merge(&mut self, other: &mut dyn ActionModel) -> bool {
        let other: &mut dyn Any = other;
        let Some(other) = other.downcast_mut::<Self>() else { return false };
        let rule = |one: &Self| (one.method, one.controls);
        rule(self) == rule(other) && self.bounds == other.bounds && self.inner.merge(&mut other.inner)
    }

    fn choose(&mut self, model: usize) {
        self.inner.choose(model);
    }

    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.inner.serve(t, horizon, model);
    }

    fn inverse_dynamics_form(&self) -> Option<[usize; 2]> {
        if self.is_simple_step() { self.inner.inverse_dynamics_form() } else { None }
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        let Self { inner, method, controls, bounds, work } = self;
        let (inner, bounds, work) = (inner.try_clone()?, bounds.clone(), work.clone());
        Some(Box::new(Self { inner, method: *method, controls: *controls, bounds, work }))
    }

    #[track_caller]
    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        let nx = self.nx();
        assert_length("next", next.len(), knots.len() * nx);
        assert_length("costs", costs.len(), knots.len());
        self.each(knots, xs, us, Evaluation::Motion, |integrated, input, i| {
            costs[i] = integrated.step(input, &mut next[i * nx..][..nx]);
        });
    }

    fn motion_size(&self) -> usize {
        if self.is_simple_step() { self.inner.motion_size() } else { 0 }
    }

    #[track_caller]
    fn calc_group_with_motion(
        &mut self,
        knots: &[usize],
        xs: &[f64],
        us: &[f64],
        next: &mut [f64],
        costs: &mut [f64],
        motions: &mut [f64],
    ) {
        let (nx, room, size) = (self.nx(), motions.len() / knots.len(), self.motion_size());
        assert_length("next", next.len(), knots.len() * nx);
        assert_length("costs", costs.len(), knots.len());
        self.each(knots, xs, us, Evaluation::Motion, |integrated, input, i| {
            if size > 0 {
                integrated.inner.motion(input.lane, &mut motions[i * room..][..size]);
            }
            costs[i] = integrated.step(input, &mut next[i * nx..][..nx]);
        });
    }

    #[track_caller]
    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        assert_length("lq_knots", lq_knots.len(), knots.len());
        if lq_knots.first().is_some_and(|knot| knot.inverse_dynamics.wanted) && self.inverse_dynamics_form().is_some() {
            return self.write_equations(knots, xs, us, lq_knots);
        }
        self.each(knots, xs, us, Evaluation::Derivatives, |integrated, input, i| {
            integrated.differentiate(input, &mut lq_knots[i])
        });
    }

    #[track_caller]
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.assert_knot(x, u);
        if self.method != Method::Terminal {
            assert_length("next", next.len(), self.nx());
        }
        let mut cost = 0.0;
        self.each(&[t], x, u, Evaluation::Motion, |integrated, input, _| cost = integrated.step(input, next));
        cost
    }

    #[track_caller]
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.assert_knot(x, u);
        self.each(&[t], x, u, Evaluation::Derivatives, |integrated, input, _| integrated.differentiate(input, knot));
    }

    fn outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        if self.method != Method::Terminal {
            let u = &u[..self.inner.nu()]; // u(0)
            self.inner.prepare(&[t], x, u, Evaluation::Motion);
            self.inner.outputs(KnotInput { lane: 0, t, x, u }, show);
        }
    }

    #[track_caller]
    fn quasi_static(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        match self.inner.quasi_static(x) {
            Some(u) => u.repeat(self.controls.nodes()),
            None => quasi_static::newton(self, t, x),
        }
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(limits) = self.inner.limits() {
            limits.visit(t, visit);
        }
    }

    /// Second derivatives by semi-implicit Euler, of constant controls: see `curvature.rs`.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (inner, Method::Euler(dt), Work { retraction, curvature, first: None, .. }) = self.parts() else {
            return false;
        };
        curvature.run(inner, dt, KnotInput { lane: 0, t, x, u }, lambda, retraction, hessian)
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        self.inner.check_position(&x[..self.inner.nq()])
    }

    #[track_caller]
    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        let (nq, nv) = (self.inner.nq(), self.inner.nv());
        assert_length("x", x.len(), nq + nv);
        assert_length("dx", dx.len(), 2 * nv);
        assert_length("out", out.len(), nq + nv);
        self.inner.integrate(&x[..nq], &dx[..nv], &mut out[..nq]);
        (0..nv).for_each(|k| out[nq + k] = x[nq + k] + dx[nv + k]);
    }

    #[track_caller]
    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        let (nq, nv) = (self.inner.nq(), self.inner.nv());
        assert_length("x0", x0.len(), nq + nv);
        assert_length("x1", x1.len(), nq + nv);
        assert_length("out", out.len(), 2 * nv);
        self.inner.difference(&x0[..nq], &x1[..nq], &mut out[..nv]);
        (0..nv).for_each(|k| out[nv + k] = x1[nq + k] - x0[nq + k]);
    }
}
