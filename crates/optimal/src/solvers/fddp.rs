//! Differential dynamic programming (DDP) and its feasibility-driven variant (FDDP).

use super::settings::Settings;
#[cfg(doc)]
use super::solution::Status;
use super::solution::{Iteration, Solution};
use super::solver_loop::{Pass, SolverLoop};
use super::watch::{Observer, Watch};
use crate::error::Error;
use crate::problem::Problem;

/// Solver by FDDP (Mastalli et al., ICRA 2020) or DDP (see [`DdpMethod`](crate::DdpMethod)). It has the rules and
/// constants of Crocoddyl 3.2 and produces the same iterates. Bounds on controls
/// ([`bounds`](crate::ActionModel::bounds)) are handled as in Crocoddyl's box solvers (Tassa, Mansard, Todorov, ICRA
/// 2014; Mastalli et al., RA-L 2022). While gaps exist, the bounds only clamp the controls of trials. Afterwards, the
/// sweep minimises each knot's quadratic model within the bounds.
///
/// The warm start may have gaps f, where the trajectory does not satisfy the dynamics. One iteration consists of:
///
/// ```text
/// derivatives   at the iterate, if it is new
/// sweep         k, K, Vx, Vxx; repeated with a larger regularisation while Quu is not positive definite
/// line search   for α = 1, ½, ¼, …: a rollout that keeps 1 − α of each gap. The rollout is accepted if it lowers
///               the cost by more than `accept` times the expected decrease α (d₁ + ½ α d₂). While gaps exist, it is
///               also accepted if it raises the cost by less than `accept_ascent` times the expected rise
/// ```
///
/// An iterate counts as feasible after the first full step, because a step of length α = 1 closes all gaps at once. The
/// feedback is u = ū + α k + K (x ⊖ x̄); in Crocoddyl, k and K have the opposite sign.
///
/// The line search first tries the step length 1 alone. If that step is rejected, the next four lengths are evaluated
/// together in one group, and then the remaining lengths. The [`lanes`](crate::GroupModel::lanes) of the actions limit
/// the size of a group. The longest acceptable step is taken, as in a search that tries one length after the other.
///
/// [`new`](Self::new) allocates the workspace. At its beginning, a solve allocates the trace and the workspaces for
/// [`segments`](Settings::segments). The first solve that needs copies of actions for [`threads`](Settings::threads)
/// allocates these copies. Nothing else is allocated, except by rayon itself.
///
/// # Examples
/// ```
/// use condyle_optimal::{ActionModel, Fddp, LqKnot, Problem, Status};
/// # struct Integrator { nu: usize }
/// # impl ActionModel for Integrator {
/// #     fn nx(&self) -> usize { 1 }
/// #     fn nu(&self) -> usize { self.nu }
/// #     fn calc(&mut self, _: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
/// #         let u: f64 = u.iter().sum();
/// #         next[0] = x[0] + u;
/// #         0.5 * (x[0] * x[0] + u * u)
/// #     }
/// #     fn calc_diff(&mut self, _: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
/// #         (knot.A[0], knot.Q[0], knot.q[0]) = (1.0, 1.0, x[0]);
/// #         knot.B.fill(1.0);
/// #         knot.S.fill(0.0);
/// #         knot.R.fill(1.0);
/// #         knot.r.copy_from_slice(u);
/// #     }
/// # }
/// // x⁺ = x + u, ℓ = ½ (x² + u²): linear and quadratic, so the first step is the last.
/// let (knot, end) = (Integrator { nu: 1 }, Integrator { nu: 0 });
/// let mut problem = Problem::new(vec![1.0], vec![Box::new(knot)], vec![0; 30], Box::new(end))?;
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
    /// Settings; may be changed between solves.
    pub settings: Settings,
    solver: SolverLoop,
}

impl Fddp {
    /// Creates a solver with the default settings and the workspace for problems with the dimensions of `problem`.
    pub fn new(problem: &Problem) -> Self {
        Self { settings: Settings::default(), solver: SolverLoop::new(problem) }
    }

    /// Returns the number of bytes that the sweep of the last iteration read from the knots: the mean of all knots
    /// before the terminal one. Benchmarks print this number.
    #[doc(hidden)]
    pub fn bytes_per_knot(&self) -> usize {
        self.solver.bytes_per_knot()
    }

