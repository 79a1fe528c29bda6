//! Line search of differential dynamic programming: the expected decrease of the cost by a step, and the test that
//! accepts a trial.

use super::best::{Best, Merit};
use super::iterate::Iterate;
use super::rollout::{Nominal, OneProblem, Trials};
use super::settings::{DdpMethod, Settings};
use super::solution::Status;
use super::watch::{Clock, Phase, Watch};
use crate::lq::KnotFeedback;
use crate::problem::{ActionView, Problem};
use crate::time::Instant;
use condyle_linalg::threads::join;
use condyle_linalg::{View, add_scaled_product, dot};
use core::sync::atomic::{AtomicBool, Ordering};

/// Number of step lengths that are evaluated as one group when the step length 1 fails, unless ½ is likely to succeed.
/// Usually one of the four lengths succeeds. A group of four takes two to three times as long as a single trial,
/// because a single trial computes branches of the robot in parallel SIMD lanes.
const SECOND: usize = 4;

/// Number of searches after a shortened step in which another thread tries shorter steps concurrently. In every second
/// or third of these searches, a shorter step is needed.
const WARY: usize = 3;

/// Outcome of a line search: data of the accepted trial, or of the last trial that stayed finite if none was accepted.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Search {
    pub(super) step: f64,
    pub(super) d1: f64,
    pub(super) d2: f64,
    pub(super) decrease: f64,
    pub(super) expected_decrease: f64,
    pub(super) accepted: bool,
    /// Reason why the search ended early, if the solve must stop.
    pub(super) stopped: Option<Status>,
    /// Whether the iterate before the accepted step was stored as the best one.
    pub(super) left_best: bool,
}

/// Iterate with its feedback, and the fields of a solver that its line search uses.
pub(super) struct Surroundings<'a> {
    /// Iterate, which the accepted trial replaces.
    pub(super) iterate: &'a mut Iterate,
    pub(super) merit: Merit,
    /// Best iterate before the current one.
    pub(super) best: &'a mut Best,
    /// Feedback and value functions of all knots.
    pub(super) feedback: &'a [KnotFeedback],
    pub(super) settings: &'a Settings,
}

/// Line search, with its workspace.
#[derive(Debug, Clone)]
pub(super) struct LineSearch {
    trials: Trials,
    /// Trials of the next step lengths, which another thread rolls out while this thread tries the first step length.
    ahead: Option<Trials>,
    /// Number of coming searches in which another thread may try shorter steps concurrently.
    wary: usize,
    /// Step lengths, 1, ½, ¼, ….
    steps: Vec<f64>,
    /// Products Vxx f of all knots, (N + 1)·ndx.
    curved_gaps: Vec<f64>,
    /// Terms dg and dq of the expected decrease, which do not depend on the trial.
    expected: [f64; 2],
}

impl LineSearch {
    /// Allocates the workspace for problems with the dimensions of `problem`, with storage for `width` trials.
    pub(super) fn new(problem: &Problem, width: usize) -> Self {
        let (horizon, ndx) = (problem.horizon(), problem.ndx());
        Self {
            trials: Trials::new(problem, width),
            ahead: None,
            wary: 0,
            steps: Vec::new(),
            curved_gaps: vec![0.0; (horizon + 1) * ndx],
            expected: [0.0; 2],
        }
    }

