//! Rows of named limits: finds the name of a row, and reads and checks multipliers by the name of their limit.

use super::outcome::{Outcome, Violation, ViolationKind};
use crate::error::Error;
use crate::problem::{Part, Problem};
use core::ops::Range;
use std::sync::Arc;

/// Rows of a knot that belong to one [`Limit`](crate::robot::Limit).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LimitRows {
    /// Name of the limit.
    pub name: Arc<str>,
    /// Index of the knot, 0 … N.
    pub knot: usize,
    /// Indices of the rows in the knot's [`Outcome::multipliers`].
    pub rows: Range<usize>,
}

impl Problem {
    /// Returns the rows of all named limits, knot by knot and in the order of the knot's limits. Constraints of a
    /// [`Constrained`](crate::Constrained) action and bounds on controls have no names and are not listed. Allocates.
    ///
    /// ```
    /// # use condyle_dynamics::robots;
    /// # use condyle_optimal::robot::{FreeDynamics, Limit, Residual};
    /// # use condyle_optimal::Problem;
    /// # use std::sync::Arc;
    /// # let arm = Arc::new(robots::arm7());
    /// # let x0 = vec![0.0; 14];
    /// let effort = Limit::new("effort", Residual::Control { reference: vec![0.0; 7] }, vec![-30.0; 7], vec![30.0; 7]);
    /// let rest = Limit::equality("rest", Residual::State { reference: x0.clone() });
    /// let knot = FreeDynamics::running(arm.clone(), 0.05, vec![])?.with_limits(vec![effort])?;
    /// let end = FreeDynamics::terminal(arm, vec![])?.with_limits(vec![rest])?;
    /// let mut problem = Problem::new(x0, vec![Box::new(knot)], vec![0; 2], Box::new(end))?;
    /// let rows = problem.limit_rows();
    /// assert_eq!(rows.iter().map(|limit| (&*limit.name, limit.knot)).collect::<Vec<_>>(), [
    ///     ("effort", 0), ("effort", 1), ("rest", 2)
    /// ]);
    /// assert_eq!(rows[2].rows, 0..14);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    pub fn limit_rows(&mut self) -> Vec<LimitRows> {
        let mut all = Vec::new();
        self.write_limit_rows(&mut all);
        all
    }

    /// Writes the result of [`limit_rows`](Self::limit_rows) to `out`. Allocates only if `out` never had as many
    /// entries.
    pub(super) fn write_limit_rows(&mut self, out: &mut Vec<LimitRows>) {
        out.clear();
        for knot in 0..=self.horizon() {
            let mut before = 0; // number of rows of this knot in earlier visits
            self.constraints(knot, &mut |bounded| {
                for (part, rows) in bounded.named_rows() {
                    let rows = before + rows.start..before + rows.end;
                    out.push(LimitRows { name: part.name.clone(), knot, rows });
                }
                before += bounded.count;
            });
        }
    }

    /// Returns multipliers of the limit `name`, checked for [`set`](crate::InteriorPoint::set_multipliers): the rows of
    /// the limit at each knot that has it, with their multipliers.
    ///
    /// # Errors
    /// [`Error::Multipliers`] if the name is unknown, a length is wrong, or a number is not finite.
    pub(super) fn check_multipliers<'y>(
        &mut self,
        name: &str,
        multipliers: &'y [impl AsRef<[f64]>],
    ) -> Result<Vec<(LimitRows, &'y [f64])>, Error> {
        let wrong = |what: String| Error::Multipliers { limit: name.to_owned(), what };
        let (limits, knots) = (self.limit_rows(), self.horizon() + 1);
        if !limits.iter().any(|limit| &*limit.name == name) {
            return Err(unknown(name, &limits));
        }
        if multipliers.len() != knots {
            return Err(wrong(format!("expected an entry for each of {knots} knots, found {}", multipliers.len())));
        }
        let mut limits = limits.into_iter().filter(|limit| &*limit.name == name).peekable();
        let mut checked = Vec::new();
        for (knot, y) in multipliers.iter().map(AsRef::as_ref).enumerate() {
            let limit = limits.next_if(|limit| limit.knot == knot);
            let expected = limit.as_ref().map_or(0, |limit| limit.rows.len());
            if y.len() != expected {
                return Err(wrong(format!("knot {knot}: expected {expected} numbers, found {}", y.len())));
            }
            if let Some(entry) = y.iter().position(|y| !y.is_finite()) {
                return Err(wrong(format!("knot {knot}: entry {entry} is {}, which is not finite", y[entry])));
            }
            checked.extend(limit.map(|limit| (limit, y)));
        }
        Ok(checked)
    }
}

