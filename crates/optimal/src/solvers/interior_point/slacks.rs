//! Constraint rows of a horizon, with their slack variables and multipliers.

mod steps;

use crate::error::Error;
use crate::lq::{ConstraintRow, LqKnot, RowTerms};
use crate::problem::{Problem, Shape, outside};
use crate::solvers::outcome::{Violation, ViolationKind};
use core::ops::Range;

/// Smallest distance of an initial slack variable from a bound, relative to the bound and to the distance of the
/// bounds.
const INTERIOR: f64 = 1e-2;
/// Largest factor between a multiplier and its value μ / distance on the central path, when a solve is resumed.
const OFF_PATH_RESUMED: f64 = 1e3;

/// Kind of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RowKind {
    /// Row without a finite bound.
    Free,
    /// Row of knot 0 that no control changes. It is reported, but not imposed.
    Fixed,
    /// Row with equal bounds.
    Equation,
    /// Row with a finite bound.
    Inequality,
}

/// Constraint rows lower ≤ g(x, u) ≤ upper of all knots: the constraints of a knot, followed by the bounds on its
/// controls. An inequality has a slack variable s with g − s = 0, and a multiplier z of each bound:
///
/// ```text
/// z_l (s − lower) = μ,     z_u (upper − s) = μ,     y = z_u − z_l
/// ```
///
/// The multiplier y of a row follows from the sweep, y⁺ = d + Σ ∂g δ. At the solution y = z_u − z_l, but y is more
/// accurate: near a bound, z contains the rounding error of g times Σ.
#[derive(Debug, Clone, Default)]
pub(super) struct Slacks {
    /// Index of the first row of each knot, and the number of all rows. Shape: N + 2.
    offsets: Vec<usize>,
    /// Number of constraints of each knot, without bounds on controls. Shape: N + 1.
    counts: Vec<usize>,
    kinds: Vec<RowKind>,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Values g at the iterate, and at a trial.
    g: Vec<f64>,
    trial: Vec<f64>,
    s: Vec<f64>,
    /// Multipliers of the lower bounds, and of the upper bounds.
    z: [Vec<f64>; 2],
    /// Multipliers of the rows.
    y: Vec<f64>,
    ds: Vec<f64>,
    dz: [Vec<f64>; 2],
    dy: Vec<f64>,
    /// Slope and curvature with which each row enters the sweep.
    terms: Vec<[f64; 2]>,
    /// Diagonals of R at knots in inverse-dynamics form, without the terms of bounds. Shape: flat controls.
    diagonals: Vec<f64>,
    /// Offsets, s, z and y before a shift.
    old: (Vec<usize>, [Vec<f64>; 4]),
}

/// Residuals of all rows at an iterate.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RowResiduals {
    /// Largest distance of a value g from its bounds.
    pub(super) violation: f64,
    /// Largest difference between μ and the product of a multiplier and its distance.
    pub(super) complementarity: f64,
    /// Sum of the absolute values of all multipliers, and their number.
    pub(super) sum: f64,
    pub(super) count: usize,
}

impl Slacks {
    /// Reads the number of rows and the bounds of each knot. Allocates only if there were never as many rows.
    pub(super) fn arrange(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let (horizon, controls) = (problem.horizon(), problem.shape().offsets[problem.horizon()]);
        let Self { offsets, counts, lower, upper, kinds, .. } = self;
        offsets.clear();
        counts.clear();
        lower.clear();
        upper.clear();
        kinds.clear();
        offsets.push(0);
        for t in 0..=horizon {
            let (mut result, mut count) = (Ok(()), 0);
            let has_controls = problem.nu(t) > 0;
            problem.constraints(t, &mut |bounded| {
                result = result.clone().and(bounded.check(t));
                count += bounded.count;
                for i in 0..bounded.count {
                    let (low, high) = (bounded.lower[i], bounded.upper[i]);
                    let part = bounded.parts.iter().rfind(|part| part.first <= i);
                    let fixed = t == 0 && (!has_controls || part.is_some_and(|part| part.of_state));
                    lower.push(low);
                    upper.push(high);
                    kinds.push(match fixed {
                        true => RowKind::Fixed,
                        false => RowKind::of(low, high),
                    });
                }
            });
            result?;
            counts.push(count);
            if t < horizon
                && let Some((low, high)) = problem.action(t).bounds(t)
            {
                lower.extend_from_slice(low);
                upper.extend_from_slice(high);
                kinds.extend(low.iter().zip(high).map(|(low, high)| RowKind::of(*low, *high)));
            }
            offsets.push(lower.len());
        }
        let all = lower.len();
        let Self { g, trial, s, z: [zl, zu], y, ds, dz: [dzl, dzu], dy, .. } = self;
        for numbers in [g, trial, s, zl, zu, y, ds, dzl, dzu, dy] {
            numbers.resize(all, 0.0);
        }
        self.terms.resize(all, [0.0; 2]);
        self.diagonals.resize(controls, 0.0);
        Ok(())
    }

