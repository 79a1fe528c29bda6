//! Objective of the form ½ ‖R x − b‖² + ½ Σ dᵢ xᵢ² + cᵀ x: rows R with right sides b, and diagonal and linear terms of
//! the unknowns x.

use crate::cone_program::ConeProgram;
use nalgebra::DMatrix;

/// Objective of one priority, with memory for all tasks and unknowns.
#[derive(Clone, Debug)]
pub(crate) struct LeastSquares {
    /// Rᵀ, with a column for each row of R. Each column is multiplied by √w, where w is the weight of the row's task.
    pub Rt: DMatrix<f64>,
    /// Right side b. Each entry is multiplied by √w, where w is the weight of the row's task.
    pub b: Vec<f64>,
    /// Number of rows in use.
    pub count: usize,
    /// Diagonal d of the terms ½ Σ dᵢ xᵢ².
    pub diagonal: Vec<f64>,
    /// Vector c of the linear term cᵀ x.
    pub linear: Vec<f64>,
    /// Unknowns with a cost dᵢ xᵢ² from a task, and not only from the regularisation.
    pub single: Vec<usize>,
    /// Number of unknowns.
    unknowns: usize,
}

impl LeastSquares {
    pub(crate) fn new(unknowns: usize, rows: usize) -> Self {
        Self {
            Rt: DMatrix::zeros(unknowns, rows),
            b: vec![0.0; rows],
            count: 0,
            diagonal: vec![0.0; unknowns],
            linear: vec![0.0; unknowns],
            single: Vec::with_capacity(unknowns),
            unknowns,
        }
    }

    /// Removes all rows and sets the number of unknowns.
    pub(crate) fn clear(&mut self, unknowns: usize) {
        self.count = 0;
        self.unknowns = unknowns;
        self.diagonal[..unknowns].fill(0.0);
        self.linear[..unknowns].fill(0.0);
        self.single.clear();
    }

    /// Adds the term ½ w (r x − b)² with the weight w and the row r; `fill` writes r into a slice of zeros.
    pub(crate) fn add_row(&mut self, weight: f64, b: f64, fill: impl FnOnce(&mut [f64])) {
        let root = weight.sqrt();
        let stride = self.Rt.nrows();
        let row = &mut self.Rt.as_mut_slice()[self.count * stride..][..self.unknowns];
        row.fill(0.0);
        fill(row);
        for x in row {
            *x *= root;
        }
        self.b[self.count] = root * b;
        self.count += 1;
    }

    /// Adds the term ½ w (x_i − a)² with the weight w, up to a constant.
    pub(crate) fn add_single(&mut self, i: usize, weight: f64, a: f64) {
        self.diagonal[i] += weight;
        self.linear[i] -= weight * a;
    }

    /// Writes the cost P and c of a program with the same unknowns.
    pub(crate) fn write(&self, program: &mut ConeProgram) {
        let n = self.unknowns;
        for j in 0..n {
            program.P.column_mut(j).rows_mut(j, n - j).fill(0.0);
            program.P[(j, j)] = self.diagonal[j];
        }
        program.c[..n].copy_from_slice(&self.linear[..n]);
        for (row, &b) in self.Rt.column_iter().zip(&self.b).take(self.count) {
            for j in 0..n {
                if row[j] == 0.0 {
                    continue;
                }
                program.P.column_mut(j).rows_mut(j, n - j).axpy(row[j], &row.rows(j, n - j), 1.0);
                program.c[j] -= row[j] * b;
            }
        }
    }
}

/// Returns Σ xᵢ yᵢ over the entries of y, computed with eight partial sums. y must not be longer than x.
pub(crate) fn dot(x: &[f64], y: &[f64]) -> f64 {
    let x = &x[..y.len()];
    let ((xs, x), (ys, y)) = (x.as_chunks::<8>(), y.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (x, y) in xs.iter().zip(ys) {
        for i in 0..8 {
            sums[i] += x[i] * y[i];
        }
    }
    sums.iter().sum::<f64>() + x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>()
}
