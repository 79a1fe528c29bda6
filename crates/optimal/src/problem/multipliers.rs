//! Multipliers of an action's constraints, and the terms that the constraints add to the action's cost.

use super::soft::Soft;
use crate::error::Error;
use core::ops::Range;
use std::sync::Arc;

/// Multipliers y of the constraints lower ≤ g(x, u) ≤ upper at the knots of an action, and the penalty 1/μ. At each
/// knot, the following term is added to the cost of the action,
///
/// ```text
/// ½ Σ (e² / μ − μ y²),      e = z − Π z,      z = g(x, u) + μ y,      Π: projection on the bounds
/// ```
///
/// whose derivative with respect to g is e / μ. Its Gauss–Newton curvature is 1/μ outside the bounds and at equalities,
/// and 0 elsewhere. Each row may have its own [ratio](Self::scale) of μ; y and g are never scaled.
///
/// A row of a soft limit gives way by the distance a ≥ 0 at which its term is smallest. The term is then the Moreau
/// envelope of the limit's cost:
///
/// ```text
/// min over a ≥ 0:   cost(a) + (|e| − a)² / 2μ − ½ μ y²,      a = max(0, (|e| / μ − linear) / (quadratic + 1/μ))
/// ```
///
/// Its derivative with respect to g is ±(|e| − a) / μ. If a > 0, this is ±(linear + quadratic · a), and the curvature
/// is quadratic / (1 + μ quadratic).
#[derive(Debug, PartialEq)]
pub(crate) struct Multipliers {
    mu: f64,
    /// Maximum number of constraints of a knot.
    size: usize,
    /// Multipliers y of each knot. Shape: knots × size, padded with zeros. Written by: `start`, `update`.
    y: Vec<f64>,
    /// Multipliers e / μ after the next update, from each knot's last derivatives. Written by: `slopes`.
    next: Vec<f64>,
    /// Ratios μ of a row / μ of the action; a row without an entry has the ratio 1. Shape: knots × size. Written by:
    /// `start`, `scale`.
    ratio: Vec<f64>,
    /// Violations g − Π g from each knot's last derivatives, NaN where g is NaN. At a row that gives way it is the
    /// difference between this distance and a. Shape: knots × size. Written by: `slopes`.
    excess: Vec<f64>,
    /// Distances g − Π g of all rows, also of those that give way. Shape: knots × size. Written by: `slopes`.
    beyond: Vec<f64>,
    /// Constraint term of the cost from each knot's last derivatives. Written by: `begin`, `slopes`.
    terms: Vec<f64>,
}

impl Clone for Multipliers {
    fn clone(&self) -> Self {
        let Self { mu, size, .. } = *self;
        let [y, next, ratio, excess, beyond, terms] =
            [&self.y, &self.next, &self.ratio, &self.excess, &self.beyond, &self.terms].map(Vec::clone);
        Self { mu, size, y, next, ratio, excess, beyond, terms }
    }

    /// Copies the multipliers; does not allocate if the number of knots is the same.
    fn clone_from(&mut self, other: &Self) {
        (self.mu, self.size) = (other.mu, other.size);
        self.y.clone_from(&other.y);
        self.next.clone_from(&other.next);
        self.ratio.clone_from(&other.ratio);
        self.excess.clone_from(&other.excess);
        self.beyond.clone_from(&other.beyond);
        self.terms.clone_from(&other.terms);
    }
}

/// Constraints of a knot with their bounds and their multipliers.
pub struct Bounded<'a> {
    /// Number of constraints of the knot.
    pub(crate) count: usize,
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
    /// Groups of constraints with the same name; empty for user-defined constraints.
    pub(crate) parts: &'a [Part],
    pub(crate) multipliers: &'a mut Multipliers,
}

/// Consecutive constraints of a knot that have the same name.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) name: Arc<str>,
    /// Index of the group's first row. The group ends where the next group begins.
    pub(crate) first: usize,
    /// Whether the rows are functions of only the state.
    pub(crate) of_state: bool,
    /// Cost of values outside the bounds, if the group may give way.
    pub(crate) soft: Option<Soft>,
    /// Description of each row, if the rows have one: the geometries of a pair.
    pub(crate) rows: Arc<[Arc<str>]>,
}

