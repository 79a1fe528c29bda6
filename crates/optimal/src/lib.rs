//! Solution of optimal control problems over a horizon: computes the controls that minimise a sum of costs along a
//! trajectory.
//!
//! ```text
//! minimise   ℓ_N(x_N) + Σₜ ℓₜ(xₜ, uₜ)      subject to   x₀ = x̂₀,   xₜ₊₁ = φₜ(xₜ, uₜ),   t = 0 … N − 1
//! ```
//!
//! # Overview
//! - An [`ActionModel`] is one knot's dynamics φ and cost ℓ with their derivatives. A [`GroupModel`] computes several
//!   knots, or several step lengths of one knot, in one call.
//! - A [`Problem`] is a horizon of action models.
//! - The problem around a trajectory is approximated as linear-quadratic in the changes δx, δu. Each knot is then an
//!   [`LqKnot`]. The [`Sweep`] solves this problem from the last knot to the first, and computes feedback gains and
//!   value functions.
//! - [`Fddp`] repeats derivatives, sweep and line search until the trajectory is optimal, and returns a [`Solution`]:
//!   the trajectory, its feedback, a [`Status`], and a record of each [`Iteration`]. Controls may be bounded.
//! - [`InteriorPoint`] imposes general constraints by slack variables and a barrier: the constraints of [`Constrained`]
//!   actions, a robot's [`Limit`](robot::Limit)s and bounds on controls. Each iteration is one sweep.
//!   [`tick`](InteriorPoint::tick) makes a fixed number of sweeps, for model-predictive control.
//! - [`AugmentedLagrangian`] imposes the same constraints by repeated solves with [`Fddp`].
//! - [`BatchFddp`] solves many problems, several at a time in SIMD lanes. [`OneByOne`] solves many problems by any of
//!   these solvers, one at a time on each thread.
//! - [`Sensitivity`] differentiates a solution with respect to initial state, targets, weights and other parameters,
//!   and [`Sensitivities`] many solutions in SIMD lanes. A [`Parameter`] is a vector with a name, which
//!   [`Problem::set_parameter`] sets without building the problem again.
//! - [`Lqr`] is linear dynamics with a quadratic cost, as an action; [`Unicycle`] is a unicycle as an action.
//! - [`ControlRate`] adds a cost, and limits, of the change of the controls from knot to knot to any action.
//! - [`AutoDiff`] turns dynamics and a cost that are generic over the scalar type into an action with exact derivatives
//!   by dual numbers. [`AutoDiffConstraint`] does the same for a path constraint, [`robot::OwnResidual::autodiff`] for
//!   a robot's residual.
//! - [`NumDiff`] differentiates any action by finite differences: a reference for tests of hand-written derivatives.
//!
//! Only the module [`robot`] depends on robots. In all other modules a state is a list of nx numbers, and a change of a
//! state is a list of ndx numbers. An action may define how a change is added to a state, ⊕
//! ([`integrate`](ActionModel::integrate)), and how two states are subtracted, ⊖
//! ([`difference`](ActionModel::difference)).
//!
//! # Conventions
//! - Trajectories are flat: the states x₀ … x_N one after the other, and the controls u₀ … u_{N−1}. A control has nu
//!   numbers; nu may differ from knot to knot.
//! - Derivatives are taken in the tangent space: A = ∂φ/∂x is ndx × ndx, whatever nx is.
//! - The gap at a knot is f = φ(x, u) ⊖ x⁺; at the start x̂₀ ⊖ x₀. A warm start may have gaps.
//! - The feedback is u = ū + α k + K (x ⊖ x̄), where x̄, ū is the trajectory, α the step length, k the feed-forward
//!   term and K the gain. In Crocoddyl, k and K have the opposite sign; otherwise [`Fddp`] and Crocoddyl's `SolverFDDP`
//!   produce the same iterates.
//! - Problems, solvers and solutions are `Send` and `Sync`. A problem is copied by [`Problem::try_clone`].
//! - A wrong shape in the arguments of a call is a fault of the program: it panics at the caller's line, with the
//!   argument's name. A wrong problem, warm start or setting is an [`Error`] before a solve begins. The outcome of a
//!   solve is its [`Status`].
//!
//! # Example
//! A pendulum swings up, from hanging (θ = 0) to upright (θ = π).
//! ```
//! use condyle_optimal::{ActionModel, Fddp, Iteration, Problem, Status};
//!
//! /// x = (θ, θ̇), u = torque: θ̈ = u − sin θ, by semi-implicit Euler steps of 0.1 s.
//! struct Pendulum { terminal: bool }
//!
//! impl ActionModel for Pendulum {
//!     fn nx(&self) -> usize { 2 }
//!     fn nu(&self) -> usize { if self.terminal { 0 } else { 1 } }
//!     fn calc(&mut self, _t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
//!         if self.terminal {
//!             let (angle, rate) = (x[0] - std::f64::consts::PI, x[1]);
//!             return 50.0 * (angle * angle + rate * rate);
//!         }
//!         next[1] = x[1] + 0.1 * (u[0] - x[0].sin()); // θ̇⁺ = θ̇ + Δt (u − sin θ)
//!         next[0] = x[0] + 0.1 * next[1];             // θ⁺ = θ + Δt θ̇⁺
//!         0.5 * 0.1 * u[0] * u[0]                     // ℓ = ½ Δt u²
//!     }
//! }
//!
//! let (knot, end) = (Pendulum { terminal: false }, Pendulum { terminal: true }); // differentiated by differences
//! let mut problem = Problem::new(vec![0.0, 0.0], vec![Box::new(knot)], vec![0; 40], Box::new(end))?;
//!
//! let mut solver = Fddp::new(&problem);
//! let solution = solver.solve_with(&mut problem, &[0.0; 2 * 41], &[0.0; 40], |iteration: &Iteration| {
//!     println!("{:3}  cost {:9.6}  step {}", iteration.iteration, iteration.cost, iteration.step);
//! })?;
//!
//! assert_eq!(solution.status, Status::Converged);
//! assert!((solution.x(40)[0] - std::f64::consts::PI).abs() < 0.05);
//! # Ok::<(), condyle_optimal::Error>(())
//! ```
#![cfg_attr(docsrs, feature(doc_cfg))]

