//! General constraints on states and controls, as terms of an augmented Lagrangian.
#![allow(non_snake_case)]

use crate::action::ActionModel;
use crate::error::{Error, assert_length};
use crate::lq::{Hessian, LqNode};
use crate::problem::Problem;
use nalgebra::DMatrix;
use std::any::Any;

/// Functions of state and control that must stay within bounds: lower ≤ gₜ(x, u) ≤ upper; equalities where both are equal.
///
/// At a terminal knot u is empty. The rules for [`ActionModel`]s hold here too.
///
/// # Examples
/// The second number of the state may not exceed 1:
/// ```
/// use condyle_optimal::Constraint;
/// use nalgebra::DMatrix;
///
/// struct Slow;
/// impl Constraint for Slow {
///     fn size(&self) -> usize { 1 }
///     fn bounds(&self, _: usize) -> (&[f64], &[f64]) { (&[f64::NEG_INFINITY], &[1.0]) }
///     fn calc(&mut self, _: usize, x: &[f64], _: &[f64], g: &mut [f64]) { g[0] = x[1]; }
///     fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) {
///         gx.copy_from_slice(&[0.0, 1.0]);
///         gu.fill(0.0);
///     }
/// }
/// ```
pub trait Constraint: Any + Send {
    /// The number of functions.
    fn size(&self) -> usize;

    /// Their least and their greatest values at knot t, infinite where there is none. They must not change during a solve.
    fn bounds(&self, t: usize) -> (&[f64], &[f64]);

    /// gₜ(x, u) into `g`.
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]);

    /// ∂g/∂x into `gx` (size × ndx), in the tangent space of the state, and ∂g/∂u into `gu` (size × nu).
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>);
}

/// An action with constraints. To its cost comes, with the multipliers y and the penalty 1/μ that
/// [`AugmentedLagrangian`](crate::AugmentedLagrangian) chooses,
///
/// ```text
/// (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖²,      z = g(x, u) + μ y,      Π: into the bounds
/// ```
///
/// whose Hessian is that of Gauss and Newton. A solver that knows nothing of constraints sees a cost for leaving the
/// bounds.
pub struct Constrained {
    action: Box<dyn ActionModel>,
    constraint: Box<dyn Constraint>,
    mu: f64,
    /// y of each knot; zero beyond its end.
    multipliers: Vec<f64>,
    /// g, and then z − Π z.
    g: Vec<f64>,
    gx: DMatrix<f64>,
    gu: DMatrix<f64>,
}

/// 1/μ before a solve has chosen one.
const PENALTY: f64 = 10.0;

impl Constrained {
    /// `action` under `constraint`, at all knots that it serves.
    pub fn new(action: Box<dyn ActionModel>, constraint: Box<dyn Constraint>) -> Self {
        let (size, ndx, nu) = (constraint.size(), action.ndx(), action.nu());
        let (gx, gu) = (DMatrix::zeros(size, ndx), DMatrix::zeros(size, nu));
        Self { action, constraint, mu: 1.0 / PENALTY, multipliers: vec![], g: vec![0.0; size], gx, gu }
    }

    /// The action, if it is a `T`.
    pub fn action_mut<T: ActionModel>(&mut self) -> Option<&mut T> {
        let action: &mut dyn Any = self.action.as_mut();
        action.downcast_mut()
    }

    /// The constraint, if it is a `T`.
    pub fn constraint_mut<T: Constraint>(&mut self) -> Option<&mut T> {
        let constraint: &mut dyn Any = self.constraint.as_mut();
        constraint.downcast_mut()
    }

    /// The number of constraints.
    fn size(&self) -> usize {
        self.g.len()
    }

    /// z − Π z into `g`; returns the largest violation, the distance of g from its bounds, and the term of the cost.
    pub(crate) fn evaluate(&mut self, t: usize, x: &[f64], u: &[f64]) -> (f64, f64) {
        let size = self.size();
        self.constraint.calc(t, x, u, &mut self.g);
        let (lower, upper) = self.constraint.bounds(t);
        let y = self.multipliers.get(t * size..(t + 1) * size);
        let (mut violation, mut term) = (0.0_f64, 0.0);
        for i in 0..size {
            let (g, y) = (self.g[i], y.map_or(0.0, |y| y[i]));
            let z = g + self.mu * y;
            let outside = |z: f64| match z {
                z if z > upper[i] => z - upper[i],
                z if z >= lower[i] => 0.0,
                z => z - lower[i], // a NaN stays one
            };
            violation = violation.max(outside(g).abs());
            self.g[i] = outside(z);
            term += 0.5 * (self.g[i] * self.g[i] / self.mu - self.mu * y * y);
        }
        // `max` above drops a NaN, the sum does not
        (if term.is_nan() { f64::NAN } else { violation }, term)
    }

    /// y ← (z − Π z) / μ, from the last `evaluate` at knot t.
    fn update_multipliers(&mut self, t: usize) {
        let size = self.size();
        for i in 0..size {
            self.multipliers[t * size + i] = self.g[i] / self.mu;
        }
    }

