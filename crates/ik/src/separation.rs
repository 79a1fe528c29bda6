//! Limits of distances between bodies, as rows of a step's program:
//!
//! ```text
//! ∂d/∂q Δq + T ∂d/∂t ≥ −min(T / T_look, 1) (d − d_min)
//! ```
//!
//! T is the duration of the step, and T_look the look-ahead time. If the limits of the joints do not allow this for all
//! pairs at once, the pairs at least do not come nearer, and the step's status is
//! [`Status::Relaxed`](crate::Status::Relaxed).

use crate::active_set::ActiveSet;
use crate::error::Error;
use condyle_dynamics::distances::{DistanceLimits, DistancePairs, Distances};
use condyle_dynamics::{Model, Placements};

/// Distances of a robot, and the memory of their rows.
#[derive(Clone, Debug)]
pub(crate) struct Separation {
    pub pairs: DistancePairs,
    minimum: f64,
    /// min(T / T_look, 1).
    approach: f64,
    /// T, the duration of a step (s).
    dt: f64,
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
            approach: (dt / limits.look_ahead).min(1.0),
            dt,
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
                program.b.push(-self.approach * room - self.dt * self.pairs.rate(&self.results, pair));
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
    let [first, second] = pairs.geometries_of(pair).map(|geometry| pairs.geometry(geometry));
    format!("{first} and {second}")
}
