//! The quadratic form of a knot of semi-implicit Euler: blocks that are the identity or Δt are never multiplied.
#![allow(non_snake_case)] // the names of the literature, and N, Π, T, E

use crate::dense::{SLACK, View, add, add_product_lower, add_transposed_product_lower, product, transpose};
use crate::lq::LqNode;
use crate::riccati::Work;
use crate::structure::{EulerBlock, LARGEST_BLOCK};
use crate::vector::Vector;

/// Scratch for the form; column-major with slack rows, stride nv + SLACK but for `M`.
#[derive(Debug, Clone)]
pub(crate) struct Euler {
    /// Nᵀ.
    pub(crate) N: Vec<f64>,
    /// Π.
    pub(crate) Pi: Vec<f64>,
    /// Δt Eᵀp_q + p_v.
    pub(crate) py: Vec<f64>,
    /// Part of NᵀF_q; stride as H, but at most that of Nᵀ and Π.
    M: Vec<f64>,
    /// The columns of P E or P T that are not those of P; stride as P.
    PB: Vec<f64>,
}

impl Euler {
    /// Room for n states.
    pub(crate) fn new(n: usize) -> Self {
        let scratch = |rows: usize| vec![0.0; (rows + SLACK) * (n / 2)];
        let py = vec![0.0; n / 2];
        Self { N: scratch(n / 2), Pi: scratch(n / 2), py, M: scratch(n / 2), PB: scratch(n) }
    }
}

impl Work {
    /// H += AᵀPA and so on, with the states in the order (v, q).
    #[inline(always)]
    pub(crate) fn add_euler<V: Vector, const NR: usize>(
        &mut self,
        m: usize,
        dt: f64,
        blocks: &[EulerBlock],
        node: &LqNode,
    ) {
        let n = self.p.len();
        let (nv, ld, rows) = (n / 2, self.stride(m), m + n);
        let ldn = nv + SLACK;
        self.step_curvature::<V, NR>(dt, blocks);
        let Self { F, W, H, euler: Euler { N, Pi, py, M, .. }, .. } = self;

        // W = (Π [G F_v F_q] + [0 0 N])ᵀ,   last row Δt Eᵀp_q + p_v
        transpose::<V>(F, ld, 0, node.B.as_slice(), n, nv..n, 0..m);
        transpose::<V>(F, ld, m, node.A.as_slice(), n, nv..n, nv..n);
        transpose::<V>(F, ld, m + nv, node.A.as_slice(), n, nv..n, 0..nv);
        let all = View { data: F, stride: ld };
        product::<V, NR>(W, ld, [rows, nv, nv], all, View { data: Pi, stride: ldn });
        for k in 0..nv {
            let (W, N) = (&mut W[k * ld + m + nv..][..nv + 1], &N[k * ldn..][..nv]);
            for i in 0..nv {
                W[i] += N[i];
            }
            W[nv] = py[k];
        }

        // H += W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T,   Qx_q += Tᵀp_q
        add_product_lower::<V, NR>(H, ld, [rows + 1, rows, nv], View { data: W, stride: ld }, all);
        let H_qq = &mut H[(m + nv) * ld + m + nv..];
        let (Nt, F_q) = (View { data: N, stride: ldn }, View { data: &F[m + nv..], stride: ld });
        add_transposed_product_lower::<V, NR>(H_qq, ld, nv, Nt, F_q, M, ldn);
        self.position_curvature::<V, NR>(m, blocks);
    }

