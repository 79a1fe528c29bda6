//! Derivatives of an action by central differences.

use super::ActionModel;
use crate::lq::LqKnot;
use nalgebra::DMatrix;

/// Step h of first differences, about ε^⅓. This step balances the truncation error h² and the rounding error ε/h.
pub(crate) const FIRST: f64 = 6e-6;

/// Step h of second differences, about ε^¼. This step balances the truncation error h² and the rounding error ε/h².
pub(crate) const SECOND: f64 = 1.2e-4;

/// Computes the next state and the cost ℓ at (x ⊕ δx, u + δu). The argument z contains the changes (δx, δu).
pub(crate) fn at<A: ActionModel + ?Sized>(
    action: &mut A,
    t: usize,
    x: &[f64],
    u: &[f64],
    z: &[f64],
    next: &mut [f64],
) -> f64 {
    let (dx, du) = z.split_at(action.ndx());
    let mut moved = vec![0.0; x.len()];
    action.integrate(x, dx, &mut moved);
    let u: Vec<f64> = u.iter().zip(du).map(|(u, du)| u + du).collect();
    action.calc(t, &moved, &u, next)
}

/// Computes the outputs of [`calc_diff`](ActionModel::calc_diff) by central differences of [`calc`](ActionModel::calc).
pub(crate) fn calc_diff<A: ActionModel + ?Sized>(action: &mut A, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
    let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
    // a terminal action does not write the next state: initialise it with x, which is a valid state on any manifold
    let (mut centre, mut plus, mut minus) = (x.to_vec(), x.to_vec(), x.to_vec());
    let (mut up, mut down) = (vec![0.0; ndx], vec![0.0; ndx]);
    let mut z = vec![0.0; ndx + nu];
    debug_assert_eq!(x.len(), nx);
    at(action, t, x, u, &z, &mut centre);

    for j in 0..ndx + nu {
        z[j] = FIRST;
        let above = at(action, t, x, u, &z, &mut plus);
        z[j] = -FIRST;
        let below = at(action, t, x, u, &z, &mut minus);
        z[j] = 0.0;
        // ∂x⁺/∂zⱼ = ((x⁺(h) ⊖ x⁺) − (x⁺(−h) ⊖ x⁺)) / 2h, ∂ℓ/∂zⱼ = (ℓ(h) − ℓ(−h)) / 2h, with ±h added to zⱼ
        action.difference(&centre, &plus, &mut up);
        action.difference(&centre, &minus, &mut down);
        for i in 0..ndx {
            let slope = (up[i] - down[i]) / (2.0 * FIRST);
            if j < ndx { knot.A[(i, j)] = slope } else { knot.B[(i, j - ndx)] = slope }
        }
        let slope = (above - below) / (2.0 * FIRST);
        if j < ndx { knot.q[j] = slope } else { knot.r[j - ndx] = slope }
    }

    for i in 0..ndx + nu {
        for j in 0..=i {
            // ∂²ℓ/∂zᵢ∂zⱼ = (ℓ(h, h) − ℓ(h, −h) − ℓ(−h, h) + ℓ(−h, −h)) / 4h², with ±h added to zᵢ and zⱼ
            let mut sum = 0.0;
            for (si, sj) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                z[i] += si * SECOND;
                z[j] += sj * SECOND;
                sum += si * sj * at(action, t, x, u, &z, &mut plus);
                z[i] = 0.0;
                z[j] = 0.0;
            }
            let curvature = sum / (4.0 * SECOND * SECOND);
            write_curvature([&mut knot.Q, &mut knot.S, &mut knot.R], ndx, (i, j), curvature);
        }
    }
}

/// Writes the second derivative with respect to entries i ≥ j of z = (δx, δu) to its block of the Hessian. The block is
/// xx if both entries belong to δx, uu if both belong to δu, and xu otherwise.
pub(crate) fn write_curvature(
    [xx, xu, uu]: [&mut DMatrix<f64>; 3],
    ndx: usize,
    (i, j): (usize, usize),
    curvature: f64,
) {
    match (i < ndx, j < ndx) {
        (true, _) => (xx[(i, j)], xx[(j, i)]) = (curvature, curvature),
        (false, true) => xu[(j, i - ndx)] = curvature,
        (false, false) => (uu[(i - ndx, j - ndx)], uu[(j - ndx, i - ndx)]) = (curvature, curvature),
    }
}
