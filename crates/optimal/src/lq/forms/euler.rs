//! Quadratic form of a knot with semi-implicit Euler steps. The blocks of A and B that are the identity or Δt are never
//! multiplied.
#![allow(non_snake_case)] // names follow the literature; also N, Π, T, E

use super::super::feedback::KnotFeedback;
use super::super::knot::LqKnot;
use super::super::structure::{EulerBlock, LARGEST_BLOCK};
use super::super::workspace::Workspace;
use super::controls::Controls;
use super::dense::{add_to_diagonal, write_cost};
use super::{Curvature, KnotForm};
use condyle_linalg::{
    Aligned, Vector, Vectorized, View, add_in_turn, add_matrix, add_product_lower, add_transposed_product_lower,
    at_narrow_level, padded, product, transpose,
};

/// Form of semi-implicit Euler steps with the controls as unknowns, and with the states in the order (v, q).
#[derive(Debug, Clone)]
pub(super) struct Euler {
    steps: Steps,
    /// Scratch for the upper triangle of NᵀF_q, with the same stride as Nᵀ and Π.
    M: Aligned,
    controls: Controls,
}

impl Euler {
    /// Allocates the scratch for n states and at most m controls.
    pub(super) fn new(n: usize, m: usize) -> Self {
        Self { steps: Steps::new(n), M: Aligned::zeros(padded(n / 2) * (n / 2)), controls: Controls::new(m) }
    }
}

impl KnotForm for Euler {
    fn turn(&self, n: usize) -> usize {
        n / 2
    }

    /// Writes H. Let [G F_v F_q] be the rows of [B A] for the velocities:
    ///
    /// ```text
    /// W = (Π [G F_v F_q] + [0 0 N])ᵀ,   last row Δt Eᵀp_q + p_v
    /// H = cost + W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T,   Qx_q += Tᵀp_q
    /// ```
    fn write(&mut self, work: &mut Workspace, knot: &LqKnot, regularisation: f64, curvature: &mut Curvature<'_>) {
        let (n, m) = (knot.ndx(), knot.nu());
        let (nv, ld, rows) = (n / 2, work.stride(m), m + n);
        let ldn = padded(nv);
        let Self { steps, M, .. } = self;
        write_cost(work, knot, nv, curvature);
        steps.write(work, knot);

        let Workspace { F, W, H, .. } = work;
        let (A, B) = (View::new(knot.A.as_slice(), n), View::new(knot.B.as_slice(), n));
        transpose(F, ld, B.at(nv, 0), [nv, m]);
        transpose(&mut F[m..], ld, A.at(nv, nv), [nv, nv]);
        transpose(&mut F[m + nv..], ld, A.at(nv, 0), [nv, nv]);
        let (all, F_q) = (View::new(F, ld), View::new(&F[m + nv..], ld));
        let (N, Pi) = steps.N_and_Pi();
        let (N, Pi) = (View::new(N, ldn), View::new(Pi, ldn));
        product(W, ld, [rows, nv, nv], all, Pi);
        add_matrix(&mut W[m + nv..], ld, N, [nv, nv]);
        for k in 0..nv {
            W[k * ld + rows] = steps.py[k];
        }
        add_product_lower(H, ld, [rows + 1, rows, nv], View::new(W, ld), all);
        let H_qq = &mut H[(m + nv) * (ld + 1)..];
        add_transposed_product_lower(H_qq, ld, nv, N, F_q, M, ldn);
        steps.add_positions(work, knot);
        add_to_diagonal(&mut work.H, ld, m, regularisation);
    }

