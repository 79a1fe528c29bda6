//! Eliminates equalities from a program, so that fewer unknowns remain.
//!
//! Gauss–Jordan elimination with complete pivoting splits x into basic unknowns, one for each independent equality, and the
//! others, z: x_B = p − T z. Equalities that depend on others (redundant contacts, say) have no pivot and are left out.
//! What is then minimised over z, with n_B = number of basic unknowns:
//!
//! ```text
//! ½ ‖(R_N − R_B T) z − (b − R_B p)‖² + …     l − G_B p ≤ (G_N − G_B T) z ≤ u − G_B p     h + F_B p + (F_N − F_B T) z ∈ Q
//! ```
//!
//! Source: Nocedal and Wright, *Numerical Optimization* (2006), section 15.3 (elimination of variables).

use crate::cone_program::{ConeProgram, Size};
use crate::least_squares::LeastSquares;
use condyle_linalg::{
    SLACK, View, add_product_lower, add_scaled_product, max_abs, product_without_slack, subtract_product,
};
use nalgebra::DMatrix;

/// Pivots smaller than this part of the row's largest entry in the beginning say that a row depends on others.
const DEPENDENT: f64 = 1e-8;

/// A pivot of the last tick serves again if it is at least this part of the row's largest entry.
const KEEP: f64 = 0.05;

/// Basic and other unknowns, and the map from z to x.
pub(crate) struct Basis {
    /// Pivots in their order: equality and unknown. Those of the last call are tried first.
    pivots: Vec<(usize, usize)>,
    /// The unknowns in z.
    pub others: Vec<usize>,
    /// T, other × basic, with slack rows.
    T: DMatrix<f64>,
    /// p.
    p: Vec<f64>,
    /// Scratch: the basic columns of some rows. Shape: rows × basic, with slack.
    basic_part: DMatrix<f64>,
}

/// The elimination, with room for the largest program.
pub(crate) struct Elimination {
    /// Scratch: Aᵀ while it is being eliminated. Shape: unknowns × equalities, with slack rows.
    W: DMatrix<f64>,
    /// Scratch: the row of the pivot, and the factor with which each row has it taken off.
    pivot_row: Vec<f64>,
    factors: Vec<f64>,
    right: Vec<f64>,
    /// (equalities, unknowns) of the last call.
    shape: (usize, usize),
    used: Vec<bool>,
    pub basis: Basis,
    /// Scratch: rows of the objective. Shape: other × rows, with slack.
    rows: DMatrix<f64>,
    right_side: Vec<f64>,
    /// Scratch: P, with slack rows.
    P: DMatrix<f64>,
}

impl Elimination {
    /// For programs of at most such a size, and objectives of at most so many rows.
    pub(crate) fn new(capacity: Size, objective: usize) -> Self {
        let Size { unknowns: n, equalities: m, rows, .. } = capacity;
        let tall = n + SLACK;
        let most = objective + m; // a row for each basic unknown's own weight
        Self {
            W: DMatrix::zeros(tall, m + SLACK),
            pivot_row: vec![0.0; tall],
            factors: vec![0.0; m + SLACK],
            right: vec![0.0; m],
            shape: (0, 0),
            used: vec![false; m],
            basis: Basis {
                pivots: Vec::with_capacity(m),
                others: Vec::with_capacity(n),
                T: DMatrix::zeros(tall, m),
                p: vec![0.0; m],
                basic_part: DMatrix::zeros(rows.max(objective) + SLACK, m),
            },
            rows: DMatrix::zeros(tall, most + SLACK),
            right_side: vec![0.0; most],
            P: DMatrix::zeros(tall, tall),
        }
    }

    /// Splits the unknowns by the first `equalities` rows of A x = b. Whether the basis is the one of the call before.
    pub(crate) fn split(&mut self, program: &ConeProgram, equalities: usize) -> bool {
        let n = program.size.unknowns;
        let again = self.shape == (equalities, n) && self.eliminate(program, equalities, true);
        if !again {
            self.eliminate(program, equalities, false);
        }
        self.shape = (equalities, n);
        let Basis { pivots, others, T, p, .. } = &mut self.basis;
        others.clear();
        others.extend((0..n).filter(|j| !pivots.iter().any(|p| p.1 == *j)));
        for (i, &(row, _)) in pivots.iter().enumerate() {
            p[i] = self.right[row];
            let w = self.W.column(row);
            for (z, &j) in others.iter().enumerate() {
                T[(z, i)] = w[j];
            }
        }
        again
    }

