//! Knots as equations of inverse dynamics, for small arms. Every coordinate has a motor, and the configurations are a
//! vector space.
//!
//! This is the form of [`inverse_dynamics`](super::inverse_dynamics) in which every coordinate is an unknown, y = δv +
//! w, and T = E = 1:
//!
//! ```text
//!     ⎡ Π ·   ·      ⎤   over (w, δv, δq)
//! H = ⎢ Π Π   ·      ⎥ + cost + Uᵀ (R + ϱ 1) U + Gᵀ a″ G
//!     ⎣ Nᵀ Nᵀ P₁₁    ⎦
//! ```
//!
//! The elimination multiplies each row of U and G by the square root of its weight. It adds the outer products of these
//! rows to H in tiles.
#![allow(non_snake_case)] // names follow the literature; also N, Π, U

use super::super::feedback::{KnotFeedback, take_gains};
use super::super::knot::LqKnot;
use super::super::structure::InverseDynamicsForm;
use super::super::workspace::Workspace;
use super::{Curvature, KnotForm};
use condyle_linalg::{
    Aligned, SLACK, Vector, Vectorized, View, add_blocks, add_in_turn, at_narrow_level, copy_scaled, eliminate_sum,
    padded, transpose_block,
};

/// Maximum number of coordinates. For more coordinates, the form that skips zeros in the rows is faster.
pub(in crate::lq) const MOST: usize = 16;

/// Form of knots of small arms in which every coordinate has a motor, with its scratch.
#[derive(Debug, Clone)]
pub(in crate::lq) struct Driven {
    /// Scaled rows of U and G with columns for (w, δv, δq). Each row ends with its entry of the gradient and with
    /// zeros. Shape: `stride` × (MOST + [`MOST_COSTS`](Self::MOST_COSTS)); empty for larger robots.
    rows: Aligned,
    stride: usize,
    /// Number of rows in use in `rows`.
    count: usize,
    /// Scratch of [`take_gains`].
    y: Vec<f64>,
}

impl Driven {
    /// Maximum number of residual rows in G.
    pub(in crate::lq) const MOST_COSTS: usize = 16;

    /// Allocates the scratch for n states.
    pub(super) fn new(n: usize) -> Self {
        let nv = if n <= 2 * MOST { n / 2 } else { 0 };
        let stride = padded(4 * nv + 1 + 3 * SLACK);
        Self { rows: Aligned::zeros(stride * (nv + Self::MOST_COSTS)), stride, count: 0, y: vec![0.0; 2 * nv + SLACK] }
    }

    /// Returns the number of rows that this form needs below H.
    pub(in crate::lq) fn rows_below(n: usize, m: usize) -> usize {
        if n <= 2 * MOST { m } else { 0 }
    }

    /// Returns whether this form applies to a knot. `regularisation` is the number that the sweep adds to the diagonal
    /// of R.
    pub(in crate::lq) fn takes(knot: &LqKnot, regularisation: f64) -> bool {
        let (nv, InverseDynamicsForm { own, slopes, diagonal, .. }) = (knot.ndx() / 2, &knot.inverse_dynamics);
        nv <= MOST
            && *own == [[0, 0, nv]]
            && knot.nu() == nv
            && knot.structure.euler().is_some_and(|(_, blocks)| blocks.is_empty())
            && slopes.len() <= Self::MOST_COSTS
            && slopes.iter().all(|slopes| slopes[1] > 0.0)
            && diagonal[nv..].iter().all(|r| r + regularisation > 0.0)
    }
}

impl KnotForm for Driven {
    fn turn(&self, n: usize) -> usize {
        n / 2
    }

