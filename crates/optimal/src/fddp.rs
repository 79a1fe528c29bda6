//! Feasibility-driven differential dynamic programming.
#![allow(non_snake_case)] // K beside k, the names of the literature

use crate::dense::{add_scaled_product, dot, max_abs};
use crate::error::Error;
use crate::lq::{LqNode, Sweep, SweepError};
use crate::problem::{Problem, Shape};
use crate::rollout::{Nominal, Trials};
use crate::settings::Settings;
use crate::solution::{Iteration, Solution, Status, Timings};
use std::time::Instant;

/// FDDP (Mastalli et al., ICRA 2020), with the rules and constants of Crocoddyl 3.2, so that both make the same
/// iterates.
///
/// The warm start may have gaps f, places where the trajectory does not satisfy the dynamics. One iteration is
///
/// ```text
/// derivatives   at the iterate, if it is a new one
/// sweep         k, K, Vx, Vxx; while Quu is not positive definite, with a larger regularisation
/// line search   for α = 1, ½, ¼, …: a rollout that keeps the part 1 − α of each gap; accepted if it lowers the cost
///               by more than `accept` times the expected α (d₁ + ½ α d₂), or, while there are gaps, raises it by less
///               than `accept_ascent` times that
/// ```
///
/// Iterates count as feasible from the first full step on (α = 1 closes all gaps at once). The feedback is
/// u = ū + α k + K (x ⊖ x̄); Crocoddyl has the opposite sign of k and K.
///
/// The first step length is tried alone; if it fails, the others are tried side by side, as many as the actions have
/// [`lanes`](crate::ActionModel::lanes), and the longest good one is taken: the same step that one by one would find.
///
/// The workspace is allocated by [`new`](Self::new); a solve allocates the trace when it begins (not again the next time), and then nothing.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, Fddp, LqNode, Problem, Status};
/// # struct Integrator { nu: usize }
/// # impl ActionModel for Integrator {
/// #     fn nx(&self) -> usize { 1 }
/// #     fn nu(&self) -> usize { self.nu }
/// #     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
/// #         let u: f64 = u.iter().sum();
/// #         next[0] = x[0] + u;
/// #         0.5 * (x[0] * x[0] + u * u)
/// #     }
/// #     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
/// #         (node.A[0], node.Q[0], node.q[0]) = (1.0, 1.0, x[0]);
/// #         node.B.fill(1.0);
/// #         node.S.fill(0.0);
/// #         node.R.fill(1.0);
/// #         node.r.copy_from_slice(u);
/// #     }
/// # }
/// // x⁺ = x + u, ℓ = ½ (x² + u²): linear and quadratic, so the first step is the last.
/// let mut problem = Problem::new(vec![1.0], vec![Box::new(Integrator { nu: 1 })], vec![0; 30], Box::new(Integrator { nu: 0 }))?;
/// let mut solver = Fddp::new(&problem);
/// let solution = solver.solve(&mut problem, &[0.0; 31], &[0.0; 30])?;
///
/// assert_eq!(solution.status, Status::Converged);
/// let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
/// assert!((solution.u(0)[0] + 1.0 / golden).abs() < 1e-8);
/// assert!((solution.cost - golden / 2.0).abs() < 1e-8);
/// # Ok::<(), condyle_optimal::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Fddp {
    /// May be changed between solves.
    pub settings: Settings,
    nodes: Vec<LqNode>,
    sweep: Sweep,
    trials: Trials,
    /// The step lengths, 1, ½, ¼, ….
    steps: Vec<f64>,
    /// The iterate is in here.
    solution: Solution,
    /// φₜ(xₜ, uₜ) of the iterate, N·nx.
    next: Vec<f64>,
    costs: Vec<f64>,
    /// f₀ = x̂₀ ⊖ x₀, fₜ₊₁ = φₜ ⊖ xₜ₊₁ of the iterate, (N + 1)·ndx.
    gaps: Vec<f64>,
    /// Vxx f, (N + 1)·ndx.
    curved_gaps: Vec<f64>,
    /// xₜ ⊖ a trial's xₜ.
    dx: Vec<f64>,
    /// Expected improvement without the part that depends on the trial: dg, dq.
    expected: [f64; 2],
}

