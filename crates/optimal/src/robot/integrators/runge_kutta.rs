//! Runge–Kutta methods, as in Crocoddyl's `IntegratedActionModelRK`.
//!
//! ```text
//! y₀ = x,   kᵢ = (vᵢ, a(yᵢ, uᵢ)),   yᵢ₊₁ = x ⊕ cᵢ₊₁ Δt kᵢ,   x⁺ = x ⊕ Δt Σ bᵢ kᵢ,   cost = Δt Σ bᵢ ℓ(yᵢ, uᵢ)
//! ```
//!
//! where uᵢ = u(cᵢ) is the value of the control polynomial u(s) = Σ lₖ(s) wₖ. Derivatives are taken with respect to all
//! w. Limits are evaluated only at y₀.
//!
//! Source: Hairer, Nørsett, Wanner, *Solving Ordinary Differential Equations I* (1993), section II.1.

use super::Integrator;
use super::accelerations::{slopes, solve, values};
use super::controls::ControlPolynomial;
use super::retraction::Retraction;
use crate::lq::LqKnot;
use crate::problem::Evaluation;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput};
use crate::robot::dynamics::batch::Group;
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
pub(super) struct RungeKutta {
    /// Times of the stages, as fractions of Δt; the next field contains the weights of the stages.
    c: &'static [f64],
    b: &'static [f64],
    /// Weights lₖ of the controls wₖ at each stage.
    l: [[f64; 3]; 4],
    /// Controls of the current stage. Shape: nu.
    u: Vec<f64>,
    /// State y of the current stage. Shape: nq + nv.
    y: Vec<f64>,
    /// Slope k of the current stage; the next fields are the step to the next stage and the sum Σ b k. Shape: 2 nv.
    k: Vec<f64>,
    dx: Vec<f64>,
    sum: Vec<f64>,
    /// Derivatives ∂y/∂(x, w); the next fields are ∂k/∂(x, w) and ∂(Σ b k)/∂(x, w). Shape: 2 nv × (2 nv + nw).
    dy: DMatrix<f64>,
    dk: DMatrix<f64>,
    dsum: DMatrix<f64>,
    /// Derivatives of the cost at the current stage.
    stage: LqKnot,
    /// Products of derivatives with the Hessian of the current stage. Shape: (2 nv + nw) × (2 nv + nw); `W`: 2 nv × (2
    /// nv + nw).
    H: DMatrix<f64>,
    W: DMatrix<f64>,
}

impl RungeKutta {
    /// Creates the method with two, three or four stages.
    pub(super) fn new<M: ContinuousModel>(stages: usize, model: &M, controls: ControlPolynomial) -> Self {
        let (nq, nv, nu) = (model.nq(), model.nv(), model.nu());
        let (c, b): (&[f64], &[f64]) = match stages {
            2 => (&[0.0, 0.5], &[0.0, 1.0]),
            3 => (&[0.0, 1.0 / 3.0, 2.0 / 3.0], &[0.25, 0.0, 0.75]),
            _ => (&[0.0, 0.5, 0.5, 1.0], &[1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0]),
        };
        let rule = match stages {
            2 => Integrator::RungeKutta2,
            3 => Integrator::RungeKutta3,
            _ => Integrator::RungeKutta4,
        };
        let (n, nw) = (2 * nv, controls.nodes() * nu);
        let wide = DMatrix::zeros(n, n + nw);
        let l = core::array::from_fn(|i| controls.weights(rule, c.get(i).copied().unwrap_or(0.0)));
        Self {
            c,
            b,
            l,
            u: vec![0.0; nu],
            y: vec![0.0; nq + nv],
            k: vec![0.0; n],
            dx: vec![0.0; n],
            sum: vec![0.0; n],
            dy: wide.clone(),
            dk: wide.clone(),
            dsum: wide.clone(),
            stage: LqKnot::zeros(n, nu),
            H: DMatrix::zeros(n + nw, n + nw),
            W: wide,
        }
    }

    /// Computes the state x ⊕ c Δt k into `self.y`, and the step c Δt k into `self.dx`. The argument `step` is c Δt.
    fn advance<M: ContinuousModel>(&mut self, model: &M, x: &[f64], step: f64) {
        let (nq, nv) = (model.nq(), model.nv());
        (0..2 * nv).for_each(|i| self.dx[i] = step * self.k[i]);
        model.integrate(&x[..nq], &self.dx[..nv], &mut self.y[..nq]);
        (0..nv).for_each(|i| self.y[nq + i] = x[nq + i] + self.dx[nv + i]);
    }

    /// Computes the controls of stage i, uᵢ = Σ lₖ wₖ.
    fn set_controls(&mut self, i: usize, w: &[f64]) {
        let Self { l, u, .. } = self;
        u.fill(0.0);
        for (l, w) in l[i].iter().zip(w.chunks_exact(u.len().max(1))) {
            u.iter_mut().zip(w).for_each(|(u, w)| *u += l * w);
        }
    }

