//! Rows of the Jacobians of residuals. All rows of a knot are collected first. Then the gradient and the Gauss–Newton
//! Hessian are written once: each entry of Q, S and R is a sum of products of row entries.
#![allow(non_snake_case)] // names follow the literature

use crate::lq::LqKnot;
use condyle_linalg::{Aligned, Vector, Vectorized, View, at_level, padded, product_without_slack};
use core::ops::Range;

/// Adds d to q and diag(dd) to Q at `entries`, for a residual whose Jacobian there is the identity.
pub(crate) fn add_state_diagonal(knot: &mut LqKnot, entries: Range<usize>, d: &[f64], dd: &[f64]) {
    let (n, inverse, form) = (knot.ndx(), knot.structure.is_inverse_dynamics(), &mut knot.inverse_dynamics);
    for i in entries.clone() {
        knot.q[i] += d[i];
    }
    let explicit = if inverse { n / 2 } else { n };
    for i in entries.start..entries.end.min(explicit) {
        knot.Q.as_mut_slice()[i * (n + 1)] += dd[i];
    }
    for i in entries.start.max(explicit)..entries.end {
        form.diagonal[i - n / 2] += dd[i];
    }
}

/// Adds d to r and diag(dd) to R, for a residual whose Jacobian is the identity.
pub(crate) fn add_control_diagonal(knot: &mut LqKnot, d: &[f64], dd: &[f64]) {
    let (n, m, inverse) = (knot.ndx(), knot.nu(), knot.structure.is_inverse_dynamics());
    let form = &mut knot.inverse_dynamics;
    for i in 0..m {
        knot.r[i] += d[i];
        match inverse {
            true => form.diagonal[n / 2 + i] += dd[i],
            false => knot.R.as_mut_slice()[i * (m + 1)] += dd[i],
        }
    }
}

/// Row of a Jacobian with respect to (u, v, q), to which derivatives are added.
pub(crate) struct Row<'a> {
    pub u: &'a mut [f64],
    pub v: &'a mut [f64],
    pub q: &'a mut [f64],
}

/// Rows of all residuals of a knot, with respect to (u, v, q), and the derivatives a′ and a″ of their activations. In a
/// knot in inverse-dynamics form, u stands for the unknowns that replace the controls.
#[derive(Clone, Debug)]
pub(crate) struct Rows {
    nu: usize,
    nv: usize,
    /// Stride: distance from the first entry of a row to the first entry of the next row.
    stride: usize,
    /// Buffer of rows, filled from both ends. Rows of residuals that depend on more than q begin at the front; rows of
    /// residuals that depend only on q begin at the back.
    rows: Aligned,
    /// Derivatives a′ and a″ of the activation for each row.
    slopes: Vec<[f64; 2]>,
    /// Number of rows with respect to (u, v, q); the next field is the number of rows with respect to only q.
    whole: usize,
    positions: usize,
    /// Rows multiplied by √|a″|; the next field contains the same rows with the sign of a″.
    left: Aligned,
    right: Aligned,
}

impl Rows {
    /// Allocates `whole` rows with respect to (u, v, q) and `positions` rows with respect to only q.
    pub(crate) fn new(nv: usize, nu: usize, [whole, positions]: [usize; 2]) -> Self {
        let (most, stride) = (whole + positions, padded(nu + 2 * nv));
        let rows = Aligned::zeros(most.max(1) * stride);
        let (left, right, slopes) = (rows.clone(), rows.clone(), vec![[0.0; 2]; most]);
        Self { nu, nv, stride, rows, slopes, whole: 0, positions: 0, left, right }
    }

    /// Removes all rows.
    pub(crate) fn clear(&mut self) {
        (self.whole, self.positions) = (0, 0);
    }

