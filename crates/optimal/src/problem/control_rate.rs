//! Action with a cost, and with limits, of the change of the controls from knot to knot.
#![allow(non_snake_case)] // names follow the literature: A, B, Q, S, R

use super::action::ActionModel;
use super::constrained::Constrained;
use super::group::{Evaluation, KnotGroup, Results, evaluate, lanes};
use super::multipliers::Visit;
use super::path_constraint::PathConstraint;
use crate::error::Error;
use crate::lq::{Hessian, LqKnot};
use core::slice;
use nalgebra::DMatrix;
use std::any::Any;

/// Action that remembers the controls p of the knot before as a part of its state, and adds the cost of their change:
///
/// ```text
/// state (x, p),   p⁺ = u,   ℓ + ½ Σᵢ wᵢ (uᵢ − pᵢ)²
/// ```
///
/// The derivatives are exact. nx and ndx grow by the number of controls; p follows x. All actions of a problem must be
/// wrapped with the same weights. The initial state of the problem contains the controls before the first knot, for
/// example those that the motors execute now. A knot without controls (an impact, or the terminal knot) keeps p: there,
/// the weights only give the size of p. All other knots have one control for each weight.
///
/// A weight w/Δt per knot of Δt seconds is the weight w of the squared rate u̇². [`limited`](Self::limited) also limits
/// the change of the controls.
///
/// The state is larger, and a sweep does not use the structure of A and B of the wrapped action. For a quadruped in
/// contact, an iteration takes about 1.8 times as long.
///
/// ```
/// use condyle_optimal::{ControlRate, Fddp, LqKnot, Lqr, Problem};
///
/// // x⁺ = x + u, ℓ = ½ x² + ½ 3 (u − p)²: from x = 1 at rest, the control begins gently.
/// let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
/// (knot.A[0], knot.B[0], knot.Q[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0);
/// let [knot, end] = [knot, end].map(|knot| ControlRate::new(Box::new(Lqr::new(knot)), &[3.0]).unwrap());
/// let mut problem = Problem::new(vec![1.0, 0.0], vec![Box::new(knot)], vec![0; 30], Box::new(end))?;
/// let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 62], &[0.0; 30])?.clone();
/// assert!(-0.5 < solution.u(0)[0] && solution.u(0)[0] < -0.2);
/// assert_eq!(solution.x(1)[1], solution.u(0)[0]);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
pub struct ControlRate {
    action: Box<dyn ActionModel>,
    weights: Vec<f64>,
    /// States and next states of the wrapped action. Shape: knots of a group × nx.
    xs: Vec<f64>,
    next: Vec<f64>,
    /// LQ knots of the wrapped action, one for each lane.
    lq_knots: Vec<LqKnot>,
    hessian: Hessian,
}

impl ControlRate {
    /// Creates an action that adds a cost of the change of the controls to `action`, with a weight for each control.
    ///
    /// # Errors
    /// [`Error::Length`] if the action has controls, but not one for each weight. [`Error::Setting`] for a weight that
    /// is negative or not finite.
    pub fn new(action: Box<dyn ActionModel>, weights: &[f64]) -> Result<Self, Error> {
        let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
        if nu > 0 && nu != weights.len() {
            return Err(Error::Length { name: "weights", expected: nu, found: weights.len() });
        }
        if let Some(&value) = weights.iter().find(|w| !(w.is_finite() && **w >= 0.0)) {
            return Err(Error::Setting { name: "weights", value, allowed: "at least 0" });
        }
        let mut this = Self {
            weights: weights.to_vec(),
            xs: vec![],
            next: vec![],
            lq_knots: vec![],
            hessian: Hessian::zeros(ndx, nu),
            action,
        };
        let lanes = lanes(&mut *this.action);
        this.lq_knots = (0..lanes).map(|_| LqKnot::zeros(ndx, nu)).collect();
        (this.xs, this.next) = (vec![0.0; lanes * nx], vec![0.0; lanes * nx]);
        Ok(this)
    }

    /// Adds the limits lower ≤ u − p ≤ upper to an action with controls. [`InteriorPoint`](crate::InteriorPoint) and
    /// [`AugmentedLagrangian`](crate::AugmentedLagrangian) impose them.
    ///
    /// # Errors
    /// [`Error::Length`] if there is not one bound for each control.
    pub fn limited(self, lower: &[f64], upper: &[f64]) -> Result<Constrained, Error> {
        let (ndx, nu) = (self.action.ndx(), self.action.nu());
        for (name, bounds) in [("lower", lower), ("upper", upper)] {
            if bounds.len() != nu {
                return Err(Error::Length { name, expected: nu, found: bounds.len() });
            }
        }
        let limit = RateLimit { nx: self.action.nx(), ndx, bounds: [lower.to_vec(), upper.to_vec()] };
        Ok(Constrained::new(Box::new(self), Box::new(limit)))
    }

