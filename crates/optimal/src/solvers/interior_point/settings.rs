//! Settings of the interior point.

use crate::error::Error;
use crate::solvers::settings::{Settings, check_all, exceeds, from_zero};
use std::time::Duration;

/// Settings of [`InteriorPoint`](crate::InteriorPoint).
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InteriorPointSettings {
    /// Tolerance of the gradient of the Lagrangian, of the complementarity (both scaled as in IPOPT) and of the gaps. A
    /// tenth of it is the tolerance of the constraints.
    pub tolerance: f64,
    /// Maximum number of iterations.
    pub max_iterations: usize,
    /// Barrier parameter μ of the first iteration; if `None`, the cost of the warm start divided by the
    /// number of bounds.
    pub barrier_start: Option<f64>,
    /// Largest barrier parameter μ of a [`tick`](crate::InteriorPoint::tick), in the unit of the cost. A larger μ
    /// tolerates larger disturbances, but keeps a larger distance from the bounds until they have decayed.
    pub tick_barrier: f64,
    /// Whether the curvature λᵀ∂²φ of the dynamics is included near the solution, where an action computes it. Knots
    /// are then not given as equations of inverse dynamics. This saves iterations where the curvature of the dynamics
    /// exceeds the neglected curvature of the costs. With soft limits, the curvature is included from the start. If
    /// this setting is off, it is then included once the KKT error has not decreased for eight iterations.
    pub second_order: bool,
    /// Whether the sweep receives a robot's knots as equations of inverse dynamics: see
    /// [`Settings::inverse_dynamics_form`](crate::Settings::inverse_dynamics_form).
    pub inverse_dynamics_form: bool,
    /// Time limit of a solve: see [`Settings::time_budget`](crate::Settings::time_budget).
    pub time_budget: Option<Duration>,
    /// Number of threads that compute derivatives: see [`Settings::threads`](crate::Settings::threads).
    pub threads: usize,
    /// Smallest regularisation.
    pub regularisation_min: f64,
    /// Largest regularisation; a solve that reaches it stops.
    pub regularisation_max: f64,
}

impl Default for InteriorPointSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            max_iterations: 300,
            barrier_start: None,
            tick_barrier: 0.1,
            second_order: false,
            inverse_dynamics_form: true,
            time_budget: None,
            threads: 1,
            regularisation_min: 1e-9,
            regularisation_max: 1e9,
        }
    }
}

impl InteriorPointSettings {
    /// Checks the settings, as each solve does at its beginning.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first invalid field.
    pub fn check(&self) -> Result<(), Error> {
        self.shared().map(|_| ())
    }

    /// Checks the settings, and returns the settings of the loop that all solvers share.
    pub(super) fn shared(&self) -> Result<Settings, Error> {
        let (min, max, start) = (self.regularisation_min, self.regularisation_max, self.barrier_start.unwrap_or(1.0));
        check_all([
            ("tolerance", self.tolerance, from_zero(self.tolerance), "at least 0"),
            ("barrier_start", start, exceeds(0.0, start), "above 0"),
            ("tick_barrier", self.tick_barrier, exceeds(0.0, self.tick_barrier), "above 0"),
            ("regularisation_min", min, exceeds(0.0, min), "above 0"),
            ("regularisation_max", max, exceeds(min, max), "above regularisation_min"),
        ])?;
        let settings = Settings {
            max_iterations: self.max_iterations,
            time_budget: self.time_budget,
            threads: self.threads,
            regularisation_min: min,
            regularisation_start: min,
            regularisation_max: max,
            inverse_dynamics_form: self.inverse_dynamics_form,
            ..Settings::default()
        };
        settings.check()?;
        Ok(settings)
    }
}
