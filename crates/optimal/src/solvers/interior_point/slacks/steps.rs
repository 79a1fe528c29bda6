//! Newton step of the constraint rows: their terms in the sweep, the steps of s, z and y, and the merit of a step.

use super::{RowKind, Slacks};
use crate::lq::{ConstraintRow, LqKnot};
use crate::problem::{Shape, outside};
use condyle_linalg::dot;

/// Curvature 1/ρ of the proximal term of an equation.
const EQUATION_CURVATURE: f64 = 1e8;
/// Largest factor between a multiplier and its value μ / distance on the central path.
const OFF_PATH: f64 = 1e10;

impl Slacks {
    /// Adds Σ y ∂g of knot t to the gradients with respect to δx, to the unknowns w and to δu. At a knot that is not in
    /// inverse-dynamics form, the unknowns are δu, and `of_u` is not changed.
    pub(in crate::solvers::interior_point) fn add_gradient(
        &self,
        t: usize,
        knot: &LqKnot,
        of_x: &mut [f64],
        of_w: &mut [f64],
        of_u: &mut [f64],
    ) {
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
    pub(in crate::solvers::interior_point) fn write_terms(
        &mut self,
        knots: &mut [LqKnot],
        r: &[f64],
        shape: &Shape,
        mu: f64,
    ) {
        for i in 0..self.len() {
            self.terms[i] = self.term(i, mu);
        }
        self.move_terms(knots, r, shape);
    }

    /// Computes terms that minimise ½ Σ w e², where e are the distances of the values g from their bounds and w are the
    /// weights of the rows.
    pub(in crate::solvers::interior_point) fn write_violation_terms(
        &mut self,
        knots: &mut [LqKnot],
        r: &[f64],
        shape: &Shape,
    ) {
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
    pub(in crate::solvers::interior_point) fn find_steps(
        &mut self,
        t: usize,
        knot: &LqKnot,
        dx: &[f64],
        w: &[f64],
        du: &[f64],
        mu: f64,
    ) {
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
    pub(in crate::solvers::interior_point) fn step_lengths(&self, tau: f64) -> [f64; 2] {
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
    pub(in crate::solvers::interior_point) fn trial_merit(&self, alpha: f64) -> [f64; 2] {
        self.merit(alpha, &self.trial)
    }

    /// Returns Σ |g − s| + Σ |h| and −Σ log of all distances at the iterate.
    pub(in crate::solvers::interior_point) fn merit_here(&self) -> [f64; 2] {
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
    pub(in crate::solvers::interior_point) fn squared_violation(&self, of_trial: bool) -> f64 {
        let g = if of_trial { &self.trial } else { &self.g };
        let imposed = (0..self.len()).filter(|&i| !matches!(self.kinds[i], RowKind::Free | RowKind::Fixed));
        0.5 * imposed.map(|i| self.weight(i) * outside(g[i], self.lower[i], self.upper[i]).powi(2)).sum::<f64>()
    }

    /// Returns the derivative of −Σ log of all distances along the step.
    pub(in crate::solvers::interior_point) fn barrier_slope(&self) -> f64 {
        let slope = |i: usize| {
            let [below, above] = self.distances(i, 0.0);
            self.ds[i] * (above.recip() - below.recip())
        };
        self.inequalities().map(slope).sum()
    }

    /// Moves s and y by the step length α, and z by β. Then moves z to the neighbourhood of the central path.
    pub(in crate::solvers::interior_point) fn advance(&mut self, alpha: f64, beta: f64, mu: f64) {
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
