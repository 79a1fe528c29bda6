//! Program with additional unknowns r and t. These unknowns replace R x in the objective and the rows G_d x in the
//! constraints, whose matrices R and G_d have few zeros. The matrices of the program are then sparse.
//!
//! ```text
//! minimise     ½ ‖r‖² + ½ Σ dᵢ xᵢ² + cᵀ x                over (x, r, t)
//! subject to   R x − r = b,  G_d x − t = 0,  l ≤ t ≤ u,  and the equalities, the other rows and the cones of x
//! ```
//!
//! The product RᵀR is not formed, and a row with two bounds is stored once. The multipliers of rows and cones are the
//! same as in the original program.

use crate::condense::Known;
use crate::cone_program::{ConeProgram, Size};
use crate::least_squares::LeastSquares;

/// Program in lifted form, with memory for the largest program.
pub(crate) struct Lifted {
    pub program: ConeProgram,
}

impl Lifted {
    /// Allocates memory for programs up to the size `capacity` and objectives of up to `objective` rows. The first
    /// `dense` rows of a program have few zeros.
    pub(crate) fn new(capacity: Size, dense: usize, objective: usize) -> Self {
        let more = dense + objective;
        let capacity = Size { unknowns: capacity.unknowns + more, equalities: capacity.equalities + more, ..capacity };
        Self { program: ConeProgram::new(capacity) }
    }

    /// Writes the lifted form of a program over x with an objective over x.
    pub(crate) fn write(&mut self, full: &ConeProgram, known: Known<'_>, objective: &LeastSquares) {
        let to = &mut self.program;
        let (Size { unknowns: n, equalities, rows, cone_rows }, most) = (full.size, full.c.len());
        let (first_r, first_t) = (n, n + objective.count);
        let all = first_t + known.dense;
        to.size = Size { unknowns: all, equalities: equalities + all - n, rows, cone_rows };
        to.cones.clear();
        to.cones.extend_from_slice(&full.cones);

        for j in 0..all {
            let column = &mut to.P.as_mut_slice()[j * to.c.len()..][j..all];
            column.fill(0.0);
            column[0] = if j < n { objective.diagonal[j] } else { f64::from(u8::from(j < first_t)) };
        }
        to.c[..n].copy_from_slice(&objective.linear[..n]);
        to.c[n..all].fill(0.0);

        let copy = |to: &mut [f64], from: &[f64]| {
            to[..n].copy_from_slice(from);
            to[n..all].fill(0.0);
        };
        for i in 0..equalities {
            copy(to.equality_mut(i), &full.At.as_slice()[i * most..][..n]);
        }
        to.b[..equalities].copy_from_slice(&full.b[..equalities]);
        for (i, R) in objective.Rt.as_slice().chunks_exact(most.max(1)).take(objective.count).enumerate() {
            let e = equalities + i;
            let coefficients = to.equality_mut(e);
            copy(coefficients, &R[..n]);
            coefficients[first_r + i] = -1.0; // R x − r = b
            to.b[e] = objective.b[i];
        }
        for i in 0..rows {
            let G = &full.Gt.as_slice()[i * most..][..n];
            if i < known.dense {
                let e = equalities + objective.count + i;
                let coefficients = to.equality_mut(e);
                copy(coefficients, G);
                coefficients[first_t + i] = -1.0; // G x − t = 0
                to.b[e] = 0.0;
                let coefficients = &mut to.row_mut(i)[..all];
                coefficients.fill(0.0);
                coefficients[first_t + i] = 1.0;
            } else {
                copy(to.row_mut(i), G);
            }
        }
        to.lower[..rows].copy_from_slice(&full.lower[..rows]);
        to.upper[..rows].copy_from_slice(&full.upper[..rows]);
        for i in 0..cone_rows {
            copy(to.cone_row_mut(i), &full.Ft.as_slice()[i * most..][..n]);
        }
        to.h[..cone_rows].copy_from_slice(&full.h[..cone_rows]);
    }
}
