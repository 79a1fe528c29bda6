//! Terms by which the constraint rows of a knot enter the quadratic form of a step.
#![allow(non_snake_case)] // names follow the literature: C, D, H, P

use super::knot::LqKnot;
use super::rows::{MOST_FORMS, RowGroup};
use super::workspace::Workspace;
use condyle_linalg::{SLACK, View, add_product_lower, add_scaled_product, padded};
use core::ops::Range;

/// Slopes and curvatures of the constraint rows of a horizon. They add to the cost of each knot
///
/// ```text
/// Σᵢ dᵢ ρᵢ + ½ σᵢ ρᵢ²,     ρ = C δx + D δu
/// ```
#[derive(Clone, Copy)]
pub(crate) struct RowTerms<'a> {
    /// Index of the first row of each knot, and the number of all rows.
    pub(crate) offsets: &'a [usize],
    /// Slope d and curvature σ ≥ 0 of each row.
    pub(crate) terms: &'a [[f64; 2]],
}

/// Rows with several entries, in the order of the columns of H.
#[derive(Debug, Clone, Default)]
pub(super) struct ScaledRows {
    rows: Vec<f64>,
    /// Combinations of the rows by their curvature.
    scaled: Vec<f64>,
    /// Sum of the rows times their slopes.
    slope: Vec<f64>,
    stride: usize,
    count: usize,
    /// Range of the columns that some row has.
    columns: Range<usize>,
}

impl ScaledRows {
    /// Removes all rows, and sets the number of columns.
    fn clear(&mut self, columns: usize) {
        (self.stride, self.count, self.columns) = (columns + SLACK, 0, columns..0);
        self.slope.clear();
        self.slope.resize(self.stride, 0.0);
    }

    /// Appends a row of zeros. Returns the row, which the caller fills at `columns`.
    fn push(&mut self, columns: Range<usize>) -> &mut [f64] {
        let first = self.count * self.stride;
        self.count += 1;
        self.columns = self.columns.start.min(columns.start)..self.columns.end.max(columns.end);
        for rows in [&mut self.rows, &mut self.scaled] {
            if rows.len() < first + self.stride {
                rows.resize(first + self.stride, 0.0);
            }
            rows[first..][..self.stride].fill(0.0);
        }
        &mut self.rows[first..][..self.stride]
    }

    /// Sets the slopes and the curvature of the last rows, which are combined.
    fn set_terms<const N: usize>(&mut self, slopes: &[f64], curvature: &[[f64; N]]) {
        let first = (self.count - slopes.len()) * self.stride;
        let rows = View::new(&self.rows[first..self.count * self.stride], self.stride);
        add_scaled_product(&mut self.slope, 1.0, rows, slopes);
        for (scaled, factors) in self.scaled[first..].chunks_exact_mut(self.stride).zip(curvature) {
            add_scaled_product(scaled, 1.0, rows, &factors[..slopes.len()]);
        }
    }

    /// Sets the slope and the curvature of the last row.
    fn set_last_terms(&mut self, [slope, curvature]: [f64; 2]) {
        let (first, columns) = ((self.count - 1) * self.stride, self.columns.clone());
        let row = &self.rows[first..][columns.clone()];
        for (sum, entry) in self.slope[columns.clone()].iter_mut().zip(row) {
            *sum += slope * entry;
        }
        for (scaled, entry) in self.scaled[first..][columns].iter_mut().zip(row) {
            *scaled = curvature * entry;
        }
    }

    /// Adds the curvature of all rows to the lower triangle of H, and their slope to its last row.
    fn add_to(&self, H: &mut [f64], ld: usize) {
        if self.count == 0 {
            return;
        }
        let (first, size, last) = (self.columns.start, self.columns.len(), self.stride - SLACK);
        for k in self.columns.clone() {
            H[k * ld + last] += self.slope[k];
        }
        let [left, right] = [&self.scaled, &self.rows].map(|rows| View::new(&rows[first..], self.stride));
        add_product_lower(&mut H[first * (ld + 1)..], ld, [size, size, self.count], left, right);
    }
}

/// Order of the columns of [C D] in H: first the columns of δu, then the columns of δx, rotated by `turn`.
#[derive(Clone, Copy)]
struct Columns {
    n: usize,
    m: usize,
    turn: usize,
}

impl Columns {
    /// Returns the column of H for column j of [C D].
    fn place(self, j: usize) -> usize {
        let Self { n, m, turn } = self;
        match j {
            j if j >= n => j - n,
            j if j >= turn => m + j - turn,
            j => m + n + j - turn,
        }
    }

