//! Second derivatives of the Lagrangian of each knot.

use super::point::Point;
use super::wrong;
use crate::error::Error;
use crate::lq::Hessian;
use crate::problem::Problem;
use nalgebra::DMatrix;

/// Step of central differences, where truncation and rounding errors of a function of size 1 are about equal.
const STEP: f64 = 6e-6;

/// Adds the second derivatives of the dynamics to the Hessians of all knots.
pub(super) fn add_dynamics(problem: &mut Problem, point: &mut Point) -> Result<(), Error> {
    let shape = &point.shape;
    for t in 0..shape.horizon() {
        let (knot, lambda) = (&mut point.knots[t], &point.lambda[t + 1]);
        let mut hessian = Hessian::zeros(knot.ndx(), knot.nu());
        let (x, u) = (&point.xs[shape.x(t)], &point.us[shape.u(t)]);
        if !problem.action_mut(t).dynamics_hessian(t, x, u, lambda.as_slice(), &mut hessian) {
            return Err(wrong(format!(
                "knot {t} does not have second derivatives of its dynamics; expected curvature `exact` or \
                 `gauss_newton`"
            )));
        }
        knot.Q += hessian.xx;
        knot.S += hessian.xu;
        knot.R += hessian.uu;
    }
    Ok(())
}

/// Replaces the Hessians of all knots by central differences of the gradients ∇Lₜ(x ⊕ δx, u + δu).
///
/// The gradients are expressed in the tangent space at x ⊕ δx instead of x. The Jacobians of ⊕ and ⊖ between the two
/// are E = 1 − ½ ad(δx) + O(δx²). Their first-order terms add the Lie brackets ½ ∇Lᵀ[δx, ε] to the second derivatives
/// along δx and ε. Brackets are antisymmetric, so the symmetric part of the differences is the Hessian.
pub(super) fn write_exact(problem: &mut Problem, point: &mut Point) {
    let shape = point.shape.clone();
    let (horizon, ndx) = (shape.horizon(), shape.ndx);
    let most = (0..horizon).map(|t| shape.nu(t)).max().unwrap_or(0);
    let size = |t: usize| ndx + shape.nu(t);
    let mut all: Vec<DMatrix<f64>> = (0..=horizon).map(|t| DMatrix::zeros(size(t), size(t))).collect();
    let mut scratch = problem.lq_knots();
    let (mut xs, mut us, mut change) = (point.xs.clone(), point.us.clone(), vec![0.0; ndx]);
    for j in 0..ndx + most {
        let mut steps = vec![STEP; horizon + 1];
        let mut sides = [STEP, -STEP].map(|h| {
            xs.copy_from_slice(&point.xs);
            us.copy_from_slice(&point.us);
            for t in 0..=horizon {
                if j < ndx {
                    change[j] = h;
                    problem.action(t).integrate(&point.xs[shape.x(t)], &change, &mut xs[shape.x(t)]);
                    change[j] = 0.0;
                } else if j < size(t) {
                    // a step that is proportional to a large control, and the difference that was really taken
                    let (k, u) = (shape.offsets[t] + j - ndx, point.us[shape.offsets[t] + j - ndx]);
                    us[k] = u + h * u.abs().max(1.0);
                    steps[t] = (us[k] - u).abs();
                }
            }
            point.gradients(problem, [&xs, &us], &mut scratch)
        });
        let [above, below] = &mut sides;
        for t in 0..=horizon {
            if j < size(t) {
                above[t] -= &below[t];
                all[t].column_mut(j).copy_from(&(&above[t] / (2.0 * steps[t])));
            }
        }
    }
    for (knot, H) in point.knots.iter_mut().zip(&all) {
        let (n, m) = (ndx, knot.nu());
        let H = (H + H.transpose()) * 0.5;
        knot.Q.copy_from(&H.view((0, 0), (n, n)));
        knot.S.copy_from(&H.view((0, n), (n, m)));
        knot.R.copy_from(&H.view((n, n), (m, m)));
    }
}
