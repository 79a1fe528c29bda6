//! Back end with clarabel, the reference solver.
//!
//! Clarabel requires A x + s = b with s in a product of cones, in sparse matrices with a fixed pattern. A solver is
//! built once for each shape of a program and kept. The shape consists of the sizes, and of the bounds that are finite
//! or equal. If a set of contacts returns, only numbers must be updated. The pattern holds all entries that have been
//! non-zero so far. When another entry becomes non-zero, for example when a robot leaves a symmetric posture, the
//! solver is built again. Clarabel allocates once in each solve; a new shape or pattern causes more allocations.
//!
//! In most ticks a robot is far from most of its limits. So clarabel gets a row of G only if a recent solution was
//! close to one of the row's bounds. If a solution violates a row that was left out, the program is solved again with
//! this row. So the final solution satisfies all rows.

use super::{ConeProgram, Multipliers, Outcome, Settings, Size, Solver, Start, Status};
use ::clarabel::algebra::CscMatrix;
use ::clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use condyle_linalg::dot;
use std::time::Instant;

/// Regularisation added to the diagonal entries of a matrix before its factorisation. Clarabel's own value, 1e-8,
/// requires iterative refinement in each solve.
const REGULARISATION: f64 = 1e-11;

/// Maximum number of stored shapes. A new shape replaces the shape that was not used for the longest time.
const KEPT: usize = 16;

/// Distance to a bound below which a row counts as close, relative to the width between the row's bounds (or to its
/// only bound).
const CLOSE: f64 = 0.1;

/// Number of consecutive solutions that must be far from a row of G before the row is left out again. The number is
/// large, because the return of a row requires a new solver.
const PATIENCE: u32 = 1000;

/// Number of solves with all rows after a failed solve without some of the rows.
const RETRIES: u32 = 10;

/// Row of clarabel's constraints A x + s = b.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Row {
    /// Equality i: aᵢ x = bᵢ.
    Equality(usize),
    /// Row i of G whose bounds are equal: gᵢ x = lᵢ = uᵢ.
    Fixed(usize),
    /// Lower bound of row i of G: −gᵢ x ≤ −lᵢ.
    Lower(usize),
    /// Upper bound of row i of G: gᵢ x ≤ uᵢ.
    Upper(usize),
    /// Row i of F, in a cone: −fᵢ x + s = hᵢ.
    Cone(usize),
}

impl Row {
    fn coefficient(self, program: &ConeProgram, j: usize) -> f64 {
        match self {
            Row::Equality(i) => program.At[(j, i)],
            Row::Fixed(i) | Row::Upper(i) => program.Gt[(j, i)],
            Row::Lower(i) => -program.Gt[(j, i)],
            Row::Cone(i) => -program.Ft[(j, i)],
        }
    }

    fn right_side(self, program: &ConeProgram) -> f64 {
        match self {
            Row::Equality(i) => program.b[i],
            Row::Fixed(i) | Row::Upper(i) => program.upper[i],
            Row::Lower(i) => -program.lower[i],
            Row::Cone(i) => program.h[i],
        }
    }

    /// Returns whether the solver needs the row. It needs all equalities, fixed rows and cones, and the rows to which
    /// recent solutions were close.
    fn matters(self, away: &[u32]) -> bool {
        match self {
            Row::Lower(i) | Row::Upper(i) => away[i] < PATIENCE,
            Row::Equality(_) | Row::Fixed(_) | Row::Cone(_) => true,
        }
    }

    /// Returns the number of non-zero coefficients of the row.
    fn count(self, program: &ConeProgram) -> usize {
        let (matrix, i) = match self {
            Row::Equality(i) => (&program.At, i),
            Row::Fixed(i) | Row::Lower(i) | Row::Upper(i) => (&program.Gt, i),
            Row::Cone(i) => (&program.Ft, i),
        };
        nonzeros(&matrix.as_slice()[i * matrix.nrows()..][..program.size.unknowns])
    }
}

fn nonzeros(x: &[f64]) -> usize {
    x.iter().map(|&x| usize::from(x != 0.0)).sum()
}

