//! Solutions: the trajectory, its feedback, how the solve ended and what happened on the way.
#![allow(non_snake_case)] // K beside k, the names of the literature

use crate::problem::{Problem, Shape};
use core::fmt;
use core::ops::{AddAssign, Range};
use nalgebra::{DMatrix, DVector};
#[cfg(feature = "serde")]
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::time::Duration;

/// The outcome of a solve. Whatever it says, the [`Solution`] holds the best iterate found: a converged one; else, of those
/// from which a step could be computed and of the last one, the one with the smallest gap, and among equals that of least
/// cost. An iterate within the bounds on controls precedes a warm start outside. An iterate has diverged, and is no candidate,
/// if its cost exceeds the lowest of the solve by more than 1e8·(1 + |lowest|).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Status {
    /// The iterate has no gaps and the expected decrease of its cost is below the tolerance.
    Converged,
    /// The allowed iterations are spent.
    MaxIterations,
    /// The time allowed is over, or what is left of it is too short to go on.
    TimeLimit,
    /// An [`Observer`](crate::Observer) has ended the solve.
    Interrupted,
    /// The regularisation reached its largest value: no descent direction or no acceptable step was found.
    RegularisationLimit,
    /// The penalty reached its limit and constraints are still violated. This proves nothing: another warm start, or a
    /// larger penalty, may find a solution. [`Outcome::worst`](crate::Outcome::worst) is the largest violation.
    ConstraintsViolated,
    /// No solution exists, and [`Outcome::worst`](crate::Outcome::worst) is the proof: the initial state x̂₀ itself violates a
    /// constraint of knot 0 that is known to depend on no control: a built-in residual of the state alone. The solution is that under the other constraints, as far as the
    /// solve came.
    Infeasible,
    /// Cost, dynamics or derivatives of the last iterate are infinite or NaN, so that no direction can be computed. The
    /// solution is the best iterate before it; if it is the warm start itself, its cost may be infinite. States and controls
    /// are finite. Another warm start may help, such as x̂₀ held still ([`Problem::quasi_static`](crate::Problem::quasi_static)).
    NotFinite,
}

impl Status {
    /// Returns the name, as files and Python have it: `"converged"`, `"max_iterations"` and so on.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::MaxIterations => "max_iterations",
            Self::TimeLimit => "time_limit",
            Self::Interrupted => "interrupted",
            Self::RegularisationLimit => "regularisation_limit",
            Self::ConstraintsViolated => "constraints_violated",
            Self::Infeasible => "infeasible",
            Self::NotFinite => "not_finite",
        }
    }
}

/// Writes the status as a short phrase.
impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Converged => "converged",
            Self::MaxIterations => "reached the limit of iterations",
            Self::TimeLimit => "ran out of time",
            Self::Interrupted => "was interrupted",
            Self::RegularisationLimit => "found no step that lowers the cost",
            Self::ConstraintsViolated => "constraints are violated",
            Self::Infeasible => "no trajectory satisfies the constraints",
            Self::NotFinite => "cost or derivatives are not finite",
        })
    }
}

/// A record of one iteration.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Iteration {
    /// Its number, from 0.
    pub iteration: usize,
    /// Cost of the iterate after the step.
    pub cost: f64,
    /// Largest gap, ‖f‖∞, of the iterate before the step.
    pub gap: f64,
    /// |d₁ + ½ d₂|, the decrease of the cost expected of the full step; compared with the tolerance.
    pub stop: f64,
    /// The step length α tried last, which is the accepted one if one was.
    pub step: f64,
    /// Regularisation after the iteration.
    pub regularisation: f64,
    /// Slope of the expected change: the cost should fall by α (d₁ + ½ α d₂).
    pub d1: f64,
    /// Curvature of the expected change.
    pub d2: f64,
    /// The decrease of the cost with the step tried last.
    pub decrease: f64,
    /// The decrease that was expected.
    pub expected_decrease: f64,
    /// Whether the iterate after the step satisfies the dynamics.
    pub feasible: bool,
    /// Whether a step was accepted; if not, the iterate is as before.
    pub accepted: bool,
}

