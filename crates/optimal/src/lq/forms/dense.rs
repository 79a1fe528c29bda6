//! Quadratic form of a knot whose A and B have no known structure.
#![allow(non_snake_case)] // names follow the literature: A, B, Q, …

use super::super::feedback::KnotFeedback;
use super::super::knot::{Hessian, LqKnot};
use super::super::workspace::Workspace;
use super::controls::Controls;
use super::{Curvature, KnotForm};
use condyle_linalg::{View, add_product_lower, copy_lower, copy_matrix, padded, product, transpose};

/// Form with full matrices A and B, and with the states in their original order.
#[derive(Debug, Clone)]
pub(super) struct Dense {
    controls: Controls,
}

impl Dense {
    /// Allocates the scratch for at most m controls.
    pub(super) fn new(m: usize) -> Self {
        Self { controls: Controls::new(m) }
    }
}

impl KnotForm for Dense {
    fn turn(&self, _: usize) -> usize {
        0
    }

    /// Writes H = [R + ϱ 1 ·; S Q; rᵀ qᵀ] + W [B A], W = [P B, P A, P f + p]ᵀ. The term ϱ 1 is the regularisation.
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, curvature: &mut Curvature<'_>) {
        let (n, m) = (knot.ndx(), knot.nu());
        let (ld, rows) = (work.stride(m), m + n);
        write_cost(work, knot, 0, curvature);
        let Workspace { P, p, F, W, H, .. } = work;
        transpose(F, ld, View::new(knot.B.as_slice(), n), [n, m]);
        transpose(&mut F[m..], ld, View::new(knot.A.as_slice(), n), [n, n]);
        let F = View::new(F, ld);
        product(W, ld, [rows, n, n], F, View::new(P, padded(n)));
        for k in 0..n {
            W[k * ld + rows] = p[k];
        }
        add_product_lower(H, ld, [rows + 1, rows, n], View::new(W, ld), F);
        add_to_diagonal(H, ld, m, regularisation);
    }

    /// Writes the product Θ [B A] to the rows below H.
    fn write_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]) {
        let (n, m) = (knot.ndx(), knot.nu());
        let ld = work.stride(m);
        let Workspace { F, H, .. } = work;
        product(&mut H[m + n + 1..], ld, [n, m + n, n], View::new(Theta, padded(n)), View::new(F, ld));
    }

    fn eliminate(
        &mut self,
        work: &mut Workspace,
        knot: &LqKnot,
        feedback: &mut KnotFeedback,
    ) -> Result<usize, (usize, f64)> {
        self.controls.eliminate(work, knot, feedback)
    }

    fn write_gains(&mut self, work: &mut Workspace, knot: &LqKnot, feedback: &mut KnotFeedback, _: bool) {
        let turn = self.turn(knot.ndx());
        self.controls.write_gains(work, knot, feedback, turn);
    }
}

/// Writes the lower triangle of H = [R ·; S Q; rᵀ qᵀ] + [ψuu ·; ψxu ψxx; 0 0], with the states rotated by `turn`. The
/// second matrix is the Hessian of the dynamics' curvature ψ.
pub(super) fn write_cost(work: &mut Workspace, knot: &LqKnot, turn: usize, curvature: &mut Curvature<'_>) {
    let (n, m) = (knot.ndx(), knot.nu());
    let (ld, split) = (work.stride(m), n - turn); // `split`: number of states before the rotated order wraps around
    let Workspace { H, p, .. } = work;
    let (R, S, Q) = (View::new(knot.R.as_slice(), m), View::new(knot.S.as_slice(), n), View::new(knot.Q.as_slice(), n));
    copy_lower(H, ld, R, m);
    copy_matrix(&mut H[m..], ld, S.at(turn, 0), [split, m]);
    copy_lower(&mut H[m * ld + m..], ld, Q.at(turn, turn), split);
    if turn > 0 {
        copy_matrix(&mut H[m + split..], ld, S, [turn, m]);
        copy_matrix(&mut H[m * ld + m + split..], ld, Q.at(0, turn), [turn, split]);
        copy_lower(&mut H[(m + split) * (ld + 1)..], ld, Q, turn);
    }
    for j in 0..m {
        H[j * ld + m + n] = knot.r[j];
    }
    for j in 0..n {
        let state = if j < split { j + turn } else { j - split };
        H[(m + j) * ld + m + n] = knot.q[state];
    }
    if let Some(hessian) = curvature.at(p, m) {
        add_hessian(H, ld, hessian, turn);
    }
}

/// Adds the Hessian [ψuu ·; ψxu ψxx] of the dynamics' curvature ψ to H, with the states rotated by `turn`.
fn add_hessian(H: &mut [f64], ld: usize, Hessian { xx, xu, uu }: &Hessian, turn: usize) {
    let (n, m) = xu.shape();
    let state = |i: usize| (i + turn) % n;
    for j in 0..m {
        for i in 0..m {
            H[j * ld + i] += uu[(i, j)];
        }
        for i in 0..n {
            H[j * ld + m + i] += xu[(state(i), j)];
        }
    }
    for j in 0..n {
        for i in j..n {
            H[(m + j) * ld + m + i] += xx[(state(i), state(j))];
        }
    }
}

/// Adds the regularisation ϱ to the diagonal of Quu.
pub(super) fn add_to_diagonal(H: &mut [f64], ld: usize, m: usize, regularisation: f64) {
    for j in 0..m {
        H[j * ld + j] += regularisation;
    }
}
