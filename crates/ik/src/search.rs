//! Search of one thread: starts of many targets in the lanes of a [`Descent`].

use crate::descent::{Descent, TARGET, write_target};
use crate::global::{Apart, GlobalIk, Outcome, Posture};
use crate::held::Held;
use crate::search_settings::Rank;
use condyle_dynamics::distances::prepared::PreparedPairs;
use condyle_dynamics::{Se3, neutral, normalize};
use condyle_spatial::block::Block;
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Result of one start.
#[derive(Clone, Debug)]
pub(crate) struct Trial {
    pub q: Vec<f64>,
    pub error: [f64; 2],
    /// Whether the error is within the tolerance.
    pub reached: bool,
    /// Nearest pair, if it is too near.
    pub collision: Option<usize>,
}

impl Trial {
    /// Returns whether the start reached the target with all pairs far enough apart.
    pub(crate) fn succeeded(&self) -> bool {
        self.reached && self.collision.is_none()
    }
}

/// Number of entries of the table from which a search starts.
const NEAREST: usize = 16;

/// Start that a lane follows.
#[derive(Clone, Copy, Debug)]
struct Job {
    target: usize,
    start: usize,
    iteration: usize,
    /// Least weighted error so far, and the iteration at which it last fell clearly.
    least: f64,
    fell: usize,
    /// Whether steps push pairs apart.
    pushes: bool,
}

/// Progress of the search for one target.
#[derive(Clone, Debug, Default)]
struct Progress {
    /// Results of the starts, in order.
    trials: Vec<Option<Trial>>,
    /// Indices of the nearest entries of the table, the nearest first.
    nearest: Vec<usize>,
    done: bool,
}

/// Search of one thread.
pub(crate) struct Search<'a, S> {
    ik: &'a GlobalIk,
    targets: &'a [Se3<f64>],
    posture: &'a [f64],
    descent: Descent<S>,
    jobs: Vec<Option<Job>>,
    progress: Vec<Progress>,
    /// Positions before and after a step, one row for each lane.
    q: Vec<f64>,
    next: Vec<f64>,
    /// Numbers of the targets, one row for each lane.
    rows: Vec<f64>,
    /// Next target without a start.
    fresh: usize,
    /// First target that is not done.
    first: usize,
    /// Scratch: distances of the table's entries from a target.
    distances: Vec<(f64, usize)>,
    apart: Option<Apart>,
}

/// Iterations without a clear fall of the error, after which a start is given up, and the factor of a clear fall.
const STALLED: usize = 6;
const CLEAR: f64 = 0.7;
/// Distance beyond the minimum up to which pairs are pushed apart (m); a descent ends inside of the minimum.
const BEYOND: f64 = 1e-3;
/// First start of a target that pushes pairs apart: for most targets of an arm, the next start is cheaper. If postures
/// are ranked by their distance from the given one, the first start pushes, too.
const FIRST_PUSH: usize = 2;

impl<'a, S: Block<Number = f64>> Search<'a, S> {
    pub(crate) fn new(ik: &'a GlobalIk, targets: &'a [Se3<f64>], posture: &'a [f64]) -> Self {
        let (frames, nq) = (ik.aim.frames.len(), ik.model.nq());
        let margin = ik.settings.minimum_distance + BEYOND;
        let pairs = ik.pairs.as_ref().map(|pairs| (PreparedPairs::from(pairs), margin));
        Self {
            ik,
            targets,
            posture,
            descent: Descent::new(&ik.model, frames, pairs),
            jobs: vec![None; S::LANES],
            progress: vec![Progress::default(); targets.len() / frames],
            q: neutral(&ik.model).repeat(S::LANES),
            next: vec![0.0; nq * S::LANES],
            rows: vec![0.0; TARGET * frames * S::LANES],
            fresh: 0,
            first: 0,
            distances: Vec::new(),
            apart: ik.apart(),
        }
    }

