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

/// The end of a solve's time, and how long each phase lasted when it was last run, in this solve or one before.
#[derive(Debug, Clone, Default)]
pub(crate) struct Clock {
    end: Option<Instant>,
    last: [Duration; 3],
}

impl Clock {
    /// A solve begins that may take `budget`.
    pub(crate) fn start(&mut self, begin: Instant, budget: Option<Duration>) {
        self.end = budget.and_then(|budget| begin.checked_add(budget));
    }

    /// `Ok` if there is time for phases that follow each other and the observer wants to go on, else why not. A refusal halves
    /// what is expected of the phases, so that one late phase does not stop all solves to come.
    pub(super) fn allows(&mut self, phases: &[Phase], watch: &mut PacedObserver<'_>) -> Result<(), Status> {
        let now = Instant::now();
        if watch.go_on(now).is_break() {
            return Err(Status::Interrupted);
        }
        let expected = phases.iter().map(|phase| self.last[*phase as usize]).sum();
        if self.end.is_none_or(|end| now + expected <= end) {
            return Ok(());
        }
        phases.iter().for_each(|phase| self.last[*phase as usize] /= 2);
        Err(Status::TimeLimit)
    }

    /// A phase was run; returns its duration.
    pub(crate) fn ran(&mut self, phase: Phase, since: Instant) -> Duration {
        self.lasted(phase, since.elapsed())
    }

    /// A phase was run, and took so long; returns that.
    pub(super) fn lasted(&mut self, phase: Phase, duration: Duration) -> Duration {
        self.last[phase as usize] = duration;
        duration
    }
}
