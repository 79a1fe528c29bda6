//! Iterations of a solve, and its reasons to stop.

use super::clock::Phase;
use super::fddp::Fddp;
use super::observer::PacedObserver;
use super::progress::Progress;
use super::search::{Iterate, Search};
use super::settings::DdpMethod;
use super::solution::{Iteration, Status};
use crate::lq::SweepError;
use crate::problem::Problem;

impl Fddp {
    /// Iterates from a start with the given largest gap until one of the reasons to stop occurs.
    pub(super) fn iterate(
        &mut self,
        problem: &mut Problem,
        now: &mut Progress,
        mut gap: f64,
        watch: &mut PacedObserver<'_>,
    ) -> Status {
        if !(self.solution.cost.is_finite() && gap.is_finite()) {
            return Status::NotFinite;
        }
        let mut search = Search::default();
        for iteration in 0..self.settings.max_iterations {
            if search.accepted {
                gap = self.update_gaps(problem);
            }
            self.sweep.keep_values(self.settings.counts_gaps(now.feasible));
            let mut swept = None;
            if search.accepted || iteration == 0 {
                let phases = [Phase::CalcDiff, Phase::Sweep];
                if let Err(status) = self.clock.allows(&phases[..1 + usize::from(self.follows())], watch) {
                    return status;
                }
                swept = self.calc_diff(problem, now.feasible, now.regularisation);
            }
            if swept.is_none()
                && let Err(status) = self.clock.allows(&[Phase::Sweep], watch)
            {
                return status;
            }
            now.swept_best = false;
            while let Err(error) = swept.take().unwrap_or_else(|| self.sweep(problem, now.regularisation)) {
                now.regularisation = self.increased(now.regularisation);
                if now.regularisation == self.settings.regularisation_max {
                    return match error {
                        SweepError::NotPositive { .. } => Status::RegularisationLimit,
                        SweepError::NotFinite { .. } => Status::NotFinite,
                    };
                }
                if let Err(status) = self.clock.allows(&[Phase::Sweep], watch) {
                    return status;
                }
            }
            now.swept = true;
            let Self { line_search, solution, next, motions, gaps, best, sweep, settings, clock, .. } = self;
            let (feedback, feasible) = (sweep.feedback(), now.feasible);
            let value = now.value(gap, solution.cost);
            let iterate =
                Iterate { solution, next, motions, value, best, gaps, feedback, feasible, settings, clock, watch };
            search = line_search.run(problem, iterate, search);
            if let Some(status) = search.stopped {
                return status;
            }
            if search.accepted {
                (now.bounded, now.steps) = (true, now.steps + 1);
                now.swept_best = search.left_best;
                now.was_feasible = now.feasible;
                now.feasible |= search.step == 1.0 || self.settings.method == DdpMethod::Ddp;
            }
            if search.step > self.settings.regularisation_decrease_above {
                now.regularisation = self.decreased(now.regularisation);
            }
            if search.step <= self.settings.regularisation_increase_below {
                now.regularisation = self.increased(now.regularisation);
            }
            let stop = (search.d1 + 0.5 * search.d2).abs(); // expected decrease for α = 1
            let record = Iteration {
                iteration,
                cost: self.solution.cost,
                gap,
                stop,
                step: search.step,
                regularisation: now.regularisation,
                d1: search.d1,
                d2: search.d2,
                decrease: search.decrease,
                expected_decrease: search.expected_decrease,
                feasible: now.feasible,
                accepted: search.accepted,
            };
            self.solution.trace.push(record);
            self.clock.end_guarantee();
            let verdict = watch.iteration(&record);
            if now.regularisation == self.settings.regularisation_max {
                return Status::RegularisationLimit;
            }
            if now.was_feasible && stop < now.tolerance {
                return Status::Converged;
            }
            if verdict.is_break() {
                return Status::Interrupted;
            }
        }
        Status::MaxIterations
    }

    fn increased(&self, regularisation: f64) -> f64 {
        (regularisation * self.settings.regularisation_factor).min(self.settings.regularisation_max)
    }

    fn decreased(&self, regularisation: f64) -> f64 {
        (regularisation / self.settings.regularisation_factor).max(self.settings.regularisation_min)
    }
}
