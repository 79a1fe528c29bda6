//! Solution of many problems of one shape by FDDP, several at a time in the lanes of SIMD registers.

use super::directions::{Directions, Member};
use super::many::{ManyProblems, copy_start, spread};
use super::rollout::{Nominal, SeveralProblems, Trials};
use super::search::Search;
use super::settings::Settings;
use super::solution::{Iteration, Status};
use super::solver_loop::{Pass, Progress, SolverLoop};
use super::watch::{Observer, Watch};
use crate::error::Error;
use crate::lq::{LqKnot, Sweep};
use crate::problem::Problem;
use crate::solvers::fddp::Fddp;
use crate::time::Instant;
use core::ops::ControlFlow;

/// Share of the lanes from which on the problems that wait for their search directions no longer wait for the line
/// searches of the others. The sweep of few problems takes as long as the sweep of all.
const FULL: f64 = 0.75;

/// Solver of many problems that have the same shape: the same numbers of knots, states and controls, and the same kinds
/// of dynamics and costs. The problems may differ in initial states, targets, weights, bounds, durations, and in the
/// targets of contacts.
///
/// As many problems as a SIMD register has lanes are solved together. Each problem has its own iterations of [`Fddp`]:
/// its own step lengths, regularisation and convergence. The trials of all line searches are rolled out in lanes. The
/// sweeps run in lanes too, if the processor has AVX-512 and the robot is an arm of at most 16 joints, each with a
/// motor. Controls must have no bounds, and knots the [inverse-dynamics form](Settings::inverse_dynamics_form). Other
/// problems are swept one by one. A problem that has ended is replaced by the next one. Each thread solves its own
/// problems.
///
/// The result of a problem does not depend on the other problems, to the bit. It differs from the result of [`Fddp`] by
/// rounding at most, because [`Fddp`] rolls out a single trial, and sweeps, by other algorithms.
///
/// A problem with another robot model, such as other inertial parameters, is solved alone, by [`Fddp`]. The same holds
/// for other frames, kinds or gains of contacts, and for other kinds of costs and limits.
///
/// ```
/// use condyle_optimal::{BatchFddp, Error, LqKnot, Lqr, ManyProblems, Problem, Solution};
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
/// let mut solver = BatchFddp::new(&problem, 1)?;
/// assert_eq!(solver.solve(3, &starts)?, 3);
/// let costs = starts.costs.into_inner().unwrap();
/// assert!((costs[1] - 4.0 * costs[0]).abs() < 1e-12 && costs[2].is_nan()); // the third problem fails alone
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug)]
pub struct BatchFddp {
    /// Settings of each solve. [`threads`](Settings::threads) and [`segments`](Settings::segments) are not used. The
    /// [`time_budget`](Settings::time_budget) applies to each call of [`solve`](Self::solve), not to each problem.
    pub settings: Settings,
    workers: Vec<Worker>,
}

/// Solver of one thread.
#[derive(Debug)]
struct Worker {
    nominal: Problem,
    /// Nominal warm start: states and controls.
    start: [Vec<f64>; 2],
    slots: Vec<Slot>,
    trials: Trials,
    /// Linear-quadratic problem and sweep, which all slots use in turn, so that they stay in the caches.
    linear: Linear,
    /// Search directions of all slots in lanes; `None` if directions are computed one by one.
    directions: Option<Directions>,
}

/// Storage of a linear-quadratic problem, and its sweep.
#[derive(Debug)]
struct Linear {
    knots: Vec<LqKnot>,
    sweep: Sweep,
}

/// Place for one of the problems that are solved together.
#[derive(Debug)]
struct Slot {
    problem: Problem,
    solver: SolverLoop,
    task: Option<Task>,
}

/// Problem that is being solved.
#[derive(Debug)]
struct Task {
    index: usize,
    begin: Instant,
    now: Progress,
    iteration: usize,
    search: Search,
    /// Number of step lengths that this search has tried.
    tried: usize,
    /// Whether the iteration waits for its search direction. If not, its line search is running.
    waits: bool,
}