/// What carries over from one iteration to the next.
struct Progress {
    regularisation: f64,
    feasible: bool,
    /// Whether the iterate before the last accepted step was feasible.
    was_feasible: bool,
}

/// The outcome of a line search: of the trial it accepted or else of the last that stayed finite.
#[derive(Clone, Copy, Default)]
struct Search {
    step: f64,
    d1: f64,
    d2: f64,
    decrease: f64,
    expected_decrease: f64,
    accepted: bool,
}

impl Fddp {
    /// A solver with the default settings and the workspace for problems with the dimensions of `problem`.
    pub fn new(problem: &Problem) -> Self {
        let (nodes, shape) = (problem.nodes(), problem.shape());
        let horizon = problem.horizon();
        Self {
            settings: Settings::default(),
            sweep: Sweep::new(&nodes),
            nodes,
            trials: Trials::new(problem, problem.lanes()),
            steps: Vec::new(),
            solution: Solution::new(problem),
            next: vec![0.0; horizon * shape.nx],
            costs: vec![0.0; horizon + 1],
            gaps: vec![0.0; (horizon + 1) * shape.ndx],
            curved_gaps: vec![0.0; (horizon + 1) * shape.ndx],
            dx: vec![0.0; shape.ndx],
            expected: [0.0; 2],
        }
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat.
    ///
    /// # Errors
    /// [`Error`] if the dimensions of `problem` are not those given to [`new`](Self::new), the warm start has a wrong
    /// length or is not finite, or a setting makes no sense. How the solve went is no error: see [`Solution::status`].
    pub fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Result<&Solution, Error> {
        self.solve_with(problem, xs, us, |_| ())
    }

    /// As [`solve`](Self::solve), and shows each iteration to `observer` as it ends.
    ///
    /// # Errors
    /// As [`solve`](Self::solve).
    pub fn solve_with(
        &mut self,
        problem: &mut Problem,
        xs: &[f64],
        us: &[f64],
        mut observer: impl FnMut(&Iteration),
    ) -> Result<&Solution, Error> {
        let begin = Instant::now();
        self.settings.check()?;
        check_shape(self.solution.shape(), problem.shape())?;
        Error::check("xs", xs, self.solution.xs.len())?;
        Error::check("us", us, self.solution.us.len())?;

        self.solution.xs.copy_from_slice(xs);
        self.solution.us.copy_from_slice(us);
        self.solution.timings = Timings::default();
        self.solution.trace.clear();
        self.solution.trace.reserve(self.settings.max_iterations);
        self.steps.clear();
        self.steps.extend((0..self.settings.step_lengths).map(|n| 0.5_f64.powi(n as i32))); // α = 2⁻ⁿ
        let start = self.settings.regularisation_start;
        let mut progress = Progress { regularisation: start, feasible: false, was_feasible: false };
        let status = self.iterate(problem, &mut progress, &mut observer);
        self.finish(problem, &progress, status);
        self.solution.timings.total = begin.elapsed();
        Ok(&self.solution)
    }

    /// The result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solution
    }

    /// The iterations, until one of the reasons to stop.
    fn iterate(&mut self, problem: &mut Problem, now: &mut Progress, observer: &mut dyn FnMut(&Iteration)) -> Status {
        self.calc(problem);
        let mut gap = self.update_gaps(problem);
        if !(self.solution.cost.is_finite() && gap.is_finite()) {
            return Status::NotFinite;
        }
        let mut search = Search::default();
        for iteration in 0..self.settings.max_iterations {
            if search.accepted {
                gap = self.update_gaps(problem);
            }
            if search.accepted || iteration == 0 {
                self.calc_diff(problem, now.feasible);
            }
            while let Err(error) = self.sweep(now.regularisation) {
                now.regularisation = self.increased(now.regularisation);
                if now.regularisation == self.settings.regularisation_max {
                    return match error {
                        SweepError::NotPositive { .. } => Status::RegularisationLimit,
                        SweepError::NotFinite { .. } => Status::NotFinite,
                    };
                }
            }
            self.expect(now.feasible);
            search = self.line_search(problem, now.feasible, search);
            if search.accepted {
                now.was_feasible = now.feasible;
                now.feasible |= search.step == 1.0;
            }
            if search.step > self.settings.regularisation_decrease_above {
                now.regularisation = self.decreased(now.regularisation);
            }
            if search.step <= self.settings.regularisation_increase_below {
                now.regularisation = self.increased(now.regularisation);
            }
            let stop = (search.d1 + 0.5 * search.d2).abs(); // the expected decrease for α = 1
            let record = Iteration {
                iteration,
                cost: self.solution.cost,
                gap,
                stop,
                step: search.step,
                regularisation: now.regularisation,
                d1: search.d1,
                d2: search.d2,
                decrease: search.decrease,
                expected_decrease: search.expected_decrease,
                feasible: now.feasible,
                accepted: search.accepted,
            };
            self.solution.trace.push(record);
            observer(&record);
            if now.regularisation == self.settings.regularisation_max {
                return Status::RegularisationLimit;
            }
            if now.was_feasible && stop < self.settings.tolerance {
                return Status::Converged;
            }
        }
        Status::MaxIterations
    }