/// Durations of the phases of a solve: of an [`AugmentedLagrangian`](crate::AugmentedLagrangian) of all inner solves together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Timings {
    /// Dynamics and cost of the warm start.
    pub calc: Duration,
    /// Derivatives; on several threads, as long as the sweep beside them waited or computed some itself.
    pub calc_diff: Duration,
    /// Backward sweeps, repeated ones included.
    pub sweep: Duration,
    /// Trial rollouts of the line searches, accepted or not.
    pub rollout: Duration,
    /// The whole solve, observer included.
    pub total: Duration,
    /// The time beyond [`Settings::time_budget`](crate::Settings::time_budget), zero if the solve ended in time: above zero
    /// where the budget is shorter than the first iteration, or a phase lasted longer than predicted. A budget of zero asks
    /// for no iteration, and is never overrun.
    #[cfg_attr(feature = "serde", serde(default))]
    pub overrun: Duration,
}

/// Adds the phases of another part of the same solve. `total` and `overrun` are set at its end.
impl AddAssign for Timings {
    fn add_assign(&mut self, part: Self) {
        self.calc += part.calc;
        self.calc_diff += part.calc_diff;
        self.sweep += part.sweep;
        self.rollout += part.rollout;
    }
}

impl Timings {
    /// Sets the duration of the whole solve, and its excess over a budget.
    pub(crate) fn end(&mut self, total: Duration, budget: Option<Duration>) {
        self.total = total;
        let budget = budget.filter(|budget| !budget.is_zero());
        self.overrun = budget.map_or(Duration::ZERO, |budget| total.saturating_sub(budget));
    }
}

/// The result of a solve. One that is read from a file is checked: its parts have the lengths of one horizon.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(remote = "Self"))] // the fields; the implementations below check them
pub struct Solution {
    /// States x₀ … x_N, flat: (N + 1)·nx.
    pub xs: Vec<f64>,
    /// Controls u₀ … u_{N−1}, flat.
    pub us: Vec<f64>,
    /// Feedback gains of the last sweep, per knot nu × ndx: uₜ + Kₜ (x ⊖ xₜ) is the control near the trajectory.
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::read::matrices"))]
    pub K: Vec<DMatrix<f64>>,
    /// Feed-forward of the last sweep, per knot nu: the full step it asked for.
    pub k: Vec<DVector<f64>>,
    /// Cost of the trajectory; infinite if it is not a number.
    pub cost: f64,
    /// Largest gap of the trajectory, ‖f‖∞; infinite if it is not a number.
    pub gap: f64,
    /// Whether the trajectory satisfies the dynamics: it is a plain rollout from x̂₀.
    pub feasible: bool,
    /// Regularisation at the end.
    pub regularisation: f64,
    /// The outcome of the solve.
    pub status: Status,
    /// A record per iteration.
    pub trace: Vec<Iteration>,
    /// The times of its phases.
    pub timings: Timings,
    shape: Shape,
}

impl Solution {
    /// Zeros for a problem that is yet to be solved.
    pub(crate) fn new(problem: &Problem) -> Self {
        let shape = problem.shape().clone();
        let horizon = shape.horizon();
        Self {
            xs: vec![0.0; (horizon + 1) * shape.nx],
            us: vec![0.0; shape.offsets[horizon]],
            K: (0..horizon).map(|t| DMatrix::zeros(shape.nu(t), shape.ndx)).collect(),
            k: (0..horizon).map(|t| DVector::zeros(shape.nu(t))).collect(),
            cost: f64::INFINITY,
            gap: f64::INFINITY,
            feasible: false,
            regularisation: 0.0,
            status: Status::MaxIterations,
            trace: Vec::new(),
            timings: Timings::default(),
            shape,
        }
    }

    /// The state xₜ, t = 0 … N.
    ///
    /// # Panics
    /// If t > N.
    #[track_caller]
    pub fn x(&self, t: usize) -> &[f64] {
        let horizon = self.shape.horizon();
        assert!(t <= horizon, "`t` is {t}, expected at most {horizon}");
        &self.xs[self.shape.x(t)]
    }

    /// The control uₜ, t = 0 … N − 1.
    ///
    /// # Panics
    /// If t ≥ N.
    #[track_caller]
    pub fn u(&self, t: usize) -> &[f64] {
        let horizon = self.shape.horizon();
        assert!(t < horizon, "`t` is {t}, expected less than {horizon}: knot {horizon} has no controls");
        &self.us[self.shape.u(t)]
    }

