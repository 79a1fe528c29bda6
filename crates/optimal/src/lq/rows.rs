//! Constraint rows of a linear-quadratic knot.
#![allow(non_snake_case)] // names follow the literature: C, D, W

use core::ops::Range;
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
    /// Groups of rows that are combinations of the same few forms.
    groups: Vec<Group>,
    forms: Vec<Run>,
    /// Stored entries of all rows and forms, one after the other, and the weights of the groups.
    numbers: Vec<f64>,
}

/// Row in its stored form. The run of a row that belongs to a group is empty.
#[derive(Debug, Clone, PartialEq)]
struct Row {
    run: Run,
    c: f64,
    lower: f64,
    upper: f64,
}

/// Run of consecutive columns of [C D]: the first column, and the range of its entries in `numbers`.
#[derive(Debug, Clone, PartialEq)]
struct Run {
    first: usize,
    start: usize,
    end: usize,
}

/// Ranges of the rows and the forms of a group, and the range of its weights in `numbers`.
#[derive(Debug, Clone, PartialEq)]
struct Group {
    rows: Range<usize>,
    forms: Range<usize>,
    weights: Range<usize>,
}

/// Maximum number of forms of a group: the components of a wrench.
pub(crate) const MOST_FORMS: usize = 6;

/// Group of rows W φ, where the forms φ are linear in δx and δu. The 17 rows of a wrench cone are combinations of six
/// forms, the components of the wrench.
#[derive(Debug, Clone)]
pub(crate) struct RowGroup<'a> {
    /// Indices of the rows.
    pub(crate) rows: Range<usize>,
    /// Weights W, row after row.
    pub(crate) W: &'a [f64],
    all: &'a ConstraintRows,
    forms: Range<usize>,
}

impl<'a> RowGroup<'a> {
    /// Returns the first column and the entries of each form.
    pub(crate) fn forms(&self) -> impl ExactSizeIterator<Item = (usize, &'a [f64])> + use<'a> {
        let ConstraintRows { forms, numbers, .. } = self.all;
        forms[self.forms.clone()].iter().map(|run| (run.first, &numbers[run.start..run.end]))
    }

    /// Returns the weights of each row.
    pub(crate) fn weights(&self) -> core::slice::ChunksExact<'a, f64> {
        self.W.chunks_exact(self.forms.len())
    }

    /// Computes Wᵀ y for the numbers y of the rows.
    #[inline(always)]
    pub(crate) fn transposed_product(&self, y: impl Iterator<Item = f64>) -> [f64; MOST_FORMS] {
        let mut sums = [0.0; MOST_FORMS];
        for (y, weights) in y.zip(self.weights()) {
            sums.iter_mut().zip(weights).for_each(|(sum, w)| *sum += y * w);
        }
        sums
    }
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
    /// Returns the sizes of the allocated memory.
    pub(crate) fn capacities(&self) -> [usize; 4] {
        [self.rows.capacity(), self.groups.capacity(), self.forms.capacity(), self.numbers.capacity()]
    }

