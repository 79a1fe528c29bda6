//! Solution in the units of the original program.

use super::scaled::Source;
use super::workspace::Workspace;
use crate::cone_program::{Multipliers, Size};

/// Unknowns x and all multipliers. The vectors have the sizes of the capacity.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    /// Number of unknowns of the program that has this solution; `None` if there is no such program.
    pub solves: Option<usize>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Multipliers of the lower and of the upper bounds. The field `z` is their difference.
    pub sides: [Vec<f64>; 2],
    pub z: Vec<f64>,
    pub w: Vec<f64>,
}

impl Solution {
    pub(super) fn new(capacity: Size) -> Self {
        let Size { unknowns, equalities, rows, cone_rows } = capacity;
        let zeros = |length: usize| vec![0.0; length];
        let sides = [zeros(rows), zeros(rows)];
        Self { solves: None, x: zeros(unknowns), y: zeros(equalities), sides, z: zeros(rows), w: zeros(cone_rows) }
    }

    pub(super) fn clear(&mut self) {
        let Self { solves, x, y, sides: [lower, upper], z, w } = self;
        *solves = None;
        for x in [x, y, lower, upper, z, w] {
            x.fill(0.0);
        }
    }

    /// Stores a given solution.
    pub(super) fn set(&mut self, x: &[f64], multipliers: Multipliers<'_>) {
        self.clear();
        self.solves = Some(x.len());
        let Multipliers { equalities, rows, cones } = multipliers;
        for (to, from) in [(&mut self.x, x), (&mut self.y, equalities), (&mut self.z, rows), (&mut self.w, cones)] {
            to[..from.len()].copy_from_slice(from);
        }
        for (i, z) in rows.iter().enumerate() {
            (self.sides[0][i], self.sides[1][i]) = (z.max(0.0), (-z).max(0.0));
        }
    }

    /// Returns the multiplier of the lower (k = 0) or upper (k = 1) bound of the constraint `source`.
    pub(super) fn of(&self, source: Source, k: usize) -> f64 {
        match source {
            Source::Row(i) => self.sides[k][i],
            Source::Equality(i) if k == 0 => self.y[i],
            Source::Cone(i) if k == 0 => self.w[i],
            _ => 0.0,
        }
    }

    /// Stores the iterate of the workspace, converted to the units of the original program.
    pub(super) fn read(&mut self, work: &Workspace) {
        self.clear();
        let data = &work.data;
        for j in 0..data.n {
            self.x[j] = data.units[j] * work.x[j];
        }
        for (k, &source) in data.equality_sources.iter().enumerate() {
            let multiplier = work.y[k] * data.equality_scales[k] / data.cost;
            match source {
                Source::Equality(i) => self.y[i] = multiplier,
                Source::Row(i) => self.sides[usize::from(multiplier < 0.0)][i] = multiplier.abs(),
                Source::Cone(i) => self.w[i] = multiplier,
            }
        }
        for (k, (side, has)) in work.sides.iter().zip([&data.has_lower, &data.has_upper]).enumerate() {
            for (i, &source) in data.sources.iter().enumerate() {
                let multiplier = has[i] * side.z[i] * data.scales[i] / data.cost;
                match source {
                    Source::Row(row) => self.sides[k][row] = multiplier,
                    Source::Cone(row) if k == 0 => self.w[row] = multiplier,
                    _ => {}
                }
            }
        }
        for cone in &data.cones {
            for i in 0..cone.dim {
                self.w[cone.source + i] = work.cones.z[cone.at + i] * cone.scale / data.cost;
            }
        }
        for (z, (lower, upper)) in self.z.iter_mut().zip(self.sides[0].iter().zip(&self.sides[1])) {
            *z = lower - upper;
        }
    }
}
