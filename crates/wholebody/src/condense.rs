//! Eliminates equalities from a program, so that fewer unknowns remain.
//!
//! Gauss–Jordan elimination with complete pivoting splits x into basic unknowns x_B and other unknowns z. There is one
//! basic unknown for each independent equality: x_B = p − T z. Equalities that depend on others (for example redundant
//! contacts) have no pivot and are left out. Index B marks columns of basic unknowns, and index N marks the other
//! columns. The program over z:
//!
//! ```text
//! minimise     ½ ‖(R_N − R_B T) z − (b − R_B p)‖² + …
//! subject to   l − G_B p ≤ (G_N − G_B T) z ≤ u − G_B p
//!              h + F_B p + (F_N − F_B T) z ∈ Q
//! ```
//!
//! Source: Nocedal and Wright, *Numerical Optimization* (2006), section 15.3 (elimination of variables).

use crate::basis::{Basis, Elimination};
use crate::cone_program::{ConeProgram, Size};
use crate::least_squares::LeastSquares;
use crate::warm_start::Places;
use condyle_linalg::{SLACK, View, add_product_lower, add_scaled_product};
use nalgebra::DMatrix;

/// Known structure of a program. The rows of G come in three groups: rows with few zeros, rows that bound one unknown,
/// and all other rows.
#[derive(Clone, Copy)]
pub(crate) struct Known<'a> {
    /// Number of rows with few zeros.
    pub dense: usize,
    /// Unknown of each row that bounds a single unknown.
    pub single: &'a [usize],
    /// Indices of the unknowns and constraints in use.
    pub places: &'a Places,
}

/// Elimination of the equalities in the program of one priority. Its memory suffices for the largest program.
pub(crate) struct Condenser {
    pub elimination: Elimination,
    pub basis: Basis,
    /// Scratch: rows of the objective. Shape: number of other unknowns × rows, with padding.
    rows: DMatrix<f64>,
    right_side: Vec<f64>,
    /// Scratch: P, with padding rows.
    P: DMatrix<f64>,
    /// Scratch: values of the rows at z = 0.
    particular: Vec<f64>,
    /// Scratch: values of the other unknowns z.
    z: Vec<f64>,
}

impl Condenser {
    /// Allocates memory for programs up to this size and objectives up to this number of rows.
    pub(crate) fn new(capacity: Size, objective: usize) -> Self {
        let Size { unknowns, equalities, rows, .. } = capacity;
        let tall = unknowns + SLACK;
        let most = objective + equalities; // plus one row for the diagonal cost of each basic unknown
        Self {
            elimination: Elimination::new(unknowns, equalities),
            basis: Basis::new(unknowns, equalities, rows.max(objective)),
            rows: DMatrix::zeros(tall, most + SLACK),
            right_side: vec![0.0; most],
            P: DMatrix::zeros(tall, tall),
            particular: vec![0.0; rows.max(objective) + 4 * SLACK],
            z: vec![0.0; unknowns],
        }
    }

    /// Writes a program over z to `out`. The written program is equivalent to the program `full` over x with the given
    /// objective.
    pub(crate) fn condense(
        &mut self,
        full: &ConeProgram,
        known: Known<'_>,
        objective: &LeastSquares,
        out: &mut ConeProgram,
    ) {
        self.elimination.split(full, &mut self.basis);
        let Self { basis, particular, .. } = self;
        out.size = Size { unknowns: basis.others.len(), equalities: 0, ..full.size };
        out.cones.clear();
        out.cones.extend_from_slice(&full.cones);

        basis.map_dense_rows(&full.Gt, known.dense, &mut out.Gt, particular);
        let bound = |out: &mut ConeProgram, r: usize, at_p: f64| {
            (out.lower[r], out.upper[r]) = (full.lower[r] - at_p, full.upper[r] - at_p);
        };
        for r in 0..known.dense {
            bound(out, r, particular[r]);
        }
        for (k, &unknown) in known.single.iter().enumerate() {
            let at_p = basis.map_single_row(unknown, &mut out.Gt, known.dense + k);
            bound(out, known.dense + k, at_p);
        }
        for r in known.dense + known.single.len()..full.size.rows {
            let at_p = basis.map_row(&full.Gt, r, &mut out.Gt);
            bound(out, r, at_p);
        }
        for r in 0..full.size.cone_rows {
            out.h[r] = full.h[r] + basis.map_row(&full.Ft, r, &mut out.Ft);
        }
        self.objective(objective, out);
    }

    /// Returns z, the entries of x that are not basic unknowns.
    pub(crate) fn reduce(&mut self, x: &[f64]) -> &[f64] {
        let z = &mut self.z[..self.basis.others.len()];
        for (z, &j) in z.iter_mut().zip(&self.basis.others) {
            *z = x[j];
        }
        z
    }

    /// Computes the cost matrix P and the cost vector c of the least-squares objective over z.
    fn objective(&mut self, from: &LeastSquares, out: &mut ConeProgram) {
        let Self { basis, rows, right_side, P, particular, .. } = self;
        let (n, tall) = (basis.others.len(), rows.nrows());
        basis.map_dense_rows(&from.Rt, from.count, rows, particular);
        for r in 0..from.count {
            right_side[r] = from.b[r] - particular[r];
        }
        for (z, &j) in basis.others.iter().enumerate() {
            out.c[z] = from.linear[j];
        }
        for (i, &j) in basis.basic.iter().enumerate() {
            // ½ d (pᵢ − Tᵢ z)² + c (pᵢ − Tᵢ z)
            let (root, linear, T) = (from.diagonal[j].sqrt(), from.linear[j], basis.column(i));
            let row = &mut rows.as_mut_slice()[(from.count + i) * tall..][..n];
            for z in 0..n {
                row[z] = -root * T[z];
                out.c[z] -= linear * T[z];
            }
            right_side[from.count + i] = -root * basis.p[i];
        }
        let (count, P) = (from.count + basis.basic.len(), P.as_mut_slice());
        P[..tall * n].fill(0.0);
        let view = View::new(rows.as_slice(), tall);
        add_product_lower(P, tall, [n, n, count], view, view);
        add_scaled_product(&mut out.c[..n], -1.0, view, &right_side[..count]);
        let stride = out.P.nrows();
        for (j, &x) in basis.others.iter().enumerate() {
            out.P.as_mut_slice()[j * stride + j..][..n - j].copy_from_slice(&P[j * tall + j..][..n - j]);
            out.P.as_mut_slice()[j * stride + j] += from.diagonal[x];
        }
    }
}
