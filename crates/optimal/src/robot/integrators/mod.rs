//! Integrators, which compute the next state from accelerations, and knots with a duration.

mod accelerations;
mod across;
mod controls;
mod curvature;
mod euler;
mod integrator;
mod retraction;
mod runge_kutta;

use super::continuous::{ContinuousModel, Derivatives, KnotInput};
use super::dynamics::batch::Group;
use super::dynamics::robot::RobotDynamics;
use super::horizon::{PerKnot, PerModel};
use super::knot_data::{OnDemand, WIDEST};
use crate::error::assert_length;
use crate::lq::{Hessian, LqKnot};
use crate::problem::{Evaluation, KnotGroup, Results, Visit, quasi_static};
use crate::{ActionModel, Error, GroupModel};
use accelerations::{robot, robot_mut, slopes, solve, values};
pub use controls::ControlPolynomial;
use controls::widen;
use curvature::Curvature;
pub use integrator::Integrator;
use retraction::Retraction;
use runge_kutta::RungeKutta;
use std::any::Any;

/// Knot that integrates a [`ContinuousModel`] over Δt seconds. It can also be an impact or a terminal knot, whose cost
/// is ℓ without the factor Δt.
#[derive(Clone, Debug)]
pub struct Integrated<M> {
    inner: M,
    method: Method,
    /// Durations Δt of the knots; not used by impacts and terminal knots.
    durations: PerModel<PerKnot<f64>>,
    controls: ControlPolynomial,
    /// Lower and upper bounds of the controls; `None` without bounds.
    bounds: Option<[Vec<f64>; 2]>,
    work: OnDemand<Work>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Method {
    /// Terminal knot, without a next state.
    Terminal,
    /// Impact, with a jump of the velocity.
    Impact,
    /// Semi-implicit Euler step.
    Euler,
    /// Runge–Kutta step with this number of stages.
    RungeKutta(usize),
}

/// Workspace of a step.
#[derive(Debug)]
struct Work {
    retraction: Retraction,
    curvature: Curvature,
    runge_kutta: Option<RungeKutta>,
    /// Derivatives with respect to the first node of the control polynomial; `None` if the polynomial has only one
    /// node.
    first: Option<Box<LqKnot>>,
}

impl<M: ContinuousModel> Integrated<M> {
    /// Creates a knot of Δt seconds.
    ///
    /// # Errors
    /// [`Error::TimeStep`] if Δt is not above 0.
    pub fn new(model: M, integrator: Integrator, dt: f64) -> Result<Self, Error> {
        if !(dt > 0.0 && dt.is_finite()) {
            return Err(Error::TimeStep { dt });
        }
        let method = match integrator {
            Integrator::SemiImplicitEuler => Method::Euler,
            Integrator::RungeKutta2 => Method::RungeKutta(2),
            Integrator::RungeKutta3 => Method::RungeKutta(3),
            Integrator::RungeKutta4 => Method::RungeKutta(4),
        };
        Ok(Self::of(model, method, dt))
    }

    /// Creates the terminal knot of a model without controls.
    ///
    /// # Panics
    /// If the model has controls.
    #[track_caller]
    pub fn without_time(model: M) -> Self {
        assert!(model.nu() == 0, "`model` has {} controls, expected 0 at the end", model.nu());
        Self::of(model, Method::Terminal, 0.0)
    }

    /// Creates an impact. Its model computes the velocity change v⁺ − v instead of accelerations.
    pub(super) fn impact(model: M) -> Self {
        Self::of(model, Method::Impact, 0.0)
    }

    fn of(inner: M, method: Method, dt: f64) -> Self {
        let (controls, durations) = (ControlPolynomial::Constant, PerModel::new(PerKnot::new(dt)));
        Self { inner, method, durations, controls, bounds: None, work: OnDemand::default() }
    }

    /// Returns the model, and the workspace of a step.
    fn parts(&mut self) -> (&mut M, &mut Work) {
        let Self { inner, method, controls, work, .. } = self;
        let work = work.get(|| {
            let runge_kutta = match *method {
                Method::RungeKutta(stages) => Some(RungeKutta::new(stages, inner, *controls)),
                _ => None,
            };
            let (retraction, curvature) = (Retraction::new(inner.nv()), Curvature::new(inner));
            let first = (!controls.is_constant() && runge_kutta.is_none())
                .then(|| Box::new(LqKnot::zeros(2 * inner.nv(), inner.nu())));
            Work { retraction, curvature, runge_kutta, first }
        });
        (inner, work)
    }

