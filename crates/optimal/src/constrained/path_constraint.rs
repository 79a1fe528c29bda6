//! General constraints on states and controls.

use crate::problem::ActionModel;
use crate::problem::differences::FIRST;
use nalgebra::DMatrix;
use std::any::Any;

/// Functions of state and control that must stay within bounds: lower ≤ gₜ(x, u) ≤ upper. A function whose bounds are
/// equal is an equality.
///
/// At a terminal knot u is empty. The rules for [`ActionModel`]s apply here too. With an
/// [`AutoDiffConstraint`](crate::AutoDiffConstraint) no Jacobian needs to be written.
///
/// # Examples
/// The second entry of the state may not exceed 1:
/// ```
/// use condyle_optimal::PathConstraint;
/// use nalgebra::DMatrix;
///
/// struct Slow;
/// impl PathConstraint for Slow {
///     fn size(&self) -> usize { 1 }
///     fn bounds(&self, _: usize) -> (&[f64], &[f64]) { (&[f64::NEG_INFINITY], &[1.0]) }
///     fn calc(&mut self, _: usize, x: &[f64], _: &[f64], g: &mut [f64]) { g[0] = x[1]; }
///     fn calc_diff(&mut self, _: usize, _: &[f64], _: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
///         gx.copy_from_slice(&[0.0, 1.0]);
///         gu.fill(0.0);
///         true
///     }
/// }
/// ```
pub trait PathConstraint: Any + Send + Sync {
    /// Returns the number of functions.
    fn size(&self) -> usize;

    /// Returns the smallest and largest allowed values at knot t, infinite where a function is unbounded. They must not
    /// change during a solve.
    fn bounds(&self, t: usize) -> (&[f64], &[f64]);

    /// Computes gₜ(x, u) into `g`.
    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]);

    /// Computes ∂g/∂x into `gx` (size × ndx), in the tangent space of the state, and ∂g/∂u into `gu` (size × nu).
    /// Returns whether it did so. The default returns false: the solver then takes central differences of
    /// [`calc`](Self::calc), which are slow, allocate, and are accurate to about 1e-9.
    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        let _ = (t, x, u, gx, gu);
        false
    }

    /// Returns a copy that computes the same, as [`ActionModel::try_clone`] does; `None` by default.
    fn try_clone(&self) -> Option<Box<dyn PathConstraint>> {
        None
    }
}

/// Computes ∂g/∂x and ∂g/∂u of an action's constraint by central differences.
pub(super) fn calc_diff(
    action: &dyn ActionModel,
    constraint: &mut dyn PathConstraint,
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
