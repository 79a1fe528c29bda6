//! The program of a tick as it stands before a solver, and what the solver said: for tests and for comparisons.

use crate::cone_program::{ConeProgram, Size};
use crate::controller::WholeBodyController;
use crate::references::References;
use nalgebra::{DMatrix, DVector};

/// The numbers of a program: min ½ xᵀ P x + cᵀ x with A x = b, l ≤ G x ≤ u and h + F x in a product of second-order cones.
#[derive(Clone, Debug)]
pub struct Program {
    /// Symmetric.
    pub P: DMatrix<f64>,
    /// The linear cost.
    pub c: DVector<f64>,
    /// Equalities.
    pub A: DMatrix<f64>,
    /// Their right side.
    pub b: DVector<f64>,
    /// Rows.
    pub G: DMatrix<f64>,
    /// Their lower bounds.
    pub lower: DVector<f64>,
    /// Their upper bounds.
    pub upper: DVector<f64>,
    /// Rows of cones.
    pub F: DMatrix<f64>,
    /// Their constants.
    pub h: DVector<f64>,
    /// The dimensions of the cones.
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

    /// ½ xᵀ P x + cᵀ x.
    pub fn objective(&self, x: &DVector<f64>) -> f64 {
        0.5 * x.dot(&(&self.P * x)) + self.c.dot(x)
    }
}

/// What the solver of the first priority found.
#[derive(Clone, Debug)]
pub struct Optimum {
    /// The accelerations and the forces of the contacts that touch.
    pub x: DVector<f64>,
    /// The unknowns that the solver had: those of x that were not eliminated, or more.
    pub z: DVector<f64>,
    /// The multipliers of the equalities that were not eliminated.
    pub equalities: DVector<f64>,
    /// The multipliers of the rows: positive at a lower bound.
    pub rows: DVector<f64>,
    /// The multipliers of the cones' rows.
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
        self.levels.assemble(program, kinds, &self.objective.levels[0]);
    }

    /// Solves the program that was assembled.
    #[doc(hidden)]
    pub fn solve_assembled(&mut self) {
        self.levels.solve_assembled(self.equations.program().1);
    }

    /// The program of the first priority as it stands before anything is eliminated.
    #[doc(hidden)]
    #[track_caller]
    pub fn program(&mut self, q: &[f64], v: &[f64], references: &References) -> Program {
        self.check_lengths(q, v, references);
        self.update(q, v, references);
        self.objective.levels[0].write(&mut self.equations.program);
        Program::new(&self.equations.program)
    }

    /// The program of the first priority as its solver sees it.
    #[doc(hidden)]
    #[track_caller]
    pub fn reduced_program(&mut self, q: &[f64], v: &[f64], references: &References) -> Program {
        self.assemble(q, v, references);
        Program::new(self.levels.program())
    }

    /// The optimum that the last step's solver of the first priority found.
    #[doc(hidden)]
    pub fn optimum(&self) -> Optimum {
        let solver = self.levels.first_solver();
        let multipliers = solver.multipliers();
        Optimum {
            x: DVector::from_column_slice(&self.levels.x[..self.equations.program.size.unknowns]),
            z: DVector::from_column_slice(solver.x()),
            equalities: DVector::from_column_slice(multipliers.equalities),
            rows: DVector::from_column_slice(multipliers.rows),
            cones: DVector::from_column_slice(multipliers.cones),
        }
    }
}