    /// Returns the same knot with controls that follow a polynomial in time. A terminal knot has no controls and is
    /// returned unchanged. Bounds on controls, including bounds set before this call, apply at each node of the
    /// polynomial.
    #[must_use]
    pub fn with_controls(mut self, controls: ControlPolynomial) -> Self {
        if self.method != Method::Terminal {
            (self.controls, self.work) = (controls, OnDemand::default());
        }
        let (nu, nodes) = (self.inner.nu(), self.controls.nodes());
        self.bounds = self.bounds.map(|bounds| bounds.map(|bound| bound[..nu].repeat(nodes)));
        self
    }

    /// Returns the same knot with bounds on the controls u of its model. The bounds are infinite where a control is
    /// unbounded.
    ///
    /// # Panics
    /// If the length of a bound differs from the number of controls of the model.
    #[must_use]
    #[track_caller]
    pub fn with_bounds(mut self, lower: Vec<f64>, upper: Vec<f64>) -> Self {
        assert_length("lower", lower.len(), self.inner.nu());
        assert_length("upper", upper.len(), self.inner.nu());
        let nodes = self.controls.nodes();
        self.bounds = Some([lower.repeat(nodes), upper.repeat(nodes)]);
        self
    }

    /// Returns the model that is integrated.
    pub fn inner(&self) -> &M {
        &self.inner
    }

    /// Returns the model that is integrated, as a mutable reference.
    pub fn inner_mut(&mut self) -> &mut M {
        &mut self.inner
    }

    /// Calls `show` with each vector that the dynamics of knot t compute: see
    /// [`Problem::outputs`](crate::Problem::outputs).
    pub fn outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        if self.method != Method::Terminal {
            let u = &u[..self.inner.nu()]; // shows the outputs for u(0)
            self.inner.outputs(KnotInput { t, x, u }, show);
        }
    }

    /// Panics if a state or controls have a wrong length.
    #[track_caller]
    fn assert_knot(&self, x: &[f64], u: &[f64]) {
        assert_length("x", x.len(), self.nx());
        assert_length("u", u.len(), self.nu());
    }

    /// Returns whether several states can be computed in one batch. This excludes Runge–Kutta methods, which compute
    /// stage after stage, and controls that change within a knot.
    fn is_simple_step(&self) -> bool {
        !matches!(self.method, Method::RungeKutta(_)) && self.controls.is_constant()
    }