    /// Reads the rows of a problem that was shifted by one knot. Each knot takes s, z and y of the knot after it, if
    /// both have the same number of rows. The last knot before the terminal one takes the numbers of the knot before
    /// it.
    pub(super) fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let (offsets, numbers) = &mut self.old;
        offsets.clone_from(&self.offsets);
        for (old, now) in numbers.iter_mut().zip([&self.s, &self.z[0], &self.z[1], &self.y]) {
            old.clone_from(now);
        }
        self.arrange(problem)?;
        let Self { offsets, s, z: [zl, zu], y, old: (before, numbers), .. } = self;
        let horizon = problem.horizon();
        if before.len() != offsets.len() {
            return Ok(());
        }
        for (old, now) in numbers.iter().zip([s, zl, zu, y]) {
            for t in 0..=horizon {
                let from = if t == horizon { t } else { (t + 1).min(horizon - 1) };
                let (from, to) = (before[from]..before[from + 1], offsets[t]..offsets[t + 1]);
                match from.len() == to.len() {
                    true => now[to].copy_from_slice(&old[from]),
                    false => now[to].fill(0.0),
                }
            }
        }
        Ok(())
    }

    /// Returns the number of all rows.
    pub(super) fn len(&self) -> usize {
        self.kinds.len()
    }

    /// Returns the largest number of constraints of a knot, without bounds on controls.
    pub(super) fn most(&self) -> usize {
        self.counts.iter().copied().max().unwrap_or(0)
    }

    /// Returns the slopes and curvatures of the rows, as the sweep reads them.
    pub(super) fn row_terms(&self) -> RowTerms<'_> {
        RowTerms { offsets: &self.offsets, terms: &self.terms }
    }

    fn knot(&self, t: usize) -> Range<usize> {
        self.offsets[t]..self.offsets[t + 1]
    }

    fn inequalities(&self) -> impl Iterator<Item = usize> {
        (0..self.len()).filter(|&i| self.kinds[i] == RowKind::Inequality)
    }

    /// Returns the distances of s from both bounds of row i, for a step of length α; infinite where a bound is.
    fn distances(&self, i: usize, alpha: f64) -> [f64; 2] {
        let s = self.s[i] + alpha * self.ds[i];
        [s - self.lower[i], self.upper[i] - s]
    }

    /// Returns the number of finite bounds of inequalities.
    pub(super) fn bound_count(&self) -> usize {
        let finite = |i: usize| usize::from(self.lower[i].is_finite()) + usize::from(self.upper[i].is_finite());
        self.inequalities().map(finite).sum()
    }

    /// Takes the values of a trial from `values` (N + 1 equal parts) and from the controls.
    pub(super) fn take_trial(&mut self, values: &[f64], us: &[f64], shape: &Shape) {
        let room = values.len() / self.counts.len();
        for (t, &count) in self.counts.iter().enumerate() {
            let to = &mut self.trial[self.offsets[t]..self.offsets[t + 1]];
            let (constraints, bounds) = to.split_at_mut(count);
            constraints.copy_from_slice(&values[t * room..][..count]);
            if !bounds.is_empty() {
                bounds.copy_from_slice(&us[shape.u(t)]);
            }
        }
    }

    /// Makes the values of the last trial the values of the iterate.
    pub(super) fn accept_trial(&mut self) {
        std::mem::swap(&mut self.g, &mut self.trial);
    }

    /// Appends the bounds on controls to the rows of the knots, and stores the diagonals of R of knots in
    /// inverse-dynamics form.
    pub(super) fn complete_rows(&mut self, knots: &mut [LqKnot], shape: &Shape) {
        for (t, knot) in knots.iter_mut().enumerate() {
            let (n, m) = (knot.ndx(), knot.nu());
            let inverse = knot.structure.is_inverse_dynamics();
            let first = n + if inverse { m } else { 0 };
            for (j, i) in (self.offsets[t] + self.counts[t]..self.offsets[t + 1]).enumerate() {
                let (lower, upper) = (self.lower[i], self.upper[i]);
                knot.rows.push(ConstraintRow { first: first + j, entries: &[1.0], c: self.g[i], lower, upper });
            }
            if t == 0 {
                for (row, kind) in knot.rows.iter().zip(&mut self.kinds) {
                    if row.first + row.entries.len() <= n && *kind != RowKind::Free {
                        *kind = RowKind::Fixed; // no control changes the row
                    }
                }
            }
            if inverse {
                self.diagonals[shape.u(t)].copy_from_slice(&knot.inverse_dynamics.diagonal[n / 2..]);
            }
        }
    }

    /// Sets s to the values g, moved into the interior, and z to the central path. Sets y to zero for equations.
    pub(super) fn start(&mut self, mu: f64) {
        for i in 0..self.len() {
            let z = if self.kinds[i] == RowKind::Inequality {
                self.s[i] = self.inside(i, INTERIOR);
                self.distances(i, 0.0).map(|distance| mu / distance)
            } else {
                [0.0; 2]
            };
            (self.z[0][i], self.z[1][i], self.y[i]) = (z[0], z[1], z[1] - z[0]);
        }
    }

    /// Sets s to the values g where they are inside, and moves z to the neighbourhood of the central path. Keeps y.
    pub(super) fn resume(&mut self, mu: f64) {
        for i in 0..self.len() {
            if self.kinds[i] != RowKind::Inequality {
                continue;
            }
            let old = self.s[i];
            let is_inside = |s: f64| s > self.lower[i] && s < self.upper[i];
            self.s[i] = match is_inside(self.g[i]) {
                true => self.inside(i, 1e-6),
                false if is_inside(old) => old,
                false => self.inside(i, INTERIOR),
            };
            self.center(i, mu, OFF_PATH_RESUMED);
            self.y[i] = self.z[1][i] - self.z[0][i];
        }
    }

    /// Sets y of consecutive rows of knot t, from row `first` on. The sign of y chooses the bound whose multiplier is
    /// |y|. The multiplier of the other bound is 0, so that [`resume`](Self::resume) moves it to the central path. A
    /// new problem must have been [arranged](Self::arrange).
    pub(super) fn set_multipliers(&mut self, t: usize, first: usize, y: &[f64]) {
        for (i, &y) in (self.offsets[t] + first..).zip(y) {
            (self.z[0][i], self.z[1][i], self.y[i]) = ((-y).max(0.0), y.max(0.0), y);
        }
    }

    /// Sets all multipliers to 0.
    pub(super) fn forget(&mut self) {
        let Self { z: [zl, zu], y, .. } = self;
        [zl, zu, y].into_iter().for_each(|numbers| numbers.fill(0.0));
    }

    /// Returns g of row i, moved away from the bounds by the given relative margin.
    fn inside(&self, i: usize, margin: f64) -> f64 {
        let (lower, upper) = (self.lower[i], self.upper[i]);
        let least = |bound: f64| (margin * bound.abs().max(1.0)).min(margin * (upper - lower));
        let mut s = self.g[i];
        if lower.is_finite() {
            s = s.max(lower + least(lower));
        }
        if upper.is_finite() {
            s = s.min(upper - least(upper));
        }
        s
    }

    /// Moves the multipliers of row i to the neighbourhood of the central path. Multipliers of 0 move to the path.
    fn center(&mut self, i: usize, mu: f64, factor: f64) {
        for (z, distance) in [0, 1].into_iter().zip(self.distances(i, 0.0)) {
            let path = mu / distance;
            let given = if self.z[z][i] == 0.0 { path } else { self.z[z][i] };
            self.z[z][i] = given.clamp(path / factor, path * factor); // 0 for an infinite bound
        }
    }

    /// Returns the multiplier of row i in the gradient of the Lagrangian.
    fn multiplier(&self, i: usize) -> f64 {
        match self.kinds[i] {
            RowKind::Free | RowKind::Fixed => 0.0,
            RowKind::Equation | RowKind::Inequality => self.y[i],
        }
    }

    /// Returns the mean and the smallest product of a multiplier and its distance; `None` without inequalities.
    pub(super) fn products(&self) -> Option<[f64; 2]> {
        let (mut sum, mut least, mut count) = (0.0, f64::INFINITY, 0);
        for i in self.inequalities() {
            for (z, distance) in self.z.iter().zip(self.distances(i, 0.0)).filter(|(_, d)| *d != f64::INFINITY) {
                sum += z[i] * distance;
                least = least.min(z[i] * distance);
                count += 1;
            }
        }
        (count > 0).then(|| [sum / count as f64, least])
    }

    /// Returns the residuals of all rows at the iterate.
    pub(super) fn residuals(&self) -> RowResiduals {
        let mut all = RowResiduals::default();
        for i in 0..self.len() {
            if matches!(self.kinds[i], RowKind::Free | RowKind::Fixed) {
                continue;
            }
            let e = outside(self.g[i], self.lower[i], self.upper[i]).abs();
            all.violation = if e > all.violation || e.is_nan() { e } else { all.violation };
            if self.kinds[i] == RowKind::Equation {
                (all.sum, all.count) = (all.sum + self.y[i].abs(), all.count + 1);
                continue;
            }
            for (z, distance) in self.z.iter().zip(self.distances(i, 0.0)).filter(|(_, d)| *d != f64::INFINITY) {
                all.complementarity = all.complementarity.max(z[i] * distance);
                (all.sum, all.count) = (all.sum + z[i], all.count + 1);
            }
        }
        all
    }

    /// Returns the row with the largest violation among the rows that are imposed, or else among the rows that no
    /// control changes.
    pub(super) fn worst(&self, problem: &mut Problem, imposed: bool) -> Option<Violation> {
        let mut worst: Option<Violation> = None;
        for t in 0..self.counts.len() {
            for (row, i) in self.knot(t).enumerate() {
                let amount = outside(self.g[i], self.lower[i], self.upper[i]).abs();
                let amount = if amount.is_nan() { f64::INFINITY } else { amount };
                let least = worst.as_ref().map_or(0.0, |worst| worst.amount);
                if amount > least && imposed == (self.kinds[i] != RowKind::Fixed) {
                    let kind =
                        if row < self.counts[t] { ViolationKind::Constraint } else { ViolationKind::ControlBound };
                    let row = if row < self.counts[t] { row } else { row - self.counts[t] };
                    worst = Some(Violation { kind, knot: t, row, name: None, entry: row, amount });
                }
            }
        }
        let violation = worst.as_mut()?;
        let mut first = 0;
        problem.constraints(violation.knot, &mut |bounded| {
            let own = violation.row.wrapping_sub(first);
            let part = bounded.parts.iter().rfind(|part| part.first <= own);
            if violation.kind == ViolationKind::Constraint
                && own < bounded.count
                && let Some(part) = part
            {
                (violation.name, violation.entry) = (Some(part.name.clone()), own - part.first);
            }
            first += bounded.count;
        });
        worst
    }

    /// Copies the multipliers y of the constraints of each knot, followed by the multipliers of the bounds on its
    /// controls.
    pub(super) fn write_multipliers(&self, out: &mut Vec<Vec<f64>>) {
        out.resize(self.counts.len(), Vec::new());
        for (t, out) in out.iter_mut().enumerate() {
            out.clear();
            out.extend(self.knot(t).map(|i| self.multiplier(i)));
        }
    }
}

impl RowKind {
    /// Returns the kind of a row with the given bounds.
    fn of(lower: f64, upper: f64) -> Self {
        match lower == upper {
            true => Self::Equation,
            false if lower.is_finite() || upper.is_finite() => Self::Inequality,
            false => Self::Free,
        }
    }
}