    /// The gradient and the Gauss–Newton Hessian of the term: w = (z − Π z) / μ,  q += gₓᵀ w,  Q += gₓᵀ D gₓ / μ, …, where D
    /// is 1 for the functions outside of their bounds.
    fn add_derivatives(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        _ = self.evaluate(t, x, u);
        self.constraint.calc_diff(t, x, u, &mut self.gx, &mut self.gu);
        let (lower, upper) = self.constraint.bounds(t);
        let (ndx, nu) = (self.gx.ncols(), self.gu.ncols());
        for i in 0..self.g.len() {
            if self.g[i] == 0.0 && lower[i] < upper[i] {
                continue;
            }
            let (w, d) = (self.g[i] / self.mu, 1.0 / self.mu);
            for a in 0..ndx {
                let ga = self.gx[(i, a)];
                if ga != 0.0 {
                    node.q[a] += ga * w;
                    for b in 0..ndx {
                        node.Q[(b, a)] += d * ga * self.gx[(i, b)];
                    }
                    for b in 0..nu {
                        node.S[(a, b)] += d * ga * self.gu[(i, b)];
                    }
                }
            }
            for a in 0..nu {
                let ga = self.gu[(i, a)];
                if ga != 0.0 {
                    node.r[a] += ga * w;
                    for b in 0..nu {
                        node.R[(b, a)] += d * ga * self.gu[(i, b)];
                    }
                }
            }
        }
    }
}

impl ActionModel for Constrained {
    fn nx(&self) -> usize {
        self.action.nx()
    }

    fn ndx(&self) -> usize {
        self.action.ndx()
    }

    fn nu(&self) -> usize {
        self.action.nu()
    }

    fn lanes(&self) -> usize {
        self.action.lanes()
    }

    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.action.bounds(t)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let cost = self.action.calc(t, x, u, next);
        cost + self.evaluate(t, x, u).1
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        self.action.calc_diff(t, x, u, node);
        self.add_derivatives(t, x, u, node);
    }

    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        let (nx, nu) = (self.nx(), self.nu());
        self.action.calc_group(knots, xs, us, next, costs);
        for (i, &t) in knots.iter().enumerate() {
            costs[i] += self.evaluate(t, &xs[i * nx..][..nx], &us[i * nu..][..nu]).1;
        }
    }

    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], nodes: &mut [LqNode]) {
        let (nx, nu) = (self.nx(), self.nu());
        assert_length("nodes", nodes.len(), knots.len());
        self.action.calc_diff_group(knots, xs, us, nodes);
        for (i, &t) in knots.iter().enumerate() {
            self.add_derivatives(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut nodes[i]);
        }
    }

    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        self.action.dynamics_hessian(t, x, u, lambda, hessian)
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.action.integrate(x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.action.difference(x0, x1, out);
    }
}

impl Problem {
    /// The model of knot t, if it is a constrained one.
    pub(crate) fn constrained(&mut self, t: usize) -> Option<&mut Constrained> {
        let action: &mut dyn Any = self.action_mut(t);
        action.downcast_mut()
    }

    /// Multipliers of zero everywhere, and the penalty 1/μ.
    ///
    /// # Errors
    /// [`Error`] if bounds have a wrong length or leave no value.
    pub(crate) fn start_constraints(&mut self, mu: f64) -> Result<(), Error> {
        let horizon = self.horizon();
        for knot in 0..=horizon {
            let Some(constrained) = self.constrained(knot) else { continue };
            let expected = constrained.size();
            let (lower, upper) = constrained.constraint.bounds(knot);
            for (name, found) in [("lower bounds", lower.len()), ("upper bounds", upper.len())] {
                if found != expected {
                    return Err(Error::Dimension { node: knot, name, expected, found });
                }
            }
            for (row, (&lower, &upper)) in lower.iter().zip(upper).enumerate() {
                // false for NaN
                if !(lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY) {
                    return Err(Error::Constraint { knot, row, lower, upper });
                }
            }
            constrained.multipliers.resize((horizon + 1) * expected, 0.0);
            constrained.multipliers.fill(0.0);
            constrained.mu = mu;
        }
        Ok(())
    }

    /// The penalty 1/μ.
    pub(crate) fn set_penalty(&mut self, mu: f64) {
        for knot in 0..=self.horizon() {
            if let Some(constrained) = self.constrained(knot) {
                constrained.mu = mu;
            }
        }
    }

    /// y ← (z − Π z) / μ at the trajectory (xs, us).
    pub(crate) fn update_multipliers(&mut self, xs: &[f64], us: &[f64]) {
        for knot in 0..=self.horizon() {
            let (x, u) = (self.shape().x(knot), self.shape().u(knot));
            if let Some(constrained) = self.constrained(knot) {
                _ = constrained.evaluate(knot, &xs[x], &us[u]);
                constrained.update_multipliers(knot);
            }
        }
    }

    /// y of knot t.
    pub(crate) fn multipliers(&mut self, t: usize) -> Vec<f64> {
        let of = |c: &mut Constrained| c.multipliers[t * c.size()..(t + 1) * c.size()].to_vec();
        self.constrained(t).map(of).unwrap_or_default()
    }
}
