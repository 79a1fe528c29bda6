//! Settings of the solvers.

use crate::error::Error;
use core::fmt;
use std::time::Duration;

/// Method by which a solve searches for an optimum.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DdpMethod {
    /// Differential dynamic programming (Mayne, 1966), Crocoddyl's `SolverDDP`. Every trial is a rollout from x̂₀
    /// without gaps. The first accepted step therefore closes the gaps of a warm start at once, whatever this costs.
    Ddp,
    /// Feasibility-driven differential dynamic programming (Mastalli et al., ICRA 2020), Crocoddyl's `SolverFDDP`: a
    /// trial of length α keeps the fraction 1 − α of each gap.
    #[default]
    Fddp,
}

impl DdpMethod {
    /// Returns the method's name in files and in Python: `"ddp"` or `"fddp"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ddp => "ddp",
            Self::Fddp => "fddp",
        }
    }
}

/// Writes the abbreviation of the method: DDP or FDDP.
impl fmt::Display for DdpMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ddp => "DDP",
            Self::Fddp => "FDDP",
        })
    }
}

/// Settings of [`Fddp`](crate::Fddp); the defaults are Crocoddyl's.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Settings {
    /// Method, which decides how gaps are closed and which steps are accepted.
    pub method: DdpMethod,
    /// Whether the quadratic model includes the curvature of the dynamics, that is, Vx·∂²φ in Qxx, Qxu and Quu. This is
    /// full DDP, which converges quadratically; Quu may need more regularisation. A robot's knots compute the exact
    /// curvature if they have no contacts and use semi-implicit Euler steps. The dynamics of all other robot knots
    /// count as linear. A user-defined action may compute the curvature of its dynamics.
    pub second_order: bool,
    /// Whether the sweep receives a robot's knots as equations of inverse dynamics. The unknowns are then accelerations
    /// and contact forces instead of the controls. This form is used only without bounds on controls and without
    /// `second_order`. Steps and gains are the same, except for rounding errors, in about half the time.
    pub inverse_dynamics_form: bool,
    /// Maximum number of iterations, at most 1 000 000. With a tolerance of 0, a solve makes exactly this number of
    /// iterations.
    pub max_iterations: usize,
    /// Tolerance of the expected decrease |d₁ + ½ d₂| of the cost. A solve has converged when the iterate before the
    /// last step was feasible and the expected decrease is below the tolerance.
    pub tolerance: f64,
    /// Tolerance that replaces `tolerance` for problems with bounds on controls. The expected decrease of such problems
    /// does not include the multipliers of the bounds.
    pub tolerance_bounded: f64,
    /// Whether a warm start outside the bounds on controls is moved into the bounds, entry by entry, before a solve.
    /// This applies to the warm start given to [`solve`], and to the last trajectory in [`resume`]. Crocoddyl does not
    /// move its warm start, so only `false` reproduces Crocoddyl's iterates. With either value, a solution that
    /// violates a bound is never [`Converged`].
    ///
    /// [`solve`]: crate::Fddp::solve
    /// [`resume`]: crate::Fddp::resume
    /// [`Converged`]: crate::Status::Converged
    pub project_warm_start: bool,
    /// Time limit of a solve; `None` for no limit. The first iteration always runs, unless the budget is zero. The
    /// later phases are derivatives, a sweep and a trial; with several threads, derivatives and sweep are one phase. A
    /// phase starts only if it is predicted to end in time. The prediction is the median of the last five durations of
    /// that phase, over all solves. One or two delays therefore do not shorten later solves. A solve may exceed the
    /// limit if the budget is shorter than an iteration, or if a phase is delayed: see
    /// [`Timings::overrun`](crate::Timings::overrun). A solve that restores a better iterate may need one more sweep.
    pub time_budget: Option<Duration>,
    /// Number of segments of the horizon that a sweep processes at the same time, at most 1024: see
    /// [`Sweep::set_segments`]. The number of threads in rayon's pool does not change the result.
    ///
    /// [`Sweep::set_segments`]: crate::Sweep::set_segments
    pub segments: usize,
    /// Number of threads that share an iteration, at most 1024. The threads belong to the rayon pool from which the
    /// solver is called, or else to the global pool. They compute derivatives and gains while the calling thread
    /// sweeps, and try shorter step lengths when the first length is often too long. The result is the same to the last
    /// bit for any number of threads. More than one thread needs copies of the actions ([`try_clone`]). The copies are
    /// made when they are missing or a model has changed.
    ///
    /// [`try_clone`]: crate::ActionModel::try_clone
    pub threads: usize,
    /// Number n of step lengths that a line search tries: 1, ½, …, 2¹⁻ⁿ.
    pub step_lengths: usize,
    /// Fraction of the expected decrease. A step is accepted if the cost falls by more than this fraction.
    pub accept: f64,
    /// Factor of the test for steps that are expected to raise the cost, while gaps exist. Such a step is accepted if
    /// the rise of the cost is less than this factor times the expected rise.
    pub accept_ascent: f64,
    /// Bound on |d₁|. Below this bound, any step that is expected to lower the cost is accepted.
    pub flat: f64,
    /// Regularisation of the first iteration.
    pub regularisation_start: f64,
    /// Smallest regularisation.
    pub regularisation_min: f64,
    /// Largest regularisation; a solve that reaches it stops.
    pub regularisation_max: f64,
    /// Factor by which the regularisation is raised or lowered.
    pub regularisation_factor: f64,
    /// Step length above which an accepted step lowers the regularisation.
    pub regularisation_decrease_above: f64,
    /// Step length at or below which the regularisation is raised.
    pub regularisation_increase_below: f64,
}

