//! Start of a resumed solve: the last trajectory, or x̂₀ held still if that trajectory is lost.

use super::fddp::Fddp;
use super::solution::Status;
use crate::problem::Problem;

/// Factor by which the cost of a start may exceed the cost of the last solution, with 1 added to both. A push of the
/// state or a new reference rarely raises the cost more. A horizon whose end diverges exceeds it within a few shifts
/// (measured: 0.3, 1e3, 2e4, 3e7).
const LOST: f64 = 10.0;

impl Fddp {
    /// Replaces the start of a resumed solve by x̂₀ at all knots and the controls that hold it still, if the start is
    /// lost and this costs less. A start is lost if its cost or a gap is not finite, or if it costs far more than the
    /// last solution. Returns the largest gap of the start. Allocates only if a start is lost.
    pub(super) fn recover(&mut self, problem: &mut Problem, gap: f64, last_cost: f64) -> f64 {
        let cost = self.solution.cost;
        let limit = if last_cost.is_finite() { LOST * (1.0 + last_cost.abs()) } else { f64::INFINITY };
        if gap.is_finite() && cost.is_finite() && cost - last_cost <= limit {
            return gap;
        }
        let held_xs = problem.x0().repeat(problem.horizon() + 1);
        let Ok(held_us) = problem.quasi_static(&held_xs) else { return gap };
        let lost =
            (std::mem::replace(&mut self.solution.xs, held_xs), std::mem::replace(&mut self.solution.us, held_us));
        if self.settings.project_warm_start {
            self.solution.project(problem, 0..problem.horizon());
        }
        let held_gap = self.start(problem);
        let is_finite = held_gap.is_finite() && self.solution.cost.is_finite();
        if is_finite && !(gap.is_finite() && self.solution.cost >= cost) {
            return held_gap;
        }
        (self.solution.xs, self.solution.us) = lost;
        self.start(problem)
    }

    /// Computes dynamics, cost and gaps of the start; returns the largest gap.
    pub(super) fn start(&mut self, problem: &mut Problem) -> f64 {
        self.calc(problem);
        self.update_gaps(problem)
    }

    /// Returns the regularisation with which a resumed solve begins. If the last solve ran out of time or iterations
    /// after a rejected step, it is the regularisation of its end: with a smaller one, the same step would be rejected
    /// again.
    pub(super) fn resumed_regularisation(&self) -> f64 {
        let start = self.settings.regularisation_start;
        let stopped = matches!(self.solution.status, Status::TimeLimit | Status::MaxIterations | Status::Interrupted);
        match self.solution.trace.last() {
            Some(last) if stopped && !last.accepted => last.regularisation.max(start),
            _ => start,
        }
    }
}