    /// Allocates at least the given [capacities](Self::capacities).
    pub(crate) fn reserve(&mut self, capacities: [usize; 4]) {
        let Self { rows, groups, forms, numbers } = self;
        rows.reserve_exact(capacities[0].saturating_sub(rows.len()));
        groups.reserve_exact(capacities[1].saturating_sub(groups.len()));
        forms.reserve_exact(capacities[2].saturating_sub(forms.len()));
        numbers.reserve_exact(capacities[3].saturating_sub(numbers.len()));
    }

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
        self.groups.clear();
        self.forms.clear();
        self.numbers.clear();
    }

    /// Appends a row. Zeros at the beginning and the end of the row's run are not stored. Allocates if the rows exceed
    /// the memory of earlier rows.
    pub fn push(&mut self, row: ConstraintRow<'_>) {
        let ConstraintRow { first, entries, c, lower, upper } = row;
        let run = self.store(first, entries);
        self.rows.push(Row { run, c, lower, upper });
    }

    /// Appends a form to the forms of the next group. At most [`MOST_FORMS`] forms make a group.
    pub(crate) fn push_form(&mut self, first: usize, entries: &[f64]) {
        let run = self.store(first, entries);
        self.forms.push(run);
    }

    /// Appends the rows W φ, where φ are the forms that were pushed since the last group. W is stored row after row.
    /// The numbers of a row are c, its lower and its upper bound.
    pub(crate) fn push_group(&mut self, W: &[f64], rows: impl Iterator<Item = [f64; 3]>) {
        let (first, at) = (self.rows.len(), self.numbers.len());
        let forms = self.groups.last().map_or(0, |group| group.forms.end)..self.forms.len();
        assert!(forms.len() <= MOST_FORMS, "a group has {} forms", forms.len());
        self.numbers.extend_from_slice(W);
        self.rows.extend(rows.map(|[c, lower, upper]| Row {
            run: Run { first: 0, start: 0, end: 0 },
            c,
            lower,
            upper,
        }));
        self.groups.push(Group { rows: first..self.rows.len(), forms, weights: at..self.numbers.len() });
    }

    /// Appends the rows of `from` with `count` additional zero columns before column `at`.
    pub(crate) fn append_widened(&mut self, from: &ConstraintRows, at: usize, count: usize) {
        let (rows, forms) = (self.rows.len(), self.forms.len());
        for Row { run, c, lower, upper } in &from.rows {
            let run = self.store_widened(run.first, &from.numbers[run.start..run.end], at, count);
            self.rows.push(Row { run, c: *c, lower: *lower, upper: *upper });
        }
        for run in &from.forms {
            let run = self.store_widened(run.first, &from.numbers[run.start..run.end], at, count);
            self.forms.push(run);
        }
        for group in &from.groups {
            let start = self.numbers.len();
            self.numbers.extend_from_slice(&from.numbers[group.weights.clone()]);
            let moved = |range: &Range<usize>, by: usize| range.start + by..range.end + by;
            let (rows, forms) = (moved(&group.rows, rows), moved(&group.forms, forms));
            self.groups.push(Group { rows, forms, weights: start..self.numbers.len() });
        }
    }

    /// Stores a run with `count` zero columns before column `at`.
    fn store_widened(&mut self, first: usize, entries: &[f64], at: usize, count: usize) -> Run {
        let start = self.numbers.len();
        let before = at.saturating_sub(first).min(entries.len());
        self.numbers.extend_from_slice(&entries[..before]);
        if 0 < before && before < entries.len() {
            self.numbers.resize(self.numbers.len() + count, 0.0);
        }
        self.numbers.extend_from_slice(&entries[before..]);
        let first = if before == 0 && !entries.is_empty() { first + count } else { first };
        Run { first, start, end: self.numbers.len() }
    }

    /// Stores a run without the zeros at its ends.
    fn store(&mut self, first: usize, entries: &[f64]) -> Run {
        let from = entries.iter().position(|x| *x != 0.0).unwrap_or(0);
        let to = entries.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
        let start = self.numbers.len();
        self.numbers.extend_from_slice(&entries[from..to]);
        Run { first: first + from, start, end: self.numbers.len() }
    }

    /// Returns the value c and the bounds of each row, [c, lower, upper], in the order in which the rows were appended.
    pub fn bounds(&self) -> impl ExactSizeIterator<Item = [f64; 3]> {
        self.rows.iter().map(|row| [row.c, row.lower, row.upper])
    }

    /// Returns the first column and the entries of each row. The rows of groups have none here.
    pub(crate) fn runs(&self) -> impl ExactSizeIterator<Item = (usize, &[f64])> {
        self.rows.iter().map(|Row { run, .. }| (run.first, &self.numbers[run.start..run.end]))
    }

    /// Returns the groups of rows.
    pub(crate) fn groups(&self) -> impl ExactSizeIterator<Item = RowGroup<'_>> {
        self.groups.iter().map(|Group { rows, forms, weights }| RowGroup {
            rows: rows.clone(),
            W: &self.numbers[weights.clone()],
            all: self,
            forms: forms.clone(),
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
        let mut add = |i: usize, factor: f64, (first, entries): (usize, &[f64])| {
            for (j, x) in (first..).zip(entries) {
                if j < ndx { C[(i, j)] += factor * x } else { D[(i, j - ndx)] += factor * x }
            }
        };
        self.runs().enumerate().for_each(|(i, run)| add(i, 1.0, run));
        for group in self.groups() {
            for (i, weights) in group.rows.clone().zip(group.weights()) {
                weights.iter().zip(group.forms()).for_each(|(w, form)| add(i, *w, form));
            }
        }
        [C, D]
    }

    /// Panics if a row extends beyond the given number of columns.
    #[track_caller]
    pub(super) fn assert_columns(&self, columns: usize) {
        let forms = self.groups().flat_map(|group| group.forms().map(move |form| (group.rows.start, form)));
        for (i, (first, entries)) in self.runs().enumerate().chain(forms) {
            let end = first + entries.len();
            assert!(end <= columns, "row {i} of `rows` ends at column {end}, but [C D] has {columns}");
        }
    }
}
