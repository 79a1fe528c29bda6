//! Constraint rows of a linear-quadratic knot.
#![allow(non_snake_case)] // names follow the literature: C, D

use nalgebra::DMatrix;

/// Constraints of an [`LqKnot`](crate::LqKnot) on the changes δx and δu, row by row:
///
/// ```text
/// lower ≤ C δx + D δu + c ≤ upper
/// ```
///
/// A row with equal bounds is an equality. For each row, only one run of consecutive columns of [C D] is stored; the
/// entries outside the run are zero. A bound on one coordinate therefore stores a single entry. No memory is allocated
/// before the first row.
///
/// # Examples
/// ```
/// use condyle_optimal::{ConstraintRow, LqKnot};
///
/// // At x₁ = 0.7: x₁ ≤ 1, and u₀ + u₁ = 0.
/// let mut knot = LqKnot::zeros(2, 2);
/// let (lower, upper) = (f64::NEG_INFINITY, 1.0);
/// knot.rows.push(ConstraintRow { first: 1, entries: &[1.0], c: 0.7, lower, upper });
/// knot.rows.push(ConstraintRow { first: 2, entries: &[1.0, 1.0], c: 0.0, lower: 0.0, upper: 0.0 });
///
/// let [C, D] = knot.rows.dense(2, 2);
/// assert_eq!(C.as_slice(), [0.0, 0.0, 1.0, 0.0]); // column after column
/// assert_eq!(D.as_slice(), [0.0, 1.0, 0.0, 1.0]);
/// ```
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ConstraintRows {
    rows: Vec<Row>,
    /// Stored entries of all rows, one row after the other.
    numbers: Vec<f64>,
}

/// Row in its stored form: the position of its entries, its value and its bounds.
#[derive(Debug, Clone, PartialEq)]
struct Row {
    /// First column of the run in [C D]; the next field is the end of the run in `numbers`.
    first: usize,
    end: usize,
    c: f64,
    lower: f64,
    upper: f64,
}

/// Row of [`ConstraintRows`]: lower ≤ entries · (δx, δu) + c ≤ upper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstraintRow<'a> {
    /// First column of the run in [C D]: an index of δx, or ndx plus an index of δu.
    pub first: usize,
    /// Entries of the run.
    pub entries: &'a [f64],
    /// Value of the constraint at δx = 0, δu = 0.
    pub c: f64,
    /// Lower bound; −∞ for none.
    pub lower: f64,
    /// Upper bound; ∞ for none.
    pub upper: f64,
}

impl ConstraintRows {
    /// Returns the number of rows.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Returns whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Removes all rows; the memory is kept.
    pub fn clear(&mut self) {
        self.rows.clear();
        self.numbers.clear();
    }

    /// Appends a row. Zeros at the beginning and the end of the row's run are not stored. Allocates if the rows exceed
    /// the memory of earlier rows.
    pub fn push(&mut self, row: ConstraintRow<'_>) {
        let ConstraintRow { first, entries, c, lower, upper } = row;
        let start = entries.iter().position(|x| *x != 0.0).unwrap_or(0);
        let end = entries.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
        self.numbers.extend_from_slice(&entries[start..end]);
        self.rows.push(Row { first: first + start, end: self.numbers.len(), c, lower, upper });
    }

    /// Returns the rows, in the order in which they were appended.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = ConstraintRow<'_>> {
        let mut start = 0;
        self.rows.iter().map(move |&Row { first, end, c, lower, upper }| {
            let entries = &self.numbers[std::mem::replace(&mut start, end)..end];
            ConstraintRow { first, entries, c, lower, upper }
        })
    }

    /// Returns C (rows × ndx) and D (rows × nu) as full matrices. Allocates.
    ///
    /// # Panics
    /// If a row extends beyond ndx + nu columns.
    #[track_caller]
    pub fn dense(&self, ndx: usize, nu: usize) -> [DMatrix<f64>; 2] {
        self.assert_columns(ndx + nu);
        let (mut C, mut D) = (DMatrix::zeros(self.len(), ndx), DMatrix::zeros(self.len(), nu));
        for (i, row) in self.iter().enumerate() {
            for (j, x) in (row.first..).zip(row.entries) {
                if j < ndx { C[(i, j)] = *x } else { D[(i, j - ndx)] = *x }
            }
        }
        [C, D]
    }

    /// Panics if a row extends beyond the given number of columns.
    #[track_caller]
    pub(super) fn assert_columns(&self, columns: usize) {
        for (i, row) in self.iter().enumerate() {
            let end = row.first + row.entries.len();
            assert!(end <= columns, "row {i} of `rows` ends at column {end}, but [C D] has {columns}");
        }
    }
}