    /// Returns the wrapped action, if its type is `T`.
    pub fn action_mut<T: ActionModel>(&mut self) -> Option<&mut T> {
        let action: &mut dyn Any = self.action.as_mut();
        action.downcast_mut()
    }

    /// Returns the number of entries of p.
    fn kept(&self) -> usize {
        self.weights.len()
    }

    /// Writes the LQ knot of (x, p) from the LQ knot of x. p is empty at a knot without controls.
    fn expand(&self, inner: &LqKnot, p: &[f64], u: &[f64], knot: &mut LqKnot) {
        let (n, kept, nu) = (inner.ndx(), self.kept(), u.len());
        knot.structure.set_dense();
        for (to, from, columns) in [(&mut knot.A, &inner.A, n), (&mut knot.Q, &inner.Q, n), (&mut knot.B, &inner.B, nu)]
        {
            to.fill(0.0);
            to.view_mut((0, 0), (n, columns)).copy_from(from);
        }
        knot.S.fill(0.0);
        knot.S.view_mut((0, 0), (n, nu)).copy_from(&inner.S);
        knot.R.copy_from(&inner.R);
        knot.q.fill(0.0);
        knot.q.rows_mut(0, n).copy_from(&inner.q);
        knot.r.copy_from(&inner.r);
        for i in 0..kept {
            if nu == 0 {
                knot.A[(n + i, n + i)] = 1.0; // p⁺ = p
                continue;
            }
            let (w, change) = (self.weights[i], u[i] - p[i]);
            knot.B[(n + i, i)] = 1.0; // p⁺ = u
            knot.q[n + i] = -w * change;
            knot.r[i] += w * change;
            knot.Q[(n + i, n + i)] = w;
            knot.S[(n + i, i)] = -w;
            knot.R[(i, i)] += w;
        }
        knot.rows.append_widened(&inner.rows, n, kept);
    }
}

impl ActionModel for ControlRate {
    fn nx(&self) -> usize {
        self.action.nx() + self.kept()
    }

    fn ndx(&self) -> usize {
        self.action.ndx() + self.kept()
    }

    fn nu(&self) -> usize {
        self.action.nu()
    }

    fn is_terminal(&self) -> bool {
        self.action.is_terminal()
    }

    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.action.bounds(t)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        Some(&mut *self.action)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let mut cost = 0.0;
        let mut results = Results::values(next, slice::from_mut(&mut cost), &mut []);
        self.evaluate(&[t], x, u, Evaluation::Values, &mut results);
        cost
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let mut results = Results::derivatives(slice::from_mut(knot));
        self.evaluate(&[t], x, u, Evaluation::Derivatives, &mut results);
    }

    /// Computes the second derivatives of the wrapped action; p⁺ = u has none.
    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (nx, n) = (self.action.nx(), self.action.ndx());
        if !self.action.dynamics_hessian(t, &x[..nx], u, &lambda[..n], &mut self.hessian) {
            return false;
        }
        hessian.fill(0.0);
        hessian.xx.view_mut((0, 0), (n, n)).copy_from(&self.hessian.xx);
        hessian.xu.view_mut((0, 0), (n, u.len())).copy_from(&self.hessian.xu);
        hessian.uu.copy_from(&self.hessian.uu);
        true
    }

    fn knot_group(&self) -> Option<&dyn KnotGroup> {
        Some(self)
    }

    fn knot_group_mut(&mut self) -> Option<&mut dyn KnotGroup> {
        Some(self)
    }

    fn quasi_static(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        let nx = self.action.nx();
        self.action.quasi_static(t, &x[..nx])
    }

    fn shift(&mut self) {
        self.action.shift();
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        let Self { weights, xs, next, lq_knots, hessian, .. } = self;
        let (weights, [xs, next]) = (weights.clone(), [xs, next].map(Vec::clone));
        let (lq_knots, hessian, action) = (lq_knots.clone(), hessian.clone(), self.action.try_clone()?);
        Some(Box::new(Self { action, weights, xs, next, lq_knots, hessian }))
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        self.action.check_state(&x[..self.action.nx()])
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        let (nx, n) = (self.action.nx(), self.action.ndx());
        self.action.integrate(&x[..nx], &dx[..n], &mut out[..nx]);
        for ((out, p), dp) in out[nx..].iter_mut().zip(&x[nx..]).zip(&dx[n..]) {
            *out = p + dp;
        }
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        let (nx, n) = (self.action.nx(), self.action.ndx());
        self.action.difference(&x0[..nx], &x1[..nx], &mut out[..n]);
        for ((out, p0), p1) in out[n..].iter_mut().zip(&x0[nx..]).zip(&x1[nx..]) {
            *out = p1 - p0;
        }
    }
}