/// Lists the rows of a program in clarabel's order: zero cone, orthant, second-order cones.
fn list_rows(program: &ConeProgram, rows: &mut Vec<Row>) {
    let Size { equalities, rows: m, cone_rows, .. } = program.size;
    let (lower, upper) = (&program.lower[..m], &program.upper[..m]);
    rows.clear();
    rows.extend((0..equalities).map(Row::Equality));
    rows.extend((0..m).filter(|&i| lower[i] == upper[i]).map(Row::Fixed));
    for i in (0..m).filter(|&i| lower[i] != upper[i]) {
        if lower[i] > f64::NEG_INFINITY {
            rows.push(Row::Lower(i));
        }
        if upper[i] < f64::INFINITY {
            rows.push(Row::Upper(i));
        }
    }
    rows.extend((0..cone_rows).map(Row::Cone));
}

/// Solver for programs of one shape.
struct Shape {
    size: Size,
    cones: Vec<usize>,
    /// All rows of the program.
    all: Vec<Row>,
    /// Number of consecutive solutions that were far from each row of G, up to now.
    away: Vec<u32>,
    /// Rows that the solver has.
    rows: Vec<Row>,
    /// Entries of P's upper triangle and of A, column by column.
    entries: [Vec<(usize, usize)>; 2],
    values: [Vec<f64>; 2],
    linear: Vec<f64>,
    right_side: Vec<f64>,
    solver: DefaultSolver<f64>,
}

impl Shape {
    /// Builds a solver for the needed rows. The pattern holds the program's non-zero entries and the additional entries
    /// `more`.
    fn new(
        program: &ConeProgram,
        all: Vec<Row>,
        away: Vec<u32>,
        more: [Vec<(usize, usize)>; 2],
        settings: &Settings,
    ) -> Self {
        let n = program.size.unknowns;
        let rows: Vec<Row> = all.iter().copied().filter(|row| row.matters(&away)).collect();
        let kept = |k: usize, (i, j)| more[k].binary_search_by_key(&(j, i), |&(i, j)| (j, i)).is_ok();
        let in_P = (0..n).flat_map(|j| (0..=j).map(move |i| (i, j)));
        let in_A = (0..n).flat_map(|j| (0..rows.len()).map(move |i| (i, j)));
        let entries = [
            in_P.filter(|&(i, j)| i == j || program.P[(j, i)] != 0.0 || kept(0, (i, j))).collect(),
            in_A.filter(|&(i, j)| rows[i].coefficient(program, j) != 0.0 || kept(1, (i, j))).collect(),
        ];
        let values = gather(program, &rows, &entries);
        let right_side: Vec<f64> = rows.iter().map(|row| row.right_side(program)).collect();
        let csc = |m: usize, k: usize| {
            let starts = (0..=n).map(|j| entries[k].partition_point(|e| e.1 < j)).collect();
            CscMatrix::new(m, n, starts, entries[k].iter().map(|e| e.0).collect(), values[k].clone())
        };
        let zeros = rows.iter().filter(|row| matches!(row, Row::Equality(_) | Row::Fixed(_))).count();
        let orthant = rows.len() - zeros - program.size.cone_rows;
        let mut cones = vec![SupportedConeT::ZeroConeT(zeros), SupportedConeT::NonnegativeConeT(orthant)];
        cones.extend(program.cones.iter().map(|&dim| match dim {
            1 => SupportedConeT::NonnegativeConeT(1),
            _ => SupportedConeT::SecondOrderConeT(dim),
        }));
        let Settings { tolerance, .. } = *settings;
        let settings = DefaultSettings {
            verbose: false,
            tol_feas: tolerance,
            tol_gap_abs: tolerance,
            tol_gap_rel: tolerance,
            // Refine only as accurately as the tolerance requires, because clarabel's own value, 1e-13, takes a sixth
            // of the time of a solve.
            iterative_refinement_reltol: tolerance,
            iterative_refinement_abstol: tolerance,
            static_regularization_constant: REGULARISATION,
            // Numbers can only be replaced if the pattern stays the same. So switch off presolve and the removal of
            // zeros.
            presolve_enable: false,
            input_sparse_dropzeros: false,
            ..DefaultSettings::default()
        };
        // The solver computes the scales of rows and columns from these numbers and keeps them.
        let solver =
            DefaultSolver::new(&csc(n, 0), &program.c[..n], &csc(rows.len(), 1), &right_side, &cones, settings)
                .expect("shapes and cones agree by construction");
        let (size, cones, linear) = (program.size, program.cones.clone(), program.c[..n].to_vec());
        Self { size, cones, all, away, rows, entries, values, linear, right_side, solver }
    }

