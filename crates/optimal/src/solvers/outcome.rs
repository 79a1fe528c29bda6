//! Outcome of a solve with constraints, and the description of a violated constraint row.

use super::limit_rows::LimitRows;
use core::fmt;
use std::sync::Arc;

/// Result of a solve for its constraints; the trajectory is in the [`Solution`](crate::Solution).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Outcome {
    /// Sum Σ ℓ of the knots' costs, without the penalty terms of the constraints and without `soft_cost`.
    pub cost: f64,
    /// Sum of the costs of all values outside the bounds of soft [`Limit`](crate::robot::Limit)s. The sum of this
    /// number and of `cost` is minimal at a solution.
    pub soft_cost: f64,
    /// Rows of soft limits that are outside their bounds by more than 100 times the tolerance, knot by knot.
    pub gave_way: Vec<Violation>,
    /// Largest distance of a constraint from its bounds, or largest gap of the dynamics, whichever is larger. Soft
    /// limits have no part in it, except in an [`AugmentedLagrangian`](crate::AugmentedLagrangian): there it includes
    /// the difference between a row's distance from its bounds and the distance for which its multiplier pays.
    pub primal: f64,
    /// Constraint or dynamics row with the violation in `primal`: the evidence of [`Status::ConstraintsViolated`].
    /// `None` if all constraints hold exactly. With [`Status::Infeasible`] it is the row that proves infeasibility: the
    /// constraint on x̂₀ with the largest violation.
    ///
    /// [`Status::ConstraintsViolated`]: crate::Status::ConstraintsViolated
    /// [`Status::Infeasible`]: crate::Status::Infeasible
    pub worst: Option<Violation>,
    /// Largest entry of the gradient of the Lagrangian with respect to controls and states, projected on the bounds of
    /// the controls. The multipliers of the dynamics are adjoint states of the trajectory or of its closed loop with
    /// the gains of the last sweep, whichever gives the smaller gradient.
    pub dual: f64,
    /// Multipliers y of each knot: positive at an upper bound, negative at a lower bound, empty at a knot without
    /// constraints. At a robot's knot, the multipliers of its [`Limit`](crate::robot::Limit)s come first, in the order
    /// of the limits. The multipliers of a [`Constrained`](crate::Constrained) action that contains the robot's action
    /// follow. For an [`InteriorPoint`](crate::InteriorPoint), the multipliers of the bounds on controls are last.
    pub multipliers: Vec<Vec<f64>>,
    /// Rows of `multipliers` that belong to each named limit, knot by knot. [`multipliers_of`](Self::multipliers_of)
    /// uses them.
    pub limits: Vec<LimitRows>,
    /// Penalty 1/μ at the end of the solve, of rows whose bounds do not exceed 1.
    pub penalty: f64,
    /// Barrier parameter μ at the end of a solve by an interior point; 0 for other solvers.
    pub barrier: f64,
    /// Number of inner solves.
    pub solves: usize,
    /// Number of iterations of all inner solves.
    pub iterations: usize,
}

/// Kind of a [`Violation`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ViolationKind {
    /// Constraint of a knot: a robot's [`Limit`](crate::robot::Limit) or a [`PathConstraint`](crate::PathConstraint).
    Constraint,
    /// Bound on a control ([`bounds`](crate::ActionModel::bounds)); `row` is the index of the control.
    ControlBound,
    /// Gap of the dynamics: f₀ = x̂₀ ⊖ x₀ at knot 0, else fₜ = φ(xₜ₋₁, uₜ₋₁) ⊖ xₜ.
    Gap,
}

/// Violated row of a constraint or of the dynamics at the end of a solve.
///
/// ```
/// # use condyle_dynamics::robots;
/// # use condyle_optimal::robot::{FreeDynamics, Limit, Residual};
/// # use condyle_optimal::{AugmentedLagrangian, Problem, Status};
/// # use std::sync::Arc;
/// # let arm = Arc::new(robots::arm7());
/// # let x0 = vec![0.0; 14];
/// // the arm begins at rest, but a limit requires at least 0.5 rad of its third joint
/// let mut lower = vec![f64::NEG_INFINITY; 14];
/// lower[2] = 0.5;
/// let bent = Limit::new("bent", Residual::State { reference: x0.clone() }, lower, vec![f64::INFINITY; 14]);
/// let knot = FreeDynamics::running(arm.clone(), 0.05, vec![])?.with_limits(vec![bent])?;
/// let end = FreeDynamics::terminal(arm, vec![])?;
/// # let mut knot = knot;
/// # let us = knot.quasi_static(&x0).repeat(5);
/// let mut problem = Problem::new(x0.clone(), vec![Box::new(knot)], vec![0; 5], Box::new(end))?;
/// let mut solver = AugmentedLagrangian::new(&problem);
/// # solver.settings.max_solves = 2;
/// let status = solver.solve(&mut problem, &x0.repeat(6), &us)?.status;
/// assert_eq!(status, Status::Infeasible);
/// let worst = solver.outcome().worst.as_ref().unwrap();
/// assert_eq!(worst.to_string(), "knot 0: entry 2 of `bent` is 5.000e-1 beyond its bound");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Violation {
    /// Kind of the row: constraint or gap.
    pub kind: ViolationKind,
    /// Index of the knot, 0 … N.
    pub knot: usize,
    /// Index of the row. A constraint has the index of its multiplier in the knot's
    /// [`Outcome::multipliers`](crate::Outcome::multipliers). A gap has the index of its entry in the tangent vector.
    pub row: usize,
    /// Name of the [`Limit`](crate::robot::Limit), if the row belongs to one.
    pub name: Option<Arc<str>>,
    /// Index of the row within the named limit; without a name, equal to `row`.
    pub entry: usize,
    /// Description of the row: the two geometries of a limit of distances; `None` for other rows.
    pub what: Option<Arc<str>>,
    /// Distance from the bound, or size of the gap, in the units of the row; infinite if it is NaN.
    pub amount: f64,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, knot, row, name, entry, what, amount } = self;
        match (kind, name, what) {
            (ViolationKind::Gap, ..) => write!(f, "knot {knot}: entry {row} of the gap is {amount:.3e}"),
            (ViolationKind::ControlBound, ..) => {
                write!(f, "knot {knot}: control {row} is {amount:.3e} beyond its bound")
            }
            (_, Some(name), Some(pair)) => {
                write!(f, "knot {knot}: distance of {pair} in `{name}` is {amount:.3e} beyond its bound")
            }
            (_, Some(name), None) => {
                write!(f, "knot {knot}: entry {entry} of `{name}` is {amount:.3e} beyond its bound")
            }
            (_, None, _) => write!(f, "knot {knot}: constraint {row} is {amount:.3e} beyond its bound"),
        }
    }
}