    /// Adapts the storage to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.trials.reshape(problem);
        self.ahead.iter_mut().for_each(|ahead| ahead.reshape(problem));
    }

    /// Prepares the searches of a solve that try `count` step lengths on `threads` threads. `motion_size` is the number
    /// of accelerations and forces that are stored per knot.
    pub(super) fn start(&mut self, problem: &Problem, count: usize, motion_size: usize, threads: usize) {
        if threads > 1 && self.ahead.is_none() {
            self.ahead = Some(Trials::new(problem, self.trials.width()));
        }
        self.wary = 0;
        self.trials.keep_motions(motion_size);
        self.ahead.iter_mut().for_each(|ahead| ahead.keep_motions(motion_size));
        self.steps.clear();
        self.steps.extend((0..count).map(|n| 0.5_f64.powi(n as i32))); // α = 2⁻ⁿ
    }

    /// Tries α = 1, ½, ¼, … until a step is accepted; the accepted trial becomes the iterate. If a recent search needed
    /// a step shorter than 1, a second thread tries the next lengths at the same time as the first length.
    ///
    /// The expected decrease of a diverging trial is the expected decrease of the trial before it. If the first trial
    /// diverges, it is the expected decrease of the previous line search, `last`. In DDP the expected decrease does not
    /// depend on the trial, so a diverging trial has the same terms as any other trial of the search.
    #[inline(never)] // `benches/instructions.py` counts this function by name
    pub(super) fn run(
        &mut self,
        problem: &mut Problem,
        around: Surroundings<'_>,
        last: Search,
        clock: &mut Clock,
        watch: &mut Watch<'_>,
    ) -> Search {
        let mut search = self.begin(&around, last);
        let Self { trials, ahead, wary, steps, curved_gaps, expected } = self;
        let Surroundings { iterate, merit, best, feedback, settings } = around;
        let counts_gaps = settings.counts_gaps(merit.feasible);
        let (horizon, lanes, count) = (problem.horizon(), trials.width(), steps.len());
        let some_from = |tried: usize| {
            let most = match tried {
                0 => 1,
                1 if last.step >= 0.5 => 1, // ½ is likely to succeed: the last search took ½ or 1
                1 | 2 => SECOND,
                _ => count,
            };
            tried..tried + most.min(lanes).min(count - tried)
        };
        let beside = *wary > 0 && settings.threads > 1 && count > 1;
        let (mut tried, mut ready) = (0, false); // `ready`: `ahead` holds the next trials, except their terminal knot
        while tried < count {
            if !ready && let Err(status) = clock.allows(&[Phase::Rollout], watch) {
                search.stopped = Some(status);
                return search;
            }
            let start = Instant::now();
            let nominal = Nominal::of(iterate, feedback, counts_gaps);
            let rule = Rule::new(settings, merit, *expected, curved_gaps, nominal.xs);
            let trying = some_from(tried);
            let lengths = &steps[trying.clone()];
            match (ahead.as_mut(), problem.two()) {
                (Some(ahead), _) if ready => {
                    std::mem::swap(trials, ahead);
                    let view = &mut problem.action_view();
                    trials.run(&mut OneProblem { view, nominal }, lengths, horizon..=horizon);
                    ready = false;
                }
                (Some(ahead), Some([mut own, mut copies])) if beside && tried == 0 => {
                    let (next, enough) = (&steps[some_from(1)], AtomicBool::new(false));
                    join(
                        || {
                            trials.run(&mut OneProblem { view: &mut own, nominal }, lengths, 0..=horizon);
                            let good = rule.judge(&mut search.clone(), trials, 0, lengths[0], &own).is_some();
                            enough.store(good, Ordering::Relaxed);
                        },
                        || {
                            ready = (0..horizon).all(|t| {
                                ahead.run(&mut OneProblem { view: &mut copies, nominal }, next, t..=t);
                                !enough.load(Ordering::Relaxed)
                            });
                        },
                    );
                }
                _ => {
                    let view = &mut problem.action_view();
                    trials.run(&mut OneProblem { view, nominal }, lengths, 0..=horizon);
                }
            }
            let view = problem.action_view();
            let good = lengths
                .iter()
                .enumerate()
                .find_map(|(i, step)| rule.judge(&mut search, trials, i, *step, &view).map(|cost| (i, cost)));
            iterate.solution.timings.rollout += clock.ran(Phase::Rollout, start);
            if let Some((i, cost)) = good {
                search.take(trials, i, cost, (iterate, best, merit));
                break;
            }
            tried = trying.end;
        }
        *wary = if search.step < 1.0 { WARY } else { wary.saturating_sub(1) };
        search
    }

    /// Begins a search: computes the expected decrease of the cost.
    pub(super) fn begin(&mut self, around: &Surroundings<'_>, last: Search) -> Search {
        self.expect(around);
        self.begin_expecting(self.expected, around.settings, last)
    }

    /// Begins a search with known terms dg and dq of the expected decrease. The products Vxx f are in
    /// [`curved_gaps_mut`](Self::curved_gaps_mut).
    pub(super) fn begin_expecting(&mut self, expected: [f64; 2], settings: &Settings, last: Search) -> Search {
        self.expected = expected;
        let mut search = Search { accepted: false, left_best: false, ..last };
        if settings.method == DdpMethod::Ddp {
            [search.d1, search.d2] = expected;
        }
        search
    }

    /// Returns the storage of the products Vxx f of all knots, (N + 1)·ndx.
    pub(super) fn curved_gaps_mut(&mut self) -> &mut [f64] {
        &mut self.curved_gaps
    }

    /// Returns the step lengths of a search, 1, ½, ¼, ….
    pub(super) fn steps(&self) -> &[f64] {
        &self.steps
    }

    /// Judges trial i of `trials`, which has step length number n of this search. An accepted trial becomes the
    /// iterate. Returns whether it was accepted.
    pub(super) fn judge(
        &self,
        around: Surroundings<'_>,
        search: &mut Search,
        (trials, i, n): (&mut Trials, usize, usize),
        view: &ActionView<'_>,
    ) -> bool {
        let Surroundings { iterate, merit, best, settings, .. } = around;
        let rule = Rule::new(settings, merit, self.expected, &self.curved_gaps, &iterate.solution.xs);
        let good = rule.judge(search, trials, i, self.steps[n], view);
        if let Some(cost) = good {
            search.take(trials, i, cost, (iterate, best, merit));
        }
        good.is_some()
    }

    /// Computes the terms dg = −Σ Quᵀk − Σ (Vx + Vxx f)ᵀf and dq = −Σ kᵀQuu k + Σ fᵀVxx f of the expected decrease. DDP
    /// omits the terms with gaps f.
    fn expect(&mut self, around: &Surroundings<'_>) {
        let Surroundings { iterate, merit, feedback, settings, .. } = around;
        let ((mut dg, mut dq), counts_gaps) = ((0.0, 0.0), settings.counts_gaps(merit.feasible));
        let all = feedback;
        for (t, feedback) in all.iter().enumerate() {
            dg -= feedback.expected[0];
            dq -= feedback.expected[1];
            if counts_gaps {
                let range = iterate.solution.shape().dx(t);
                let (f, curved) = (&iterate.gaps[range.clone()], &mut self.curved_gaps[range]);
                match t {
                    0 => {
                        curved.fill(0.0);
                        add_scaled_product(curved, 1.0, View::new(feedback.Vxx.as_slice(), f.len()), f); // Vxx f
                    }
                    _ => curved.copy_from_slice(all[t - 1].curved_gap.as_slice()),
                }
                let curvature = dot(f, curved);
                dg -= dot(feedback.Vx.as_slice(), f) + curvature;
                dq += curvature;
            }
        }
        self.expected = [dg, dq];
    }
}

