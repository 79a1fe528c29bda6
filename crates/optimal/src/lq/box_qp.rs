//! Solution of quadratic programs with bounds, by projected Newton steps.
#![allow(non_snake_case)] // names follow the literature

use condyle_linalg::{SLACK, dot, eliminate, solve_right};
use nalgebra::DMatrix;

/// Maximum number of Newton steps with Crocoddyl's rule. If they do not converge, the same number of steps follows with
/// the careful rule.
const STEPS: usize = 100;

/// Convergence tolerance: largest gradient entry of the free variables at a solution.
const GRADIENT: f64 = 1e-5;

/// Fraction of the decrease that the slope predicts. A step is accepted if the objective falls by more than this
/// fraction of the predicted decrease.
const ACCEPT: f64 = 0.1;

/// Number of step lengths that a line search tries: 1, ½, …, 2⁻⁹.
const STEP_LENGTHS: i32 = 10;

/// Workspace for a quadratic program with bounds,
///
/// ```text
/// minimise   ½ xᵀ H x + qᵀ x      subject to   lower ≤ x ≤ upper
/// ```
///
/// by the method of Tassa, Mansard, Todorov (ICRA 2014, section III), with the rules and constants of Crocoddyl's box
/// solvers. A variable is clamped if it lies on a bound and the negative gradient points outside that bound. The other
/// variables are free: they make a Newton step, whose result is moved into the bounds.
///
/// Crocoddyl's rule for accepting a step uses the slope of the free variables with the wrong sign, so a step may raise
/// the objective. The iteration usually still converges, to the same set of clamped variables. If the iteration cycles
/// (18 of the 600 problems of `tests/box_qp.rs`), the rule of the paper is used.
#[derive(Debug, Clone)]
pub(crate) struct BoxQp {
    pub(crate) x: Vec<f64>,
    /// Indices of the variables that were free in the last Newton step, in ascending order.
    pub(crate) free: Vec<usize>,
    gradient: Vec<f64>,
    step: Vec<f64>,
    trial: Vec<f64>,
    /// Matrix [H_ff; g_fᵀ] of the free variables f with gradient g; the elimination replaces H_ff by its Cholesky
    /// factor.
    H: Vec<f64>,
    upper: Vec<f64>,
}

impl BoxQp {
    /// Allocates the workspace for `size` variables.
    pub(crate) fn new(size: usize) -> Self {
        Self {
            x: vec![0.0; size],
            free: Vec::with_capacity(size),
            gradient: vec![0.0; size],
            step: vec![0.0; size],
            trial: vec![0.0; size],
            H: vec![0.0; (size + 1 + SLACK) * (size + SLACK)],
            upper: vec![0.0; (size + SLACK) * size],
        }
    }

    /// Solves the program from `start`, which is first moved into the bounds. Writes the results to `x` and `free`.
    ///
    /// # Errors
    /// Index of a variable and its pivot, if the block of H for the free variables is not positive definite.
    pub(crate) fn solve(
        &mut self,
        H: &DMatrix<f64>,
        q: &[f64],
        lower: &[f64],
        upper: &[f64],
        start: impl Iterator<Item = f64>,
    ) -> Result<(), (usize, f64)> {
        let m = q.len();
        for (i, start) in start.enumerate() {
            self.x[i] = start.min(upper[i]).max(lower[i]);
        }
        for n in 0..2 * STEPS {
            // gradient g = q + H x of the objective
            self.gradient[..m].copy_from_slice(q);
            for j in 0..m {
                for i in 0..m {
                    self.gradient[i] += H[(i, j)] * self.x[j];
                }
            }
            self.free.clear();
            for (i, g) in self.gradient[..m].iter().enumerate() {
                if !(self.x[i] == lower[i] && *g > 0.0 || self.x[i] == upper[i] && *g < 0.0) {
                    self.free.push(i);
                }
            }
            self.newton_step(H)?;
            let slope = self.free.iter().fold(0.0, |largest: f64, &i| largest.max(self.gradient[i].abs()));
            self.line_search(H, q, lower, upper, n >= STEPS);
            if slope <= GRADIENT {
                break;
            }
        }
        Ok(())
    }

    /// Computes the step Δx_f = −H_ff⁻¹ g_f of the free variables f, and Δx = 0 for the clamped variables.
    fn newton_step(&mut self, H: &DMatrix<f64>) -> Result<(), (usize, f64)> {
        let Self { free, gradient, step, H: work, upper, .. } = self;
        let (count, stride) = (free.len(), free.len() + 1 + SLACK);
        for (column, &j) in free.iter().enumerate() {
            let column = &mut work[column * stride..][..stride];
            for (row, &i) in free.iter().enumerate() {
                column[row] = H[(i, j)];
            }
            column[count] = gradient[j];
            column[count + 1..].fill(0.0);
        }
        eliminate(work, stride, [count + 1, count, count]).map_err(|(row, pivot)| (free[row], pivot))?;
        solve_right(work, stride, [count, count + 1, count], upper);
        step.fill(0.0);
        for (column, &j) in free.iter().enumerate() {
            step[j] = -work[column * stride + count];
        }
        Ok(())
    }

    /// Takes a step of the longest length that is accepted, if one is. If `careful`, the rule of the paper accepts
    /// steps; otherwise Crocoddyl's rule does.
    fn line_search(&mut self, H: &DMatrix<f64>, q: &[f64], lower: &[f64], upper: &[f64], careful: bool) {
        let m = q.len();
        if !careful {
            for &i in &self.free {
                self.gradient[i] = -self.gradient[i];
            }
        }
        let value = objective(H, q, &self.x[..m]);
        for n in 0..STEP_LENGTHS {
            let length = 0.5_f64.powi(n);
            let mut expected = 0.0;
            for i in 0..m {
                self.trial[i] = (self.x[i] + length * self.step[i]).min(upper[i]).max(lower[i]);
                expected += self.gradient[i] * (self.x[i] - self.trial[i]);
            }
            if value - objective(H, q, &self.trial[..m]) > ACCEPT * expected {
                self.x[..m].copy_from_slice(&self.trial[..m]);
                return;
            }
        }
    }
}

/// Returns the objective ½ xᵀ H x + qᵀ x.
fn objective(H: &DMatrix<f64>, q: &[f64], x: &[f64]) -> f64 {
    let curvature: f64 = H.column_iter().zip(x).map(|(column, xj)| xj * dot(column.as_slice(), x)).sum();
    0.5 * curvature + dot(q, x)
}
