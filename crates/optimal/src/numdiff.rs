//! Derivatives of any action by finite differences: the oracle against which written derivatives are tested.

use crate::action::ActionModel;
use crate::constrained::Constraint;
use crate::lq::{Hessian, LqNode};
use nalgebra::DMatrix;

/// The step of first differences, about ε^⅓: truncation h² meets rounding ε/h.
const FIRST: f64 = 6e-6;

/// The step of second differences, about ε^¼: truncation h² meets rounding ε/h².
const SECOND: f64 = 1.2e-4;

/// An action whose derivatives, whatever it has of its own, are central differences of [`calc`](ActionModel::calc), taken
/// with ⊕ and ⊖.
///
/// First derivatives are right to about 1e-9, second ones to about 1e-7 (relative to the size of cost and state). The
/// Hessian is the exact one: an action that gives a Gauss–Newton approximation differs from it where the residuals
/// curve. Costs 2 (ndx + nu) + 2 (ndx + nu)² calls and allocates: for tests.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, LqNode, NumDiff};
///
/// struct Pendulum;
/// impl ActionModel for Pendulum {
///     fn nx(&self) -> usize { 2 }
///     fn nu(&self) -> usize { 1 }
///     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
///         next[0] = x[0] + 0.1 * x[1];
///         next[1] = x[1] + 0.1 * (u[0] - x[0].sin());
///         1.0 - x[0].cos() + 0.5 * u[0] * u[0]
///     }
/// }
///
/// let mut node = LqNode::zeros(2, 1);
/// NumDiff(Pendulum).calc_diff(0, &[0.3, 0.0], &[0.0], &mut node);
/// assert!((node.A[(1, 0)] + 0.1 * 0.3_f64.cos()).abs() < 1e-9);
/// assert!((node.Q[(0, 0)] - 0.3_f64.cos()).abs() < 1e-6);
/// ```
#[derive(Debug, Clone)]
pub struct NumDiff<A>(
    /// The action that is differentiated.
    pub A,
);

/// x⁺ and ℓ at (x ⊕ δx, u + δu) with z = (δx, δu).
fn at<A: ActionModel + ?Sized>(action: &mut A, t: usize, x: &[f64], u: &[f64], z: &[f64], next: &mut [f64]) -> f64 {
    let (dx, du) = z.split_at(action.ndx());
    let mut moved = vec![0.0; x.len()];
    action.integrate(x, dx, &mut moved);
    let u: Vec<f64> = u.iter().zip(du).map(|(u, du)| u + du).collect();
    action.calc(t, &moved, &u, next)
}

/// [`calc_diff`](ActionModel::calc_diff) by differences of [`calc`](ActionModel::calc).
pub(crate) fn calc_diff<A: ActionModel + ?Sized>(action: &mut A, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
    let (nx, ndx, nu) = (action.nx(), action.ndx(), action.nu());
    // A terminal action leaves `next` alone: start from x, which is a state on any manifold.
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
        // ∂x⁺/∂zⱼ = ((x⁺(h) ⊖ x⁺) − (x⁺(−h) ⊖ x⁺)) / 2h,   ∂ℓ/∂zⱼ = (ℓ(h) − ℓ(−h)) / 2h
        action.difference(&centre, &plus, &mut up);
        action.difference(&centre, &minus, &mut down);
        for i in 0..ndx {
            let slope = (up[i] - down[i]) / (2.0 * FIRST);
            if j < ndx { node.A[(i, j)] = slope } else { node.B[(i, j - ndx)] = slope }
        }
        let slope = (above - below) / (2.0 * FIRST);
        if j < ndx { node.q[j] = slope } else { node.r[j - ndx] = slope }
    }

    for i in 0..ndx + nu {
        for j in 0..=i {
            // ∂²ℓ/∂zᵢ∂zⱼ = (ℓ(h, h) − ℓ(h, −h) − ℓ(−h, h) + ℓ(−h, −h)) / 4h²
            let mut sum = 0.0;
            for (si, sj) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                z[i] += si * SECOND;
                z[j] += sj * SECOND;
                sum += si * sj * at(action, t, x, u, &z, &mut plus);
                z[i] = 0.0;
                z[j] = 0.0;
            }
            let curvature = sum / (4.0 * SECOND * SECOND);
            match (i < ndx, j < ndx) {
                (true, _) => (node.Q[(i, j)], node.Q[(j, i)]) = (curvature, curvature),
                (false, true) => node.S[(j, i - ndx)] = curvature,
                (false, false) => (node.R[(i - ndx, j - ndx)], node.R[(j - ndx, i - ndx)]) = (curvature, curvature),
            }
        }
    }
}