    /// Drops the first knot, and makes room at the end for one with the shape that `shape` has there: a copy of the last
    /// state and, where it fits, the last control; the gains there are zero.
    pub(crate) fn shift(&mut self, shape: &Shape) {
        let (nx, last, ndx) = (shape.nx, shape.horizon() - 1, shape.ndx);
        self.xs.copy_within(nx.., 0);
        let (first, nu) = (self.shape.nu(0), shape.nu(last));
        let fits = self.shape.nu(last) == nu;
        self.us.copy_within(first.., 0);
        let kept = self.us.len() - first;
        self.us.resize(kept + nu, 0.0);
        match fits && nu <= kept {
            true => self.us.copy_within(kept - nu..kept, kept),
            false => self.us[kept..].fill(0.0),
        }
        self.K.rotate_left(1);
        self.k.rotate_left(1);
        if self.k[last].len() != nu {
            (self.K[last], self.k[last]) = (DMatrix::zeros(nu, ndx), DVector::zeros(nu));
        }
        self.K[last].fill(0.0);
        self.k[last].fill(0.0);
        self.shape.clone_from(shape);
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Moves the controls of some knots into their bounds.
    pub(crate) fn project(&mut self, problem: &Problem, knots: Range<usize>) {
        for t in knots {
            let Some((lower, upper)) = problem.action(t).bounds(t) else { continue };
            for (u, (lower, upper)) in self.us[self.shape.u(t)].iter_mut().zip(lower.iter().zip(upper)) {
                *u = u.max(*lower).min(*upper);
            }
        }
    }

    /// Whether some control lies on a bound.
    pub(crate) fn touches_bounds(&self, problem: &Problem) -> bool {
        (0..self.shape.horizon()).any(|t| {
            problem.action(t).bounds(t).is_some_and(|(lower, upper)| {
                let mut bounds = lower.iter().zip(upper);
                self.us[self.shape.u(t)].iter().any(|u| bounds.next().is_some_and(|(l, h)| u <= l || u >= h))
            })
        })
    }

    /// Whether all controls are within their bounds.
    pub(crate) fn is_bounded(&self, problem: &Problem) -> bool {
        (0..self.shape.horizon()).all(|t| {
            problem.action(t).bounds(t).is_none_or(|(lower, upper)| {
                let mut bounds = lower.iter().zip(upper);
                self.us[self.shape.u(t)].iter().all(|u| bounds.next().is_none_or(|(l, h)| (*l..=*h).contains(u)))
            })
        })
    }

    /// Says which part of a solution from a file has not the length that its horizon asks for.
    #[cfg(feature = "serde")]
    fn check(&self) -> Result<(), String> {
        self.shape.check_itself()?;
        let Shape { nx, ndx, .. } = self.shape;
        let (horizon, wrong) = (self.shape.horizon(), |name, expected: usize, found: usize| {
            (expected != found).then(|| format!("`{name}`: expected length {expected}, found {found}"))
        });
        let lengths = [
            ("xs", (horizon + 1) * nx, self.xs.len()),
            ("us", self.shape.offsets[horizon], self.us.len()),
            ("K", horizon, self.K.len()),
            ("k", horizon, self.k.len()),
        ];
        let mut faults = lengths.into_iter().filter_map(|(name, expected, found)| wrong(name, expected, found));
        if let Some(fault) = faults.next() {
            return Err(fault);
        }
        for (t, (K, k)) in self.K.iter().zip(&self.k).enumerate() {
            let nu = self.shape.nu(t);
            if K.shape() != (nu, ndx) || k.len() != nu {
                let (rows, columns) = K.shape();
                let found = format!("K is {rows} × {columns}, k has length {}", k.len());
                return Err(format!("knot {t}: expected gains of {nu} × {ndx}, but {found}"));
            }
        }
        Ok(())
    }
}

#[cfg(feature = "serde")]
impl Serialize for Solution {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, to)
    }
}

#[cfg(feature = "serde")]
impl<'de> Deserialize<'de> for Solution {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let solution = Self::deserialize(from)?;
        solution.check().map_err(serde::de::Error::custom)?;
        Ok(solution)
    }
}
