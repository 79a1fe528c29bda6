//! Storage of the best iterate of a solve, which is restored at the end if the last iterate is worse.

use super::iterate::Iterate;
use crate::problem::Problem;

/// Largest difference of two gaps that count as equal. Gaps are differences of rounded states.
const SAME_GAP: f64 = 1e-12;
/// Largest difference of two costs that count as equal, relative to 1 + cost. Costs are rounded sums.
const SAME_COST: f64 = 1e-12;
/// Bound on the cost of an iterate. An iterate has diverged if its cost exceeds the lowest cost of the solve by more
/// than 1e8·(1 + |lowest|), whatever its gaps. The bound is high because closing the gaps of a warm start may raise the
/// cost. For example, a term with weight 1e6 at a distance of ten stays within the bound.
/// distance of ten is still within the bound.
const RUNAWAY: f64 = 1e8;

/// Merit of an iterate, and the values from which its feedback was computed. An iterate within the bounds on controls
/// is better than an iterate outside the bounds. Next, the iterate with the smaller gap is better; for equal gaps, the
/// iterate with the lower cost.
#[derive(Debug, Clone, Copy)]
pub(super) struct Merit {
    /// Largest gap of the iterate.
    pub(super) gap: f64,
    pub(super) cost: f64,
    /// Whether the iterate counts as feasible.
    pub(super) feasible: bool,
    /// Whether all controls are within their bounds. Only a warm start that was not projected can violate them.
    pub(super) bounded: bool,
    /// Number of accepted steps that led to the iterate.
    pub(super) steps: usize,
    /// Regularisation of the sweep at the iterate.
    pub(super) regularisation: f64,
}

/// Best iterate so far for which the solver found a search direction.
///
/// An accepted step replaces the current iterate. The old iterate is stored here, if it is the best, by an exchange of
/// buffers without a copy.
#[derive(Debug, Clone)]
pub(super) struct Best {
    xs: Vec<f64>,
    us: Vec<f64>,
    /// Next states φₜ(xₜ, uₜ), N·nx.
    next: Vec<f64>,
    merit: Option<Merit>,
    /// Lowest cost of all iterates of this solve, including the warm start.
    lowest: f64,
}

impl Best {
    /// Allocates the storage for an iterate of `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        let shape = problem.shape();
        let horizon = shape.horizon();
        Self {
            xs: vec![0.0; (horizon + 1) * shape.nx],
            us: vec![0.0; shape.offsets[horizon]],
            next: vec![0.0; horizon * shape.nx],
            merit: None,
            lowest: f64::INFINITY,
        }
    }

    /// Adapts the storage to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.us.resize(problem.shape().offsets[problem.horizon()], 0.0);
    }

    /// Removes the stored iterate of the last solve.
    pub(super) fn start(&mut self) {
        (self.merit, self.lowest) = (None, f64::INFINITY);
    }

    /// Stores the iterate from which an accepted step starts, unless the stored iterate is better. The two iterates
    /// exchange their buffers. Returns whether the iterate was stored.
    pub(super) fn leave(&mut self, iterate: &mut Iterate, merit: Merit) -> bool {
        self.lowest = self.lowest.min(merit.cost);
        let good = !self.is_better_than(&merit);
        if good {
            self.exchange(iterate);
            self.merit = Some(merit);
        }
        good
    }

    /// Returns whether an iterate is stored that is better than an iterate with the merit `other`.
    pub(super) fn is_better_than(&self, other: &Merit) -> bool {
        let Some(best) = &self.merit else { return false };
        let lowest = self.lowest.min(other.cost);
        let ran_away = |cost: f64| cost - lowest > RUNAWAY * (1.0 + lowest.abs());
        match (ran_away(best.cost), ran_away(other.cost)) {
            (false, true) => true,
            (true, false) => false,
            _ if best.bounded != other.bounded => best.bounded,
            _ if (other.gap - best.gap).abs() > SAME_GAP => other.gap > best.gap,
            _ => other.cost - best.cost > SAME_COST * (1.0 + best.cost.abs()),
        }
    }

    /// Makes the best iterate the current one, if one is stored, and returns its merit.
    pub(super) fn restore(&mut self, iterate: &mut Iterate) -> Option<Merit> {
        let merit = self.merit.take()?;
        self.exchange(iterate);
        (iterate.solution.gap, iterate.solution.cost) = (merit.gap, merit.cost);
        Some(merit)
    }

    fn exchange(&mut self, iterate: &mut Iterate) {
        std::mem::swap(&mut self.xs, &mut iterate.solution.xs);
        std::mem::swap(&mut self.us, &mut iterate.solution.us);
        std::mem::swap(&mut self.next, &mut iterate.next);
    }
}
