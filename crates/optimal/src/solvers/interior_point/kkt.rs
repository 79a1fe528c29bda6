//! Residuals of the optimality conditions, and multipliers of the dynamics.
#![allow(non_snake_case)] // names follow the literature: A, B, D, E, T, U

use super::slacks::Slacks;
use crate::lq::{InverseDynamicsForm, LqKnot};
use crate::problem::Shape;
use condyle_linalg::{View, add_scaled_product, dot, max_abs};

/// Residuals of the optimality conditions of an iterate.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Kkt {
    /// Largest entry of the gradient of the Lagrangian with respect to the controls.
    pub(super) gradient: f64,
    /// The same entry, divided by IPOPT's scale of the multipliers.
    pub(super) dual: f64,
    /// Largest product of a multiplier and its distance, divided by IPOPT's scale.
    pub(super) complementarity: f64,
    /// Largest gradient with respect to a distance by which a soft limit gives way, divided by IPOPT's scale.
    pub(super) soft: f64,
    /// Largest gap of the dynamics.
    pub(super) gap: f64,
    /// Largest distance of a constraint from its bounds.
    pub(super) violation: f64,
}

impl Kkt {
    /// Returns the largest residual.
    pub(super) fn error(&self) -> f64 {
        self.dual.max(self.soft).max(self.complementarity).max(self.gap).max(self.violation)
    }

    /// Returns whether the iterate is optimal up to a tolerance, a tenth of it for violations.
    pub(super) fn is_converged(&self, tolerance: f64) -> bool {
        self.dual.max(self.soft).max(self.complementarity).max(self.gap) <= tolerance
            && self.violation <= 0.1 * tolerance
    }
}

/// Adjoint recursion, with its workspace.
#[derive(Debug, Clone, Default)]
pub(super) struct Adjoint {
    /// Multipliers λ of the dynamics. Shape: (N + 1) × ndx.
    pub(super) lambda: Vec<f64>,
    /// Gradients with respect to the unknowns and the state, (w, δv, δq) or (δu, δx). Shape: nu + ndx.
    gradient: Vec<f64>,
    /// Gradient of a knot's cost and rows with respect to δx. Shape: ndx.
    of_x: Vec<f64>,
    /// The same with respect to δu. Shape: nu.
    of_u: Vec<f64>,
    /// Gradient Δt Eᵀλ_q + λ_v with respect to the velocity after the step. Shape: ndx / 2.
    pi: Vec<f64>,
    /// Matrix ∂u/∂w, which an elimination overwrites. Shape: nu × nu.
    matrix: Vec<f64>,
}

/// Coordinates of the gradient of the Lagrangian at knots in inverse-dynamics form.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Coordinates {
    /// Unknowns w.
    Unknowns,
    /// Controls: ∂L/∂u = (∂u/∂w)⁻ᵀ ∂L/∂w.
    Controls,
}

impl Adjoint {
    /// Computes λ from the gradients q and r of the costs and from the multipliers of the rows,
    ///
    /// ```text
    /// λ = q + Aᵀλ⁺ + Cᵀy,     ∂L/∂u = r + Bᵀλ⁺ + Dᵀy
    /// ```
    ///
    /// and returns the residuals, with the gradient in the given coordinates.
    pub(super) fn run(
        &mut self,
        knots: &[LqKnot],
        slacks: &Slacks,
        [q, r]: [&[f64]; 2],
        gaps: &[f64],
        shape: &Shape,
        coordinates: Coordinates,
    ) -> Kkt {
        let n = shape.ndx;
        self.lambda.resize(q.len(), 0.0);
        let (mut dual, mut sum) = (0.0_f64, 0.0);
        for t in (0..knots.len()).rev() {
            let (knot, range) = (&knots[t], shape.dx(t));
            let Self { lambda, gradient, of_x, of_u, pi, matrix } = self;
            let (own, ahead) = lambda.split_at_mut(range.end);
            let own = &mut own[range.clone()];
            of_x.clear();
            of_x.extend_from_slice(&q[range]);
            of_u.clear();
            of_u.extend_from_slice(&r[shape.u(t)]);
            let m = of_u.len();
            gradient.clear();
            gradient.resize(m + n, 0.0);
            if knot.structure.is_inverse_dynamics() {
                slacks.add_gradient(t, knot, of_x, &mut gradient[..m], of_u);
                add_equations(knot, gradient, [of_x, of_u], pi, &ahead[..n]);
                if coordinates == Coordinates::Controls {
                    convert_to_controls(knot, gradient, matrix);
                }
                own[..n / 2].copy_from_slice(&gradient[m + n / 2..]);
                own[n / 2..].copy_from_slice(&gradient[m..m + n / 2]);
            } else {
                slacks.add_gradient(t, knot, of_x, of_u, &mut []);
                own.copy_from_slice(of_x);
                if let Some(ahead) = ahead.get(..n) {
                    for (g, column) in own.iter_mut().zip(knot.A.as_slice().chunks_exact(n)) {
                        *g += dot(column, ahead);
                    }
                    for (g, column) in of_u.iter_mut().zip(knot.B.as_slice().chunks_exact(n)) {
                        *g += dot(column, ahead);
                    }
                }
                gradient[..m].copy_from_slice(of_u);
            }
            let largest = max_abs(&gradient[..m]);
            dual = if largest > dual || largest.is_nan() { largest } else { dual };
            sum += own.iter().map(|x| x.abs()).sum::<f64>();
        }
        let rows = slacks.residuals();
        let scale = |sum: f64, count: usize| (sum / count.max(1) as f64).max(100.0) / 100.0;
        let scale_of_dual = scale(sum + rows.sum, self.lambda.len() + rows.count);
        Kkt {
            gradient: dual,
            dual: dual / scale_of_dual,
            soft: rows.stationarity / scale_of_dual,
            complementarity: rows.complementarity / scale(rows.sum, rows.count),
            gap: max_abs(gaps),
            violation: rows.violation,
        }
    }
}

