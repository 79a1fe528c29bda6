//! Distances between bodies, as rows of the program.

use crate::cone_program::ConeProgram;
use crate::error::Error;
use crate::least_squares::{LeastSquares, dot};
use condyle_dynamics::distances::{DistancePairs, Distances, GeometryPair};
use condyle_dynamics::{Data, Model, forward_kinematics, integrate};

/// Time by which the robot moves for the difference of two gradients (s).
const STEP: f64 = 1e-6;

/// Limits of the distances d of pairs of geometries, as bounds on their accelerations:
///
/// ```text
/// d̈ = g q̈ + ġ v ≥ −(2 / T) ḋ − (d − d_min) / T²        g = ∂d/∂q
/// ```
///
/// A distance approaches its minimum no faster than a critically damped spring with time constant T would (an
/// exponential control barrier function: Nguyen and Sreenath, 2016). The bound is at most a_max, so a pair that is too
/// near moves apart with at most a_max. If dynamics, contacts and torques allow no such acceleration, the bound becomes
/// a task of large weight at that tick.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceLimits {
    /// Pairs of geometries of the robot, or of the robot and its surroundings.
    pub pairs: Vec<GeometryPair>,
    /// d_min, the minimum distance (m).
    pub minimum: f64,
    /// Look-ahead time T (s); at least the duration of several ticks.
    pub look_ahead: f64,
    /// a_max (m/s²).
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

    pub(crate) fn check(&self) -> Result<(), Error> {
        let above = |x: f64| x > 0.0 && x.is_finite();
        for (name, value, is_valid, allowed) in [
            ("distances.minimum", self.minimum, self.minimum.is_finite(), "finite"),
            ("distances.look_ahead", self.look_ahead, above(self.look_ahead), "above 0"),
            ("distances.max_acceleration", self.max_acceleration, above(self.max_acceleration), "above 0"),
            ("distances.range", self.range, self.range > 0.0, "above 0"),
        ] {
            if !is_valid {
                return Err(Error::Setting { name, value, allowed });
            }
        }
        Ok(())
    }
}

/// Distances of a robot at one state, and the memory for them.
pub(crate) struct Separation {
    limits: DistanceLimits,
    pairs: DistancePairs,
    data: Data<f64>,
    now: Distances,
    after: Distances,
    /// Scratch: the step v STEP, and the position after this step.
    step: Vec<f64>,
    q: Vec<f64>,
    /// Lower bound of g q̈ for each pair; −∞ for a pair that is far away.
    bounds: Vec<f64>,
}

impl Separation {
    /// Prepares the pairs for a robot.
    ///
    /// # Errors
    /// [`Error::Model`] for an invalid pair.
    pub(crate) fn new(model: &Model, limits: &DistanceLimits) -> Result<Self, Error> {
        let mut pairs = DistancePairs::new(model, &limits.pairs)?;
        pairs.set_cutoff(limits.minimum.max(0.0) + limits.range);
        Ok(Self {
            limits: limits.clone(),
            data: Data::new(model),
            now: Distances::new(&pairs),
            after: Distances::new(&pairs),
            step: vec![0.0; model.nv()],
            q: vec![0.0; model.nq()],
            bounds: vec![f64::NEG_INFINITY; pairs.len()],
            pairs,
        })
    }

    /// Returns the number of pairs, each of which has a row.
    pub(crate) fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Computes the rows at the state (q, v), and writes them to the program from row `first` on.
    pub(crate) fn write(&mut self, model: &Model, q: &[f64], v: &[f64], program: &mut ConeProgram, first: usize) {
        let Self { limits, pairs, data, now, after, step, q: moved, bounds } = self;
        let (T, most) = (limits.look_ahead, limits.max_acceleration);
        pairs.gradients(forward_kinematics(model, data, q), now);
        step.iter_mut().zip(v).for_each(|(step, v)| *step = STEP * v);
        integrate(model, q, step, moved);
        pairs.gradients(forward_kinematics(model, data, moved), after);
        let unknowns = program.size.unknowns;
        for (k, bound) in bounds.iter_mut().enumerate() {
            let (g, room) = (now.gradient(k), now.distance(k) - limits.minimum);
            *bound = f64::NEG_INFINITY;
            if now.is_near(k) && room < limits.range {
                let rate = dot(g, v);
                // ġ v by a difference; at an edge, where g jumps, it is limited
                let drift = ((dot(after.gradient(k), v) - rate) / STEP).clamp(-most, most);
                *bound = (-2.0 / T * rate - room / (T * T)).min(most) - drift;
            }
            let row = &mut program.row_mut(first + k)[..unknowns];
            row.fill(0.0);
            row[..g.len()].copy_from_slice(g);
            (program.lower[first + k], program.upper[first + k]) = (*bound, f64::INFINITY);
        }
    }

    /// Removes the bounds from the rows of the program. A pair whose bound excludes zero acceleration gets a task of
    /// this weight for the bound.
    pub(crate) fn relax(&self, program: &mut ConeProgram, first: usize, objective: &mut LeastSquares, weight: f64) {
        for (k, &bound) in self.bounds.iter().enumerate() {
            program.lower[first + k] = f64::NEG_INFINITY;
            if bound > 0.0 {
                let g = self.now.gradient(k);
                objective.add_row(weight, bound, |row| row[..g.len()].copy_from_slice(g));
            }
        }
    }
}
