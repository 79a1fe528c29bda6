//! Macros that write the classes of solvers, with the methods that all solvers have.

use super::outcomes::multipliers_by_knot;
use super::problem::{Problem, lock};
use super::recorder::{address, kept};
use crate::exceptions::problem_error;
use condyle::optimal as rust;
use pyo3::prelude::*;
use rust::record::Call;
use std::sync::Mutex;

/// Defines a solver class. The macro writes the methods that all solvers have. The constructor and the methods of only
/// one class are arguments of the macro.
macro_rules! solver {
    ($(#[$doc:meta])* $class:ident, $set:ident, $show:ident { $($own:tt)* }) => {
        $(#[$doc])*
        #[pyclass(frozen, module = "condyle.optimal")]
        pub(crate) struct $class {
            pub(super) problem: Py<Problem>,
            pub(super) solver: Mutex<rust::$class>,
            /// The settings that the user set; `inner` are the settings of the inner solver, if there is one.
            settings: Py<PyDict>,
            inner: Py<PyDict>,
        }

        #[pymethods]
        impl $class {
            $($own)*

            /// Solves the problem from a warm start. Returns a `Solution`; its status shows how the solve ended.
            ///
            /// Other threads can run meanwhile. Signals are checked about forty times a second, between the three
            /// phases of an iteration (derivatives, backward sweep, rollout). An exception of a signal handler, such as
            /// KeyboardInterrupt, ends the solve and is raised. Then `solution` is the best iterate, from which
            /// `resume` continues.
            ///
            /// xs: states, (N + 1, nx), which need not satisfy the dynamics.
            /// us: controls, (N, nu), or a list of N arrays if knots differ in nu.
            /// callback: a function that is called with the `Iteration` after each iteration. If the function returns
            ///     False, the solve ends ("interrupted"). Exceptions of the callback end the solve and are raised.
            /// verbose: whether to print a line for each iteration.
            /// progress: whether to show the progress, with tqdm if it is installed, else as lines of text.
            ///
            /// Raises `ProblemError` for invalid numbers or settings, and exceptions raised by an `Action`.
            #[pyo3(signature = (xs, us, callback=None, verbose=false, progress=false))]
            fn solve<'py>(
                &self,
                py: Python<'py>,
                xs: &Bound<'py, PyAny>,
                us: &Bound<'py, PyAny>,
                callback: Option<Bound<'py, PyAny>>,
                verbose: bool,
                progress: bool,
            ) -> PyResult<Bound<'py, PyAny>> {
                let observer = Observer { callback, verbose, progress };
                let start = Start::From([xs, us]);
                run(py, &self.problem, &self.solver, start, observer, |solver, problem, [xs, us], interruptions| {
                    solver.solve_with(problem, xs, us, interruptions)
                })
            }

            /// The `Solution` of the last solve, even if a signal or an error of an `Action` ended the solve
            /// ("interrupted"); None before the first solve.
            #[getter]
            fn solution<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
                let problem = lock("problem", &self.problem.get().inner)?;
                let solver = lock("solver", &self.solver)?;
                let solution = solver.solution();
                (!solution.timings.total.is_zero()).then(|| give(py, &self.problem, &problem, solution)).transpose()
            }

            /// Publishes the last solution for the threads that call a policy.
            ///
            /// policy: a `Policy` of the same problem.
            /// start: the time (s) at which knot 0 begins, on the clock of the policy's callers. Knots follow with
            ///     their present durations; an impact takes no time.
            ///
            /// Raises `ProblemError` for knots without duration, of an `Action`, and if the problem was shifted and
            /// the solution was not.
            #[pyo3(signature = (policy, start=0.0))]
            fn publish(&self, policy: &Bound<'_, Policy>, start: f64) -> PyResult<()> {
                let problem = lock("problem", &self.problem.get().inner)?;
                let solver = lock("solver", &self.solver)?;
                let mut publisher = lock("policy", &policy.get().publisher)?;
                publisher.publish(&problem, solver.solution(), start).map_err(problem_error)
            }

            /// All settings by name, as a read-only mapping.
            ///
            /// An assignment of a mapping changes the settings that it names; the others stay. The next `solve` or
            /// `resume` uses them: `solver.settings = {"tolerance": 1e-4}`.
            ///
            /// Raises `ProblemError` for an invalid number; then no setting changes.
            #[getter(settings)]
            fn all_settings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyMappingProxy>> {
                Ok(read_only($show(&lock("solver", &self.solver)?.settings, py)?))
            }

            #[setter(settings)]
            fn change_settings(&self, settings: &Bound<'_, PyMapping>) -> PyResult<()> {
                let given = dict(settings)?;
                let mut solver = lock("solver", &self.solver)?;
                let mut changed = solver.settings.clone();
                $set(&mut changed, Some(&given))?;
                changed.check().map_err(problem_error)?;
                solver.settings = changed;
                self.settings.bind(given.py()).update(given.as_mapping())
            }

            /// Changes settings by name, for the next `solve` or other call: `solver.configure(tolerance=1e-4)`.
            ///
            /// settings: settings of this solver; the others stay. This is the same as an assignment to `settings`.
            ///
            /// Raises `ProblemError` for an invalid number; then no setting changes.
            #[pyo3(signature = (**settings))]
            fn configure(&self, settings: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
                settings.map_or(Ok(()), |settings| self.change_settings(settings.as_mapping()))
            }

            /// Forgets the last solution, and starts anew from a state: the recovery after the status "not_finite".
            ///
            /// The new trajectory has the state at all knots, the controls that hold it still, and no gains or
            /// multipliers; `resume` starts from it.
            ///
            /// x0: the state, nx numbers; it becomes the initial state of the problem.
            ///
            /// Raises `ProblemError` as `Problem.set_x0` does.
            fn reset(&self, x0: &Bound<'_, PyAny>) -> PyResult<()> {
                let mut problem = lock("problem", &self.problem.get().inner)?;
                let mut solver = lock("solver", &self.solver)?;
                let x0 = vector("x0", x0, problem.nx())?;
                let recorded = address(&self.solver);
                self.problem.get().recorder.note_of(recorded, || Call::Reset { x0: kept(&x0) });
                let result = solver.reset(&mut problem, &x0);
                self.problem.get().raise()?;
                result.map_err(problem_error)
            }

            fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
                let mut text = format!("<condyle.optimal.{} of {}", stringify!($class), self.problem.bind(py).repr()?);
                for (name, value) in self.settings.bind(py).iter() {
                    text += &format!(", {name} {}", value.repr()?);
                }
                let inner = self.inner.bind(py);
                if !inner.is_empty() {
                    text += &format!(", inner {}", inner.repr()?);
                }
                Ok(text + ">")
            }

            /// Returns the class and the arguments from which `pickle` makes an equal solver: the problem and the
            /// settings. The solution is not included.
            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
                let (py, Self { problem, settings, inner, .. }) = (slf.py(), slf.get());
                let arguments = (problem.clone_ref(py), inner.clone_ref(py), settings.clone_ref(py));
                Ok((slf.get_type().getattr("_make")?, arguments).into_pyobject(py)?.into_any())
            }

            #[staticmethod]
            fn _make(
                problem: Bound<'_, Problem>,
                inner: Option<&Bound<'_, PyDict>>,
                settings: &Bound<'_, PyDict>,
            ) -> PyResult<Self> {
                Self::with(problem, inner, Some(settings))
            }

            fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
                visit.call(&self.problem)?;
                visit.call(&self.settings)?;
                visit.call(&self.inner)
            }

            /// Shifts the horizon of the problem and the last solution by a knot, as an MPC does after each step.
            ///
            /// `resume` then starts from the shifted solution. Knot t becomes knot t − 1, and keeps the costs and
            /// limits of this single knot. The new last knot has the model `last`, with the costs and limits that this
            /// model has for all knots. The last control is repeated, if the contacts are the same as at the knot
            /// before. If a robot's contacts change there, the last control holds the last state but one still, as
            /// `quasi_static` does. The last state follows from the last control. At a second shift without a solver
            /// step in between, the last state is repeated, because a rollout with repeated controls would diverge.
            ///
            /// last: the index of the new last knot's model.
            ///
            /// Raises `ProblemError` if the model does not exist.
            fn shift(&self, last: usize) -> PyResult<()> {
                let mut problem = lock("problem", &self.problem.get().inner)?;
                let recorded = address(&self.solver);
                self.problem.get().recorder.note_of(recorded, || Call::Shift { last });
                let mut solver = lock("solver", &self.solver)?;
                problem.shift(last).map_err(problem_error)?;
                self.problem.get().describe_shift()?;
                solver.shift(&mut problem).map_err(problem_error)?;
                self.problem.get().raise()
            }

            /// Predicts the state at the time `then` from the state x at the time `now`: nx numbers. The last solution
            /// is executed meanwhile: the dynamics of the knots are integrated, with the controls of the policy,
            /// u = ū + K (x ⊖ x̄). The steps take at most 2 ms.
            ///
            /// A controller predicts the state at which its next plan begins, before it calls `retime` or `shift`.
            ///
            /// x: the measured state, nx numbers.
            /// now, then: times (s) after the beginning of knot 0 of the last solution. After the horizon, the last
            ///     knot continues.
            ///
            /// Raises `ProblemError` for a number that is not finite, and for knots without duration, of an `Action`.
            fn predict<'py>(
                &self,
                x: &Bound<'py, PyAny>,
                now: f64,
                then: f64,
            ) -> PyResult<Bound<'py, PyAny>> {
                let py = x.py();
                let mut problem = lock("problem", &self.problem.get().inner)?;
                let solver = lock("solver", &self.solver)?;
                let x = vector("x", x, problem.nx())?;
                let mut next = vec![0.0; problem.nx()];
                let solution = solver.solution();
                solution.predict(&mut problem, &x, now, then, &mut next).map_err(problem_error)?;
                self.problem.get().raise()?;
                next.give(py, None)
            }

            /// Moves the horizon by any time, gives its knots new models and durations, and turns the last solution
            /// into a warm start for it. A controller calls this method in each period, with knots from a `Schedule`.
            /// So the period is independent of the spacing of the knots, and contacts may begin and end at any time.
            ///
            /// Each new knot takes its numbers from the last solution at the same time. States are interpolated;
            /// a new knot has the controls, gains and multipliers of the old knot at its middle. If this knot has
            /// other contacts, the controls hold the state still, the gains are zero, and only limits with the same
            /// name keep their multipliers. After the end of the last solution, states and controls follow as in
            /// `shift`.
            ///
            /// Returns the number of knots that have passed. The costs and limits of single knots move by this number.
            /// A knot whose model changes has the costs and limits that its new model has for all knots, until
            /// `set_references` is called.
            ///
            /// elapsed: the time (s) from the beginning of knot 0 of the last solution to the beginning of the new
            ///     horizon, at least 0.
            /// knot_models: the index of the model of each knot, N indices.
            /// durations: the duration (s) of each knot, N numbers, 0 for an impact.
            ///
            /// Raises `ProblemError` for invalid arguments, and before the first solve. Then nothing changes.
            fn retime(
                &self,
                elapsed: f64,
                knot_models: Vec<usize>,
                durations: &Bound<'_, PyAny>,
            ) -> PyResult<usize> {
                let mut problem = lock("problem", &self.problem.get().inner)?;
                let mut solver = lock("solver", &self.solver)?;
                let durations = vector("durations", durations, knot_models.len())?;
                self.problem.get().check_durations(&problem, &knot_models, &durations)?;
                let (recorded, before) = (address(&self.solver), problem.knot_models().to_vec());
                self.problem.get().recorder.note_of(recorded, || Call::Retime {
                    elapsed,
                    knot_models: knot_models.clone(),
                    durations: kept(&durations),
                });
                let passed = solver.retime(&mut problem, elapsed, &knot_models, &durations).map_err(problem_error)?;
                self.problem.get().describe_knots(passed, &before, &knot_models)?;
                self.problem.get().raise()?;
                Ok(passed)
            }
        }
    };
}

