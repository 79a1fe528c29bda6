//! The solvers, and what they give back.

use super::{Problem, common_nu, controls, exception, lock, rust};
use crate::arrays::{matrix, named_tuple, output};
use nalgebra::DMatrix;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList, PyTuple, PyType};
use std::sync::Mutex;

fn no_setting(name: &str) -> PyErr {
    PyValueError::new_err(format!("settings: there is no setting '{name}'"))
}

/// Changes the settings of FDDP that are given.
fn set(s: &mut rust::Settings, given: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    for (name, value) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let number = match name.as_str() {
            "max_iterations" => {
                s.max_iterations = value.extract()?;
                continue;
            }
            "second_order" => {
                s.second_order = value.extract()?;
                continue;
            }
            "inverse_dynamics_form" => {
                s.inverse_dynamics_form = value.extract()?;
                continue;
            }
            "segments" => {
                s.segments = value.extract()?;
                continue;
            }
            "threads" => {
                s.threads = value.extract()?;
                continue;
            }
            "step_lengths" => {
                s.step_lengths = value.extract()?;
                continue;
            }
            "method" => {
                s.method = match value.extract::<String>()?.as_str() {
                    "fddp" => rust::DdpMethod::Fddp,
                    "ddp" => rust::DdpMethod::Ddp,
                    other => {
                        return Err(PyValueError::new_err(format!(
                            "method: expected 'fddp' or 'ddp', found '{other}'"
                        )));
                    }
                };
                continue;
            }
            "time_budget" => {
                let seconds: Option<f64> = value.extract()?;
                let duration = |s| std::time::Duration::try_from_secs_f64(s);
                let duration = seconds.map(duration).transpose().map_err(|_| {
                    PyValueError::new_err(format!("time_budget: expected at least 0 seconds, found {seconds:?}"))
                })?;
                s.time_budget = duration;
                continue;
            }
            "tolerance" => &mut s.tolerance,
            "tolerance_bounded" => &mut s.tolerance_bounded,
            "accept" => &mut s.accept,
            "accept_ascent" => &mut s.accept_ascent,
            "flat" => &mut s.flat,
            "regularisation_start" => &mut s.regularisation_start,
            "regularisation_min" => &mut s.regularisation_min,
            "regularisation_max" => &mut s.regularisation_max,
            "regularisation_factor" => &mut s.regularisation_factor,
            "regularisation_decrease_above" => &mut s.regularisation_decrease_above,
            "regularisation_increase_below" => &mut s.regularisation_increase_below,
            _ => return Err(no_setting(&name)),
        };
        *number = value.extract()?;
    }
    Ok(())
}

/// A solve, from a warm start (xs, us) if there is one; other threads run meanwhile.
fn run<'py, S: Send>(
    py: Python<'py>,
    problem: &Py<Problem>,
    solver: &Mutex<S>,
    warm_start: Option<[&Bound<'_, PyAny>; 2]>,
    solve: impl for<'a> FnOnce(&'a mut S, &mut rust::Problem, &[f64], &[f64]) -> Result<&'a rust::Solution, rust::Error>
    + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let mut inner = lock("problem", &problem.get().inner)?;
    let mut solver = lock("solver", solver)?;
    let (mut x, mut u) = (vec![], vec![]);
    if let Some([xs, us]) = warm_start {
        x = matrix("xs", xs, [inner.horizon() + 1, inner.nx()])?.to_vec();
        u = controls(&inner, us)?;
    }
    let (inner, solver) = (&mut *inner, &mut *solver);
    let solution = py.detach(|| solve(solver, inner, &x, &u)).map_err(exception)?;
    problem.get().raise()?;
    give(py, inner, solution)
}

/// Moves a problem on by a knot, and a solver's solution with it.
fn shift<S>(
    problem: &Py<Problem>,
    solver: &Mutex<S>,
    last: usize,
    solution: impl Fn(&mut S, &mut rust::Problem) -> Result<(), rust::Error>,
) -> PyResult<()> {
    let mut inner = lock("problem", &problem.get().inner)?;
    let mut solver = lock("solver", solver)?;
    inner.shift(last).map_err(exception)?;
    problem.get().describe_shift()?;
    solution(&mut solver, &mut inner).map_err(exception)?;
    problem.get().raise()
}

