//! Time budgets: the effect of a delay on a controller, and the recovery of the controller.

use condyle_optimal::{ActionModel, AugmentedLagrangian, Error, Fddp, LqKnot, Problem, Solution, Status};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

/// Budget of each solve; the next constant is the duration of the delay (ms). Both are long compared with an iteration
/// of a few µs and with disturbances by other processes.
const BUDGET: Duration = Duration::from_millis(400);
const DELAY: u64 = 900;
/// Horizon of the problem, long enough that a solve from a new initial state takes several iterations.
const HORIZON: usize = 30;
/// Bound on |x| in the closed loop; a diverging rollout exceeds it by orders of magnitude.
const SANE: f64 = 50.0;

/// Unstable pendulum, θ̈ = 3 sin θ + u, by Euler steps of 0.1 s. Under a constant control, its state triples in 6
/// knots. The fields `delay` and `broken` make its derivatives sleep or become NaN.
#[derive(Clone)]
pub(super) struct Unstable {
    pub(super) nu: usize,
    /// Time for which the next call of `calc_diff` sleeps (ms).
    pub(super) delay: Arc<AtomicU64>,
    /// Whether derivatives are NaN.
    pub(super) broken: Arc<AtomicU64>,
}

impl ActionModel for Unstable {
    fn nx(&self) -> usize {
        2
    }
    fn nu(&self) -> usize {
        self.nu
    }
    fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let u: f64 = u.iter().sum();
        next[0] = x[0] + 0.1 * x[1];
        next[1] = x[1] + 0.1 * (3.0 * x[0].sin() + u);
        0.5 * (10.0 * x[0] * x[0] + x[1] * x[1] + 0.1 * u * u)
    }
    fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        let delay = self.delay.swap(0, Ordering::SeqCst);
        if delay > 0 {
            std::thread::sleep(Duration::from_millis(delay));
        }
        let factor = if self.broken.load(Ordering::SeqCst) > 0 { f64::NAN } else { 1.0 };
        knot.A.copy_from_slice(&[1.0, 0.3 * x[0].cos(), 0.1, 1.0]);
        knot.Q.copy_from_slice(&[10.0, 0.0, 0.0, 1.0]);
        knot.q.copy_from_slice(&[10.0 * x[0] * factor, x[1]]);
        for i in 0..self.nu {
            (knot.B[(0, i)], knot.B[(1, i)], knot.R[(i, i)], knot.r[i]) = (0.0, 0.1, 0.1, 0.1 * u[i]);
            (knot.S[(0, i)], knot.S[(1, i)]) = (0.0, 0.0);
        }
    }
    fn try_clone(&self) -> Option<Box<dyn ActionModel>> {
        Some(Box::new(self.clone()))
    }
}

/// Solver of the tests: FDDP or the augmented Lagrangian.
enum Solver {
    Fddp(Box<Fddp>),
    Constrained(Box<AugmentedLagrangian>),
}

impl Solver {
    fn each(problem: &Problem) -> [Self; 2] {
        [Self::Fddp(Box::new(Fddp::new(problem))), Self::Constrained(Box::new(AugmentedLagrangian::new(problem)))]
    }
    fn settings(&mut self) -> &mut condyle_optimal::Settings {
        match self {
            Self::Fddp(solver) => &mut solver.settings,
            Self::Constrained(solver) => &mut solver.inner,
        }
    }
    fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Solution {
        match self {
            Self::Fddp(solver) => solver.solve(problem, xs, us),
            Self::Constrained(solver) => solver.solve(problem, xs, us),
        }
        .unwrap()
        .clone()
    }
    fn resume(&mut self, problem: &mut Problem) -> Solution {
        match self {
            Self::Fddp(solver) => solver.resume(problem),
            Self::Constrained(solver) => solver.resume(problem),
        }
        .unwrap()
        .clone()
    }
    fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        problem.shift(0)?;
        match self {
            Self::Fddp(solver) => solver.shift(problem),
            Self::Constrained(solver) => solver.shift(problem),
        }
    }
    fn solution(&self) -> &Solution {
        match self {
            Self::Fddp(solver) => solver.solution(),
            Self::Constrained(solver) => solver.solution(),
        }
    }
    /// Returns the number of iterations, summed over all inner solves.
    fn iterations(&self) -> usize {
        match self {
            Self::Fddp(solver) => solver.solution().trace.len(),
            Self::Constrained(solver) => solver.outcome().iterations,
        }
    }
}

/// Closed loop of a plant, a problem and a solver, which has solved the problem once without a budget.
struct Loop {
    plant: Unstable,
    problem: Problem,
    solver: Solver,
    x: Vec<f64>,
}

impl Loop {
    fn all() -> impl Iterator<Item = Self> {
        [(0, 1), (0, 2), (1, 1), (1, 2)].into_iter().map(|(which, threads)| {
            let plant = Unstable { nu: 1, delay: Arc::default(), broken: Arc::default() };
            let end = Unstable { nu: 0, ..plant.clone() };
            let x = vec![0.8, 0.0];
            let mut problem =
                Problem::new(x.clone(), vec![Box::new(plant.clone())], vec![0; HORIZON], Box::new(end)).unwrap();
            let mut solver = Solver::each(&problem).into_iter().nth(which).unwrap();
            solver.settings().threads = threads;
            let first = solver.solve(&mut problem, &x.repeat(HORIZON + 1), &[0.0; HORIZON]);
            assert_eq!(first.status, Status::Converged);
            Self { plant, problem, solver, x }
        })
    }