    /// Π, N and Δt Eᵀp_q + p_v: how the value of the next state depends on its velocity.
    #[inline(always)]
    pub(crate) fn step_curvature<V: Vector, const NR: usize>(&mut self, dt: f64, blocks: &[EulerBlock]) {
        let n = self.p.len();
        let (nv, ldp, ldn) = (n / 2, n + SLACK, n / 2 + SLACK);
        let Self { P, p, euler: Euler { N, Pi, py, PB, .. }, .. } = self;

        // Nᵀ = Tᵀ(Δt P₁₁E + P₁₂),   Π = Δt Eᵀ(Δt P₁₁E + P₁₂) + Δt P₂₁E + P₂₂;  as if T and E were 1 from the left
        times_blocks::<V, NR>(PB, P, ldp, n, blocks, |block| &block.E);
        let step = V::splat(dt);
        for k in 0..nv {
            let (PE, P) = (column(k, blocks, P, PB, ldp), &P[(nv + k) * ldp..]);
            let (N, Pi) = (&mut N[k * ldn..], &mut Pi[k * ldn..]);
            let mut i = 0;
            while i < nv {
                let sum = V::load(&PE[i..]).mul_add(step, V::load(&P[i..]));
                sum.store(&mut N[i..]);
                sum.add(V::load(&PE[nv + i..])).mul_add(step, V::load(&P[nv + i..])).store(&mut Pi[i..]);
                i += V::N;
            }
            py[k] = dt * p[k] + p[nv + k];
        }
        // and their blocks from the left
        for block in blocks {
            let (T, E, size) = (rows_of(&block.T), rows_of(&block.E), block.T.nrows());
            for k in 0..nv {
                let at = k * ldn + block.start;
                let (N, Pi) = (&mut N[at..][..size], &mut Pi[at..][..size]);
                let (TN, EN) = (combine(&T, N), combine(&E, N));
                for i in 0..size {
                    Pi[i] += dt * (EN[i] - N[i]);
                }
                N.copy_from_slice(&TN[..size]);
            }
            let Ep = combine(&E, &p[block.range()]);
            for (i, k) in block.range().enumerate() {
                py[k] = dt * Ep[i] + p[nv + k];
            }
        }
    }

    /// H_qq += TᵀP₁₁T,   Qx_q += Tᵀp_q.
    #[inline(always)]
    pub(crate) fn position_curvature<V: Vector, const NR: usize>(&mut self, m: usize, blocks: &[EulerBlock]) {
        let n = self.p.len();
        let (nv, ld, ldp) = (n / 2, self.stride(m), n + SLACK);
        let Self { P, p, H, euler: Euler { PB, .. }, .. } = self;
        let H_qq = &mut H[(m + nv) * ld + m + nv..];
        times_blocks::<V, NR>(PB, P, ldp, nv, blocks, |block| &block.T);
        for j in 0..nv {
            let (PT, H) = (column(j, blocks, P, PB, ldp), &mut H_qq[j * ld..]);
            let gradient = H[nv];
            add::<V>(H, PT, nv); // what lies above the diagonal is not read
            H[nv] = gradient;
        }
        for block in blocks {
            let (T, size) = (rows_of(&block.T), block.T.nrows());
            for j in 0..nv {
                let PT = &column(j, blocks, P, PB, ldp)[block.range()];
                let (TPT, H) = (combine(&T, PT), &mut H_qq[j * ld + block.start..][..size]);
                for i in 0..size {
                    H[i] += TPT[i] - PT[i];
                }
            }
        }
        for block in blocks {
            let rows = &mut p[block.range()];
            let product = combine(&rows_of(&block.T), rows);
            rows.copy_from_slice(&product[..rows.len()]);
        }
        for j in 0..nv {
            H_qq[j * ld + nv] += p[j];
        }
    }
}

