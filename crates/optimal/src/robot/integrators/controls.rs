//! Control polynomials, which describe how the controls of a knot change during its duration.
#![allow(non_snake_case)] // names follow the literature: B, S, R

use super::Integrator;
use crate::lq::LqKnot;

/// Polynomial u(s) that the controls of a knot follow. The argument s is the time within the knot divided by Δt, from 0
/// to 1.
///
/// The control vector w of the knot contains the values of u at the nodes of the polynomial, one after the other.
///
/// ```text
/// constant    u(s) = w                                     one node
/// linear      u(s) = (1 − 2 s) w₀ + 2 s w₁                 nodes at s = 0 and ½
/// quadratic   u(s) = Σ lₖ(s) wₖ, Lagrange's polynomials    nodes at s = 0, ½, 1; with `RungeKutta3` at 0, ⅓, ⅔
/// ```
///
/// Dynamics and costs are computed at the stages of the [`Integrator`], each with its own u(s). Semi-implicit Euler has
/// one stage, at s = 0. With this integrator, w₁ and w₂ therefore have no effect on the next state; only regularisation
/// and [`Constrained`](crate::Constrained) terms determine them. These polynomials are Crocoddyl's
/// `ControlParametrizationModelPolyZero`, `PolyOne` and `PolyTwoRK`.
///
/// ```
/// use condyle_optimal::robot::{ControlPolynomial, Integrator};
/// let [a, b, c] = ControlPolynomial::Quadratic.weights(Integrator::RungeKutta4, 0.5);
/// assert_eq!([a, b, c], [0.0, 1.0, 0.0]); // w₁ is the control in the middle
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum ControlPolynomial {
    /// Constant controls: one node.
    #[default]
    Constant,
    /// First-degree polynomial: two nodes.
    Linear,
    /// Second-degree polynomial: three nodes.
    Quadratic,
}

impl ControlPolynomial {
    /// Returns the number of nodes. A knot has nodes · nu entries in its control vector.
    pub fn nodes(self) -> usize {
        match self {
            Self::Constant => 1,
            Self::Linear => 2,
            Self::Quadratic => 3,
        }
    }

    /// Returns the weights of w₀, w₁, w₂ in u(s). The weight of a node that does not exist is 0.
    pub fn weights(self, integrator: Integrator, s: f64) -> [f64; 3] {
        match (self, integrator) {
            (Self::Constant, _) => [1.0, 0.0, 0.0],
            (Self::Linear, _) => [1.0 - 2.0 * s, 2.0 * s, 0.0],
            (Self::Quadratic, Integrator::RungeKutta3) => {
                [(4.5 * s - 4.5) * s + 1.0, (6.0 - 9.0 * s) * s, (4.5 * s - 1.5) * s]
            }
            (Self::Quadratic, _) => [(2.0 * s - 1.0) * (s - 1.0), 4.0 * s * (1.0 - s), (2.0 * s - 1.0) * s],
        }
    }

    /// Returns whether the controls are constant during the knot.
    pub(crate) fn is_constant(&self) -> bool {
        *self == Self::Constant
    }
}

/// Converts derivatives with respect to u = w₀ into derivatives with respect to all w. The columns of w₁ and w₂ are
/// zero.
pub(super) fn widen(from: &LqKnot, knot: &mut LqKnot) {
    let (n, nu) = (from.ndx(), from.nu());
    let LqKnot { A, B, Q, S, R, q, r, .. } = knot;
    for part in [&mut *B, &mut *S, &mut *R] {
        part.fill(0.0);
    }
    r.fill(0.0);
    A.copy_from(&from.A);
    Q.copy_from(&from.Q);
    q.copy_from(&from.q);
    B.view_mut((0, 0), (n, nu)).copy_from(&from.B);
    S.view_mut((0, 0), (n, nu)).copy_from(&from.S);
    R.view_mut((0, 0), (nu, nu)).copy_from(&from.R);
    r.rows_mut(0, nu).copy_from(&from.r);
}
