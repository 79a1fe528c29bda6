//! Gradient of the Lagrangian of the augmented Lagrangian solver.

use super::solution::Solution;
use crate::lq::LqKnot;
use crate::problem::Problem;
use nalgebra::DVector;

/// Gradient of the Lagrangian for one choice of the adjoint states.
pub(super) struct Slopes {
    /// Largest entry, after projection on the bounds of the controls.
    pub(super) dual: f64,
    /// Largest entry without projection, except for controls that are pressed against a bound.
    pub(super) free: f64,
}

/// Computes the gradient of the Lagrangian by the recursion λ = q + Aᵀλ⁺ + Kᵀs, s = r + Bᵀλ⁺, from the LQ knots at a
/// trajectory. The entries for the controls are s, for the states −Kᵀs. The vectors q and r contain the terms yᵀ∂g of
/// the constraints.
///
/// Without feedback, K is zero. An unstable motion then multiplies rounding errors by the largest sensitivity of the
/// states, which can be a million. With the gains K of a sweep, the recursion follows the closed loop, which is stable.
pub(super) fn slopes(
    problem: &Problem,
    knots: &[LqKnot],
    solution: &Solution,
    [lambda, before, of_state]: &mut [DVector<f64>; 3],
    fed_back: bool,
) -> Slopes {
    let horizon = problem.horizon();
    let (mut dual, mut free) = (0.0, 0.0);
    lambda.copy_from(&knots[horizon].q);
    for t in (0..horizon).rev() {
        let knot = &knots[t];
        let u = &solution.us[problem.control_range(t)];
        of_state.fill(0.0);
        for (j, u) in u.iter().enumerate() {
            let slope = knot.r[j] + knot.B.column(j).dot(lambda);
            let (lower, upper) = match problem.action(t).bounds(t) {
                Some((lower, upper)) => (lower[j], upper[j]),
                None => (f64::NEG_INFINITY, f64::INFINITY),
            };
            // at a minimum, u equals u − ∂L/∂u projected on the bounds of u
            let projected = if slope.is_nan() { slope } else { u - (u - slope).min(upper).max(lower) };
            dual = larger(dual, projected.abs());
            if !(*u <= lower && slope > 0.0 || *u >= upper && slope < 0.0) {
                free = larger(free, slope.abs());
            }
            if fed_back {
                of_state.iter_mut().zip(solution.K[t].row(j).iter()).for_each(|(sum, gain)| *sum += gain * projected);
            }
        }
        for entry in of_state.iter() {
            (dual, free) = (larger(dual, entry.abs()), larger(free, entry.abs()));
        }
        before.copy_from(&knot.q);
        before.gemv_tr(1.0, &knot.A, lambda, 1.0);
        *before += &*of_state;
        std::mem::swap(lambda, before);
    }
    Slopes { dual, free }
}

/// Returns the larger of two numbers, or NaN if one of them is NaN.
pub(super) fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}
