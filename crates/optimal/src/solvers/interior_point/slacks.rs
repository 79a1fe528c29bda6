//! Constraint rows of a horizon, with their slack variables and multipliers.

mod barrier;
mod soft;
mod steps;

use crate::error::Error;
use crate::lq::{ConstraintRow, LqKnot, RowTerms};
use crate::problem::{Problem, Shape, outside};
use crate::solvers::outcome::{Violation, ViolationKind};
use crate::solvers::retime::Retiming;
use barrier::{Barrier, Products, StepLimits, padded};
use core::ops::Range;
use soft::SoftRows;

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
    /// Row of a soft limit.
    Soft,
}

/// Constraint rows lower ≤ g(x, u) ≤ upper of all knots: the constraints of a knot, followed by the bounds on its
/// controls. An inequality has a slack variable s with g − s = 0, and a multiplier z of each bound:
///
/// ```text
/// z_l (s − lower) = μ,     z_u (upper − s) = μ,     y = z_u − z_l
/// ```
///
/// A row of a soft limit is an inequality, also if its bounds are equal. Each of its bounds gives way by a distance e,
/// whose cost is part of the problem. Such rows have no part in the violation.
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
    /// Indices of the equations.
    equations: Vec<usize>,
    /// Values g at the iterate, and at a trial.
    g: Vec<f64>,
    trial: Vec<f64>,
    /// Slack variables and multipliers of the inequalities.
    barrier: Barrier,
    soft: SoftRows,
    /// Multipliers of the rows, and their steps.
    y: Vec<f64>,
    dy: Vec<f64>,
    limits: StepLimits,
    /// Slope and curvature with which each row enters the sweep.
    terms: Vec<[f64; 2]>,
    /// Diagonals of R at knots in inverse-dynamics form, without the terms of bounds. Shape: flat controls.
    diagonals: Vec<f64>,
    /// Offsets, s, z and y before a shift.
    old: (Vec<usize>, [Vec<f64>; 4]),
    /// Numbers of constraints before a retiming.
    old_counts: Vec<usize>,
    /// Numbers s, z and y before a tick.
    saved: [Vec<f64>; 4],
}

/// Residuals of all rows at an iterate.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct RowResiduals {
    /// Largest distance of a value g from its bounds.
    pub(super) violation: f64,
    /// Largest difference between μ and the product of a multiplier and its distance.
    pub(super) complementarity: f64,
    /// Largest gradient with respect to a distance by which a soft limit gives way.
    pub(super) stationarity: f64,
    /// Sum of the absolute values of all multipliers, and their number.
    pub(super) sum: f64,
    pub(super) count: usize,
}

