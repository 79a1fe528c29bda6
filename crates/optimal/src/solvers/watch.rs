//! Reasons to stop a solve early: its time limit, and its observer.

use super::solution::{Iteration, Status};
use crate::time::Instant;
use core::ops::ControlFlow;
use std::time::Duration;

/// Observer of a solve. If it ends the solve, the solution is the best iterate so far, with
/// [`Status::Interrupted`](crate::Status::Interrupted).
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
    /// Receives an iteration that has ended, and returns whether to continue. The return value is ignored if the solve
    /// would end now anyway.
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()>;

    /// Returns whether to continue, while an iteration is running. It is called between the phases of an iteration
    /// (derivatives, sweep, trials), at most every 10 ms. A program can check here for signals, or for a flag that
    /// another thread sets.
    fn go_on(&mut self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<R: Verdict, F: FnMut(&Iteration) -> R> Observer for F {
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self(now).verdict()
    }
}

/// Return value of a closure used as an [`Observer`]: a [`ControlFlow`], or nothing, which means to continue.
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

/// Observer of a solve, the time at which the solve began, and the time at which the observer was called last.
pub(super) struct Watch<'a> {
    observer: &'a mut dyn Observer,
    pub(super) begin: Instant,
    asked: Instant,
}

impl<'a> Watch<'a> {
    /// Begins a solve now.
    pub(super) fn new(observer: &'a mut dyn Observer) -> Self {
        let begin = Instant::now();
        Self { observer, begin, asked: begin }
    }

    /// Passes an iteration to the observer.
    pub(super) fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self.observer.iteration(now)
    }

    /// Asks the observer whether to continue, if the minimum time has passed.
    fn go_on(&mut self, now: Instant) -> ControlFlow<()> {
        if now.duration_since(self.asked) < PERIOD {
            return ControlFlow::Continue(());
        }
        self.asked = now;
        self.observer.go_on()
    }
}

/// Phase of an iteration.
#[derive(Clone, Copy)]
pub(super) enum Phase {
    CalcDiff,
    Sweep,
    Rollout,
}

/// Number of durations whose median predicts the next duration of a phase. Two delays among five then change nothing,
/// and a slower machine is noticed after three durations. (The minimum would never notice a slower machine, and each
/// solve would overrun.)
const RECENT: usize = 5;

/// Last durations of a phase, of this solve and the previous ones.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Recent {
    durations: [Duration; RECENT],
    /// Number of durations ever added.
    count: usize,
}

impl Recent {
    /// Stores a duration; it replaces the oldest one if five are stored.
    pub(super) fn add(&mut self, duration: Duration) {
        self.durations[self.count % RECENT] = duration;
        self.count += 1;
    }

    /// Returns the median, or the lower of the two middle values; zero if no duration is stored.
    pub(super) fn median(&self) -> Duration {
        let mut sorted = self.durations;
        let known = &mut sorted[..self.count.min(RECENT)];
        known.sort_unstable();
        known.len().checked_sub(1).map_or(Duration::ZERO, |last| known[last / 2])
    }
}

/// Time limit of a solve, and the recent durations of each phase.
#[derive(Debug, Clone, Default)]
pub(super) struct Clock {
    /// Beginning and time limit of the solve.
    limit: Option<(Instant, Duration)>,
    /// Time at the end of the budget that phases must leave unused.
    pub(super) reserve: Duration,
    /// Whether phases run regardless of the time, as in the first iteration of a solve.
    guaranteed: bool,
    recent: [Recent; 3],
}

impl Clock {
    /// Starts a solve with the time limit `budget`. The first iteration runs regardless of the time, unless the budget
    /// is zero.
    pub(super) fn start(&mut self, begin: Instant, budget: Option<Duration>) {
        self.limit = budget.map(|budget| (begin, budget));
        (self.reserve, self.guaranteed) = (Duration::ZERO, budget != Some(Duration::ZERO));
    }

    /// Ends the iteration that runs regardless of the time.
    pub(super) fn end_guarantee(&mut self) {
        self.guaranteed = false;
    }

    /// Returns whether the time limit is reached.
    pub(super) fn is_over(&self) -> bool {
        self.limit.is_some_and(|(begin, budget)| begin.elapsed() >= budget)
    }

    /// Returns `Ok` if there is time for the phases, one after the other, and the observer wants to continue. Otherwise
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