type Queue<'a, P> = super::many::Queue<'a, P, Settings>;

/// Observer that lets a solve run to its end.
struct Unobserved;

impl Observer for Unobserved {
    fn iteration(&mut self, _: &Iteration) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

impl BatchFddp {
    /// Creates a solver with the default settings, and with copies of the nominal problem for `threads` threads. The
    /// nominal warm start is x̂₀ at all knots, and the controls that hold x̂₀ still. Allocates.
    ///
    /// # Errors
    /// [`Error::NoCopy`] for an action that cannot be copied.
    pub fn new(problem: &Problem, threads: usize) -> Result<Self, Error> {
        let mut nominal = problem.try_clone()?;
        let [xs, us] = super::start::quasi_static_start(&mut nominal)?;
        let workers = (0..threads.max(1)).map(|_| Worker::new(problem, [&xs, &us])).collect::<Result<_, _>>()?;
        Ok(Self { settings: Settings::default(), workers })
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
        self.settings.check()?;
        let settings = Settings { threads: 1, segments: 1, time_budget: None, ..self.settings.clone() };
        let queue = Queue::new(problems, &settings, count, self.settings.time_budget);
        spread(&mut self.workers, &|worker: &mut Worker| worker.run(&queue));
        Ok(queue.taken())
    }
}

impl Worker {
    /// Creates the solver of one thread.
    fn new(problem: &Problem, [xs, us]: [&[f64]; 2]) -> Result<Self, Error> {
        let width = problem.lanes();
        let nominal = problem.try_clone()?;
        let slot = || {
            let problem = problem.try_clone_beside(&nominal)?;
            Ok(Slot { solver: SolverLoop::for_batch(&problem), problem, task: None })
        };
        let mut trials = Trials::new(&nominal, width);
        trials.keep_motions(nominal.motion_size());
        let slots = (0..width).map(|_| slot()).collect::<Result<_, Error>>()?;
        let knots = SolverLoop::knots_of(&nominal);
        let directions = Directions::new(&nominal, &knots);
        let linear = Linear { sweep: Sweep::new(&knots), knots };
        Ok(Self { nominal, start: [xs.to_vec(), us.to_vec()], slots, trials, linear, directions })
    }

    /// Solves problems until the queue is empty or a reason to stop exists.
    fn run<P: ManyProblems>(&mut self, queue: &Queue<'_, P>) {
        let mut asked = Instant::now();
        loop {
            let stop = queue.stops(&mut asked);
            for k in 0..self.slots.len() {
                if let Some(status) = stop
                    && let Some(task) = self.slots[k].task.take()
                {
                    self.slots[k].end(queue, task, status, &mut self.linear);
                }
                while stop.is_none() && self.slots[k].task.is_none() {
                    let Some(index) = queue.take() else { break };
                    self.begin(k, index, queue);
                }
            }
            if self.slots.iter().all(|slot| slot.task.is_none()) {
                return;
            }
            let searching = self.slots.iter().filter(|slot| slot.searching().is_some()).count();
            let waiting = self.slots.iter().filter(|slot| slot.task.is_some()).count() - searching;
            match searching > 0 && (waiting as f64) < FULL * self.slots.len() as f64 {
                true => self.search(queue),
                false => self.find_directions(queue),
            }
        }
    }

