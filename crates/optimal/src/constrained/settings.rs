//! Settings of the method of multipliers.

use crate::error::Error;

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
    /// Penalty 1/μ of the first inner solve.
    pub penalty_start: f64,
    /// Largest penalty 1/μ.
    pub penalty_max: f64,
    /// Factor by which the penalty 1/μ rises.
    pub penalty_factor: f64,
    /// Whether a failed solve is repeated from x̂₀ at all knots and the controls that hold it still
    /// ([`quasi_static`](crate::Problem::quasi_static)). A solve has failed if it ends as not finite, or with violated
    /// constraints at the largest penalty. The better result is kept. Typical causes are warm starts that diverge or
    /// saturate the controls. The repetition allocates. `resume` never repeats, nor does a problem without constraints
    /// and bounds.
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
    /// Checks the settings.
    ///
    /// # Errors
    /// [`Error::Setting`] for the first invalid field.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let positive = |x: f64| x > 0.0 && x.is_finite();
        for (name, value, good, allowed) in [
            ("max_solves", self.max_solves as f64, self.max_solves > 0, "at least 1"),
            ("tolerance", self.tolerance, positive(self.tolerance), "above 0"),
            ("tolerance_dual", self.tolerance_dual, positive(self.tolerance_dual), "above 0"),
            (
                "penalty_start",
                self.penalty_start,
                self.penalty_start > 1.0 && self.penalty_start.is_finite(),
                "above 1",
            ),
            (
                "penalty_max",
                self.penalty_max,
                self.penalty_max >= self.penalty_start && self.penalty_max.is_finite(),
                "at least penalty_start",
            ),
            (
                "penalty_factor",
                self.penalty_factor,
                self.penalty_factor > 1.0 && self.penalty_factor.is_finite(),
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