    /// Appends a row of zeros with the derivatives `worth` = [a′, a″] of the activation. Returns the row, which the
    /// caller fills.
    pub(crate) fn push(&mut self, worth: [f64; 2]) -> Row<'_> {
        let k = self.whole;
        self.slopes[k] = worth;
        self.whole += 1;
        let row = &mut self.rows[k * self.stride..][..self.nu + 2 * self.nv];
        row.fill(0.0);
        let (u, x) = row.split_at_mut(self.nu);
        let (v, q) = x.split_at_mut(self.nv);
        Row { u, v, q }
    }

    /// Appends a row of a Jacobian with respect to only q, with the derivatives `worth` = [a′, a″] of the activation.
    pub(crate) fn push_positions(&mut self, row: &[f64], worth: [f64; 2]) {
        self.positions += 1;
        let k = self.slopes.len() - self.positions;
        self.slopes[k] = worth;
        self.rows[k * self.stride + self.nu + self.nv..][..self.nv].copy_from_slice(row);
    }

    /// Returns row i of those that were pushed with respect to the columns (q, v, u) of δx and δu, and the column of
    /// its first entry. If all rows are functions of q alone, the row has only the columns of q.
    pub(crate) fn of_knot(&mut self, i: usize) -> &[f64] {
        let (u, v) = (self.nu, self.nv);
        if i >= self.whole {
            let k = self.slopes.len() - 1 - (i - self.whole);
            return &self.rows[k * self.stride + u + v..][..v];
        }
        let (row, to) = (&self.rows[i * self.stride..][..u + 2 * v], &mut self.left[..u + 2 * v]);
        to[..v].copy_from_slice(&row[u + v..]);
        to[v..2 * v].copy_from_slice(&row[u..u + v]);
        to[2 * v..].copy_from_slice(&row[..u]);
        to
    }

    /// Writes q, r, Q, S and R from the matrix G of all rows: the gradient is Gᵀ a′, the Hessian Gᵀ a″ G. In
    /// inverse-dynamics form, only the gradient and the block of Q for positions are written. The sweep then uses the
    /// rows that depend on more than positions.
    pub(crate) fn write(&mut self, knot: &mut LqKnot) {
        knot.q.as_mut_slice().fill(0.0);
        knot.r.as_mut_slice().fill(0.0);
        if knot.structure.is_inverse_dynamics() {
            knot.inverse_dynamics.set_costs(&self.rows[..self.whole * self.stride], &self.slopes[..self.whole]);
        }
        at_level(Write { rows: self, knot });
    }
}

struct Write<'a> {
    rows: &'a mut Rows,
    knot: &'a mut LqKnot,
}

impl Vectorized for Write<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { rows: Rows { nu, nv, stride, rows, slopes, whole, positions, left, right }, knot } = self;
        let (m, nv, n, stride) = (*nu, *nv, 2 * *nv, *stride);
        let inverse = knot.structure.is_inverse_dynamics();
        let (some, all) = if inverse { (0, *positions) } else { (*whole, *whole + *positions) };
        let first = slopes.len() - *positions;
        for k in 0..all {
            let from = if k < some { k } else { first + k - some };
            let ([d, dd], row) = (slopes[from], &rows[from * stride..][..stride]);
            let start = if k < some { 0 } else { m + nv };
            if k < some {
                add_multiple(knot.r.as_mut_slice(), row, d);
                add_multiple(&mut knot.q.as_mut_slice()[nv..], &row[m..], d);
            }
            add_multiple(&mut knot.q.as_mut_slice()[..nv], &row[m + nv..], d);
            let scale = dd.abs().sqrt();
            let (left, right) = (&mut left[k * stride..][..stride], &mut right[k * stride..][..stride]);
            for i in start..stride {
                left[i] = row[i] * scale;
                right[i] = if dd < 0.0 { -left[i] } else { left[i] };
            }
        }
        let (u, v, q) = (0, m, m + nv); // offsets of u, v and q in a row
        let Q = knot.Q.as_mut_slice();
        let both = [&left[..], &right[..]];
        if inverse {
            knot.inverse_dynamics.diagonal.fill(0.0);
            for k in 0..if all == 0 { nv } else { 0 } {
                Q[k * n..][..nv].fill(0.0);
            }
        } else if some == 0 {
            Q.fill(0.0);
            knot.S.as_mut_slice().fill(0.0);
            knot.R.as_mut_slice().fill(0.0);
        } else {
            outer(&mut Q[nv..], n, [nv, nv], [v, q], both, stride, some);
            outer(&mut Q[nv * n..], n, [nv, nv], [q, v], both, stride, some);
            outer(&mut Q[nv * n + nv..], n, [nv, nv], [v, v], both, stride, some);
            if m > 0 {
                outer(knot.S.as_mut_slice(), n, [nv, m], [q, u], both, stride, some);
                outer(&mut knot.S.as_mut_slice()[nv..], n, [nv, m], [v, u], both, stride, some);
                outer(knot.R.as_mut_slice(), m, [m, m], [u, u], both, stride, some);
            }
        }
        if all > 0 {
            outer(Q, n, [nv, nv], [q, q], both, stride, all);
        }
    }
}

/// Computes y += a x for the entries of x.
#[inline(always)]
fn add_multiple(y: &mut [f64], x: &[f64], a: f64) {
    for i in 0..y.len().min(x.len()) {
        y[i] += a * x[i];
    }
}

/// Computes C = Σ left rightᵀ over the first `length` rows of `left` and `right`. The rows of C correspond to entries
/// of `left`, and the columns of C to entries of `right`, each from a given offset. Both triangles of C contain the
/// same sums.
fn outer(
    C: &mut [f64],
    ldc: usize,
    [rows, columns]: [usize; 2],
    from: [usize; 2],
    [left, right]: [&[f64]; 2],
    stride: usize,
    length: usize,
) {
    let (left, right) = (View::new(&left[from[0]..], stride), View::new(&right[from[1]..], stride));
    product_without_slack(C, ldc, [rows, columns, length], left, right);
}