    /// Begins problem `index` in slot k. A problem that cannot share lanes is solved at once.
    fn begin<P: ManyProblems>(&mut self, k: usize, index: usize, queue: &Queue<'_, P>) {
        let Self { nominal, start, slots, linear, directions, .. } = self;
        let Slot { problem, solver, .. } = &mut slots[k];
        let begin = Instant::now();
        let [mut xs, mut us] = start.clone();
        let prepared = queue.problems.start(index, problem, &mut xs, &mut us);
        if let Err(error) = prepared {
            return queue.problems.solved(index, problem, Err(error));
        }
        if !problem.matches(nominal) {
            let mut alone = Fddp::new(nominal);
            alone.settings = queue.settings.clone();
            let result = alone.solve(problem, &xs, &us).map_err(P::Error::from);
            return queue.problems.solved(index, problem, result);
        }
        solver.exchange(&mut linear.knots, &mut linear.sweep, false);
        let begun = solver.begin(problem, queue.settings, Some([&xs, &us]));
        let now = begun.map(|()| {
            solver.forget_gains();
            solver.start_clock(queue.settings, &Watch::new(&mut Unobserved));
            solver.start_pass(problem, queue.settings, Pass::default())
        });
        solver.exchange(&mut linear.knots, &mut linear.sweep, false);
        let now = match now {
            Ok(now) => now,
            Err(error) => return queue.problems.solved(index, problem, Err(error.into())),
        };
        let task = Task { index, begin, now, iteration: 0, search: Search::default(), tried: 0, waits: false };
        self.slots[k].advance(queue, task, linear, directions.is_some());
    }

    /// Computes the search directions of all problems that wait for them, in lanes. A problem whose sweep fails there
    /// is swept alone, with a larger regularisation.
    fn find_directions<P: ManyProblems>(&mut self, queue: &Queue<'_, P>) {
        let Self { slots, linear, directions: Some(directions), .. } = self else { return };
        let mut members = Vec::with_capacity(slots.len());
        for Slot { problem, solver, task } in &mut *slots {
            let Some(task) = task.as_mut().filter(|task| task.waits) else { continue };
            if task.search.accepted {
                task.now.merit.gap = solver.iterate.update_gaps(problem);
            }
            members.push(Member { problem, solver, now: &mut task.now });
        }
        let mut found = directions.run(&mut members, |feasible| queue.settings.counts_gaps(feasible)).into_iter();
        for slot in slots {
            let Some(mut task) = slot.task.take_if(|task| task.waits) else { continue };
            match found.next().flatten() {
                Some(expected) => {
                    task.search = slot.solver.line_search.begin_expecting(expected, queue.settings, task.search);
                    task.waits = false;
                    slot.task = Some(task);
                }
                None => slot.find_direction(queue, task, linear),
            }
        }
    }

    /// Rolls out trials of all problems, and ends the line searches that accept a trial or have no more step lengths.
    fn search<P: ManyProblems>(&mut self, queue: &Queue<'_, P>) {
        let Self { slots, trials, linear, directions, .. } = self;
        let most = queue.settings.step_lengths;
        // one trial for each problem, and then the next step lengths of the problems whose first trial was rejected
        let mut counts: Vec<usize> = slots.iter().map(|slot| usize::from(slot.searching().is_some())).collect();
        let mut free = trials.width() - counts.iter().sum::<usize>();
        while free > 0 {
            let before = free;
            for (slot, count) in slots.iter().zip(&mut counts) {
                let Some(task) = slot.searching() else { continue };
                if task.tried > 0 && task.tried + *count < most && free > 0 {
                    (*count, free) = (*count + 1, free - 1);
                }
            }
            if free == before {
                break;
            }
        }
        let (mut problems, mut of, mut steps) = (Vec::new(), Vec::new(), Vec::new());
        let horizon = slots[0].problem.horizon();
        for (slot, &count) in slots.iter_mut().zip(&counts) {
            let Some(task) = slot.task.as_ref().filter(|task| !task.waits) else { continue };
            let SolverLoop { iterate, line_search, .. } = &slot.solver;
            let counts_gaps = queue.settings.counts_gaps(task.now.merit.feasible);
            of.extend((0..count).map(|_| problems.len()));
            steps.extend_from_slice(&line_search.steps()[task.tried..task.tried + count]);
            problems.push((slot.problem.action_view(), Nominal::stored(iterate, counts_gaps)));
        }
        trials.run(&mut SeveralProblems { problems, of }, &steps, 0..=horizon);
        let mut first = 0;
        for (slot, &count) in slots.iter_mut().zip(&counts) {
            let Some(mut task) = slot.task.take_if(|task| !task.waits) else { continue };
            let Slot { problem, solver, .. } = slot;
            let view = problem.action_view();
            for i in first..first + count {
                let (line_search, around, _) = solver.surroundings(queue.settings, &task.now);
                let accepted = line_search.judge(around, &mut task.search, (trials, i, task.tried), &view);
                task.tried += 1;
                if accepted {
                    break;
                }
            }
            first += count;
            if !(task.search.accepted || task.tried == most) {
                slot.task = Some(task);
                continue;
            }
            let watch = &mut Unobserved;
            let (now, iteration) = (&mut task.now, task.iteration);
            let stop = solver.end_iteration(
                queue.settings,
                Pass::default(),
                now,
                iteration,
                &task.search,
                &mut Watch::new(watch),
            );
            task.iteration += 1;
            match stop {
                Some(status) => slot.end(queue, task, status, linear),
                None => slot.advance(queue, task, linear, directions.is_some()),
            }
        }
    }
}

impl Slot {
    /// Returns the problem of this slot if its line search is running.
    fn searching(&self) -> Option<&Task> {
        self.task.as_ref().filter(|task| !task.waits)
    }