    /// Writes H without the terms of U and G, and writes U to the rows below H.
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, _: &mut Curvature<'_>) {
        self.count = knot.nu() + knot.inverse_dynamics.slopes.len();
        at_narrow_level(Write { rows: &mut self.rows, stride: self.stride, work, knot, regularisation });
    }

    fn write_below(&mut self, _: &mut Workspace, _: &LqKnot, _: &[f64]) {
        unreachable!("segments of a horizon take the form for all robots");
    }

    /// Adds the terms of U and G to H, and eliminates the unknowns. With the rows of U below H, the result is [L ·; X
    /// Hₓₓ − X Xᵀ; yᵀ ·; Y K], as in [`Gains`](super::super::feedback::Gains).
    fn eliminate(&mut self, work: &mut Workspace, knot: &LqKnot, _: &mut KnotFeedback) -> Result<usize, (usize, f64)> {
        let (n, m, ld) = (knot.ndx(), knot.nu(), work.stride(knot.nu()));
        let shape = [m + n + 1 + m, m + n, m];
        eliminate_sum(&mut work.H, ld, shape, View::new(&self.rows, self.stride), [m + n + 1, self.count])?;
        Ok(m)
    }

    fn write_gains(&mut self, work: &mut Workspace, knot: &LqKnot, feedback: &mut KnotFeedback, _: bool) {
        let (all, ld) = (knot.ndx() + knot.nu(), work.stride(knot.nu()));
        let H = View::new(&work.H, ld);
        take_gains(H.at(all + 1, 0), H.at(all, 0), knot, feedback, &mut self.y);
    }
}

/// Inner loops of [`Driven::write`], compiled for each SIMD level.
struct Write<'a> {
    rows: &'a mut [f64],
    stride: usize,
    work: &'a mut Workspace,
    knot: &'a LqKnot,
    regularisation: f64,
}

impl Vectorized for Write<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { rows, stride, work, knot, regularisation } = self;
        let (nv, ld, form) = (knot.nu(), work.stride(knot.nu()), &knot.inverse_dynamics);
        let (n, all, size) = (2 * nv, 3 * nv, form.stride);
        let (dt, _) = knot.structure.euler().expect("the form is that of Euler steps");
        let Workspace { P, p, H, .. } = work;
        let (P, Q) = (View::new(P, padded(n)), View::new(knot.Q.as_slice(), n));
        let (v, q) = (nv * ld, n * ld); // offsets of the columns of δv and δq in H

        // writes Nᵀ = Δt P₁₁ + P₁₂, Π = Δt (Nᵀ + P₂₁) + P₂₂, and Q + P₁₁ in the block of δq
        let places = ([n, v + n], [0, nv, v + nv]);
        add_in_turn::<V, 2, 3>(H, ld, places, P.at(0, nv), P, dt, [nv, nv]);
        add_blocks::<V>(&mut H[q + n..], ld, Q, P, [nv, nv]);
        let ((p_q, p_v), (gradient_q, gradient_v)) = (p.split_at(nv), knot.q.as_slice().split_at(nv));
        for j in 0..nv {
            let y = dt * p_q[j] + p_v[j];
            H[j * ld + all] = y;
            H[v + j * ld + nv + j] += form.diagonal[j];
            H[v + j * ld + all] = y + gradient_v[j];
            H[q + j * ld + all] = gradient_q[j] + p_q[j];
        }
        transpose_block::<V>(&mut H[all + 1..], ld, View::new(&form.efforts.numbers, size), [all, nv]);

        // scales each row x to √a″ x, and its entry of the gradient to a′ / √a″
        let (efforts, costs) = (form.efforts.numbers.chunks_exact(size), form.costs.numbers.chunks_exact(size));
        for (k, (x, row)) in efforts.chain(costs).zip(rows.chunks_exact_mut(stride)).enumerate() {
            let [d, dd] =
                if k < nv { [knot.r[k], form.diagonal[nv + k] + regularisation] } else { form.slopes[k - nv] };
            let root = condyle_spatial::Scalar::sqrt(dd);
            copy_scaled::<V>(row, &x[..all], root);
            row[all] = d / root;
        }
    }
}
