//! Policies: the feedback of a solution as a function of time and state, which other threads read while a solve runs.
#![allow(non_snake_case)] // names follow the literature: K

use super::solution::Solution;
use crate::error::{Error, assert_length};
use crate::problem::{ActionModel, Problem, Shape};
use core::fmt;
use nalgebra::DMatrix;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard, TryLockError};

/// Number of buffers. One has the latest plan, one may still be read, and the writer fills the third.
const BUFFERS: usize = 3;

/// Computes the times (s) at which the knots of a problem begin, and the end of the horizon: N + 1 numbers. The first
/// time is 0. An impact takes no time.
///
/// # Errors
/// [`Error::NoDuration`] for a knot whose action has no duration: a user-defined action.
pub(super) fn knot_times(problem: &Problem, times: &mut Vec<f64>) -> Result<(), Error> {
    times.clear();
    let mut time = 0.0;
    for knot in 0..problem.horizon() {
        times.push(time);
        time += problem.duration(knot).ok_or(Error::NoDuration { knot })?;
    }
    times.push(time);
    Ok(())
}

/// Returns the knot of time t and the fraction of its duration that has passed, from 0 to 1. Before the first knot, the
/// fraction is 0 at knot 0; after the horizon, it is 1 at the last knot. Knots without controls are passed over.
fn locate(times: &[f64], shape: &Shape, t: f64) -> (usize, f64) {
    let last = times.len() - 2;
    let mut knot = times[1..=last].partition_point(|begin| *begin <= t);
    let mut fraction = match times[knot + 1] - times[knot] {
        span if span > 0.0 => ((t - times[knot]) / span).clamp(0.0, 1.0),
        _ => 0.0,
    };
    while shape.nu(knot) == 0 && knot > 0 {
        (knot, fraction) = (knot - 1, 1.0);
    }
    (knot, if fraction.is_nan() { 0.0 } else { fraction })
}

/// States of a problem: how states are added, subtracted and interpolated. It is independent of the problem, so another
/// thread can use it while a solve runs. Clones share their memory.
#[derive(Clone)]
pub struct StateSpace(Arc<dyn ActionModel>);

impl fmt::Debug for StateSpace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("StateSpace").field("nx", &self.0.nx()).field("ndx", &self.0.ndx()).finish()
    }
}

impl StateSpace {
    /// Returns the states of a problem. Allocates.
    ///
    /// # Errors
    /// [`Error::NoCopy`] if the terminal action, which adds and subtracts states, cannot be copied.
    pub fn new(problem: &Problem) -> Result<Self, Error> {
        let action = problem.action(problem.horizon()).try_clone().ok_or(Error::NoCopy { model: None })?;
        Ok(Self(action.into()))
    }

    /// Returns the number of entries of a state.
    pub fn nx(&self) -> usize {
        self.0.nx()
    }

    /// Returns the number of entries of a change of state.
    pub fn ndx(&self) -> usize {
        self.0.ndx()
    }

    /// Computes x₁ ⊖ x₀ into `dx` (ndx).
    pub fn difference(&self, x0: &[f64], x1: &[f64], dx: &mut [f64]) {
        self.0.difference(x0, x1, dx);
    }

    /// Computes x₀ ⊕ s (x₁ ⊖ x₀) into `x` (nx), the state at the fraction s of the way from x₀ to x₁. `dx` (ndx) is
    /// scratch.
    pub fn between(&self, [x0, x1]: [&[f64]; 2], s: f64, dx: &mut [f64], x: &mut [f64]) {
        self.0.difference(x0, x1, dx);
        dx.iter_mut().for_each(|dx| *dx *= s);
        self.0.integrate(x0, dx, x);
    }
}

/// Plan at one time: the result of [`Solution::at`].
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PlanPoint {
    /// Index of the knot.
    pub knot: usize,
    /// State x̄, interpolated between the states of this knot and of the next one.
    pub x: Vec<f64>,
    /// Controls ū of the knot.
    pub u: Vec<f64>,
    /// Feedback gains K of the knot, nu × ndx.
    pub K: DMatrix<f64>,
}

