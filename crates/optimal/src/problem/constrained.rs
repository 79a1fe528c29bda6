//! Action with constraints, which become terms of an augmented Lagrangian.

use super::action::ActionModel;
use super::group::{Evaluation, KnotGroup, Results, constraint_count, evaluate, lanes};
use super::multipliers::{Bounded, Multipliers, Visit};
use super::path_constraint::{self, PathConstraint};
use crate::lq::{ConstraintRow, ConstraintRows, Hessian, LqKnot};
use core::fmt;
use nalgebra::DMatrix;
use std::any::Any;

/// Action with constraints lower ≤ g(x, u) ≤ upper. The following term is added to its cost.
/// [`AugmentedLagrangian`](crate::AugmentedLagrangian) sets the multipliers y and the penalty 1/μ:
///
/// ```text
/// (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖²,      z = g(x, u) + μ y,      Π: projection on the bounds
/// ```
///
/// The Hessian of the term is the Gauss–Newton approximation. A solver without support for constraints treats the term
/// as an ordinary cost of values outside the bounds. For a robot's residuals see [`Limit`](crate::robot::Limit), which
/// computes the dynamics once for cost and constraints.
pub struct Constrained {
    action: Box<dyn ActionModel>,
    constraint: Box<dyn PathConstraint>,
    multipliers: Multipliers,
    g: Vec<f64>,
    /// First derivatives of the term with respect to g; the next field contains the second derivatives.
    d: Vec<f64>,
    dd: Vec<f64>,
    gx: DMatrix<f64>,
    gu: DMatrix<f64>,
    /// One row [∂g/∂x ∂g/∂u]. Shape: ndx + nu.
    row: Vec<f64>,
}

impl Constrained {
    /// Creates an action that adds `constraint` to `action`, at all knots that use the action.
    pub fn new(action: Box<dyn ActionModel>, constraint: Box<dyn PathConstraint>) -> Self {
        let (size, ndx, nu) = (constraint.size(), action.ndx(), action.nu());
        let (gx, gu) = (DMatrix::zeros(size, ndx), DMatrix::zeros(size, nu));
        let [g, d, dd] = [(); 3].map(|()| vec![0.0; size]);
        let row = Vec::with_capacity(ndx + nu);
        Self { action, constraint, multipliers: Multipliers::new(size), g, d, dd, gx, gu, row }
    }

    /// Returns the wrapped action, if its type is `T`.
    pub fn action_mut<T: ActionModel>(&mut self) -> Option<&mut T> {
        let action: &mut dyn Any = self.action.as_mut();
        action.downcast_mut()
    }

    /// Returns the constraint, if its type is `T`.
    pub fn constraint_mut<T: PathConstraint>(&mut self) -> Option<&mut T> {
        let constraint: &mut dyn Any = self.constraint.as_mut();
        constraint.downcast_mut()
    }

    /// Computes the term that the constraints add to the action's cost.
    fn term(&mut self, t: usize, x: &[f64], u: &[f64]) -> f64 {
        self.constraint.calc(t, x, u, &mut self.g);
        let (lower, upper) = self.constraint.bounds(t);
        self.multipliers.value(t, 0, &self.g, [lower, upper], None)
    }

    /// Computes g and its Jacobians ∂g/∂x and ∂g/∂u.
    fn differentiate(&mut self, t: usize, x: &[f64], u: &[f64]) {
        let Self { action, constraint, g, gx, gu, .. } = self;
        constraint.calc(t, x, u, g);
        if !constraint.calc_diff(t, x, u, gx, gu) {
            path_constraint::calc_diff(&**action, &mut **constraint, t, x, u, [gx, gu]);
        }
    }

    /// Appends the constraints to the rows of a knot.
    fn push_rows(&mut self, t: usize, x: &[f64], u: &[f64], rows: &mut ConstraintRows) {
        self.differentiate(t, x, u);
        let Self { constraint, g, gx, gu, row, .. } = self;
        let (lower, upper) = constraint.bounds(t);
        for (i, &c) in g.iter().enumerate() {
            row.clear();
            row.extend(gx.row(i).iter().chain(gu.row(i).iter()));
            rows.push(ConstraintRow { first: 0, entries: row, c, lower: lower[i], upper: upper[i] });
        }
    }

