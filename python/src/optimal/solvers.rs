//! Solvers and their solutions.

use super::evaluation::solution as give;
use super::outcomes::give_outcome;
use super::policy::Policy;
use super::problem::{Problem, lock};
use super::recorder::{address, kept};
use super::run::{Observer, Start, observe, run};
use super::settings::{
    dict, read_only, set_constraints, set_fddp, set_interior_point, show_constraints, show_fddp, show_interior_point,
};
use super::solver_class::{plain_solver, set_multipliers, solver};
use crate::arrays::{Give, vector};
use crate::exceptions::{problem_error, wrong_word};
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyMappingProxy};
use rust::record::Call;
use std::sync::Mutex;

solver! {
/// The solver FDDP or DDP: differential dynamic programming, feasibility-driven or plain, with the equations and
/// constants of Crocoddyl.
///
/// If controls are bounded, the solver uses the equations of Crocoddyl's box solvers.
///
/// problem: the problem to solve. All memory is allocated once, for the size of this problem.
/// settings: any of the following settings, by name. `method`: "fddp" (default), whose trial steps keep a fraction of
///     the gaps, or "ddp", whose trial steps are rollouts without gaps. `second_order`: whether to use the curvature of
///     the dynamics if the models provide it (full DDP). `inverse_dynamics_form`: whether the sweep uses the equations
///     of inverse dynamics at knots of robots, if possible (default: yes). The steps are the same and take less time.
///     `project_warm_start`: whether `solve` and `resume` move controls of a warm start into their bounds (default:
///     yes). Crocoddyl does not move them; for the iterates of Crocoddyl, use False. `time_budget` (s): a solve that
///     has used up the budget returns its current result, with the status "time_limit". The first iteration always
///     runs, unless the budget is 0. In later iterations, each phase (derivatives, backward sweep, rollout) runs only
///     if the median of its last five durations fits into the budget. If a solve takes longer than the budget,
///     `timings.overrun` is the excess. `segments`: the number of segments of the horizon on which a sweep works at the
///     same time, at most 1024, default 1. The sweep uses as many threads as are available. The number of segments
///     changes the results by rounding errors; the number of threads does not change them. `threads`: the number of
///     threads that share an iteration on a robot (derivatives and gains, in parallel with the sweep), at most 1024,
///     default 1. The results are bit-identical for any number of these threads. `max_iterations`, `tolerance`,
///     `tolerance_bounded` (if controls are bounded), `step_lengths`, `accept`, `accept_ascent`, `flat`,
///     `regularisation_start`, `regularisation_min`, `regularisation_max`, `regularisation_factor`,
///     `regularisation_decrease_above`, `regularisation_increase_below`: the thresholds of the method.
Fddp, set_fddp, show_fddp {
    #[new]
    #[pyo3(signature = (problem, **settings))]
    fn new(problem: Bound<'_, Problem>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Self::with(problem, None, settings)
    }

    /// Solves the problem from the last solution, with a new initial state or a shifted horizon. Returns a
    /// `Solution`.
    ///
    /// With a `time_budget`, one or two delayed solves do not make later solves shorter; each solve makes at least one
    /// iteration. If the last solve ran out of time or iterations after a rejected step, the regularisation starts at
    /// its last value, otherwise at `regularisation_start`.
    ///
    /// stop: "full_step" ends the solve when a step of length 1 is accepted, with the status "full_step". This is the
    ///     mode for model predictive control. After the state has moved, the warm start has a gap at x₀. Shorter steps
    ///     of length α keep the fraction 1 − α of each gap, and gaps may grow from period to period. A step of length 1
    ///     closes all gaps. None (default) iterates until the solve has converged.
    /// most: the maximum number of iterations, at least 1; None (default) takes `max_iterations` of the settings. Only
    ///     with `stop`.
    /// callback, verbose, progress: as for `solve`.
    ///
    /// Raises `ProblemError` as `solve` does, and if there is no solution yet.
    #[pyo3(signature = (callback=None, verbose=false, progress=false, *, stop=None, most=None))]
    fn resume<'py>(
        &self,
        py: Python<'py>,
        callback: Option<Bound<'py, PyAny>>,
        verbose: bool,
        progress: bool,
        stop: Option<&str>,
        most: Option<usize>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let to_full_step = match stop {
            None => false,
            Some("full_step") => true,
            Some(other) => return Err(wrong_word("stop", "'full_step' or None", other)),
        };
        match most {
            Some(_) if !to_full_step => return Err(PyValueError::new_err("most: expected only with stop='full_step'")),
            Some(0) => return Err(PyValueError::new_err("most: expected at least 1, found 0")),
            _ => {}
        }
        let observer = Observer { callback, verbose, progress };
        let most = match most {
            Some(most) => most,
            None => lock("solver", &self.solver)?.settings.max_iterations,
        };
        let start = Start::Last(if to_full_step { Call::ResumeToFullStep { most } } else { Call::Resume });
        run(py, &self.problem, &self.solver, start, observer, |solver, problem, _, interruptions| match to_full_step {
            true => solver.resume_to_full_step_with(problem, most, interruptions),
            false => solver.resume_with(problem, interruptions),
        })
    }

    /// Makes the first half of an iteration before the state arrives: derivatives and sweep along the trajectory of the
    /// last solution. `feedback` makes the second half.
    ///
    /// In each period, call `shift`, set references, call `prepare`, and then wait for the state. The prediction is the
    /// first state of the shifted solution; it becomes `problem.x0`. Do not change the problem until `feedback`. A
    /// direction that is not found is reported by `feedback`. Other threads can run meanwhile.
    ///
    /// Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
    fn prepare(&self, py: Python<'_>) -> PyResult<()> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut solver = lock("solver", &self.solver)?;
        let (inner, solver) = (&mut *problem, &mut *solver);
        self.problem.get().recorder.note_of(address(&self.solver), || Call::Prepare { sweeps: 1 });
        observe(py, &self.problem, Observer::default(), |signals| solver.prepare_with(inner, signals))
    }

    /// Sets the initial state to the measured state, and completes the prepared iteration with its gap and rollouts.
    /// Returns a `Solution`.
    ///
    /// For each state, the result is the result of `problem.set_x0(x0)` and `resume(stop="full_step", most=most)`, to
    /// the bit, because the sweep does not contain the initial state. `time_budget` applies to this call alone;
    /// `timings` contain both. Other threads can run meanwhile.
    ///
    /// x0: the measured state, nx numbers.
    /// most: the maximum number of iterations, at least 1. If the step is shorter than 1, whole iterations follow the
    ///     prepared one, until a step of length 1.
    ///
    /// Raises `ProblemError` if nothing is prepared, and as `Problem.set_x0` does; then the preparation is kept. Raises
    /// exceptions raised by an `Action`.
    #[pyo3(signature = (x0, most=1))]
    fn feedback<'py>(&self, py: Python<'py>, x0: &Bound<'_, PyAny>, most: usize) -> PyResult<Bound<'py, PyAny>> {
        if most == 0 {
            return Err(PyValueError::new_err("most: expected at least 1, found 0"));
        }
        let x0 = self.state(x0)?;
        let start = Start::Last(Call::Feedback { x0: kept(&x0), most });
        run(py, &self.problem, &self.solver, start, Observer::default(), |solver, problem, _, signals| {
            solver.feedback_with(problem, &x0, most, signals)
        })
    }
}
}

