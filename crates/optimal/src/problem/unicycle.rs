//! Unicycle as an action, a minimal problem with nonlinear dynamics.

use super::action::ActionModel;
use crate::lq::{Hessian, LqKnot};

/// Unicycle with the state x = (x, y, θ) and the control u = (v, ω):
///
/// ```text
/// x⁺ = x + Δt (v cos θ, v sin θ, ω),      ℓ = ½ (w₁² ‖x‖² + w₂² ‖u‖²)
/// ```
///
/// Dynamics and cost equal the dynamics and cost of Crocoddyl's `ActionModelUnicycle`. Allocates nothing.
///
/// ```
/// use condyle_optimal::{Fddp, Problem, Status, Unicycle};
/// let x0 = [-1.0, -1.0, 1.0];
/// let (knot, end) = (Unicycle::default(), Unicycle::default().terminal());
/// let mut problem = Problem::new(x0.to_vec(), vec![Box::new(knot)], vec![0; 20], Box::new(end))?;
/// let solution = Fddp::new(&problem).solve(&mut problem, &[0.0; 63], &[0.0; 40])?.clone();
/// assert_eq!(solution.status, Status::Converged);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Unicycle {
    /// Time step Δt (s).
    pub dt: f64,
    /// Weights w₁ and w₂.
    pub weights: [f64; 2],
    end: bool,
}

impl Default for Unicycle {
    /// Returns a unicycle with a step of 0.1 s and the weights 10 and 1.
    fn default() -> Self {
        Self::new(0.1, [10.0, 1.0])
    }
}

impl Unicycle {
    /// Creates a unicycle with the step Δt and the weights w₁ and w₂.
    pub fn new(dt: f64, weights: [f64; 2]) -> Self {
        Self { dt, weights, end: false }
    }

    /// Returns the same unicycle as a terminal action, without controls.
    #[must_use]
    pub fn terminal(self) -> Self {
        Self { end: true, ..self }
    }
}

fn square(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum()
}

impl ActionModel for Unicycle {
    fn nx(&self) -> usize {
        3
    }

    fn nu(&self) -> usize {
        if self.end { 0 } else { 2 }
    }

    fn is_terminal(&self) -> bool {
        self.end
    }

    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let [by_x, by_u] = self.weights.map(|w| w * w);
        if let &[v, turn] = u {
            let (s, c) = x[2].sin_cos();
            for (k, rate) in [v * c, v * s, turn].into_iter().enumerate() {
                next[k] = x[k] + self.dt * rate;
            }
        }
        0.5 * (by_x * square(x) + by_u * square(u))
    }

    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let ([by_x, by_u], dt) = (self.weights.map(|w| w * w), self.dt);
        knot.Q.fill(0.0);
        knot.Q.fill_diagonal(by_x);
        knot.S.fill(0.0);
        knot.R.fill(0.0);
        knot.R.fill_diagonal(by_u);
        (0..3).for_each(|k| knot.q[k] = by_x * x[k]);
        (0..u.len()).for_each(|k| knot.r[k] = by_u * u[k]);
        if let &[v, _] = u {
            let (s, c) = x[2].sin_cos();
            knot.A.fill_with_identity();
            (knot.A[(0, 2)], knot.A[(1, 2)]) = (-dt * v * s, dt * v * c);
            knot.B.fill(0.0);
            (knot.B[(0, 0)], knot.B[(1, 0)], knot.B[(2, 1)]) = (dt * c, dt * s, dt);
        }
    }

    fn dynamics_hessian(&mut self, _: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        for part in [&mut hessian.xx, &mut hessian.xu, &mut hessian.uu] {
            part.fill(0.0);
        }
        if let &[v, _] = u {
            let (s, c) = x[2].sin_cos();
            hessian.xx[(2, 2)] = -self.dt * v * (lambda[0] * c + lambda[1] * s);
            hessian.xu[(2, 0)] = self.dt * (lambda[1] * c - lambda[0] * s);
        }
        true
    }

    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(self.clone()))
    }
}