    /// Simulates one control period: the plant follows the plan, the horizon moves by one knot, and the solver computes
    /// the next plan.
    fn step(&mut self) -> Solution {
        let plan = self.solver.solution();
        let u = plan.u(0)[0] + (0..2).map(|i| plan.K[0][(0, i)] * (self.x[i] - plan.x(0)[i])).sum::<f64>();
        let mut next = vec![0.0; 2];
        self.plant.calc(0, &self.x, &[u], &mut next);
        next[1] += 0.02; // disturbs the plant
        self.x = next;
        self.solver.shift(&mut self.problem).unwrap();
        self.problem.set_x0(&self.x).unwrap();
        self.solver.resume(&mut self.problem)
    }
}

/// Returns the largest absolute value in the trajectory of a solution.
fn size(solution: &Solution) -> f64 {
    solution.xs.iter().chain(&solution.us).fold(0.0, |most, x| most.max(x.abs()))
}

/// Checks that a delay makes one solve late, which reports an overrun, and that the following solves are normal.
#[test]
fn a_controller_recovers_from_a_delay() {
    for mut now in Loop::all() {
        now.solver.settings().time_budget = Some(BUDGET);
        for _ in 0..6 {
            assert!(now.step().status == Status::Converged && now.solver.iterations() > 1);
        }
        now.plant.delay.store(DELAY, Ordering::SeqCst);
        let late = now.step();
        assert_eq!((late.status, late.trace.len()), (Status::TimeLimit, 1));
        assert!(late.timings.overrun >= Duration::from_millis(DELAY) - BUDGET, "{:?}", late.timings);
        for _ in 0..6 {
            let next = now.step();
            assert!(next.status == Status::Converged && now.solver.iterations() > 1, "{:?}", next.status);
            assert_eq!(next.timings.overrun, Duration::ZERO);
        }
        assert!(now.x[0].abs() < 0.8);
    }
}

/// Checks a budget that is always too short. Each solve still makes one iteration, which suffices to control the plant.
#[test]
fn a_budget_below_an_iteration_is_overrun() {
    for mut now in Loop::all() {
        now.solver.settings().time_budget = Some(Duration::from_nanos(1));
        for _ in 0..60 {
            let solution = now.step();
            assert_eq!((solution.status, now.solver.iterations()), (Status::TimeLimit, 1));
            assert!(solution.timings.overrun > Duration::ZERO && size(&solution) < SANE);
        }
        assert!(now.x[0].abs() < 0.1, "{:?}", now.x);
    }
}

/// Checks that no iteration is made with a budget of zero. A horizon that is only shifted ends in copies of its last
/// state. A later solve with enough time gives the same result as a solve from a new start.
#[test]
fn horizons_stay_sane_without_iterations() {
    for mut now in Loop::all() {
        now.solver.settings().time_budget = Some(Duration::ZERO);
        for _ in 0..4 * HORIZON {
            let solution = now.solver.resume(&mut now.problem);
            assert_eq!((solution.status, now.solver.iterations()), (Status::TimeLimit, 0));
            assert_eq!(solution.timings.overrun, Duration::ZERO);
            now.solver.shift(&mut now.problem).unwrap();
            assert!(size(now.solver.solution()) < SANE);
        }
        // the first shift computes x_N from the last control, and later shifts copy it
        let xs = &now.solver.solution().xs;
        assert_eq!(xs[..2].repeat(HORIZON), xs[2..]);
        now.solver.settings().time_budget = None;
        let solution = now.solver.resume(&mut now.problem);
        let fresh = Loop::all().next().unwrap();
        assert_eq!(solution.status, Status::Converged);
        assert!((solution.cost - fresh.solver.solution().cost).abs() < 1e-6, "{}", solution.cost);
    }
}

/// Checks several shifts in a row: the first shift computes the last state from the last control, and the other shifts
/// copy it.
#[test]
fn only_a_new_trajectory_is_rolled_out() {
    for mut now in Loop::all() {
        let solved = now.solver.solution().clone();
        let mut next = [0.0; 2];
        now.plant.calc(0, solved.x(HORIZON), solved.u(HORIZON - 1), &mut next);
        now.solver.shift(&mut now.problem).unwrap();
        assert_eq!(now.solver.solution().x(HORIZON), next);
        now.solver.shift(&mut now.problem).unwrap();
        assert_eq!(now.solver.solution().x(HORIZON), next);
        assert_eq!(now.solver.solution().u(HORIZON - 1), solved.u(HORIZON - 1));
    }
}

/// Checks that shifts do not make the horizon diverge after solves that are not finite.
#[test]
fn horizons_stay_sane_when_nothing_is_finite() {
    for mut now in Loop::all() {
        now.plant.broken.store(1, Ordering::SeqCst);
        for _ in 0..2 * HORIZON {
            now.solver.shift(&mut now.problem).unwrap();
            let solution = now.solver.resume(&mut now.problem);
            assert!(solution.status == Status::NotFinite && size(&solution) < SANE, "{:?}", solution.status);
        }
        now.plant.broken.store(0, Ordering::SeqCst);
        let solution = now.solver.resume(&mut now.problem);
        assert!(solution.status == Status::Converged && size(&solution) < SANE, "{:?}", solution.status);
    }
}
