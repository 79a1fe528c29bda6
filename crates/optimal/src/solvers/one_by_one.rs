//! Solution of many problems by any solver, one problem at a time on each thread.

use super::many::{ManyProblems, Queue, copy_start, spread};
use super::solution::{Iteration, Status};
use super::start::quasi_static_start;
use super::watch::Observer;
use crate::error::Error;
use crate::problem::Problem;
use crate::solvers::{AugmentedLagrangian, Fddp, InteriorPoint};
use crate::time::Instant;
use core::ops::ControlFlow;
use sealed::Solves;
use std::time::Duration;

/// Solvers that a [`OneByOne`] can use: [`Fddp`], [`InteriorPoint`] and [`AugmentedLagrangian`].
pub trait SingleSolver: Solves {}

impl<S: Solves> SingleSolver for S {}

/// Solver of many problems that have the same numbers of knots, states and controls. On each thread, a solver `S`
/// solves one problem after the other.
///
/// The result of a problem is the result of a new solver with the same settings, to the bit. It does not depend on the
/// other problems. SIMD lanes compute several knots of one problem. For many problems without limits,
/// [`BatchFddp`](crate::BatchFddp) computes several problems at a time in these lanes, which may be faster.
///
/// ```
/// use condyle_optimal::{Error, InteriorPoint, LqKnot, Lqr, ManyProblems, OneByOne, Problem, Solution};
/// use std::sync::Mutex;
///
/// /// Problems x⁺ = x + u, ℓ = ½ (x² + u²), from different initial states.
/// struct Starts { x0: Vec<f64>, costs: Mutex<Vec<f64>> }
///
/// impl ManyProblems for Starts {
///     type Error = Error;
///
///     fn start(&self, i: usize, problem: &mut Problem, xs: &mut [f64], _: &mut [f64]) -> Result<(), Error> {
///         xs.fill(self.x0[i]);
///         problem.set_x0(&self.x0[i..=i])
///     }
///
///     fn solved(&self, i: usize, _: &mut Problem, result: Result<&Solution, Error>) {
///         self.costs.lock().unwrap()[i] = result.map_or(f64::NAN, |solution| solution.cost);
///     }
/// }
///
/// let (mut knot, mut end) = (LqKnot::zeros(1, 1), LqKnot::zeros(1, 0));
/// (knot.A[0], knot.B[0], knot.Q[0], knot.R[0], end.Q[0]) = (1.0, 1.0, 1.0, 1.0, 1.0);
/// let problem = Problem::new(vec![1.0], vec![Box::new(Lqr::new(knot))], vec![0; 30], Box::new(Lqr::new(end)))?;
///
/// let starts = Starts { x0: vec![1.0, 2.0, f64::NAN], costs: Mutex::new(vec![0.0; 3]) };
/// let mut solver = OneByOne::<InteriorPoint>::new(&problem, 1)?;
/// solver.solver.settings.tolerance = 1e-8;
/// assert_eq!(solver.solve(3, &starts)?, 3);
/// let costs = starts.costs.into_inner().unwrap();
/// assert!((costs[1] - 4.0 * costs[0]).abs() < 1e-12 && costs[2].is_nan()); // the third problem fails alone
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug)]
pub struct OneByOne<S> {
    /// Solver with the settings of each solve. Its time budget applies to each problem.
    pub solver: S,
    /// Time limit of each call of [`solve`](Self::solve); `None` for no limit.
    pub time_budget: Option<Duration>,
    workers: Vec<Worker<S>>,
}

/// Solver of one thread.
#[derive(Debug)]
struct Worker<S> {
    nominal: Problem,
    /// Copy of the nominal problem, which is changed for each problem.
    problem: Problem,
    /// Nominal warm start: states and controls.
    start: [Vec<f64>; 2],
    /// Warm start of the problem that is being solved.
    trajectory: [Vec<f64>; 2],
    /// Solver of the problems that match the nominal problem.
    solver: S,
}

/// Observer of a solve, which ends the solve if the receiver of the solutions ends the call.
struct Asking<'a, P, S> {
    queue: &'a Queue<'a, P, S>,
    asked: &'a mut Instant,
}

impl<P: ManyProblems, S> Observer for Asking<'_, P, S> {
    fn iteration(&mut self, _: &Iteration) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn go_on(&mut self) -> ControlFlow<()> {
        match self.queue.stops(self.asked) {
            Some(Status::Interrupted) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()), // the time limit of the solve ends it at the end of the call's time
        }
    }
}