/// Defines a solver class as `solver` does, with a `resume` that has no criterion to stop of its own.
macro_rules! plain_solver {
    ($(#[$doc:meta])* $class:ident, $set:ident, $show:ident { $($own:tt)* }) => {
        solver! {
            $(#[$doc])*
            $class, $set, $show {
                /// Solves the problem from the last solution, with a new initial state or a shifted horizon. Returns a
                /// `Solution`.
                ///
                /// With a `time_budget`, one or two delayed solves do not make later solves shorter; each solve makes
                /// at least one iteration.
                ///
                /// callback, verbose, progress: as for `solve`.
                ///
                /// Raises `ProblemError` as `solve` does, and if there is no solution yet.
                #[pyo3(signature = (callback=None, verbose=false, progress=false))]
                fn resume<'py>(
                    &self,
                    py: Python<'py>,
                    callback: Option<Bound<'py, PyAny>>,
                    verbose: bool,
                    progress: bool,
                ) -> PyResult<Bound<'py, PyAny>> {
                    let observer = Observer { callback, verbose, progress };
                    let start = Start::Last(Call::Resume);
                    run(py, &self.problem, &self.solver, start, observer, |solver, problem, _, interruptions| {
                        solver.resume_with(problem, interruptions)
                    })
                }

                $($own)*
            }
        }
    };
}

pub(super) use {plain_solver, solver};

/// Sets the multipliers of the limit `name` in a solver, and records the call. `set` is the method of the solver.
pub(super) fn set_multipliers<S>(
    problem: &Py<Problem>,
    solver: &Mutex<S>,
    name: &str,
    values: &Bound<'_, PyAny>,
    set: impl FnOnce(&mut S, &mut rust::Problem, &str, &[Vec<f64>]) -> Result<(), rust::Error>,
) -> PyResult<()> {
    let problem = problem.get();
    let mut inner = lock("problem", &problem.inner)?;
    let recorded = address(solver);
    let mut solver = lock("solver", solver)?;
    let values = multipliers_by_knot(&mut inner, name, values)?;
    problem.recorder.note_of(recorded, || Call::SetMultipliers {
        name: name.to_owned(),
        values: values.iter().map(|y| kept(y)).collect(),
    });
    set(&mut solver, &mut inner, name, &values).map_err(problem_error)
}