    /// Calls `visit` with each run of columns that are consecutive in [C D] and in H: the first column of H, and the
    /// entries.
    fn each_run(self, first: usize, entries: &[f64], mut visit: impl FnMut(usize, &[f64])) {
        let Self { n, m, turn } = self;
        let mut at = 0;
        while at < entries.len() {
            let j = first + at;
            let end = [turn, n, n + m].into_iter().find(|end| j < *end).unwrap_or(usize::MAX);
            let run = &entries[at..entries.len().min(end - first)];
            visit(self.place(j), run);
            at += run.len();
        }
    }

    /// Appends a run of [C D] to `rows`.
    fn push_run(self, first: usize, entries: &[f64], rows: &mut ScaledRows) {
        let Self { n, turn, .. } = self;
        let end = first + entries.len();
        if end <= turn || (turn <= first && end <= n) || n <= first {
            let to = self.place(first);
            return rows.push(to..to + entries.len())[to..][..entries.len()].copy_from_slice(entries);
        }
        let [mut start, mut end] = [usize::MAX, 0];
        self.each_run(first, entries, |to, run| (start, end) = (start.min(to), end.max(to + run.len())));
        let row = rows.push(start..end);
        self.each_run(first, entries, |to, run| row[to..to + run.len()].copy_from_slice(run));
    }
}

impl RowTerms<'_> {
    /// Adds the terms of knot t to the lower triangle of H = [H_uu ·; H_xu H_xx; g_uᵀ g_xᵀ]. The states of H are
    /// rotated by `turn`.
    pub(super) fn add_to_form(
        &self,
        t: usize,
        knot: &LqKnot,
        turn: usize,
        work: &mut Workspace,
        scratch: &mut ScaledRows,
    ) {
        let terms = &self.terms[self.offsets[t]..self.offsets[t + 1]];
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        let (H, columns) = (&mut work.H, Columns { n, m, turn });
        scratch.clear(m + n);
        for ((first, entries), &[slope, curvature]) in knot.rows.runs().zip(terms) {
            if [slope, curvature] == [0.0; 2] || entries.is_empty() {
                continue;
            }
            if let [entry] = entries {
                let j = columns.place(first);
                H[j * ld + j] += curvature * entry * entry;
                H[j * ld + m + n] += slope * entry;
                continue;
            }
            columns.push_run(first, entries, scratch);
            scratch.set_last_terms([slope, curvature]);
        }
        for group in knot.rows.groups() {
            add_group(&group, &terms[group.rows.clone()], columns, H, ld, scratch);
        }
        scratch.add_to(H, ld);
    }

    /// Adds the terms of the terminal knot t to P and p.
    pub(super) fn add_to_value(&self, t: usize, knot: &LqKnot, work: &mut Workspace) {
        let stride = padded(knot.ndx());
        let Workspace { P, p, .. } = work;
        assert_eq!(knot.rows.groups().len(), 0, "a terminal knot has no forces");
        for ((first, entries), &[slope, curvature]) in
            knot.rows.runs().zip(&self.terms[self.offsets[t]..self.offsets[t + 1]])
        {
            for (j, entry) in (first..).zip(entries) {
                p[j] += slope * entry;
                let scaled = curvature * entry;
                for (P, entry) in P[j * stride + first..].iter_mut().zip(entries) {
                    *P += scaled * entry;
                }
            }
        }
    }
}

/// Adds the terms of rows W φ: the slope Wᵀ d and the curvature Wᵀ Σ W of the forms φ. Where each form is one
/// coordinate, they are added to H; otherwise, the forms are appended to `scratch`.
fn add_group(
    group: &RowGroup<'_>,
    terms: &[[f64; 2]],
    columns: Columns,
    H: &mut [f64],
    ld: usize,
    scratch: &mut ScaledRows,
) {
    let all = columns.n + columns.m;
    let slope = group.transposed_product(terms.iter().map(|[slope, _]| *slope));
    let mut curvature = [[0.0; MOST_FORMS]; MOST_FORMS];
    for ([_, sigma], weights) in terms.iter().zip(group.weights()) {
        for (row, w) in curvature.iter_mut().zip(weights) {
            row.iter_mut().zip(weights).for_each(|(to, other)| *to += sigma * w * other);
        }
    }
    if group.forms().all(|(_, entries)| entries.len() <= 1) {
        let coordinate =
            |(first, entries): (usize, &[f64])| entries.first().map(|entry| (columns.place(first), *entry));
        for ((form, slope), curvature) in group.forms().zip(slope).zip(&curvature) {
            let Some((j, entry)) = coordinate(form) else { continue };
            H[j * ld + all] += slope * entry;
            for (other, curvature) in group.forms().zip(curvature) {
                if let Some((i, other)) = coordinate(other).filter(|(i, _)| *i >= j) {
                    H[j * ld + i] += curvature * entry * other;
                }
            }
        }
        return;
    }
    for (first, entries) in group.forms() {
        columns.push_run(first, entries, scratch);
    }
    let count = group.forms().len();
    scratch.set_terms(&slope[..count], &curvature[..count]);
}