/// Function that is called with the constraints of a knot.
pub(crate) type Visit<'a> = dyn FnMut(Bounded<'_>) + 'a;

impl Bounded<'_> {
    /// Returns the groups of constraints with a name, and the rows of each group.
    pub(crate) fn named_rows(&self) -> impl Iterator<Item = (&Part, Range<usize>)> {
        let ends = self.parts.iter().skip(1).map(|part| part.first).chain([self.count]);
        self.parts.iter().zip(ends).map(|(part, end)| (part, part.first..end))
    }

    /// Returns the group with a name to which a row belongs.
    pub(crate) fn part(&self, row: usize) -> Option<&Part> {
        self.named_rows().find(|(_, rows)| rows.contains(&row)).map(|(part, _)| part)
    }

    /// Returns whether any constraint may give way.
    pub(crate) fn is_any_soft(&self) -> bool {
        self.parts.iter().any(|part| part.soft.is_some())
    }

    /// Returns the group to which a row belongs, if the group may give way, and its cost of values outside the bounds.
    pub(crate) fn soft(&self, row: usize) -> Option<(&Part, Soft)> {
        let part = self.part(row)?;
        part.soft.map(|soft| (part, soft))
    }

    /// Checks that the bounds have the right lengths and that some value satisfies them.
    ///
    /// # Errors
    /// [`Error`] if the bounds have a wrong length or no value satisfies them.
    pub(crate) fn check(&self, knot: usize) -> Result<(), Error> {
        for (name, found) in [("lower bounds", self.lower.len()), ("upper bounds", self.upper.len())] {
            if found != self.count {
                return Err(Error::Dimension { knot, name, expected: self.count, found });
            }
        }
        for (row, (&lower, &upper)) in self.lower.iter().zip(self.upper).enumerate() {
            if !leave_a_value(lower, upper) {
                return Err(Error::Constraint { knot, row, lower, upper });
            }
        }
        Ok(())
    }
}

/// Returns whether some finite number is within the bounds, and neither bound is NaN.
pub(crate) fn leave_a_value(lower: f64, upper: f64) -> bool {
    lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY // false for NaN
}

/// Default penalty 1/μ, which is used until a solver sets another.
pub(crate) const PENALTY: f64 = 10.0;

/// Returns the unit in which the penalty measures a row: the smaller absolute value of its finite bounds other than 0,
/// and at least 1. An equality has the unit 1, because its bound is an offset and no range.
fn unit(lower: f64, upper: f64) -> f64 {
    if lower == upper {
        return 1.0;
    }
    let bounds = [lower, upper].map(f64::abs).into_iter().filter(|bound| bound.is_finite() && *bound != 0.0);
    bounds.reduce(f64::min).unwrap_or(1.0).max(1.0)
}

/// Returns the signed distance of z from the interval [lower, upper]; zero within it.
#[inline(always)]
pub(crate) fn outside(z: f64, lower: f64, upper: f64) -> f64 {
    match z {
        z if z > upper => z - upper,
        z if z >= lower => 0.0,
        z => z - lower, // a NaN in z remains NaN
    }
}

/// Returns the distance a by which a row gives way whose value z is outside its bounds by e; NaN if e is.
#[inline(always)]
fn given(soft: Soft, e: f64, mu: f64) -> f64 {
    let a = (e.abs() / mu - soft.linear) / (soft.quadratic + 1.0 / mu);
    if a <= 0.0 { 0.0 } else { a }
}

impl Multipliers {
    /// Creates multipliers of zero, for at most `size` constraints per knot.
    pub(crate) fn new(size: usize) -> Self {
        let [y, next, ratio, excess, beyond, terms] = [(); 6].map(|()| Vec::new());
        Self { mu: 1.0 / PENALTY, size, y, next, ratio, excess, beyond, terms }
    }

