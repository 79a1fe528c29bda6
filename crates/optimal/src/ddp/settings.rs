//! The settings of the FDDP family.

use crate::error::Error;
use core::fmt;
use std::time::Duration;

/// Which search for an optimum a solve is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum DdpMethod {
    /// Differential dynamic programming (Mayne, 1966), Crocoddyl's `SolverDDP`: every trial is a plain rollout from x̂₀,
    /// so that the first step accepted closes the gaps of a warm start at once, at whatever cost.
    Ddp,
    /// Feasibility-driven differential dynamic programming (Mastalli et al., ICRA 2020), Crocoddyl's `SolverFDDP`: a
    /// trial of length α keeps the part 1 − α of each gap.
    #[default]
    Fddp,
}

impl DdpMethod {
    /// Returns the name, as files and Python have it: `"ddp"` or `"fddp"`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ddp => "ddp",
            Self::Fddp => "fddp",
        }
    }
}

/// Writes the method by its usual abbreviation.
impl fmt::Display for DdpMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Ddp => "DDP",
            Self::Fddp => "FDDP",
        })
    }
}

/// The settings of [`Fddp`](crate::Fddp); the defaults are Crocoddyl's.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct Settings {
    /// How gaps are closed and which steps are accepted.
    pub method: DdpMethod,
    /// Whether the curvature of the dynamics counts, Vx·∂²φ in Qxx, Qxu and Quu, at knots whose action gives it: full DDP,
    /// which converges quadratically. Quu may need more regularisation then. Of a robot's knots those by semi-implicit
    /// Euler that are without contacts give it, exactly; the others count as linear.
    pub second_order: bool,
    /// Whether a robot's knots come to the sweep as the equations of inverse dynamics, with accelerations and contact
    /// forces as unknowns instead of the controls, where that is possible: without bounds on controls and without
    /// `second_order`. The same steps and gains, up to rounding, in about half the time.
    pub inverse_dynamics_form: bool,
    /// Iterations after which a solve stops, at most 1 000 000. With a tolerance of 0 it makes exactly so many.
    pub max_iterations: usize,
    /// Converged when the iterate was feasible and the expected decrease |d₁ + ½ d₂| of the cost falls below this.
    pub tolerance: f64,
    /// The tolerance of problems with bounds on controls: the expected decrease does not see the bounds' multipliers.
    pub tolerance_bounded: f64,
    /// Whether a warm start outside of the bounds on controls is moved into them, entry by entry, before a solve: what is
    /// given to [`solve`], and the last trajectory in [`resume`]. Crocoddyl keeps such a start, so its iterates need `false`.
    /// A solution that violates a bound is never [`Converged`], with either value.
    ///
    /// [`solve`]: crate::Fddp::solve
    /// [`resume`]: crate::Fddp::resume
    /// [`Converged`]: crate::Status::Converged
    pub project_warm_start: bool,
    /// The time that a solve may take; `None` for no limit. The first iteration always runs, unless the budget is zero.
    /// A later phase (derivatives, a sweep, a trial; on several threads derivatives and sweep together) starts only if it
    /// would end in time. Its duration is predicted as the median of the last five of its kind, of all solves, so that one
    /// or two delays do not shorten later solves. A solve that takes longer reports
    /// [`Timings::overrun`](crate::Timings::overrun): the budget is shorter than an iteration, or something delayed it. A
    /// solve that goes back to a better iterate may take a sweep longer.
    pub time_budget: Option<Duration>,
    /// The number of segments of the horizon on which a sweep works at the same time: see [`Sweep::set_segments`]. It is
    /// not the number of threads, which are those of rayon's pool, and any number of them finds the same. At most 1024.
    ///
    /// [`Sweep::set_segments`]: crate::Sweep::set_segments
    pub segments: usize,
    /// Threads that share an iteration, of rayon's pool in which a solve is called, else of the global one: derivatives, and
    /// beside them the sweep, which stays on the calling thread, and the gains; and a second step length where the first is
    /// often too long. Any number finds the same to the last bit. More than 1 need copies of the actions ([`fork`]), which are
    /// made when there are none yet, or not of a model as it is now. At most 1024.
    ///
    /// [`fork`]: crate::ActionModel::fork
    pub threads: usize,
    /// Number of step lengths tried, 2⁻ⁿ for n = 0, 1, ….
    pub step_lengths: usize,
    /// A step is accepted if the cost falls by more than this times the expected decrease.
    pub accept: f64,
    /// While there are gaps, a step that was expected to raise the cost is accepted if the cost rises by less than
    /// this times what was expected.
    pub accept_ascent: f64,
    /// Any step that was expected to lower the cost is accepted if |d₁| is below this.
    pub flat: f64,
    /// Regularisation of the first iteration.
    pub regularisation_start: f64,
    /// Least regularisation.
    pub regularisation_min: f64,
    /// Largest regularisation; a solve that reaches it stops.
    pub regularisation_max: f64,
    /// Factor by which the regularisation rises and falls.
    pub regularisation_factor: f64,
    /// The regularisation falls after a step longer than this.
    pub regularisation_decrease_above: f64,
    /// The regularisation rises after a step of this length or shorter.
    pub regularisation_increase_below: f64,
}