mod error;
mod lq;
mod problem;
#[cfg(feature = "serde")]
mod read;
#[cfg(feature = "serde")]
pub mod record;
pub mod robot;
mod sensitivity;
mod solvers;
mod time;

pub use error::Error;
pub use lq::{
    ConstraintRow, ConstraintRows, DynamicsStructure, EulerBlock, Hessian, KnotFeedback, LqKnot, Sweep, SweepError,
};
pub use nalgebra;
pub use problem::{
    ActionModel, AutoDiff, AutoDiffConstraint, Constrained, ControlRate, GenericAction, GenericConstraint, GroupModel,
    Lqr, NumDiff, PathConstraint, Problem, RolloutResults, Rollouts, Schedule, Unicycle,
};
pub use sensitivity::{
    Adjoint, Curvature, Parameter, ParameterJacobian, ParameterValues, Sensitivities, Sensitivity, SensitivityReport,
    SensitivitySettings, SolutionJacobian, WeakestBound,
};
pub use solvers::{
    AugmentedLagrangian, BatchFddp, ConstraintSettings, DdpMethod, Fallback, Fddp, InteriorPoint,
    InteriorPointSettings, Iteration, LimitRows, ManyProblems, Observer, OneByOne, Outcome, PlanPoint, Policy,
    PolicyPoint, PolicyPublisher, Settings, SingleSolver, Solution, StateSpace, Status, Timings, Verdict, Violation,
    ViolationKind,
};
#[cfg(all(target_arch = "wasm32", target_os = "unknown"))]
pub use time::set_clock;

/// Code block of the README, run as a doctest.
#[cfg(all(doctest, feature = "loaders"))]
#[doc = include_str!("../README.md")]
mod readme {}
