//! Solves the program priority by priority. Later priorities keep the results of earlier priorities.
//!
//! All minimisers of ½ ‖R x − b‖² over a convex set have the same R x. So the equality R x = R x*, with any minimiser
//! x*, describes all minimisers. Source: Escande, Mansard and Wieber, *Hierarchical quadratic programming* (2014),
//! section 2.

use crate::basis::Elimination;
use crate::condense::{Condenser, Known};
#[cfg(feature = "clarabel")]
use crate::cone_program::Clarabel;
use crate::cone_program::{
    ConeProgram, InteriorPoint, Multipliers, Outcome, Settings as SolverSettings, Size, Solver, Start,
};
use crate::least_squares::LeastSquares;
#[cfg(feature = "clarabel")]
use crate::lifted::Lifted;
use crate::numbers::Reader;
use crate::settings::{Backend, Formulation, Settings};
use crate::warm_start::WarmStart;
use condyle_linalg::max_abs;

/// Amount by which bounds and cones are widened for later priorities: relative to 1 + |bound| for rows, in N for cones.
/// Interior-point methods need constraints with an interior. The equalities that keep the results of earlier priorities
/// may leave rows and cones without an interior.
const WIDENED: f64 = 1e-7;

/// Threshold below which the equalities of earlier priorities already determine a row's value. The compared number is
/// the ratio of the row's coefficients after the elimination to the coefficients before it.
const DECIDED: f64 = 1e-9;

/// Form of the program that the solver of a priority receives.
pub(crate) enum Given {
    /// A program whose equalities were eliminated.
    Condensed(Box<Condenser>, ConeProgram),
    /// A sparse program with additional unknowns.
    #[cfg(feature = "clarabel")]
    Lifted(Lifted),
    /// The original program.
    Full(ConeProgram),
}

/// Solvers of all priorities, and their last solution.
pub(crate) struct TaskHierarchy {
    solvers: Vec<Box<dyn Solver + Send + Sync>>,
    pub given: Vec<Given>,
    /// Last solution of each solver.
    pub warm_starts: Vec<WarmStart>,
    warm: bool,
    /// x of the last solution.
    pub x: Vec<f64>,
}

impl TaskHierarchy {
    /// Allocates memory for programs up to the size `capacity`, whose first `dense` rows have few zeros. The objective
    /// of each priority has up to `rows[priority]` rows.
    pub(crate) fn new(
        capacity: Size,
        #[cfg_attr(not(feature = "clarabel"), expect(unused_variables))] dense: usize,
        rows: &[usize],
        settings: &Settings,
    ) -> Self {
        let Settings { tolerance, max_iterations, time_limit, formulation, .. } = *settings;
        let given = |(priority, &objective): (usize, &usize)| match (formulation, settings.backend) {
            // Equalities that keep the results of earlier priorities may depend on the equalities of contacts and base.
            // Only an elimination handles dependent equalities.
            _ if priority > 0 => Given::condensed(capacity, objective),
            (Formulation::Condensed, _) => Given::condensed(capacity, objective),
            #[cfg(feature = "clarabel")]
            (Formulation::Full, Backend::Clarabel) => Given::Lifted(Lifted::new(capacity, dense, objective)),
            (Formulation::Full, Backend::InteriorPoint) => Given::Full(ConeProgram::new(capacity)),
        };
        let given: Vec<Given> = rows.iter().enumerate().map(given).collect();
        let solver_settings = SolverSettings { tolerance, max_iterations, time_limit };
        let solver = |given: &Given| -> Box<dyn Solver + Send + Sync> {
            let capacity = given.program().capacity();
            match settings.backend {
                #[cfg(feature = "clarabel")]
                Backend::Clarabel => Box::new(Clarabel::new(capacity, solver_settings)),
                Backend::InteriorPoint => Box::new(InteriorPoint::new(capacity, solver_settings)),
            }
        };
        let solvers = given.iter().map(solver).collect();
        let warm_starts = rows.iter().map(|_| WarmStart::new(capacity)).collect();
        Self { solvers, given, warm_starts, warm: settings.warm_start, x: vec![0.0; capacity.unknowns] }
    }

    /// Minimises one objective after the other subject to a program, and returns the number of minimised objectives.
    /// Afterwards, the field `x` is the best solution found, and finite.
    pub(crate) fn solve(
        &mut self,
        program: &mut ConeProgram,
        known: Known<'_>,
        objectives: &[LeastSquares],
    ) -> (Outcome, usize) {
        let (n, equalities) = (program.size.unknowns, program.size.equalities);
        let mut all = Outcome { iterations: 0, warm: true, reduced: false, stopped: None };
        let mut done = 0;
        for (priority, objective) in objectives.iter().enumerate() {
            let outcome = self.minimise(program, known, objective, priority);
            all.iterations += outcome.iterations;
            all.warm &= outcome.warm;
            all.reduced |= outcome.reduced;
            all.stopped = outcome.stopped;
            if all.stopped.is_some() {
                break;
            }
            done += 1;
            if priority + 1 < objectives.len() {
                hold(program, objective, &self.x[..n]);
            }
        }
        program.size.equalities = equalities;
        (all, done)
    }

    /// Writes the program of the first priority in the form that its solver receives.
    pub(crate) fn assemble(&mut self, program: &ConeProgram, known: Known<'_>, objective: &LeastSquares) {
        self.given[0].write(program, known, objective);
    }

    /// Returns the program that was last written for the solver of the first priority.
    pub(crate) fn program(&self) -> &ConeProgram {
        self.given[0].program()
    }

    /// Solves the program that `assemble` wrote.
    pub(crate) fn solve_assembled(&mut self, known: Known<'_>) {
        self.solve_given(known, 0);
    }

