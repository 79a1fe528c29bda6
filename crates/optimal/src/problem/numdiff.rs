//! Derivatives of any action by finite differences, as a reference for tests of hand-written derivatives.

use super::action::ActionModel;
use super::action::differences::{SECOND, at, calc_diff, write_curvature};
use crate::lq::{Hessian, LqKnot};

/// Action that differentiates another action by central differences of [`calc`](ActionModel::calc), taken with ⊕ and ⊖.
/// The derivatives of the other action itself are not used.
///
/// First derivatives are accurate to about 1e-9, second derivatives to about 1e-7 (relative to the size of cost and
/// state). The Hessian is exact up to these errors; a Gauss–Newton approximation differs from it if the residuals are
/// nonlinear. `NumDiff` is meant for tests: its derivatives take 2 (ndx + nu) + 2 (ndx + nu)² calls of `calc`, and
/// allocate.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, LqKnot, NumDiff};
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
/// let mut knot = LqKnot::zeros(2, 1);
/// NumDiff(Pendulum).calc_diff(0, &[0.3, 0.0], &[0.0], &mut knot);
/// assert!((knot.A[(1, 0)] + 0.1 * 0.3_f64.cos()).abs() < 1e-9);
/// assert!((knot.Q[(0, 0)] - 0.3_f64.cos()).abs() < 1e-6);
/// ```
#[derive(Debug, Clone)]
pub struct NumDiff<A>(
    /// Action that is differentiated.
    pub A,
);

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

    fn inner_mut(&mut self) -> Option<&mut dyn ActionModel> {
        Some(&mut self.0)
    }

    fn is_terminal(&self) -> bool {
        self.0.is_terminal()
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

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        calc_diff(&mut self.0, t, x, u, knot);
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
                let Hessian { xx, xu, uu } = hessian;
                write_curvature([xx, xu, uu], ndx, (i, j), curvature);
            }
        }
        true
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        self.0.check_state(x)
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.0.integrate(x, dx, out)
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.0.difference(x0, x1, out)
    }
}
