//! The multipliers of an action's constraints, and their terms of its cost.

use crate::error::Error;
use std::sync::Arc;

/// The multipliers y of constraints lower ≤ g(x, u) ≤ upper at the knots that an action serves, and the penalty 1/μ. To
/// the action's cost comes, at each knot,
///
/// ```text
/// ½ Σ (e² / μ − μ y²),      e = z − Π z,      z = g(x, u) + μ y,      Π: into the bounds
/// ```
///
/// with the slope e / μ by g, and the curvature of Gauss and Newton: 1/μ outside of the bounds and at equalities, else 0.
#[derive(Debug, PartialEq)]
pub(crate) struct Multipliers {
    mu: f64,
    /// The most constraints that a knot has.
    size: usize,
    /// y of each knot. Shape: knots × size, and zero beyond its end. Written by: `start`, `update`.
    y: Vec<f64>,
    /// e / μ at each knot's last derivatives, which are better multipliers. Written by: `slopes`.
    next: Vec<f64>,
    /// g − Π g at each knot's last derivatives, NaN where g is. Shape: knots × size. Written by: `slopes`.
    excess: Vec<f64>,
    /// The cost's term there, of each knot. Written by: `begin`, `slopes`.
    terms: Vec<f64>,
}

impl Clone for Multipliers {
    fn clone(&self) -> Self {
        let Self { mu, size, .. } = *self;
        let [y, next, excess, terms] = [&self.y, &self.next, &self.excess, &self.terms].map(Vec::clone);
        Self { mu, size, y, next, excess, terms }
    }

    /// Allocates nothing for as many knots.
    fn clone_from(&mut self, other: &Self) {
        (self.mu, self.size) = (other.mu, other.size);
        self.y.clone_from(&other.y);
        self.next.clone_from(&other.next);
        self.excess.clone_from(&other.excess);
        self.terms.clone_from(&other.terms);
    }
}

/// The constraints of a knot, and their multipliers.
pub struct Bounded<'a> {
    /// The number of constraints.
    pub(crate) count: usize,
    pub(crate) lower: &'a [f64],
    pub(crate) upper: &'a [f64],
    /// The parts of the constraints that are known by name; empty for those of a user.
    pub(crate) parts: &'a [Part],
    pub(crate) multipliers: &'a mut Multipliers,
}

/// Consecutive constraints of a knot that have a name.
#[derive(Clone, Debug)]
pub(crate) struct Part {
    pub(crate) name: Arc<str>,
    /// The first of its rows; the last is before the first of the next part.
    pub(crate) first: usize,
    /// Whether its rows are functions of the state alone.
    pub(crate) of_state: bool,
}

/// A function that is called with the constraints of a knot.
pub(crate) type Visit<'a> = dyn FnMut(Bounded<'_>) + 'a;

impl Bounded<'_> {
    /// # Errors
    /// [`Error`] if the bounds have a wrong length or leave no value.
    pub(crate) fn check(&self, knot: usize) -> Result<(), Error> {
        for (name, found) in [("lower bounds", self.lower.len()), ("upper bounds", self.upper.len())] {
            if found != self.count {
                return Err(Error::Dimension { node: knot, name, expected: self.count, found });
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

/// Whether some finite number is within bounds, which are numbers themselves.
pub(crate) fn leave_a_value(lower: f64, upper: f64) -> bool {
    lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY // false for NaN
}

/// 1/μ unless a solve has chosen another.
pub(crate) const PENALTY: f64 = 10.0;

/// The distance of z beyond its bounds, with its sign.
#[inline(always)]
fn outside(z: f64, lower: f64, upper: f64) -> f64 {
    match z {
        z if z > upper => z - upper,
        z if z >= lower => 0.0,
        z => z - lower, // a NaN stays one
    }
}

impl Multipliers {
    /// Zeros, for at most `size` constraints a knot.
    pub(crate) fn new(size: usize) -> Self {
        Self { mu: 1.0 / PENALTY, size, y: vec![], next: vec![], excess: vec![], terms: vec![] }
    }

    /// The most constraints that a knot has.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    /// Zeros at knot t of so many, and μ. Allocates at the first call.
    pub(crate) fn start(&mut self, t: usize, knots: usize, mu: f64) {
        self.mu = mu;
        for numbers in [&mut self.y, &mut self.next, &mut self.excess] {
            numbers.resize(knots * self.size, 0.0);
            numbers[t * self.size..(t + 1) * self.size].fill(0.0);
        }
        self.terms.resize(knots, 0.0);
    }

    pub(crate) fn set_mu(&mut self, mu: f64) {
        self.mu = mu;
    }

    /// Sets the first ones of y at knot t, after `start`.
    pub(crate) fn set(&mut self, t: usize, y: &[f64]) {
        self.y[t * self.size..][..y.len()].copy_from_slice(y);
    }

    /// The first `count` of y at knot t.
    pub(crate) fn of(&self, t: usize, count: usize) -> &[f64] {
        &self.y[t * self.size..][..count]
    }

    /// y ← e / μ at knot t.
    pub(crate) fn update(&mut self, t: usize) {
        let knot = t * self.size..(t + 1) * self.size;
        self.y[knot.clone()].copy_from_slice(&self.next[knot]);
    }

    /// g − Π g of the first `count` constraints, their next multipliers, and the cost's term, at the last derivatives of
    /// knot t.
    pub(crate) fn measured(&self, t: usize, count: usize) -> (&[f64], &[f64], f64) {
        let first = t * self.size;
        (&self.excess[first..][..count], &self.next[first..][..count], self.terms[t])
    }

    fn y(&self, t: usize, row: usize) -> f64 {
        self.y.get(t * self.size + row).copied().unwrap_or(0.0)
    }

    /// The cost's term for the constraints from `first` on whose values are g.
    pub(crate) fn value(&self, t: usize, first: usize, g: &[f64], lower: &[f64], upper: &[f64]) -> f64 {
        let mut term = 0.0;
        for i in 0..g.len() {
            let y = self.y(t, first + i);
            let e = outside(g[i] + self.mu * y, lower[i], upper[i]);
            term += 0.5 * (e * e / self.mu - self.mu * y * y);
        }
        term
    }

    /// Begins the derivatives of knot t.
    pub(crate) fn begin(&mut self, t: usize) {
        if let Some(term) = self.terms.get_mut(t) {
            *term = 0.0;
        }
    }

    /// The slopes and curvatures of [`value`](Self::value), in `d` and `dd`.
    pub(crate) fn slopes(
        &mut self,
        t: usize,
        first: usize,
        g: &[f64],
        [lower, upper]: [&[f64]; 2],
        d: &mut [f64],
        dd: &mut [f64],
    ) {
        for i in 0..g.len() {
            let e = outside(g[i] + self.mu * self.y(t, first + i), lower[i], upper[i]);
            let active = e != 0.0 || lower[i] == upper[i];
            (d[i], dd[i]) = (e / self.mu, if active { 1.0 / self.mu } else { 0.0 });
        }
        let term = self.value(t, first, g, lower, upper);
        if let Some(sum) = self.terms.get_mut(t) {
            *sum += term;
            let rows = t * self.size + first..t * self.size + first + g.len();
            self.next[rows.clone()].copy_from_slice(&d[..g.len()]);
            for (i, excess) in self.excess[rows].iter_mut().enumerate() {
                *excess = outside(g[i], lower[i], upper[i]);
            }
        }
    }
}
