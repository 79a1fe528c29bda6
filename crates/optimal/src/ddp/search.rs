//! The line search of differential dynamic programming: what a step should gain, and whether it does.

use super::best::{Best, Value};
use super::clock::{Clock, Phase};
use super::observer::PacedObserver;
use super::rollout::{Nominal, Trials};
use super::settings::{DdpMethod, Settings};
use super::solution::{Solution, Status};
use crate::lq::LqKnot;
use crate::problem::Problem;
use crate::time::Instant;
use condyle_linalg::{View, add_scaled_product, dot};

/// The number of step lengths that are tried side by side when the first one fails: one of the next few is mostly good, and
/// each has a cost of its own beside dynamics in lanes.
const SECOND: usize = 4;

/// The outcome of a line search: of the trial it accepted or else of the last that stayed finite.
#[derive(Clone, Copy, Default)]
pub(super) struct Search {
    pub(super) step: f64,
    pub(super) d1: f64,
    pub(super) d2: f64,
    pub(super) decrease: f64,
    pub(super) expected_decrease: f64,
    pub(super) accepted: bool,
    /// Why there was no other trial, if the solve must stop.
    pub(super) stopped: Option<Status>,
    /// The iterate before the accepted step is the best one now.
    pub(super) left_best: bool,
}

/// An iterate, its feedback, and how to search around it.
pub(super) struct Iterate<'a, 'o> {
    /// The iterate is in here; it becomes the accepted trial.
    pub(super) solution: &'a mut Solution,
    /// φₜ(xₜ, uₜ), N·nx.
    pub(super) next: &'a mut Vec<f64>,
    /// Its accelerations and forces.
    pub(super) motions: &'a mut [f64],
    /// What it is worth, and the best one before it.
    pub(super) value: Value,
    pub(super) best: &'a mut Best,
    /// f₀ = x̂₀ ⊖ x₀, fₜ₊₁ = φₜ ⊖ xₜ₊₁, (N + 1)·ndx.
    pub(super) gaps: &'a [f64],
    /// The feedback and value functions.
    pub(super) knots: &'a [LqKnot],
    /// Whether the iterate counts as feasible.
    pub(super) feasible: bool,
    pub(super) settings: &'a Settings,
    pub(super) clock: &'a mut Clock,
    pub(super) watch: &'a mut PacedObserver<'o>,
}

/// The line search, with its workspace.
#[derive(Debug, Clone)]
pub(super) struct LineSearch {
    trials: Trials,
    /// The step lengths, 1, ½, ¼, ….
    steps: Vec<f64>,
    /// Vxx f, (N + 1)·ndx.
    curved_gaps: Vec<f64>,
    /// xₜ ⊖ a trial's xₜ.
    dx: Vec<f64>,
    /// The expected improvement without the part that depends on the trial: dg, dq.
    expected: [f64; 2],
}

