//! Distances between bodies, as rows of the program:
//!
//! ```text
//! d̈ = g q̈ + ġ v ≥ −(2 / T) ḋ − (d − d_min) / T²        g = ∂d/∂q,   ḋ = g v + ∂d/∂t
//! ```
//!
//! The velocities of obstacles count as constant. If dynamics, contacts and torques allow no such acceleration, the
//! bound becomes a task of large weight at that tick.

use crate::cone_program::ConeProgram;
use crate::error::Error;
use crate::least_squares::{LeastSquares, dot};
use condyle_dynamics::distances::{DistanceLimits, DistancePairs, Distances};
use condyle_dynamics::{Data, Model, Motion, Se3, forward_kinematics, integrate, lie};

/// Time by which the robot moves for the difference of two gradients (s).
const STEP: f64 = 1e-6;

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
    /// Scratch: obstacles that move, with their placements.
    moving: Vec<(usize, Se3<f64>)>,
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
            moving: Vec::with_capacity(pairs.geometry_count()),
            pairs,
        })
    }

    /// Returns the number of pairs, each of which has a row.
    pub(crate) fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Returns the pairs, to move obstacles.
    pub(crate) fn pairs_mut(&mut self) -> &mut DistancePairs {
        &mut self.pairs
    }

    /// Computes the rows at the state (q, v), and writes them to the program from row `first` on.
    pub(crate) fn write(&mut self, model: &Model, q: &[f64], v: &[f64], program: &mut ConeProgram, first: usize) {
        let Self { limits, pairs, data, now, after, step, q: moved, bounds, moving } = self;
        let (T, most) = (limits.look_ahead, limits.max_acceleration);
        pairs.gradients(forward_kinematics(model, data, q), now);
        step.iter_mut().zip(v).for_each(|(step, v)| *step = STEP * v);
        integrate(model, q, step, moved);
        moving.clear();
        let placement = |geometry| (geometry, pairs.geometry(geometry).placement);
        moving.extend((0..pairs.geometry_count()).filter(|&g| pairs.velocity(g) != Motion::zero()).map(placement));
        for &(geometry, placement) in &*moving {
            let v = pairs.velocity(geometry);
            let turn = lie::exp3(v.angular.scale(STEP)).to_rotation();
            let translation = placement.translation + v.linear.scale(STEP);
            pairs.place(geometry, Se3::new(turn * placement.rotation, translation));
        }
        pairs.gradients(forward_kinematics(model, data, moved), after);
        let unknowns = program.size.unknowns;
        for (k, bound) in bounds.iter_mut().enumerate() {
            let (g, room) = (now.gradient(k), now.distance(k) - limits.minimum);
            *bound = f64::NEG_INFINITY;
            if now.is_near(k) && room < limits.range {
                let rate = dot(g, v) + pairs.rate(now, k);
                // d̈ at q̈ = 0 by a difference of ḋ; at an edge, where g jumps, it is limited
                let later = dot(after.gradient(k), v) + pairs.rate(after, k);
                let drift = ((later - rate) / STEP).clamp(-most, most);
                *bound = (-2.0 / T * rate - room / (T * T)).min(most) - drift;
            }
            let row = &mut program.row_mut(first + k)[..unknowns];
            row.fill(0.0);
            row[..g.len()].copy_from_slice(g);
            (program.lower[first + k], program.upper[first + k]) = (*bound, f64::INFINITY);
        }
        moving.iter().for_each(|&(geometry, placement)| pairs.place(geometry, placement));
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