    /// Solves `problem` from the warm start `xs` ((N + 1)·nx, gaps allowed) and `us`, both flat.
    ///
    /// # Errors
    /// [`Error`] if the dimensions of `problem` differ from the dimensions of the problem given to [`new`](Self::new),
    /// or if a setting is invalid. Also if the warm start has a wrong length, is not finite or contains an invalid
    /// state. A solve that does not converge is not an error: see [`Solution::status`].
    pub fn solve(&mut self, problem: &mut Problem, xs: &[f64], us: &[f64]) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut |_: &Iteration| {})
    }

    /// Solves as [`solve`](Self::solve) does, and passes each iteration to `observer` when it ends. The observer may
    /// end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn solve_with(
        &mut self,
        problem: &mut Problem,
        xs: &[f64],
        us: &[f64],
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        self.run(problem, Some([xs, us]), &mut observer)
    }

    /// Solves `problem` from the trajectory of the last solve. The problem may have a new initial state or new
    /// references, or may be [shifted](Self::shift) to the next horizon.
    ///
    /// A trajectory is lost if it is not finite, or if its cost exceeds the cost c of the last solution by more than 10
    /// (1 + |c|). A lost trajectory is replaced by x̂₀ at all knots and the controls that hold x̂₀ still, if the
    /// replacement costs less; [`Solution::fallback`] says so. If the last solve ran out of time or iterations after a
    /// rejected step, the regularisation starts at its last value, otherwise at
    /// [`regularisation_start`](Settings::regularisation_start).
    ///
    /// After a last step of length α < 1, the solution begins at x̄₀ = x̂₀ ⊕ (α − 1) f₀, not at x̂₀: the step keeps the
    /// fraction 1 − α of the gap f₀ before it.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume(&mut self, problem: &mut Problem) -> Result<&Solution, Error> {
        self.run(problem, None, &mut |_: &Iteration| {})
    }

    /// Solves as [`resume`](Self::resume) does, and passes each iteration to `observer` when it ends. The observer may
    /// end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume_with(&mut self, problem: &mut Problem, mut observer: impl Observer) -> Result<&Solution, Error> {
        self.run(problem, None, &mut observer)
    }

    /// Iterates as [`resume`](Self::resume) does until a step of length α = 1 is accepted, and makes at most `most`
    /// iterations (at least one). `most` replaces [`max_iterations`](Settings::max_iterations). The iterations are the
    /// same as in [`resume`](Self::resume).
    ///
    /// This is the mode for model predictive control. After the state has moved, the warm start has a gap at x₀. A
    /// shorter step keeps the fraction 1 − α of each gap, so x̄₀ ≠ x̂₀; if every period ends so, gaps accumulate. A step
    /// of length 1 closes all gaps, and the status is then [`Status::FullStep`], or [`Status::Converged`].
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume_to_full_step(&mut self, problem: &mut Problem, most: usize) -> Result<&Solution, Error> {
        self.resume_to_full_step_with(problem, most, |_: &Iteration| {})
    }

    /// Iterates as [`resume_to_full_step`](Self::resume_to_full_step) does, and passes each iteration to `observer`
    /// when it ends. The observer may end the solve.
    ///
    /// # Errors
    /// The same errors as [`solve`](Self::solve).
    pub fn resume_to_full_step_with(
        &mut self,
        problem: &mut Problem,
        most: usize,
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        self.run_pass(problem, None, Pass { to_full_step: Some(most.max(1)), ..Pass::default() }, &mut observer)
    }

    /// Makes the first half of an iteration, before the state arrives: derivatives and sweep along the trajectory of
    /// the last solve. [`feedback`](Self::feedback) makes the second half. This is the real-time iteration scheme: call
    /// [`shift`](Self::shift), set references, and `prepare`; then wait for the state.
    ///
    /// The prediction is the first state x̄₀ of the trajectory; it becomes the problem's initial state. Until
    /// `feedback`, the problem must not change. A direction that is not found is reported by `feedback`.
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn prepare(&mut self, problem: &mut Problem) -> Result<(), Error> {
        self.prepare_with(problem, |_: &Iteration| {})
    }

    /// Prepares as [`prepare`](Self::prepare) does. The observer may end the preparation; it receives no iterations.
    ///
    /// # Errors
    /// The same errors as [`resume`](Self::resume).
    pub fn prepare_with(&mut self, problem: &mut Problem, mut observer: impl Observer) -> Result<(), Error> {
        self.solver.prepare(problem, &self.settings, &mut Watch::new(&mut observer))
    }

    /// Sets the initial state to the measured state `x0`, and completes the [prepared](Self::prepare) iteration with
    /// its gap x̂₀ ⊖ x̄₀ and rollouts. If the step is shorter than 1, further whole iterations follow, until a step of
    /// length 1 or `most` iterations.
    ///
    /// The result is, to the bit, the result of [`Problem::set_x0`] and
    /// [`resume_to_full_step`](Self::resume_to_full_step), wherever `x0` is: the sweep does not contain the initial
    /// state. The only exception is a lost trajectory (see [`resume`](Self::resume)), which is replaced by the
    /// prediction held still. The time budget applies to this call alone; [`timings`](Solution::timings) contain both.
    ///
    /// # Errors
    /// [`Error::NothingPrepared`] if `prepare` was not called since the last solve, shift or feedback. The errors of
    /// [`Problem::set_x0`], for example if a number is not finite; the preparation is then kept.
    pub fn feedback(&mut self, problem: &mut Problem, x0: &[f64], most: usize) -> Result<&Solution, Error> {
        self.feedback_with(problem, x0, most, |_: &Iteration| {})
    }

    /// Makes the second half as [`feedback`](Self::feedback) does, and passes each iteration to `observer`.
    ///
    /// # Errors
    /// The same errors as [`feedback`](Self::feedback).
    pub fn feedback_with(
        &mut self,
        problem: &mut Problem,
        x0: &[f64],
        most: usize,
        mut observer: impl Observer,
    ) -> Result<&Solution, Error> {
        self.solver.feedback(problem, &self.settings, x0, most, &mut Watch::new(&mut observer))?;
        Ok(self.solution())
    }

    /// Forgets the last trajectory and starts anew from the state `x0`, which becomes the initial state of the problem.
    /// The new trajectory has `x0` at all knots, the controls that hold it still, and no gains. This is the recovery
    /// after [`Status::NotFinite`]; [`resume`](Self::resume) or [`prepare`](Self::prepare) follow. Allocates.
    ///
    /// # Errors
    /// The errors of [`Problem::set_x0`]. [`Error::Dimension`] if the problem has other dimensions than the solver.
    pub fn reset(&mut self, problem: &mut Problem, x0: &[f64]) -> Result<(), Error> {
        self.solver.reset(problem, &self.settings, x0)
    }

    /// Turns the solution into a warm start for a problem that has since been [shifted](Problem::shift) by one knot.
    /// States, controls and gains move one knot towards the beginning. Allocates only if the number of controls differs
    /// along the horizon.
    ///
    /// The last control is repeated, if the new last knot has the contacts of the knot before it. If a robot's
    /// contacts, actuation or kind of dynamics change there, the last control holds the state x_{N−1} still, as
    /// [`quasi_static`](crate::ActionModel::quasi_static) does. A repeated control would belong to other contacts: the
    /// start of a trot then cost 1.74 instead of 0.13, where the optimum is 0.085. If the number of controls changes
    /// and the knot has no such control, the last control is zero. The last gains are zero.
    ///
    /// The last state follows from the last control, x_N = φ(x_{N−1}, u_{N−1}), if the trajectory comes from a warm
    /// start or from a solve that took a step. If the trajectory is shifted again without such a solve, the last state
    /// is repeated, x_N = x_{N−1}, and the next solve closes the gap. The reason is that no feedback stabilises a
    /// rollout with repeated controls. The end of the horizon would diverge exponentially while solves run out of time.
    ///
    /// # Errors
    /// [`Error`] if the numbers of knots, states and controls differ from the numbers of the last problem, shifted
    /// once.
    pub fn shift(&mut self, problem: &mut Problem) -> Result<(), Error> {
        self.solver.shift(problem, &self.settings)
    }

    /// Moves the horizon of `problem` by `elapsed` seconds, gives its knots new models and durations (s), and turns the
    /// solution into a warm start for it. A controller calls this method in each period, with knots from a
    /// [`Schedule`](crate::Schedule). So the period is independent of the spacing of the knots, and contacts may begin
    /// and end at any time. With `elapsed` equal to the duration of knot 0 and the knots of a [shifted](Problem::shift)
    /// problem, the result is the one of [`shift`](Self::shift).
    ///
    /// Each new knot takes its numbers from the old plan at the same time. States are interpolated, as in
    /// [`Solution::at`]; a new knot has the controls and gains of the old knot at
    /// its middle. If this knot has
    /// other contacts, the controls hold the state still, and the gains are zero. After the end of the old plan, the
    /// last control is repeated or holds the state still, and states follow as in [`shift`](Self::shift).
    ///
    /// Returns the number of knots that have passed. The costs and limits that belong to a single knot move by this
    /// number. A knot whose
    /// model changes loses them. Allocates only at the first call, or if the number of a knot's controls changes.
    ///
    /// ```
    /// # use condyle_dynamics::robots;
    /// # use condyle_optimal::robot::{Activation, Cost, FreeDynamics, Residual};
    /// use condyle_optimal::{Fddp, Problem, Schedule};
    /// # let arm = std::sync::Arc::new(robots::arm7());
    /// # let effort = Residual::Control { reference: vec![0.0; 7] };
    /// # let costs = vec![Cost::new("effort", 1.0, effort, Activation::Quadratic)];
    /// # let knot = Box::new(FreeDynamics::running(arm.clone(), 0.02, costs)?);
    /// # let (x0, end) = (vec![0.1; 14], Box::new(FreeDynamics::terminal(arm, vec![])?));
    /// let mut problem = Problem::new(x0.clone(), vec![knot], vec![0; 10], end)?;
    /// let mut solver = Fddp::new(&problem);
    /// solver.solve(&mut problem, &x0.repeat(11), &vec![0.0; 70])?;
    /// let (schedule, mut begin) = (Schedule::new(0.02, 0)?, 0.0);
    /// let (mut models, mut durations) = ([0; 10], [0.0; 10]);
    /// for now in [0.005, 0.01, 0.015, 0.02, 0.025] {
    ///     schedule.write_knots(now, &mut models, &mut durations);
    ///     solver.retime(&mut problem, now - begin, &models, &durations)?;
    ///     begin = now;
    ///     // here: set_x0 with the measured state, and new references
    ///     solver.resume_to_full_step(&mut problem, 3)?;
    /// }
    /// assert!((problem.duration(0).unwrap() - 0.015).abs() < 1e-12);
    /// # Ok::<(), condyle_optimal::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::NothingToResume`] before the first solve; [`Error::Elapsed`] if `elapsed` is negative or not finite;
    /// the errors of [`Problem::set_knots`]; [`Error::NoDuration`] for a user-defined action. Problem and solution are
    /// then unchanged.
    pub fn retime(
        &mut self,
        problem: &mut Problem,
        elapsed: f64,
        knot_models: &[usize],
        durations: &[f64],
    ) -> Result<usize, Error> {
        self.solver.retime(problem, &self.settings, elapsed, knot_models, durations)
    }

    /// Returns the result of the last solve.
    pub fn solution(&self) -> &Solution {
        &self.solver.iterate.solution
    }

    /// Sets the gains of the solution to zero, as in a new solver.
    pub(super) fn forget_gains(&mut self) {
        self.solver.forget_gains();
    }

    fn run(
        &mut self,
        problem: &mut Problem,
        warm_start: Option<[&[f64]; 2]>,
        observer: &mut dyn Observer,
    ) -> Result<&Solution, Error> {
        self.run_pass(problem, warm_start, Pass::default(), observer)
    }

    fn run_pass(
        &mut self,
        problem: &mut Problem,
        warm_start: Option<[&[f64]; 2]>,
        pass: Pass,
        observer: &mut dyn Observer,
    ) -> Result<&Solution, Error> {
        let (Self { settings, solver }, mut watch) = (self, Watch::new(observer));
        solver.begin(problem, settings, warm_start)?;
        solver.start_clock(settings, &watch);
        let pass = Pass { resumes: warm_start.is_none(), ..pass };
        solver.pass(problem, settings, pass, &mut watch);
        Ok(solver.end(settings, &watch))
    }
}
