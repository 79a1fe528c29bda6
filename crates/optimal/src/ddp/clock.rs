//! Time that a solve may take.

use std::time::{Duration, Instant};

/// A phase of an iteration.
#[derive(Clone, Copy)]
pub(crate) enum Phase {
    CalcDiff,
    Sweep,
    Rollout,
}

/// The end of a solve's time, and how long each phase lasted when it was last run, in this solve or one before.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clock {
    end: Option<Instant>,
    last: [Duration; 3],
}

impl Clock {
    /// A solve begins that may take `budget`.
    pub(crate) fn start(&mut self, begin: Instant, budget: Option<Duration>) {
        self.end = budget.map(|budget| begin + budget);
    }

    /// Whether there is time for a phase. A refusal halves what is expected of it, so that one late phase does not stop all
    /// solves to come.
    pub(crate) fn allows(&mut self, phase: Phase) -> bool {
        let expected = &mut self.last[phase as usize];
        let allowed = self.end.is_none_or(|end| Instant::now() + *expected <= end);
        if !allowed {
            *expected /= 2;
        }
        allowed
    }

    /// A phase was run; returns its duration.
    pub(crate) fn ran(&mut self, phase: Phase, since: Instant) -> Duration {
        let duration = since.elapsed();
        self.last[phase as usize] = duration;
        duration
    }
}