    /// Gauss–Jordan elimination; with the pivots of the last call, unless one of them has become too small.
    fn eliminate(&mut self, program: &ConeProgram, m: usize, again: bool) -> bool {
        let Self { W, right, used, pivot_row, factors, basis: Basis { pivots, .. }, .. } = self;
        let (n, stride) = (program.size.unknowns, W.nrows());
        for r in 0..m {
            let row = &program.At.as_slice()[r * program.At.nrows()..][..n];
            let largest = max_abs(row);
            let scale = if largest > 0.0 { 1.0 / largest } else { 0.0 };
            for (w, a) in W.as_mut_slice()[r * stride..].iter_mut().zip(row) {
                *w = scale * a;
            }
            right[r] = scale * program.b[r];
        }
        used[..m].fill(false);
        let steps = if again { pivots.len() } else { m };
        if !again {
            pivots.clear();
        }
        for step in 0..steps {
            let column = |r: usize| &W.as_slice()[r * stride..r * stride + n];
            let (row, j) = if again {
                let (row, j) = pivots[step];
                if column(row)[j].abs() < KEEP * max_abs(column(row)).max(KEEP) {
                    return false;
                }
                (row, j)
            } else {
                let (mut best, mut row) = (DEPENDENT, None);
                for r in (0..m).filter(|&r| !used[r]) {
                    let size = max_abs(column(r));
                    if size > best {
                        (best, row) = (size, Some(r));
                    }
                }
                let Some(row) = row else { break };
                let j = column(row).iter().position(|w| w.abs() >= best).expect("the largest is there");
                pivots.push((row, j));
                (row, j)
            };
            used[row] = true;
            let inverse = 1.0 / W[(j, row)];
            for (p, w) in pivot_row[..n].iter_mut().zip(&W.as_slice()[row * stride..]) {
                *p = inverse * w;
            }
            right[row] *= inverse;
            for r in 0..m {
                factors[r] = W[(j, r)];
                right[r] -= if r == row { 0.0 } else { factors[r] * right[row] };
            }
            // W −= factors ⊗ pivot row; its own row becomes it, and column j the unit vector
            let (a, b) = (View::new(pivot_row, stride), View::new(factors, factors.len()));
            subtract_product(W.as_mut_slice(), stride, [n, m, 1], a, b);
            W.as_mut_slice()[row * stride..][..n].copy_from_slice(&pivot_row[..n]);
            for r in 0..m {
                W[(j, r)] = f64::from(u8::from(r == row));
            }
        }
        // A row that seemed to depend on others may do so no longer.
        !again || (0..m).all(|r| used[r] || max_abs(&W.as_slice()[r * stride..r * stride + n]) <= DEPENDENT)
    }

    /// The program over z of one over x, the first `dense` of whose rows have few zeros, with an objective over x.
    pub(crate) fn condense(
        &mut self,
        full: &ConeProgram,
        dense: usize,
        objective: &LeastSquares,
        out: &mut ConeProgram,
    ) {
        let basis = &mut self.basis;
        out.size = Size { unknowns: basis.others.len(), equalities: 0, ..full.size };
        out.cones.clear();
        out.cones.extend_from_slice(&full.cones);
        basis.map_dense_rows(&full.Gt, dense, &mut out.Gt);
        basis.map_rows(&full.Gt, dense..full.size.rows, &mut out.Gt);
        for r in 0..full.size.rows {
            let at_p = basis.at_particular(&full.Gt, r);
            (out.lower[r], out.upper[r]) = (full.lower[r] - at_p, full.upper[r] - at_p);
        }
        basis.map_rows(&full.Ft, 0..full.size.cone_rows, &mut out.Ft);
        for r in 0..full.size.cone_rows {
            out.h[r] = full.h[r] + basis.at_particular(&full.Ft, r);
        }
        self.objective(objective, out);
    }