/// The most segments, and the most threads: each has memory of its own.
const MOST_AT_ONCE: usize = 1024;

/// `MOST_AT_ONCE` in words.
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
    /// Whether gaps count in what a step should gain.
    pub(super) fn counts_gaps(&self, feasible: bool) -> bool {
        !feasible && self.method == DdpMethod::Fddp
    }

    /// Checks the settings, as each solve does.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first field that makes no sense.
    pub fn check(&self) -> Result<(), Error> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let from_zero = |x: f64| x >= 0.0 && x.is_finite();
        let [steps, segments, threads] = [self.step_lengths, self.segments, self.threads].map(|count| count as f64);
        let number = |x: f64| x.is_finite();
        let (above, below) = (self.regularisation_decrease_above, self.regularisation_increase_below);
        for (name, value, good, allowed) in [
            ("regularisation_decrease_above", above, number(above), "a finite number"),
            ("regularisation_increase_below", below, number(below), "a finite number"),
            ("tolerance", self.tolerance, from_zero(self.tolerance), "at least 0"),
            ("tolerance_bounded", self.tolerance_bounded, from_zero(self.tolerance_bounded), "at least 0"),
            ("segments", segments, (1..=MOST_AT_ONCE).contains(&self.segments), AT_ONCE),
            ("threads", threads, (1..=MOST_AT_ONCE).contains(&self.threads), AT_ONCE),
            ("step_lengths", steps, (1..=60).contains(&self.step_lengths), "from 1 to 60"),
            ("accept", self.accept, from_zero(self.accept), "at least 0"),
            ("accept_ascent", self.accept_ascent, from_zero(self.accept_ascent), "at least 0"),
            ("flat", self.flat, from_zero(self.flat), "at least 0"),
            ("regularisation_min", self.regularisation_min, positive(self.regularisation_min), "above 0"),
            (
                "regularisation_max",
                self.regularisation_max,
                self.regularisation_max > self.regularisation_min && self.regularisation_max.is_finite(),
                "above regularisation_min",
            ),
            (
                "regularisation_start",
                self.regularisation_start,
                (self.regularisation_min..self.regularisation_max).contains(&self.regularisation_start),
                "at least regularisation_min and below regularisation_max",
            ),
            (
                "regularisation_factor",
                self.regularisation_factor,
                self.regularisation_factor > 1.0 && self.regularisation_factor.is_finite(),
                "above 1",
            ),
        ] {
            if !good {
                return Err(Error::Setting { name, value, allowed });
            }
        }
        Ok(())
    }
}