/// Copies the given settings.
fn copied(py: Python<'_>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Py<PyDict>> {
    Ok(settings.map_or_else(|| Ok(PyDict::new(py)), |settings| settings.copy())?.unbind())
}

/// Defines the constructor of solvers without an inner solver, and their reader of states.
macro_rules! construct {
    ($($class:ident by $set:ident),*) => {$(
        impl $class {
            fn with(
                problem: Bound<'_, Problem>,
                _inner: Option<&Bound<'_, PyDict>>,
                settings: Option<&Bound<'_, PyDict>>,
            ) -> PyResult<Self> {
                let py = problem.py();
                let mut solver = rust::$class::new(&*lock("problem", &problem.get().inner)?);
                $set(&mut solver.settings, settings)?;
                solver.settings.check().map_err(problem_error)?;
                let (problem, solver, settings) = (problem.unbind(), Mutex::new(solver), copied(py, settings)?);
                Ok(Self { problem, solver, settings, inner: copied(py, None)? })
            }

            /// Reads a state of the problem.
            fn state(&self, x0: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
                let size = lock("problem", &self.problem.get().inner)?.nx();
                Ok(vector("x0", x0, size)?.to_vec())
            }
        }
    )*};
}
construct!(Fddp by set_fddp, InteriorPoint by set_interior_point);