    /// Writes the next state for the controls w. Returns the cost.
    pub(super) fn calc<M: ContinuousModel>(
        &mut self,
        model: &mut M,
        KnotInput { t, x, u: w, .. }: KnotInput<'_>,
        dt: f64,
        next: &mut [f64],
    ) -> f64 {
        let (nq, nv, mut cost, mut term) = (model.nq(), model.nv(), 0.0, 0.0);
        self.sum.fill(0.0);
        self.k.fill(0.0);
        for i in 0..self.b.len() {
            self.advance(model, x, self.c[i] * dt);
            self.set_controls(i, w);
            let (input, limited) = (KnotInput { t, x: &self.y, u: &self.u }, i == 0);
            solve(model, Group::one(&input, Evaluation::Values, limited));
            let (a, rate, limits) = values(model, 0, input, limited);
            term += limits; // the limit term is zero at later stages
            cost += self.b[i] * rate;
            self.k[..nv].copy_from_slice(&self.y[nq..]);
            self.k[nv..].copy_from_slice(a);
            (0..2 * nv).for_each(|j| self.sum[j] += dt * self.b[i] * self.k[j]);
        }
        model.integrate(&x[..nq], &self.sum[..nv], &mut next[..nq]);
        (0..nv).for_each(|j| next[nq + j] = x[nq + j] + self.sum[nv + j]);
        dt * cost + term
    }

    /// Writes the derivatives of a step for the controls w, by the chain rule through the stages.
    pub(super) fn calc_diff<M: ContinuousModel>(
        &mut self,
        model: &mut M,
        KnotInput { t, x, u: w, .. }: KnotInput<'_>,
        dt: f64,
        step: &mut Retraction,
        knot: &mut LqKnot,
    ) {
        let (nq, nv, nu) = (model.nq(), model.nv(), model.nu());
        let (n, nw) = (2 * nv, w.len());
        for field in [&mut knot.Q, &mut knot.S, &mut knot.R] {
            field.fill(0.0);
        }
        knot.q.fill(0.0);
        knot.r.fill(0.0);
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
            self.set_controls(i, w);
            let (input, limited) = (KnotInput { t, x: &self.y, u: &self.u }, i == 0 && model.robot().is_some());
            let group = Group::one(&input, Evaluation::Derivatives, i == 0);
            solve(model, group);
            let Derivatives { a, da_dq, da_dv, da_du } = slopes(model, 0, input, weight, group, &mut self.stage);
            self.k[..nv].copy_from_slice(&self.y[nq..]);
            self.k[nv..].copy_from_slice(a);
            for j in 0..n + nw {
                let own = j.checked_sub(n).map(|j| (self.l[i][j / nu], &da_du[(j % nu) * nv..]));
                for r in 0..nv {
                    let mut slope = own.map_or(0.0, |(l, da_du)| l * da_du[r]);
                    for s in 0..nv {
                        slope += da_dq[(r, s)] * self.dy[(s, j)] + da_dv[(r, s)] * self.dy[(nv + s, j)];
                    }
                    self.dk[(r, j)] = self.dy[(nv + r, j)]; // ∂v
                    self.dk[(nv + r, j)] = slope; // a_x ∂y + a_u ∂u
                }
            }
            (0..n).for_each(|j| self.sum[j] += weight * self.k[j]);
            if weight != 0.0 || limited {
                self.dk.iter().zip(self.dsum.iter_mut()).for_each(|(dk, sum)| *sum += weight * dk);
                self.add_cost(knot, i, n, nu);
            }
            if i == 0 {
                core::mem::swap(&mut self.stage.rows, &mut knot.rows); // at c₀ = 0, y = x and u = w₀
                self.stage.rows.clear();
            }
        }
        step.delta.copy_from_slice(&self.sum[..nv]);
        step.differentiate(model);
        step.chain(model.groups(), &mut self.dsum);
        knot.A.copy_from(&self.dsum.columns(0, n));
        knot.B.copy_from(&self.dsum.columns(n, nw));
    }

    /// Adds the derivatives of the cost of stage i. The cost is a function of y and uᵢ; the chain rule converts its
    /// derivatives to x and w: H += Yᵀ Q Y and further products, with Y = ∂y/∂(x, w) and ∂uᵢ/∂wₖ = lₖ.
    fn add_cost(&mut self, knot: &mut LqKnot, i: usize, n: usize, nu: usize) {
        let Self { l, dy: Y, stage, H, W, .. } = self;
        let (l, nw) = (l[i], Y.ncols() - n);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (q, S) = (stage.q.as_slice(), stage.S.as_slice());
        for (j, (y, w)) in Y.as_slice().chunks_exact(n).zip(W.as_mut_slice().chunks_exact_mut(n)).enumerate() {
            for (Q_r, w) in stage.Q.as_slice().chunks_exact(n).zip(w.iter_mut()) {
                *w = dot(Q_r, y); // Q Y
            }
            if j >= n {
                let (l, m) = (l[(j - n) / nu], (j - n) % nu);
                w.iter_mut().zip(&S[m * n..]).for_each(|(w, s)| *w += l * s); // + [0 S ∂u]
            }
            for (i, y) in Y.as_slice().chunks_exact(n).enumerate() {
                H[(i, j)] = dot(y, w); // Yᵀ (Q Y + [0 S ∂u])
            }
            for (k, S_k) in S.chunks_exact(n).enumerate() {
                let own = if j < n { 0.0 } else { l[(j - n) / nu] * stage.R[(k, (j - n) % nu)] };
                let row = dot(S_k, y) + own;
                for at in 0..nw / nu {
                    H[(n + at * nu + k, j)] += l[at] * row; // + ∂uᵀ [0; Sᵀ Y + R ∂u]
                }
            }
            if j < n {
                knot.q[j] += dot(q, y);
            } else {
                knot.r[j - n] += dot(q, y) + l[(j - n) / nu] * stage.r[(j - n) % nu];
            }
        }
        knot.Q += H.view((0, 0), (n, n));
        knot.S += H.view((0, n), (n, nw));
        knot.R += H.view((n, n), (nw, nw));
    }
}
