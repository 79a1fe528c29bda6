//! The backward sweep that solves a linear-quadratic problem.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use crate::box_qp::BoxQp;
use crate::dense::{SLACK, View, add_product_lower, add_scaled_product, copy, copy_symmetric, product, transpose};
use crate::error::assert_length;
use crate::euler::Euler;
use crate::factor::{eliminate, solve_right};
use crate::lq::{DIVERGED, LqKnot, LqNode};
use crate::vector::{Dense, Vector, at_level};

/// Why a sweep stopped before the first knot.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// Quu has a pivot that is not positive: the problem is not convex in the control there. More regularisation helps.
    #[error("knot {knot}: Quu is not positive definite (pivot {row} is {pivot:e})")]
    NotPositive {
        /// The knot.
        knot: usize,
        /// The row of the pivot.
        row: usize,
        /// Its value.
        pivot: f64,
    },
    /// The value function is infinite, NaN, or beyond 1e30.
    #[error("knot {knot}: the value function is not finite")]
    NotFinite {
        /// The knot.
        knot: usize,
    },
}

/// The backward Riccati sweep, with its workspace.
///
/// With the gap as a constant third coordinate, one knot is the elimination of δu from a quadratic form. Let
/// F = [B A f] and P, p the value function of the next knot. Then
///
/// ```text
/// W = (P F)ᵀ,   last row += pᵀ                          P f + p is the gradient at the predicted state
///
///     ⎡ Quu  ·  ⎤   ⎡ R   · ⎤                 ⎡ L  ·         ⎤
/// H = ⎢ Qxu Qxx ⎥ = ⎢ S   Q ⎥ + W [B A]   →   ⎢ X  Vxx       ⎥    L Lᵀ = Quu,  X = Qxu L⁻ᵀ,  Vxx = Qxx − X Xᵀ
///     ⎣ Quᵀ Qxᵀ ⎦   ⎣ rᵀ qᵀ ⎦                 ⎣ yᵀ Vxᵀ       ⎦    y = L⁻¹ Qu,   Vx = Qx − X y
///
/// [K k]ᵀ = −[X; yᵀ] L⁻¹
/// ```
///
/// A regularisation ϱ ≥ 0 is added to the diagonals of Quu (before it is factorised) and of Vxx (before it is used by
/// the knot before), as in Crocoddyl.
///
/// A knot whose A and B are those of semi-implicit Euler ([`Structure`](crate::Structure)) takes half the operations: with
/// N = (Δt EᵀP₁₁ + P₂₁) T and Π = Δt²EᵀP₁₁E + Δt (EᵀP₁₂ + P₂₁E) + P₂₂, and A_v = [F_q F_v], B_v = G,
///
/// ```text
/// W = (Π [G F_v F_q] + [0 0 N])ᵀ,   H += W [G F_v F_q],   H_qq += F_qᵀN + TᵀP₁₁T
/// ```
///
/// Where δu is bounded, k solves the quadratic program of its knot by projected Newton steps (Tassa, Mansard, Todorov,
/// ICRA 2014), and the elimination is that of the controls that are not at a bound. The steps start from minus the k of
/// the last run, Crocoddyl's choice; it decides nothing but which of two equally good sets of bounds is found.
///
/// The cost of a dense knot is about 2 n²(n + m) + n (n + m)² + m n (n + m)
/// operations for n = ndx, m = nu. Allocates nothing after [`new`](Self::new).
///
/// # Examples
/// ```
/// use condyle_optimal::{LqNode, Sweep};
///
/// // Minimise ½ δu² + δx₁²  with  δx₁ = δx₀ + δu:   δu = −⅔ δx₀,   V₀ = ⅓ δx₀².
/// let mut nodes = [LqNode::zeros(1, 1), LqNode::zeros(1, 0)];
/// (nodes[0].A[0], nodes[0].B[0], nodes[0].R[0], nodes[1].Q[0]) = (1.0, 1.0, 1.0, 2.0);
///
/// let mut sweep = Sweep::new(&nodes);
/// sweep.run(&nodes, 0.0)?;
/// assert!((sweep.knots()[0].K[0] + 2.0 / 3.0).abs() < 1e-15);
/// assert!((sweep.knots()[0].Vxx[0] - 2.0 / 3.0).abs() < 1e-15);
/// # Ok::<(), condyle_optimal::SweepError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Sweep {
    knots: Vec<LqKnot>,
    /// What one step reads and writes beside its knot.
    work: Work,
}

