//! The line search of differential dynamic programming: what a step should gain, and whether it does.

use crate::clock::Phase;
use crate::fddp::Fddp;
use crate::problem::Problem;
use crate::rollout::Nominal;
use crate::settings::Method;
use crate::solution::Solution;
use condyle_linalg::{View, add_scaled_product, dot};
use std::time::Instant;

/// How many step lengths are tried side by side when the first one fails: beside dynamics in lanes each costs something of
/// its own, and the next few mostly have a good one.
const SECOND: usize = 4;

/// The outcome of a line search: of the trial it accepted or else of the last that stayed finite.
#[derive(Clone, Copy, Default)]
pub(crate) struct Search {
    pub(crate) step: f64,
    pub(crate) d1: f64,
    pub(crate) d2: f64,
    pub(crate) decrease: f64,
    pub(crate) expected_decrease: f64,
    pub(crate) accepted: bool,
    /// There was no time for another trial.
    pub(crate) out_of_time: bool,
}

impl Fddp {
    /// Whether gaps count in what a step should gain.
    pub(crate) fn gaps_count(&self, feasible: bool) -> bool {
        !feasible && self.settings.method == Method::Fddp
    }

    /// dg = −Σ Quᵀk − Σ (Vx + Vxx f)ᵀf,   dq = −Σ kᵀQuu k + Σ fᵀVxx f;  DDP leaves the gaps f out.
    pub(crate) fn expect(&mut self, feasible: bool) {
        let (mut dg, mut dq) = (0.0, 0.0);
        let gaps = self.gaps_count(feasible);
        for (t, knot) in self.sweep.knots().iter().enumerate() {
            dg -= knot.expected[0];
            dq -= knot.expected[1];
            if gaps {
                let place = self.solution.shape().dx(t);
                let (f, curved) = (&self.gaps[place.clone()], &mut self.curved_gaps[place]);
                curved.fill(0.0);
                add_scaled_product(curved, 1.0, View::new(knot.Vxx.as_slice(), f.len()), f); // Vxx f
                let curvature = dot(f, curved);
                dg -= dot(knot.Vx.as_slice(), f) + curvature;
                dq += curvature;
            }
        }
        self.expected = [dg, dq];
    }

    /// dv = −Σ fᵀVxx (x ⊖ x_trial): what the trial's distance from the iterate adds while there are gaps.
    fn expect_of_trial(&mut self, problem: &Problem, i: usize) -> f64 {
        let shape = self.solution.shape();
        let mut dv = 0.0;
        for t in 0..=shape.horizon() {
            problem.action(t).difference(self.trials.x(i, t), &self.solution.xs[shape.x(t)], &mut self.dx);
            dv -= dot(&self.curved_gaps[shape.dx(t)], &self.dx);
        }
        dv
    }

    /// Tries α = 1, ½, ¼, … until a step is accepted, which becomes the iterate.
    ///
    /// A trial that leaves all bounds keeps the expectation of the trial before it; the first one has that of the line
    /// search before, `last`, or in DDP, where it does not depend on the trial, that of this one.
    pub(crate) fn line_search(&mut self, problem: &mut Problem, feasible: bool, last: Search) -> Search {
        let mut search = Search { accepted: false, ..last };
        let gaps = !feasible && self.settings.method == Method::Fddp;
        if self.settings.method == Method::Ddp {
            [search.d1, search.d2] = self.expected;
        }
        let (mut tried, count) = (0, self.steps.len());
        while tried < count {
            let most = match tried {
                0 => 1,
                1 => SECOND,
                _ => count,
            };
            let width = most.min(self.trials.width()).min(count - tried);
            if !self.clock.allows(Phase::Rollout) {
                search.out_of_time = true;
                return search;
            }
            self.roll_out(problem, gaps, tried, width);
            for i in 0..width {
                search.step = self.steps[tried + i];
                let Some(cost) = self.trials.cost(i) else { continue };
                // d₁ = dg + dv,   d₂ = dq − 2 dv,   expected decrease α (d₁ + ½ α d₂)
                let dv = if gaps { self.expect_of_trial(problem, i) } else { 0.0 };
                search.d1 = self.expected[0] + dv;
                search.d2 = self.expected[1] - 2.0 * dv;
                search.expected_decrease = search.step * (search.d1 + 0.5 * search.step * search.d2);
                search.decrease = self.solution.cost - cost;
                if self.accepts(&search, feasible) {
                    let Solution { xs, us, .. } = &mut self.solution;
                    self.trials.copy_to(i, xs, us, &mut self.next);
                    self.solution.cost = cost;
                    search.accepted = true;
                    return search;
                }
            }
            tried += width;
        }
        search
    }

    /// The trials `from`, `from` + 1, … of the line search, side by side; with what is left of the `gaps`.
    fn roll_out(&mut self, problem: &mut Problem, gaps: bool, from: usize, width: usize) {
        let clock = Instant::now();
        let gaps = gaps.then_some(self.gaps.as_slice());
        let Solution { xs, us, .. } = &self.solution;
        let nominal = Nominal { xs, us, gaps, knots: self.sweep.knots() };
        self.trials.run(problem, &nominal, &self.steps[from..from + width]);
        self.solution.timings.rollout += self.clock.ran(Phase::Rollout, clock);
    }

    /// Whether the step lowers the cost enough; or, while there are gaps, raises it little enough (FDDP), or is expected
    /// to lower the cost of the rollout that closes them (DDP).
    fn accepts(&self, search: &Search, feasible: bool) -> bool {
        let Search { d1, decrease, expected_decrease, .. } = *search;
        let closes_gaps = !feasible && self.settings.method == Method::Ddp;
        if expected_decrease >= 0.0 {
            d1.abs() < self.settings.flat || closes_gaps || decrease > self.settings.accept * expected_decrease
        } else {
            !feasible && !closes_gaps && decrease > self.settings.accept_ascent * expected_decrease
        }
    }
}