    /// Updates for each row of G whether the solution is close to it. Returns whether the solution violates a row that
    /// the solver lacks.
    fn compare(&mut self, program: &ConeProgram, x: &[f64]) -> bool {
        let mut violated = false;
        for (i, away) in self.away.iter_mut().enumerate() {
            let (lower, upper, y) = (program.lower[i], program.upper[i], dot(&program.row(i)[..x.len()], x));
            let width = if (upper - lower).is_finite() { upper - lower } else { lower.abs().min(upper.abs()) };
            violated |= *away >= PATIENCE && (y < lower || y > upper);
            let close = y < lower + CLOSE * width || y > upper - CLOSE * width;
            *away = if close { 0 } else { away.saturating_add(1) };
        }
        violated
    }

    /// Returns whether the solver has all rows that are now needed.
    fn is_complete(&self) -> bool {
        self.all.iter().filter(|row| row.matters(&self.away)).eq(&self.rows)
    }

    /// Replaces the numbers in the solver, if the pattern contains all non-zero entries of the program. Returns whether
    /// it does.
    fn update(&mut self, program: &ConeProgram) -> bool {
        for (k, &(i, j)) in self.entries[0].iter().enumerate() {
            self.values[0][k] = program.P[(j, i)];
        }
        for (k, &(i, j)) in self.entries[1].iter().enumerate() {
            self.values[1][k] = self.rows[i].coefficient(program, j);
        }
        let n = program.size.unknowns;
        let in_P = (0..n).map(|j| nonzeros(&program.P.as_slice()[j * program.P.nrows()..][j..n])).sum::<usize>();
        let in_A = self.rows.iter().map(|row| row.count(program)).sum::<usize>();
        if [in_P, in_A] != [0, 1].map(|k| nonzeros(&self.values[k])) {
            return false;
        }
        for (b, row) in self.right_side.iter_mut().zip(&self.rows) {
            *b = row.right_side(program);
        }
        self.linear.copy_from_slice(&program.c[..program.size.unknowns]);
        let solver = &mut self.solver;
        solver
            .update_P(&self.values[0])
            .and_then(|()| solver.update_q(&self.linear))
            .and_then(|()| solver.update_A(&self.values[1]))
            .and_then(|()| solver.update_b(&self.right_side))
            .expect("patterns are fixed and presolve is off");
        true
    }
}

fn gather(program: &ConeProgram, rows: &[Row], entries: &[Vec<(usize, usize)>; 2]) -> [Vec<f64>; 2] {
    [
        entries[0].iter().map(|&(i, j)| program.P[(j, i)]).collect(),
        entries[1].iter().map(|&(i, j)| rows[i].coefficient(program, j)).collect(),
    ]
}

/// Sets the limits of iterations and time in a solver. Allocates if these limits change.
fn limit(solver: &mut DefaultSolver<f64>, max_iter: u32, time_limit: f64) {
    let given = solver.settings();
    if (given.max_iter, given.time_limit) != (max_iter, time_limit) {
        let settings = DefaultSettings { max_iter, time_limit, ..given.clone() };
        solver.update_settings(settings).expect("both may change");
    }
}

/// Clarabel's interior-point method.
pub(crate) struct Clarabel {
    settings: Settings,
    capacity: Size,
    /// Shapes in the order of their last use; the most recently used shape is last.
    shapes: Vec<Shape>,
    rows: Vec<Row>,
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    w: Vec<f64>,
    size: Size,
}

impl Clarabel {
    /// Creates a solver of programs with this capacity.
    pub(crate) fn new(capacity: Size, settings: Settings) -> Self {
        let Size { unknowns, equalities, rows, cone_rows } = capacity;
        Self {
            settings,
            capacity,
            shapes: Vec::with_capacity(KEPT),
            rows: Vec::with_capacity(equalities + 2 * rows + cone_rows),
            x: vec![0.0; unknowns],
            y: vec![0.0; equalities],
            z: vec![0.0; rows],
            w: vec![0.0; cone_rows],
            size: Size::default(),
        }
    }

