//! Time limit of a solve, and other reasons to stop.

use super::observer::PacedObserver;
use super::solution::Status;
use crate::time::Instant;
use std::time::Duration;

/// Phase of an iteration.
#[derive(Clone, Copy)]
pub(crate) enum Phase {
    CalcDiff,
    Sweep,
    Rollout,
}

/// Number of durations from which the duration of a phase is predicted, by their median. Two delays among five then
/// change nothing, and a slower machine is noticed after three. (The minimum would never notice it, and each solve
/// would overrun.)
const RECENT: usize = 5;

/// Last durations of a phase, of this solve and the previous ones.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Recent {
    durations: [Duration; RECENT],
    /// Number of durations ever added.
    count: usize,
}

impl Recent {
    /// Stores a duration; it replaces the oldest one if five are stored.
    pub(crate) fn add(&mut self, duration: Duration) {
        self.durations[self.count % RECENT] = duration;
        self.count += 1;
    }

    /// Returns the median, the lower one of an even number; zero if no duration is stored.
    pub(crate) fn median(&self) -> Duration {
        let mut sorted = self.durations;
        let known = &mut sorted[..self.count.min(RECENT)];
        known.sort_unstable();
        known.len().checked_sub(1).map_or(Duration::ZERO, |last| known[last / 2])
    }
}

/// End of a solve's time, and the recent durations of each phase.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clock {
    end: Option<Instant>,
    /// Whether phases run regardless of the time, as in the first iteration of a solve.
    guaranteed: bool,
    recent: [Recent; 3],
}

impl Clock {
    /// Starts a solve with the time limit `budget`. If `guaranteed`, its first iteration runs regardless of the time.
    pub(crate) fn start(&mut self, begin: Instant, budget: Option<Duration>, guaranteed: bool) {
        self.end = budget.and_then(|budget| begin.checked_add(budget));
        self.guaranteed = guaranteed;
    }

    /// Ends the iteration that runs regardless of the time.
    pub(super) fn end_guarantee(&mut self) {
        self.guaranteed = false;
    }

    /// Returns `Ok` if there is time for the phases, one after the other, and the observer wants to continue. Otherwise
    /// returns the reason to stop.
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

    /// Records a phase that has just ended; returns its duration.
    pub(crate) fn ran(&mut self, phase: Phase, since: Instant) -> Duration {
        self.lasted(phase, since.elapsed())
    }

    /// Records the duration of a phase, and returns it.
    pub(super) fn lasted(&mut self, phase: Phase, duration: Duration) -> Duration {
        self.recent[phase as usize].add(duration);
        duration
    }
}
