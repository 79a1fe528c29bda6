//! Rows of soft limits that gave way, and their cost.

use super::outcome::Violation;
use crate::problem::{Bounded, Problem};

/// Distance from which a row counts as one that gave way, as a multiple of the tolerance. On the central path, a row
/// that holds is also a little outside.
const NOTICEABLE: f64 = 100.0;

impl Problem {
    /// Writes the rows of soft limits to `out` that are outside their bounds by more than 100 times `tolerance`.
    /// Returns the cost of all values outside the bounds of soft limits. `distance` receives the constraints of an
    /// action, the knot, the number of constraints of the knot before them, and a row. It returns the distance of the
    /// row's value from its bounds. Allocates only if `out` never had room for all rows of soft limits.
    pub(super) fn write_given_way(
        &mut self,
        tolerance: f64,
        out: &mut Vec<Violation>,
        mut distance: impl FnMut(&Bounded<'_>, usize, usize, usize) -> f64,
    ) -> f64 {
        out.clear();
        let (mut cost, mut all) = (0.0, 0);
        for t in 0..=self.horizon() {
            let mut before = 0;
            self.constraints(t, &mut |bounded| {
                let rows = if bounded.is_any_soft() { 0..bounded.count } else { 0..0 };
                for i in rows {
                    let Some((part, soft)) = bounded.soft(i) else { continue };
                    all += 1;
                    let amount = distance(&bounded, t, before, i);
                    cost += soft.cost(amount);
                    let amount = if amount.is_nan() { f64::INFINITY } else { amount };
                    if amount > NOTICEABLE * tolerance {
                        out.push(Violation::of_row(t, before + i, Some((part, i - part.first)), amount));
                    }
                }
                before += bounded.count;
            });
        }
        out.reserve(all - out.len());
        if cost.is_nan() { f64::INFINITY } else { cost }
    }
}