/// Differential dynamic programming, feasibility-driven or not, with Crocoddyl's rules and constants.
///
/// Where controls are bounded, these are those of its box solvers.
///
/// problem: what is solved; the solver allocates for its shape once.
/// settings: `method`, "fddp" (default: trials keep a part of the gaps) or "ddp" (every trial is a plain rollout);
///     `second_order`, whether the curvature of the dynamics counts (where the models give it; full DDP);
///     `inverse_dynamics_form`, whether robots' knots come to the sweep as equations of inverse dynamics where
///     that is possible (default: yes; the same steps in less time); and
///     any of `max_iterations`, `tolerance`, `tolerance_bounded` (where controls are bounded), `step_lengths`,
///     `accept`, `accept_ascent`, `flat`, `regularisation_start`, `regularisation_min`, `regularisation_max`,
///     `regularisation_factor`, `regularisation_decrease_above`, `regularisation_increase_below`,
///     `time_budget` (s; a solve without time to go on returns what it has, with the status "time_limit"),
///     `segments` (of the horizon on which a sweep works at the same time, in as many threads as there are; 1 unless
///     given, for one thread. Results are the same but for rounding, and to the last bit for any number of threads),
///     `threads` (on which derivatives of a robot are computed, 1 unless given; the same to the last bit).
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Fddp {
    problem: Py<Problem>,
    solver: Mutex<rust::Fddp>,
}

#[pymethods]
impl Fddp {
    #[new]
    #[pyo3(signature = (problem, **settings))]
    fn new(problem: Bound<'_, Problem>, settings: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let mut solver = rust::Fddp::new(&*lock("problem", &problem.get().inner)?);
        set(&mut solver.settings, settings)?;
        Ok(Self { problem: problem.unbind(), solver: Mutex::new(solver) })
    }

    /// Solves the problem from a warm start, and returns a `Solution`. Other threads run meanwhile.
    ///
    /// xs: states, (N + 1, nx); they need not satisfy the dynamics.
    /// us: controls, (N, nu), or a list of N arrays where knots differ in nu.
    ///
    /// Raises `ProblemError` for numbers or settings that make no sense, and what an `Action` raises. How the solve
    /// ended is the solution's status.
    fn solve<'py>(&self, py: Python<'py>, xs: &Bound<'_, PyAny>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        run(py, &self.problem, &self.solver, Some([xs, us]), |solver, problem, xs, us| solver.solve(problem, xs, us))
    }

    /// Solves the problem from the last solution: with a new initial state, or shifted. Returns a `Solution`.
    ///
    /// Raises `ProblemError` as `solve`.
    fn resume<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        run(py, &self.problem, &self.solver, None, |solver, problem, _, _| solver.resume(problem))
    }

    /// Moves the horizon of the problem on by a knot, as an MPC does after each step, and the last solution with it.
    ///
    /// `resume` then starts from there. Knot t becomes knot t − 1, with the costs and limits of its own; the last one
    /// is served by a model of the problem, with those that it has for all knots.
    ///
    /// last: the index of that model.
    ///
    /// Raises `ProblemError` if there is no such model.
    fn shift(&self, last: usize) -> PyResult<()> {
        shift(&self.problem, &self.solver, last, rust::Fddp::shift)
    }
}

