//! Second derivatives of a semi-implicit Euler step.
//!
//! With y = v + Δt a(x, u) the step is q⁺ = q ⊕ Δt y, v⁺ = y. Let E = ∂(q ⊕ δ)/∂δ at δ = Δt y, ε = Δt δy and
//! θ(δq, ε) = λ_qᵀ((q ⊕ δq) ⊕ (Δt y + ε) ⊖ q⁺). By the chain rule
//!
//! ```text
//! ψ = θ(δq, ε) + λ_vᵀ δy      ∂²ψ = Δt μᵀ∂²a + [∂δq; ∂ε]ᵀ ∂²θ [∂δq; ∂ε]      μ = λ_v + Δt Eᵀ λ_q
//! ```
//!
//! where ∂²θ has a block for each group of positions that is not a vector space, and is zero elsewhere.
#![allow(non_snake_case)] // names follow the literature: E

use super::retraction::Retraction;
use crate::lq::Hessian;
use crate::lq::LARGEST_BLOCK;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput};
use core::ops::Range;

/// Entries of a matrix column in the rows of a group, padded with zeros.
type Rows = [f64; LARGEST_BLOCK];

/// Workspace for the second derivatives of a model's Euler steps.
#[derive(Clone, Debug)]
pub(super) struct Curvature {
    groups: Vec<Range<usize>>,
    /// Vector Δt μ. Shape: nv. Written by: `run`.
    mu: Vec<f64>,
    /// Hessian ∂²θ, with ε in place of the controls. Shape: nv and nv; empty without groups. Written by: `run`.
    theta: Hessian,
    /// Rows of one group in the three matrices ∂ε/∂(x, u), ∂²θ/∂q∂(x, u) and ∂²θ/∂ε∂(x, u). Shape: ndx + nu columns
    /// each; empty without groups. Written by: `add_group`.
    columns: [Vec<Rows>; 3],
}

impl Curvature {
    pub(super) fn new<M: ContinuousModel>(model: &M) -> Self {
        let (groups, nv) = (model.groups().to_vec(), model.nv());
        let (n, count) = if groups.is_empty() { (0, 0) } else { (nv, 2 * nv + model.nu()) };
        let columns = [(); 3].map(|()| vec![[0.0; LARGEST_BLOCK]; count]);
        Self { groups, mu: vec![0.0; nv], theta: Hessian::zeros(n, n), columns }
    }

    /// Writes ∂²ψ to `hessian`. Returns whether the model has second derivatives.
    pub(super) fn run<M: ContinuousModel>(
        &mut self,
        model: &mut M,
        dt: f64,
        input: KnotInput<'_>,
        lambda: &[f64],
        step: &mut Retraction,
        hessian: &mut Hessian,
    ) -> bool {
        let Self { groups, mu, theta, columns } = self;
        let nv = mu.len();
        let (lambda_q, lambda_v) = lambda.split_at(nv);
        mu.copy_from_slice(lambda_q);
        if !groups.is_empty() {
            let a = model.calc(input).0;
            step.set_euler(&input.x[input.x.len() - nv..], a, dt);
            if !model.integrate_hessian(&step.delta, lambda_q, theta) {
                return false;
            }
            step.differentiate(model);
            for group in groups.iter() {
                for k in group.clone() {
                    mu[k] = group.clone().map(|r| step.E[(r, k)] * lambda_q[r]).sum(); // Eᵀ λ_q
                }
            }
        }
        for k in 0..nv {
            mu[k] = dt * (lambda_v[k] + dt * mu[k]); // Δt (λ_v + Δt Eᵀ λ_q)
        }
        let Some(first) = model.hessian(input, mu, hessian) else { return false };
        for group in groups.iter() {
            add_group(group, dt, &first, theta, columns, hessian);
        }
        true
    }
}

/// Adds the term [∂δq; ∂ε]ᵀ ∂²θ [∂δq; ∂ε] of one group, where ε = Δt (δv + Δt (∂a/∂q δq + ∂a/∂v δv + ∂a/∂u δu)). Takes
/// O((ndx + nu)²) operations.
fn add_group(
    group: &Range<usize>,
    dt: f64,
    first: &Derivatives<'_>,
    theta: &Hessian,
    [epsilon, by_q, by_epsilon]: &mut [Vec<Rows>; 3],
    hessian: &mut Hessian,
) {
    let (nv, start, size) = (first.a.len(), group.start, group.len());
    let slopes = [first.da_dq.as_slice(), first.da_dv.as_slice(), first.da_du];
    let mut column = 0;
    for (part, slope) in slopes.into_iter().enumerate() {
        for (k, slope) in slope.chunks_exact(nv).enumerate() {
            let (mut e, mut along_q, mut along_epsilon) =
                ([0.0; LARGEST_BLOCK], [0.0; LARGEST_BLOCK], [0.0; LARGEST_BLOCK]);
            for r in 0..size {
                e[r] = dt * dt * slope[start + r];
            }
            if part == 1 && group.contains(&k) {
                e[k - start] += dt;
            }
            for c in 0..size {
                for r in 0..size {
                    along_q[r] += theta.xu[(start + r, start + c)] * e[c];
                    along_epsilon[r] += theta.uu[(start + r, start + c)] * e[c];
                }
            }
            if part == 0 && group.contains(&k) {
                for r in 0..size {
                    along_q[r] += theta.xx[(start + r, k)];
                    along_epsilon[r] += theta.xu[(k, start + r)];
                }
            }
            (epsilon[column], by_q[column], by_epsilon[column]) = (e, along_q, along_epsilon);
            column += 1;
        }
    }
    // entry in column j, row i: (∂δq/∂i)ᵀ ∂²θ/∂q∂j + (∂ε/∂i)ᵀ ∂²θ/∂ε∂j
    let (ndx, nu) = (2 * nv, column - 2 * nv);
    let (by_state, by_control) = epsilon.split_at(ndx);
    for j in 0..column {
        let states = match j < ndx {
            true => &mut hessian.xx.as_mut_slice()[j * ndx..][..ndx],
            false => &mut hessian.xu.as_mut_slice()[(j - ndx) * ndx..][..ndx],
        };
        add_products(by_state, &by_epsilon[j], states);
        for r in 0..size {
            states[start + r] += by_q[j][r];
        }
        if j >= ndx {
            add_products(by_control, &by_epsilon[j], &mut hessian.uu.as_mut_slice()[(j - ndx) * nu..][..nu]);
        }
    }
}

/// Computes out += Rᵀ x, where `rows` contains the columns of R.
fn add_products(rows: &[Rows], x: &Rows, out: &mut [f64]) {
    for (out, row) in out.iter_mut().zip(rows) {
        let mut sum = 0.0;
        for r in 0..LARGEST_BLOCK {
            sum += row[r] * x[r];
        }
        *out += sum;
    }
}