    /// Dynamics and cost of the warm start.
    fn calc(&mut self, problem: &mut Problem) {
        let clock = Instant::now();
        problem.calc(&self.solution.xs, &self.solution.us, &mut self.next, &mut self.costs);
        self.solution.cost = self.costs.iter().sum();
        self.solution.timings.calc += clock.elapsed();
    }

    /// f₀ = x̂₀ ⊖ x₀,  fₜ₊₁ = φₜ(xₜ, uₜ) ⊖ xₜ₊₁; returns ‖f‖∞.
    fn update_gaps(&mut self, problem: &Problem) -> f64 {
        let (shape, xs) = (self.solution.shape(), &self.solution.xs);
        for t in 0..=shape.horizon() {
            let predicted = if t == 0 { problem.x0() } else { &self.next[shape.x(t - 1)] };
            problem.action(t).difference(&xs[shape.x(t)], predicted, &mut self.gaps[shape.dx(t)]);
        }
        max_abs(&self.gaps)
    }

    /// The LQ problem at the iterate; the gaps are in it until the first full step.
    fn calc_diff(&mut self, problem: &mut Problem, feasible: bool) {
        let clock = Instant::now();
        problem.calc_diff(&self.solution.xs, &self.solution.us, &mut self.nodes);
        for (t, node) in self.nodes.iter_mut().enumerate() {
            match self.gaps.get(self.solution.shape().dx(t + 1)) {
                Some(gap) if !feasible => node.f.as_mut_slice().copy_from_slice(gap),
                _ => node.f.fill(0.0),
            }
        }
        self.solution.timings.calc_diff += clock.elapsed();
    }

    fn sweep(&mut self, regularisation: f64) -> Result<(), SweepError> {
        let clock = Instant::now();
        let result = self.sweep.run(&self.nodes, regularisation);
        self.solution.timings.sweep += clock.elapsed();
        result
    }

    /// dg = −Σ Quᵀk − Σ (Vx + Vxx f)ᵀf,   dq = −Σ kᵀQuu k + Σ fᵀVxx f;  Quu k = −Qu, so the first sums are opposite.
    fn expect(&mut self, feasible: bool) {
        let (mut dg, mut dq) = (0.0, 0.0);
        for (t, knot) in self.sweep.knots().iter().enumerate() {
            let descent = -dot(knot.Qu.as_slice(), knot.k.as_slice());
            dg += descent;
            dq -= descent;
            if !feasible {
                let place = self.solution.shape().dx(t);
                let (f, curved) = (&self.gaps[place.clone()], &mut self.curved_gaps[place]);
                curved.fill(0.0);
                add_scaled_product(curved, 1.0, knot.Vxx.as_slice(), f); // Vxx f
                let curvature = dot(f, curved);
                dg -= dot(knot.Vx.as_slice(), f) + curvature;
                dq += curvature;
            }
        }
        self.expected = [dg, dq];
    }

    /// dv = −Σ fᵀVxx (x ⊖ x_trial): what the trial's distance from the iterate adds while there are gaps.
    fn expect_of_trial(&mut self, problem: &Problem, i: usize) -> f64 {
        let shape = self.solution.shape();
        let mut dv = 0.0;
        for t in 0..=shape.horizon() {
            problem.action(t).difference(self.trials.x(i, t), &self.solution.xs[shape.x(t)], &mut self.dx);
            dv -= dot(&self.curved_gaps[shape.dx(t)], &self.dx);
        }
        dv
    }