    /// Moves the shape that fits the program to the end of the list, and gives its solver the program's numbers.
    fn prepare(&mut self, program: &ConeProgram) {
        list_rows(program, &mut self.rows);
        let found = self
            .shapes
            .iter()
            .position(|shape| shape.size == program.size && shape.cones == program.cones && shape.all == self.rows);
        let (mut away, mut more) = (Vec::new(), [Vec::new(), Vec::new()]);
        if let Some(k) = found {
            self.shapes[k..].rotate_left(1);
            let shape = self.shapes.last_mut().expect("just found");
            let complete = shape.is_complete();
            if complete && shape.update(program) {
                return;
            }
            let Shape { away: before, entries: [in_P, in_A], .. } = self.shapes.pop().expect("just found");
            (away, more) = (before, [in_P, if complete { in_A } else { Vec::new() }]);
        }
        if self.shapes.len() == KEPT {
            self.shapes.remove(0);
        }
        away.resize(program.size.rows, PATIENCE);
        self.shapes.push(Shape::new(program, self.rows.clone(), away, more, &self.settings));
    }

    /// Solves the program with the needed rows. The limits of iterations and time include the earlier solves of the
    /// same program.
    fn solve_with_rows(&mut self, program: &ConeProgram, iterations: u32, started: Instant) -> Outcome {
        self.prepare(program);
        let Settings { max_iterations, time_limit, .. } = self.settings;
        let Self { shapes, x, y, z, w, .. } = self;
        let Shape { solver, rows, all, .. } = shapes.last_mut().expect("just prepared");
        // If rows are left out, half of the iterations are reserved for a solve with all rows.
        let share = |most: u32| if rows.len() < all.len() { most.div_ceil(2) } else { most };
        let elapsed = if iterations == 0 { 0.0 } else { started.elapsed().as_secs_f64() };
        limit(solver, share(max_iterations - iterations), time_limit - elapsed);
        solver.solve();
        limit(solver, share(max_iterations), time_limit);
        let solution = &solver.solution;
        let stopped = match solution.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => None,
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => Some(Status::Infeasible),
            SolverStatus::DualInfeasible | SolverStatus::AlmostDualInfeasible => Some(Status::Unbounded),
            SolverStatus::MaxIterations => Some(Status::IterationLimit),
            SolverStatus::MaxTime => Some(Status::TimeLimit),
            _ => Some(Status::NumericalError),
        };
        if solution.x.iter().chain(&solution.z).all(|x| x.is_finite()) {
            x[..solution.x.len()].copy_from_slice(&solution.x);
            z.fill(0.0);
            for (&row, &multiplier) in rows.iter().zip(&solution.z) {
                match row {
                    Row::Equality(i) => y[i] = -multiplier,
                    Row::Fixed(i) | Row::Upper(i) => z[i] -= multiplier,
                    Row::Lower(i) => z[i] += multiplier,
                    Row::Cone(i) => w[i] = multiplier,
                }
            }
        }
        let reduced = solution.status == SolverStatus::AlmostSolved;
        Outcome { iterations: solution.iterations, warm: false, reduced, stopped }
    }
}

impl Solver for Clarabel {
    fn solve(&mut self, program: &ConeProgram, _start: Start) -> Outcome {
        assert_eq!(program.capacity(), self.capacity, "the program's capacity");
        self.size = program.size;
        if let Err(status) = program.check() {
            return Outcome { iterations: 0, warm: false, reduced: false, stopped: Some(status) };
        }
        let (started, mut iterations) = (Instant::now(), 0);
        for round in 0.. {
            let outcome = self.solve_with_rows(program, iterations, started);
            iterations += outcome.iterations;
            let outcome = Outcome { iterations, ..outcome };
            let shape = self.shapes.last_mut().expect("just solved");
            let complete = shape.rows.len() == shape.all.len();
            let failed = outcome.stopped.is_some() || outcome.reduced;
            let done = match outcome.stopped {
                Some(Status::Infeasible | Status::TimeLimit) => true, // all rows would give the same result
                _ if failed => complete,
                _ => !shape.compare(program, &self.x[..program.size.unknowns]),
            };
            if done {
                return outcome;
            }
            if failed || round > 0 {
                let soon = PATIENCE - if failed { RETRIES } else { 1 };
                shape.away.iter_mut().for_each(|away| *away = (*away).min(soon)); // all rows are needed now
            }
        }
        unreachable!("in the third round no row is left out")
    }

    fn x(&self) -> &[f64] {
        &self.x[..self.size.unknowns]
    }

    fn multipliers(&self) -> Multipliers<'_> {
        let Size { equalities, rows, cone_rows, .. } = self.size;
        Multipliers { equalities: &self.y[..equalities], rows: &self.z[..rows], cones: &self.w[..cone_rows] }
    }
}