    /// Sets whether limits add their terms of the augmented Lagrangian to the cost.
    fn set_limits_in_cost(&mut self, counted: bool) {
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.terms.limits.in_cost = counted;
        }
    }

    /// Writes the residuals of the limits at one knot of the last solved group. For a Runge–Kutta method, whose stages
    /// are solved later, solves the first stage.
    fn write_limits(&mut self, lane: usize, input: KnotInput<'_>, to: &mut [f64]) {
        let input = KnotInput { u: &input.u[..self.inner.nu()], ..input };
        if matches!(self.method, Method::RungeKutta(_)) {
            solve(&mut self.inner, Group::one(&input, Evaluation::Values, true));
        }
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.write_limits(lane, input, to);
        }
    }

    /// Returns the controls from which a step is computed. For a Runge–Kutta method these are all nodes of the
    /// polynomial; for other methods, only u(0).
    fn controls_of_step<'u>(&self, u: &'u [f64]) -> &'u [f64] {
        if matches!(self.method, Method::RungeKutta(_)) { u } else { &u[..self.inner.nu()] }
    }

    /// Computes the next state of knot t after `dt` seconds. Returns the cost of the knot.
    #[track_caller]
    fn calc_after(&mut self, t: usize, x: &[f64], u: &[f64], dt: f64, next: &mut [f64]) -> f64 {
        self.assert_knot(x, u);
        if self.method != Method::Terminal {
            assert_length("next", next.len(), self.nx());
        }
        self.set_limits_in_cost(true);
        let input = KnotInput { t, x, u: self.controls_of_step(u) };
        if !matches!(self.method, Method::RungeKutta(_)) {
            solve(&mut self.inner, Group::one(&input, Evaluation::Values, true));
        }
        self.step(0, input, dt, next)
    }

    /// Returns the duration of knot t.
    fn duration_of(&self, t: usize) -> f64 {
        *self.durations.at(t).at(t)
    }

    /// Writes the next state of one knot of the last computed group, after `dt` seconds. Returns the cost of the knot.
    fn step(&mut self, lane: usize, input: KnotInput<'_>, dt: f64, next: &mut [f64]) -> f64 {
        let method = self.method;
        let (inner, Work { retraction, runge_kutta, .. }) = self.parts();
        match (method, runge_kutta) {
            (Method::Euler, _) => {
                euler::calc(inner, input, dt, retraction, next, |inner| values(inner, lane, input, true))
            }
            (_, Some(method)) => method.calc(inner, input, dt, next),
            (Method::Impact, _) => {
                let nq = inner.nq();
                let (change, cost, term) = values(inner, lane, input, true);
                next.copy_from_slice(input.x);
                change.iter().enumerate().for_each(|(k, change)| next[nq + k] += change);
                cost + term
            }
            _ => {
                let (_, cost, term) = values(inner, lane, input, true);
                cost + term
            }
        }
    }

    /// Writes the derivatives at one knot of the last computed group.
    fn differentiate(&mut self, lane: usize, input: KnotInput<'_>, group: Group<'_>, knot: &mut LqKnot) {
        let (method, dt) = (self.method, *self.durations.at(input.t).at(input.t));
        let (inner, Work { retraction, runge_kutta, first, .. }) = self.parts();
        match (method, runge_kutta, first) {
            (Method::Euler, _, Some(first)) => {
                euler::calc_diff(inner, lane, input, dt, group, retraction, first);
                widen(first, knot);
                core::mem::swap(&mut first.rows, &mut knot.rows); // u = w₀ has the same columns
                first.rows.clear();
            }
            (Method::Euler, ..) => euler::calc_diff(inner, lane, input, dt, group, retraction, knot),
            (_, Some(method), _) => method.calc_diff(inner, input, dt, retraction, knot),
            (Method::Impact, ..) => {
                let nv = inner.nv();
                let Derivatives { da_dq, da_dv, .. } = slopes(inner, lane, input, 1.0, group, knot);
                // the Jacobian A = [1, 0; ∂v⁺/∂q, ∂v⁺/∂v] has the structure of an Euler step with Δt = 0
                knot.structure.set_euler(0.0, &[]);
                knot.A.fill_with_identity();
                let mut below = knot.A.rows_mut(nv, nv);
                below.columns_mut(0, nv).copy_from(da_dq);
                below.columns_mut(nv, nv).zip_apply(da_dv, |a, change| *a += change);
            }
            _ => _ = slopes(inner, lane, input, 1.0, group, knot),
        }
    }
}

impl<M: ContinuousModel> KnotGroup for Integrated<M> {
    fn lanes(&mut self) -> usize {
        GroupModel::lanes(self)
    }