    /// Returns the maximum number of constraints of a knot.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Sets the multipliers of knot t to zero, the ratios of its rows to one, and μ; the action serves `knots` knots.
    /// Allocates at the first call.
    pub(crate) fn start(&mut self, t: usize, knots: usize, mu: f64) {
        self.mu = mu;
        for numbers in [&mut self.y, &mut self.next, &mut self.excess, &mut self.beyond] {
            numbers.resize(knots * self.size, 0.0);
            numbers[t * self.size..(t + 1) * self.size].fill(0.0);
        }
        self.ratio.resize(knots * self.size, 1.0);
        self.ratio[t * self.size..(t + 1) * self.size].fill(1.0);
        self.terms.resize(knots, 0.0);
    }

    /// Scales the rows of knot t by their bounds: μ of a row is multiplied by the square of its [`unit`]. The penalty
    /// then applies to g / unit. `start` must have been called before.
    pub(crate) fn scale(&mut self, t: usize, lower: &[f64], upper: &[f64]) {
        let rows = self.ratio[t * self.size..].iter_mut();
        for (ratio, (&lower, &upper)) in rows.zip(lower.iter().zip(upper)) {
            *ratio = unit(lower, upper).powi(2);
        }
    }

    /// Returns μ of a row of knot t.
    #[inline(always)]
    fn mu(&self, t: usize, row: usize) -> f64 {
        self.mu * self.ratio.get(t * self.size + row).copied().unwrap_or(1.0)
    }

    pub(crate) fn set_mu(&mut self, mu: f64) {
        self.mu = mu;
    }

    /// Sets the first entries of y at knot t. `start` must have been called before.
    pub(crate) fn set(&mut self, t: usize, y: &[f64]) {
        self.y[t * self.size..][..y.len()].copy_from_slice(y);
    }

    /// Returns the first `count` entries of y at knot t.
    pub(crate) fn of(&self, t: usize, count: usize) -> &[f64] {
        &self.y[t * self.size..][..count]
    }

    /// Updates the multipliers of knot t: y ← e / μ.
    pub(crate) fn update(&mut self, t: usize) {
        let knot = t * self.size..(t + 1) * self.size;
        self.y[knot.clone()].copy_from_slice(&self.next[knot]);
    }

    /// Returns three results of the last derivatives of knot t: the violations g − Π g of the first `count`
    /// constraints, the next multipliers of these constraints, and the term of the cost.
    pub(crate) fn measured(&self, t: usize, count: usize) -> (&[f64], &[f64], f64) {
        let first = t * self.size;
        (&self.excess[first..][..count], &self.next[first..][..count], self.terms[t])
    }

    /// Returns the distance of a row's value from its bounds, from the last derivatives of knot t.
    pub(crate) fn distance(&self, t: usize, row: usize) -> f64 {
        self.beyond[t * self.size + row].abs()
    }

    fn y(&self, t: usize, row: usize) -> f64 {
        self.y.get(t * self.size + row).copied().unwrap_or(0.0)
    }

    /// Returns the term of the cost for the constraints from index `first` on. `g` contains the values of these
    /// constraints, which give way if `soft` is set.
    pub(crate) fn value(
        &self,
        t: usize,
        first: usize,
        g: &[f64],
        [lower, upper]: [&[f64]; 2],
        soft: Option<Soft>,
    ) -> f64 {
        let mut term = 0.0;
        for i in 0..g.len() {
            let (y, mu) = (self.y(t, first + i), self.mu(t, first + i));
            let e = outside(g[i] + mu * y, lower[i], upper[i]);
            let (kept, cost) = match soft {
                None => (e, 0.0),
                Some(soft) => {
                    let a = given(soft, e, mu);
                    (e.abs() - a, soft.cost(a))
                }
            };
            term += cost + 0.5 * (kept * kept / mu - mu * y * y);
        }
        term
    }

    /// Sets the stored term of the cost of knot t to zero, at the beginning of its derivatives.
    pub(crate) fn begin(&mut self, t: usize) {
        if let Some(term) = self.terms.get_mut(t) {
            *term = 0.0;
        }
    }

