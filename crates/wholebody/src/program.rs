//! A cone program of fixed sparsity on clarabel; it knows no robot.
//!
//! ```text
//! minimise  ½ xᵀ P x + cᵀ x    subject to    A x + s = b,   s in a product of cones
//! ```

use crate::error::Status;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::DMatrix;

/// The numbers of a cone program, dense; entries outside of the patterns are not read.
#[derive(Clone, Debug)]
pub(crate) struct Numbers {
    /// n × n; the upper triangle is read.
    pub P: DMatrix<f64>,
    /// n.
    pub c: Vec<f64>,
    /// m × n.
    pub A: DMatrix<f64>,
    /// m.
    pub b: Vec<f64>,
}

impl Numbers {
    pub(crate) fn zeros(m: usize, n: usize) -> Self {
        Self { P: DMatrix::zeros(n, n), c: vec![0.0; n], A: DMatrix::zeros(m, n), b: vec![0.0; m] }
    }
}

/// Which entries of a matrix may differ from zero, by columns, and their values.
struct Sparse {
    rows: usize,
    columns: usize,
    entries: Vec<(usize, usize)>,
    values: Vec<f64>,
}

impl Sparse {
    fn new(rows: usize, columns: usize, present: impl Fn(usize, usize) -> bool) -> Self {
        let all = (0..columns).flat_map(|j| (0..rows).map(move |i| (i, j)));
        let entries: Vec<_> = all.filter(|&(i, j)| present(i, j)).collect();
        Self { rows, columns, values: vec![0.0; entries.len()], entries }
    }

    fn gather(&mut self, dense: &DMatrix<f64>) -> &Vec<f64> {
        for (value, &(i, j)) in self.values.iter_mut().zip(&self.entries) {
            *value = dense[(i, j)];
        }
        &self.values
    }

    fn to_csc(&self) -> CscMatrix<f64> {
        let starts = (0..=self.columns).map(|j| self.entries.partition_point(|e| e.1 < j)).collect();
        let rows = self.entries.iter().map(|e| e.0).collect();
        CscMatrix::new(self.rows, self.columns, starts, rows, self.values.clone())
    }
}

/// A solver whose sparsity, cones and memory were fixed when it was built.
pub(crate) struct ConeProgram {
    P: Sparse,
    A: Sparse,
    solver: DefaultSolver<f64>,
}

/// What a solve found.
pub(crate) struct Outcome<'p> {
    /// The minimiser, or the last iterate.
    pub x: &'p [f64],
    pub iterations: u32,
    /// Whether only clarabel's reduced tolerances are met.
    pub reduced: bool,
    /// Why `x` is not the minimiser.
    pub stopped: Option<Status>,
}

impl ConeProgram {
    /// With the patterns of P (its upper triangle) and A, and numbers of the size that later ones will have.
    pub(crate) fn new(
        numbers: &Numbers,
        in_P: impl Fn(usize, usize) -> bool,
        in_A: impl Fn(usize, usize) -> bool,
        cones: &[SupportedConeT<f64>],
        settings: DefaultSettings<f64>,
    ) -> Self {
        let n = numbers.c.len();
        let mut P = Sparse::new(n, n, |i, j| i <= j && in_P(i, j));
        let mut A = Sparse::new(numbers.b.len(), n, in_A);
        P.gather(&numbers.P);
        A.gather(&numbers.A);
        // Numbers can be replaced only where neither presolve nor the removal of zeros changed the pattern.
        let settings =
            DefaultSettings { presolve_enable: false, input_sparse_dropzeros: false, verbose: false, ..settings };
        let mut solver = DefaultSolver::new(&P.to_csc(), &numbers.c, &A.to_csc(), &numbers.b, cones, settings)
            .expect("shapes and cones agree by construction");
        solver.solve(); // the first solve allocates its timers
        Self { P, A, solver }
    }

    /// Solves with new numbers. Clarabel allocates once.
    pub(crate) fn solve(&mut self, numbers: &Numbers) -> Outcome<'_> {
        let Self { P, A, solver } = self;
        solver
            .update_P(P.gather(&numbers.P))
            .and_then(|()| solver.update_q(&numbers.c))
            .and_then(|()| solver.update_A(A.gather(&numbers.A)))
            .and_then(|()| solver.update_b(&numbers.b))
            .expect("patterns are fixed and presolve is off");
        solver.solve();
        let solution = &solver.solution;
        let stopped = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => None,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Some(Status::Infeasible),
            SolverStatus::MaxIterations => Some(Status::IterationLimit),
            SolverStatus::MaxTime => Some(Status::TimeLimit),
            // The objective is bounded below: a certificate of the contrary is a numerical failure too.
            _ => Some(Status::NumericalError),
        };
        let reduced = solution.status == SolverStatus::AlmostSolved;
        Outcome { x: &solution.x, iterations: solution.iterations, reduced, stopped }
    }
}