impl Slacks {
    /// Reads the number of rows and the bounds of each knot. Allocates only if there were never as many rows.
    pub(super) fn arrange(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let (horizon, controls) = (problem.horizon(), problem.shape().offsets[problem.horizon()]);
        let Self { offsets, counts, lower, upper, kinds, soft, .. } = self;
        soft.clear();
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
                    kinds.push(match (part.and_then(|part| part.soft), fixed) {
                        (Some(cost), _) => {
                            soft.push(lower.len() - 1, cost, [low, high], !fixed);
                            RowKind::Soft
                        }
                        (None, true) => RowKind::Fixed,
                        (None, false) => RowKind::of(low, high),
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
        self.barrier.clear();
        self.equations.clear();
        for (i, kind) in kinds.iter().enumerate() {
            self.barrier.push(match kind {
                RowKind::Inequality => [lower[i], upper[i]],
                _ => [f64::NEG_INFINITY, f64::INFINITY],
            });
            if *kind == RowKind::Equation {
                self.equations.push(i);
            }
        }
        self.barrier.complete();
        let all = padded(lower.len());
        let Self { g, trial, y, dy, .. } = self;
        for numbers in [g, trial, y, dy] {
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
        self.keep_old();
        self.arrange(problem)?;
        let Self { offsets, barrier: Barrier { s, z: [zl, zu], .. }, y, old: (before, numbers), .. } = self;
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

    /// Reads the rows of a problem whose knots have other times. Each knot takes s, z and y of limits from the knot of
    /// the old horizon that the retiming names. Multipliers are proportional to the duration of a knot.
    pub(super) fn retime(&mut self, problem: &mut Problem, retiming: &Retiming) -> Result<(), Error> {
        self.keep_old();
        std::mem::swap(&mut self.old_counts, &mut self.counts);
        self.arrange(problem)?;
        let Self { offsets, counts, barrier: Barrier { s, z: [zl, zu], .. }, y, old, old_counts, .. } = self;
        let (before, numbers) = &*old;
        for (old, now) in numbers.iter().zip([s, zl, zu, y]) {
            let is_slack = core::ptr::eq(old, &numbers[0]);
            now.fill(0.0);
            let mut copy = |to: usize, from: usize, count: usize, scale: f64| {
                let scale = if is_slack { 1.0 } else { scale };
                now[to..to + count].iter_mut().zip(&old[from..from + count]).for_each(|(now, old)| *now = scale * old);
            };
            for t in 0..counts.len() {
                retiming.each_rows(problem, t, &mut |to, knot, from, scale| {
                    if from.end <= old_counts[knot] {
                        copy(offsets[t] + to.start, before[knot] + from.start, from.len(), scale);
                    }
                });
                let Some(source) = retiming.sources.get(t) else { continue };
                let (to, from) = (offsets[t] + counts[t], before[source.knot] + old_counts[source.knot]);
                let bounds = offsets[t + 1] - to;
                if source.has_controls && bounds == before[source.knot + 1] - from {
                    copy(to, from, bounds, source.scale);
                }
            }
        }
        Ok(())
    }

    /// Copies offsets, s, z and y before the rows change.
    fn keep_old(&mut self) {
        let (offsets, numbers) = &mut self.old;
        offsets.clone_from(&self.offsets);
        let Barrier { s, z: [zl, zu], .. } = &self.barrier;
        for (old, now) in numbers.iter_mut().zip([s, zl, zu, &self.y]) {
            old.clone_from(now);
        }
    }

    /// Saves s, z and y. Allocates only if there were never as many rows.
    pub(super) fn save(&mut self) {
        let Self { barrier: Barrier { s, z: [zl, zu], .. }, y, saved, .. } = self;
        for (saved, now) in saved.iter_mut().zip([s, zl, zu, y]) {
            saved.clear();
            saved.reserve(now.capacity()); // the rows of later ticks fit too
            saved.extend_from_slice(now);
        }
    }

    /// Takes back the s, z and y that were saved for the same rows. [`resume`](Self::resume) computes what follows from
    /// them.
    pub(super) fn restore(&mut self) {
        let Self { barrier: Barrier { s, z: [zl, zu], .. }, y, saved, .. } = self;
        for (saved, now) in saved.iter().zip([s, zl, zu, y]) {
            now.clone_from(saved);
        }
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

    /// Returns the number of products of multipliers and distances: one for each finite bound of an inequality, and up
    /// to two for each finite bound of a soft limit.
    pub(super) fn bound_count(&self) -> usize {
        self.barrier.count + self.soft.count
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
                self.fix_rows(knot);
            }
            if inverse {
                self.diagonals[shape.u(t)].copy_from_slice(&knot.inverse_dynamics.diagonal[n / 2..]);
            }
        }
    }

    /// Marks the rows of knot 0 that no control changes.
    fn fix_rows(&mut self, knot: &LqKnot) {
        let is_of_state = |(first, entries): (usize, &[f64])| first + entries.len() <= knot.ndx();
        let mut groups = knot.rows.groups().peekable();
        for (i, run) in knot.rows.runs().enumerate() {
            while groups.next_if(|group| group.rows.end <= i).is_some() {}
            let fixed = match groups.peek().filter(|group| group.rows.contains(&i)) {
                Some(group) => group.forms().all(is_of_state),
                None => is_of_state(run),
            };
            if !fixed || matches!(self.kinds[i], RowKind::Free | RowKind::Fixed) {
                continue;
            }
            if self.kinds[i] == RowKind::Soft {
                self.soft.fix(i);
                self.y[i] = 0.0;
                continue;
            }
            self.kinds[i] = RowKind::Fixed;
            self.equations.retain(|&equation| equation != i);
            self.barrier.free(i);
            self.y[i] = 0.0;
        }
    }

    /// Sets s to the values g, moved into the interior, and z to the central path. Sets y to zero for equations.
    pub(super) fn start(&mut self, mu: f64) {
        for i in 0..self.len() {
            self.y[i] = 0.0;
            if self.kinds[i] == RowKind::Inequality {
                self.barrier.s[i] = self.inside(i, INTERIOR);
                let [zl, zu] = self.barrier.distances(i).map(|distance| mu / distance);
                (self.barrier.z[0][i], self.barrier.z[1][i], self.y[i]) = (zl, zu, zu - zl);
            }
        }
        self.barrier.renew();
        self.soft.start(&self.g, mu, &mut self.y);
    }

    /// Sets s to the values g where they are inside, and moves z to the neighbourhood of the central path. Keeps y of
    /// equations.
    pub(super) fn resume(&mut self, mu: f64) {
        for i in (0..self.len()).filter(|&i| self.kinds[i] == RowKind::Inequality) {
            let old = self.barrier.s[i];
            let is_inside = |s: f64| s > self.lower[i] && s < self.upper[i];
            self.barrier.s[i] = match is_inside(self.g[i]) {
                true => self.inside(i, 1e-6),
                false if is_inside(old) => old,
                false => self.inside(i, INTERIOR),
            };
            self.barrier.center(i, mu, OFF_PATH_RESUMED);
            self.y[i] = self.barrier.z[1][i] - self.barrier.z[0][i];
        }
        self.barrier.renew();
        self.soft.resume(&self.g, mu, &mut self.y, OFF_PATH_RESUMED);
    }

    /// Sets y of consecutive rows of knot t, from row `first` on. The sign of y chooses the bound whose multiplier is
    /// |y|. The multiplier of the other bound is 0, so that [`resume`](Self::resume) moves it to the central path. A
    /// new problem must have been [arranged](Self::arrange).
    pub(super) fn set_multipliers(&mut self, t: usize, first: usize, y: &[f64]) {
        for (i, &y) in (self.offsets[t] + first..).zip(y) {
            let z = &mut self.barrier.z;
            (z[0][i], z[1][i], self.y[i]) = ((-y).max(0.0), y.max(0.0), y);
        }
    }

    /// Sets all multipliers to 0.
    pub(super) fn forget(&mut self) {
        let Self { barrier: Barrier { z: [zl, zu], .. }, y, .. } = self;
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

    /// Returns the multiplier of row i in the gradient of the Lagrangian.
    fn multiplier(&self, i: usize) -> f64 {
        if self.kinds[i].is_imposed() || self.kinds[i] == RowKind::Soft { self.y[i] } else { 0.0 }
    }

    /// Returns the mean and the smallest product of a multiplier and its distance; `None` without inequalities.
    pub(super) fn products(&self) -> Option<[f64; 2]> {
        let (products, count) = (self.all_products(), self.bound_count());
        (count > 0).then(|| [products.sum / count as f64, products.least])
    }

    fn all_products(&self) -> Products {
        self.barrier.products.and(self.soft.products)
    }

    /// Returns the residuals of all rows at the iterate.
    pub(super) fn residuals(&self) -> RowResiduals {
        let Self { equations, g, lower, upper, .. } = self;
        let products = self.all_products();
        let mut violation = 0.0;
        for ((kind, g), (lower, upper)) in self.kinds.iter().zip(g).zip(lower.iter().zip(upper)) {
            let counts = kind.is_imposed() || *kind == RowKind::Soft && g.is_nan();
            let e = if counts { outside(*g, *lower, *upper).abs() } else { 0.0 };
            violation = if e > violation || e.is_nan() { e } else { violation };
        }
        RowResiduals {
            violation,
            complementarity: products.largest,
            stationarity: self.soft.stationarity(),
            sum: products.multipliers + equations.iter().map(|&i| self.y[i].abs()).sum::<f64>(),
            count: self.barrier.count + self.soft.bounds + equations.len(),
        }
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
                let is_counted = self.kinds[i] != RowKind::Soft && imposed == (self.kinds[i] != RowKind::Fixed);
                if amount > least && is_counted {
                    let kind =
                        if row < self.counts[t] { ViolationKind::Constraint } else { ViolationKind::ControlBound };
                    let row = if row < self.counts[t] { row } else { row - self.counts[t] };
                    worst = Some(Violation { kind, ..Violation::of_row(t, row, None, amount) });
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
                violation.set_part(part, own - part.first);
            }
            first += bounded.count;
        });
        worst
    }

    /// Returns whether controls change a row of a soft limit.
    pub(super) fn has_soft_rows(&self) -> bool {
        self.soft.count > 0
    }

    /// Returns the cost of the values g of soft limits that controls change.
    pub(super) fn soft_cost(&self) -> f64 {
        self.soft.cost(&self.g)
    }

    /// Writes the rows of soft limits that gave way by more than `tolerance`. Returns the cost of soft limits.
    pub(super) fn write_given_way(&self, problem: &mut Problem, tolerance: f64, out: &mut Vec<Violation>) -> f64 {
        problem.write_given_way(tolerance, out, |bounded, t, before, i| {
            outside(self.g[self.offsets[t] + before + i], bounded.lower[i], bounded.upper[i]).abs()
        })
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

    /// Returns whether the row must hold.
    fn is_imposed(self) -> bool {
        matches!(self, Self::Equation | Self::Inequality)
    }
}