    fn target(&self, target: usize) -> &'a [Se3<f64>] {
        let frames = self.ik.aim.frames.len();
        &self.targets[target * frames..][..frames]
    }

    /// Searches all targets.
    pub(crate) fn run(mut self, answers: &mut [Option<Posture>]) {
        loop {
            let mut changed = false;
            for lane in 0..S::LANES {
                let over = self.jobs[lane].is_some_and(|job| self.progress[job.target].done);
                if self.jobs[lane].is_none() || over {
                    changed |= self.issue(lane);
                }
            }
            if self.jobs.iter().all(Option::is_none) {
                break;
            }
            if changed {
                self.descent.set_targets(&self.rows);
            }
            self.descent.step(&self.ik.model, &self.ik.aim, &self.q, &mut self.next);
            for lane in 0..S::LANES {
                self.look(lane, answers);
            }
            std::mem::swap(&mut self.q, &mut self.next);
        }
    }

    /// Gives a lane its next start. Returns whether the lane's target changed.
    fn issue(&mut self, lane: usize) -> bool {
        self.jobs[lane] = None;
        let settings = &self.ik.settings;
        while self.first < self.fresh && self.progress[self.first].done {
            self.first += 1;
        }
        let target = if self.fresh < self.progress.len() {
            self.fresh += 1;
            self.fresh - 1
        } else {
            // All targets have a start: the one with the fewest starts, which is not done, gets another one.
            let open = (self.first..self.progress.len())
                .filter(|&t| !self.progress[t].done && self.progress[t].trials.len() < settings.starts)
                .min_by_key(|&t| self.progress[t].trials.len());
            match open {
                Some(target) => target,
                None => return false,
            }
        };
        self.begin(lane, target);
        true
    }

    /// Begins the next start of a target in a lane.
    fn begin(&mut self, lane: usize, target: usize) {
        let nq = self.ik.model.nq();
        let start = self.progress[target].trials.len();
        self.progress[target].trials.push(None);
        self.jobs[lane] = Some(Job { target, start, iteration: 0, least: f64::INFINITY, fell: 0, pushes: false });
        self.descent.set_push(lane, false);
        let frames = self.ik.aim.frames.len();
        let row = &mut self.rows[lane * TARGET * frames..][..TARGET * frames];
        for (pose, to) in self.targets[target * frames..][..frames].iter().zip(row.chunks_exact_mut(TARGET)) {
            write_target(pose, to);
        }
        let table = self.ik.settings.table;
        if start == 1 && table > 0 {
            self.rank_table(lane, target);
        }
        let q = &mut self.q[lane * nq..][..nq];
        if start == 0 {
            q.copy_from_slice(self.posture);
            self.ik.clip(q);
        } else if let Some(&entry) = self.progress[target].nearest.get(start - 1) {
            q.copy_from_slice(&self.ik.table.q[entry * nq..][..nq]);
        } else {
            // One generator for each start of the same number: equal targets have equal answers.
            let seed = self.ik.settings.seed ^ (start as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            q.copy_from_slice(&self.ik.draw(&mut StdRng::seed_from_u64(seed)));
        }
    }

    /// Finds the entries of the table whose frames are nearest to the target of a lane.
    fn rank_table(&mut self, lane: usize, target: usize) {
        let width = TARGET * self.ik.aim.frames.len();
        let row = &self.rows[lane * width..][..width];
        let [linear, angular] = self.ik.aim.weights;
        self.distances.clear();
        for (k, entry) in self.ik.table.poses.chunks_exact(width).enumerate() {
            let mut sum = 0.0;
            for (row, entry) in row.chunks_exact(TARGET).zip(entry.chunks_exact(TARGET)) {
                let square = |range: std::ops::Range<usize>| -> f64 {
                    row[range.clone()].iter().zip(&entry[range]).map(|(x, y)| (x - y) * (x - y)).sum()
                };
                sum += linear * square(9..12) + 0.5 * angular * square(0..9); // ‖R − R_t‖² ≈ 2 θ²
            }
            self.distances.push((sum, k));
        }
        let count = NEAREST.min(self.distances.len());
        let by_distance = |a: &(f64, usize), b: &(f64, usize)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
        if count < self.distances.len() {
            self.distances.select_nth_unstable_by(count - 1, by_distance);
        }
        self.distances[..count].sort_unstable_by(by_distance);
        self.progress[target].nearest.extend(self.distances[..count].iter().map(|&(_, k)| k));
    }

    /// Looks at the position of a lane before the last step. Ends its start if it is at the target with all pairs far
    /// enough apart, or makes no progress. At the target with a pair that is too near, the start goes on and pushes
    /// pairs apart.
    fn look(&mut self, lane: usize, answers: &mut [Option<Posture>]) {
        let Some(mut job) = self.jobs[lane].filter(|job| !self.progress[job.target].done) else { return };
        let (settings, nq) = (&self.ik.settings, self.ik.model.nq());
        let error = self.descent.errors(lane);
        let reached = error[0] <= settings.tolerance[0] && error[1] <= self.ik.rotation_tolerance();
        let weighted = self.ik.weighted(error) + self.descent.excess(lane);
        if weighted < CLEAR * CLEAR * job.least {
            (job.least, job.fell) = (weighted, job.iteration);
        }
        job.iteration += 1;
        let stuck = job.iteration > job.fell + STALLED || job.iteration >= settings.iterations || !weighted.is_finite();
        self.jobs[lane] = Some(job);
        if !reached && !stuck {
            return;
        }
        let mut q = self.q[lane * nq..][..nq].to_vec();
        normalize(&self.ik.model, &mut q);
        let collision = self.apart.as_mut().and_then(|apart| apart.collision(self.ik, &q));
        let may_push = job.start >= FIRST_PUSH || settings.rank == Rank::Nearest;
        if reached && collision.is_some() && !job.pushes && may_push {
            self.jobs[lane] = Some(Job { iteration: 0, least: f64::INFINITY, fell: 0, pushes: true, ..job });
            self.descent.set_push(lane, true);
            return;
        }
        if reached && collision.is_some() && job.pushes && !stuck {
            return; // the push goes on
        }
        self.jobs[lane] = None;
        self.progress[job.target].trials[job.start] = Some(Trial { q, error, reached, collision });
        self.conclude(job.target, answers);
    }

    /// Writes the answer for a target if the finished starts, in order, suffice.
    fn conclude(&mut self, target: usize, answers: &mut [Option<Posture>]) {
        let settings = &self.ik.settings;
        let progress = &self.progress[target];
        // Only starts before the first unfinished start count.
        let (mut count, mut found) = (0, 0);
        for trial in &progress.trials {
            let Some(trial) = trial else { break };
            count += 1;
            found += usize::from(trial.succeeded());
            if found == settings.solutions {
                break;
            }
        }
        if found < settings.solutions && count < settings.starts {
            return;
        }
        let trials: Vec<&Trial> = progress.trials[..count].iter().flatten().collect();
        let best = self.ik.best(&trials, self.posture);
        let outcome = if best.succeeded() {
            Outcome::Reached
        } else {
            let mut held = self.ik.held(&best.q, self.target(target));
            // The pair that excludes the start with the least error.
            let least = trials.iter().min_by(|a, b| self.ik.weighted(a.error).total_cmp(&self.ik.weighted(b.error)));
            held.extend(least.and_then(|trial| trial.collision).map(Held::Pair));
            Outcome::Unreached { held }
        };
        answers[target] = Some(Posture { q: best.q.clone(), outcome, error: best.error, starts: count });
        self.progress[target] = Progress { done: true, ..Progress::default() };
    }
}
