//! Receding horizons: the solution of one problem as the warm start of the next.

use super::fddp::Fddp;
use crate::error::Error;
use crate::lq::{LqKnot, Sweep};
use crate::problem::Problem;

impl Fddp {
    /// Turns the solution into a warm start for a problem that has been [shifted](Problem::shift) by one knot since.
    /// States, controls and gains move one knot to the front, and the last control is repeated (it is zero where the
    /// number of controls changes). Allocates only if the number of controls differs along the horizon.
    ///
    /// The last state follows from the last control, x_N = φ(x_{N−1}, u_{N−1}), if the trajectory comes from a warm
    /// start or from a solve that took a step. At each further shift without such a solve, the last state is repeated,
    /// x_N = x_{N−1}, and the next solve closes the gap. Nothing stabilises a rollout with repeated controls: without
    /// this rule, the end of the horizon would diverge exponentially while solves run out of time.
    ///
    /// # Errors
    /// [`Error`] if the numbers of knots, states and controls differ from the last problem, shifted once.
    pub fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let (old, new) = (self.solution.shape(), problem.shape());
        let (horizon, ndx) = (new.horizon(), new.ndx);
        if old.horizon() != horizon {
            return Err(Error::Length { name: "knot_models", expected: old.horizon(), found: horizon });
        }
        for t in 0..horizon - 1 {
            if old.nu(t + 1) != new.nu(t) {
                return Err(Error::Dimension { knot: t, name: "nu", expected: old.nu(t + 1), found: new.nu(t) });
            }
        }
        for (name, expected, found) in [("nx", old.nx, new.nx), ("ndx", old.ndx, new.ndx)] {
            if expected != found {
                return Err(Error::Dimension { knot: 0, name, expected, found });
            }
        }
        self.solution.shift(new);
        if (0..horizon).any(|t| self.lq_knots[t].nu() != new.nu(t)) {
            self.lq_knots[..horizon].rotate_left(1);
            self.lq_knots[horizon - 1] = LqKnot::zeros(ndx, new.nu(horizon - 1));
            problem.reserve_inverse_dynamics(&mut self.lq_knots);
            self.sweep = Sweep::new(&self.lq_knots);
        }
        self.line_search.reshape(problem);
        self.best.reshape(problem);
        if self.settings.project_warm_start {
            self.solution.project(problem, horizon - 1..horizon);
        }
        if !std::mem::take(&mut self.renewed) {
            return Ok(()); // x_N = x_{N−1}
        }
        // x_N = φ(x_{N−1}, u_{N−1}), if it is a valid state
        let new = problem.shape();
        let (x, u, end) = (new.x(horizon - 1), new.u(horizon - 1), new.x(horizon));
        let next = &mut self.next[..end.len()];
        problem.action_mut(horizon - 1).calc(horizon - 1, &self.solution.xs[x], &self.solution.us[u], next);
        if next.iter().all(|x| x.is_finite()) {
            self.solution.xs[end].copy_from_slice(next);
        }
        Ok(())
    }
}