impl Solution {
    /// Returns the plan at time t (s) after the beginning of knot 0: the state x̄ = xₖ ⊕ s (xₖ₊₁ ⊖ xₖ), where the
    /// fraction s of knot k has passed, and the controls and gains of knot k. Controls and gains are constant during a
    /// knot, as in its integration step. Times outside the horizon give its first or its last state. `problem` must be
    /// the solved problem; knots have its present durations. Allocates.
    ///
    /// # Errors
    /// [`Error::NoDuration`] for a knot without a duration. [`Error::Dimension`] if the problem has other dimensions
    /// than the solution.
    pub fn at(&self, problem: &Problem, t: f64) -> Result<PlanPoint, Error> {
        self.shape().check(problem.shape())?;
        let mut times = Vec::with_capacity(problem.horizon() + 1);
        knot_times(problem, &mut times)?;
        let (knot, s) = locate(&times, self.shape(), t);
        let (mut x, mut dx) = (vec![0.0; problem.nx()], vec![0.0; problem.ndx()]);
        let space = problem.action(problem.horizon());
        space.difference(self.x(knot), self.x(knot + 1), &mut dx);
        dx.iter_mut().for_each(|dx| *dx *= s);
        space.integrate(self.x(knot), &dx, &mut x);
        Ok(PlanPoint { knot, x, u: self.u(knot).to_vec(), K: self.K[knot].clone() })
    }
}

/// Copy of a solution for readers.
#[derive(Debug, Default)]
struct Stored {
    /// Times at which the knots begin, N + 1 numbers.
    times: Vec<f64>,
    shape: Shape,
    xs: Vec<f64>,
    us: Vec<f64>,
    /// Gains of all knots, each column after column.
    K: Vec<f64>,
    /// Bounds on the controls, infinite for controls without bounds.
    lower: Vec<f64>,
    upper: Vec<f64>,
}

/// Memory that the writer and all readers share.
#[derive(Debug)]
struct Shared {
    buffers: [RwLock<Stored>; BUFFERS],
    /// Index of the buffer with the latest plan; [`BUFFERS`] before the first plan.
    latest: AtomicUsize,
    space: StateSpace,
}

impl Shared {
    /// Locks the buffer of the latest plan for reading, without waiting. Returns `None` before the first plan.
    fn read(&self) -> Option<RwLockReadGuard<'_, Stored>> {
        loop {
            let latest = self.latest.load(Ordering::Acquire);
            match self.buffers.get(latest)?.try_read() {
                Ok(stored) => return Some(stored),
                Err(TryLockError::Poisoned(error)) => return Some(error.into_inner()),
                Err(TryLockError::WouldBlock) => {} // the writer has published a newer plan since
            }
        }
    }

    /// Locks a buffer other than the latest one for writing, and returns its index.
    fn write(&self) -> (usize, RwLockWriteGuard<'_, Stored>) {
        loop {
            let latest = self.latest.load(Ordering::Acquire);
            for (k, buffer) in self.buffers.iter().enumerate().filter(|(k, _)| *k != latest) {
                match buffer.try_write() {
                    Ok(stored) => return (k, stored),
                    Err(TryLockError::Poisoned(error)) => return (k, PoisonError::into_inner(error)),
                    Err(TryLockError::WouldBlock) => {}
                }
            }
            std::thread::yield_now(); // readers still read both old plans
        }
    }
}

/// Publisher of plans for [`Policy`], one for each solver. A controller publishes each new solution, and another thread
/// reads the latest plan at its own rate, also while a solve runs.
///
/// There are three buffers: readers read the latest plan, and the publisher writes to a buffer that no one reads.
/// Readers never wait: a reader that finds its buffer taken reads the newer plan instead.
///
/// ```
/// # use condyle_dynamics::robots;
/// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
/// use condyle_optimal::{Fddp, PolicyPublisher, Problem};
/// # let arm = std::sync::Arc::new(robots::arm7());
/// # let costs = vec![Cost::new("effort", 1.0, Residual::Control { reference: vec![0.0; 7] }, Activation::Quadratic)];
/// # let knot = Box::new(FreeDynamics::running(arm.clone(), 0.02, costs)?);
/// # let (x0, end) = (vec![0.1; 14], Box::new(FreeDynamics::terminal(arm, vec![])?));
/// let mut problem = Problem::new(x0.clone(), vec![knot], vec![0; 10], end)?;
/// let mut publisher = PolicyPublisher::new(&problem)?;
/// let mut policy = publisher.policy();
/// let mut solver = Fddp::new(&problem);
/// let now = 3.0; // time of the measured state x0 (s)
/// solver.solve(&mut problem, &x0.repeat(11), &vec![0.0; 70])?;
/// publisher.publish(&problem, solver.solution(), now)?;
/// let mut u = vec![0.0; 7];
/// let torques = std::thread::spawn(move || {
///     policy.control(now + 0.005, &[0.1; 14], &mut u).map(|_| u)
/// });
/// assert!(torques.join().unwrap().is_some());
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug)]
pub struct PolicyPublisher {
    shared: Arc<Shared>,
}

