//! Limits of distances between bodies, as rows of a step's program.

use crate::active_set::ActiveSet;
use crate::error::Error;
use crate::settings::positive;
use condyle_dynamics::distances::{DistancePairs, Distances, GeometryPair};
use condyle_dynamics::{Model, Placements};

/// Limits of the distances d of pairs of geometries in one step of duration T:
///
/// ```text
/// ∂d/∂q Δq ≥ −min(γ T, 1) (d − d_min)
/// ```
///
/// A pair that is too near moves apart. If the limits of the joints do not allow this for all pairs at once, the pairs
/// at least do not come nearer, and the step's status is [`Status::Relaxed`](crate::Status::Relaxed). Source: Faverjon
/// and Tournassoud (1987), equation 4.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceLimits {
    /// Pairs of geometries of the robot, or of the robot and its surroundings.
    pub pairs: Vec<GeometryPair>,
    /// d_min, the minimum distance (m).
    pub minimum: f64,
    /// γ, the rate at which a distance may approach its minimum (1/s); above 0.
    pub rate: f64,
    /// Distance above d_min beyond which a pair has no limit (m); above 0. It is far longer than any motion of a step.
    pub range: f64,
}

impl DistanceLimits {
    /// Creates limits for these pairs, with a minimum of 1 cm, a rate of 10/s and a range of 20 cm.
    pub fn new(pairs: Vec<GeometryPair>) -> Self {
        Self { pairs, minimum: 0.01, rate: 10.0, range: 0.2 }
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        if !self.minimum.is_finite() {
            return Err(Error::Setting { name: "distances.minimum", value: self.minimum, allowed: "finite" });
        }
        positive("distances.rate", self.rate)?;
        if self.range.is_nan() || self.range <= 0.0 {
            return Err(Error::Setting { name: "distances.range", value: self.range, allowed: "above 0" });
        }
        Ok(())
    }
}

/// Distances of a robot, and the memory of their rows.
#[derive(Clone, Debug)]
pub(crate) struct Separation {
    pub pairs: DistancePairs,
    minimum: f64,
    /// min(γ T, 1).
    approach: f64,
    range: f64,
    results: Distances,
    /// Pair of each row.
    pub rows: Vec<usize>,
}

impl Separation {
    pub(crate) fn new(model: &Model, limits: &DistanceLimits, dt: f64) -> Result<Self, Error> {
        let mut pairs = DistancePairs::new(model, &limits.pairs)?;
        pairs.set_cutoff(limits.minimum.max(0.0) + limits.range);
        Ok(Self {
            minimum: limits.minimum,
            approach: (limits.rate * dt).min(1.0),
            range: limits.range,
            results: Distances::new(&pairs),
            rows: Vec::with_capacity(pairs.len()),
            pairs,
        })
    }

    /// Writes the rows of all near pairs to the program.
    pub(crate) fn write(&mut self, placements: Placements<'_, f64>, program: &mut ActiveSet) {
        self.pairs.gradients(placements, &mut self.results);
        self.rows.clear();
        for pair in 0..self.pairs.len() {
            let room = self.results.distance(pair) - self.minimum;
            if self.results.is_near(pair) && room < self.range {
                self.rows.push(pair);
                program.A.extend_from_slice(self.results.gradient(pair));
                program.b.push(-self.approach * room);
            }
        }
    }

    /// Returns the smallest distance at the last step, and its pair.
    pub(crate) fn nearest(&self) -> Option<(usize, f64)> {
        self.results.nearest()
    }
}

/// Returns the names of a pair's geometries.
pub(crate) fn pair_names(pairs: &DistancePairs, pair: usize) -> String {
    let [first, second] = pairs.geometries_of(pair).map(|geometry| {
        let geometry = pairs.geometry(geometry);
        match (&geometry.name, &geometry.frame) {
            (name, _) if !name.is_empty() => format!("`{name}`"),
            (_, Some(frame)) => format!("{} on `{}`", geometry.shape.kind(), frame.name),
            _ => format!("{} in the world", geometry.shape.kind()),
        }
    });
    format!("{first} and {second}")
}