/// Maximum number of segments, and of threads. Each segment and each thread has its own memory.
const MOST_AT_ONCE: usize = 1024;

/// Text of an error message: valid range of the numbers of segments and threads.
const AT_ONCE: &str = "at least 1 and at most 1024";

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: DdpMethod::Fddp,
            second_order: false,
            inverse_dynamics_form: true,
            max_iterations: 100,
            tolerance: 1e-9,
            tolerance_bounded: 5e-5,
            project_warm_start: true,
            time_budget: None,
            segments: 1,
            threads: 1,
            step_lengths: 10,
            accept: 0.1,
            accept_ascent: 2.0,
            flat: 1e-12,
            regularisation_start: 1e-9,
            regularisation_min: 1e-9,
            regularisation_max: 1e9,
            regularisation_factor: 10.0,
            regularisation_decrease_above: 0.5,
            regularisation_increase_below: 0.01,
        }
    }
}

impl Settings {
    /// Returns whether the expected decrease of a step includes the gaps.
    pub(super) fn counts_gaps(&self, feasible: bool) -> bool {
        !feasible && self.method == DdpMethod::Fddp
    }

    /// Returns the regularisation raised by one factor, but not above the largest regularisation.
    pub(super) fn increased(&self, regularisation: f64) -> f64 {
        (regularisation * self.regularisation_factor).min(self.regularisation_max)
    }

    /// Returns the regularisation lowered by one factor, but not below the smallest regularisation.
    pub(super) fn decreased(&self, regularisation: f64) -> f64 {
        (regularisation / self.regularisation_factor).max(self.regularisation_min)
    }

    /// Checks the settings, as each solve does at its beginning.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first invalid field.
    pub fn check(&self) -> Result<(), Error> {
        let [steps, segments, threads] = [self.step_lengths, self.segments, self.threads].map(|count| count as f64);
        let (above, below) = (self.regularisation_decrease_above, self.regularisation_increase_below);
        let [start, min, max, factor] =
            [self.regularisation_start, self.regularisation_min, self.regularisation_max, self.regularisation_factor];
        check_all([
            ("regularisation_decrease_above", above, above.is_finite(), "a finite number"),
            ("regularisation_increase_below", below, below.is_finite(), "a finite number"),
            ("tolerance", self.tolerance, from_zero(self.tolerance), "at least 0"),
            ("tolerance_bounded", self.tolerance_bounded, from_zero(self.tolerance_bounded), "at least 0"),
            ("segments", segments, (1..=MOST_AT_ONCE).contains(&self.segments), AT_ONCE),
            ("threads", threads, (1..=MOST_AT_ONCE).contains(&self.threads), AT_ONCE),
            ("step_lengths", steps, (1..=60).contains(&self.step_lengths), "from 1 to 60"),
            ("accept", self.accept, from_zero(self.accept), "at least 0"),
            ("accept_ascent", self.accept_ascent, from_zero(self.accept_ascent), "at least 0"),
            ("flat", self.flat, from_zero(self.flat), "at least 0"),
            ("regularisation_min", min, exceeds(0.0, min), "above 0"),
            ("regularisation_max", max, exceeds(min, max), "above regularisation_min"),
            (
                "regularisation_start",
                start,
                (min..max).contains(&start),
                "at least regularisation_min and below regularisation_max",
            ),
            ("regularisation_factor", factor, exceeds(1.0, factor), "above 1"),
        ])
    }
}