    /// Adds the gradient and the Gauss–Newton Hessian of the constraints' term: q += gₓᵀ d, Q += gₓᵀ D gₓ, and likewise
    /// r, R and S. Here d and D are the term's first and second derivatives with respect to g.
    fn add_derivatives(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.differentiate(t, x, u);
        let (lower, upper) = self.constraint.bounds(t);
        self.multipliers.begin(t);
        self.multipliers.slopes(t, 0, &self.g, [lower, upper], None, [&mut self.d, &mut self.dd]);
        let (ndx, nu) = (self.gx.ncols(), self.gu.ncols());
        for i in 0..self.g.len() {
            let (w, d) = (self.d[i], self.dd[i]);
            if d == 0.0 {
                continue;
            }
            for a in 0..ndx {
                let ga = self.gx[(i, a)];
                if ga != 0.0 {
                    knot.q[a] += ga * w;
                    for b in 0..ndx {
                        knot.Q[(b, a)] += d * ga * self.gx[(i, b)];
                    }
                    for b in 0..nu {
                        knot.S[(a, b)] += d * ga * self.gu[(i, b)];
                    }
                }
            }
            for a in 0..nu {
                let ga = self.gu[(i, a)];
                if ga != 0.0 {
                    knot.r[a] += ga * w;
                    for b in 0..nu {
                        knot.R[(b, a)] += d * ga * self.gu[(i, b)];
                    }
                }
            }
        }
    }
}

impl fmt::Debug for Constrained {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (nx, nu, constraints) = (self.nx(), self.nu(), self.g.len());
        f.debug_struct("Constrained").field("nx", &nx).field("nu", &nu).field("constraints", &constraints).finish()
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

    fn is_terminal(&self) -> bool {
        self.action.is_terminal()
    }

    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.action.bounds(t)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let cost = self.action.calc(t, x, u, next);
        cost + self.term(t, x, u)
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.action.calc_diff(t, x, u, knot);
        self.add_derivatives(t, x, u, knot);
    }

    fn knot_group(&self) -> Option<&dyn KnotGroup> {
        Some(self)
    }

    fn knot_group_mut(&mut self) -> Option<&mut dyn KnotGroup> {
        Some(self)
    }

    fn shift(&mut self) {
        self.action.shift();
    }

    fn quasi_static(&mut self, t: usize, x: &[f64]) -> Vec<f64> {
        self.action.quasi_static(t, x)
    }

    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        Some(&mut *self.action)
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        let (action, constraint) = (self.action.try_clone()?, self.constraint.try_clone()?);
        let Self { multipliers, g, d, dd, gx, gu, row, .. } = self;
        let (multipliers, [g, d, dd]) = (multipliers.clone(), [g, d, dd].map(Vec::clone));
        let (gx, gu, row) = (gx.clone(), gu.clone(), Vec::with_capacity(row.capacity()));
        Some(Box::new(Self { action, constraint, multipliers, g, d, dd, gx, gu, row }))
    }

    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        self.action.dynamics_hessian(t, x, u, lambda, hessian)
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        self.action.check_state(x)
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.action.integrate(x, dx, out);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.action.difference(x0, x1, out);
    }
}

impl KnotGroup for Constrained {
    fn lanes(&mut self) -> usize {
        lanes(&mut *self.action)
    }

    /// Evaluates a group of knots of the action, and adds the constraints' term to the cost of each knot.
    #[track_caller]
    fn evaluate(&mut self, knots: &[usize], xs: &[f64], us: &[f64], what: Evaluation<'_>, results: &mut Results<'_>) {
        let (nx, nu) = (self.nx(), self.nu());
        let what = what.without_equations();
        evaluate(&mut *self.action, knots, xs, us, what, results);
        let room = results.constraints.len() / knots.len().max(1);
        for (i, &t) in knots.iter().enumerate() {
            let (x, u) = (&xs[i * nx..][..nx], &us[i * nu..][..nu]);
            match what {
                Evaluation::Values if room > 0 => {
                    let (first, size) = (constraint_count(&mut *self.action, t), self.constraint.size());
                    self.constraint.calc(t, x, u, &mut results.constraints[i * room + first..][..size]);
                }
                Evaluation::Values => results.costs[i] += self.term(t, x, u),
                Evaluation::Rows => self.push_rows(t, x, u, &mut results.lq_knots[i].rows),
                _ => self.add_derivatives(t, x, u, &mut results.lq_knots[i]),
            }
        }
    }

    fn hold_still(&mut self, x: &[f64], u: &mut [f64]) -> bool {
        self.action.knot_group_mut().is_some_and(|group| group.hold_still(x, u))
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

    fn constraints(&mut self, t: usize, visit: &mut Visit<'_>) {
        if let Some(group) = self.action.knot_group_mut() {
            group.constraints(t, visit);
        }
        let (lower, upper) = self.constraint.bounds(t);
        visit(Bounded { count: self.g.len(), lower, upper, parts: &[], multipliers: &mut self.multipliers });
    }
}