    /// Computes the first and second derivatives of [`value`](Self::value) with respect to g, into `d` and `dd`.
    pub(crate) fn slopes(
        &mut self,
        t: usize,
        first: usize,
        g: &[f64],
        bounds: [&[f64]; 2],
        soft: Option<Soft>,
        [d, dd]: [&mut [f64]; 2],
    ) {
        let [lower, upper] = bounds;
        for i in 0..g.len() {
            let mu = self.mu(t, first + i);
            let e = outside(g[i] + mu * self.y(t, first + i), lower[i], upper[i]);
            let active = e != 0.0 || lower[i] == upper[i];
            (d[i], dd[i]) = (e / mu, if active { 1.0 / mu } else { 0.0 });
            if let Some(soft) = soft {
                let a = given(soft, e, mu);
                if a > 0.0 {
                    (d[i], dd[i]) = (soft.slope(a).copysign(e), soft.quadratic / (1.0 + mu * soft.quadratic));
                }
            }
        }
        let term = self.value(t, first, g, bounds, soft);
        if let Some(sum) = self.terms.get_mut(t) {
            *sum += term;
            let rows = t * self.size + first..t * self.size + first + g.len();
            self.next[rows.clone()].copy_from_slice(&d[..g.len()]);
            for (i, row) in rows.enumerate() {
                let beyond = outside(g[i], lower[i], upper[i]);
                (self.beyond[row], self.excess[row]) = (beyond, beyond);
                if let Some(soft) = soft {
                    let mu = self.mu(t, row - t * self.size);
                    let e = outside(g[i] + mu * self.y[row], lower[i], upper[i]);
                    let a = given(soft, e, mu);
                    if a > 0.0 {
                        self.excess[row] = beyond - a.copysign(e);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares value, slope and curvature of the term of a soft row by differences, and the value with a direct
    /// minimisation over the distance a by which the row gives way.
    #[test]
    fn the_term_of_a_soft_row_is_an_envelope() {
        for (lower, upper) in [(-1.0, 0.5), (0.2, 0.2), (f64::NEG_INFINITY, 0.5)] {
            for (linear, quadratic) in [(0.7, 0.0), (0.0, 3.0), (0.4, 2.0)] {
                let soft = Soft { linear, quadratic };
                let mut multipliers = Multipliers::new(1);
                multipliers.start(0, 1, 0.3);
                multipliers.scale(0, &[lower], &[upper]);
                for y in [0.0, 0.6, -0.9] {
                    multipliers.set(0, &[y]);
                    for k in 0..60 {
                        let g = -3.0 + 0.1037 * f64::from(k);
                        let bounds: [&[f64]; 2] = [&[lower], &[upper]];
                        let value = |g: f64| multipliers.value(0, 0, &[g], bounds, Some(soft));
                        let e = outside(g + 0.3 * y, lower, upper).abs();
                        let cost = |a: f64| soft.cost(a) + (e - a).powi(2) / 0.6 - 0.15 * y * y;
                        let least = (0..4001).map(|i| cost(e * f64::from(i) / 4000.0)).fold(f64::INFINITY, f64::min);
                        assert!((value(g) - least).abs() < 1e-5, "{} {least}", value(g));
                        let h = 1e-4;
                        let slope = (value(g + h) - value(g - h)) / (2.0 * h);
                        let curvature = (value(g + h) - 2.0 * value(g) + value(g - h)) / (h * h);
                        let (mut d, mut dd) = ([0.0], [0.0]);
                        multipliers.clone().slopes(0, 0, &[g], bounds, Some(soft), [&mut d, &mut dd]);
                        assert!((d[0] - slope).abs() < 1e-6, "{d:?} {slope}");
                        // the envelope has kinks of its slope, which no point of this grid is near
                        assert!((dd[0] - curvature).abs() < 1e-5, "{dd:?} {curvature} at {g}");
                    }
                }
            }
        }
    }
}