/// The method of multipliers around `Fddp`, an augmented Lagrangian as ProxDDP's: for robots with `Limit`s and for
/// `ConstrainedAction`s.
///
/// repeat: minimise Σ ℓ + (1 / 2μ) ‖z − Π z‖² − (μ / 2) ‖y‖², z = g + μ y, by FDDP; if the limits hold well enough,
/// y ← (z − Π z) / μ, else μ falls; until limits and the gradient of ℓ + yᵀg vanish to the tolerances.
///
/// problem: what is solved; the solver allocates for its shape once.
/// inner: a dict of the settings of `Fddp` for the inner solves; their tolerances are chosen, `time_budget` is for all.
/// settings: any of `tolerance` (how far a limit may be from its bounds), `tolerance_dual` (how large an entry of the
///     gradient of the Lagrangian may be), `max_solves` (inner solves), `penalty_start` (1/μ of the first),
///     `penalty_max`, `penalty_factor` (by which it rises).
///
/// >>> from condyle.optimal import AugmentedLagrangian, Cost, FreeDynamics, Limit, Problem
/// >>> arm = condyle.robots.arm7()
/// >>> x0 = np.r_[0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0, np.zeros(7)]
/// >>> costs = [Cost.state("rest", 1e-1, x0), Cost.control("effort", 1e-3, np.zeros(7))]
/// >>> weak = Limit.control("weak", np.zeros(7), lower=np.full(7, -30.0), upper=np.full(7, 30.0))
/// >>> knot = FreeDynamics(arm, 0.05, costs, limits=[weak])
/// >>> reach = Limit.frame_translation("reach", arm, "tool", [0.5, 0.1, 0.6])  # exactly
/// >>> problem = Problem(x0, [knot], [0] * 10, FreeDynamics(arm, None, [], limits=[reach]))
/// >>> solver = AugmentedLagrangian(problem)
/// >>> solution = solver.solve(np.tile(x0, (11, 1)), np.tile(knot.quasi_static(x0), (10, 1)))
/// >>> solution.status, bool(np.abs(solution.us).max() < 30.0 + 1e-6), solver.outcome.primal < 1e-6
/// ('converged', True, True)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct AugmentedLagrangian {
    problem: Py<Problem>,
    solver: Mutex<rust::AugmentedLagrangian>,
}

#[pymethods]
impl AugmentedLagrangian {
    #[new]
    #[pyo3(signature = (problem, inner=None, **settings))]
    fn new(
        problem: Bound<'_, Problem>,
        inner: Option<&Bound<'_, PyDict>>,
        settings: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut solver = rust::AugmentedLagrangian::new(&*lock("problem", &problem.get().inner)?);
        set(&mut solver.inner, inner)?;
        let s = &mut solver.settings;
        for (name, value) in settings.into_iter().flatten() {
            let name: String = name.extract()?;
            let number = match name.as_str() {
                "max_solves" => {
                    s.max_solves = value.extract()?;
                    continue;
                }
                "tolerance" => &mut s.tolerance,
                "tolerance_dual" => &mut s.tolerance_dual,
                "penalty_start" => &mut s.penalty_start,
                "penalty_max" => &mut s.penalty_max,
                "penalty_factor" => &mut s.penalty_factor,
                _ => return Err(no_setting(&name)),
            };
            *number = value.extract()?;
        }
        Ok(Self { problem: problem.unbind(), solver: Mutex::new(solver) })
    }

    /// Solves the problem from a warm start and multipliers of zero, and returns a `Solution`. Other threads run
    /// meanwhile.
    ///
    /// Its status is "converged" when the residuals of `outcome` are below the tolerances, and "infeasible" if the
    /// penalty reached its limit and the limits do not hold. Its cost contains the terms of the limits, that of
    /// `outcome` does not; its trace and gains are those of the last inner solve.
    ///
    /// xs: states, (N + 1, nx); they need not satisfy the dynamics.
    /// us: controls, (N, nu), or a list of N arrays where knots differ in nu.
    ///
    /// Raises `ProblemError` for numbers or settings that make no sense, and what an `Action` raises.
    fn solve<'py>(&self, py: Python<'py>, xs: &Bound<'_, PyAny>, us: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        run(py, &self.problem, &self.solver, Some([xs, us]), |solver, problem, xs, us| solver.solve(problem, xs, us))
    }

    /// Solves the problem from the last solution, its multipliers and its penalty; returns a `Solution`.
    ///
    /// The initial state may be another one, or the problem be shifted. After a solve that ended as "infeasible" or
    /// "not_finite" the multipliers are zero.
    ///
    /// Raises `ProblemError` as `solve`.
    fn resume<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        run(py, &self.problem, &self.solver, None, |solver, problem, _, _| solver.resume(problem))
    }

    /// Moves the horizon of the problem on by a knot, and the last solution with its multipliers, as `Fddp.shift`.
    ///
    /// last: the index of the model that serves the last knot.
    ///
    /// Raises `ProblemError` if there is no such model.
    fn shift(&self, last: usize) -> PyResult<()> {
        shift(&self.problem, &self.solver, last, rust::AugmentedLagrangian::shift)
    }

    /// What the last solve says of the limits, an `Outcome`.
    #[getter]
    fn outcome<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        static OUTCOME: PyOnceLock<Py<PyType>> = PyOnceLock::new();
        let solver = lock("solver", &self.solver)?;
        let o = solver.outcome();
        let array = |y: &Vec<f64>| output(py, None, &[y.len()], |out| out.copy_from_slice(y));
        let multipliers = o.multipliers.iter().map(array).collect::<PyResult<Vec<_>>>()?;
        let outcome = named_tuple(py, &OUTCOME, "Outcome")?;
        outcome.call1((o.cost, o.primal, o.dual, multipliers, o.penalty, o.solves, o.iterations))
    }
}