/// The derivatives of a constraint of an action by differences.
pub(crate) fn constraint(
    action: &dyn ActionModel,
    constraint: &mut dyn Constraint,
    t: usize,
    x: &[f64],
    u: &[f64],
    [gx, gu]: [&mut DMatrix<f64>; 2],
) {
    let (ndx, size) = (action.ndx(), constraint.size());
    let (mut moved, mut dx, mut du) = (x.to_vec(), vec![0.0; ndx], u.to_vec());
    let mut sides = [vec![0.0; size], vec![0.0; size]];
    for j in 0..ndx + u.len() {
        for (g, step) in sides.iter_mut().zip([FIRST, -FIRST]) {
            if j < ndx {
                dx[j] = step;
                action.integrate(x, &dx, &mut moved);
                constraint.calc(t, &moved, u, g);
                dx[j] = 0.0;
            } else {
                du[j - ndx] = u[j - ndx] + step;
                constraint.calc(t, x, &du, g);
                du[j - ndx] = u[j - ndx];
            }
        }
        for i in 0..size {
            let slope = (sides[0][i] - sides[1][i]) / (2.0 * FIRST);
            if j < ndx { gx[(i, j)] = slope } else { gu[(i, j - ndx)] = slope }
        }
    }
}

impl<A: ActionModel> ActionModel for NumDiff<A> {
    fn nx(&self) -> usize {
        self.0.nx()
    }

    fn ndx(&self) -> usize {
        self.0.ndx()
    }

    fn nu(&self) -> usize {
        self.0.nu()
    }

    fn bounds(&self, t: usize) -> Option<(&[f64], &[f64])> {
        self.0.bounds(t)
    }

    fn shift(&mut self) {
        self.0.shift();
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        self.0.calc(t, x, u, next)
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        calc_diff(&mut self.0, t, x, u, node);
    }

    fn dynamics_hessian(&mut self, t: usize, x: &[f64], u: &[f64], lambda: &[f64], hessian: &mut Hessian) -> bool {
        let (ndx, nu) = (self.ndx(), self.nu());
        let (mut centre, mut moved) = (x.to_vec(), x.to_vec());
        let (mut z, mut change) = (vec![0.0; ndx + nu], vec![0.0; ndx]);
        at(&mut self.0, t, x, u, &z, &mut centre);
        for i in 0..ndx + nu {
            for j in 0..=i {
                let mut sum = 0.0;
                for (si, sj) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
                    z[i] += si * SECOND;
                    z[j] += sj * SECOND;
                    at(&mut self.0, t, x, u, &z, &mut moved);
                    self.0.difference(&centre, &moved, &mut change);
                    sum += si * sj * lambda.iter().zip(&change).map(|(l, c)| l * c).sum::<f64>();
                    (z[i], z[j]) = (0.0, 0.0);
                }
                let curvature = sum / (4.0 * SECOND * SECOND);
                match (i < ndx, j < ndx) {
                    (true, _) => (hessian.xx[(i, j)], hessian.xx[(j, i)]) = (curvature, curvature),
                    (false, true) => hessian.xu[(j, i - ndx)] = curvature,
                    (false, false) => {
                        (hessian.uu[(i - ndx, j - ndx)], hessian.uu[(j - ndx, i - ndx)]) = (curvature, curvature);
                    }
                }
            }
        }
        true
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.0.integrate(x, dx, out)
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.0.difference(x0, x1, out)
    }
}
