//! Terms by which the constraint rows of a knot enter the quadratic form of a step.
#![allow(non_snake_case)] // names follow the literature: C, D, H, P

use super::knot::LqKnot;
use super::workspace::Workspace;
use condyle_linalg::{SLACK, View, add_product_lower};

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

/// Scratch for rows with several entries: their entries times √σ, in the order of the columns of H.
#[derive(Debug, Clone, Default)]
pub(super) struct ScaledRows(Vec<f64>);

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
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        let (all, stride) = (m + n, m + n + SLACK);
        // column of H for a column of [C D]
        let place = |j: usize| match j {
            j if j >= n => j - n,
            j if j >= turn => m + j - turn,
            j => m + n + j - turn,
        };
        let (H, mut count, mut columns) = (&mut work.H, 0, all..0);
        for (row, &[slope, curvature]) in knot.rows.iter().zip(&self.terms[self.offsets[t]..self.offsets[t + 1]]) {
            if [slope, curvature] == [0.0; 2] || row.entries.is_empty() {
                continue;
            }
            if let [entry] = row.entries {
                let j = place(row.first);
                H[j * ld + j] += curvature * entry * entry;
                H[j * ld + all] += slope * entry;
                continue;
            }
            let first = count * stride;
            if scratch.0.len() < first + stride {
                scratch.0.resize(first + stride, 0.0);
            }
            let scaled = &mut scratch.0[first..][..stride];
            scaled.fill(0.0);
            let root = curvature.sqrt();
            // runs of columns that are consecutive in [C D] and in H
            let mut at = 0;
            while at < row.entries.len() {
                let j = row.first + at;
                let end = if j < turn {
                    turn
                } else if j < n {
                    n
                } else {
                    n + m
                };
                let run = &row.entries[at..row.entries.len().min(end - row.first)];
                let to = place(j);
                for (k, entry) in (to..).zip(run) {
                    scaled[k] = root * entry;
                    H[k * ld + all] += slope * entry;
                }
                columns = columns.start.min(to)..columns.end.max(to + run.len());
                at += run.len();
            }
            count += 1;
        }
        if count > 0 {
            let (first, size) = (columns.start, columns.len());
            let rows = View::new(&scratch.0[first..], stride);
            add_product_lower(&mut H[first * (ld + 1)..], ld, [size, size, count], rows, rows);
        }
    }

    /// Adds the terms of the terminal knot t to P and p.
    pub(super) fn add_to_value(&self, t: usize, knot: &LqKnot, work: &mut Workspace) {
        let stride = knot.ndx() + SLACK;
        let Workspace { P, p, .. } = work;
        for (row, &[slope, curvature]) in knot.rows.iter().zip(&self.terms[self.offsets[t]..self.offsets[t + 1]]) {
            for (j, entry) in (row.first..).zip(row.entries) {
                p[j] += slope * entry;
                let scaled = curvature * entry;
                for (P, entry) in P[j * stride + row.first..].iter_mut().zip(row.entries) {
                    *P += scaled * entry;
                }
            }
        }
    }
}