    /// Computes dynamics, steps, costs and limits of a group of knots, in batches of as many knots as a SIMD register
    /// has lanes.
    #[track_caller]
    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation<'_>, results: &mut Results<'_>) {
        let (nx, nu, inner_nu, count) = (self.nx(), self.nu(), self.inner.nu(), knots.len());
        assert_length("xs", xs.len(), count * nx);
        assert_length("us", us.len(), count * nu);
        match what {
            Evaluation::Values => {
                assert_length("next", results.next.len(), count * nx);
                assert_length("costs", results.costs.len(), count);
            }
            _ => assert_length("lq_knots", results.lq_knots.len(), count),
        }
        let motion = KnotGroup::inverse_dynamics(self).map_or(0, |(size, _)| size);
        let constraints = results.constraints.len() / count.max(1);
        self.set_limits_in_cost(!what.has_rows() && constraints == 0);
        let what = match what {
            Evaluation::Values => what,
            Evaluation::Equations { .. } if motion > 0 => what,
            _ => Evaluation::Derivatives,
        };
        let (lanes, room) = (GroupModel::lanes(self), results.motions.len() / count.max(1));
        let differentiates_steps =
            self.method == Method::Euler && what != Evaluation::Values && !self.inner.groups().is_empty();
        let mut to = 0;
        while to < count {
            let from = to;
            to = (from + lanes).min(count);
            let (knots, xs) = (&knots[from..to], &xs[from * nx..to * nx]);
            let controls = &us[from * nu..][..(to - from) * inner_nu]; // with several knots, controls are constant
            let mut durations = [0.0; WIDEST];
            let steps = if differentiates_steps { to - from } else { 0 };
            for k in 0..steps {
                durations[k] = self.duration_of(knots[k]);
            }
            let durations = &durations[..steps];
            let group = Group { knots, xs, us: controls, what: what.part(from..to, count), limited: true, durations };
            if !matches!(self.method, Method::RungeKutta(_)) {
                solve(&mut self.inner, group);
            }
            for i in from..to {
                let lane = i - from;
                let u = self.controls_of_step(&us[i * nu..][..nu]);
                let input = KnotInput { t: knots[lane], x: &xs[lane * nx..][..nx], u };
                if what != Evaluation::Values {
                    self.differentiate(lane, input, group, &mut results.lq_knots[i]);
                    continue;
                }
                if let Some(robot) = robot_mut(&mut self.inner).filter(|_| motion.min(room) > 0) {
                    robot.copy_motion(lane, &mut results.motions[i * room..][..motion]);
                }
                if constraints > 0 {
                    let to = &mut results.constraints[i * constraints..][..constraints];
                    self.write_limits(lane, input, to);
                }
                let dt = self.duration_of(input.t);
                results.costs[i] = self.step(lane, input, dt, &mut results.next[i * nx..][..nx]);
            }
        }
    }

    #[track_caller]
    fn evaluate_across(
        &mut self,
        others: &mut [&mut dyn ActionModel],
        of: &[usize],
        t: usize,
        trajectory: [&[f64]; 2],
        results: &mut Results<'_>,
    ) -> bool {
        self.values_across(others, of, t, trajectory, results)
    }

    fn matches(&self, other: &dyn ActionModel, t: usize) -> bool {
        let other: &dyn Any = other;
        let Some(other) = other.downcast_ref::<Self>() else { return false };
        let rule = |one: &Self| (one.method, one.controls, one.bounds.is_some());
        let robots = robot(&self.inner).zip(robot(&other.inner));
        rule(self) == rule(other) && robots.is_some_and(|(own, other)| own.matches(other, t))
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.terms.limits.visit(t, visit);
        }
    }

    fn inverse_dynamics(&self) -> Option<(usize, [usize; 2])> {
        let euler = self.method == Method::Euler && self.controls.is_constant();
        robot(&self.inner).filter(|_| euler)?.inverse_dynamics()
    }

    fn reserve(&mut self) {
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.reserve();
        }
        self.parts();
    }

    fn merge(&mut self, other: &mut dyn ActionModel, place: Option<usize>) -> bool {
        let other: &mut dyn Any = other;
        let Some(other) = other.downcast_mut::<Self>() else { return false };
        let rule = |one: &Self| (one.method, one.controls);
        if rule(self) != rule(other) || self.bounds != other.bounds {
            return false;
        }
        let (Some(robot), Some(others)) = (robot_mut(&mut self.inner), robot_mut(&mut other.inner)) else {
            return false;
        };
        let same = robot.merge(others, place);
        if same {
            self.durations.append(&mut other.durations, place);
        }
        same
    }

    fn share(&mut self, other: &dyn KnotGroup) {
        let others = other.dynamics_ref().and_then(|robot| robot.downcast_ref::<RobotDynamics>());
        if let Some((own, other)) = robot_mut(&mut self.inner).zip(others) {
            own.share(other);
        }
    }

    fn choose(&mut self, model: usize) {
        self.durations.choose(model);
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.terms.choose(model);
        }
    }

    fn serve(&mut self, t: usize, horizon: usize, model: usize) {
        self.durations.serve(t, horizon, model);
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.terms.serve(t, horizon, model);
        }
    }

    fn release(&mut self, t: usize) {
        self.durations.chosen_mut().release(t);
        if let Some(robot) = robot_mut(&mut self.inner) {
            robot.terms.release(t);
        }
    }

    fn reserve_durations(&mut self, horizon: usize) {
        self.durations.all_mut().iter_mut().for_each(|durations| durations.reserve(horizon));
    }

    fn set_duration(&mut self, t: usize, dt: f64) -> bool {
        let has_duration = !matches!(self.method, Method::Terminal | Method::Impact);
        if has_duration {
            self.durations.chosen_mut().set(Some(t), dt);
        }
        has_duration
    }

    fn bounds_mut(&mut self) -> Option<([&mut [f64]; 2], usize)> {
        let count = self.inner.nu();
        let [lower, upper] = self.bounds.as_mut()?;
        Some(([lower, upper], count))
    }

    fn advance(&mut self, t: usize, x: &[f64], u: &[f64], dt: f64, next: &mut [f64]) -> bool {
        let has_duration = !matches!(self.method, Method::Terminal | Method::Impact);
        if has_duration {
            self.calc_after(t, x, u, dt, next);
        }
        has_duration
    }

    fn show_outputs(&mut self, t: usize, x: &[f64], u: &[f64], show: &mut dyn FnMut(&str, &[f64])) {
        self.outputs(t, x, u, show);
    }

    fn hold_still(&mut self, x: &[f64], u: &mut [f64]) -> bool {
        let nu = self.inner.nu();
        let Some(robot) = robot_mut(&mut self.inner).filter(|_| nu > 0) else { return false };
        let exists = robot.hold_still(x, &mut u[..nu]);
        for node in 1..self.controls.nodes() {
            u.copy_within(..nu, node * nu);
        }
        exists
    }

    fn has_controls_of(&self, other: &dyn KnotGroup) -> bool {
        let others = other.dynamics_ref().and_then(|robot| robot.downcast_ref::<RobotDynamics>());
        robot(&self.inner).zip(others).is_none_or(|(own, other)| own.has_controls_of(other))
    }

    fn duration(&self, t: usize) -> Option<f64> {
        match self.method {
            Method::Terminal => None,
            Method::Impact => Some(0.0),
            _ => Some(*self.durations.at(t).at(t)),
        }
    }

    fn dynamics_ref(&self) -> Option<&dyn Any> {
        self.inner.robot()
    }

    fn dynamics(&mut self) -> Option<&mut dyn Any> {
        self.inner.robot_mut()
    }
}