impl PolicyPublisher {
    /// Creates a publisher without a plan, for solutions of `problem`. Allocates.
    ///
    /// # Errors
    /// [`Error::NoCopy`] if the terminal action cannot be copied; the copy adds and subtracts states.
    pub fn new(problem: &Problem) -> Result<Self, Error> {
        let (space, shape) = (StateSpace::new(problem)?, problem.shape());
        let gains = shape.offsets[shape.horizon()] * shape.ndx;
        let buffers = core::array::from_fn(|_| {
            RwLock::new(Stored {
                times: Vec::with_capacity(shape.horizon() + 1),
                shape: shape.clone(),
                xs: Vec::with_capacity((shape.horizon() + 1) * shape.nx),
                us: Vec::with_capacity(shape.offsets[shape.horizon()]),
                K: Vec::with_capacity(gains),
                lower: Vec::with_capacity(shape.offsets[shape.horizon()]),
                upper: Vec::with_capacity(shape.offsets[shape.horizon()]),
            })
        });
        Ok(Self { shared: Arc::new(Shared { buffers, latest: AtomicUsize::new(BUFFERS), space }) })
    }

    /// Returns a reader of the published plans, for another thread. Allocates.
    pub fn policy(&self) -> Policy {
        Policy { shared: self.shared.clone(), x: Vec::new(), dx: Vec::new() }
    }

    /// Publishes a solution of `problem` whose knot 0 begins at the time `start` (s). The policy has the bounds on
    /// controls that `problem` has now. Allocates nothing, unless the numbers of controls have grown.
    ///
    /// # Errors
    /// [`Error::NoDuration`] for a knot whose action has no duration: call [`publish_at`](Self::publish_at).
    /// [`Error::Dimension`] if the problem has other dimensions than the solution.
    pub fn publish(&mut self, problem: &Problem, solution: &Solution, start: f64) -> Result<(), Error> {
        self.fill(problem, solution, |times| {
            knot_times(problem, times)?;
            times.iter_mut().for_each(|time| *time += start);
            Ok(())
        })
    }

    /// Publishes a solution as [`publish`](Self::publish) does, for knots that begin at the given times. The last of
    /// the N + 1 times is the end of the horizon.
    ///
    /// # Errors
    /// [`Error::Length`] for another number of times, [`Error::NotFinite`] for a time that is not finite.
    /// [`Error::Dimension`] if the problem has other dimensions than the solution.
    pub fn publish_at(&mut self, problem: &Problem, solution: &Solution, times: &[f64]) -> Result<(), Error> {
        Error::check("times", times, problem.horizon() + 1)?;
        self.fill(problem, solution, |to| {
            to.clear();
            to.extend_from_slice(times);
            Ok(())
        })
    }