impl Work {
    /// Rows below H: Θ [B A] for a Θ of n rows (stride n + SLACK),
    ///
    /// ```text
    /// Θ B = Ψ G,   Θ A = Ψ [F_q F_v] + [Θ_q T  0],   Ψ = Δt Θ_q E + Θ_v
    /// ```
    #[inline(always)]
    pub(crate) fn add_euler_below<V: Vector, const NR: usize>(
        &mut self,
        Theta: &[f64],
        m: usize,
        dt: f64,
        blocks: &[EulerBlock],
    ) {
        let n = self.p.len();
        let (nv, ld, at) = (n / 2, self.stride(m), m + n + 1);
        self.velocity_below::<V, NR>(Theta, dt, blocks);
        let Self { F, W: Psi, H, .. } = self;
        let (Psi, F) = (View { data: Psi, stride: n + SLACK }, View { data: F, stride: ld });
        product::<V, NR>(&mut H[at..], ld, [n, m + n, nv], Psi, F);
        self.position_below::<V, NR>(Theta, m, blocks);
    }

    /// Ψ, in W with the stride of Θ.
    #[inline(always)]
    pub(crate) fn velocity_below<V: Vector, const NR: usize>(&mut self, Theta: &[f64], dt: f64, blocks: &[EulerBlock]) {
        let n = self.p.len();
        let (nv, ldt) = (n / 2, n + SLACK);
        let Self { W: Psi, euler: Euler { PB, .. }, .. } = self;
        times_blocks::<V, NR>(PB, Theta, ldt, n, blocks, |block| &block.E);
        for k in 0..nv {
            let (Theta_q, Theta_v) = (column(k, blocks, Theta, PB, ldt), &Theta[(nv + k) * ldt..][..n]);
            let Psi = &mut Psi[k * ldt..][..n];
            for i in 0..n {
                Psi[i] = dt * Theta_q[i] + Theta_v[i];
            }
        }
    }

    /// Adds Θ_q T to the columns of δq.
    #[inline(always)]
    pub(crate) fn position_below<V: Vector, const NR: usize>(
        &mut self,
        Theta: &[f64],
        m: usize,
        blocks: &[EulerBlock],
    ) {
        let n = self.p.len();
        let (nv, ld, ldt, at) = (n / 2, self.stride(m), n + SLACK, m + n + 1);
        let Self { H, euler: Euler { PB, .. }, .. } = self;
        times_blocks::<V, NR>(PB, Theta, ldt, n, blocks, |block| &block.T);
        for j in 0..nv {
            let (Theta_q, H) = (column(j, blocks, Theta, PB, ldt), &mut H[(m + nv + j) * ld + at..][..n]);
            for i in 0..n {
                H[i] += Theta_q[i];
            }
        }
    }
}

/// The columns of the blocks of P B, in `rows` rows, for a matrix B that is the identity but for blocks.
#[inline(always)]
fn times_blocks<V: Vector, const NR: usize>(
    PB: &mut [f64],
    P: &[f64],
    ldp: usize,
    rows: usize,
    blocks: &[EulerBlock],
    B: impl Fn(&EulerBlock) -> &nalgebra::DMatrix<f64>,
) {
    for block in blocks {
        let (columns, at) = (rows_of(B(block)), block.start * ldp);
        let size = block.T.nrows();
        let (P, B) = (View { data: &P[at..], stride: ldp }, View { data: columns.as_flattened(), stride: 8 });
        product::<V, NR>(&mut PB[at..], ldp, [rows, size, size], P, B);
    }
}

/// A column of P B: that of P, unless it is in a block.
#[inline(always)]
fn column<'a>(k: usize, blocks: &[EulerBlock], P: &'a [f64], PB: &'a [f64], ldp: usize) -> &'a [f64] {
    let in_block = blocks.iter().any(|block| block.range().contains(&k));
    &(if in_block { PB } else { P })[k * ldp..]
}

/// The rows of a block, with zeros up to a whole register.
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

/// Bᵀx from the rows of B.
#[inline(always)]
fn combine(rows: &[[f64; 8]; LARGEST_BLOCK], x: &[f64]) -> [f64; 8] {
    let mut sum = [0.0; 8];
    for i in 0..LARGEST_BLOCK.min(x.len()) {
        for j in 0..8 {
            sum[j] += rows[i][j] * x[i];
        }
    }
    sum
}