impl<M: ContinuousModel> GroupModel for Integrated<M> {
    fn lanes(&self) -> usize {
        if self.is_simple_step() { robot(&self.inner).map_or(1, RobotDynamics::lanes) } else { 1 }
    }

    #[track_caller]
    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        self.evaluate(knots, xs, us, Evaluation::Values, &mut Results::values(next, costs, &mut []));
    }

    #[track_caller]
    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        self.evaluate(knots, xs, us, Evaluation::Derivatives, &mut Results::derivatives(lq_knots));
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

    fn shift(&mut self) {
        self.durations.all_mut().iter_mut().for_each(PerKnot::shift);
        self.inner.shift();
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        let Self { inner, method, durations, controls, bounds, work } = self;
        let (inner, durations, bounds, work) = (inner.try_clone()?, durations.clone(), bounds.clone(), work.clone());
        Some(Box::new(Self { inner, method: *method, durations, controls: *controls, bounds, work }))
    }

    #[track_caller]
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.calc_after(t, x, u, self.duration_of(t), next)
    }

    #[track_caller]
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.assert_knot(x, u);
        self.calc_diff_group(&[t], x, u, core::slice::from_mut(knot));
    }

    #[track_caller]
    fn quasi_static(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        match self.inner.quasi_static(x) {
            Some(u) => u.repeat(self.controls.nodes()),
            None => quasi_static::newton(self, t, x),
        }
    }

    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }

    fn knot_group(&self) -> Option<&dyn KnotGroup> {
        Some(self)
    }

    fn knot_group_mut(&mut self) -> Option<&mut dyn KnotGroup> {
        Some(self)
    }

    /// Computes the second derivatives of a semi-implicit Euler step with constant controls: see `curvature.rs`.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (euler, dt) = (self.method == Method::Euler, *self.durations.at(t).at(t));
        let (inner, Work { retraction, curvature, first: None, .. }) = self.parts() else { return false };
        euler && curvature.run(inner, dt, KnotInput { t, x, u }, lambda, retraction, hessian)
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