/// The least ndx for which the form of Euler steps is worth its bookkeeping, as `benches/riccati.rs` measured.
const EULER_FROM: usize = 16;

/// Scratch of a step. Matrices are column-major with slack rows; P has the stride n + SLACK, the others `ld`.
#[derive(Debug, Clone)]
pub(crate) struct Work {
    /// Vxx⁺, symmetric and full.
    pub(crate) P: Vec<f64>,
    /// Vx⁺, and then Vx⁺ + Vxx⁺ f.
    pub(crate) p: Vec<f64>,
    /// [B A]ᵀ, or of their last rows, as the columns of H are ordered.
    pub(crate) F: Vec<f64>,
    /// (P [B A] and so on)ᵀ.
    pub(crate) W: Vec<f64>,
    /// The quadratic form.
    pub(crate) H: Vec<f64>,
    /// Lᵀ for the back substitution.
    upper: Vec<f64>,
    pub(crate) euler: Euler,
    qp: BoxQp,
}

/// The stride of F, W and H with their m + n + 1 rows.
pub(crate) fn stride(n: usize, m: usize) -> usize {
    m + n + 1 + SLACK
}

impl Sweep {
    /// A workspace for problems with the dimensions of `nodes`, of which the last is the terminal one.
    ///
    /// # Panics
    /// If `nodes` is empty, the shapes of a node do not fit each other, ndx differs from node to node, or the terminal
    /// node has controls.
    pub fn new(nodes: &[LqNode]) -> Self {
        let terminal = nodes.last().expect("`nodes` is empty");
        let n = terminal.ndx();
        assert_length("r of the terminal node", terminal.nu(), 0);
        let m = nodes.iter().map(LqNode::nu).max().unwrap_or(0);
        let knots = nodes.iter().map(|node| {
            node.assert_shapes(n, node.nu());
            LqKnot::zeros(n, node.nu())
        });
        let work = Work {
            P: vec![0.0; (n + SLACK) * n],
            p: vec![0.0; n],
            F: vec![0.0; stride(n, m) * n],
            W: vec![0.0; stride(n, m) * n],
            H: vec![0.0; stride(n, m) * (m + n)],
            upper: vec![0.0; (m + SLACK) * m],
            euler: Euler::new(n),
            qp: BoxQp::new(m),
        };
        Self { knots: knots.collect(), work }
    }

    /// Lets the next run start as if it were the first.
    pub(crate) fn forget(&mut self) {
        for knot in &mut self.knots {
            knot.k.fill(0.0);
        }
    }

    /// The feedback and value function of each knot, as the last [`run`](Self::run) left them; the terminal one has no
    /// controls.
    pub fn knots(&self) -> &[LqKnot] {
        &self.knots
    }

    /// Sweeps from the terminal node back to the first, with `regularisation` added to the diagonals of Quu and Vxx.
    ///
    /// # Errors
    /// [`SweepError`] if a Quu is not positive definite or the value function not finite; the knots before that one
    /// then keep their old values.
    ///
    /// # Panics
    /// If the shapes of `nodes` are not those given to [`new`](Self::new).
    pub fn run(&mut self, nodes: &[LqNode], regularisation: f64) -> Result<(), SweepError> {
        assert_length("nodes", nodes.len(), self.knots.len());
        for (node, knot) in nodes.iter().zip(&self.knots) {
            node.assert_shapes(self.work.p.len(), knot.k.len());
        }
        let mut result = Ok(());
        at_level(Run { sweep: self, nodes, regularisation, result: &mut result });
        result
    }
}

/// A run, to be compiled for the processor.
struct Run<'a> {
    sweep: &'a mut Sweep,
    nodes: &'a [LqNode],
    regularisation: f64,
    result: &'a mut Result<(), SweepError>,
}

impl Dense for Run<'_> {
    #[inline(always)]
    fn run<V: Vector, const NR: usize>(self) {
        let Self { sweep: Sweep { knots, work }, nodes, regularisation, result } = self;
        let mut t = nodes.len() - 1;
        work.start(&nodes[t]);
        *result = work.finish_value::<V>(t, &mut knots[t], regularisation);
        while result.is_ok() && t > 0 {
            t -= 1;
            *result = work.step::<V, NR>(t, &nodes[t], &mut knots[t], regularisation);
            if result.is_ok() {
                *result = work.finish_value::<V>(t, &mut knots[t], regularisation);
            }
        }
    }
}