    /// Begins the next iteration of a problem. Ends the solve if there is a reason to stop. With `waits`, the problem
    /// then waits for its search direction, unless the direction cannot be computed in lanes.
    fn advance<P: ManyProblems>(&mut self, queue: &Queue<'_, P>, mut task: Task, linear: &mut Linear, waits: bool) {
        let settings = queue.settings;
        if !task.now.is_finite() && task.iteration == 0 {
            return self.end(queue, task, Status::NotFinite, linear);
        }
        if task.iteration == Pass::default().most(settings) {
            return self.end(queue, task, Status::MaxIterations, linear);
        }
        task.tried = 0;
        if waits && self.solver.uses_inverse_dynamics() {
            task.waits = true;
            self.task = Some(task);
        } else {
            self.find_direction(queue, task, linear);
        }
    }

    /// Finds the search direction of one problem: derivatives, sweep, and the expected decrease of its line search.
    /// Ends the solve if there is no direction.
    fn find_direction<P: ManyProblems>(&mut self, queue: &Queue<'_, P>, mut task: Task, linear: &mut Linear) {
        let Self { problem, solver, .. } = self;
        let (settings, Linear { knots, sweep }) = (queue.settings, &mut *linear);
        // the derivatives are always computed, because other problems have used their storage
        let steps = [true, task.search.accepted];
        solver.exchange(knots, sweep, task.iteration > 0);
        let mut observer = Unobserved;
        let watch = &mut Watch::new(&mut observer);
        let found = solver.begin_iteration(problem, settings, &mut task.now, steps, None, watch);
        if found.is_ok() {
            let (line_search, around, _) = solver.surroundings(settings, &task.now);
            task.search = line_search.begin(&around, task.search);
            solver.store_gains(&mut task.now);
        }
        solver.exchange(knots, sweep, false);
        if let Err(status) = found {
            return self.end(queue, task, status, linear);
        }
        task.waits = false;
        self.task = Some(task);
    }

    /// Completes a solution and passes it on.
    fn end<P: ManyProblems>(&mut self, queue: &Queue<'_, P>, task: Task, status: Status, linear: &mut Linear) {
        let Self { problem, solver, .. } = self;
        solver.exchange(&mut linear.knots, &mut linear.sweep, task.iteration > 0);
        solver.finish(problem, queue.settings, task.now, status);
        solver.exchange(&mut linear.knots, &mut linear.sweep, false);
        let solution = &mut solver.iterate.solution;
        solution.timings.end(task.begin.elapsed(), None);
        queue.problems.solved(task.index, problem, Ok(solution));
    }
}