    /// Copies a plan to a free buffer, whose times `fill_times` writes, and makes it the latest plan.
    fn fill(
        &mut self,
        problem: &Problem,
        solution: &Solution,
        fill_times: impl FnOnce(&mut Vec<f64>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        solution.shape().check(problem.shape())?;
        let (index, mut guard) = self.shared.write();
        let Stored { times, shape, xs, us, K, lower, upper } = &mut *guard;
        fill_times(times)?;
        shape.clone_from(solution.shape());
        xs.clone_from(&solution.xs);
        us.clone_from(&solution.us);
        K.clear();
        solution.K.iter().for_each(|gains| K.extend_from_slice(gains.as_slice()));
        lower.clear();
        upper.clear();
        for knot in 0..shape.horizon() {
            match problem.action(knot).bounds(knot) {
                Some(bounds) => (lower.extend_from_slice(bounds.0), upper.extend_from_slice(bounds.1)),
                None => {
                    let end = lower.len() + shape.nu(knot);
                    (lower.resize(end, f64::NEG_INFINITY), upper.resize(end, f64::INFINITY))
                }
            };
        }
        drop(guard);
        self.shared.latest.store(index, Ordering::Release);
        Ok(())
    }
}

/// Feedback of the latest published solution as a function of time and state, for a thread with a higher rate than the
/// solver. [`PolicyPublisher::policy`] returns it; each thread needs its own clone.
#[derive(Debug, Clone)]
pub struct Policy {
    shared: Arc<Shared>,
    x: Vec<f64>,
    dx: Vec<f64>,
}

/// Part of the plan from which [`Policy::control`] has computed controls.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct PolicyPoint {
    /// Index of the knot.
    pub knot: usize,
    /// Fraction of the knot's duration that has passed, from 0 to 1.
    pub fraction: f64,
    /// Whether the time is at or after the end of the horizon, so that the plan is too old.
    pub is_late: bool,
    /// Whether the controls contain the feedback. They do not if x has an entry that is not finite.
    pub has_feedback: bool,
}

impl Policy {
    /// Computes the controls u = ūₖ + Kₖ (x ⊖ x̄) at the time t (s) and the state x into `u`, moved into the bounds of
    /// the knot. x̄ is the plan's state at this time, as in [`Solution::at`]. Returns `None` before the first plan, and
    /// then leaves `u` unchanged. Never waits for the publisher. Allocates nothing after the first call.
    ///
    /// # Panics
    /// If x does not have nx numbers, or `u` has another length than the controls of the knot.
    #[track_caller]
    pub fn control(&mut self, t: f64, x: &[f64], u: &mut [f64]) -> Option<PolicyPoint> {
        self.run(t, x, |planned| {
            assert_length("u", u.len(), planned.len());
            u.copy_from_slice(planned);
            u
        })
    }

    /// Computes the controls as [`control`](Self::control) does, into a vector that gets the length of the controls of
    /// the knot.
    ///
    /// # Panics
    /// If x does not have nx numbers.
    #[track_caller]
    pub fn control_into(&mut self, t: f64, x: &[f64], u: &mut Vec<f64>) -> Option<PolicyPoint> {
        self.run(t, x, |planned| {
            u.clear();
            u.extend_from_slice(planned);
            u
        })
    }

    /// Computes the controls into the slice to which `copy` has copied the controls of the plan.
    #[track_caller]
    fn run<'u>(&mut self, t: f64, x: &[f64], copy: impl FnOnce(&[f64]) -> &'u mut [f64]) -> Option<PolicyPoint> {
        let Self { shared, x: nominal, dx } = self;
        let stored = shared.read()?;
        let Stored { times, shape, xs, us, K, lower, upper } = &*stored;
        assert_length("x", x.len(), shape.nx);
        let (knot, fraction) = locate(times, shape, t);
        let (range, ndx) = (shape.u(knot), shape.ndx);
        let u = copy(&us[range.clone()]);
        let has_feedback = x.iter().all(|x| x.is_finite());
        if has_feedback {
            nominal.resize(shape.nx, 0.0);
            dx.resize(ndx, 0.0);
            shared.space.between([&xs[shape.x(knot)], &xs[shape.x(knot + 1)]], fraction, dx, nominal);
            shared.space.difference(nominal, x, dx);
            let nu = range.len();
            for (column, dx) in K[range.start * ndx..range.end * ndx].chunks_exact(nu.max(1)).zip(&*dx) {
                u.iter_mut().zip(column).for_each(|(u, k)| *u += k * dx);
            }
        }
        for ((u, lower), upper) in u.iter_mut().zip(&lower[range.clone()]).zip(&upper[range]) {
            *u = u.max(*lower).min(*upper);
        }
        let is_late = times.last().is_some_and(|end| t >= *end);
        Some(PolicyPoint { knot, fraction, is_late, has_feedback })
    }

    /// Returns the time (s) of the end of the latest plan; `None` before the first plan.
    pub fn end(&self) -> Option<f64> {
        self.shared.read()?.times.last().copied()
    }

    /// Returns the number of controls of the knot at the time t (s); `None` before the first plan.
    pub fn nu(&self, t: f64) -> Option<usize> {
        let stored = self.shared.read()?;
        Some(stored.shape.nu(locate(&stored.times, &stored.shape, t).0))
    }
}