    /// P and c of the least squares over z.
    fn objective(&mut self, from: &LeastSquares, out: &mut ConeProgram) {
        let Self { basis, rows, right_side, P, .. } = self;
        let (n, tall) = (basis.others.len(), rows.nrows());
        basis.map_dense_rows(&from.Rt, from.count, rows);
        for r in 0..from.count {
            right_side[r] = from.b[r] - basis.at_particular(&from.Rt, r);
        }
        for (z, &j) in basis.others.iter().enumerate() {
            out.c[z] = from.linear[j];
        }
        let count = from.count + basis.pivots.len();
        for (i, &(_, j)) in basis.pivots.iter().enumerate() {
            // ½ d (pᵢ − Tᵢ z)² + c (pᵢ − Tᵢ z)
            let (root, linear) = (from.diagonal[j].sqrt(), from.linear[j]);
            let T = &basis.T.as_slice()[i * tall..][..n];
            let row = &mut rows.as_mut_slice()[(from.count + i) * tall..][..n];
            for z in 0..n {
                row[z] = -root * T[z];
                out.c[z] -= linear * T[z];
            }
            right_side[from.count + i] = -root * basis.p[i];
        }
        let P = P.as_mut_slice();
        P[..tall * n].fill(0.0);
        let view = View::new(rows.as_slice(), tall);
        add_product_lower(P, tall, [n, n, count], view, view);
        add_scaled_product(&mut out.c[..n], -1.0, view, &right_side[..count]);
        let stride = out.P.nrows();
        for (j, &x) in basis.others.iter().enumerate() {
            out.P.as_mut_slice()[j * stride + j..][..n - j].copy_from_slice(&P[j * tall + j..][..n - j]);
            out.P[(j, j)] += from.diagonal[x];
        }
    }
}

impl Basis {
    /// The row's value at z = 0: G_B p.
    fn at_particular(&self, rows: &DMatrix<f64>, r: usize) -> f64 {
        let row = &rows.as_slice()[r * rows.nrows()..];
        self.pivots.iter().zip(&self.p).map(|(&(_, j), p)| row[j] * p).sum()
    }

    /// (G_N − G_B T)ᵀ, for the first rows, which are columns of `from`.
    fn map_dense_rows(&mut self, from: &DMatrix<f64>, count: usize, to: &mut DMatrix<f64>) {
        let Self { pivots, others, T, basic_part, .. } = self;
        let (stride, ldt, ldb, n) = (from.nrows(), to.nrows(), basic_part.nrows(), others.len());
        for (i, &(_, j)) in pivots.iter().enumerate() {
            for r in 0..count {
                basic_part.as_mut_slice()[i * ldb + r] = from.as_slice()[r * stride + j];
            }
        }
        let (a, b) = (View::new(T.as_slice(), T.nrows()), View::new(basic_part.as_slice(), ldb));
        product_without_slack(to.as_mut_slice(), ldt, [n, count, pivots.len()], a, b);
        for r in 0..count {
            let row = &from.as_slice()[r * stride..][..stride];
            for (z, &j) in to.as_mut_slice()[r * ldt..][..n].iter_mut().zip(others.iter()) {
                *z = row[j] - *z;
            }
        }
    }

    /// The same for rows of which most entries are 0.
    fn map_rows(&self, from: &DMatrix<f64>, rows: core::ops::Range<usize>, to: &mut DMatrix<f64>) {
        let Self { pivots, others, T, .. } = self;
        let (stride, tall, ldt) = (from.nrows(), T.nrows(), to.nrows());
        for r in rows {
            let row = &from.as_slice()[r * stride..][..stride];
            let z = &mut to.as_mut_slice()[r * ldt..][..others.len()];
            for (z, &j) in z.iter_mut().zip(others.iter()) {
                *z = row[j];
            }
            for (i, &(_, j)) in pivots.iter().enumerate() {
                let factor = row[j];
                if factor != 0.0 {
                    for (z, t) in z.iter_mut().zip(&T.as_slice()[i * tall..]) {
                        *z -= factor * t;
                    }
                }
            }
        }
    }

    /// x of z.
    pub(crate) fn expand(&self, z: &[f64], x: &mut [f64]) {
        for (&j, &z) in self.others.iter().zip(z) {
            x[j] = z;
        }
        for (i, &(_, j)) in self.pivots.iter().enumerate() {
            let T = &self.T.as_slice()[i * self.T.nrows()..];
            x[j] = self.p[i] - T.iter().zip(z).map(|(t, z)| t * z).sum::<f64>(); // x_B = p − T z
        }
    }
}
