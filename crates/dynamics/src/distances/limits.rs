//! Limits of distances, for controllers that keep pairs apart.

use alloc::vec::Vec;
use condyle_model::GeometryPair;

/// Limits of the distances d of pairs of geometries, which approach a minimum d_min over a look-ahead time T. Inverse
/// kinematics limits the rate of d, and whole-body control its acceleration:
///
/// ```text
/// ḋ ≥ −(d − d_min) / T             d̈ ≥ −(2 / T) ḋ − (d − d_min) / T²
/// ḋ = ∂d/∂q v + ∂d/∂t
/// ```
///
/// ∂d/∂t follows from the velocities of obstacles, which
/// [`DistancePairs::set_velocity`](super::DistancePairs::set_velocity) sets. A pair that is too near moves apart.
///
/// Sources: Faverjon and Tournassoud (1987), equation 4, for the rate; Nguyen and Sreenath, *Exponential control
/// barrier functions* (2016), for the acceleration.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceLimits {
    /// Pairs of geometries of the robot, or of the robot and its surroundings.
    pub pairs: Vec<GeometryPair>,
    /// d_min, the minimum distance (m).
    pub minimum: f64,
    /// Look-ahead time T (s); above 0, and at least the duration of several ticks.
    pub look_ahead: f64,
    /// Largest acceleration that a bound of whole-body control asks for (m/s²); above 0. So a pair that is too near
    /// moves apart with at most this acceleration. Inverse kinematics does not read it.
    pub max_acceleration: f64,
    /// Distance above d_min beyond which a pair has no limit (m); above 0.
    pub range: f64,
}

impl DistanceLimits {
    /// Creates limits for these pairs, with a minimum of 1 cm, a look-ahead time of 0.1 s, a maximum acceleration of 50
    /// m/s² and a range of 20 cm.
    pub fn new(pairs: Vec<GeometryPair>) -> Self {
        Self { pairs, minimum: 0.01, look_ahead: 0.1, max_acceleration: 50.0, range: 0.2 }
    }

    /// Returns the first field whose value is outside its range: the name, the value, and the range in words. Returns
    /// `None` if all numbers are valid. The pairs are not checked.
    pub fn wrong(&self) -> Option<(&'static str, f64, &'static str)> {
        let above = |x: f64| x > 0.0 && x.is_finite();
        let fields = [
            ("distances.minimum", self.minimum, self.minimum.is_finite(), "finite"),
            ("distances.look_ahead", self.look_ahead, above(self.look_ahead), "above 0 and finite"),
            ("distances.max_acceleration", self.max_acceleration, above(self.max_acceleration), "above 0 and finite"),
            ("distances.range", self.range, self.range > 0.0, "above 0"),
        ];
        let wrong = fields.into_iter().find(|(.., is_valid, _)| !is_valid);
        wrong.map(|(name, value, _, allowed)| (name, value, allowed))
    }
}
