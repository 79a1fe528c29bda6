//! Time that a solve may take, and other reasons to stop.

use super::observer::PacedObserver;
use super::solution::Status;
use crate::time::Instant;
use std::time::Duration;

/// A phase of an iteration.
#[derive(Clone, Copy)]
pub(crate) enum Phase {
    CalcDiff,
    Sweep,
    Rollout,
}

/// Number of durations from which a phase is predicted, by their median: two delays among five change nothing, and a machine
/// that has become slower is noticed after three. (The minimum would never notice it, and each solve would overrun.)
const RECENT: usize = 5;

/// The last durations of a phase, of this solve and those before.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Recent {
    durations: [Duration; RECENT],
    /// The number of durations that were ever added.
    count: usize,
}

impl Recent {
    /// Notes a duration, in place of the oldest of more than five.
    pub(crate) fn add(&mut self, duration: Duration) {
        self.durations[self.count % RECENT] = duration;
        self.count += 1;
    }

    /// Returns the median, the lower one of an even number; zero if there is none yet.
    pub(crate) fn median(&self) -> Duration {
        let mut sorted = self.durations;
        let known = &mut sorted[..self.count.min(RECENT)];
        known.sort_unstable();
        known.len().checked_sub(1).map_or(Duration::ZERO, |last| known[last / 2])
    }
}

/// The end of a solve's time, and the recent durations of each phase.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clock {
    end: Option<Instant>,
    /// Whether phases run whatever the time, as in the first iteration of a solve.
    guaranteed: bool,
    recent: [Recent; 3],
}

impl Clock {
    /// Starts a solve that may take `budget`, and whose first iteration runs whatever the time if it is `guaranteed`.
    pub(crate) fn start(&mut self, begin: Instant, budget: Option<Duration>, guaranteed: bool) {
        self.end = budget.and_then(|budget| begin.checked_add(budget));
        self.guaranteed = guaranteed;
    }

    /// Ends the iteration that runs whatever the time.
    pub(super) fn end_guarantee(&mut self) {
        self.guaranteed = false;
    }

    /// Returns `Ok` if there is time for phases that follow each other and the observer wants to go on, else the reason to
    /// stop.
    pub(super) fn allows(&mut self, phases: &[Phase], watch: &mut PacedObserver<'_>) -> Result<(), Status> {
        let now = Instant::now();
        if watch.go_on(now).is_break() {
            return Err(Status::Interrupted);
        }
        let expected: Duration = phases.iter().map(|phase| self.recent[*phase as usize].median()).sum();
        if self.guaranteed || self.end.is_none_or(|end| now + expected <= end) {
            return Ok(());
        }
        Err(Status::TimeLimit)
    }

    /// Notes a phase that has just ended; returns its duration.
    pub(crate) fn ran(&mut self, phase: Phase, since: Instant) -> Duration {
        self.lasted(phase, since.elapsed())
    }

    /// Notes the duration of a phase, and returns it.
    pub(super) fn lasted(&mut self, phase: Phase, duration: Duration) -> Duration {
        self.recent[phase as usize].add(duration);
        duration
    }
}
