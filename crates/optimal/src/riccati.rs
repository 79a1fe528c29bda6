//! One step of the Riccati recursion, of a dense knot or of one of semi-implicit Euler.
#![allow(non_snake_case)] // the names of the literature: A, B, Q, …, K, Vxx

use crate::box_qp::BoxQp;
use crate::dense::{
    SLACK, View, add_product_lower, add_scaled_product, add_squares, copy, copy_symmetric, dot, product, transpose,
};
use crate::euler::Euler;
use crate::factor::{eliminate, solve_right};
use crate::implicit::Form;
use crate::lq::{DIVERGED, Hessian, LqKnot, LqNode};
use crate::structure::EulerBlock;
use crate::sweep::SweepError;
use crate::vector::Vector;

/// The least ndx for which the form of Euler steps is worth its bookkeeping, as `benches/riccati.rs` measured.
const EULER_FROM: usize = 16;

impl LqNode {
    /// Δt and the blocks of T and E, if the form of Euler steps is used.
    pub(crate) fn euler(&self) -> Option<(f64, &[EulerBlock])> {
        self.structure.euler().filter(|_| self.implicit.active || self.ndx() >= EULER_FROM)
    }
}

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
    /// Rows below the form, of which others make use.
    below: usize,
    /// Whether knots shall have their Vxx.
    pub(crate) keep: bool,
    /// Lᵀ for the back substitution.
    upper: Vec<f64>,
    pub(crate) euler: Euler,
    pub(crate) form: Form,
    qp: BoxQp,
    /// The curvature of the dynamics, one for each number of controls.
    hessians: Vec<Hessian>,
}

impl Work {
    /// Room for knots with n states and at most m controls, those of `nodes` with curvature, and in H for `below` more rows.
    pub(crate) fn new(nodes: &[LqNode], n: usize, m: usize, below: usize, room: [usize; 3]) -> Self {
        let stride = m + n + 1 + below + SLACK;
        let mut sizes: Vec<_> = nodes.iter().map(LqNode::nu).collect();
        sizes.sort_unstable();
        sizes.dedup();
        Self {
            P: vec![0.0; (n + SLACK) * n],
            p: vec![0.0; n],
            F: vec![0.0; stride * n],
            W: vec![0.0; stride * n],
            H: vec![0.0; stride * (m + n)],
            below,
            keep: true,
            upper: vec![0.0; (m + SLACK) * m],
            euler: Euler::new(n),
            form: Form::new(room, n, m),
            qp: BoxQp::new(m),
            hessians: sizes.into_iter().map(|nu| Hessian::zeros(n, nu)).collect(),
        }
    }

    /// The stride of F, W and H at a knot with m controls: their m + n + 1 rows, those below, and slack.
    pub(crate) fn stride(&self, m: usize) -> usize {
        m + self.p.len() + 1 + self.below + SLACK
    }

    /// V = ½ δxᵀ Q δx + qᵀ δx at the terminal knot.
    #[inline(always)]
    pub(crate) fn start(&mut self, node: &LqNode) {
        let n = node.ndx();
        self.p.copy_from_slice(node.q.as_slice());
        for j in 0..n {
            self.P[j * (n + SLACK)..][..n].copy_from_slice(&node.Q.as_slice()[j * n..][..n]);
        }
    }

    /// The sweep of the end of a horizon, of which the first node is knot `first` and the last the terminal one.
    #[inline(always)]
    pub(crate) fn run<V: Vector, const NR: usize>(
        &mut self,
        first: usize,
        nodes: &[LqNode],
        knots: &mut [LqKnot],
        regularisation: f64,
        curvature: &mut impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        let last = nodes.len() - 1;
        self.start(&nodes[last]);
        self.finish_value::<V>(first + last, &mut knots[last], regularisation)?;
        self.back::<V, NR>(first, &nodes[..last], knots, regularisation, curvature)
    }

    /// Steps at `nodes`, of which the first is knot `first`, from P, p of the knot after them.
    #[inline(always)]
    pub(crate) fn back<V: Vector, const NR: usize>(
        &mut self,
        first: usize,
        nodes: &[LqNode],
        knots: &mut [LqKnot],
        regularisation: f64,
        curvature: &mut impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        for i in (0..nodes.len()).rev() {
            let (t, knot) = (first + i, &mut knots[i]);
            self.step::<V, NR>(t, &nodes[i], knot, regularisation, curvature)?;
            self.finish_value::<V>(t, knot, regularisation)?;
        }
        Ok(())
    }

