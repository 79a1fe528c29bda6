//! Gradient of a loss with respect to the parameters of a problem, by the adjoint method.
//!
//! The matrix M of the linearised optimality conditions is symmetric. The derivative of the solution w = (z, λ, y)
//! along p is M dw = −F dp, so for a loss with the gradient l, dL/dp = lᵀ dw/dp = −aᵀF with M a = l.

use super::parameters::ParameterJacobian;
use super::point::{Active, Point, Rows};
use super::system::{System, Vectors, slice};
use crate::error::Error;
use crate::problem::Shape;
use nalgebra::{DMatrix, DVector};

/// Solution of the adjoint problem for a loss L(x, u).
///
/// With Lₜ, A, B, C and D as in [`Sensitivity`](crate::Sensitivity), the adjoint states ξ, controls υ and costates η
/// solve
///
/// ```text
/// minimise   Σₜ ½ ζᵀ ∇²Lₜ ζ − ∂L/∂zₜᵀ ζ,   ζ = (ξ, υ)
/// subject to ξ₀ = 0,   ξₜ₊₁ = A ξ + B υ,   C ξ + D υ = 0,   υ = 0 at a bound
/// ```
///
/// where η and γ are the multipliers of the dynamics and of the rows. The derivative of the loss with respect to a
/// parameter p is
///
/// ```text
/// dL/dp = −Σₜ (ζₜᵀ ∂(∇Lₜ)/∂p + ηₜ₊₁ᵀ ∂φₜ/∂p + γₜᵀ ∂g/∂p) − η₀ᵀ ∂x̂₀/∂p
/// ```
#[derive(Debug, Clone)]
pub struct Adjoint {
    /// Derivative of the loss with respect to the initial state, −η₀, ndx numbers in the tangent space.
    pub x0: Vec<f64>,
    /// Derivatives of the loss with respect to the bound at which a control is; zero for other controls. All controls
    /// one after the other.
    pub control_bounds: Vec<f64>,
    /// Derivatives of the loss with respect to the bound at which a row is, for the rows of each knot 0 … N; zero for
    /// other rows. The order is the order of [`Outcome::multipliers`](crate::Outcome::multipliers). For an equality,
    /// both bounds move.
    pub row_bounds: Vec<Vec<f64>>,
    shape: Shape,
    solution: Vectors,
    given: Vectors,
    /// Controls at a bound, in the order of the knots.
    held: Vec<Held>,
    /// Derivatives with respect to the bounds of the controls at a bound, for each knot.
    kappa: Vec<Vec<f64>>,
}

/// Control at a bound, with its columns of the matrices of its knot.
#[derive(Debug, Clone)]
struct Held {
    knot: usize,
    /// Index in the controls of all knots.
    index: usize,
    S: DVector<f64>,
    R: DVector<f64>,
    B: DVector<f64>,
    D: DVector<f64>,
}

impl Held {
    fn all(point: &Point) -> Vec<Self> {
        let of_knot = |(t, active): (usize, &Vec<Active>)| {
            let (lq, rows) = (&point.knots[t], &point.rows[t]);
            let column = |matrix: &DMatrix<f64>, i: usize| matrix.column(i).clone_owned();
            let one = |&(i, _): &Active| Self {
                knot: t,
                index: point.shape.offsets[t] + i,
                S: column(&lq.S, i),
                R: column(&lq.R, i),
                B: column(&lq.B, i),
                D: column(&rows.D, i),
            };
            active.iter().map(one).collect::<Vec<_>>()
        };
        point.controls.iter().enumerate().flat_map(of_knot).collect()
    }
}

impl Adjoint {
    /// Allocates an adjoint for a solution.
    pub(super) fn new(point: &Point) -> Self {
        let zeros = Vectors::zeros(point);
        Self {
            shape: point.shape.clone(),
            x0: vec![0.0; point.shape.ndx],
            control_bounds: zeros.u.clone(),
            row_bounds: point.rows.iter().map(|rows| vec![0.0; rows.y.len()]).collect(),
            held: Held::all(point),
            kappa: point.controls.iter().map(|active| vec![0.0; active.len()]).collect(),
            solution: zeros.clone(),
            given: zeros,
        }
    }

    /// Returns the adjoint states ξ₀ … ξ_N, (N + 1) · ndx.
    pub fn states(&self) -> &[f64] {
        &self.solution.x
    }

    /// Returns the adjoint controls υ₀ … υ_{N−1}, one after the other.
    pub fn controls(&self) -> &[f64] {
        &self.solution.u
    }