impl Outcome {
    /// Returns the multipliers of the limit `name` at each knot 0 … N: positive at an upper bound, negative at a lower
    /// bound, empty at a knot without this limit. Allocates.
    ///
    /// # Errors
    /// [`Error::Multipliers`] if the problem has no limit of this name; the error lists the names.
    pub fn multipliers_of(&self, name: &str) -> Result<Vec<&[f64]>, Error> {
        if !self.limits.iter().any(|limit| &*limit.name == name) {
            return Err(unknown(name, &self.limits));
        }
        let mut all: Vec<&[f64]> = vec![&[]; self.multipliers.len()];
        for limit in self.limits.iter().filter(|limit| &*limit.name == name) {
            all[limit.knot] = &self.multipliers[limit.knot][limit.rows.clone()];
        }
        Ok(all)
    }
}

impl Violation {
    /// Returns the violation of the constraint `row` of a knot by `amount`, with the name of its limit.
    pub(super) fn of_row(knot: usize, row: usize, part: Option<(&Part, usize)>, amount: f64) -> Self {
        let mut found = Self { kind: ViolationKind::Constraint, knot, row, name: None, entry: row, what: None, amount };
        if let Some((part, entry)) = part {
            found.set_part(part, entry);
        }
        found
    }

    /// Sets the name of the row's limit, the index of the row in the limit, and the description of the row.
    pub(super) fn set_part(&mut self, part: &Part, entry: usize) {
        (self.name, self.entry, self.what) = (Some(part.name.clone()), entry, part.rows.get(entry).cloned());
    }

    /// Returns the violation of the dynamics by a gap of the given size in entry `row` of the tangent vector.
    pub(super) fn of_gap(knot: usize, row: usize, amount: f64) -> Self {
        Self { kind: ViolationKind::Gap, knot, row, name: None, entry: row, what: None, amount }
    }
}

/// Moves the rows of limits by one knot, as [`Problem::shift`] moves the horizon. The new last knot before the terminal
/// one takes the rows of the knot before it.
pub(super) fn shift(limits: &mut Vec<LimitRows>, horizon: usize) {
    limits.retain(|limit| limit.knot > 0 || horizon == 1);
    let before = |limits: &[LimitRows], knot: usize| limits.partition_point(|limit| limit.knot < knot);
    let [first, end] = [horizon - 1, horizon].map(|knot| before(limits, knot));
    for limit in &mut limits[..end] {
        limit.knot = limit.knot.saturating_sub(1);
    }
    if horizon > 1 {
        for i in first..end {
            let last = LimitRows { knot: horizon - 1, ..limits[i].clone() };
            limits.insert(end + i - first, last);
        }
    }
}

/// Returns the error for a name that no limit has.
fn unknown(name: &str, limits: &[LimitRows]) -> Error {
    let mut known: Vec<&str> = Vec::new();
    for limit in limits {
        if !known.contains(&&*limit.name) {
            known.push(&limit.name);
        }
    }
    let what = match known.is_empty() {
        true => "no limit has this name, and no limit has any name".to_owned(),
        false => format!("no limit has this name; the limits are `{}`", known.join("`, `")),
    };
    Error::Multipliers { limit: name.to_owned(), what }
}
