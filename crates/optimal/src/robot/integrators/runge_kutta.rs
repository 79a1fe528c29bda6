//! Runge–Kutta methods with constant controls, as Crocoddyl's `IntegratedActionModelRK`.
//!
//! ```text
//! y₀ = x,   kᵢ = (vᵢ, a(yᵢ, u)),   yᵢ₊₁ = x ⊕ cᵢ₊₁ Δt kᵢ,   x⁺ = x ⊕ Δt Σ bᵢ kᵢ,   cost = Δt Σ bᵢ ℓ(yᵢ, u)
//! ```
//!
//! Limits hold at y₀.
//!
//! Source: Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I* (1993), section II.1.

use super::retraction::Retraction;
use crate::lq::LqNode;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput, Wanted, activate_limits, limit_term};
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
pub(super) struct RungeKutta {
    /// The times of the stages in the step, and their weights.
    c: &'static [f64],
    b: &'static [f64],
    /// The state y of a stage. Shape: nq + nv.
    y: Vec<f64>,
    /// k of a stage, the step to the next one, and Σ b k. Shape: 2 nv.
    k: Vec<f64>,
    dx: Vec<f64>,
    sum: Vec<f64>,
    /// ∂y/∂(x, u), ∂k/∂(x, u), ∂(Σ b k)/∂(x, u). Shape: 2 nv × (2 nv + nu).
    dy: DMatrix<f64>,
    dk: DMatrix<f64>,
    dsum: DMatrix<f64>,
    /// The cost at a stage.
    stage: LqNode,
    /// Products with the stage's Hessian. Shape: (2 nv + nu) × (2 nv + nu) and 2 nv × (2 nv + nu).
    H: DMatrix<f64>,
    W: DMatrix<f64>,
}

