//! Settings of differential inverse kinematics, and limits of the joints.

use crate::error::{Error, length};
use condyle_dynamics::Model;
use condyle_dynamics::distances::DistanceLimits;

/// Limits of positions, velocities and accelerations, as bounds on the displacement Δq of one step of duration T.
///
/// ```text
/// velocity       −T v_max ≤ Δq ≤ T v_max
/// position       g (q_min − q) ≤ Δq ≤ g (q_max − q)
/// acceleration   T v₀ − T² a_max ≤ Δq ≤ T v₀ + T² a_max,
///                Δq + Δq² / (2 a_max T²) ≤ q_max − q, and the same below: the joint can still stop
/// ```
///
/// v₀ is the velocity of the last step. With g ≥ ½, a motion that starts at rest within the limits never contradicts
/// them. If these bounds contradict each other, velocity comes first, then position, then
/// acceleration: each later bound moves to the nearest displacement that the earlier bounds allow. So a joint that
/// starts beyond a limit returns with at most its maximum velocity.
///
/// Positions are limited for joints with as many coordinates in q as in v, and not for free-flyers.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLimits {
    /// g, the fraction of the distance to a position limit that one step may use; above 0, at most 1.
    pub gain: f64,
    /// Minimum position, nq numbers; `None` takes the limits of the model.
    pub lower: Option<Vec<f64>>,
    /// Maximum position, nq numbers; `None` takes the limits of the model.
    pub upper: Option<Vec<f64>>,
    /// v_max, nv numbers; `None` takes the limits of the model.
    pub velocity: Option<Vec<f64>>,
    /// a_max, nv numbers; `None` for no limits.
    pub acceleration: Option<Vec<f64>>,
}

impl Default for JointLimits {
    fn default() -> Self {
        Self { gain: 0.5, lower: None, upper: None, velocity: None, acceleration: None }
    }
}

/// Settings of [`DifferentialIk`](crate::DifferentialIk).
///
/// ```
/// use condyle_ik::{JointLimits, Settings};
/// let limits = JointLimits { acceleration: Some(vec![10.0; 7]), ..JointLimits::default() };
/// let settings = Settings { dt: 0.002, limits: Some(limits), ..Settings::default() };
/// # let _ = settings;
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// T, the duration of a step (s); above 0.
    pub dt: f64,
    /// Weight of ½ ‖Δq‖², which determines the motion that the tasks leave open; above 0.
    pub damping: f64,
    /// Limits of the joints; `None` for no limits.
    pub limits: Option<JointLimits>,
    /// Limits of distances; `None` for no limits.
    pub distances: Option<DistanceLimits>,
}

impl Default for Settings {
    fn default() -> Self {
        Self { dt: 0.01, damping: 1e-8, limits: Some(JointLimits::default()), distances: None }
    }
}

/// Returns an error unless a setting is finite and positive.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), Error> {
    match value > 0.0 && value.is_finite() {
        true => Ok(()),
        false => Err(Error::Setting { name, value, allowed: "above 0 and finite" }),
    }
}

impl Settings {
    pub(crate) fn check(&self, model: &Model) -> Result<(), Error> {
        positive("dt", self.dt)?;
        positive("damping", self.damping)?;
        if let Some((name, value, allowed)) = self.distances.as_ref().and_then(DistanceLimits::wrong) {
            return Err(Error::Setting { name, value, allowed });
        }
        self.limits.as_ref().map_or(Ok(()), |limits| limits.check(model))
    }
}

impl JointLimits {
    fn check(&self, model: &Model) -> Result<(), Error> {
        if !(self.gain > 0.0 && self.gain <= 1.0) {
            return Err(Error::Setting { name: "limits.gain", value: self.gain, allowed: "above 0 and at most 1" });
        }
        for (name, list, expected) in [
            ("limits.lower", &self.lower, model.nq()),
            ("limits.upper", &self.upper, model.nq()),
            ("limits.velocity", &self.velocity, model.nv()),
            ("limits.acceleration", &self.acceleration, model.nv()),
        ] {
            let Some(list) = list else { continue };
            length(name, list.len(), expected)?;
            let magnitudes = expected == model.nv() && matches!(name, "limits.velocity" | "limits.acceleration");
            if let Some(&value) = list.iter().find(|x| x.is_nan() || magnitudes && **x < 0.0) {
                let allowed = if magnitudes { "at least 0" } else { "a number" };
                return Err(Error::Setting { name, value, allowed });
            }
        }
        Ok(())
    }
}