/// Converts the gradient with respect to (w, δv, δq) to the gradient with respect to (δu, δv, δq), for u = U (w, v, q):
///
/// ```text
/// U_wᵀ ∂L/∂u = ∂L/∂w,     ∂L/∂x at constant u = ∂L/∂x at constant w − U_xᵀ ∂L/∂u
/// ```
///
/// The system of equations is solved by Gaussian elimination with row pivots.
fn convert_to_controls(knot: &LqKnot, gradient: &mut [f64], matrix: &mut Vec<f64>) {
    let (m, InverseDynamicsForm { efforts, stride, .. }) = (knot.nu(), &knot.inverse_dynamics);
    let (gradient, of_x) = gradient.split_at_mut(m);
    matrix.clear();
    for row in 0..m {
        matrix.extend(efforts.numbers.chunks_exact(*stride).take(m).map(|U| U[row]));
    }
    for k in 0..m {
        let largest = |a: &usize, b: &usize| matrix[a * m + k].abs().total_cmp(&matrix[b * m + k].abs());
        let pivot = (k..m).max_by(largest).unwrap_or(k);
        gradient.swap(k, pivot);
        (0..m).for_each(|j| matrix.swap(k * m + j, pivot * m + j));
        let (above, below) = matrix.split_at_mut((k + 1) * m);
        let row = &above[k * m..];
        for (i, other) in below.chunks_exact_mut(m).enumerate() {
            let factor = other[k] / row[k];
            other[k..].iter_mut().zip(&row[k..]).for_each(|(x, pivot)| *x -= factor * pivot);
            gradient[k + 1 + i] -= factor * gradient[k];
        }
    }
    for k in (0..m).rev() {
        let (known, sum) = (&gradient[k + 1..], &matrix[k * m + k + 1..(k + 1) * m]);
        gradient[k] = (gradient[k] - dot(sum, known)) / matrix[k * m + k];
    }
    if m > 0 {
        add_scaled_product(of_x, -1.0, View::new(&efforts.numbers[m..], *stride), gradient);
    }
}

/// Adds to the gradient with respect to (w, δv, δq) the terms of the cost and of the equations of inverse dynamics:
///
/// ```text
/// Uᵀ ∂ℓ/∂u + Gᵀ a′ + Dᵀ π_d + [π_own; π; Tᵀ λ_q],     π = Δt Eᵀ λ_q + λ_v
/// ```
fn add_equations(knot: &LqKnot, gradient: &mut [f64], [of_x, of_u]: [&[f64]; 2], pi: &mut Vec<f64>, ahead: &[f64]) {
    let (m, nv) = (of_u.len(), ahead.len() / 2);
    let InverseDynamicsForm { own, dependent, efforts, steps, costs, slopes, stride, .. } = &knot.inverse_dynamics;
    let (dt, blocks) = knot.structure.euler().expect("the form is that of Euler steps");
    let (lambda_q, lambda_v) = ahead.split_at(nv);
    pi.clear();
    pi.extend(lambda_q.iter().zip(lambda_v).map(|(q, v)| dt * q + v));
    for (k, x) in of_x.iter().enumerate() {
        gradient[m + (k + nv) % (2 * nv)] += x;
    }
    gradient[m + nv..].iter_mut().zip(lambda_q).for_each(|(g, q)| *g += q);
    for block in blocks {
        let range = block.range();
        for (column, j) in range.clone().enumerate() {
            let along = |matrix: &nalgebra::DMatrix<f64>| -> f64 {
                range.clone().enumerate().map(|(row, i)| matrix[(row, column)] * lambda_q[i]).sum()
            };
            pi[j] = dt * along(&block.E) + lambda_v[j];
            gradient[m + nv + j] += along(&block.T) - lambda_q[j];
        }
    }
    gradient[m..m + nv].iter_mut().zip(&*pi).for_each(|(g, pi)| *g += pi);
    for &[c, k, length] in own {
        gradient[k..k + length].iter_mut().zip(&pi[c..]).for_each(|(g, pi)| *g += pi);
    }
    let mut add = |rows: &[f64], factors: &[f64]| add_scaled_product(gradient, 1.0, View::new(rows, *stride), factors);
    dependent.iter().zip(steps.numbers.chunks_exact(*stride)).for_each(|(&d, D)| add(D, &[pi[d]]));
    add(&efforts.numbers, of_u);
    slopes.iter().zip(costs.numbers.chunks_exact(*stride)).for_each(|([d, _], G)| add(G, &[*d]));
}