/// An array for all knots if they have as many controls, or else a list of arrays; `numbers` are of one knot.
fn by_knot<'py>(
    py: Python<'py>,
    problem: &rust::Problem,
    inner: &[usize],
    numbers: impl Fn(usize, &mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    let horizon = problem.horizon();
    let shape = |nu: usize| [&[nu], inner].concat();
    if let Some(nu) = common_nu(problem) {
        let each = nu * inner.iter().product::<usize>();
        return output(py, None, &[&[horizon], &shape(nu)[..]].concat(), |out| {
            (0..horizon).for_each(|t| numbers(t, &mut out[t * each..(t + 1) * each]));
        });
    }
    let arrays = (0..horizon).map(|t| output(py, None, &shape(problem.nu(t)), |out| numbers(t, out)));
    Ok(PyList::new(py, arrays.collect::<PyResult<Vec<_>>>()?)?.into_any())
}

fn row_major(K: &DMatrix<f64>, out: &mut [f64]) {
    for r in 0..K.nrows() {
        for c in 0..K.ncols() {
            out[r * K.ncols() + c] = K[(r, c)];
        }
    }
}

/// A solution as Python sees it.
fn give<'py>(py: Python<'py>, problem: &rust::Problem, s: &rust::Solution) -> PyResult<Bound<'py, PyAny>> {
    let (horizon, nx, ndx) = (problem.horizon(), problem.nx(), problem.ndx());
    static ITERATION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    static TIMINGS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    static SOLUTION: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let iteration = named_tuple(py, &ITERATION, "Iteration")?;
    let record = |i: &rust::Iteration| {
        iteration.call1((
            i.iteration,
            i.cost,
            i.gap,
            i.stop,
            i.step,
            i.regularisation,
            i.d1,
            i.d2,
            i.feasible,
            i.accepted,
        ))
    };
    let trace = s.trace.iter().map(record).collect::<PyResult<Vec<_>>>()?;
    let status = match s.status {
        rust::Status::Converged => "converged",
        rust::Status::MaxIterations => "max_iterations",
        rust::Status::TimeLimit => "time_limit",
        rust::Status::RegularisationLimit => "regularisation_limit",
        rust::Status::Infeasible => "infeasible",
        _ => "not_finite",
    };
    let t = &s.timings;
    let timings = [t.calc, t.calc_diff, t.sweep, t.rollout, t.total].map(|phase| phase.as_secs_f64());
    let timings = named_tuple(py, &TIMINGS, "Timings")?.call1(PyTuple::new(py, timings)?)?;
    named_tuple(py, &SOLUTION, "Solution")?.call1((
        output(py, None, &[horizon + 1, nx], |out| out.copy_from_slice(&s.xs))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.u(t)))?,
        by_knot(py, problem, &[ndx], |t, out| row_major(&s.K[t], out))?,
        by_knot(py, problem, &[], |t, out| out.copy_from_slice(s.k[t].as_slice()))?,
        s.cost,
        s.gap,
        s.feasible,
        status,
        trace,
        timings,
    ))
}