    /// Returns the adjoint costates η₀ … η_N, (N + 1) · ndx.
    pub fn costates(&self) -> &[f64] {
        &self.solution.dynamics
    }

    /// Returns the indices of the controls at a bound in the controls of all knots.
    pub(super) fn held(&self) -> impl Iterator<Item = usize> {
        self.held.iter().map(|held| held.index)
    }

    /// Returns ξ, υ and η, to be written.
    pub(super) fn solution_mut(&mut self) -> [&mut [f64]; 3] {
        let Vectors { x, u, dynamics, .. } = &mut self.solution;
        [x, u, dynamics]
    }

    /// Solves the adjoint problem for the gradients of a loss.
    pub(super) fn run(
        &mut self,
        point: &Point,
        system: &mut System,
        [by_states, by_controls]: [&[f64]; 2],
    ) -> Result<(), Error> {
        let Self { solution, given, held, .. } = self;
        given.x.copy_from_slice(by_states);
        given.u.copy_from_slice(by_controls);
        for held in held {
            given.u[held.index] = 0.0;
        }
        system.solve(given, solution)?;
        self.write_bounds(by_controls);
        for (t, Rows { active, .. }) in point.rows.iter().enumerate() {
            for (k, (row, _)) in active.iter().enumerate() {
                self.row_bounds[t][*row] = self.solution.rows[t][k];
            }
        }
        Ok(())
    }

    /// Computes the derivatives with respect to the initial state and to the bounds of controls from ξ, υ, η and γ.
    pub(super) fn write_bounds(&mut self, by_controls: &[f64]) {
        let Self { x0, control_bounds, shape, solution, held, kappa, .. } = self;
        for (own, eta) in x0.iter_mut().zip(&solution.dynamics) {
            *own = -eta;
        }
        let (mut t, mut k) = (0, 0); // knot, and index among its controls at a bound
        for Held { knot, index, S, R, B, D } in held {
            k = if *knot == t { k } else { 0 };
            t = *knot;
            let (xi, u) = (slice(&solution.x[shape.dx(t)]), slice(&solution.u[shape.u(t)]));
            let eta = slice(&solution.dynamics[shape.dx(t + 1)]);
            // κ = Sᵀξ + Rυ + Bᵀη⁺ + Dᵀγ − ∂L/∂u
            let terms = S.dot(&xi) + R.dot(&u) + B.dot(&eta) + D.dot(&solution.rows[t]);
            kappa[t][k] = terms - by_controls[*index];
            control_bounds[*index] = -kappa[t][k];
            k += 1;
        }
    }

    /// Returns dL/dp for a parameter. Allocates the result.
    ///
    /// # Panics
    /// If the parameter's Jacobian belongs to a solution with other dimensions or other active constraints.
    #[track_caller]
    pub fn gradient(&self, parameter: &ParameterJacobian) -> Vec<f64> {
        let mut sum = vec![0.0; parameter.size()];
        for t in 0..=parameter.horizon() {
            self.add_knot(parameter, t, &mut sum);
        }
        sum
    }

    /// Returns dL/dp for each of several parameters, from the same solution of the adjoint problem. Allocates the
    /// result.
    ///
    /// # Panics
    /// If a Jacobian belongs to a solution with other dimensions or other active constraints.
    #[track_caller]
    pub fn gradients<'a>(&self, parameters: impl IntoIterator<Item = &'a ParameterJacobian>) -> Vec<Vec<f64>> {
        parameters.into_iter().map(|parameter| self.gradient(parameter)).collect()
    }

    /// Returns the part of dL/dp for each knot 0 … N: the derivative with respect to a value of the parameter that only
    /// this knot uses. The initial state belongs to knot 0. The sum is [`gradient`](Self::gradient). Allocates the
    /// result.
    ///
    /// # Panics
    /// If the parameter's Jacobian belongs to a solution with other dimensions or other active constraints.
    #[track_caller]
    pub fn gradient_by_knot(&self, parameter: &ParameterJacobian) -> Vec<Vec<f64>> {
        let each = |t: usize| {
            let mut part = vec![0.0; parameter.size()];
            self.add_knot(parameter, t, &mut part);
            part
        };
        (0..=parameter.horizon()).map(each).collect()
    }

    /// Adds the part of dL/dp for one knot.
    #[track_caller]
    fn add_knot(&self, parameter: &ParameterJacobian, t: usize, to: &mut [f64]) {
        parameter.subtract_products(&self.shape, t, &self.solution, &self.kappa[t], to);
    }
}
