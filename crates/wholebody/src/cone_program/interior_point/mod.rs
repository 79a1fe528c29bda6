//! Condyle's own back end: a primal–dual interior-point method on dense matrices of about 10 to 60 unknowns.
//!
//! The method is Mehrotra's predictor and corrector, with Nesterov and Todd's scaling of bounds and second-order cones.
//! Each iteration factorises P + Gᵀ D G + Fᵀ W⁻² F once and solves with the factor twice. The iteration starts from the
//! data, or from the last solution, which is first moved back into the interior. Blocks of zeros in rows are skipped.
//! After construction the method does not allocate memory. The same numbers give the same bits, and no result is NaN.
//!
//! Sources: Mehrotra (1992); Nesterov and Todd (1998); Vandenberghe, *The CVXOPT linear and quadratic cone program
//! solvers* (2010). The formulas are Vandenberghe's, extended to rows with a lower and an upper bound.

mod bounds;
mod certificate;
mod cone;
mod cones;
mod iteration;
mod scaled;
mod solution;
mod start;
mod system;
mod workspace;

use super::{ConeProgram, Multipliers, Outcome, Settings, Size, Solver, Start, Status};
use bounds::Side;
use iteration::Limits;
use solution::Solution;
use std::time::Instant;
use workspace::Workspace;

/// Maximum number of iterations from a warm start. A cold start follows.
const WARM_ITERATIONS: u32 = 20;

/// Dense interior-point method; see the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct InteriorPoint {
    settings: Settings,
    capacity: Size,
    size: Size,
    work: Workspace,
    solution: Solution,
}

impl InteriorPoint {
    /// Creates a solver of programs with this capacity.
    pub(crate) fn new(capacity: Size, settings: Settings) -> Self {
        let (work, solution) = (Workspace::new(capacity), Solution::new(capacity));
        Self { settings, capacity, size: Size::default(), work, solution }
    }

    /// Minimises the loaded program. Returns whether the solution was reached from a warm start, and the error of the
    /// result.
    fn minimise(&mut self, start: Start, iterations: &mut u32) -> (bool, Result<f64, Status>) {
        let Self { settings, work, solution, .. } = self;
        let Settings { tolerance, max_iterations, time_limit } = *settings;
        let clock = time_limit.is_finite().then(|| (Instant::now(), time_limit));
        let limits = Limits { tolerance, iterations: max_iterations, clock };
        if start == Start::Warm && solution.solves == Some(work.data.n) {
            work.warm_start(solution);
            let few = Limits { iterations: max_iterations.min(WARM_ITERATIONS), ..limits };
            match work.iterate(iterations, few) {
                Err(Status::NumericalError | Status::IterationLimit) => {}
                Ok(error) if error > tolerance => {}
                found => return (true, found),
            }
        }
        match work.cold_start() {
            true => (false, work.iterate(iterations, limits)),
            false => (false, Err(Status::NumericalError)),
        }
    }
}

impl Solver for InteriorPoint {
    fn start_from(&mut self, x: &[f64], multipliers: Multipliers<'_>) {
        self.solution.set(x, multipliers);
    }

    fn solve(&mut self, program: &ConeProgram, start: Start) -> Outcome {
        assert_eq!(program.capacity(), self.capacity, "the program's capacity");
        self.size = program.size;
        if let Err(status) = program.check().and_then(|()| self.work.data.load(program)) {
            self.solution.clear();
            return Outcome { iterations: 0, warm: false, reduced: false, stopped: Some(status) };
        }
        self.work.system.prepare(&self.work.data);
        self.work.sides.iter_mut().for_each(Side::clear);
        let mut iterations = 0;
        let (warm, found) = self.minimise(start, &mut iterations);
        if self.work.is_finite() {
            self.solution.read(&self.work);
        } else {
            self.solution.clear();
        }
        self.solution.solves = found.is_ok().then_some(program.size.unknowns);
        let reduced = found.is_ok_and(|error| error > self.settings.tolerance);
        Outcome { iterations, warm, reduced, stopped: found.err() }
    }

    fn x(&self) -> &[f64] {
        &self.solution.x[..self.size.unknowns]
    }

    fn multipliers(&self) -> Multipliers<'_> {
        let Size { equalities, rows, cone_rows, .. } = self.size;
        let Solution { y, z, w, .. } = &self.solution;
        Multipliers { equalities: &y[..equalities], rows: &z[..rows], cones: &w[..cone_rows] }
    }
}
