//! Newton step of the constraint rows: their terms in the sweep, the steps of s, z and y, and the merit of a step.

use super::{RowKind, Slacks};
use crate::lq::{LqKnot, MOST_FORMS};
use crate::problem::{Shape, outside};
use condyle_linalg::{Vector, Vectorized, at_level, dot};

/// Curvature 1/ρ of the proximal term of an equation.
const EQUATION_CURVATURE: f64 = 1e8;

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
        at_level(AddGradient { slacks: self, first: self.offsets[t], knot, to: [of_x, of_w, of_u] });
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
        self.barrier.write_terms(&self.g, mu, &mut self.terms);
        self.soft.write_terms(&self.g, mu, &mut self.terms);
        for &i in &self.equations {
            self.terms[i] = [self.y[i] + EQUATION_CURVATURE * (self.g[i] - self.lower[i]), EQUATION_CURVATURE];
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
                kind if !kind.is_imposed() => [0.0; 2],
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
            for (i, (first, _)) in self.knot(t).zip(rows.runs()).filter(|(_, (first, _))| *first >= n + m) {
                let (j, [slope, curvature]) = (first - n - m, self.terms[i]);
                gradient[j] += slope;
                diagonal[j] += curvature;
                self.terms[i] = [0.0; 2];
            }
        }
    }

    /// Computes the changes of g at knot t from the changes δx, w and δu.
    pub(in crate::solvers::interior_point) fn find_changes(
        &mut self,
        t: usize,
        knot: &LqKnot,
        dx: &[f64],
        w: &[f64],
        du: &[f64],
    ) {
        let (n, m) = (knot.ndx(), knot.nu());
        let change = |run: (usize, &[f64])| -> f64 {
            if let (first, [entry]) = run {
                return entry
                    * if first < n {
                        dx[first]
                    } else if first < n + m {
                        w[first - n]
                    } else {
                        du[first - n - m]
                    };
            }
            let (first, entries) = run;
            if first + entries.len() <= n {
                return short_dot(entries, &dx[first..]); // such as a distance
            }
            let parts = [dx, w, du].into_iter().zip(split(run, [n, m]));
            parts.map(|(d, (first, entries))| short_dot(entries, &d[first..])).sum()
        };
        let changes = &mut self.barrier.ds[self.offsets[t]..];
        for (to, run) in changes.iter_mut().zip(knot.rows.runs()) {
            *to = change(run);
        }
        for group in knot.rows.groups() {
            let mut forms = [0.0; MOST_FORMS];
            forms.iter_mut().zip(group.forms()).for_each(|(to, form)| *to = change(form));
            for (i, weights) in group.rows.clone().zip(group.weights()) {
                changes[i] = weights.iter().zip(forms).map(|(w, form)| w * form).sum();
            }
        }
    }

    /// Computes the steps of s, z and y from the changes of g at all knots.
    pub(in crate::solvers::interior_point) fn find_steps(&mut self, mu: f64) {
        let Self { barrier, soft, g, y, dy, equations, lower, .. } = self;
        for &i in &*equations {
            dy[i] = EQUATION_CURVATURE * (g[i] - lower[i] + barrier.ds[i]);
        }
        let of_soft = soft.find_step([g, &barrier.ds, y], mu, dy);
        self.limits = barrier.find_step(g, mu, y, dy).and(of_soft);
    }

    /// Returns the largest step lengths of s and of z, at most 1, with which each distance and each multiplier keeps at
    /// least the fraction 1 − τ of its value.
    pub(in crate::solvers::interior_point) fn step_lengths(&self, tau: f64) -> [f64; 2] {
        self.limits.lengths(tau)
    }

    /// Returns Σ |g − s| + Σ |h|, −Σ log of all distances, and the cost of soft limits, for a step of length α to the
    /// trial.
    pub(in crate::solvers::interior_point) fn trial_merit(&self, alpha: f64) -> [f64; 3] {
        self.merit(alpha, &self.trial)
    }

    /// Returns Σ |g − s| + Σ |h|, −Σ log of all distances, and the cost of soft limits at the iterate.
    pub(in crate::solvers::interior_point) fn merit_here(&self) -> [f64; 3] {
        self.merit(0.0, &self.g)
    }

    fn merit(&self, alpha: f64, g: &[f64]) -> [f64; 3] {
        let [infeasibility, logarithms] = self.barrier.merit(g, alpha);
        let [of_soft, more, cost] = self.soft.merit(g, alpha);
        let of_equations: f64 = self.equations.iter().map(|&i| (g[i] - self.lower[i]).abs()).sum();
        [infeasibility + of_equations + of_soft, logarithms + more, cost]
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
        let imposed = (0..self.len()).filter(|&i| self.kinds[i].is_imposed());
        0.5 * imposed.map(|i| self.weight(i) * outside(g[i], self.lower[i], self.upper[i]).powi(2)).sum::<f64>()
    }

    /// Returns the derivative of −Σ log of all distances along the step.
    pub(in crate::solvers::interior_point) fn barrier_slope(&self) -> f64 {
        self.limits.slope
    }

    /// Returns the derivative of the cost of soft limits along the step.
    pub(in crate::solvers::interior_point) fn soft_slope(&self) -> f64 {
        self.soft.cost_slope
    }

    /// Moves s and y by the step length α, and z by β. Then moves z to the neighbourhood of the central path.
    pub(in crate::solvers::interior_point) fn advance(&mut self, alpha: f64, beta: f64, mu: f64) {
        self.barrier.advance([alpha, beta], Some(mu));
        self.soft.advance([alpha, beta], Some(mu));
        self.barrier.ds.fill(0.0);
        self.y.iter_mut().zip(&self.dy).for_each(|(y, dy)| *y += alpha * dy);
    }
}