impl KnotGroup for ControlRate {
    fn lanes(&mut self) -> usize {
        lanes(&mut *self.action)
    }

    /// Evaluates as many knots of the wrapped action at a time as it has lanes, and adds p.
    #[track_caller]
    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation<'_>, results: &mut Results<'_>) {
        let (nx, nu, kept, what) = (self.action.nx(), self.action.nu(), self.kept(), what.without_equations());
        let (wide, count) = (nx + kept, knots.len().max(1));
        let shares = [results.motions.len() / count, results.constraints.len() / count];
        for (first, part) in (0..).step_by(self.lq_knots.len()).zip(knots.chunks(self.lq_knots.len())) {
            let each = first..first + part.len();
            let x = |i: usize| &xs[i * wide..][..wide];
            let u = |i: usize| &us[i * nu..][..nu];
            for (to, i) in self.xs.chunks_exact_mut(nx).zip(each.clone()) {
                to.copy_from_slice(&x(i)[..nx]);
            }
            let of_group = |size: usize| each.start * size..each.end * size;
            let (states, controls) = (&self.xs[..part.len() * nx], &us[of_group(nu)]);
            if what != Evaluation::Values {
                let lq_knots = &mut self.lq_knots[..part.len()];
                for knot in &mut *lq_knots {
                    knot.structure.set_dense();
                    knot.rows.clear();
                }
                evaluate(&mut *self.action, part, states, controls, what, &mut Results::derivatives(lq_knots));
                for (inner, i) in self.lq_knots.iter().zip(each) {
                    self.expand(inner, &x(i)[nx..], u(i), &mut results.lq_knots[i]);
                }
                continue;
            }
            let mut inner = Results {
                next: &mut self.next[..part.len() * nx],
                costs: &mut results.costs[each.clone()],
                motions: &mut results.motions[of_group(shares[0])],
                constraints: &mut results.constraints[of_group(shares[1])],
                lq_knots: &mut [],
            };
            evaluate(&mut *self.action, part, states, controls, what, &mut inner);
            for (k, i) in each.enumerate() {
                let (p, u) = (&x(i)[nx..], u(i));
                let next = &mut results.next[i * wide..][..wide];
                next[..nx].copy_from_slice(&self.next[k * nx..][..nx]);
                next[nx..].copy_from_slice(if nu > 0 { u } else { p });
                let squares = self.weights.iter().zip(p.iter().zip(u)).map(|(w, (p, u))| w * (u - p) * (u - p));
                results.costs[i] += 0.5 * squares.sum::<f64>();
            }
        }
    }

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(group) = self.action.knot_group_mut() {
            group.constraints(t, visit);
        }
    }

    fn hold_still(&mut self, x: &[f64], u: &mut [f64]) -> bool {
        let nx = self.action.nx();
        self.action.knot_group_mut().is_some_and(|group| group.hold_still(&x[..nx], u))
    }

    fn has_controls_of(&self, other: &dyn KnotGroup) -> bool {
        self.action.knot_group().is_none_or(|group| group.has_controls_of(other))
    }

    fn duration(&self, t: usize) -> Option<f64> {
        self.action.knot_group()?.duration(t)
    }

    fn dynamics_ref(&self) -> Option<&dyn Any> {
        self.action.knot_group()?.dynamics_ref()
    }
}

/// Limits of the change of the controls.
#[derive(Clone)]
struct RateLimit {
    nx: usize,
    ndx: usize,
    bounds: [Vec<f64>; 2],
}

impl PathConstraint for RateLimit {
    fn size(&self) -> usize {
        self.bounds[0].len()
    }

    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.bounds[0], &self.bounds[1])
    }

    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        for ((g, p), u) in g.iter_mut().zip(&x[self.nx..]).zip(u) {
            *g = u - p;
        }
    }

    fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        gx.fill(0.0);
        gu.fill(0.0);
        for i in 0..self.size() {
            (gx[(i, self.ndx + i)], gu[(i, i)]) = (-1.0, 1.0);
        }
        true
    }

    fn try_clone(&self) -> Option<Box<dyn PathConstraint>> {
        Some(Box::new(self.clone()))
    }
}
