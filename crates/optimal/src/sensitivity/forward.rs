//! Derivatives of states and controls with respect to a parameter.

use super::parameters::ParameterJacobian;
use super::point::Point;
use super::system::{System, Vectors};
use crate::error::Error;
use nalgebra::DMatrix;

/// Derivatives of all states and controls of a solution with respect to the entries of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct SolutionJacobian {
    /// Derivatives of the states in the tangent space, (N + 1) · ndx rows, with a column for each entry.
    pub xs: DMatrix<f64>,
    /// Derivatives of the controls, one after the other, with a column for each entry.
    pub us: DMatrix<f64>,
}

/// Solves the linearised optimality conditions for each entry of a parameter.
pub(super) fn run(
    point: &Point,
    system: &mut System,
    parameter: &ParameterJacobian,
) -> Result<SolutionJacobian, Error> {
    let (shape, size) = (&point.shape, parameter.size());
    let (mut given, mut out) = (Vectors::zeros(point), Vectors::zeros(point));
    let mut found =
        SolutionJacobian { xs: DMatrix::zeros(given.x.len(), size), us: DMatrix::zeros(given.u.len(), size) };
    for j in 0..size {
        given.clear();
        // g = −∂(∇L)/∂p, e = ∂φ/∂p, c = ∂g/∂p
        let moves = parameter.write_column(j, shape, &mut given);
        for (t, (active, moves)) in point.controls.iter().zip(&moves).enumerate() {
            let knot = &point.knots[t];
            for (&(i, _), &du) in active.iter().zip(moves).filter(|(_, du)| **du != 0.0) {
                // the columns of a control at a bound, which moves with the bound
                for (e, B) in given.dynamics[shape.dx(t + 1)].iter_mut().zip(&knot.B.column(i)) {
                    *e += B * du;
                }
                for (g, S) in given.x[shape.dx(t)].iter_mut().zip(&knot.S.column(i)) {
                    *g -= S * du;
                }
                for (g, R) in given.u[shape.u(t)].iter_mut().zip(&knot.R.column(i)) {
                    *g -= R * du;
                }
                given.rows[t].axpy(du, &point.rows[t].D.column(i), 1.0);
            }
            for &(i, _) in active {
                given.u[shape.offsets[t] + i] = 0.0;
            }
        }
        system.solve(&given, &mut out)?;
        for (t, (active, moves)) in point.controls.iter().zip(&moves).enumerate() {
            for (&(i, _), &du) in active.iter().zip(moves) {
                out.u[shape.offsets[t] + i] = du;
            }
        }
        found.xs.column_mut(j).copy_from_slice(&out.x);
        found.us.column_mut(j).copy_from_slice(&out.u);
    }
    Ok(found)
}
