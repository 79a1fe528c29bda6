//! Workspace of one step of the Riccati sweep.
#![allow(non_snake_case)] // names follow the literature: P, F, W, H

use super::feedback::KnotFeedback;
use super::knot::{DIVERGED, LqKnot};
use condyle_linalg::{
    Aligned, View, add_scaled_product, copy_matrix, copy_symmetric_turned, copy_with_squares, padded,
};

/// Workspace: the value function of the next knot, ½ δxᵀP δx + pᵀδx, and the quadratic form H that a step computes from
/// it. Matrices are column-major with padding rows. P has the stride `padded(n)`; the others have the stride
/// [`stride`](Self::stride).
#[derive(Debug, Clone)]
pub(crate) struct Workspace {
    /// Hessian Vxx⁺ of the value function, symmetric, with both triangles filled.
    pub(crate) P: Aligned,
    /// Gradient Vx⁺ of the value function, overwritten by the gradient Vx⁺ + Vxx⁺ f at the predicted state.
    pub(crate) p: Vec<f64>,
    /// Matrix [B A]ᵀ, or the transpose of the last rows of [B A]. Its rows are in the order of the columns of H.
    pub(crate) F: Aligned,
    /// Transpose of the product of P with [B A], and of similar products.
    pub(crate) W: Aligned,
    /// Lower triangle of the quadratic form [Hᵤᵤ ·; Hₓᵤ Hₓₓ; gᵤᵀ gₓᵀ]. Further rows below it are used by a segment of
    /// the horizon, or contain the map from the unknowns and δx to the controls.
    pub(crate) H: Aligned,
    /// Number of rows below the quadratic form in H.
    below: usize,
}

impl Workspace {
    /// Allocates the workspace for knots with n states and at most m controls, with `below` additional rows in H.
    pub(crate) fn new(n: usize, m: usize, below: usize) -> Self {
        let stride = padded(m + n + 1 + below);
        Self {
            P: Aligned::zeros(padded(n) * n),
            p: vec![0.0; n],
            F: Aligned::zeros(stride * n),
            W: Aligned::zeros(stride * n),
            H: Aligned::zeros(stride * (m + n)),
            below,
        }
    }

    /// Returns the stride of F, W and H at a knot with m controls: m + n + 1 rows, plus the rows below and padding.
    pub(crate) fn stride(&self, m: usize) -> usize {
        padded(m + self.p.len() + 1 + self.below)
    }

    /// Sets P = Q and p = q, from the terminal knot.
    pub(crate) fn start(&mut self, knot: &LqKnot) {
        let n = knot.ndx();
        self.p.copy_from_slice(knot.q.as_slice());
        copy_matrix(&mut self.P, padded(n), View::new(knot.Q.as_slice(), n), [n, n]);
    }

    /// Adds P f to p; the result is the gradient at the predicted state.
    pub(crate) fn move_by(&mut self, f: &[f64]) {
        if f.iter().any(|f| *f != 0.0) {
            add_scaled_product(&mut self.p, 1.0, View::new(&self.P, padded(f.len())), f);
        }
    }

    /// Computes P f, the product with a gap f.
    pub(crate) fn curve(&self, f: &[f64], to: &mut [f64]) {
        to.fill(0.0);
        if f.iter().any(|f| *f != 0.0) {
            add_scaled_product(to, 1.0, View::new(&self.P, padded(f.len())), f);
        }
    }

    /// Copies the value function from H (stride `ld`) to P = Vxx and p = Vx. The first `eliminated` columns of H are
    /// eliminated, and the states of H are rotated by `turn`.
    pub(crate) fn take_value(&mut self, ld: usize, eliminated: usize, turn: usize) {
        let Self { P, p, H, .. } = self;
        let n = p.len();
        let states = &H[eliminated * (ld + 1)..];
        copy_symmetric_turned(P, padded(n), View::new(states, ld), n, turn);
        let (after, before) = p.split_at_mut(turn); // states of H after and before the wrap-around
        let mut at = n;
        for part in [before, after] {
            for p in part {
                *p = states[at];
                at += ld;
            }
        }
    }

    /// Adds the regularisation ϱ 1 to P. Writes p to the feedback, and P if `keep` is set. Returns whether P and p are
    /// finite and have not diverged.
    pub(crate) fn finish_value(&mut self, feedback: &mut KnotFeedback, regularisation: f64, keep: bool) -> bool {
        let Self { P, p, .. } = self;
        let (n, stride) = (p.len(), padded(p.len()));
        for j in 0..n {
            P[j * stride + j] += regularisation;
        }
        let (Vx, Vxx) = (feedback.Vx.as_mut_slice(), if keep { feedback.Vxx.as_mut_slice() } else { &mut [] });
        let squares = copy_with_squares(Vxx, n, View::new(P, stride), [n, n]);
        let squares = squares + copy_with_squares(Vx, n, View::new(p, n), [n, 1]);
        squares < DIVERGED * DIVERGED // false for NaN
    }
}