impl Work {
    /// V = ½ δxᵀ Q δx + qᵀ δx at the terminal knot.
    #[inline(always)]
    fn start(&mut self, node: &LqNode) {
        let n = node.ndx();
        self.p.copy_from_slice(node.q.as_slice());
        for j in 0..n {
            self.P[j * (n + SLACK)..][..n].copy_from_slice(&node.Q.as_slice()[j * n..][..n]);
        }
    }

    /// One Riccati step: P, p of knot t + 1 become those of knot t, and the gains of knot t are written.
    #[inline(always)]
    fn step<V: Vector, const NR: usize>(
        &mut self,
        t: usize,
        node: &LqNode,
        knot: &mut LqKnot,
        regularisation: f64,
    ) -> Result<(), SweepError> {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, rows, last) = (stride(n, m), m + n + 1, m + n);
        // P f + p, the gradient at the predicted state
        for k in 0..n {
            if node.f[k] != 0.0 {
                add_scaled_product(&mut self.p, node.f[k], &self.P[k * (n + SLACK)..][..n], &[1.0]);
            }
        }
        let euler = node.structure.euler().filter(|_| n >= EULER_FROM);
        // The order of the states in H: the i-th is the (i + shift)-th of x, counted around.
        let shift = if euler.is_some() { n / 2 } else { 0 };
        self.fill::<V>(node, shift);
        match euler {
            Some((dt, blocks)) => self.add_euler::<V, NR>(m, dt, blocks, node),
            None => self.add_dense::<V, NR>(node),
        }
        let Self { P, p, H, upper, qp, .. } = self;

        // Quu += ϱ I
        for j in 0..m {
            H[j * ld + j] += regularisation;
            knot.Qu[j] = H[j * ld + last];
        }
        copy_symmetric::<V>(knot.Quu.as_mut_slice(), m, H, ld, m);

        let failed = |row: usize, pivot: f64| match pivot.is_finite() {
            true => SweepError::NotPositive { knot: t, row, pivot },
            false => SweepError::NotFinite { knot: t },
        };
        // The controls that are eliminated: those not at a bound.
        let bounded = node.is_bounded();
        let free = if bounded {
            let (lower, upper) = (node.lower.as_slice(), node.upper.as_slice());
            let start = knot.k.iter().map(|k| -k);
            qp.solve::<V, NR>(&knot.Quu, knot.Qu.as_slice(), lower, upper, start)
                .map_err(|(row, pivot)| failed(row, pivot))?;
            keep_free(H, ld, rows, m, n, &qp.free);
            qp.free.len()
        } else {
            m
        };

        // L Lᵀ = Quu,   X = Qxu L⁻ᵀ,   Vxx = Qxx − X Xᵀ,   Vx = Qx − X y
        let rows = free + n + 1;
        if let Err((row, pivot)) = eliminate::<V, NR>(H, ld, rows, free + n, free) {
            return Err(failed(if bounded { qp.free[row] } else { row }, pivot));
        }
        let (split, stride) = (n - shift, n + SLACK); // states in H before and after the turn
        copy_symmetric::<V>(&mut P[shift * stride + shift..], stride, &H[free * ld + free..], ld, split);
        for j in 0..split {
            p[shift + j] = H[(free + j) * ld + free + n];
        }
        if shift > 0 {
            copy_symmetric::<V>(P, stride, &H[(free + split) * ld + free + split..], ld, shift);
            transpose(P, stride, shift, &H[free * ld..], ld, free + split..free + n, 0..split);
            for j in 0..split {
                copy::<V>(&mut P[(shift + j) * stride..], &H[(free + j) * ld + free + split..][..shift]);
            }
            for j in 0..shift {
                p[j] = H[(free + split + j) * ld + free + n];
            }
        }

