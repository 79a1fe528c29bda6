//! All cones of a program, row after row: slack variables, multipliers, scalings and directions.

use super::cone::{apply_inverse, divide, inverse_step, product, scaling};
use super::scaled::{Cone, Scaled};

/// Evaluates an expression that depends on a cone's dimension `dim`. For friction cones `dim` is the constant 3, so
/// that the compiler can unroll loops.
macro_rules! by_dimension {
    ($value:expr, $dim:ident => $expression:expr) => {
        match $value {
            3 => {
                let $dim = 3;
                $expression
            }
            $dim => $expression,
        }
    };
}

/// Slack variables s = h + F x and multipliers z of all cones. A tilde marks a scaled direction: d̃s = W⁻¹ ds, d̃z = W
/// dz, where W is the scaling of a cone.
#[derive(Clone, Debug, Default)]
pub(super) struct Cones {
    pub s: Vec<f64>,
    pub z: Vec<f64>,
    /// Residuals h + F x − s.
    pub r: Vec<f64>,
    pub ds: Vec<f64>,
    pub dz: Vec<f64>,
    /// Vector w and number η of the scaling W of each cone, and the scaled variable λ: the fields `w`, `eta` and
    /// `lambda`.
    w: Vec<f64>,
    eta: Vec<f64>,
    lambda: Vec<f64>,
    /// Solution p of λ ∘ p = ξ, where ξ is the right side of a step (see `target`).
    p: Vec<f64>,
    ds_tilde: Vec<f64>,
    dz_tilde: Vec<f64>,
    scratch: Vec<f64>,
}

impl Cones {
    pub(super) fn new(rows: usize) -> Self {
        let vector = || vec![0.0; rows];
        Self {
            s: vector(),
            z: vector(),
            r: vector(),
            ds: vector(),
            dz: vector(),
            w: vector(),
            eta: vector(),
            lambda: vector(),
            p: vector(),
            ds_tilde: vector(),
            dz_tilde: vector(),
            scratch: vector(),
        }
    }

    /// Computes the residuals r = h + F x − s and the multipliers z. Adds the contributions of the cones to `sums`,
    /// which are ‖r‖∞, sᵀ z and −hᵀ z.
    pub(super) fn residuals(&mut self, h: &[f64], Fx: &[f64], multipliers: &mut [f64], sums: &mut [f64; 3]) {
        for i in 0..h.len() {
            self.r[i] = h[i] + Fx[i] - self.s[i];
            multipliers[i] = self.z[i];
            sums[0] = sums[0].max(self.r[i].abs());
            sums[1] += self.s[i] * self.z[i];
            sums[2] -= h[i] * self.z[i];
        }
    }

    /// Computes the scaling W and the scaled variable λ = W z = W⁻¹ s of each cone. Returns false if a pair (s, z) is
    /// not in the interior of its cone.
    pub(super) fn scale(&mut self, cones: &[Cone]) -> bool {
        cones.iter().enumerate().all(|(k, cone)| by_dimension!(cone.dim, dim => self.scale_one(k, cone.at, dim)))
    }

    #[inline(always)]
    fn scale_one(&mut self, k: usize, at: usize, dim: usize) -> bool {
        let at = at..at + dim;
        let (w, lambda) = (&mut self.w[at.clone()], &mut self.lambda[at.clone()]);
        match scaling(&self.s[at.clone()], &self.z[at], w, lambda) {
            Some(eta) => self.eta[k] = eta,
            None => return false,
        }
        true
    }

    /// Computes B = (W⁻¹ F)ᵀ, with the scaling W of each cone, in the rows of Fᵀ that have non-zero entries.
    #[inline(always)]
    pub(super) fn scale_rows(&self, data: &Scaled, B: &mut [f64]) {
        let (ld, m) = (data.ld, data.rows());
        for (k, cone) in data.cones.iter().enumerate() {
            let rows = data.range(m + cone.at);
            let (w, r, n) = (&self.w[cone.at..][..cone.dim], self.eta[k].recip(), rows.len());
            let F = &data.K[(m + cone.at) * ld + rows.start..];
            let (head, tail) = B[cone.at * ld + rows.start..].split_at_mut(ld);
            let (f0, head) = (&F[..n], &mut head[..n]);
            // Until the last loop, `head` stores w₁ᵀ F₁. The last loop replaces it by the first row of the result.
            head.fill(0.0);
            for i in 1..cone.dim {
                let f = &F[i * ld..][..n];
                for j in 0..n {
                    head[j] += w[i] * f[j];
                }
            }
            let a = r / (1.0 + w[0]);
            for i in 1..cone.dim {
                let (to, f) = (&mut tail[(i - 1) * ld..][..n], &F[i * ld..][..n]);
                for j in 0..n {
                    to[j] = r * f[j] + w[i] * (a * head[j] - r * f0[j]);
                }
            }
            for j in 0..n {
                head[j] = r * (w[0] * f0[j] - head[j]);
            }
        }
    }

