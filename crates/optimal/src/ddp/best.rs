//! Best iterate of a solve, restored at the end if the last iterate is worse.
#![allow(non_snake_case)] // K besides k: names of the literature

use super::fddp::Fddp;
use super::progress::{Progress, Value};
use super::solution::{Solution, Status};
use crate::problem::Problem;

/// Largest difference of two gaps that count as equal: gaps are differences of states, which are rounded.
const SAME_GAP: f64 = 1e-12;
/// Largest difference of two costs that count as equal, relative to 1 + cost: costs are sums, which are rounded.
const SAME_COST: f64 = 1e-12;
/// Bound on the cost of an iterate: it has diverged if its cost exceeds the lowest of the solve by more than 1e8·(1 +
/// |lowest|), whatever its gaps. Iterates that close gaps may cost much more than the warm start. A weight of 1e6 at a
/// distance of ten is still within the bound.
const RUNAWAY: f64 = 1e8;

/// Best iterate from which a direction could be computed. An iterate within the bounds on controls is better than one
/// outside. Next, the smaller gap is better, and for equal gaps the lower cost.
///
/// When a step is accepted, the old iterate may be stored here by an exchange of buffers; nothing is copied.
#[derive(Debug, Clone)]
pub(super) struct Best {
    xs: Vec<f64>,
    us: Vec<f64>,
    /// φₜ(xₜ, uₜ), N·nx.
    next: Vec<f64>,
    value: Option<Value>,
    /// Lowest cost of all iterates of this solve, warm start included.
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
            value: None,
            lowest: f64::INFINITY,
        }
    }

    /// Adapts the storage to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.us.resize(problem.shape().offsets[problem.horizon()], 0.0);
    }

    /// Forgets the iterates of the last solve.
    pub(super) fn start(&mut self) {
        (self.value, self.lowest) = (None, f64::INFINITY);
    }

    /// Exchanges the iterate that a step leaves with the best one, unless it is worse. Returns whether it is now the
    /// best.
    pub(super) fn leave(&mut self, solution: &mut Solution, next: &mut Vec<f64>, value: Value) -> bool {
        self.lowest = self.lowest.min(value.cost);
        let good = !self.is_better_than(&value);
        if good {
            self.exchange(solution, next);
            self.value = Some(value);
        }
        good
    }

    /// Returns whether an iterate is stored that is better than an iterate with the value `other`.
    pub(super) fn is_better_than(&self, other: &Value) -> bool {
        let Some(best) = &self.value else { return false };
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

    /// Moves the best iterate into the solution, if one is stored, and returns its value.
    pub(super) fn restore(&mut self, solution: &mut Solution, next: &mut Vec<f64>) -> Option<Value> {
        let value = self.value.take()?;
        self.exchange(solution, next);
        Some(value)
    }

    fn exchange(&mut self, solution: &mut Solution, next: &mut Vec<f64>) {
        std::mem::swap(&mut self.xs, &mut solution.xs);
        std::mem::swap(&mut self.us, &mut solution.us);
        std::mem::swap(&mut self.next, next);
    }
}

impl Fddp {
    /// Completes the solution at the end of a solve, from the last iterate or a better one.
    pub(super) fn finish(&mut self, problem: &mut Problem, now: &mut Progress, status: Status) {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        self.solution.gap = infinite_if_nan(self.update_gaps(problem));
        self.solution.cost = infinite_if_nan(self.solution.cost);
        let Solution { gap, cost, .. } = self.solution;
        let last = now.value(gap, cost);
        let regularisation = now.regularisation;
        let goes_back = match status {
            Status::Converged => false,
            Status::NotFinite => true, // no direction exists at the last iterate
            _ => self.best.is_better_than(&last),
        };
        if goes_back && let Some(best) = self.best.restore(&mut self.solution, &mut self.next) {
            (self.solution.gap, self.solution.cost) = (best.gap, best.cost);
            (now.feasible, now.steps) = (best.feasible, best.steps);
            self.update_gaps(problem);
            self.knows_motions = false;
            if !now.swept_best {
                self.sweep.keep_values(false);
                let swept = self.calc_diff(problem, best.feasible, best.regularisation);
                now.swept = swept.unwrap_or_else(|| self.sweep(problem, best.regularisation)).is_ok();
            }
        }
        self.renewed |= now.steps > 0;
        let solution = &mut self.solution;
        solution.feasible = now.feasible;
        solution.regularisation = regularisation;
        solution.status = status;
        if !now.swept {
            return; // keep the gains of the previous solve, shifted or not
        }
        for ((K, k), feedback) in solution.K.iter_mut().zip(&mut solution.k).zip(self.sweep.feedback()) {
            K.copy_from(&feedback.K);
            k.copy_from(&feedback.k);
        }
    }
}
