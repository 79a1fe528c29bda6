//! Path constraints of a robot from user-defined residuals.

use super::residuals::own::OwnResidual;
use crate::PathConstraint;
use crate::error::Error;
use crate::problem::leave_a_value;
use nalgebra::DMatrix;

/// [`PathConstraint`] lower ≤ r(t, x, u) ≤ upper for a user-defined residual r, with the same bounds at every knot. Use
/// this constraint for actions that are not knots of a robot. For knots of a robot, a [`Limit`](crate::robot::Limit) of
/// the same residual is faster.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_optimal::robot::{FreeDynamics, GenericResidual, OwnConstraint, OwnResidual, RobotState};
/// use condyle_optimal::Constrained;
/// use condyle_spatial::Scalar;
/// use std::sync::Arc;
///
/// /// The power of all motors, uᵀv.
/// struct Power;
/// impl GenericResidual for Power {
///     fn size(&self) -> usize { 1 }
///     fn calc<S: Scalar>(&self, state: &mut RobotState<'_, S>, r: &mut [S]) {
///         r[0] = S::zero();
///         state.u.iter().zip(state.v).for_each(|(&u, &v)| r[0] += u * v);
///     }
/// }
///
/// let arm = Arc::new(robots::arm7());
/// let power = OwnConstraint::new(OwnResidual::autodiff(arm.clone(), Power), vec![-200.0], vec![200.0])?;
/// let knot = Constrained::new(Box::new(FreeDynamics::running(arm, 0.02, vec![])?), Box::new(power));
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct OwnConstraint {
    residual: OwnResidual,
    lower: Vec<f64>,
    upper: Vec<f64>,
    /// Jacobian ∂r/∂x, then ∂r/∂u, row after row. Written by: `calc_diff`.
    slopes: [Vec<f64>; 2],
}

impl OwnConstraint {
    /// Creates the constraint lower ≤ r ≤ upper, with infinite bounds where r is unbounded.
    ///
    /// # Errors
    /// [`Error::Length`] if the length of a bound differs from the number of entries of r; [`Error::Constraint`] if no
    /// value satisfies the bounds of an entry.
    pub fn new(residual: OwnResidual, lower: Vec<f64>, upper: Vec<f64>) -> Result<Self, Error> {
        for (name, bound) in [("lower", &lower), ("upper", &upper)] {
            if bound.len() != residual.size() {
                return Err(Error::Length { name, expected: residual.size(), found: bound.len() });
            }
        }
        for (row, (&lower, &upper)) in lower.iter().zip(&upper).enumerate() {
            if !leave_a_value(lower, upper) {
                return Err(Error::Constraint { knot: 0, row, lower, upper });
            }
        }
        Ok(Self { residual, lower, upper, slopes: [Vec::new(), Vec::new()] })
    }

    /// Creates the constraint r = 0.
    pub fn equality(residual: OwnResidual) -> Self {
        let zeros = vec![0.0; residual.size()];
        Self { residual, lower: zeros.clone(), upper: zeros, slopes: [Vec::new(), Vec::new()] }
    }
}

impl PathConstraint for OwnConstraint {
    fn size(&self) -> usize {
        self.residual.size()
    }

    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        self.residual.calc(t, x, u, g);
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        let [by_x, by_u] = &mut self.slopes;
        for (rows, J) in [(&mut *by_x, &*gx), (&mut *by_u, &*gu)] {
            rows.clear();
            rows.resize(J.len(), 0.0);
        }
        self.residual.calc_diff(t, x, u, by_x, by_u);
        for (J, rows) in [(gx, by_x), (gu, by_u)] {
            let columns = J.ncols();
            for (k, mut column) in J.column_iter_mut().enumerate() {
                column.iter_mut().zip(rows.iter().skip(k).step_by(columns)).for_each(|(to, slope)| *to = *slope);
            }
        }
        true
    }

    fn try_clone(&self) -> Option<Box<dyn PathConstraint>> {
        Some(Box::new(self.clone()))
    }
}
