//! Solves the program, priority by priority: what the tasks of one attain is held by the next.
//!
//! Of min ½ ‖R x − b‖² over a convex set all minimisers have the same R x; the equality R x = R x* therefore describes them
//! all. Source: Escande, Mansard and Wieber, *Hierarchical quadratic programming* (2014), section 2.

use crate::condense::Elimination;
use crate::cone_program::{
    Clarabel, ConeProgram, Dense, InteriorPoint, Outcome, Settings as SolverSettings, Size, Solver, Start,
};
use crate::least_squares::LeastSquares;
use crate::settings::{Backend, Form, Settings};
use condyle_linalg::max_abs;

/// What former priorities hold may leave no inside of rows and cones, which interior points need: by so much (relative to
/// 1 and the bound; N) they are widened for the next ones.
const WIDENED: f64 = 1e-7;

/// A row whose coefficients all have become smaller than this part of what they were is decided by what is held.
const DECIDED: f64 = 1e-9;

/// The solvers, and the solution.
pub(crate) struct Levels {
    solvers: Vec<Box<dyn Solver + Send>>,
    eliminations: Vec<Elimination>,
    condensed: ConeProgram,
    form: Form,
    warm: bool,
    /// The last solution.
    pub x: Vec<f64>,
}

impl Levels {
    /// For programs of at most such a size, and objectives of so many rows.
    pub(crate) fn new(capacity: Size, rows: &[usize], settings: &Settings) -> Self {
        let Settings { tolerance, max_iterations, time_limit, form, .. } = *settings;
        let solver_settings = SolverSettings { tolerance, max_iterations, time_limit };
        let of_solver = match form {
            Form::Condensed => Size { equalities: 0, ..capacity },
            Form::Full => capacity,
        };
        let solver = || -> Box<dyn Solver + Send> {
            match settings.backend {
                Backend::Clarabel => Box::new(Clarabel::new(of_solver, Dense, solver_settings)),
                Backend::InteriorPoint => Box::new(InteriorPoint::new(of_solver, solver_settings)),
            }
        };
        Self {
            solvers: rows.iter().map(|_| solver()).collect(),
            eliminations: match form {
                Form::Condensed => rows.iter().map(|&rows| Elimination::new(capacity, rows)).collect(),
                Form::Full => Vec::new(),
            },
            condensed: ConeProgram::new(of_solver),
            form,
            warm: settings.warm_start,
            x: vec![0.0; capacity.unknowns],
        }
    }

    /// Minimises one objective after the other, under a program whose first `dense` rows have few zeros; x is the best that was found, and finite. How many were minimised.
    pub(crate) fn solve(
        &mut self,
        program: &mut ConeProgram,
        dense: usize,
        objectives: &[LeastSquares],
    ) -> (Outcome, usize) {
        let (n, equalities) = (program.size.unknowns, program.size.equalities);
        let mut all = Outcome { iterations: 0, warm: true, reduced: false, stopped: None };
        let mut done = 0;
        for (level, objective) in objectives.iter().enumerate() {
            let outcome = self.minimise(program, dense, objective, level);
            all.iterations += outcome.iterations;
            all.warm &= outcome.warm;
            all.reduced |= outcome.reduced;
            all.stopped = outcome.stopped;
            if all.stopped.is_some() {
                break;
            }
            done += 1;
            if level + 1 < objectives.len() {
                hold(program, objective, &self.x[..n]);
            }
        }
        program.size.equalities = equalities;
        (all, done)
    }

    fn minimise(&mut self, program: &mut ConeProgram, dense: usize, objective: &LeastSquares, level: usize) -> Outcome {
        let Self { solvers, eliminations, condensed, x, warm, .. } = self;
        let solver = &mut solvers[level];
        let n = program.size.unknowns;
        if self.form == Form::Full {
            objective.write(program);
            let outcome = solver.solve(program, if *warm { Start::Warm } else { Start::Cold });
            if outcome.stopped.is_none() || level == 0 {
                x[..n].copy_from_slice(solver.x());
            }
            return outcome;
        }
        let elimination = &mut eliminations[level];
        let same_basis = elimination.split(program, program.size.equalities);
        elimination.condense(program, dense, objective, condensed);
        if condensed.size.unknowns == 0 {
            elimination.basis.expand(&[], &mut x[..n]);
            return Outcome { iterations: 0, warm: true, reduced: false, stopped: None };
        }
        if level > 0 {
            widen(condensed, program);
        }
        let outcome = solver.solve(condensed, if *warm && same_basis { Start::Warm } else { Start::Cold });
        if outcome.stopped.is_none() || level == 0 {
            elimination.basis.expand(solver.x(), &mut x[..n]);
        }
        outcome
    }
}

/// R x = R x* as equalities more.
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

/// Widens bounds and cones, and takes out rows that are decided.
fn widen(condensed: &mut ConeProgram, program: &ConeProgram) {
    let Size { unknowns, rows, .. } = condensed.size;
    let stride = condensed.Gt.nrows();
    for r in 0..rows {
        let before = max_abs(&program.Gt.as_slice()[r * stride..][..program.size.unknowns]);
        let row = &mut condensed.Gt.as_mut_slice()[r * stride..][..unknowns];
        if max_abs(row) <= DECIDED * before {
            row.fill(0.0);
            (condensed.lower[r], condensed.upper[r]) = (f64::NEG_INFINITY, f64::INFINITY);
        } else {
            condensed.lower[r] -= WIDENED * (1.0 + condensed.lower[r].abs());
            condensed.upper[r] += WIDENED * (1.0 + condensed.upper[r].abs());
        }
    }
    let mut first = 0;
    for &dimension in &condensed.cones {
        condensed.h[first] += WIDENED;
        first += dimension;
    }
}
