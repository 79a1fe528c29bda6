//! Second attempt of a solve that failed from its warm start.

use super::augmented::{AugmentedLagrangian, Outcome};
use crate::ddp::{Observer, Solution, Status};
use crate::error::Error;
use crate::problem::Problem;
use crate::time::Instant;

/// Result of an attempt.
struct Attempt {
    status: Status,
    solution: Solution,
    outcome: Outcome,
    lost: bool,
}

impl AugmentedLagrangian {
    /// Makes a second attempt after a failed one: from x̂₀ at all knots and the controls that hold it still, with
    /// multipliers of zero. Returns the status of the better attempt, and keeps its solution and outcome. A converged
    /// attempt is better; otherwise the attempt with the smaller violation is.
    ///
    /// Does nothing if the first attempt started there or no time is left. It also does nothing without constraints and
    /// bounds, where the solve equals [`Fddp`](crate::Fddp)'s.
    pub(super) fn restart(
        &mut self,
        problem: &mut Problem,
        [xs, us]: [&[f64]; 2],
        status: Status,
        observer: &mut dyn Observer,
        begin: Instant,
    ) -> Result<Status, Error> {
        let is_late = self.inner.time_budget.is_some_and(|budget| begin.elapsed() >= budget);
        if is_late || !(problem.check_bounds()? || problem.has_constraints()) {
            return Ok(status);
        }
        problem.multipliers(&mut self.outcome.multipliers);
        let (solution, outcome) = (self.solver.solution.clone(), self.outcome.clone());
        let first = Attempt { status, solution, outcome, lost: self.lost };
        let held_xs = problem.x0().repeat(problem.horizon() + 1);
        let held_us = problem.quasi_static(&held_xs)?;
        let finite = held_us.iter().all(|u| u.is_finite());
        if !finite || (held_xs == xs && held_us == us) {
            return Ok(status);
        }
        let second = self.attempt(problem, Some([&held_xs, &held_us]), observer, begin, false)?;
        let (solves, iterations) = (first.outcome.solves, first.outcome.iterations);
        let solved = second == Status::Converged || second == Status::Infeasible && !self.lost;
        let better = solved || self.outcome.primal < first.outcome.primal;
        if !better {
            let stopped = matches!(second, Status::TimeLimit | Status::Interrupted);
            let counts = (self.outcome.solves, self.outcome.iterations);
            (self.solver.solution, self.outcome, self.lost) = (first.solution, first.outcome, first.lost);
            problem.set_multipliers(&self.outcome.multipliers);
            (self.outcome.solves, self.outcome.iterations) = (solves + counts.0, iterations + counts.1);
            return Ok(if stopped { second } else { first.status });
        }
        self.outcome.solves += solves;
        self.outcome.iterations += iterations;
        Ok(second)
    }
}
