//! Solution of a solve: the trajectory, its feedback, the outcome of the solve and a record of its iterations.
#![allow(non_snake_case)] // names follow the literature: K, k

use crate::problem::{Problem, Shape};
use core::fmt;
use core::ops::Range;
use nalgebra::{DMatrix, DVector};
#[cfg(feature = "serde")]
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::time::Duration;

/// Outcome of a solve. With any status, the [`Solution`] contains the best iterate found. A converged iterate is the
/// best. If no iterate converged, the candidates are the last iterate and all iterates for which a search direction was
/// found. Among the candidates, the iterate with the smallest gap is the best; for equal gaps, the iterate with the
/// lowest cost. An iterate within the bounds on controls is better than a warm start outside the bounds. An iterate has
/// diverged, and is not a candidate, if its cost exceeds the lowest cost of the solve by more than 1e8·(1 + |lowest|).
///
/// A controller with a period asks whether it may execute the solution, with u = ūₜ + Kₜ (x ⊖ x̄ₜ).
/// [`Solution::is_executable`] answers it from the numbers:
/// - after [`Converged`](Self::Converged) and [`FullStep`](Self::FullStep), yes: x̄₀ = x̂₀, and the trajectory satisfies
///   the dynamics,
/// - after [`MaxIterations`](Self::MaxIterations), [`TimeLimit`](Self::TimeLimit),
///   [`Interrupted`](Self::Interrupted) and [`RegularisationLimit`](Self::RegularisationLimit), yes with care: the
///   numbers are finite, but the trajectory may have gaps ([`Solution::gap`]), with x̄₀ ≠ x̂₀. The feedback then acts
///   on the deviation from x̄₀. If the trace is empty, no iteration was made, and the gains are the gains of the solve
///   before it,
/// - after [`NotFinite`](Self::NotFinite), no: continue with the previous solution, and
///   [`reset`](crate::Fddp::reset) the solver,
/// - after [`ConstraintsViolated`](Self::ConstraintsViolated) and [`Infeasible`](Self::Infeasible), only if the
///   violation in [`Outcome::worst`](crate::Outcome::worst) is acceptable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Status {
    /// The iterate has no gaps, and the expected decrease of its cost is below the tolerance.
    Converged,
    /// A step of length 1 was accepted, so the trajectory has no gaps. Only
    /// [`Fddp::resume_to_full_step`](crate::Fddp::resume_to_full_step) ends so.
    FullStep,
    /// The maximum number of iterations is reached.
    MaxIterations,
    /// The time limit is reached, or the remaining time is too short to continue.
    TimeLimit,
    /// An [`Observer`](crate::Observer) has ended the solve.
    Interrupted,
    /// The regularisation reached its largest value: no descent direction or no acceptable step was found. After a
    /// solve with constraints, the last inner solve ended so, away from a minimum. This says nothing about the
    /// constraints.
    RegularisationLimit,
    /// The penalty reached its limit, inner solves found minima, and constraints are still violated. Updates of the
    /// multipliers no longer lower the violation. This does not prove infeasibility: another
    /// warm start or a larger penalty may lead to a solution. [`Outcome::worst`](crate::Outcome::worst) is the largest
    /// violation.
    ConstraintsViolated,
    /// No solution exists. The initial state x̂₀ violates a constraint of knot 0 that no control can change, for
    /// example a built-in residual of the state alone. [`Outcome::worst`](crate::Outcome::worst) names this constraint.
    /// The solution satisfies the other constraints, as far as the solve progressed. An
    /// [`InteriorPoint`](crate::InteriorPoint) also ends with this status where no small change of the trajectory
    /// reduces the violation. Another warm start may then find a solution.
    Infeasible,
    /// Cost, dynamics or derivatives of the last iterate are infinite or NaN, so no search direction can be computed.
    /// The solution is the best earlier iterate. Its states and controls are finite, but its cost may be infinite if it
    /// is the warm start. Another warm start may help, for example x̂₀ at all knots and the controls that hold x̂₀
    /// still ([`Problem::quasi_static`](crate::Problem::quasi_static)).
    NotFinite,
}

impl Status {
    /// Returns the status's name in files and in Python: `"converged"`, `"max_iterations"` and so on.
    pub fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::FullStep => "full_step",
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
            Self::FullStep => "took a full step",
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

/// Trajectory that replaced the trajectory of the last solution, because that trajectory could not be continued.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Fallback {
    /// Rollout of the last plan from x̂₀ with its gains. It replaces a plan whose gaps exceed 10 (rad, m, rad/s, m/s).
    /// It is also the plan after a tick whose sweep failed.
    RolledOut,
    /// x̂₀ at all knots, and the controls that hold x̂₀ still. They replace a plan that is not finite, or that costs far
    /// more than the last solution.
    HeldStill,
}

