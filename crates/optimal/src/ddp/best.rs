//! The best iterate of a solve, to go back to at the end when the last one is worse.
#![allow(non_snake_case)] // K beside k, the names of the literature

use super::fddp::Fddp;
use super::progress::{Progress, Value};
use super::solution::{Solution, Status};
use crate::problem::Problem;

/// Gaps that differ by less are the same: they are differences of states, which are rounded.
const SAME_GAP: f64 = 1e-12;
/// Costs that differ by less, beside 1 + their size, are the same: they are sums, which are rounded.
const SAME_COST: f64 = 1e-12;
/// An iterate that costs so many times as much as the cheapest one of the solve, and 1, has run away, whatever its gaps:
/// those that close gaps may cost much more than the warm start, but a weight of 1e6 at a distance of ten is still within
/// it.
const RUNAWAY: f64 = 1e8;

/// The best iterate from which a direction could be computed: one within the bounds on controls, then the one with the
/// smallest gap, and among equals the cheapest.
///
/// An iterate comes here when a step from it is accepted, by an exchange of buffers; nothing is copied.
#[derive(Debug, Clone)]
pub(super) struct Best {
    xs: Vec<f64>,
    us: Vec<f64>,
    /// φₜ(xₜ, uₜ), N·nx.
    next: Vec<f64>,
    value: Option<Value>,
    /// The lowest cost of an iterate of this solve, that of the warm start included.
    lowest: f64,
}

impl Best {
    /// Room for an iterate of `problem`.
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

    /// Makes room for a problem of which only the numbers of controls changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.us.resize(problem.shape().offsets[problem.horizon()], 0.0);
    }

    /// A solve begins.
    pub(super) fn start(&mut self) {
        (self.value, self.lowest) = (None, f64::INFINITY);
    }

    /// Exchanges the iterate that a step leaves with the best one, if it is not worse. Returns whether it is the best one
    /// now.
    pub(super) fn leave(&mut self, solution: &mut Solution, next: &mut Vec<f64>, value: Value) -> bool {
        self.lowest = self.lowest.min(value.cost);
        let good = !self.is_better_than(&value);
        if good {
            self.exchange(solution, next);
            self.value = Some(value);
        }
        good
    }

    /// Whether there is an iterate that is better than one of this value.
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

    /// Makes the best iterate that of the solution, if there is one. Returns what it is worth.
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
    /// Fills what the iterations leave open in the solution, of the last iterate or of a better one.
    pub(super) fn finish(&mut self, problem: &mut Problem, now: &mut Progress, status: Status) {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        self.solution.gap = infinite_if_nan(self.update_gaps(problem));
        self.solution.cost = infinite_if_nan(self.solution.cost);
        let Solution { gap, cost, .. } = self.solution;
        let last = now.value(gap, cost);
        let regularisation = now.regularisation;
        let goes_back = match status {
            Status::Converged => false,
            Status::NotFinite => true, // there is no direction at the last one
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
            return; // the gains of the solve before, shifted or not
        }
        for ((K, k), knot) in solution.K.iter_mut().zip(&mut solution.k).zip(self.sweep.knots()) {
            K.copy_from(&knot.K);
            k.copy_from(&knot.k);
        }
    }
}