        // [K k]ᵀ = −[X; yᵀ] L⁻¹
        solve_right::<V, NR>(H, ld, free, rows, free, upper);
        if bounded {
            knot.K.fill(0.0);
            knot.k.copy_from_slice(&qp.x[..m]);
            for j in 0..m {
                if qp.free.binary_search(&j).is_err() {
                    knot.Qu[j] = 0.0;
                }
            }
        }
        let K = knot.K.as_mut_slice();
        if bounded {
            for i in 0..n {
                let state = if i < split { i + shift } else { i - split };
                for j in 0..free {
                    K[state * m + qp.free[j]] = -H[j * ld + free + i];
                }
            }
        } else {
            transpose(&mut K[shift * m..], m, 0, H, ld, m..m + split, 0..m);
            transpose(K, m, 0, H, ld, m + split..m + n, 0..m);
            for K in K {
                *K = -*K;
            }
        }
        if !bounded {
            for j in 0..m {
                knot.k[j] = -H[j * ld + free + n];
            }
        }
        Ok(())
    }

    /// H = [R ·; S Q; rᵀ qᵀ], the states turned by `shift`.
    #[inline(always)]
    fn fill<V: Vector>(&mut self, node: &LqNode, shift: usize) {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, split) = (stride(n, m), n - shift);
        for j in 0..m {
            let column = &mut self.H[j * ld..][..ld];
            copy::<V>(column, &node.R.as_slice()[j * m..][..m]);
            turn::<V>(&mut column[m..], &node.S.as_slice()[j * n..][..n], shift);
            column[m + n] = node.r[j];
        }
        for j in 0..n {
            let state = if j < split { j + shift } else { j - split };
            let column = &mut self.H[(m + j) * ld..][..ld];
            turn::<V>(&mut column[m..], &node.Q.as_slice()[state * n..][..n], shift);
            column[m + n] = node.q[state];
        }
    }

    /// H += W [B A],   W = [P B, P A, P f + p]ᵀ.
    #[inline(always)]
    fn add_dense<V: Vector, const NR: usize>(&mut self, node: &LqNode) {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, rows) = (stride(n, m), m + n);
        let Self { P, p, F, W, H, .. } = self;
        transpose(F, ld, 0, node.B.as_slice(), n, 0..n, 0..m);
        transpose(F, ld, m, node.A.as_slice(), n, 0..n, 0..n);
        let F = View { data: F, stride: ld };
        product::<V, NR>(W, ld, [rows, n, n], F, View { data: P, stride: n + SLACK });
        for k in 0..n {
            W[k * ld + rows] = p[k];
        }
        add_product_lower::<V, NR>(H, ld, [rows + 1, rows, n], View { data: W, stride: ld }, F);
    }

    /// Vxx += ϱ I, and out to the knot with both if they are finite.
    #[inline(always)]
    fn finish_value<V: Vector>(&mut self, t: usize, knot: &mut LqKnot, regularisation: f64) -> Result<(), SweepError> {
        let n = self.p.len();
        knot.Vx.as_mut_slice().copy_from_slice(&self.p);
        let mut finite = all_bounded(&self.p);
        for j in 0..n {
            let column = &mut self.P[j * (n + SLACK)..][..n];
            column[j] += regularisation;
            copy::<V>(&mut knot.Vxx.as_mut_slice()[j * n..], column);
            finite &= all_bounded(column);
        }
        if finite { Ok(()) } else { Err(SweepError::NotFinite { knot: t }) }
    }
}

/// `to` = x[shift..], x[..shift].
#[inline(always)]
fn turn<V: Vector>(to: &mut [f64], x: &[f64], shift: usize) {
    copy::<V>(to, &x[shift..]);
    copy::<V>(&mut to[x.len() - shift..], &x[..shift]);
}

/// Whether no entry has diverged; false for a NaN.
#[inline(always)]
fn all_bounded(x: &[f64]) -> bool {
    let mut bounded = true;
    for x in x {
        bounded &= x.abs() < DIVERGED;
    }
    bounded
}

/// Moves the rows and columns of the `free` ones of m controls to the front of H, and what follows up behind them.
#[inline(always)]
fn keep_free(H: &mut [f64], stride: usize, rows: usize, m: usize, n: usize, free: &[usize]) {
    let kept = free.len();
    for (to, from) in free.iter().copied().chain(m..m + n).enumerate() {
        for (row, &i) in free.iter().enumerate() {
            H[to * stride + row] = H[from * stride + i];
        }
        H.copy_within(from * stride + m..from * stride + rows, to * stride + kept);
    }
}
