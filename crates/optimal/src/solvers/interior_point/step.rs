//! Steps of the trajectory: derivatives, sweep, forward pass and trials.

use super::InteriorPoint;
use super::filter::Measure;
use crate::lq::{CurvatureFn, DIVERGED, Forward, Hessian, LqKnot, SweepError, SweepOutput};
use crate::problem::{ActionModel, Evaluation, Problem};
use crate::solvers::iterate::{Iterate, Sum};
use crate::solvers::settings::Settings;
use crate::solvers::solution::{Solution, Status};
use crate::solvers::solver_loop::SolverLoop;
use crate::solvers::watch::Phase;
use crate::time::Instant;
use condyle_linalg::{View, add_scaled_product, dot};

/// Step of the trajectory, with the gradients of the costs.
#[derive(Debug, Clone)]
pub(super) struct Step {
    /// Gradients of the costs alone, q and r of all knots, flat.
    pub(super) q: Vec<f64>,
    pub(super) r: Vec<f64>,
    /// Changes δx and δu, flat.
    pub(super) dx: Vec<f64>,
    du: Vec<f64>,
    /// Combined changes of several steps from one linearisation.
    sum: [Vec<f64>; 2],
    forward: Forward,
}

/// Trajectory of a trial.
#[derive(Debug, Clone)]
pub(super) struct Trial {
    xs: Vec<f64>,
    us: Vec<f64>,
    next: Vec<f64>,
    costs: Vec<f64>,
    gaps: Vec<f64>,
    motions: Vec<f64>,
    constraints: Vec<f64>,
}

impl Step {
    /// Allocates the step for problems with the dimensions of `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        let shape = problem.shape();
        let (states, controls) = ((shape.horizon() + 1) * shape.ndx, shape.offsets[shape.horizon()]);
        let [q, dx, sum_x] = [(); 3].map(|()| vec![0.0; states]);
        let [r, du, sum_u] = [(); 3].map(|()| vec![0.0; controls]);
        Self { q, r, dx, du, sum: [sum_x, sum_u], forward: Forward::default() }
    }

    /// Adapts the step to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        let controls = problem.shape().offsets[problem.horizon()];
        for numbers in [&mut self.r, &mut self.du, &mut self.sum[1]] {
            numbers.resize(controls, 0.0);
        }
    }

    /// Returns the derivative of the cost along the step.
    pub(super) fn slope(&self) -> f64 {
        dot(&self.q, &self.dx) + dot(&self.r, &self.du)
    }

    /// Begins a combination of steps.
    pub(super) fn start_sum(&mut self) {
        self.sum.iter_mut().for_each(|sum| sum.fill(0.0));
    }

    /// Moves the combined step by the fraction α towards the last step.
    pub(super) fn add_to_sum(&mut self, alpha: f64) {
        for (sum, step) in self.sum.iter_mut().zip([&self.dx, &self.du]) {
            sum.iter_mut().zip(step).for_each(|(sum, step)| *sum += alpha * (step - *sum));
        }
    }
}

impl Trial {
    /// Allocates a trial of `problem`.
    pub(super) fn new(problem: &Problem) -> Self {
        let (shape, horizon) = (problem.shape(), problem.horizon());
        Self {
            xs: vec![0.0; (horizon + 1) * shape.nx],
            us: vec![0.0; shape.offsets[horizon]],
            next: vec![0.0; horizon * shape.nx],
            costs: vec![0.0; horizon + 1],
            gaps: vec![0.0; (horizon + 1) * shape.ndx],
            motions: Vec::new(),
            constraints: Vec::new(),
        }
    }

    /// Adapts the trial to a problem whose numbers of controls have changed.
    pub(super) fn reshape(&mut self, problem: &Problem) {
        self.us.resize(problem.shape().offsets[problem.horizon()], 0.0);
    }

    /// Sets the number of constraints per knot, and whether motions are stored.
    pub(super) fn start(&mut self, problem: &Problem, constraints: usize, with_motions: bool) {
        let motions = if with_motions { problem.horizon() * problem.motion_size() } else { 0 };
        self.motions.resize(motions, 0.0);
        self.constraints.resize((problem.horizon() + 1) * constraints, 0.0);
    }

    /// Returns the gaps of the trial.
    pub(super) fn gaps(&self) -> &[f64] {
        &self.gaps
    }

    /// Sets the trajectory.
    pub(super) fn set(&mut self, xs: &[f64], us: &[f64]) {
        self.xs.copy_from_slice(xs);
        self.us.copy_from_slice(us);
    }
}

