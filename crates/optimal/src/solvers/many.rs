//! Many problems that are solved in one call, and their distribution among threads.

use super::solution::{Solution, Status};
use crate::error::Error;
use crate::problem::Problem;
use crate::time::Instant;
use condyle_linalg::threads::join;
use core::ops::ControlFlow;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

/// Minimum time between two calls of [`ManyProblems::go_on`].
const PERIOD: Duration = Duration::from_millis(10);

/// Problems that a [`BatchFddp`](crate::BatchFddp) or a [`OneByOne`](crate::OneByOne) solves, and the receiver of their
/// solutions.
///
/// The methods are called from several threads, for one problem after the other, in any order.
pub trait ManyProblems: Sync {
    /// Error that excludes a problem.
    type Error: From<Error>;

    /// Prepares problem `i`. `problem` is a copy of the nominal problem, which may have been changed for an earlier
    /// problem: this method must set everything that differs between problems. `xs` ((N + 1)·nx) and `us` contain the
    /// nominal warm start, which this method may change.
    ///
    /// # Errors
    /// An error that excludes this problem. It is passed to [`solved`](Self::solved).
    fn start(&self, i: usize, problem: &mut Problem, xs: &mut [f64], us: &mut [f64]) -> Result<(), Self::Error>;

    /// Receives the solution of problem `i`, or the error that excluded it. `problem` is as `start` left it, and is
    /// used for a later problem.
    fn solved(&self, i: usize, problem: &mut Problem, result: Result<&Solution, Self::Error>);

    /// Returns whether to continue. This method is called at most every 10 ms on each thread.
    fn go_on(&self) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Copies a nominal warm start to the storage of each thread, after a check of lengths and numbers.
pub(super) fn copy_start<'a>(
    starts: impl Iterator<Item = &'a mut [Vec<f64>; 2]>,
    xs: &[f64],
    us: &[f64],
) -> Result<(), Error> {
    for [own_xs, own_us] in starts {
        Error::check("xs", xs, own_xs.len())?;
        Error::check("us", us, own_us.len())?;
        own_xs.copy_from_slice(xs);
        own_us.copy_from_slice(us);
    }
    Ok(())
}

/// Distribution of the problems of a call among the threads.
pub(super) struct Queue<'a, P, S> {
    pub(super) problems: &'a P,
    pub(super) settings: &'a S,
    count: usize,
    next: AtomicUsize,
    /// Whether the time is over; the next field is whether the receiver of the solutions has ended the call.
    is_over: AtomicBool,
    is_interrupted: AtomicBool,
    begin: Instant,
    /// Time limit of the call.
    budget: Option<Duration>,
}

/// Lets each worker solve problems by `run`, each on its own thread if possible.
pub(super) fn spread<W: Send>(workers: &mut [W], run: &(impl Fn(&mut W) + Sync)) {
    match workers {
        [worker] => run(worker),
        workers => {
            let (one, other) = workers.split_at_mut(workers.len() / 2);
            join(|| spread(one, run), || spread(other, run));
        }
    }
}

impl<'a, P: ManyProblems, S> Queue<'a, P, S> {
    /// Creates the queue of a call that begins now.
    pub(super) fn new(problems: &'a P, settings: &'a S, count: usize, budget: Option<Duration>) -> Self {
        Self {
            problems,
            settings,
            count,
            next: AtomicUsize::new(0),
            is_over: AtomicBool::new(false),
            is_interrupted: AtomicBool::new(false),
            begin: Instant::now(),
            budget,
        }
    }

    /// Returns the index of the next problem, unless all problems have started or the call ends early.
    pub(super) fn take(&self) -> Option<usize> {
        if self.is_over.load(Ordering::Relaxed) || self.is_interrupted.load(Ordering::Relaxed) {
            return None;
        }
        let taken = self.next.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |i| (i < self.count).then_some(i + 1));
        taken.ok()
    }

    /// Returns the number of problems that have started.
    pub(super) fn taken(&self) -> usize {
        self.next.load(Ordering::Relaxed)
    }

    /// Returns the time that is left for the call.
    pub(super) fn time_left(&self) -> Option<Duration> {
        self.budget.map(|budget| budget.saturating_sub(self.begin.elapsed()))
    }

    /// Returns the reason to end the call early, if there is one. Calls the observer if `asked` was long ago.
    pub(super) fn stops(&self, asked: &mut Instant) -> Option<Status> {
        let now = Instant::now();
        if self.budget.is_some_and(|budget| now.duration_since(self.begin) >= budget) {
            self.is_over.store(true, Ordering::Relaxed);
        }
        if now.duration_since(*asked) >= PERIOD {
            *asked = now;
            if self.problems.go_on().is_break() {
                self.is_interrupted.store(true, Ordering::Relaxed);
            }
        }
        match (self.is_interrupted.load(Ordering::Relaxed), self.is_over.load(Ordering::Relaxed)) {
            (true, _) => Some(Status::Interrupted),
            (_, true) => Some(Status::TimeLimit),
            _ => None,
        }
    }
}