/// Rule that decides whether a trial is accepted. The rule is the same for all trials that start from one iterate.
struct Rule<'a> {
    settings: &'a Settings,
    feasible: bool,
    /// Terms dg and dq of the expected decrease.
    expected: [f64; 2],
    /// Products Vxx f of all knots, if the expected decrease includes the gaps.
    curved_gaps: Option<&'a [f64]>,
    /// States of the iterate; the next field is the cost of the iterate.
    xs: &'a [f64],
    cost: f64,
}

impl<'a> Rule<'a> {
    /// Creates the rule for an iterate with the states `xs`.
    fn new(
        settings: &'a Settings,
        Merit { feasible, cost, .. }: Merit,
        expected: [f64; 2],
        curved_gaps: &'a [f64],
        xs: &'a [f64],
    ) -> Self {
        let curved_gaps = settings.counts_gaps(feasible).then_some(curved_gaps);
        Self { settings, feasible, expected, curved_gaps, xs, cost }
    }

    /// Writes the expected and the actual decrease of trial i, with step length α, to `search`. Returns the trial's
    /// cost if the trial is accepted.
    ///
    /// ```text
    /// d₁ = dg + dv,   d₂ = dq − 2 dv,   dv = −Σ fᵀVxx (x ⊖ x_trial),   expected decrease α (d₁ + ½ α d₂)
    /// ```
    fn judge(
        &self,
        search: &mut Search,
        trials: &mut Trials,
        i: usize,
        step: f64,
        view: &ActionView<'_>,
    ) -> Option<f64> {
        search.step = step;
        let cost = trials.cost(i)?;
        let dv = self.curved_gaps.map_or(0.0, |curved| trials.distance(view, i, self.xs, curved));
        search.d1 = self.expected[0] + dv;
        search.d2 = self.expected[1] - 2.0 * dv;
        search.expected_decrease = step * (search.d1 + 0.5 * step * search.d2);
        search.decrease = self.cost - cost;
        search.is_good(self.settings, self.feasible).then_some(cost)
    }
}

impl Search {
    /// Accepts trial i: the trial replaces the iterate, and the old iterate is stored if it is the best one.
    fn take(&mut self, trials: &Trials, i: usize, cost: f64, (iterate, best, merit): (&mut Iterate, &mut Best, Merit)) {
        self.left_best = best.leave(iterate, merit);
        trials.copy_to(i, iterate);
        iterate.solution.cost = cost;
        self.accepted = true;
    }

    /// Returns whether the step is accepted: whether it lowers the cost enough. While gaps exist, FDDP also accepts a
    /// step that raises the cost by little. DDP then accepts each step with an expected decrease: the first accepted
    /// step closes all gaps, whatever it costs.
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