impl InteriorPoint {
    /// Evaluates the trial: next states, costs, gaps and constraints. Returns its cost.
    pub(super) fn evaluate_trial(&mut self, problem: &mut Problem) -> f64 {
        let Trial { xs, us, next, costs, gaps, motions, constraints } = &mut self.trial;
        problem.calc_with(xs, us, next, costs, [motions, constraints]);
        let mut sum = Sum::default();
        costs.iter().for_each(|cost| sum.add(*cost));
        Iterate::write_gaps(problem, xs, next, gaps);
        self.slacks.take_trial(constraints, us, problem.shape());
        sum.value()
    }

    /// Rolls out the trajectory from x̂₀ with its gains, x⁺ = φ(x, ū + K (x ⊖ x̄)), into the trial. x̄₀ is the planned
    /// state. Returns the cost, which is infinite or NaN if the motion diverges.
    pub(super) fn roll_out(&mut self, problem: &mut Problem) -> f64 {
        let Self { solver: SolverLoop { iterate: Iterate { solution, .. }, .. }, trial, planned, .. } = self;
        let shape = problem.shape().clone();
        let Trial { xs, us, next, gaps, .. } = trial;
        xs[..shape.nx].copy_from_slice(problem.x0());
        for t in 0..shape.horizon() {
            let (x, u, dx) = (&xs[shape.x(t)], &mut us[shape.u(t)], &mut gaps[..shape.ndx]);
            let nominal = if t == 0 { &planned[..] } else { &solution.xs[shape.x(t)] };
            problem.action(t).difference(nominal, x, dx);
            u.copy_from_slice(&solution.us[shape.u(t)]);
            add_scaled_product(u, 1.0, View::new(solution.K[t].as_slice(), shape.nu(t)), dx);
            let next = &mut next[shape.x(t)];
            problem.action_mut(t).calc(t, x, u, next);
            if !next.iter().all(|x| x.abs() < DIVERGED) {
                return f64::INFINITY;
            }
            xs[shape.x(t + 1)].copy_from_slice(next);
        }
        self.evaluate_trial(problem)
    }

    /// Makes the trial the iterate.
    pub(super) fn accept_trial(&mut self, cost: f64) {
        let (trial, iterate) = (&mut self.trial, &mut self.solver.iterate);
        std::mem::swap(&mut trial.xs, &mut iterate.solution.xs);
        std::mem::swap(&mut trial.us, &mut iterate.solution.us);
        std::mem::swap(&mut trial.next, &mut iterate.next);
        std::mem::swap(&mut trial.gaps, &mut iterate.gaps);
        iterate.motions.resize(trial.motions.len(), 0.0);
        std::mem::swap(&mut trial.motions, &mut iterate.motions);
        iterate.solution.cost = cost;
        self.slacks.accept_trial();
    }

    /// Computes the derivatives at the iterate, as equations of inverse dynamics where `equations` is set and a knot
    /// supports them.
    pub(super) fn differentiate(&mut self, problem: &mut Problem, settings: &Settings, equations: bool) {
        let begin = Instant::now();
        let Self { solver, slacks, step: Step { q, r, .. }, .. } = self;
        let SolverLoop { iterate: Iterate { solution, gaps, motions, .. }, knots, sweep, clock, .. } = solver;
        let Solution { xs, us, .. } = &*solution;
        let what = match equations && !motions.is_empty() {
            true => Evaluation::Equations { motions, rows: true },
            false => Evaluation::Rows,
        };
        if settings.threads == 1 {
            problem.calc_diff_as(what, xs, us, knots);
        } else {
            let (_, feedback, gains) = sweep.follow(settings.threads);
            let nothing = |_: &dyn ActionModel, _: usize, _: &mut [LqKnot], _: &mut [_]| {};
            problem.calc_diff_on(what, [xs, us], knots, feedback, gains, nothing);
        }
        let shape = problem.shape();
        slacks.complete_rows(knots, shape);
        for (t, knot) in knots.iter_mut().enumerate() {
            if t < shape.horizon() {
                knot.f.as_mut_slice().copy_from_slice(&gaps[shape.dx(t + 1)]);
                knot.lower.fill(f64::NEG_INFINITY);
                knot.upper.fill(f64::INFINITY);
            }
            q[shape.dx(t)].copy_from_slice(knot.q.as_slice());
            r[shape.u(t)].copy_from_slice(knot.r.as_slice());
        }
        solution.timings.calc_diff += clock.lasted(Phase::CalcDiff, begin.elapsed());
    }

