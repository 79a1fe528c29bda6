//! Convex program with second-order cones, and its sizes.

use super::Status;
use nalgebra::DMatrix;

/// Sizes of a program: numbers of unknowns and constraints. They are either the numbers in use or the maximum numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Size {
    /// Length of x.
    pub unknowns: usize,
    /// Number of rows of A.
    pub equalities: usize,
    /// Number of rows of G.
    pub rows: usize,
    /// Number of rows of F, for all cones together.
    pub cone_rows: usize,
}

/// Matrices and vectors of a program, with the dimensions of the capacity. A solver reads only their first rows and
/// columns, up to the size in use.
#[derive(Clone, Debug)]
pub(crate) struct ConeProgram {
    /// Size in use. Each number is at most the number in the capacity.
    pub size: Size,
    /// Matrix P of the cost: n × n for n unknowns, positive semidefinite. Only the lower triangle is read.
    pub P: DMatrix<f64>,
    /// Vector c of the linear cost: one number for each unknown.
    pub c: Vec<f64>,
    /// Transpose of A, the coefficients of the equalities: a column for each equality.
    pub At: DMatrix<f64>,
    /// Right sides b of the equalities A x = b.
    pub b: Vec<f64>,
    /// Transpose of G, the coefficients of the rows: a column for each row.
    pub Gt: DMatrix<f64>,
    /// Lower bounds l of the rows of G; −∞ for a missing bound.
    pub lower: Vec<f64>,
    /// Upper bounds u of the rows of G; ∞ for a missing bound.
    pub upper: Vec<f64>,
    /// Transpose of F, the coefficients of the cones' rows: a column for each row, cone after cone.
    pub Ft: DMatrix<f64>,
    /// Constants h of the cones' rows h + F x.
    pub h: Vec<f64>,
    /// Dimension of each cone in use: at least 2, or 1 for the constraint s₀ ≥ 0. The sum of all dimensions is
    /// `size.cone_rows`.
    pub cones: Vec<usize>,
}

impl ConeProgram {
    /// Creates a program of zeros and infinite bounds whose size in use is the capacity. It has no cones; the caller
    /// may add cones with up to `cone_rows` rows.
    pub(crate) fn new(capacity: Size) -> Self {
        let Size { unknowns, equalities, rows, cone_rows } = capacity;
        Self {
            size: Size { cone_rows: 0, ..capacity },
            P: DMatrix::zeros(unknowns, unknowns),
            c: vec![0.0; unknowns],
            At: DMatrix::zeros(unknowns, equalities),
            b: vec![0.0; equalities],
            Gt: DMatrix::zeros(unknowns, rows),
            lower: vec![f64::NEG_INFINITY; rows],
            upper: vec![f64::INFINITY; rows],
            Ft: DMatrix::zeros(unknowns, cone_rows),
            h: vec![0.0; cone_rows],
            cones: Vec::with_capacity(cone_rows),
        }
    }

    /// Returns the maximum size of the program.
    pub(crate) fn capacity(&self) -> Size {
        Size { unknowns: self.c.len(), equalities: self.b.len(), rows: self.lower.len(), cone_rows: self.h.len() }
    }

    /// Returns a mutable slice of the coefficients of an equality: one number for each unknown of the capacity.
    pub(crate) fn equality_mut(&mut self, i: usize) -> &mut [f64] {
        let most = self.c.len();
        &mut self.At.as_mut_slice()[i * most..][..most]
    }

    /// Copies the constraints of a program of the same capacity.
    pub(crate) fn copy_constraints(&mut self, from: &Self) {
        self.size = from.size;
        self.cones.clear();
        self.cones.extend_from_slice(&from.cones);
        for (to, from) in [(&mut self.At, &from.At), (&mut self.Gt, &from.Gt), (&mut self.Ft, &from.Ft)] {
            to.copy_from(from);
        }
        for (to, from) in [
            (&mut self.b, &from.b),
            (&mut self.lower, &from.lower),
            (&mut self.upper, &from.upper),
            (&mut self.h, &from.h),
        ] {
            to.copy_from_slice(from);
        }
    }