    /// Writes Θ B = Ψ G and Θ A = Ψ [F_q F_v] + [Θ_q T 0] to the rows below H, with Ψ = Δt Θ_q E + Θ_v.
    fn write_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]) {
        let (n, m) = (knot.ndx(), knot.nu());
        let ld = work.stride(m);
        self.steps.write_velocities_below(work, knot, Theta);
        let Workspace { F, W: Psi, H, .. } = work;
        product(&mut H[m + n + 1..], ld, [n, m + n, n / 2], View::new(Psi, padded(n)), View::new(F, ld));
        self.steps.add_positions_below(work, knot, Theta);
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

/// Value function of the next state, written with the change y of the next velocity and the change δq of the positions
/// as variables. Matrices are column-major with padding rows and the stride `padded(nv)`.
#[derive(Debug, Clone)]
pub(super) struct Steps {
    /// Matrices Nᵀ and Π, one after the other in one buffer.
    both: Aligned,
    /// Gradient with respect to y: Δt Eᵀp_q + p_v.
    pub(super) py: Vec<f64>,
    /// Products P E or P T, computed only in the columns of blocks; with the stride of P.
    PB: Aligned,
}

impl Steps {
    /// Allocates the matrices for n states.
    pub(super) fn new(n: usize) -> Self {
        let matrix = |rows: usize, count: usize| Aligned::zeros(count * padded(rows) * (n / 2));
        Self { both: matrix(n / 2, 2), py: vec![0.0; n / 2], PB: matrix(n, 1) }
    }

    /// Returns Nᵀ and Π.
    #[inline(always)]
    pub(super) fn N_and_Pi(&self) -> (&[f64], &[f64]) {
        self.both.split_at(self.both.len() / 2)
    }

    /// Computes Π, N and Δt Eᵀp_q + p_v: the terms of the value function that contain the next velocity.
    pub(super) fn write(&mut self, work: &Workspace, knot: &LqKnot) {
        let (dt, blocks) = steps_of(knot);
        let n = knot.ndx();
        times_blocks(&mut self.PB, &work.P, padded(n), n, blocks, |block| &block.E);
        at_narrow_level(WriteSteps { steps: self, P: &work.P, p: &work.p, dt, blocks });
    }

    /// Adds TᵀP₁₁T to the block H_qq of H, and Tᵀp_q to its gradient Qx_q.
    pub(super) fn add_positions(&mut self, work: &mut Workspace, knot: &LqKnot) {
        let ((_, blocks), n, m) = (steps_of(knot), knot.ndx(), knot.nu());
        let (nv, ld) = (n / 2, work.stride(m));
        let Workspace { P, p, H, .. } = work;
        times_blocks(&mut self.PB, P, padded(n), nv, blocks, |block| &block.T);
        at_narrow_level(AddPositions { steps: self, P, p, H: &mut H[(m + nv) * (ld + 1)..], ld, blocks });
    }

    /// Computes Ψ = Δt Θ_q E + Θ_v into W, with the stride of Θ.
    pub(super) fn write_velocities_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]) {
        let ((dt, blocks), n) = (steps_of(knot), knot.ndx());
        let (nv, ld) = (n / 2, padded(n));
        let (Self { PB, .. }, Psi) = (self, &mut work.W);
        times_blocks(PB, Theta, ld, n, blocks, |block| &block.E);
        for k in 0..nv {
            let (Theta_q, Theta_v) = (column(k, blocks, Theta, PB, ld), &Theta[(nv + k) * ld..][..n]);
            let Psi = &mut Psi[k * ld..][..n];
            for i in 0..n {
                Psi[i] = dt * Theta_q[i] + Theta_v[i];
            }
        }
    }

    /// Adds Θ_q T to the columns of δq, in the rows below H.
    pub(super) fn add_positions_below(&mut self, work: &mut Workspace, knot: &LqKnot, Theta: &[f64]) {
        let ((_, blocks), n, m) = (steps_of(knot), knot.ndx(), knot.nu());
        let (nv, ld, ldt, at) = (n / 2, work.stride(m), padded(n), m + n + 1);
        let (Self { PB, .. }, H) = (self, &mut work.H);
        times_blocks(PB, Theta, ldt, n, blocks, |block| &block.T);
        for j in 0..nv {
            let (Theta_q, H) = (column(j, blocks, Theta, PB, ldt), &mut H[(m + nv + j) * ld + at..][..n]);
            for i in 0..n {
                H[i] += Theta_q[i];
            }
        }
    }
}

/// Returns Δt and the blocks of T and E of a knot.
fn steps_of(knot: &LqKnot) -> (f64, &[EulerBlock]) {
    knot.structure.euler().expect("the form is that of Euler steps")
}

/// Inner loops of [`Steps::write`], compiled for each SIMD level.
struct WriteSteps<'a> {
    steps: &'a mut Steps,
    P: &'a [f64],
    p: &'a [f64],
    dt: f64,
    blocks: &'a [EulerBlock],
}

impl Vectorized for WriteSteps<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { steps: Steps { both, py, PB }, P, p, dt, blocks } = self;
        let (nv, ldp, ldn) = (p.len() / 2, padded(p.len()), padded(p.len() / 2));

        // writes Nᵀ = Tᵀ(Δt P₁₁E + P₁₂) and Π = Δt Eᵀ(Δt P₁₁E + P₁₂) + Δt P₂₁E + P₂₂, but without the left factors Tᵀ
        // and Eᵀ
        let by_velocity = |k: usize| View::new(&P[(nv + k) * ldp..], ldp);
        add_in_turn::<V, 1, 1>(both, ldn, ([0], [nv * ldn]), by_velocity(0), View::new(P, ldp), dt, [nv, nv]);
        for block in blocks {
            let (k, PE) = (block.start, View::new(&PB[block.start * ldp..], ldp));
            let (out, shape) = (&mut both[k * ldn..], [nv, block.T.nrows()]);
            add_in_turn::<V, 1, 1>(out, ldn, ([0], [nv * ldn]), by_velocity(k), PE, dt, shape);
        }
        let (N, Pi) = both.split_at_mut(nv * ldn);
        let (p_q, p_v) = p.split_at(nv);
        for k in 0..nv {
            py[k] = dt * p_q[k] + p_v[k];
        }
        // applies the left factors Tᵀ and Eᵀ, block by block
        for block in blocks {
            let (T, E) = (beyond_identity(&block.T, 1.0), beyond_identity(&block.E, dt));
            for k in 0..nv {
                let at = k * ldn + block.start;
                let x = &N[at..][..block.T.nrows()];
                let (TN, EN) = (combine::<V>(&T, x), combine::<V>(&E, x));
                add::<V>(&mut N[at..], TN);
                add::<V>(&mut Pi[at..], EN);
            }
            let mut Ep = [0.0; 8];
            add::<V>(&mut Ep, combine::<V>(&E, &p[block.range()]));
            py[block.range()].iter_mut().zip(Ep).for_each(|(y, Ep)| *y += Ep);
        }
    }
}

