//! The program of a tick as the solver receives it, and the solver's result: for tests and comparisons.

use crate::cone_program::{ConeProgram, Size};
use crate::controller::WholeBodyController;
use crate::references::References;
use nalgebra::{DMatrix, DVector};

/// Matrices and vectors of a program: min ½ xᵀ P x + cᵀ x with A x = b, l ≤ G x ≤ u and h + F x in a product of
/// second-order cones.
#[derive(Clone, Debug)]
pub struct Program {
    /// P, the quadratic cost; symmetric.
    pub P: DMatrix<f64>,
    /// c, the linear cost.
    pub c: DVector<f64>,
    /// A, the coefficients of the equalities.
    pub A: DMatrix<f64>,
    /// b, the right side of the equalities.
    pub b: DVector<f64>,
    /// G, the coefficients of the rows.
    pub G: DMatrix<f64>,
    /// l, the lower bounds of the rows.
    pub lower: DVector<f64>,
    /// u, the upper bounds of the rows.
    pub upper: DVector<f64>,
    /// F, the coefficients of the cones' rows.
    pub F: DMatrix<f64>,
    /// h, the constants of the cones' rows.
    pub h: DVector<f64>,
    /// Dimensions of the cones.
    pub cones: Vec<usize>,
}

impl Program {
    fn new(from: &ConeProgram) -> Self {
        let Size { unknowns: n, equalities, rows, cone_rows } = from.size;
        let part = |matrix: &DMatrix<f64>, rows: usize| matrix.view((0, 0), (n, rows)).transpose();
        let vector = |x: &[f64], count: usize| DVector::from_column_slice(&x[..count]);
        Self {
            P: DMatrix::from_fn(n, n, |i, j| from.P[(i.max(j), i.min(j))]),
            c: vector(&from.c, n),
            A: part(&from.At, equalities),
            b: vector(&from.b, equalities),
            G: part(&from.Gt, rows),
            lower: vector(&from.lower, rows),
            upper: vector(&from.upper, rows),
            F: part(&from.Ft, cone_rows),
            h: vector(&from.h, cone_rows),
            cones: from.cones.clone(),
        }
    }

    /// Returns the objective ½ xᵀ P x + cᵀ x.
    pub fn objective(&self, x: &DVector<f64>) -> f64 {
        0.5 * x.dot(&(&self.P * x)) + self.c.dot(x)
    }
}

/// Solution that the solver of the first priority found.
#[derive(Clone, Debug)]
pub struct Optimum {
    /// x: accelerations, and forces of the contacts that touch.
    pub x: DVector<f64>,
    /// Unknowns of the solver: the unknowns in x that were not eliminated, or x with additional unknowns.
    pub z: DVector<f64>,
    /// Multipliers of the equalities that were not eliminated.
    pub equalities: DVector<f64>,
    /// Multipliers of the rows of G, positive at a lower bound.
    pub rows: DVector<f64>,
    /// Multipliers of the rows of the cones.
    pub cones: DVector<f64>,
}

impl WholeBodyController {
    /// Computes the program of the first priority as a step does, without solving it.
    #[doc(hidden)]
    #[track_caller]
    pub fn assemble(&mut self, q: &[f64], v: &[f64], references: &References) {
        self.check_lengths(q, v, references);
        self.update(q, v, references);
        let (program, kinds) = self.equations.program();
        self.hierarchy.assemble(program, kinds, &self.objective.priorities[0]);
    }

    /// Solves the program that the last call assembled.
    #[doc(hidden)]
    pub fn solve_assembled(&mut self) {
        self.hierarchy.solve_assembled(self.equations.program().1);
    }

    /// Computes the program of the first priority, before any elimination.
    #[doc(hidden)]
    #[track_caller]
    pub fn program(&mut self, q: &[f64], v: &[f64], references: &References) -> Program {
        self.check_lengths(q, v, references);
        self.update(q, v, references);
        self.objective.priorities[0].write(&mut self.equations.program);
        Program::new(&self.equations.program)
    }

    /// Computes the program of the first priority as its solver receives it.
    #[doc(hidden)]
    #[track_caller]
    pub fn reduced_program(&mut self, q: &[f64], v: &[f64], references: &References) -> Program {
        self.assemble(q, v, references);
        Program::new(self.hierarchy.program())
    }

    /// Returns the optimum found by the first priority's solver in the last step.
    #[doc(hidden)]
    pub fn optimum(&self) -> Optimum {
        let solver = self.hierarchy.first_solver();
        let multipliers = solver.multipliers();
        Optimum {
            x: DVector::from_column_slice(&self.hierarchy.x[..self.equations.program.size.unknowns]),
            z: DVector::from_column_slice(solver.x()),
            equalities: DVector::from_column_slice(multipliers.equalities),
            rows: DVector::from_column_slice(multipliers.rows),
            cones: DVector::from_column_slice(multipliers.cones),
        }
    }
}