plain_solver! {
/// The augmented Lagrangian method around `Fddp`, as in ProxDDP: for robots with `Limit`s and for `ConstrainedAction`s.
///
/// The method repeats two steps. First FDDP minimises Σ ℓ + (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖² with z = g + μ y, where
/// ℓ is the cost of a knot, g its limits, y their multipliers, and Π the projection onto the bounds. If FDDP found no
/// minimum, it continues. If the limits hold well enough, or the penalty 1/μ is at its maximum, y ← (z − Π z) / μ.
/// Otherwise μ is reduced. The method ends when the violation of limits and the gradient of ℓ + yᵀg are below the
/// tolerances.
///
/// The penalty of a row lower < r < upper is divided by the square of its smaller finite bound other than 0, if that
/// bound exceeds 1 in absolute value. Tolerances, violations and multipliers are in the units of the row.
///
/// `solve` begins with zero multipliers. `resume` begins with the multipliers and the penalty of the last solve. If the
/// last solve failed, they are from the solve before it. They start again after two failed solves in succession, or
/// after "not_finite". `shift` also shifts the multipliers. Between `solve` and `resume`, `settings` and `inner` may be
/// assigned.
///
/// A solution is "converged" when the residuals of `outcome` are below the tolerances. The status is
/// "constraints_violated" if limits do not hold at minima of the largest penalty, and updates of the multipliers do not
/// help. This does not prove that no solution exists: another warm start may find one. The status is
/// "regularisation_limit" if an inner solve found no acceptable step, and did not end at a minimum. The status is
/// "infeasible" if the initial state itself violates a limit of knot 0 that no control can change. `outcome.worst`
/// contains the knot, the limit and the amount of the largest violation. The cost of the solution includes the
/// penalties of the limits; the cost of `outcome` does not. The solution's trace and gains are from the last inner
/// solve, its timings from the whole solve. Controls of a warm start are moved into their bounds.
///
/// problem: the problem to solve. All memory is allocated once, for the size of this problem.
/// inner: a dict of settings of `Fddp` for the inner solves. The tolerances of inner solves are chosen automatically;
///     `time_budget` applies to the whole solve.
/// settings: any of the following settings, by name. `tolerance`: the largest accepted distance of a limit from its
///     bounds. `tolerance_dual`: the largest accepted entry of the gradient of the Lagrangian. `max_solves`: the
///     maximum number of inner solves. `penalty_start`, `penalty_max`, `penalty_factor`: 1/μ of the first inner solve,
///     its maximum, and the factor by which it increases; an equal `penalty_start` and `penalty_max` fix the penalty.
///     `restart`: whether to repeat a failed `solve` of a problem
///     with limits or bounds once (default: yes). The second solve starts from the initial state, held still at all
///     knots. A solve fails if it is not finite, violates limits at the largest penalty, or finds no acceptable step
///     while limits are violated. The better result is returned.
///
/// >>> from condyle.optimal import AugmentedLagrangian, Cost, FreeDynamics, Limit, Problem, Residual
/// >>> arm = condyle.robots.arm7()
/// >>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
/// >>> costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
/// >>> weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
/// >>> knot = FreeDynamics(arm, 0.05, costs, limits=[weak])
/// >>> reach = Limit("reach", Residual.frame_translation(arm, "tool", [0.5, 0.1, 0.6]))  # exactly
/// >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [], limits=[reach]))
/// >>> solver = AugmentedLagrangian(problem)
/// >>> solution = solver.solve(np.tile(x0, (11, 1)), np.tile(knot.quasi_static(x0), (10, 1)))
/// >>> solution.status, bool(np.abs(solution.us).max() < 30.0 + 1e-6), solver.outcome.primal < 1e-6
/// ('converged', True, True)
AugmentedLagrangian, set_constraints, show_constraints {
    #[new]
    #[pyo3(signature = (problem, inner=None, **settings))]
    fn new(
        problem: Bound<'_, Problem>,
        inner: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        Self::with(problem, inner, settings)
    }

    /// All settings of the inner solves by name, as a read-only mapping. An assignment changes the settings that it
    /// names, as for `settings`.
    #[getter(inner)]
    fn all_inner<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
        Ok(read_only(show_fddp(&lock("solver", &self.solver)?.inner, py)?))
    }

    #[setter(inner)]
    fn change_inner(&self, inner: &Bound<'_, PyMapping>) -> PyResult<()> {
        let given = dict(inner)?;
        let mut solver = lock("solver", &self.solver)?;
        let mut changed = solver.inner.clone();
        set_fddp(&mut changed, Some(&given))?;
        changed.check().map_err(problem_error)?;
        solver.inner = changed;
        self.inner.bind(given.py()).update(given.as_mapping())
    }

    /// The violation of limits and other results of the last solve, as an `Outcome`.
    #[getter]
    fn outcome<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_outcome(py, lock("solver", &self.solver)?.outcome())
    }

    /// Sets the multipliers of the limit `name`. The next `solve` or `resume` starts from them.
    ///
    /// Other limits keep the multipliers of the last solve; without a solve, they start at 0. The penalty and `outcome`
    /// do not change. A positive number belongs to the upper bound, a negative one to the lower bound.
    ///
    /// name: the name of a limit of the problem.
    /// values: the multipliers, (N + 1, rows), as `outcome.multipliers_of(name)` returns them. Numbers at knots without
    ///     this limit are ignored.
    ///
    /// Raises `ProblemError` if no limit has this name, or a number is not finite; then all multipliers are kept.
    fn set_multipliers(&self, name: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        set_multipliers(&self.problem, &self.solver, name, values, rust::AugmentedLagrangian::set_multipliers)
    }
}
}