/// Setting to check: its name, its value, whether the value is valid, and a text for the valid range.
pub(super) type Checked = (&'static str, f64, bool, &'static str);

/// Returns the error of the first invalid setting, if there is one.
pub(super) fn check_all<const N: usize>(settings: [Checked; N]) -> Result<(), Error> {
    match settings.into_iter().find(|(_, _, good, _)| !good) {
        Some((name, value, _, allowed)) => Err(Error::Setting { name, value, allowed }),
        None => Ok(()),
    }
}

/// Returns whether x is finite and at least 0.
pub(super) fn from_zero(x: f64) -> bool {
    x >= 0.0 && x.is_finite()
}

/// Returns whether x is finite and above the limit.
pub(super) fn exceeds(limit: f64, x: f64) -> bool {
    x > limit && x.is_finite()
}

/// Settings of [`AugmentedLagrangian`](crate::AugmentedLagrangian).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct ConstraintSettings {
    /// Maximum distance of a constraint from its bounds, and maximum gap of the dynamics.
    pub tolerance: f64,
    /// Maximum entry of the gradient of the Lagrangian.
    pub tolerance_dual: f64,
    /// Maximum number of inner solves.
    pub max_solves: usize,
    /// Penalty 1/μ of the first inner solve. If it equals `penalty_max`, the penalty is fixed, and each inner solve
    /// that finds a minimum updates the multipliers.
    pub penalty_start: f64,
    /// Largest penalty 1/μ. At this penalty, only the multipliers change.
    pub penalty_max: f64,
    /// Factor by which the penalty 1/μ is raised. It is raised after an inner solve that found a minimum at which the
    /// constraints do not hold well enough.
    pub penalty_factor: f64,
    /// Whether a failed solve is repeated from x̂₀ at all knots and the controls that hold x̂₀ still
    /// ([`quasi_static`](crate::Problem::quasi_static)). A solve has failed if its status is `NotFinite`, if
    /// constraints are violated at the largest penalty, or if it found no acceptable step while constraints were
    /// violated. The better of the two results is kept. Typical causes of failures are warm starts that diverge or
    /// saturate the controls. The repetition allocates. `resume` never repeats a solve. A problem without constraints
    /// and bounds is never solved twice.
    pub restart: bool,
}

impl Default for ConstraintSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            tolerance_dual: 1e-5,
            max_solves: 50,
            penalty_start: 10.0,
            penalty_max: 1e8,
            penalty_factor: 10.0,
            restart: true,
        }
    }
}

impl ConstraintSettings {
    /// Checks the settings, as each solve does at its beginning.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first invalid field.
    pub fn check(&self) -> Result<(), Error> {
        let (start, max, factor) = (self.penalty_start, self.penalty_max, self.penalty_factor);
        check_all([
            ("max_solves", self.max_solves as f64, self.max_solves > 0, "at least 1"),
            ("tolerance", self.tolerance, exceeds(0.0, self.tolerance), "above 0"),
            ("tolerance_dual", self.tolerance_dual, exceeds(0.0, self.tolerance_dual), "above 0"),
            ("penalty_start", start, exceeds(1.0, start), "above 1"),
            ("penalty_max", max, max >= start && max.is_finite(), "at least penalty_start"),
            ("penalty_factor", factor, exceeds(1.0, factor), "above 1"),
        ])
    }
}