impl Fallback {
    /// Returns the name in files and in Python: `"rolled_out"` or `"held_still"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::RolledOut => "rolled_out",
            Self::HeldStill => "held_still",
        }
    }
}

/// Record of one iteration of a solve.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Iteration {
    /// Index of the iteration; the first iteration has the index 0.
    pub iteration: usize,
    /// Cost of the iterate after the step.
    pub cost: f64,
    /// Largest gap, ‖f‖∞, of the iterate before the step.
    pub gap: f64,
    /// Expected decrease of the cost by the full step, |d₁ + ½ d₂|, which is compared with the tolerance.
    pub stop: f64,
    /// Length α of the accepted step, or the step length tried last if no step was accepted.
    pub step: f64,
    /// Regularisation after the iteration.
    pub regularisation: f64,
    /// Linear coefficient d₁ of the expected decrease α (d₁ + ½ α d₂) of the cost.
    pub d1: f64,
    /// Quadratic coefficient d₂ of the expected decrease α (d₁ + ½ α d₂) of the cost.
    pub d2: f64,
    /// Actual decrease of the cost by the step tried last.
    pub decrease: f64,
    /// Expected decrease of the cost by the step tried last.
    pub expected_decrease: f64,
    /// Whether the iterate after the step satisfies the dynamics.
    pub feasible: bool,
    /// Whether a step was accepted; otherwise the iterate is unchanged.
    pub accepted: bool,
}

/// Durations of the phases of a solve. For an [`AugmentedLagrangian`](crate::AugmentedLagrangian) they are sums over
/// all inner solves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Timings {
    /// Duration of the first evaluation: dynamics and cost of the warm start.
    pub calc: Duration,
    /// Duration of the derivatives. With several threads, the time in which the sweeping thread waited for derivatives
    /// or computed derivatives itself.
    pub calc_diff: Duration,
    /// Duration of the backward sweeps, including repeated sweeps.
    pub sweep: Duration,
    /// Duration of the trial rollouts in the line searches, whether accepted or not.
    pub rollout: Duration,
    /// Duration of the whole solve, including the time in the observer.
    pub total: Duration,
    /// Time beyond [`Settings::time_budget`](crate::Settings::time_budget), zero if the solve ended in time. It is
    /// positive if the budget is shorter than the first iteration, or if a phase took longer than predicted. It is zero
    /// with a budget of zero, because no iteration then runs.
    #[cfg_attr(feature = "serde", serde(default))]
    pub overrun: Duration,
}

impl Timings {
    /// Sets the duration of the whole solve, and the time beyond the budget.
    pub(crate) fn end(&mut self, total: Duration, budget: Option<Duration>) {
        self.total = total;
        let budget = budget.filter(|budget| !budget.is_zero());
        self.overrun = budget.map_or(Duration::ZERO, |budget| total.saturating_sub(budget));
    }
}

/// Result of a solve. A solution that is read from a file is checked: the lengths of all fields must fit one horizon.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(remote = "Self"))] // serde reads the fields; the implementations below check them
pub struct Solution {
    /// States x₀ … x_N, flat: (N + 1)·nx.
    pub xs: Vec<f64>,
    /// Controls u₀ … u_{N−1}, flat.
    pub us: Vec<f64>,
    /// Feedback gains of the last sweep, a matrix nu × ndx per knot. Near the trajectory the control is uₜ + Kₜ (x ⊖
    /// xₜ).
    #[cfg_attr(feature = "serde", serde(deserialize_with = "crate::read::matrices"))]
    pub K: Vec<DMatrix<f64>>,
    /// Feed-forward terms of the last sweep, nu entries per knot. They are the changes of the controls by a full step.
    pub k: Vec<DVector<f64>>,
    /// Cost of the trajectory; infinite if it is NaN.
    pub cost: f64,
    /// Largest gap of the trajectory, ‖f‖∞; infinite if it is NaN.
    pub gap: f64,
    /// Whether the trajectory satisfies the dynamics, as a rollout from x̂₀ without gaps.
    pub feasible: bool,
    /// Regularisation at the end of the solve.
    pub regularisation: f64,
    /// Outcome of the solve.
    pub status: Status,
    /// Trajectory with which the solve replaced the trajectory of the last solution; `None` if it was continued.
    #[cfg_attr(feature = "serde", serde(default))]
    pub fallback: Option<Fallback>,
    /// Record of each iteration.
    pub trace: Vec<Iteration>,
    /// Durations of the phases.
    pub timings: Timings,
    shape: Shape,
}