impl LineSearch {
    /// The workspace for problems with the dimensions of `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        let (horizon, ndx) = (problem.horizon(), problem.ndx());
        Self {
            trials: Trials::new(problem, problem.lanes()),
            steps: Vec::new(),
            curved_gaps: vec![0.0; (horizon + 1) * ndx],
            dx: vec![0.0; ndx],
            expected: [0.0; 2],
        }
    }

    /// Makes room for a problem of which only the numbers of controls changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.trials.reshape(problem);
    }

    /// Begins a solve with `count` step lengths, in which so many numbers of each knot's motion are kept.
    pub(super) fn start(&mut self, count: usize, motion_size: usize) {
        self.trials.keep_motions(motion_size);
        self.steps.clear();
        self.steps.extend((0..count).map(|n| 0.5_f64.powi(n as i32))); // α = 2⁻ⁿ
    }

    /// Tries α = 1, ½, ¼, … until a step is accepted, which becomes the iterate.
    ///
    /// A trial that leaves all bounds keeps the expectation of the trial before it; the first one has that of the line
    /// search before, `last`, or in DDP, where it does not depend on the trial, that of this one.
    #[inline(never)] // `benches/instructions.py` counts it by its name
    pub(super) fn run(&mut self, problem: &mut Problem, mut iterate: Iterate<'_, '_>, last: Search) -> Search {
        self.expect(&iterate);
        let mut search = Search { accepted: false, left_best: false, ..last };
        let gaps = iterate.settings.counts_gaps(iterate.feasible);
        if iterate.settings.method == DdpMethod::Ddp {
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
            if let Err(status) = iterate.clock.allows(&[Phase::Rollout], iterate.watch) {
                search.stopped = Some(status);
                return search;
            }
            self.roll_out(problem, &mut iterate, gaps, tried, width);
            for i in 0..width {
                search.step = self.steps[tried + i];
                let Some(cost) = self.trials.cost(i) else { continue };
                // d₁ = dg + dv,   d₂ = dq − 2 dv,   expected decrease α (d₁ + ½ α d₂)
                let dv = if gaps { self.expect_of_trial(problem, iterate.solution, i) } else { 0.0 };
                search.d1 = self.expected[0] + dv;
                search.d2 = self.expected[1] - 2.0 * dv;
                search.expected_decrease = search.step * (search.d1 + 0.5 * search.step * search.d2);
                search.decrease = iterate.solution.cost - cost;
                if search.is_good(iterate.settings, iterate.feasible) {
                    search.left_best = iterate.best.leave(iterate.solution, iterate.next, iterate.value);
                    let Solution { xs, us, .. } = iterate.solution;
                    self.trials.copy_to(i, xs, us, iterate.next, iterate.motions);
                    iterate.solution.cost = cost;
                    search.accepted = true;
                    return search;
                }
            }
            tried += width;
        }
        search
    }

    /// dg = −Σ Quᵀk − Σ (Vx + Vxx f)ᵀf,   dq = −Σ kᵀQuu k + Σ fᵀVxx f;  DDP leaves the gaps f out.
    fn expect(&mut self, iterate: &Iterate<'_, '_>) {
        let (mut dg, mut dq) = (0.0, 0.0);
        let gaps = iterate.settings.counts_gaps(iterate.feasible);
        for (t, knot) in iterate.knots.iter().enumerate() {
            dg -= knot.expected[0];
            dq -= knot.expected[1];
            if gaps {
                let place = iterate.solution.shape().dx(t);
                let (f, curved) = (&iterate.gaps[place.clone()], &mut self.curved_gaps[place]);
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
    fn expect_of_trial(&mut self, problem: &Problem, solution: &Solution, i: usize) -> f64 {
        let shape = solution.shape();
        let mut dv = 0.0;
        for t in 0..=shape.horizon() {
            problem.action(t).difference(self.trials.x(i, t), &solution.xs[shape.x(t)], &mut self.dx);
            dv -= dot(&self.curved_gaps[shape.dx(t)], &self.dx);
        }
        dv
    }

    /// The trials `from`, `from` + 1, … of the line search, side by side; with what is left of the `gaps`.
    fn roll_out(
        &mut self,
        problem: &mut Problem,
        iterate: &mut Iterate<'_, '_>,
        gaps: bool,
        from: usize,
        width: usize,
    ) {
        let start = Instant::now();
        let gaps = gaps.then_some(iterate.gaps);
        let Solution { xs, us, .. } = &*iterate.solution;
        let nominal = Nominal { xs, us, gaps, knots: iterate.knots };
        self.trials.run(problem, &nominal, &self.steps[from..from + width]);
        iterate.solution.timings.rollout += iterate.clock.ran(Phase::Rollout, start);
    }
}

impl Search {
    /// Whether the step lowers the cost enough; or, while there are gaps, raises it little enough (FDDP), or is expected
    /// to lower the cost of the rollout that closes them (DDP).
    fn is_good(&self, settings: &Settings, feasible: bool) -> bool {
        let Self { d1, decrease, expected_decrease, .. } = *self;
        let closes_gaps = !feasible && settings.method == DdpMethod::Ddp;
        if expected_decrease >= 0.0 {
            d1.abs() < settings.flat || closes_gaps || decrease > settings.accept * expected_decrease
        } else {
            !feasible && !closes_gaps && decrease > settings.accept_ascent * expected_decrease
        }
    }
}