/// Sum Σ y ∂g of a knot, which is added to the gradients with respect to δx, w and δu.
struct AddGradient<'a> {
    slacks: &'a Slacks,
    /// Index of the first row of the knot.
    first: usize,
    knot: &'a LqKnot,
    to: [&'a mut [f64]; 3],
}

impl Vectorized for AddGradient<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { slacks, first, knot, to: [of_x, of_w, of_u] } = self;
        let sizes = [knot.ndx(), knot.nu()];
        let mut add = |y: f64, run: (usize, &[f64])| {
            let (first, entries) = run;
            if first + entries.len() <= sizes[0] {
                let to = &mut of_x[first..][..entries.len()]; // such as a distance
                return to.iter_mut().zip(entries).for_each(|(to, entry)| *to += y * entry);
            }
            let parts = [&mut *of_x, &mut *of_w, &mut *of_u].into_iter().zip(split(run, sizes));
            for (to, (first, entries)) in parts {
                to[first..].iter_mut().zip(entries).for_each(|(to, entry)| *to += y * entry);
            }
        };
        for (i, run) in (first..).zip(knot.rows.runs()) {
            add(slacks.multiplier(i), run);
        }
        for group in knot.rows.groups() {
            let of_forms = group.transposed_product(group.rows.clone().map(|i| slacks.multiplier(first + i)));
            of_forms.into_iter().zip(group.forms()).for_each(|(y, form)| add(y, form));
        }
    }
}

/// Divides the entries of a run into those for δx, the unknowns and δu, each with the index of its first entry.
#[inline(always)]
fn split((first, entries): (usize, &[f64]), [n, m]: [usize; 2]) -> [(usize, &[f64]); 3] {
    let within = |end: usize| end.saturating_sub(first).min(entries.len());
    let (a, b) = (within(n), within(n + m));
    let at = |start: usize, from: usize, to: usize| match from == to {
        true => (0, &entries[..0]),
        false => ((first + from).saturating_sub(start), &entries[from..to]),
    };
    [at(0, 0, a), at(n, a, b), at(n + m, b, entries.len())]
}

/// Returns the inner product of a and the first entries of b.
fn short_dot(a: &[f64], b: &[f64]) -> f64 {
    match a {
        [] => 0.0,
        [a] => a * b[0],
        _ => dot(a, &b[..a.len()]),
    }
}