    pub(crate) fn first_solver(&self) -> &dyn Solver {
        &*self.solvers[0]
    }

    fn minimise(
        &mut self,
        program: &ConeProgram,
        known: Known<'_>,
        objective: &LeastSquares,
        priority: usize,
    ) -> Outcome {
        let given = &mut self.given[priority];
        given.write(program, known, objective);
        if priority > 0 {
            given.widen(program);
        }
        self.solve_given(known, priority)
    }

    /// Solves the program of one priority, starting from the last solution.
    fn solve_given(&mut self, known: Known<'_>, priority: usize) -> Outcome {
        let Self { solvers, given, warm_starts, x, warm } = self;
        let (solver, given, warm_start) = (&mut solvers[priority], &mut given[priority], &mut warm_starts[priority]);
        let x = &mut x[..known.places.unknowns.len()];
        if given.program().size.unknowns == 0 {
            given.read(&[], x);
            return Outcome { iterations: 0, warm: true, reduced: false, stopped: None };
        }
        let start = match warm_start.recall(known.places).filter(|_| *warm) {
            Some((last, multipliers)) => {
                given.start_from(last, multipliers, &mut **solver);
                Start::Warm
            }
            None => Start::Cold,
        };
        let outcome = solver.solve(given.program(), start);
        if outcome.stopped.is_none() || priority == 0 {
            given.read(solver.x(), x);
        }
        match outcome.stopped {
            None => warm_start.keep(known.places, x, solver.multipliers()),
            Some(_) => warm_start.forget(),
        }
        outcome
    }
}

impl Given {
    fn condensed(capacity: Size, objective: usize) -> Self {
        Given::Condensed(
            Box::new(Condenser::new(capacity, objective)),
            ConeProgram::new(Size { equalities: 0, ..capacity }),
        )
    }

    fn program(&self) -> &ConeProgram {
        match self {
            Given::Condensed(_, program) | Given::Full(program) => program,
            #[cfg(feature = "clarabel")]
            Given::Lifted(Lifted { program }) => program,
        }
    }

    /// Returns the elimination of the first priority. The next tick tries the pivots of this elimination first.
    pub(crate) fn elimination(&self) -> Option<&Elimination> {
        if let Given::Condensed(condenser, _) = self { Some(&condenser.elimination) } else { None }
    }

    /// Reads the elimination's pivots; returns `None` if they are invalid.
    pub(crate) fn read_elimination(&mut self, from: &mut Reader<'_>) -> Option<()> {
        let Given::Condensed(condenser, _) = self else { return Some(()) };
        condenser.elimination.read(&mut condenser.basis, from)
    }

    /// Writes the program in the form that the solver receives.
    fn write(&mut self, from: &ConeProgram, known: Known<'_>, objective: &LeastSquares) {
        match self {
            Given::Condensed(condenser, program) => condenser.condense(from, known, objective, program),
            #[cfg(feature = "clarabel")]
            Given::Lifted(lifted) => lifted.write(from, known, objective),
            Given::Full(program) => {
                program.copy_constraints(from);
                objective.write(program);
            }
        }
    }

    /// Passes x and the multipliers to the solver as its starting point.
    fn start_from(&mut self, x: &[f64], multipliers: Multipliers<'_>, solver: &mut dyn Solver) {
        match self {
            Given::Condensed(condenser, _) => {
                solver.start_from(condenser.reduce(x), Multipliers { equalities: &[], ..multipliers });
            }
            Given::Full(_) => solver.start_from(x, multipliers),
            #[cfg(feature = "clarabel")]
            Given::Lifted(_) => {} // clarabel starts cold
        }
    }

    /// Computes x from the unknowns that the solver found.
    fn read(&self, found: &[f64], x: &mut [f64]) {
        match self {
            Given::Condensed(condenser, _) => condenser.basis.expand(found, x),
            Given::Full(_) => x.copy_from_slice(&found[..x.len()]),
            #[cfg(feature = "clarabel")]
            Given::Lifted(_) => x.copy_from_slice(&found[..x.len()]),
        }
    }

    /// Widens bounds and cones of a condensed program, and removes rows whose values earlier priorities already
    /// determine.
    fn widen(&mut self, full: &ConeProgram) {
        let Given::Condensed(_, program) = self else { return };
        let Size { unknowns, rows, .. } = program.size;
        for r in 0..rows {
            let before = max_abs(&full.row(r)[..full.size.unknowns]);
            let row = &mut program.row_mut(r)[..unknowns];
            if max_abs(row) <= DECIDED * before {
                row.fill(0.0);
                (program.lower[r], program.upper[r]) = (f64::NEG_INFINITY, f64::INFINITY);
            } else {
                program.lower[r] -= WIDENED * (1.0 + program.lower[r].abs());
                program.upper[r] += WIDENED * (1.0 + program.upper[r].abs());
            }
        }
        let mut first = 0;
        for &dimension in &program.cones {
            program.h[first] += WIDENED;
            first += dimension;
        }
    }
}

/// Adds the equalities R x = R x*, which keep the result of an objective.
fn hold(program: &mut ConeProgram, objective: &LeastSquares, x: &[f64]) {
    let n = x.len();
    let mut add = |fill: &dyn Fn(&mut [f64])| {
        let (e, stride) = (program.size.equalities, program.At.nrows());
        let row = &mut program.At.as_mut_slice()[e * stride..][..n];
        fill(row);
        program.b[e] = row.iter().zip(x).map(|(a, x)| a * x).sum();
        program.size.equalities += 1;
    };
    for row in objective.Rt.column_iter().take(objective.count) {
        add(&|to| to.copy_from_slice(&row.as_slice()[..n]));
    }
    for &i in &objective.single {
        add(&|to| {
            to.fill(0.0);
            to[i] = 1.0;
        });
    }
}
