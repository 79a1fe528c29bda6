//! Observers, which follow a solve while it runs and may end it.

use super::solution::Iteration;
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
    /// has ended by itself.
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()>;

    /// Returns whether to continue, while an iteration is running. It is called between the phases of an iteration
    /// (derivatives, sweep, trials), at most every 10 ms. A program can check for signals here, or a flag that another
    /// thread sets.
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

/// Observer of a solve without an observer.
pub(crate) struct Unobserved;

impl Observer for Unobserved {
    fn iteration(&mut self, _: &Iteration) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Minimum time between two calls of [`Observer::go_on`].
const PERIOD: Duration = Duration::from_millis(10);

/// Observer, and the time of its last call.
pub(crate) struct PacedObserver<'a> {
    observer: &'a mut dyn Observer,
    asked: Instant,
}

impl<'a> PacedObserver<'a> {
    /// Creates the paced observer at the beginning of a solve.
    pub(super) fn new(observer: &'a mut dyn Observer, begin: Instant) -> Self {
        Self { observer, asked: begin }
    }

    /// Passes an iteration to the observer.
    pub(super) fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self.observer.iteration(now)
    }

    /// Asks the observer whether to continue, if the minimum time has passed.
    pub(super) fn go_on(&mut self, now: Instant) -> ControlFlow<()> {
        if now.duration_since(self.asked) < PERIOD {
            return ControlFlow::Continue(());
        }
        self.asked = now;
        self.observer.go_on()
    }
}
