//! Start of a solve that follows an earlier solve. It is the last trajectory shifted by a knot, or the quasi-static
//! start if that trajectory is lost.

use super::iterate::Iterate;
use super::settings::Settings;
use super::solution::{Fallback, Status};
use super::solver_loop::SolverLoop;
use crate::error::Error;
use crate::lq::{LqKnot, Sweep};
use crate::problem::Problem;

/// Maximum excess of the cost of a start over the cost c of the last solution, relative to 1 + |c|. A push of the state
/// or a new reference rarely raises the cost more. If the end of the horizon diverges, the excess passes this limit
/// within a few shifts (measured: 0.3, 1e3, 2e4, 3e7).
const LOST: f64 = 10.0;

/// Returns x̂₀ at all knots, and the controls that hold x̂₀ still. Allocates.
///
/// # Errors
/// [`Error`] if an entry of x̂₀ is not finite.
pub(super) fn quasi_static_start(problem: &mut Problem) -> Result<[Vec<f64>; 2], Error> {
    let xs = problem.x0().repeat(problem.horizon() + 1);
    let us = problem.quasi_static(&xs)?;
    Ok([xs, us])
}

/// Returns whether the start of a resumed solve is lost: its cost or its largest gap is not finite, or it costs far
/// more than the last solution.
pub(super) fn is_lost(cost: f64, gap: f64, last_cost: f64) -> bool {
    let limit = if last_cost.is_finite() { LOST * (1.0 + last_cost.abs()) } else { f64::INFINITY };
    !(gap.is_finite() && cost.is_finite() && cost - last_cost <= limit)
}

impl SolverLoop {
    /// Replaces a lost start of a resumed solve by x̂₀ at all knots and the controls that hold x̂₀ still, if the
    /// replacement costs less. A start is lost if its cost or a gap is not finite, or if it costs far more than the
    /// last solution. Returns the largest gap of the start. Allocates only if the start is lost.
    pub(super) fn recover(&mut self, problem: &mut Problem, settings: &Settings, gap: f64, last_cost: f64) -> f64 {
        let cost = self.iterate.solution.cost;
        if !is_lost(cost, gap, last_cost) {
            return gap;
        }
        let Ok([mut xs, mut us]) = quasi_static_start(problem) else { return gap };
        let solution = &mut self.iterate.solution;
        std::mem::swap(&mut solution.xs, &mut xs);
        std::mem::swap(&mut solution.us, &mut us);
        if settings.project_warm_start {
            solution.project(problem, 0..problem.horizon());
        }
        let start_gap = self.iterate.evaluate(problem);
        let start_cost = self.iterate.solution.cost;
        let is_finite = start_gap.is_finite() && start_cost.is_finite();
        if is_finite && !(gap.is_finite() && start_cost >= cost) {
            self.iterate.solution.fallback = Some(Fallback::HeldStill);
            return start_gap;
        }
        (self.iterate.solution.xs, self.iterate.solution.us) = (xs, us);
        self.iterate.evaluate(problem)
    }

    /// Shifts the trajectory and its gains by one knot: see [`Fddp::shift`](crate::Fddp::shift).
    ///
    /// # Errors
    /// [`Error`] if the numbers of knots, states and controls differ from the numbers of the last problem, shifted
    /// once.
    pub(super) fn shift(&mut self, problem: &mut Problem, settings: &Settings) -> Result<(), Error> {
        self.prepared = None;
        let Iterate { solution, next, .. } = &mut self.iterate;
        let (old, new) = (solution.shape(), problem.shape());
        let (horizon, ndx) = (new.horizon(), new.ndx);
        if old.horizon() != horizon {
            return Err(Error::Length { name: "knot_models", expected: old.horizon(), found: horizon });
        }
        let controls = (0..horizon - 1).map(|t| (t, "nu", old.nu(t + 1), new.nu(t)));
        let states = [(0, "nx", old.nx, new.nx), (0, "ndx", old.ndx, new.ndx)];
        if let Some((knot, name, expected, found)) = controls.chain(states).find(|(_, _, old, new)| old != new) {
            return Err(Error::Dimension { knot, name, expected, found });
        }
        solution.shift(new);
        if (0..horizon).any(|t| self.knots[t].nu() != new.nu(t)) {
            self.knots[..horizon].rotate_left(1);
            self.knots[horizon - 1] = LqKnot::zeros(ndx, new.nu(horizon - 1));
            problem.reserve_inverse_dynamics(&mut self.knots);
            self.sweep = Sweep::new(&self.knots);
        }
        self.line_search.reshape(problem);
        self.best.reshape(problem);
        let last = horizon - 1;
        if !problem.continues_controls(last) {
            solution.hold_still(problem, last);
        }
        if settings.project_warm_start {
            solution.project(problem, last..horizon);
        }
        if !std::mem::take(&mut self.renewed) {
            return Ok(()); // the last state stays repeated: x_N = x_{N−1}
        }
        // the last state is x_N = φ(x_{N−1}, u_{N−1}), if this state is finite
        let new = problem.shape();
        let (x, u, end) = (new.x(last), new.u(last), new.x(horizon));
        let next = &mut next[..end.len()];
        problem.action_mut(last).calc(last, &solution.xs[x], &solution.us[u], next);
        if next.iter().all(|x| x.is_finite()) {
            solution.xs[end].copy_from_slice(next);
        }
        Ok(())
    }

    /// Starts anew from x̂₀ = `x0`: see [`Fddp::reset`](crate::Fddp::reset).
    ///
    /// # Errors
    /// The errors of [`Problem::set_x0`]. [`Error::Dimension`] if the problem has other dimensions than the solver.
    pub(super) fn reset(&mut self, problem: &mut Problem, settings: &Settings, x0: &[f64]) -> Result<(), Error> {
        self.iterate.solution.shape().check(problem.shape())?;
        problem.set_x0(x0)?;
        let [xs, us] = quasi_static_start(problem)?;
        let finite_or_zero = |u: f64| if u.is_finite() { u } else { 0.0 };
        let solution = &mut self.iterate.solution;
        solution.xs.copy_from_slice(&xs);
        solution.us.iter_mut().zip(us).for_each(|(to, u)| *to = finite_or_zero(u));
        if settings.project_warm_start {
            solution.project(problem, 0..problem.horizon());
        }
        self.forget_gains();
        let solution = &mut self.iterate.solution;
        solution.trace.clear();
        (solution.cost, solution.gap, solution.feasible) = (f64::INFINITY, f64::INFINITY, false);
        (solution.status, solution.fallback) = (Status::MaxIterations, Some(Fallback::HeldStill));
        (self.started, self.renewed, self.prepared) = (true, true, None);
        Ok(())
    }
}