/// Inner loops of [`Steps::add_positions`], compiled for each SIMD level. `H` starts at the diagonal block of δq.
struct AddPositions<'a> {
    steps: &'a Steps,
    P: &'a [f64],
    p: &'a mut [f64],
    H: &'a mut [f64],
    ld: usize,
    blocks: &'a [EulerBlock],
}

impl Vectorized for AddPositions<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { steps: Steps { PB, .. }, P, p, H, ld, blocks } = self;
        let (nv, ldp) = (p.len() / 2, padded(p.len()));
        let whole = nv.next_multiple_of(V::N);
        for j in 0..nv {
            let (PT, H) = (&column(j, blocks, P, PB, ldp)[..whole], &mut H[j * ld..][..whole.max(nv + 1)]);
            let gradient = H[nv];
            let mut i = j / V::N * V::N; // elements above the diagonal are never read
            while i < whole {
                V::load(&H[i..]).add(V::load(&PT[i..])).store(&mut H[i..]);
                i += V::N;
            }
            H[nv] = gradient + p[j];
        }
        for block in blocks {
            let T = beyond_identity(&block.T, 1.0);
            for j in 0..nv {
                let PT = &column(j, blocks, P, PB, ldp)[block.range()];
                add::<V>(&mut H[j * ld + block.start..], combine::<V>(&T, PT));
            }
            let mut Tp = [0.0; 8];
            add::<V>(&mut Tp, combine::<V>(&T, &p[block.range()]));
            for (j, Tp) in block.range().zip(Tp) {
                p[j] += Tp;
                H[j * ld + nv] += Tp;
            }
        }
    }
}

/// Computes the product P B, for a matrix B that is the identity except for blocks. Only the columns of these blocks
/// and the first `rows` rows are computed.
fn times_blocks(
    PB: &mut [f64],
    P: &[f64],
    ldp: usize,
    rows: usize,
    blocks: &[EulerBlock],
    B: impl Fn(&EulerBlock) -> &nalgebra::DMatrix<f64>,
) {
    for block in blocks {
        let (columns, at, size) = (rows_of(B(block)), block.start * ldp, block.T.nrows());
        let (P, B) = (View::new(&P[at..], ldp), View::new(columns.as_flattened(), 8));
        product(&mut PB[at..], ldp, [rows, size, size], P, B);
    }
}

/// Returns column k of P B: a computed column if k is in a block, else the column of P.
#[inline(always)]
fn column<'a>(k: usize, blocks: &[EulerBlock], P: &'a [f64], PB: &'a [f64], ldp: usize) -> &'a [f64] {
    let in_block = blocks.iter().any(|block| block.range().contains(&k));
    &(if in_block { PB } else { P })[k * ldp..]
}

/// Returns the rows of a block, each padded with zeros to eight entries.
#[inline(always)]
fn rows_of(B: &nalgebra::DMatrix<f64>) -> [[f64; 8]; LARGEST_BLOCK] {
    let mut rows = [[0.0; 8]; LARGEST_BLOCK];
    for i in 0..B.nrows() {
        for j in 0..B.ncols() {
            rows[i][j] = B[(i, j)];
        }
    }
    rows
}

/// Returns the rows of s (B − 1), for a block B and a factor s.
#[inline(always)]
fn beyond_identity(B: &nalgebra::DMatrix<f64>, s: f64) -> [[f64; 8]; LARGEST_BLOCK] {
    let mut rows = rows_of(B);
    for i in 0..LARGEST_BLOCK {
        for j in 0..8 {
            rows[i][j] *= s;
        }
        rows[i][i] -= if i < B.nrows() { s } else { 0.0 };
    }
    rows
}

/// Computes the eight entries of Bᵀx from the rows of B.
#[inline(always)]
fn combine<V: Vector>(rows: &[[f64; 8]; LARGEST_BLOCK], x: &[f64]) -> [V; 4] {
    let mut sums = [V::splat(0.0); 4];
    for k in 0..x.len().min(LARGEST_BLOCK) {
        let (row, x) = (&rows[k], V::splat(x[k]));
        for s in 0..8 / V::N {
            sums[s] = V::load(&row[s * V::N..]).mul_add(x, sums[s]);
        }
    }
    sums
}

/// Adds x to the first eight entries of y.
#[inline(always)]
fn add<V: Vector>(y: &mut [f64], x: [V; 4]) {
    let y = &mut y[..8];
    for s in 0..8 / V::N {
        V::load(&y[s * V::N..]).add(x[s]).store(&mut y[s * V::N..]);
    }
}