impl<S: SingleSolver> OneByOne<S> {
    /// Creates a solver with the default settings, and with copies of the nominal problem for `threads` threads. The
    /// nominal warm start is x̂₀ at all knots, and the controls that hold x̂₀ still. Allocates.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub fn new(problem: &Problem, threads: usize) -> Result<Self, Error> {
        let mut nominal = problem.try_clone()?;
        let start = quasi_static_start(&mut nominal)?;
        let worker = || {
            let nominal = problem.try_clone()?;
            let problem = problem.try_clone_beside(&nominal)?;
            let solver = S::create(&nominal);
            Ok(Worker { nominal, problem, start: start.clone(), trajectory: start.clone(), solver })
        };
        let workers = (0..threads.max(1)).map(|_| worker()).collect::<Result<_, Error>>()?;
        Ok(Self { solver: S::create(&nominal), time_budget: None, workers })
    }

    /// Sets the nominal warm start: the states ((N + 1)·nx, gaps allowed) and the controls from which all problems
    /// start, unless [`ManyProblems::start`] changes them.
    ///
    /// # Errors
    /// [`Error`] if a length is wrong or a number is not finite. The old warm start is then kept.
    pub fn set_start(&mut self, xs: &[f64], us: &[f64]) -> Result<(), Error> {
        copy_start(self.workers.iter_mut().map(|worker| &mut worker.start), xs, us)
    }

    /// Solves the problems 0 … `count` − 1. Returns the number of problems that were passed to
    /// [`ManyProblems::solved`]. It is below `count` if time is over or [`ManyProblems::go_on`] ends the solve: the
    /// problems that are being solved then end with [`Status::TimeLimit`] or [`Status::Interrupted`], and the others do
    /// not start.
    ///
    /// # Errors
    /// [`Error::Setting`] for an invalid setting.
    pub fn solve(&mut self, count: usize, problems: &impl ManyProblems) -> Result<usize, Error> {
        self.solver.check()?;
        let queue = Queue::new(problems, &self.solver, count, self.time_budget);
        spread(&mut self.workers, &|worker: &mut Worker<S>| worker.run(&queue));
        Ok(queue.taken())
    }
}

impl<S: SingleSolver> Worker<S> {
    /// Solves problems until the queue is empty or a reason to stop exists.
    fn run<P: ManyProblems>(&mut self, queue: &Queue<'_, P, S>) {
        let Self { nominal, problem, start, trajectory, solver } = self;
        let mut asked = Instant::now();
        while queue.stops(&mut asked).is_none() {
            let Some(index) = queue.take() else { return };
            let [xs, us] = trajectory;
            xs.copy_from_slice(&start[0]);
            us.copy_from_slice(&start[1]);
            if let Err(error) = queue.problems.start(index, problem, xs, us) {
                queue.problems.solved(index, problem, Err(error));
                continue;
            }
            let mut other = (!problem.matches(nominal)).then(|| S::create(problem));
            let solver = other.as_mut().unwrap_or(solver);
            solver.prepare(queue.settings, queue.time_left());
            let observer = Asking { queue, asked: &mut asked };
            let result = solver.solve_from(problem, [xs, us], observer).map_err(P::Error::from);
            queue.problems.solved(index, problem, result);
        }
    }
}

/// Methods that the solvers share, and that users do not call.
mod sealed {
    use super::{AugmentedLagrangian, Duration, Error, Fddp, InteriorPoint, Observer, Problem};
    use crate::Solution;

    /// Solver of one problem after the other.
    pub trait Solves: Send + Sync + Sized {
        /// Creates a solver with the default settings.
        fn create(problem: &Problem) -> Self;

        /// Checks the settings.
        fn check(&self) -> Result<(), Error>;

        /// Takes the settings of another solver, with a time budget of at most `most`, and forgets the last gains, so
        /// that a solve without a sweep has none.
        fn prepare(&mut self, settings: &Self, most: Option<Duration>);

        /// Solves a problem from a warm start.
        fn solve_from(
            &mut self,
            problem: &mut Problem,
            start: [&[f64]; 2],
            observer: impl Observer,
        ) -> Result<&Solution, Error>;
    }

    /// Returns the smaller of two time limits.
    fn smaller(one: Option<Duration>, other: Option<Duration>) -> Option<Duration> {
        one.into_iter().chain(other).min()
    }

    /// Implements [`Solves`] for a solver: its class, the path of its time budget, and its other settings.
    macro_rules! solves {
        ($($class:ident: $($budget:ident).+ $(, $inner:ident)?;)*) => {$(
            impl Solves for $class {
                fn create(problem: &Problem) -> Self {
                    Self::new(problem)
                }

                fn check(&self) -> Result<(), Error> {
                    $(self.$inner.check()?;)?
                    self.settings.check()
                }

                fn prepare(&mut self, settings: &Self, most: Option<Duration>) {
                    self.settings.clone_from(&settings.settings);
                    $(self.$inner.clone_from(&settings.$inner);)?
                    self.$($budget).+ = smaller(settings.$($budget).+, most);
                    self.forget_gains();
                }

                fn solve_from(
                    &mut self,
                    problem: &mut Problem,
                    [xs, us]: [&[f64]; 2],
                    observer: impl Observer,
                ) -> Result<&Solution, Error> {
                    self.solve_with(problem, xs, us, observer)
                }
            }
        )*};
    }

    solves! {
        Fddp: settings.time_budget;
        InteriorPoint: settings.time_budget;
        AugmentedLagrangian: inner.time_budget, inner;
    }
}