impl RungeKutta {
    /// A method of two, three or four stages.
    pub(super) fn new<M: ContinuousModel>(stages: usize, model: &M) -> Self {
        let (nq, nv, nu) = (model.nq(), model.nv(), model.nu());
        let (c, b): (&[f64], &[f64]) = match stages {
            2 => (&[0.0, 0.5], &[0.0, 1.0]),
            3 => (&[0.0, 1.0 / 3.0, 2.0 / 3.0], &[0.25, 0.0, 0.75]),
            _ => (&[0.0, 0.5, 0.5, 1.0], &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]),
        };
        let (n, wide) = (2 * nv, DMatrix::zeros(2 * nv, 2 * nv + nu));
        Self {
            c,
            b,
            y: vec![0.0; nq + nv],
            k: vec![0.0; n],
            dx: vec![0.0; n],
            sum: vec![0.0; n],
            dy: wide.clone(),
            dk: wide.clone(),
            dsum: wide.clone(),
            stage: LqNode::zeros(n, nu),
            H: DMatrix::zeros(n + nu, n + nu),
            W: wide,
        }
    }

    /// Computes x ⊕ c Δt k, in `self.y`, with the step in `self.dx`.
    fn advance<M: ContinuousModel>(&mut self, model: &M, x: &[f64], step: f64) {
        let (nq, nv) = (model.nq(), model.nv());
        (0..2 * nv).for_each(|i| self.dx[i] = step * self.k[i]);
        model.integrate(&x[..nq], &self.dx[..nv], &mut self.y[..nq]);
        (0..nv).for_each(|i| self.y[nq + i] = x[nq + i] + self.dx[nv + i]);
    }

    /// Writes the next state; returns the cost.
    pub(super) fn calc<M: ContinuousModel>(
        &mut self,
        model: &mut M,
        KnotInput { t, x, u, .. }: KnotInput<'_>,
        dt: f64,
        next: &mut [f64],
    ) -> f64 {
        let (nq, nv, mut cost, mut term) = (model.nq(), model.nv(), 0.0, 0.0);
        self.sum.fill(0.0);
        self.k.fill(0.0);
        for i in 0..self.b.len() {
            self.advance(model, x, self.c[i] * dt);
            model.prepare(&[t], &self.y, u, Wanted::Motion);
            let (a, rate) = model.calc(KnotInput { lane: 0, t, x: &self.y, u });
            cost += self.b[i] * rate;
            self.k[..nv].copy_from_slice(&self.y[nq..]);
            self.k[nv..].copy_from_slice(a);
            (0..2 * nv).for_each(|j| self.sum[j] += dt * self.b[i] * self.k[j]);
            if i == 0 {
                term = limit_term(model);
                activate_limits(model, false);
            }
        }
        activate_limits(model, true);
        model.integrate(&x[..nq], &self.sum[..nv], &mut next[..nq]);
        (0..nv).for_each(|j| next[nq + j] = x[nq + j] + self.sum[nv + j]);
        dt * cost + term
    }

    /// Writes the derivatives of a step, by the chain rule through the stages.
    pub(super) fn calc_diff<M: ContinuousModel>(
        &mut self,
        model: &mut M,
        KnotInput { t, x, u, .. }: KnotInput<'_>,
        dt: f64,
        step: &mut Retraction,
        node: &mut LqNode,
    ) {
        let (nq, nv, nu) = (model.nq(), model.nv(), model.nu());
        let n = 2 * nv;
        for field in [&mut node.Q, &mut node.S, &mut node.R] {
            field.fill(0.0);
        }
        node.q.fill(0.0);
        node.r.fill(0.0);
        self.sum.fill(0.0);
        self.k.fill(0.0);
        self.dk.fill(0.0);
        self.dsum.fill(0.0);
        for i in 0..self.b.len() {
            let (time, weight) = (self.c[i] * dt, self.b[i] * dt);
            self.advance(model, x, time);
            self.dy.copy_from(&self.dk);
            self.dy *= time; // ∂(c Δt k)
            step.delta.copy_from_slice(&self.dx[..nv]);
            step.differentiate(model);
            step.chain(model.groups(), &mut self.dy);
            model.prepare(&[t], &self.y, u, Wanted::Derivatives);
            let input = KnotInput { lane: 0, t, x: &self.y, u };
            let Derivatives { a, da_dq, da_dv, da_du } = model.calc_diff(input, weight, &mut self.stage);
            self.k[..nv].copy_from_slice(&self.y[nq..]);
            self.k[nv..].copy_from_slice(a);
            for j in 0..n + nu {
                for r in 0..nv {
                    let mut slope = if j < n { 0.0 } else { da_du[(j - n) * nv + r] };
                    for s in 0..nv {
                        slope += da_dq[(r, s)] * self.dy[(s, j)] + da_dv[(r, s)] * self.dy[(nv + s, j)];
                    }
                    self.dk[(r, j)] = self.dy[(nv + r, j)]; // ∂v
                    self.dk[(nv + r, j)] = slope; // a_x ∂y + a_u
                }
            }
            (0..n).for_each(|j| self.sum[j] += weight * self.k[j]);
            let limited = i == 0 && activate_limits(model, false);
            if weight != 0.0 || limited {
                self.dk.iter().zip(self.dsum.iter_mut()).for_each(|(dk, sum)| *sum += weight * dk);
                self.add_cost(node, n, nu);
            }
        }
        activate_limits(model, true);
        step.delta.copy_from_slice(&self.sum[..nv]);
        step.differentiate(model);
        step.chain(model.groups(), &mut self.dsum);
        node.A.copy_from(&self.dsum.columns(0, n));
        node.B.copy_from(&self.dsum.columns(n, nu));
    }

    /// Adds the cost of a stage, a function of y and u, as one of x and u: H += Yᵀ Q Y + …, with Y = ∂y/∂(x, u).
    fn add_cost(&mut self, node: &mut LqNode, n: usize, nu: usize) {
        let Self { dy: Y, stage, H, W, .. } = self;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (q, S) = (stage.q.as_slice(), stage.S.as_slice());
        for (j, (y, w)) in Y.as_slice().chunks_exact(n).zip(W.as_mut_slice().chunks_exact_mut(n)).enumerate() {
            for (Q_r, w) in stage.Q.as_slice().chunks_exact(n).zip(w.iter_mut()) {
                *w = dot(Q_r, y); // Q Y
            }
            if j >= n {
                w.iter_mut().zip(&S[(j - n) * n..]).for_each(|(w, s)| *w += s); // + [0 S]
            }
            for (i, y) in Y.as_slice().chunks_exact(n).enumerate() {
                H[(i, j)] = dot(y, w); // Yᵀ (Q Y + [0 S])
            }
            for (k, S_k) in S.chunks_exact(n).enumerate() {
                let own = if j < n { 0.0 } else { stage.R[(k, j - n)] };
                H[(n + k, j)] += dot(S_k, y) + own; // + [0; Sᵀ Y + R]
            }
            if j < n {
                node.q[j] += dot(q, y);
            } else {
                node.r[j - n] += dot(q, y) + stage.r[j - n];
            }
        }
        node.Q += H.view((0, 0), (n, n));
        node.S += H.view((0, n), (n, nu));
        node.R += H.view((n, n), (nu, nu));
    }
}