    /// Computes x ← W⁻² x, with the scaling W of each cone.
    pub(super) fn weigh(&mut self, cones: &[Cone], x: &mut [f64]) {
        for (k, cone) in cones.iter().enumerate() {
            let at = cone.at..cone.at + cone.dim;
            let (w, y) = (&self.w[at.clone()], &mut self.scratch[at.clone()]);
            apply_inverse(self.eta[k], w, &x[at.clone()], y);
            apply_inverse(self.eta[k], w, y, &mut x[at]);
        }
    }

    /// Computes the solution p of λ ∘ p = ξ with ξ = σμ e − λ ∘ λ − d̃s ∘ d̃z, and the target W⁻¹ (p − W⁻¹ r). λ is the
    /// scaled variable, d̃s and d̃z are the last scaled directions, W is the scaling, and r the residual. The term d̃s
    /// ∘ d̃z is only used if `second_order` is true.
    pub(super) fn target(&mut self, cones: &[Cone], centre: f64, second_order: bool, target: &mut [f64]) {
        for (k, cone) in cones.iter().enumerate() {
            by_dimension!(cone.dim, dim => self.target_one(k, cone.at, dim, centre, second_order, target));
        }
    }

    #[inline(always)]
    fn target_one(&mut self, k: usize, at: usize, dim: usize, centre: f64, second_order: bool, target: &mut [f64]) {
        let at = at..at + dim;
        let (eta, w, lambda) = (self.eta[k], &self.w[at.clone()], &self.lambda[at.clone()]);
        let (p, y) = (&mut self.p[at.clone()], &mut self.scratch[at.clone()]);
        if second_order {
            product(&self.ds_tilde[at.clone()], &self.dz_tilde[at.clone()], y);
            y[0] -= centre;
            divide(lambda, y, p);
        } else if centre > 0.0 {
            y.fill(0.0);
            y[0] = -centre;
            divide(lambda, y, p);
        } else {
            p.fill(0.0);
        }
        for i in 0..dim {
            p[i] = -lambda[i] - p[i];
        }
        apply_inverse(eta, w, &self.r[at.clone()], y);
        for i in 0..dim {
            y[i] = p[i] - y[i];
        }
        apply_inverse(eta, w, y, &mut target[at]);
    }

    /// Computes the directions of the slack variables s and of the multipliers z: ds = F dx + r and dz = W⁻¹ (p − W⁻¹
    /// ds), with p of `target`. Raises `inverse` to the inverse of the greatest step length.
    pub(super) fn direction(&mut self, cones: &[Cone], Fdx: &[f64], inverse: &mut f64) {
        for (k, cone) in cones.iter().enumerate() {
            by_dimension!(cone.dim, dim => self.direction_one(k, cone.at, dim, Fdx, inverse));
        }
    }

    #[inline(always)]
    fn direction_one(&mut self, k: usize, at: usize, dim: usize, Fdx: &[f64], inverse: &mut f64) {
        let at = at..at + dim;
        let (Fdx, r, p) = (&Fdx[at.clone()], &self.r[at.clone()], &self.p[at.clone()]);
        let (eta, w, lambda) = (self.eta[k], &self.w[at.clone()], &self.lambda[at.clone()]);
        let (ds, dz) = (&mut self.ds[at.clone()], &mut self.dz[at.clone()]);
        let (ds_tilde, dz_tilde) = (&mut self.ds_tilde[at.clone()], &mut self.dz_tilde[at.clone()]);
        for i in 0..dim {
            ds[i] = Fdx[i] + r[i];
        }
        apply_inverse(eta, w, ds, ds_tilde);
        for i in 0..dim {
            dz_tilde[i] = p[i] - ds_tilde[i];
        }
        apply_inverse(eta, w, dz_tilde, dz);
        *inverse = inverse.max(inverse_step(lambda, ds_tilde)).max(inverse_step(lambda, dz_tilde));
    }

    /// Adds the step: s += α ds and z += α dz, with the step length α.
    pub(super) fn advance(&mut self, rows: usize, step: f64) {
        for i in 0..rows {
            self.s[i] += step * self.ds[i];
            self.z[i] += step * self.dz[i];
        }
    }
}
