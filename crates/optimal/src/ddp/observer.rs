//! Observers, who look at a solve while it goes on, and may end it.

use super::solution::Iteration;
use crate::time::Instant;
use core::ops::ControlFlow;
use std::time::Duration;

/// An observer of a solve, who may end it: the solution is then the best iterate so far, with
/// [`Status::Interrupted`](crate::Status::Interrupted).
///
/// A closure of an [`Iteration`] is one that sees each iteration, and if it returns a [`ControlFlow`] may end the solve
/// after it:
///
/// ```
/// use condyle_optimal::{Iteration, Observer};
/// use core::ops::ControlFlow::{Break, Continue};
/// fn observe(observer: impl Observer) { /* … */ }
/// observe(|now: &Iteration| println!("{}", now.cost));
/// observe(|now: &Iteration| if now.cost < 1e-3 { Break(()) } else { Continue(()) });
/// ```
pub trait Observer {
    /// Sees an iteration that has ended, and says whether to go on. A solve that has ended by itself takes no notice.
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()>;

    /// Says whether to go on, when nothing has ended: asked between the phases of an iteration (derivatives, sweep, trials),
    /// at most every 10 ms. This is where a program looks for signals, or at a flag that another thread sets.
    fn go_on(&mut self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl<R: Verdict, F: FnMut(&Iteration) -> R> Observer for F {
    fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self(now).verdict()
    }
}

/// The value that a closure that is an [`Observer`] may return: whether to go on, or nothing, which is yes.
pub trait Verdict {
    /// Whether to go on.
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

/// The observer of a solve that nobody observes.
pub(crate) struct Unobserved;

impl Observer for Unobserved {
    fn iteration(&mut self, _: &Iteration) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// The least time between two questions to an observer.
const PERIOD: Duration = Duration::from_millis(10);

/// An observer, and when it was last asked.
pub(crate) struct PacedObserver<'a> {
    observer: &'a mut dyn Observer,
    asked: Instant,
}

impl<'a> PacedObserver<'a> {
    /// A solve begins.
    pub(super) fn new(observer: &'a mut dyn Observer, begin: Instant) -> Self {
        Self { observer, asked: begin }
    }

    /// Shows an iteration.
    pub(super) fn iteration(&mut self, now: &Iteration) -> ControlFlow<()> {
        self.observer.iteration(now)
    }

    /// Asks whether to go on, if it is time to.
    pub(super) fn go_on(&mut self, now: Instant) -> ControlFlow<()> {
        if now.duration_since(self.asked) < PERIOD {
            return ControlFlow::Continue(());
        }
        self.asked = now;
        self.observer.go_on()
    }
}
