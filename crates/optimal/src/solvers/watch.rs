//! Reasons to stop a solve early: the time limit, and the return value of the observer.

use super::solution::{Iteration, Status};
use crate::time::Instant;
use core::ops::ControlFlow;
use std::time::Duration;

/// Observer of a solve, which is called after each iteration. If the observer ends the solve, the solution is the best
/// iterate so far, with [`Status::Interrupted`](crate::Status::Interrupted).
///
/// A closure that takes an [`Iteration`] is an observer of each iteration. If it returns a [`ControlFlow`], it may end
/// the solve after that iteration:
///
/// ```
/// use condyle_optimal::{Iteration, Observer};
/// use core::ops::ControlFlow::{Break, Continue};
/// fn observe(observer: impl Observer) { /* … */ }
/// observe(|now: &Iteration| println!("{}", now.cost));
/// observe(|now: &Iteration| if now.cost < 1e-3 { Break(()) } else { Continue(()) });
/// ```
pub trait Observer {
    /// Receives an iteration that has ended, and returns whether to continue. The return value has no effect if the
    /// solve ends after this iteration anyway.
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()>;

    /// Returns whether to continue, while an iteration is running. The solver calls this method between the phases of
    /// an iteration (derivatives, sweep, trials), at most every 10 ms. A program can test here for signals, or for a
    /// flag that another thread sets.
    fn go_on(&mut self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<R: Verdict, F: FnMut(&Iteration) -> R> Observer for F {
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self(now).verdict()
    }
}

/// Return value of a closure that serves as an [`Observer`]: a [`ControlFlow`], or `()`, which means to continue.
pub trait Verdict {
    /// Returns whether to continue.
    fn verdict(self) -> ControlFlow<()>;
}

impl Verdict for () {
    fn verdict(self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl Verdict for ControlFlow<()> {
    fn verdict(self) -> Self {
        self
    }
}

/// Minimum time between two calls of [`Observer::go_on`].
const PERIOD: Duration = Duration::from_millis(10);

/// Observer of a solve, with two times: the beginning of the solve, and the last call of the observer.
pub(super) struct Watch<'a> {
    observer: &'a mut dyn Observer,
    pub(super) begin: Instant,
    asked: Instant,
}

impl<'a> Watch<'a> {
    /// Creates the watch of a solve that begins now.
    pub(super) fn new(observer: &'a mut dyn Observer) -> Self {
        let begin = Instant::now();
        Self { observer, begin, asked: begin }
    }

    /// Passes an iteration to the observer.
    pub(super) fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self.observer.iteration(now)
    }

    /// Calls the observer, if the minimum time since its last call has passed. Returns whether to continue.
    fn go_on(&mut self, now: Instant) -> ControlFlow<()> {
        if now.duration_since(self.asked) < PERIOD {
            return ControlFlow::Continue(());
        }
        self.asked = now;
        self.observer.go_on()
    }
}

/// Phase of an iteration whose duration is predicted.
#[derive(Clone, Copy)]
pub(super) enum Phase {
    CalcDiff,
    Sweep,
    Rollout,
}

/// Number of durations whose median predicts the next duration of a phase. Two delays among five durations do not
/// change the median. If the machine becomes slower, the median follows after three durations. (The minimum would not
/// follow, and each solve would exceed its time limit.)
const RECENT: usize = 5;

/// Last durations of a phase, over all solves.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recent {
    durations: [Duration; RECENT],
    /// Number of durations added since the beginning.
    count: usize,
}

impl Recent {
    /// Stores a duration, in place of the oldest one if five are stored.
    pub(super) fn add(&mut self, duration: Duration) {
        self.durations[self.count % RECENT] = duration;
        self.count += 1;
    }

    /// Returns the median of the stored durations, or the lower of the two middle values; zero if none is stored.
    pub(super) fn median(&self) -> Duration {
        let mut sorted = self.durations;
        let known = &mut sorted[..self.count.min(RECENT)];
        known.sort_unstable();
        known.len().checked_sub(1).map_or(Duration::ZERO, |last| known[last / 2])
    }
}

/// Clock of a solve: its time limit, and the recent durations of each phase.
#[derive(Debug, Clone, Default)]
pub(super) struct Clock {
    /// Beginning and time limit of the solve; `None` without a time limit.
    limit: Option<(Instant, Duration)>,
    /// Time at the end of the budget that phases must not use.
    pub(super) reserve: Duration,
    /// Whether phases run regardless of the time limit, as in the first iteration of a solve.
    guaranteed: bool,
    recent: [Recent; 3],
}

impl Clock {
    /// Starts the clock of a solve with the time limit `budget`. The first iteration runs regardless of the time limit,
    /// unless the limit is zero.
    pub(super) fn start(&mut self, begin: Instant, budget: Option<Duration>) {
        self.limit = budget.map(|budget| (begin, budget));
        (self.reserve, self.guaranteed) = (Duration::ZERO, budget != Some(Duration::ZERO));
    }

    /// Applies the time limit from now on: called after the first iteration, which runs regardless of the limit.
    pub(super) fn end_guarantee(&mut self) {
        self.guaranteed = false;
    }

    /// Returns whether the time limit is reached.
    pub(super) fn is_over(&self) -> bool {
        self.limit.is_some_and(|(begin, budget)| begin.elapsed() >= budget)
    }

    /// Returns `Ok` if enough time remains for the phases in sequence and the observer wants to continue. Otherwise
    /// returns the reason to stop.
    pub(super) fn allows(&mut self, phases: &[Phase], watch: &mut Watch<'_>) -> Result<(), Status> {
        let now = Instant::now();
        if watch.go_on(now).is_break() {
            return Err(Status::Interrupted);
        }
        let expected: Duration = phases.iter().map(|phase| self.recent[*phase as usize].median()).sum();
        let end = self.limit.and_then(|(begin, budget)| begin.checked_add(budget.saturating_sub(self.reserve)));
        if self.guaranteed || end.is_none_or(|end| now + expected <= end) {
            return Ok(());
        }
        Err(Status::TimeLimit)
    }

    /// Records a phase that has just ended; returns its duration.
    pub(super) fn ran(&mut self, phase: Phase, since: Instant) -> Duration {
        self.lasted(phase, since.elapsed())
    }

    /// Records the duration of a phase, and returns it.
    pub(super) fn lasted(&mut self, phase: Phase, duration: Duration) -> Duration {
        self.recent[phase as usize].add(duration);
        duration
    }
}