    /// Sweeps with the terms of the rows and, if `curved`, with the curvature λᵀ∂²φ of the dynamics.
    ///
    /// # Errors
    /// The errors of a [`Sweep`](crate::Sweep).
    pub(super) fn sweep(
        &mut self,
        problem: &mut Problem,
        curved: bool,
        regularisation: f64,
        output: SweepOutput,
    ) -> Result<(), SweepError> {
        let begin = Instant::now();
        let Self { solver, slacks, adjoint, .. } = self;
        let SolverLoop { iterate: Iterate { solution, .. }, knots, sweep, clock, .. } = solver;
        let (Solution { xs, us, .. }, shape) = (&*solution, solution.shape());
        let mut curvature = |t: usize, _: &[f64], hessian: &mut Hessian| {
            let (x, u) = (&xs[shape.x(t)], &us[shape.u(t)]);
            problem.action_mut(t).dynamics_hessian(t, x, u, &adjoint.lambda[shape.dx(t + 1)], hessian)
        };
        let curvature = curved.then_some(&mut curvature as &mut CurvatureFn<'_>);
        let result = sweep.run_with_rows(knots, regularisation, slacks.row_terms(), output, curvature);
        solution.timings.sweep += clock.lasted(Phase::Sweep, begin.elapsed());
        result
    }

    /// Computes the steps of states, controls, slack variables and multipliers from the factors of the sweep.
    pub(super) fn find_steps(&mut self, problem: &Problem) {
        let Self { solver: SolverLoop { iterate, knots, sweep, .. }, slacks, step, mu, .. } = self;
        let (shape, n) = (problem.shape(), problem.ndx());
        let Step { dx, du, forward, .. } = step;
        dx[..n].copy_from_slice(&iterate.gaps[..n]);
        for (t, knot) in knots.iter().enumerate() {
            let (done, ahead) = dx.split_at_mut((t + 1) * n);
            let (x, u) = (&done[t * n..], &mut du[shape.u(t)]);
            let w = match ahead.get_mut(..n) {
                Some(next) => forward.step(knot, &sweep.feedback()[t].factors, x, u, next),
                None => &[],
            };
            slacks.find_changes(t, knot, x, w, u);
        }
        slacks.find_steps(*mu);
    }

    /// Evaluates the trial of step length α. Returns its cost, and θ and φ.
    pub(super) fn try_step(&mut self, problem: &mut Problem, alpha: f64) -> (f64, Measure) {
        let begin = Instant::now();
        let Self { solver: SolverLoop { iterate, .. }, trial, step, .. } = self;
        move_by(problem, &iterate.solution, alpha, [&step.dx, &step.du], trial);
        let cost = self.evaluate_trial(problem);
        self.solver.iterate.solution.timings.rollout += self.solver.clock.ran(Phase::Rollout, begin);
        let [infeasibility, logarithms, of_soft] = self.slacks.trial_merit(alpha);
        let theta = infeasibility + sum_abs(&self.trial.gaps);
        (cost, Measure { theta, cost: cost + of_soft, logarithms })
    }

    /// Moves the trajectory by the combined step, without evaluating it. Its first state becomes x̂₀.
    ///
    /// # Errors
    /// [`Status::NotFinite`] if a number of the new trajectory is not finite; then the trajectory does not move.
    pub(super) fn apply_sum(&mut self, problem: &Problem) -> Result<(), Status> {
        let Self { solver: SolverLoop { iterate, renewed, .. }, trial, step, .. } = self;
        let [dx, du] = &step.sum;
        move_by(problem, &iterate.solution, 1.0, [dx, du], trial);
        trial.xs[..problem.nx()].copy_from_slice(problem.x0());
        if !trial.xs.iter().chain(&trial.us).all(|x| x.is_finite()) {
            return Err(Status::NotFinite);
        }
        std::mem::swap(&mut trial.xs, &mut iterate.solution.xs);
        std::mem::swap(&mut trial.us, &mut iterate.solution.us);
        *renewed = true;
        Ok(())
    }
}

/// Writes x ⊕ α δx and u + α δu to the trial.
fn move_by(problem: &Problem, solution: &Solution, alpha: f64, [dx, du]: [&[f64]; 2], trial: &mut Trial) {
    let (shape, Trial { xs, us, gaps, .. }) = (problem.shape(), trial);
    for t in 0..=shape.horizon() {
        let scaled = &mut gaps[..shape.ndx];
        scaled.iter_mut().zip(&dx[shape.dx(t)]).for_each(|(to, dx)| *to = alpha * dx);
        problem.action(t).integrate(&solution.xs[shape.x(t)], scaled, &mut xs[shape.x(t)]);
    }
    for ((to, u), du) in us.iter_mut().zip(&solution.us).zip(du) {
        *to = u + alpha * du;
    }
}

/// Returns the sum of absolute values.
pub(super) fn sum_abs(x: &[f64]) -> f64 {
    x.iter().map(|x| x.abs()).sum()
}