    /// Returns the coefficients of a row of G: one number for each unknown of the capacity.
    pub(crate) fn row(&self, i: usize) -> &[f64] {
        &self.Gt.as_slice()[i * self.c.len()..][..self.c.len()]
    }

    /// Returns a mutable slice of the coefficients of a row of G.
    pub(crate) fn row_mut(&mut self, i: usize) -> &mut [f64] {
        let most = self.c.len();
        &mut self.Gt.as_mut_slice()[i * most..][..most]
    }

    /// Returns a mutable slice of the coefficients of a row of a cone.
    pub(crate) fn cone_row_mut(&mut self, i: usize) -> &mut [f64] {
        let most = self.c.len();
        &mut self.Ft.as_mut_slice()[i * most..][..most]
    }

    /// Checks that all numbers that a solver reads are finite (bounds may be infinite). Also checks the size in use.
    ///
    /// # Errors
    /// [`Status::NotFinite`] names the first number that is not finite.
    ///
    /// # Panics
    /// If the size in use exceeds the capacity, or if the dimensions of the cones do not add up to `size.cone_rows`.
    pub(crate) fn check(&self) -> Result<(), Status> {
        let (Size { unknowns: n, equalities, rows, cone_rows }, most) = (self.size, self.capacity());
        assert!(n <= most.unknowns && equalities <= most.equalities, "size: more than the capacity");
        assert!(rows <= most.rows && cone_rows <= most.cone_rows, "size: more than the capacity");
        assert_eq!(self.cones.iter().sum::<usize>(), cone_rows, "cones: the sum of the dimensions");
        for (name, matrix, columns) in
            [("P", &self.P, n), ("At", &self.At, equalities), ("Gt", &self.Gt, rows), ("Ft", &self.Ft, cone_rows)]
        {
            for j in 0..columns {
                let from = if name == "P" { j } else { 0 };
                finite(name, &matrix.as_slice()[j * most.unknowns..][..n], from, j * most.unknowns)?;
            }
        }
        finite("c", &self.c[..n], 0, 0)?;
        finite("b", &self.b[..equalities], 0, 0)?;
        finite("h", &self.h[..cone_rows], 0, 0)?;
        let wrong = |name, index| Err(Status::NotFinite { name, index });
        for i in 0..rows {
            if self.lower[i].is_nan() || self.lower[i] == f64::INFINITY {
                return wrong("lower", i);
            }
            if self.upper[i].is_nan() || self.upper[i] == f64::NEG_INFINITY {
                return wrong("upper", i);
            }
        }
        Ok(())
    }

    /// Returns the objective ½ xᵀ P x + cᵀ x.
    #[cfg(test)]
    pub(crate) fn objective(&self, x: &[f64]) -> f64 {
        let mut sum = 0.0;
        for j in 0..self.size.unknowns {
            let below: f64 = (j + 1..self.size.unknowns).map(|i| self.P[(i, j)] * x[i]).sum();
            sum += x[j] * (0.5 * self.P[(j, j)] * x[j] + below + self.c[j]);
        }
        sum
    }
}

/// Checks that the numbers of a column are finite, from index `from` on. `first` is the column's offset in the matrix.
fn finite(name: &'static str, column: &[f64], from: usize, first: usize) -> Result<(), Status> {
    // 0 · x is 0 for each finite x, and NaN otherwise. Add these products in eight independent sums.
    let (eights, rest) = column[from..].as_chunks::<8>();
    let mut sums = [0.0; 8];
    for x in eights {
        for i in 0..8 {
            sums[i] += 0.0 * x[i];
        }
    }
    if sums.iter().chain(rest).map(|x| 0.0 * x).sum::<f64>() == 0.0 {
        return Ok(());
    }
    let index = (from..column.len()).find(|&i| !column[i].is_finite()).expect("the sum is NaN");
    Err(Status::NotFinite { name, index: first + index })
}
