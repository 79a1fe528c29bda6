//! Elimination of the controls from a knot's quadratic form; controls at a bound are not eliminated.
#![allow(non_snake_case)] // names follow the literature: K, Quu

use super::super::box_qp::BoxQp;
use super::super::feedback::KnotFeedback;
use super::super::knot::LqKnot;
use super::super::workspace::Workspace;
use condyle_linalg::{SLACK, View, copy_symmetric, dot, eliminate, solve_right, transpose_negated};

/// Elimination of the controls, with its scratch.
#[derive(Debug, Clone)]
pub(super) struct Controls {
    qp: BoxQp,
    /// Transpose of the factor L, for the back substitution.
    upper: Vec<f64>,
    /// Number of controls that the last elimination eliminated.
    free: usize,
}

impl Controls {
    /// Allocates the scratch for m controls.
    pub(super) fn new(m: usize) -> Self {
        Self { qp: BoxQp::new(m), upper: vec![0.0; (m + SLACK) * m], free: 0 }
    }

    /// Eliminates the controls that are not at a bound: L Lᵀ = Quu, X = Qxu L⁻ᵀ, Vxx = Qxx − X Xᵀ, Vx = Qx − X y.
    /// Stores Qu and Quu in the feedback and, if there are bounds, k in the scratch. Returns the number of eliminated
    /// controls.
    ///
    /// # Errors
    /// Index of the control and its pivot, if the pivot is not positive.
    pub(super) fn eliminate(
        &mut self,
        work: &mut Workspace,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
    ) -> Result<usize, (usize, f64)> {
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        let H = &mut work.H;
        for j in 0..m {
            feedback.Qu[j] = H[j * ld + m + n];
        }
        copy_symmetric(feedback.Quu.as_mut_slice(), m, View::new(H, ld), m);
        if !knot.is_bounded() {
            self.free = m;
            eliminate(H, ld, [m + n + 1, m + n, m])?;
            return Ok(m);
        }
        let (lower, upper) = (knot.lower.as_slice(), knot.upper.as_slice());
        let start = feedback.k.iter().map(|k| -k);
        self.qp.solve(&feedback.Quu, feedback.Qu.as_slice(), lower, upper, start)?;
        let free = &self.qp.free;
        keep_free(H, ld, m, n, free);
        self.free = free.len();
        eliminate(H, ld, [self.free + n + 1, self.free + n, self.free]).map_err(|(row, pivot)| (free[row], pivot))?;
        Ok(self.free)
    }

    /// Computes the gains [K k]ᵀ = −[X; yᵀ] L⁻¹ from the result of the elimination, in which the states are rotated by
    /// `turn`.
    pub(super) fn write_gains(
        &mut self,
        work: &mut Workspace,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
        turn: usize,
    ) {
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        let (Self { qp, upper, free }, H, split) = (self, &mut work.H, n - turn);
        let free = *free;
        solve_right(H, ld, [free, free + n + 1, free], upper);
        let K = feedback.K.as_mut_slice();
        if knot.is_bounded() {
            K.fill(0.0);
            for i in 0..n {
                let state = if i < split { i + turn } else { i - split };
                for j in 0..free {
                    K[state * m + qp.free[j]] = -H[j * ld + free + i];
                }
            }
            feedback.k.copy_from_slice(&qp.x[..m]);
            for j in 0..m {
                if qp.free.binary_search(&j).is_err() {
                    feedback.Qu[j] = 0.0;
                }
            }
        } else {
            transpose_negated(&mut K[turn * m..], m, View::new(&H[m..], ld), [split, m]);
            transpose_negated(K, m, View::new(&H[m + split..], ld), [turn, m]);
            for j in 0..m {
                feedback.k[j] = -H[j * ld + m + n];
            }
        }
        let k = feedback.k.as_slice();
        feedback.expected = [dot(feedback.Qu.as_slice(), k), 0.0];
        for (column, k_j) in feedback.Quu.column_iter().zip(k) {
            feedback.expected[1] += k_j * dot(column.as_slice(), k);
        }
    }
}

/// Moves the rows and columns of the free controls to the front of H, and the rows and columns of the states after
/// them. `free` contains the indices of the free controls among m.
fn keep_free(H: &mut [f64], stride: usize, m: usize, n: usize, free: &[usize]) {
    let (kept, rows) = (free.len(), m + n + 1);
    for (to, from) in free.iter().copied().chain(m..m + n).enumerate() {
        for (row, &i) in free.iter().enumerate() {
            H[to * stride + row] = H[from * stride + i];
        }
        H.copy_within(from * stride + m..from * stride + rows, to * stride + kept);
    }
}