impl Solution {
    /// Creates a solution of zeros for a problem that is not yet solved.
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
            fallback: None,
            trace: Vec::new(),
            timings: Timings::default(),
            shape,
        }
    }

    /// Returns whether the problem has not been solved yet.
    pub(crate) fn is_empty(&self) -> bool {
        self.status == Status::MaxIterations && self.trace.is_empty() && self.timings.total.is_zero()
    }

    /// Returns the state xₜ, t = 0 … N.
    ///
    /// # Panics
    /// If t > N.
    #[track_caller]
    pub fn x(&self, t: usize) -> &[f64] {
        let horizon = self.shape.horizon();
        assert!(t <= horizon, "`t` is {t}, expected at most {horizon}");
        &self.xs[self.shape.x(t)]
    }

    /// Returns the control uₜ, t = 0 … N − 1.
    ///
    /// # Panics
    /// If t ≥ N.
    #[track_caller]
    pub fn u(&self, t: usize) -> &[f64] {
        let horizon = self.shape.horizon();
        assert!(t < horizon, "`t` is {t}, expected less than {horizon}: knot {horizon} has no controls");
        &self.us[self.shape.u(t)]
    }

    /// Returns whether a controller may execute the plan: the status is not [`Status::NotFinite`], and all states,
    /// controls and gains are finite. The plan may still have [gaps](Self::gap), or violate limits
    /// ([`Outcome::worst`](crate::Outcome::worst)). If the plan is not executable, continue with the last one that was,
    /// and [`reset`](crate::Fddp::reset) the solver.
    pub fn is_executable(&self) -> bool {
        let finite = |numbers: &[f64]| numbers.iter().all(|x| x.is_finite());
        let has_gains = self.K.iter().all(|K| finite(K.as_slice()));
        self.status != Status::NotFinite && finite(&self.xs) && finite(&self.us) && has_gains
    }

    /// Returns the first regularisation of a resumed solve. This is `start`, unless the last solve ran out of time or
    /// iterations after a rejected step. In that case it is the last regularisation, because a smaller one would lead
    /// to the same rejected step.
    pub(super) fn resumed_regularisation(&self, start: f64) -> f64 {
        let stopped = matches!(self.status, Status::TimeLimit | Status::MaxIterations | Status::Interrupted);
        match self.trace.last() {
            Some(last) if stopped && !last.accepted => last.regularisation.max(start),
            _ => start,
        }
    }

    /// Drops the first knot and appends a knot at the end. The dimensions become `shape`. The new knot copies the last
    /// state and, if its size fits, the last control. The gains of the new knot are zero.
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

    /// Changes the dimensions to `shape`, and the length of the controls. The caller changes the gains.
    pub(super) fn reshape(&mut self, shape: &Shape) {
        self.us.resize(shape.offsets[shape.horizon()], 0.0);
        self.shape.clone_from(shape);
    }

    pub(crate) fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Moves the controls of `knots` into their bounds.
    pub(crate) fn project(&mut self, problem: &Problem, knots: Range<usize>) {
        for t in knots {
            let Some((lower, upper)) = problem.action(t).bounds(t) else { continue };
            for (u, (lower, upper)) in self.us[self.shape.u(t)].iter_mut().zip(lower.iter().zip(upper)) {
                *u = u.max(*lower).min(*upper);
            }
        }
    }

    /// Replaces the controls of knot t of a robot by the controls that hold its state still, if these are finite.
    pub(crate) fn hold_still(&mut self, problem: &mut Problem, t: usize) {
        let Self { xs, us, k, shape, .. } = self;
        let (x, still) = (&xs[shape.x(t)], k[t].as_mut_slice()); // k of the new knot has no meaning yet
        if problem.hold_still(t, x, still) && still.iter().all(|u| u.is_finite()) {
            us[shape.u(t)].copy_from_slice(still);
        }
        still.fill(0.0);
    }

    /// Returns whether a control lies on a bound.
    pub(crate) fn touches_bounds(&self, problem: &Problem) -> bool {
        (0..self.shape.horizon()).any(|t| {
            problem.action(t).bounds(t).is_some_and(|(lower, upper)| {
                let mut bounds = lower.iter().zip(upper);
                self.us[self.shape.u(t)].iter().any(|u| bounds.next().is_some_and(|(l, h)| u <= l || u >= h))
            })
        })
    }

    /// Returns whether all controls are within their bounds.
    pub(crate) fn is_bounded(&self, problem: &Problem) -> bool {
        (0..self.shape.horizon()).all(|t| {
            problem.action(t).bounds(t).is_none_or(|(lower, upper)| {
                let mut bounds = lower.iter().zip(upper);
                self.us[self.shape.u(t)].iter().all(|u| bounds.next().is_none_or(|(l, h)| (*l..=*h).contains(u)))
            })
        })
    }

    /// Checks that each field of a solution from a file has the length that the solution's horizon requires.
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