    /// One Riccati step: P, p of knot t + 1 become those of knot t, and the gains of knot t are written.
    #[inline(always)]
    pub(crate) fn step<V: Vector, const NR: usize>(
        &mut self,
        t: usize,
        node: &LqNode,
        knot: &mut LqKnot,
        regularisation: f64,
        curvature: &mut impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> Result<(), SweepError> {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, rows, last) = (self.stride(m), m + n + 1, m + n);
        let shift = self.form::<V, NR>(t, node, regularisation, curvature);
        let Self { H, qp, .. } = self;
        let implicit = node.implicit.active;
        if !implicit {
            for j in 0..m {
                knot.Qu[j] = H[j * ld + last];
            }
            copy_symmetric::<V>(knot.Quu.as_mut_slice(), m, H, ld, m);
        }

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
        self.take_value::<V>(ld, free, shift);

        if implicit {
            self.gains_of_efforts::<V, NR>(node, knot);
            return Ok(());
        }
        // [K k]ᵀ = −[X; yᵀ] L⁻¹
        let (Self { H, upper, qp, .. }, split) = (self, n - shift);
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
            transpose::<V>(&mut K[shift * m..], m, 0, H, ld, m..m + split, 0..m);
            transpose::<V>(K, m, 0, H, ld, m + split..m + n, 0..m);
            for K in K {
                *K = -*K;
            }
        }
        if !bounded {
            for j in 0..m {
                knot.k[j] = -H[j * ld + free + n];
            }
        }
        let k = knot.k.as_slice();
        knot.expected = [dot(knot.Qu.as_slice(), k), 0.0];
        for (column, k_j) in knot.Quu.column_iter().zip(k) {
            knot.expected[1] += k_j * dot(column.as_slice(), k);
        }
        Ok(())
    }

    /// The quadratic form H of knot t, with ϱ on the diagonal of Quu, and P f + p. Returns how the states are turned in H:
    /// the i-th there is the (i + shift)-th of x, counted around.
    #[inline(always)]
    pub(crate) fn form<V: Vector, const NR: usize>(
        &mut self,
        t: usize,
        node: &LqNode,
        regularisation: f64,
        curvature: &mut impl FnMut(usize, &[f64], &mut Hessian) -> bool,
    ) -> usize {
        let (n, m) = (node.ndx(), node.nu());
        // P f + p, the gradient at the predicted state
        for k in 0..n {
            if node.f[k] != 0.0 {
                add_scaled_product(&mut self.p, node.f[k], &self.P[k * (n + SLACK)..][..n], &[1.0]);
            }
        }
        if node.implicit.active {
            self.add_implicit::<V, NR>(node, regularisation);
            return n / 2;
        }
        let euler = node.euler();
        let shift = if euler.is_some() { n / 2 } else { 0 };
        self.fill::<V>(node, shift);
        if let Some(hessian) = self.hessians.iter_mut().find(|hessian| hessian.uu.nrows() == m)
            && curvature(t, &self.p, hessian)
        {
            self.add_hessian(shift, m);
        }
        match euler {
            Some((dt, blocks)) => self.add_euler::<V, NR>(m, dt, blocks, node),
            None => self.add_dense::<V, NR>(node),
        }
        // Quu += ϱ I
        let ld = self.stride(m);
        for j in 0..m {
            self.H[j * ld + j] += regularisation;
        }
        shift
    }

    /// P, p = Vxx, Vx of an H (stride `ld`) whose first `free` columns are eliminated and whose states are turned by `shift`.
    #[inline(always)]
    pub(crate) fn take_value<V: Vector>(&mut self, ld: usize, free: usize, shift: usize) {
        let Self { P, p, H, .. } = self;
        let n = p.len();
        let (split, stride) = (n - shift, n + SLACK); // states in H before and after the turn
        copy_symmetric::<V>(&mut P[shift * stride + shift..], stride, &H[free * ld + free..], ld, split);
        for j in 0..split {
            p[shift + j] = H[(free + j) * ld + free + n];
        }
        if shift > 0 {
            copy_symmetric::<V>(P, stride, &H[(free + split) * ld + free + split..], ld, shift);
            transpose::<V>(P, stride, shift, &H[free * ld..], ld, free + split..free + n, 0..split);
            for j in 0..split {
                copy::<V>(&mut P[(shift + j) * stride..], &H[(free + j) * ld + free + split..][..shift]);
            }
            for j in 0..shift {
                p[j] = H[(free + split + j) * ld + free + n];
            }
        }
    }

    /// H = [R ·; S Q; rᵀ qᵀ], the states turned by `shift`: its lower triangle.
    #[inline(always)]
    fn fill<V: Vector>(&mut self, node: &LqNode, shift: usize) {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, split) = (self.stride(m), n - shift);
        for j in 0..m {
            let column = &mut self.H[j * ld..][..ld];
            copy::<V>(&mut column[j..], &node.R.as_slice()[j * m + j..][..m - j]);
            turn::<V>(&mut column[m..], &node.S.as_slice()[j * n..][..n], shift);
            column[m + n] = node.r[j];
        }
        for j in 0..n {
            let state = if j < split { j + shift } else { j - split };
            let column = &mut self.H[(m + j) * ld..][..ld];
            let (below, Q) = (&mut column[m + j..], &node.Q.as_slice()[state * n..][..n]);
            if j < split {
                copy::<V>(below, &Q[state..]);
                copy::<V>(&mut below[split - j..], &Q[..shift]);
            } else {
                copy::<V>(below, &Q[state..shift]);
            }
            column[m + n] = node.q[state];
        }
    }

    /// H += [ψuu ·; ψxu ψxx; 0 0], the states turned by `shift`.
    fn add_hessian(&mut self, shift: usize, m: usize) {
        let n = self.p.len();
        let (ld, state) = (self.stride(m), |i: usize| (i + shift) % n);
        let Some(Hessian { xx, xu, uu }) = self.hessians.iter().find(|hessian| hessian.uu.nrows() == m) else { return };
        for j in 0..m {
            for i in 0..m {
                self.H[j * ld + i] += uu[(i, j)];
            }
            for i in 0..n {
                self.H[j * ld + m + i] += xu[(state(i), j)];
            }
        }
        for j in 0..n {
            for i in j..n {
                self.H[(m + j) * ld + m + i] += xx[(state(i), state(j))];
            }
        }
    }

    /// H += W [B A],   W = [P B, P A, P f + p]ᵀ.
    #[inline(always)]
    fn add_dense<V: Vector, const NR: usize>(&mut self, node: &LqNode) {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, rows) = (self.stride(m), m + n);
        let Self { P, p, F, W, H, .. } = self;
        transpose::<V>(F, ld, 0, node.B.as_slice(), n, 0..n, 0..m);
        transpose::<V>(F, ld, m, node.A.as_slice(), n, 0..n, 0..n);
        let F = View { data: F, stride: ld };
        product::<V, NR>(W, ld, [rows, n, n], F, View { data: P, stride: n + SLACK });
        for k in 0..n {
            W[k * ld + rows] = p[k];
        }
        add_product_lower::<V, NR>(H, ld, [rows + 1, rows, n], View { data: W, stride: ld }, F);
    }

    /// Vxx += ϱ I, and out to the knot with Vx; Vxx only if it is to be kept. Fails if they have diverged.
    #[inline(always)]
    pub(crate) fn finish_value<V: Vector>(
        &mut self,
        t: usize,
        knot: &mut LqKnot,
        regularisation: f64,
    ) -> Result<(), SweepError> {
        let n = self.p.len();
        let mut squares = [V::splat(0.0); 2];
        copy::<V>(knot.Vx.as_mut_slice(), &self.p);
        add_squares(&mut squares, &self.p);
        for j in 0..n {
            let column = &mut self.P[j * (n + SLACK)..][..n];
            column[j] += regularisation;
            if self.keep {
                copy::<V>(&mut knot.Vxx.as_mut_slice()[j * n..], column);
            }
            add_squares(&mut squares, column);
        }
        let mut sums = [0.0; SLACK];
        squares[0].add(squares[1]).store(&mut sums);
        let finite = sums.iter().sum::<f64>() < DIVERGED * DIVERGED; // false for a NaN
        if finite { Ok(()) } else { Err(SweepError::NotFinite { knot: t }) }
    }
}

/// `to` = x[shift..], x[..shift].
#[inline(always)]
fn turn<V: Vector>(to: &mut [f64], x: &[f64], shift: usize) {
    copy::<V>(to, &x[shift..]);
    copy::<V>(&mut to[x.len() - shift..], &x[..shift]);
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
