//! Prediction of the state while a plan is executed, for example during the latency of a controller.
#![allow(non_snake_case)] // names follow the literature: K

use super::solution::Solution;
use crate::error::{Error, assert_length};
use crate::problem::{Problem, innermost};

/// Largest duration of an integration step (s).
const STEP: f64 = 2e-3;
/// Times (s) that differ by less are equal.
const SAME_TIME: f64 = 1e-9;

impl Solution {
    /// Predicts the state at the time `then` (s) from the state x at the time `now`, into `out`. It integrates the
    /// dynamics of the knots, with the controls of the policy: u = ūₖ + Kₖ (x ⊖ x̄), moved into the bounds of the knot.
    /// Times are counted from the beginning of knot 0, as in [`at`](Self::at). After the horizon, the last knot
    /// continues. The steps take at most 2 ms.
    ///
    /// A controller predicts the state at which its next plan begins, while the robot executes the present plan. It
    /// calls this method before it moves the horizon: `problem` must have the knots of the solution. Allocates only at
    /// the first call.
    ///
    /// ```
    /// # use condyle_dynamics::robots;
    /// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// # use condyle_optimal::{Fddp, Problem};
    /// # let arm = std::sync::Arc::new(robots::arm7());
    /// # let effort = Residual::Control { reference: vec![0.0; 7] };
    /// # let costs = vec![Cost::new("effort", 1.0, effort, Activation::Quadratic)];
    /// # let knot = Box::new(FreeDynamics::running(arm.clone(), 0.02, costs)?);
    /// # let (x0, end) = (vec![0.1; 14], Box::new(FreeDynamics::terminal(arm, vec![])?));
    /// # let mut problem = Problem::new(x0.clone(), vec![knot], vec![0; 10], end)?;
    /// # let mut solver = Fddp::new(&problem);
    /// # solver.solve(&mut problem, &x0.repeat(11), &vec![0.0; 70])?;
    /// let measured = x0; // at the beginning of the plan
    /// let mut ahead = vec![0.0; 14];
    /// solver.solution().predict(&mut problem, &measured, 0.0, 0.005, &mut ahead)?;
    /// problem.set_x0(&ahead)?; // the next plan begins 5 ms later
    /// # assert!((ahead[0] - 0.1 - 0.005 * 0.1).abs() < 0.005);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error`] if x does not have nx finite numbers, [`Error::NotFinite`] for a time that is not finite,
    /// [`Error::NoDuration`] for a knot of a user-defined action, and [`Error::Dimension`] if the problem has other
    /// dimensions than the solution.
    ///
    /// # Panics
    /// If `out` does not have nx numbers.
    #[track_caller]
    pub fn predict(&self, problem: &mut Problem, x: &[f64], now: f64, then: f64, out: &mut [f64]) -> Result<(), Error> {
        assert_length("out", out.len(), problem.nx());
        self.shape().check(problem.shape())?;
        Error::check("x", x, problem.nx())?;
        Error::check_finite("time", &[now, then])?;
        out.copy_from_slice(x);
        let mut scratch = core::mem::take(problem.scratch());
        let result = self.integrate(problem, &mut scratch, now, then, out);
        *problem.scratch() = scratch;
        result
    }

    /// Integrates the state x from the time `now` to the time `then`.
    fn integrate(
        &self,
        problem: &mut Problem,
        scratch: &mut Vec<f64>,
        now: f64,
        then: f64,
        x: &mut [f64],
    ) -> Result<(), Error> {
        let (nx, ndx, last) = (problem.nx(), problem.ndx(), problem.horizon() - 1);
        let most = (0..=last).map(|knot| problem.nu(knot)).max().unwrap_or(0);
        scratch.resize(2 * nx + 2 * ndx + most, 0.0);
        let (next, rest) = scratch.split_at_mut(nx);
        let (planned, rest) = rest.split_at_mut(nx);
        let (dx, rest) = rest.split_at_mut(ndx);
        let (along, u) = rest.split_at_mut(ndx);
        let (mut begin, mut time) = (0.0, now);
        for knot in 0..=last {
            let duration = problem.duration(knot).ok_or(Error::NoDuration { knot })?;
            let end = begin + duration;
            if duration == 0.0 && begin > now && begin <= then {
                problem.action_mut(knot).calc(knot, x, &[], next); // an impact
                x.copy_from_slice(next);
            }
            let until = if knot == last { then } else { end.min(then) };
            if problem.nu(knot) > 0 && until > time + SAME_TIME {
                let count = ((until - time) / STEP - 1e-6).ceil().max(1.0);
                let h = (until - time) / count;
                problem.difference(self.x(knot), self.x(knot + 1), along);
                for step in 0..count as usize {
                    let s = ((time + step as f64 * h - begin) / duration).clamp(0.0, 1.0);
                    dx.iter_mut().zip(&*along).for_each(|(dx, along)| *dx = s * along);
                    problem.action(last + 1).integrate(self.x(knot), dx, planned);
                    problem.difference(planned, x, dx);
                    let u = &mut u[..problem.nu(knot)];
                    u.copy_from_slice(self.u(knot));
                    for (column, dx) in self.K[knot].column_iter().zip(&*dx) {
                        u.iter_mut().zip(column.iter()).for_each(|(u, K)| *u += K * dx);
                    }
                    let action = problem.action_mut(knot);
                    if let Some((lower, upper)) = action.bounds(knot) {
                        u.iter_mut().zip(lower.iter().zip(upper)).for_each(|(u, (lower, upper))| {
                            *u = u.max(*lower).min(*upper);
                        });
                    }
                    if !innermost(action).is_some_and(|group| group.advance(knot, x, u, h, next)) {
                        return Err(Error::NoDuration { knot });
                    }
                    x.copy_from_slice(next);
                }
                time = until;
            }
            begin = end;
        }
        Ok(())
    }
}
