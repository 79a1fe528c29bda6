//! The settings of a controller.

use crate::error::Error;
use crate::task::Gains;
use condyle_dynamics::Model;

/// The settings of [`WholeBodyController`](crate::WholeBodyController).
///
/// ```
/// use condyle_wholebody::{Gains, Settings};
/// // Feet that drifted come back, motors of 40 N m.
/// let settings =
///     Settings { contact_gains: Gains::critical(400.0), effort: Some(vec![40.0; 18]), ..Settings::default() };
/// # let _ = settings;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Weight of ½ ‖q̈‖², which decides what the tasks leave open.
    pub acceleration_weight: f64,
    /// Weight of ½ Σ ‖f − f_ref‖² (1/N²), which spreads the forces.
    pub force_weight: f64,
    /// Baumgarte's: a contact's acceleration is k (p_ref − p) − d ṗ instead of 0.
    pub contact_gains: Gains,
    /// Greatest effort of each coordinate, nv numbers (N m, N), infinite where there is none; `None` for the model's.
    pub effort: Option<Vec<f64>>,
    /// Tolerance of the solver, absolute and relative, on feasibility and duality gap.
    pub tolerance: f64,
    /// Iterations after which a step fails.
    pub max_iterations: u32,
    /// Seconds after which a step fails; may be infinite. What depends on it depends on the machine's load.
    pub time_limit: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            acceleration_weight: 1e-6,
            force_weight: 1e-5,
            contact_gains: Gains { stiffness: 0.0, damping: 0.0 },
            effort: None,
            tolerance: 1e-9,
            max_iterations: 50,
            time_limit: f64::INFINITY,
        }
    }
}

impl Settings {
    pub(crate) fn check(&self, model: &Model) -> Result<(), Error> {
        let from_zero = |x: f64| x >= 0.0 && x.is_finite();
        let Gains { stiffness, damping } = self.contact_gains;
        for (name, value, good, allowed) in [
            ("acceleration_weight", self.acceleration_weight, from_zero(self.acceleration_weight), "at least 0"),
            ("force_weight", self.force_weight, from_zero(self.force_weight), "at least 0"),
            ("contact_gains.stiffness", stiffness, from_zero(stiffness), "at least 0"),
            ("contact_gains.damping", damping, from_zero(damping), "at least 0"),
            ("tolerance", self.tolerance, self.tolerance > 0.0 && self.tolerance < 1.0, "between 0 and 1"),
            ("max_iterations", f64::from(self.max_iterations), self.max_iterations > 0, "at least 1"),
            ("time_limit", self.time_limit, self.time_limit > 0.0, "above 0"),
        ] {
            if !good {
                return Err(Error::Setting { name, value, allowed });
            }
        }
        let effort = self.effort(model);
        if effort.len() != model.nv() {
            return Err(Error::Length { name: "effort", expected: model.nv(), found: effort.len() });
        }
        match effort.iter().find(|x| x.is_nan() || **x < 0.0) {
            Some(&value) => Err(Error::Setting { name: "effort", value, allowed: "at least 0" }),
            None => Ok(()),
        }
    }

    /// Greatest effort of each coordinate.
    pub(crate) fn effort<'s>(&'s self, model: &'s Model) -> &'s [f64] {
        self.effort.as_deref().unwrap_or(&model.limits().effort)
    }
}