impl AugmentedLagrangian {
    fn with(
        problem: Bound<'_, Problem>,
        inner: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let py = problem.py();
        let mut solver = rust::AugmentedLagrangian::new(&*lock("problem", &problem.get().inner)?);
        set_fddp(&mut solver.inner, inner)?;
        solver.inner.check().map_err(problem_error)?;
        set_constraints(&mut solver.settings, settings)?;
        let (problem, solver) = (problem.unbind(), Mutex::new(solver));
        Ok(Self { problem, solver, settings: copied(py, settings)?, inner: copied(py, inner)? })
    }
}

plain_solver! {
/// The primal–dual interior point method with multiple shooting: for robots with `Limit`s, bounds on controls, and
/// `ConstrainedAction`s.
///
/// A slack variable s replaces each limited number. The method replaces each bound by a barrier term −μ log(s − lower)
/// or −μ log(upper − s). It makes Newton steps for states, controls, slack variables and multipliers, while μ falls to
/// zero. Each step is a single sweep over the horizon, which costs little more than a sweep without limits. A filter
/// accepts a step if either the violation or the cost with barrier terms decreases enough. If no step is accepted,
/// or the violation stalls, the method starts anew with careful steps. Later, a restoration reduces the violation
/// alone.
///
/// Use `InteriorPoint` for problems with limits, and `tick` for model predictive control with limits. It takes fewer
/// iterations than `AugmentedLagrangian`, but its trajectory has gaps until it converges. Use `AugmentedLagrangian`
/// if `InteriorPoint` does not converge, or if the result of each iteration must satisfy the dynamics. Use `Fddp` if
/// there are no limits.
///
/// `solve` computes the first slack variables and multipliers from the warm start. `resume` and `tick` begin with the
/// slack variables and multipliers of the last solve, and `shift` also shifts them. `settings` may be assigned before
/// each of these calls. The status is "converged" if the gradient of the Lagrangian, the complementarity and the gaps
/// are below the tolerance, and the violation is below a tenth of it. A violated limit is never reported as
/// "converged". The status is "infeasible" if the restoration ended where no small step reduces the violation, or if
/// the initial state itself violates a limit of knot 0 that no control can change. The first case does not prove that
/// no solution exists: another warm start may find one. The status is "constraints_violated" if the restoration reached
/// its maximum number of iterations. `outcome.worst` contains the knot, the limit and the amount of the largest
/// violation. "regularisation_limit", "max_iterations", "time_limit", "interrupted" and "not_finite" have the same
/// meanings as for `Fddp`; the solution is then the best iterate. The status is also "regularisation_limit" if the
/// residuals no longer decrease near a solution. The costs of the solution and of `outcome` are equal and do not
/// include terms of the limits. A soft `Limit` gives way where it costs less than to hold it. Its cost is
/// `outcome.soft_cost`, and `outcome.gave_way` lists the rows that gave way.
///
/// The gains K contain the limits. Near a bound, the feedback is stiff in the direction of this bound. With μ near
/// zero, active rows are equations: K does not move a control that is at its bound, and keeps other active limits at
/// their bounds for small deviations of the state. Rows that are not active do not change K.
///
/// problem: the problem to solve. All memory is allocated once, for the size of this problem.
/// settings: any of the following settings, by name. `tolerance`: see above, default 1e-6; the gradient and the
///     complementarity are scaled as in IPOPT. `max_iterations`: default 300. `barrier_start`: μ of the first
///     iteration; None (default) chooses the cost of the warm start divided by the number of bounds. `tick_barrier`:
///     the largest μ of a `tick`, in the unit of the cost, default 0.1. `second_order`:
///     whether to use the curvature of the dynamics near the solution, if the models provide it. This saves iterations
///     if this curvature is large compared with the costs. With soft limits, the curvature is used from the start, or,
///     without this setting, once the residuals have not decreased for eight iterations. `inverse_dynamics_form`,
///     `time_budget` (s), `threads`: as for `Fddp`; the results are bit-identical for any number of threads.
///     `regularisation_min`, `regularisation_max`: the smallest and the largest regularisation; a solve that reaches
///     the largest one stops.
///
/// >>> from condyle.optimal import Cost, FreeDynamics, InteriorPoint, Limit, Problem, Residual
/// >>> arm = condyle.robots.arm7()
/// >>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
/// >>> costs = [Cost("rest", 1e-1, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))]
/// >>> weak = Limit("weak", Residual.control(np.zeros(7)), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
/// >>> knot = FreeDynamics(arm, 0.05, costs, limits=[weak])
/// >>> reach = Limit("reach", Residual.frame_translation(arm, "tool", [0.5, 0.1, 0.6]))  # exactly
/// >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [], limits=[reach]))
/// >>> solver = InteriorPoint(problem)
/// >>> solution = solver.solve(np.tile(x0, (11, 1)), np.tile(knot.quasi_static(x0), (10, 1)))
/// >>> solution.status, bool(np.abs(solution.us).max() < 30.0 + 1e-6), solver.outcome.primal < 1e-6
/// ('converged', True, True)
/// >>> solver.shift(0)
/// >>> problem.set_x0(solution.xs[1])
/// >>> solver.tick(2).us.shape
/// (10, 7)
InteriorPoint, set_interior_point, show_interior_point {
    #[new]
    #[pyo3(signature = (problem, **settings))]
    fn new(problem: Bound<'_, Problem>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        Self::with(problem, None, settings)
    }

    /// Makes one linearisation at the last trajectory and up to `sweeps` Newton steps for its quadratic program, as a
    /// controller does in each period. Returns a `Solution`.
    ///
    /// No step length is searched, so the time is known in advance. The result is close to the optimum only if the last
    /// trajectory is: begin with a `solve`, then `shift`, `set_x0` and `tick` in each period. Other threads can run
    /// meanwhile. The status is "converged" if the quadratic program is solved, "max_iterations" after all steps,
    /// and "time_limit" if the `time_budget` ended the steps. The first step is always made. The cost, the gap and
    /// `outcome` belong to the trajectory before the tick, from the present initial state. `outcome.dual` is infinite,
    /// because a tick does not measure it. The gains belong to the last step.
    ///
    /// sweeps: the maximum number of steps, at least 1. Two steps follow changes of the active limits better than one.
    ///
    /// Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
    #[pyo3(signature = (sweeps=2))]
    fn tick<'py>(&self, py: Python<'py>, sweeps: usize) -> PyResult<Bound<'py, PyAny>> {
        let start = Start::Last(Call::Tick { sweeps });
        run(py, &self.problem, &self.solver, start, Observer::default(), |solver, problem, _, interruptions| {
            solver.tick_with(problem, sweeps, interruptions)
        })
    }

    /// Makes the part of a tick that does not depend on the measured state, before the state arrives: the
    /// linearisation along the last trajectory, all steps but the last one, and the last sweep. `feedback` makes the
    /// rest.
    ///
    /// In each period, call `shift`, set references, call `prepare`, and then wait for the state. The prediction is the
    /// first state of the shifted solution; it becomes `problem.x0`. Do not change the problem until `feedback`, which
    /// also reports a failed sweep. Other threads can run meanwhile. `time_budget` does not apply.
    ///
    /// sweeps: the maximum number of steps, at least 1, as for `tick`.
    ///
    /// Raises `ProblemError` as `resume` does, and exceptions raised by an `Action`.
    #[pyo3(signature = (sweeps=2))]
    fn prepare(&self, py: Python<'_>, sweeps: usize) -> PyResult<()> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut solver = lock("solver", &self.solver)?;
        let (inner, solver) = (&mut *problem, &mut *solver);
        self.problem.get().recorder.note_of(address(&self.solver), || Call::Prepare { sweeps });
        observe(py, &self.problem, Observer::default(), |signals| solver.prepare_with(inner, sweeps, signals))
    }

    /// Sets the initial state to the measured state, and completes the prepared tick. Returns a `Solution`.
    ///
    /// If the state equals the prediction, the result is the result of `problem.set_x0(x0)` and `tick`, to the bit.
    /// Elsewhere, the linearisation remains the one along the prediction, and the difference enters the last step. If
    /// the difference is so large that other limits may become active, one new sweep replaces the prepared ones.
    /// `time_budget` applies to this call alone; `timings` contain both. Other threads can run meanwhile.
    ///
    /// x0: the measured state, nx numbers.
    ///
    /// Raises `ProblemError` if nothing is prepared, and as `Problem.set_x0` does; then the preparation is kept. Raises
    /// exceptions raised by an `Action`.
    fn feedback<'py>(&self, py: Python<'py>, x0: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let x0 = self.state(x0)?;
        let start = Start::Last(Call::Feedback { x0: kept(&x0), most: 1 });
        run(py, &self.problem, &self.solver, start, Observer::default(), |solver, problem, _, signals| {
            solver.feedback_with(problem, &x0, signals)
        })
    }

    /// The violation of limits and other results of the last solve or tick, as an `Outcome`.
    #[getter]
    fn outcome<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        give_outcome(py, lock("solver", &self.solver)?.outcome())
    }

    /// Sets the multipliers of the limit `name`. The next `solve`, `resume` or `tick` starts from them.
    ///
    /// Other limits keep the multipliers of the last solve; without a solve, they start as usual. `outcome` does not
    /// change. A positive number belongs to the upper bound, a negative one to the lower bound. Numbers without such a
    /// bound have no effect, and numbers far from the central path are moved towards it.
    ///
    /// name: the name of a limit of the problem.
    /// values: the multipliers, (N + 1, rows), as `outcome.multipliers_of(name)` returns them. Numbers at knots without
    ///     this limit are ignored.
    ///
    /// Raises `ProblemError` if no limit has this name, or a number is not finite; then all multipliers are kept.
    fn set_multipliers(&self, name: &str, values: &Bound<'_, PyAny>) -> PyResult<()> {
        set_multipliers(&self.problem, &self.solver, name, values, rust::InteriorPoint::set_multipliers)
    }
}
}
