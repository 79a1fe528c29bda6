//! Constraint rows of a horizon, with their slack variables and multipliers.
#![allow(non_snake_case)] // names follow the literature: C, D

use crate::error::Error;
use crate::lq::{ConstraintRow, LqKnot, RowTerms};
use crate::problem::{Problem, Shape};
use crate::solvers::outcome::{Violation, ViolationKind};
use condyle_linalg::dot;
use core::ops::Range;

/// Curvature 1/ρ of the proximal term of an equation.
const EQUATION_CURVATURE: f64 = 1e8;
/// Smallest distance of an initial slack variable from a bound, relative to the bound and to the distance of the
/// bounds.
const INTERIOR: f64 = 1e-2;
/// Largest factor between a multiplier and its value μ / distance on the central path.
const OFF_PATH: f64 = 1e10;
/// The same factor when a solve is resumed.
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

    /// Moves the multipliers of row i to the neighbourhood of the central path.
    fn center(&mut self, i: usize, mu: f64, factor: f64) {
        for (z, distance) in [0, 1].into_iter().zip(self.distances(i, 0.0)) {
            let path = mu / distance;
            self.z[z][i] = self.z[z][i].clamp(path / factor, path * factor); // 0 for an infinite bound
        }
    }

    /// Returns the multiplier of row i in the gradient of the Lagrangian.
    fn multiplier(&self, i: usize) -> f64 {
        match self.kinds[i] {
            RowKind::Free | RowKind::Fixed => 0.0,
            RowKind::Equation | RowKind::Inequality => self.y[i],
        }
    }

    /// Adds Σ y ∂g of knot t to the gradients with respect to δx, to the unknowns w and to δu. At a knot that is not in
    /// inverse-dynamics form, the unknowns are δu, and `of_u` is not changed.
    pub(super) fn add_gradient(&self, t: usize, knot: &LqKnot, of_x: &mut [f64], of_w: &mut [f64], of_u: &mut [f64]) {
        let (n, m) = (knot.ndx(), knot.nu());
        for (i, row) in self.knot(t).zip(knot.rows.iter()) {
            let y = self.multiplier(i);
            if y == 0.0 {
                continue;
            }
            let [x, w, u] = split(&row, [n, m]);
            for (to, (first, entries)) in [&mut *of_x, &mut *of_w, &mut *of_u].into_iter().zip([x, w, u]) {
                to[first..].iter_mut().zip(entries).for_each(|(to, entry)| *to += y * entry);
            }
        }
    }

    /// Returns the slope and the curvature with which row i enters the sweep.
    fn term(&self, i: usize, mu: f64) -> [f64; 2] {
        let (g, lower) = (self.g[i], self.lower[i]);
        match self.kinds[i] {
            RowKind::Free | RowKind::Fixed => [0.0; 2],
            RowKind::Equation => [self.y[i] + EQUATION_CURVATURE * (g - lower), EQUATION_CURVATURE],
            RowKind::Inequality => {
                let [below, above] = self.distances(i, 0.0).map(f64::recip);
                let curvature = self.z[0][i] * below + self.z[1][i] * above;
                [curvature * (g - self.s[i]) + mu * (above - below), curvature]
            }
        }
    }

    /// Computes the slope and the curvature of all rows. At knots in inverse-dynamics form, the terms of δu are added
    /// to the gradient `r` and to the diagonal of R.
    pub(super) fn write_terms(&mut self, knots: &mut [LqKnot], r: &[f64], shape: &Shape, mu: f64) {
        for i in 0..self.len() {
            self.terms[i] = self.term(i, mu);
        }
        self.move_terms(knots, r, shape);
    }

    /// Computes terms that minimise ½ Σ w e², where e are the distances of the values g from their bounds and w are the
    /// weights of the rows.
    pub(super) fn write_violation_terms(&mut self, knots: &mut [LqKnot], r: &[f64], shape: &Shape) {
        for i in 0..self.len() {
            let weight = self.weight(i);
            self.terms[i] = match self.kinds[i] {
                RowKind::Free | RowKind::Fixed => [0.0; 2],
                _ => match outside(self.g[i], self.lower[i], self.upper[i]) {
                    e if e != 0.0 || self.kinds[i] == RowKind::Equation => [weight * e, weight],
                    _ => [0.0; 2],
                },
            };
        }
        self.move_terms(knots, r, shape);
    }

    /// Moves the terms of δu at knots in inverse-dynamics form into their gradients and diagonals.
    fn move_terms(&mut self, knots: &mut [LqKnot], r: &[f64], shape: &Shape) {
        for (t, knot) in knots.iter_mut().enumerate().filter(|(_, knot)| knot.structure.is_inverse_dynamics()) {
            let (n, m) = (knot.ndx(), knot.nu());
            let LqKnot { rows, r: gradient, inverse_dynamics, .. } = knot;
            let diagonal = &mut inverse_dynamics.diagonal[n / 2..];
            gradient.as_mut_slice().copy_from_slice(&r[shape.u(t)]);
            diagonal.copy_from_slice(&self.diagonals[shape.u(t)]);
            for (i, row) in self.knot(t).zip(rows.iter()).filter(|(_, row)| row.first >= n + m) {
                let (j, [slope, curvature]) = (row.first - n - m, self.terms[i]);
                gradient[j] += slope;
                diagonal[j] += curvature;
                self.terms[i] = [0.0; 2];
            }
        }
    }

    /// Computes the steps of s, z and y of knot t from the changes δx, w and δu.
    pub(super) fn find_steps(&mut self, t: usize, knot: &LqKnot, dx: &[f64], w: &[f64], du: &[f64], mu: f64) {
        let (n, m) = (knot.ndx(), knot.nu());
        for (i, row) in self.knot(t).zip(knot.rows.iter()) {
            if matches!(self.kinds[i], RowKind::Free | RowKind::Fixed) {
                continue;
            }
            let parts = [dx, w, du].into_iter().zip(split(&row, [n, m]));
            let change: f64 = parts.map(|(d, (first, entries))| short_dot(entries, &d[first..])).sum();
            if self.kinds[i] == RowKind::Equation {
                self.dy[i] = EQUATION_CURVATURE * (self.g[i] - self.lower[i] + change);
                continue;
            }
            let [slope, curvature] = self.term(i, mu);
            self.dy[i] = slope + curvature * change - self.y[i];
            let ds = change + self.g[i] - self.s[i];
            self.ds[i] = ds;
            for (z, (distance, toward)) in self.distances(i, 0.0).into_iter().zip([-1.0, 1.0]).enumerate() {
                let (multiplier, inverse) = (self.z[z][i], distance.recip());
                self.dz[z][i] = mu * inverse - multiplier + toward * multiplier * inverse * ds;
            }
        }
    }

    /// Returns the largest step lengths of s and of z, at most 1, with which each distance and each multiplier keeps at
    /// least the fraction 1 − τ of its value.
    pub(super) fn step_lengths(&self, tau: f64) -> [f64; 2] {
        let (mut primal, mut dual) = (1.0_f64, 1.0_f64);
        for i in self.inequalities() {
            let (ds, [below, above]) = (self.ds[i], self.distances(i, 0.0));
            if -ds > tau * below {
                primal = primal.min(tau * below / -ds);
            }
            if ds > tau * above {
                primal = primal.min(tau * above / ds);
            }
            for (z, dz) in self.z.iter().zip(&self.dz) {
                if -dz[i] > tau * z[i] {
                    dual = dual.min(tau * z[i] / -dz[i]);
                }
            }
        }
        [primal, dual]
    }

    /// Returns Σ |g − s| + Σ |h| and −Σ log of all distances, for a step of length α to the trial.
    pub(super) fn trial_merit(&self, alpha: f64) -> [f64; 2] {
        self.merit(alpha, &self.trial)
    }

    /// Returns Σ |g − s| + Σ |h| and −Σ log of all distances at the iterate.
    pub(super) fn merit_here(&self) -> [f64; 2] {
        self.merit(0.0, &self.g)
    }

    fn merit(&self, alpha: f64, g: &[f64]) -> [f64; 2] {
        let (mut infeasibility, mut logarithms) = (0.0, Logarithms::default());
        for i in 0..self.len() {
            match self.kinds[i] {
                RowKind::Free | RowKind::Fixed => {}
                RowKind::Equation => infeasibility += (g[i] - self.lower[i]).abs(),
                RowKind::Inequality => {
                    infeasibility += (g[i] - self.s[i] - alpha * self.ds[i]).abs();
                    for distance in self.distances(i, alpha).into_iter().filter(|distance| *distance != f64::INFINITY) {
                        logarithms.add(distance);
                    }
                }
            }
        }
        [infeasibility, -logarithms.sum()]
    }

    /// Returns the weight of row i in a sum of squared violations. A bound far from zero tells the size of the row: an
    /// effort of 1 N m beyond 30 N m is a small violation.
    fn weight(&self, i: usize) -> f64 {
        let sizes = [self.lower[i], self.upper[i]].map(f64::abs).into_iter().filter(|b| *b > 0.0 && b.is_finite());
        let size = sizes.fold(f64::INFINITY, f64::min);
        if size.is_finite() { size.max(1.0).powi(-2) } else { 1.0 }
    }

    /// Returns ½ Σ w e², where e are the distances of the values g from their bounds and w are the weights of the rows.
    /// With `of_trial`, g are the values of the trial.
    pub(super) fn squared_violation(&self, of_trial: bool) -> f64 {
        let g = if of_trial { &self.trial } else { &self.g };
        let imposed = (0..self.len()).filter(|&i| !matches!(self.kinds[i], RowKind::Free | RowKind::Fixed));
        0.5 * imposed.map(|i| self.weight(i) * outside(g[i], self.lower[i], self.upper[i]).powi(2)).sum::<f64>()
    }

    /// Returns the derivative of −Σ log of all distances along the step.
    pub(super) fn barrier_slope(&self) -> f64 {
        let slope = |i: usize| {
            let [below, above] = self.distances(i, 0.0);
            self.ds[i] * (above.recip() - below.recip())
        };
        self.inequalities().map(slope).sum()
    }

    /// Moves s and y by the step length α, and z by β. Then moves z to the neighbourhood of the central path.
    pub(super) fn advance(&mut self, alpha: f64, beta: f64, mu: f64) {
        for i in 0..self.len() {
            match self.kinds[i] {
                RowKind::Free | RowKind::Fixed => {}
                RowKind::Equation => self.y[i] += alpha * self.dy[i],
                RowKind::Inequality => {
                    self.y[i] += alpha * self.dy[i];
                    self.s[i] += alpha * self.ds[i];
                    for (z, dz) in self.z.iter_mut().zip(&self.dz) {
                        z[i] += beta * dz[i];
                    }
                    self.center(i, mu, OFF_PATH);
                }
            }
        }
        self.ds.fill(0.0);
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

/// Sum of logarithms, with one logarithm for many numbers.
#[derive(Default)]
struct Logarithms {
    product: Option<f64>,
    sum: f64,
}

impl Logarithms {
    fn add(&mut self, x: f64) {
        let product = self.product.unwrap_or(1.0) * x;
        self.product = Some(product);
        if !(1e-200..1e200).contains(&product) {
            self.sum += product.ln();
            self.product = None;
        }
    }

    fn sum(self) -> f64 {
        self.sum + self.product.map_or(0.0, f64::ln)
    }
}

/// Returns the signed distance of g from the interval [lower, upper]; zero inside.
fn outside(g: f64, lower: f64, upper: f64) -> f64 {
    match g {
        g if g > upper => g - upper,
        g if g >= lower => 0.0,
        g => g - lower, // NaN remains NaN
    }
}

/// Divides the entries of a row into those for δx, the unknowns and δu, each with the index of its first entry.
fn split<'a>(row: &ConstraintRow<'a>, [n, m]: [usize; 2]) -> [(usize, &'a [f64]); 3] {
    let within = |end: usize| end.saturating_sub(row.first).min(row.entries.len());
    let (a, b) = (within(n), within(n + m));
    let first = |start: usize, at: usize| (row.first + at).saturating_sub(start);
    let at = |start: usize, from: usize, to: usize| match from == to {
        true => (0, &row.entries[..0]),
        false => (first(start, from), &row.entries[from..to]),
    };
    [at(0, 0, a), at(n, a, b), at(n + m, b, row.entries.len())]
}

/// Returns the inner product of a and the first entries of b.
fn short_dot(a: &[f64], b: &[f64]) -> f64 {
    match a {
        [] => 0.0,
        [a] => a * b[0],
        _ => dot(a, &b[..a.len()]),
    }
}