    /// Tries α = 1, ½, ¼, … until a step is accepted, which becomes the iterate.
    ///
    /// A trial that leaves all bounds keeps the expectation of the trial before it, that of `last` at first.
    fn line_search(&mut self, problem: &mut Problem, feasible: bool, last: Search) -> Search {
        let mut search = Search { accepted: false, ..last };
        let (mut tried, count) = (0, self.steps.len());
        while tried < count {
            let width = if tried == 0 { 1 } else { self.trials.width().min(count - tried) };
            self.roll_out(problem, feasible, tried, width);
            for i in 0..width {
                search.step = self.steps[tried + i];
                let Some(cost) = self.trials.cost(i) else { continue };
                // d₁ = dg + dv,   d₂ = dq − 2 dv,   expected decrease α (d₁ + ½ α d₂)
                let dv = if feasible { 0.0 } else { self.expect_of_trial(problem, i) };
                search.d1 = self.expected[0] + dv;
                search.d2 = self.expected[1] - 2.0 * dv;
                search.expected_decrease = search.step * (search.d1 + 0.5 * search.step * search.d2);
                search.decrease = self.solution.cost - cost;
                if self.accepts(&search, feasible) {
                    let Solution { xs, us, .. } = &mut self.solution;
                    self.trials.copy_to(i, xs, us, &mut self.next);
                    self.solution.cost = cost;
                    search.accepted = true;
                    return search;
                }
            }
            tried += width;
        }
        search
    }

    /// The trials `from`, `from` + 1, … of the line search, side by side.
    fn roll_out(&mut self, problem: &mut Problem, feasible: bool, from: usize, width: usize) {
        let clock = Instant::now();
        let gaps = (!feasible).then_some(self.gaps.as_slice());
        let Solution { xs, us, .. } = &self.solution;
        let nominal = Nominal { xs, us, gaps, knots: self.sweep.knots() };
        self.trials.run(problem, &nominal, &self.steps[from..from + width]);
        self.solution.timings.rollout += clock.elapsed();
    }

    /// Whether the step lowers the cost enough, or, while there are gaps, raises it little enough.
    fn accepts(&self, search: &Search, feasible: bool) -> bool {
        let Search { d1, decrease, expected_decrease, .. } = *search;
        if expected_decrease >= 0.0 {
            d1.abs() < self.settings.flat || decrease > self.settings.accept * expected_decrease
        } else {
            !feasible && decrease > self.settings.accept_ascent * expected_decrease
        }
    }

    fn increased(&self, regularisation: f64) -> f64 {
        (regularisation * self.settings.regularisation_factor).min(self.settings.regularisation_max)
    }

    fn decreased(&self, regularisation: f64) -> f64 {
        (regularisation / self.settings.regularisation_factor).max(self.settings.regularisation_min)
    }

    /// Fills what the iterations leave open in the solution.
    fn finish(&mut self, problem: &Problem, now: &Progress, status: Status) {
        let infinite_if_nan = |x: f64| if x.is_nan() { f64::INFINITY } else { x };
        self.solution.gap = infinite_if_nan(self.update_gaps(problem));
        let solution = &mut self.solution;
        solution.cost = infinite_if_nan(solution.cost);
        solution.feasible = now.feasible;
        solution.regularisation = now.regularisation;
        solution.status = status;
        for ((K, k), knot) in solution.K.iter_mut().zip(&mut solution.k).zip(self.sweep.knots()) {
            K.copy_from(&knot.K);
            k.copy_from(&knot.k);
        }
    }
}

/// `Ok` if a problem has the dimensions for which a solver was made.
fn check_shape(expected: &Shape, found: &Shape) -> Result<(), Error> {
    if expected.horizon() != found.horizon() {
        return Err(Error::Length { name: "stages", expected: expected.horizon(), found: found.horizon() });
    }
    for t in 0..=expected.horizon() {
        for (name, expected, found) in
            [("nx", expected.nx, found.nx), ("ndx", expected.ndx, found.ndx), ("nu", expected.nu(t), found.nu(t))]
        {
            if expected != found {
                return Err(Error::Dimension { node: t, name, expected, found });
            }
        }
    }
    Ok(())
}
