//! Derivatives of solutions with respect to the parameters of their problem.

use super::evaluation::{by_knot, named_controls};
use super::problem::{Problem, lock};
use super::solvers::{AugmentedLagrangian, Fddp, InteriorPoint};
use crate::arrays::{Give, class, matrix, output, vector};
use crate::exceptions::{problem_error, within, wrong_word};
use condyle::optimal as rust;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::{Curvature, Parameter, ParameterJacobian, SensitivitySettings};
use std::collections::HashMap;
use std::sync::Mutex;

/// Maximum number of entries of a parameter of one's own.
const MOST_ENTRIES: usize = 4096;

/// The derivatives of a solver's last solution with respect to the parameters of its problem.
///
/// The optimality conditions are linearised at the solution and factorised once. After that, the gradient of a loss
/// with respect to a parameter is one pass over the knots, whatever the number of the parameter's entries.
///
/// A parameter has a name, such as "x0", "target/NAME" or "inertia/LINK"; `Problem.parameters` returns all names. A
/// parameter that several knots share changes at all of them. Changes are in the tangent space: 2 nv numbers for a
/// state, 3 for a rotation R exp(δ), 6 for a placement M exp(δ), linear first. Other parameters change by numbers that
/// are added to their values. `define` adds parameters of your own.
///
/// Bounds that are active are held active. If `report.strict_complementarity` is False, a bound is active with a
/// multiplier near zero; the solution has a kink there, and the derivative on the other side differs.
///
/// solver: an `Fddp`, `InteriorPoint` or `AugmentedLagrangian` whose last solution has converged. The error of a
///     derivative is proportional to the error of the solution, so choose tight tolerances.
/// curvature: "exact" (default) takes second derivatives by differences of the first derivatives, for problems of all
///     kinds. "dynamics" adds the second derivatives of the dynamics, if the models provide them, to the Hessians of
///     the costs that the solver uses; it is exact if costs are quadratic in x and u. "gauss_newton" takes the
///     solver's Hessians of costs alone, and is an approximation.
/// tolerance: the largest residual of the optimality conditions that counts as converged, relative to their terms.
/// strictness: the smallest `report.margin` with strict complementarity.
///
/// Raises `ProblemError` if the solution has not converged, the problem has changed since the solve, a limit is soft,
/// or the solution is no strict minimum, so that derivatives do not exist.
///
/// >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivity
/// >>> arm, x0 = condyle.robots.arm7(), np.full(14, 0.1)
/// >>> rest, effort = Cost("rest", 1.0, Residual.state(x0)), Cost("effort", 1e-3, Residual.control(np.zeros(7)))
/// >>> reach = Cost("reach", 10.0, Residual.frame_translation(arm, "tool", [0.4, 0.2, 0.5]))
/// >>> knot, end = FreeDynamics(arm, 0.05, [rest, effort, reach]), FreeDynamics(arm, None, [rest])
/// >>> problem = Problem(x0, [knot], [0] * 10, end)
/// >>> solver = Fddp(problem)
/// >>> solver.solve(np.tile(x0, (11, 1)), np.zeros((10, 7))).status
/// 'converged'
/// >>> sensitivity = Sensitivity(solver)
/// >>> by_us = np.zeros((10, 7))
/// >>> by_us[0, 1] = 1.0  # the loss is the first effort of the second joint
/// >>> sensitivity.gradient("target/reach", by_us=by_us).shape
/// (3,)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Sensitivity {
    pub(super) problem: Py<Problem>,
    pub(super) inner: Mutex<rust::Sensitivity>,
    pub(super) jacobians: Mutex<HashMap<String, ParameterJacobian>>,
    /// The problem's number of changes at which it was the solved problem.
    revision: Mutex<u64>,
}

#[pymethods]
impl Sensitivity {
    #[new]
    #[pyo3(signature = (solver, *, curvature="exact", tolerance=1e-3, strictness=1e-4))]
    fn new(solver: &Bound<'_, PyAny>, curvature: &str, tolerance: f64, strictness: f64) -> PyResult<Self> {
        let settings = SensitivitySettings { curvature: curvature_of(curvature)?, tolerance, strictness };
        let py = solver.py();
        if let Ok(solver) = solver.cast::<Fddp>() {
            let (solver, problem) = (lock("solver", &solver.get().solver)?, &solver.get().problem);
            Self::of(py, problem, solver.solution(), None, settings)
        } else if let Ok(solver) = solver.cast::<InteriorPoint>() {
            let (solver, problem) = (lock("solver", &solver.get().solver)?, &solver.get().problem);
            Self::of(py, problem, solver.solution(), Some(solver.outcome()), settings)
        } else if let Ok(solver) = solver.cast::<AugmentedLagrangian>() {
            let (solver, problem) = (lock("solver", &solver.get().solver)?, &solver.get().problem);
            Self::of(py, problem, solver.solution(), Some(solver.outcome()), settings)
        } else {
            Err(PyTypeError::new_err(format!(
                "solver: expected an Fddp, InteriorPoint or AugmentedLagrangian, found {}",
                solver.get_type().name()?
            )))
        }
    }

    /// Computes the derivatives at a solution of `Fddp` with the given states, controls and gains, which may come from
    /// `solve_many`. The problem must be the solved problem.
    #[staticmethod]
    fn _at(
        problem: &Bound<'_, Problem>,
        xs: &Bound<'_, PyAny>,
        us: &Bound<'_, PyAny>,
        K: &Bound<'_, PyAny>,
        curvature: &str,
    ) -> PyResult<Self> {
        let settings = SensitivitySettings { curvature: curvature_of(curvature)?, ..Default::default() };
        let solution = {
            let inner = lock("problem", &problem.get().inner)?;
            let mut solution = rust::Fddp::new(&inner).solution().clone();
            solution.xs = matrix("xs", xs, [inner.horizon() + 1, inner.nx()])?.to_vec();
            solution.us = named_controls("us", &inner, us)?;
            let size = solution.K.iter().map(|K| K.len()).sum();
            let numbers = vector("K", K, size)?;
            let mut rest = &numbers[..];
            for gains in &mut solution.K {
                let (nu, ndx) = gains.shape();
                let (own, others) = rest.split_at(nu * ndx);
                *gains = nalgebra::DMatrix::from_row_slice(nu, ndx, own);
                rest = others;
            }
            solution.status = rust::Status::Converged;
            solution
        };
        Self::of(problem.py(), problem.as_unbound(), &solution, None, settings)
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.problem)
    }

    /// The `SensitivityReport` on the solution: active bounds, residuals and strict complementarity.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let inner = lock("sensitivity", &self.inner)?;
        let report = inner.report();
        let weakest = report.weakest.map(|weakest| {
            let kind = match weakest.kind {
                rust::ViolationKind::ControlBound => "control_bound",
                _ => "constraint",
            };
            (kind, weakest.knot, weakest.row)
        });
        class!(py, "SensitivityReport")?.call1((
            report.curvature.name(),
            report.stationarity,
            report.primal,
            report.active_controls,
            report.active_rows,
            report.strict_complementarity,
            report.margin,
            weakest,
        ))
    }

    /// Computes the gradient dL/dp of a loss L(x, u) with respect to a parameter, by the adjoint method.
    ///
    /// The derivatives of the optimality conditions with respect to the parameter are computed at the first call for
    /// this parameter, and stored.
    ///
    /// parameter: the name of the parameter.
    /// by_xs: the gradients of the loss with respect to the states, (N + 1, ndx), in the tangent space; None for zeros.
    /// by_us: the gradients of the loss with respect to the controls, (N, nu), or a list of N arrays if knots differ in
    ///     nu; None for zeros.
    /// by_knot: whether to return the part of each knot, (N + 1, n): the derivatives with respect to values of the
    ///     parameter that only this knot uses, such as the rows of `Problem.references`.
    ///
    /// Raises `ProblemError` if the parameter does not exist, or if the problem has changed since this object was
    /// created.
    #[pyo3(signature = (parameter, by_xs=None, by_us=None, by_knot=false))]
    fn gradient<'py>(
        &self,
        py: Python<'py>,
        parameter: &str,
        by_xs: Option<&Bound<'py, PyAny>>,
        by_us: Option<&Bound<'py, PyAny>>,
        by_knot: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let names = [parameter.to_owned()];
        let by_knot = if by_knot { &names[..] } else { &[] };
        Ok(self.all(py, &names, [by_xs, by_us], by_knot)?.remove(0))
    }

    /// Computes the gradients of a loss with respect to several parameters, by one solution of the adjoint problem.
    /// Returns a list with an array for each parameter.
    ///
    /// parameters: the names of the parameters.
    /// by_xs, by_us: as for `gradient`.
    /// by_knot: the names of parameters for which the part of each knot is returned, as by `gradient`.
    ///
    /// Raises `ProblemError` as `gradient` does.
    #[pyo3(signature = (parameters, by_xs=None, by_us=None, by_knot=Vec::new()))]
    fn gradients<'py>(
        &self,
        py: Python<'py>,
        parameters: Vec<String>,
        by_xs: Option<&Bound<'py, PyAny>>,
        by_us: Option<&Bound<'py, PyAny>>,
        by_knot: Vec<String>,
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        check_names(&parameters, &by_knot)?;
        self.all(py, &parameters, [by_xs, by_us], &by_knot)
    }

    /// Computes and stores the derivatives of the optimality conditions with respect to parameters, for later gradients
    /// by `Sensitivities`. Returns this object.
    ///
    /// parameters: the names of the parameters.
    ///
    /// Raises `ProblemError` if a parameter does not exist, or if the problem has changed since this object was
    /// created.
    fn prepare<'py>(slf: &Bound<'py, Self>, parameters: Vec<String>) -> PyResult<Bound<'py, Self>> {
        parameters.iter().try_for_each(|name| slf.get().find(name))?;
        Ok(slf.clone())
    }

    /// Computes the gradients of a loss with respect to the initial state and to all active bounds, as
    /// `BoundGradients`. They need no parameter.
    ///
    /// by_xs, by_us: as for `gradient`.
    #[pyo3(signature = (by_xs=None, by_us=None))]
    fn bounds<'py>(
        &self,
        py: Python<'py>,
        by_xs: Option<&Bound<'py, PyAny>>,
        by_us: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.check()?;
        let mut inner = lock("sensitivity", &self.inner)?;
        let [by_states, by_controls] = self.loss(by_xs, by_us)?;
        let adjoint = inner.adjoint(&by_states, &by_controls).map_err(problem_error)?;
        let problem = lock("problem", &self.problem.get().inner)?;
        let of_controls = by_knot(py, &problem, &[], |t, out| {
            out.copy_from_slice(&adjoint.control_bounds[problem.control_range(t)]);
        })?;
        let rows = adjoint.row_bounds.iter().map(|rows| rows.give(py, None)).collect::<PyResult<Vec<_>>>()?;
        class!(py, "BoundGradients")?.call1((adjoint.x0.give(py, None)?, of_controls, rows))
    }

    /// Computes the derivatives of all states and controls with respect to a parameter of n entries: an array
    /// (N + 1, ndx, n), and an array (N, nu, n), or a list of N arrays if knots differ in nu. One pass over the knots
    /// for each entry.
    ///
    /// parameter: the name of the parameter.
    ///
    /// Raises `ProblemError` as `gradient` does.
    fn jacobian<'py>(&self, py: Python<'py>, parameter: &str) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        self.check()?;
        self.find(parameter)?;
        let mut inner = lock("sensitivity", &self.inner)?;
        let jacobians = lock("sensitivity", &self.jacobians)?;
        let found = inner.forward(&jacobians[parameter]).map_err(problem_error)?;
        let problem = lock("problem", &self.problem.get().inner)?;
        let (ndx, n) = (problem.ndx(), found.xs.ncols());
        let rows = |of: &nalgebra::DMatrix<f64>, first: usize, out: &mut [f64]| {
            for (row, out) in (first..).zip(out.chunks_exact_mut(n)) {
                out.iter_mut().zip(of.row(row).iter()).for_each(|(out, x)| *out = *x);
            }
        };
        let xs = output(py, None, &[problem.horizon() + 1, ndx, n], |out| rows(&found.xs, 0, out))?;
        let us = by_knot(py, &problem, &[n], |t, out| rows(&found.us, problem.control_range(t).start, out))?;
        Ok((xs, us))
    }

    /// Defines a parameter of your own, whose derivatives are central differences: the inertia of a body, a coefficient
    /// of friction, or any other number of which problems are built.
    ///
    /// name: the name, for `gradient` and `jacobian`. An earlier definition of this name is replaced.
    /// size: the number of entries.
    /// build: a function that returns the `Problem` for a change of the entries from the solved problem. It is called
    ///     with zeros first, and then twice for each entry.
    /// step: the size of these changes.
    ///
    /// Raises `ProblemError` if the problem for zeros is another one than the solved problem, or if a problem has other
    /// dimensions; `ValueError` for the name of a parameter that exists already; and exceptions of `build`.
    #[pyo3(signature = (name, size, build, step=1e-5))]
    fn define(&self, name: &str, size: usize, build: &Bound<'_, PyAny>, step: f64) -> PyResult<()> {
        let size = within("size", size, 1, MOST_ENTRIES)?;
        if name.parse::<Parameter>().is_ok() {
            return Err(PyValueError::new_err(format!(
                "name: {name:?} is a parameter that needs no definition, expected another name"
            )));
        }
        let (py, mut raised) = (build.py(), None);
        let inner = lock("sensitivity", &self.inner)?;
        let problem = lock("problem", &self.problem.get().inner)?;
        let found = inner.jacobian_with(&problem, size, step, |change, evaluate| {
            let built = (|| {
                let problem = build.call1((change.give(py, None)?,))?;
                let problem = problem.cast::<Problem>().map_err(|_| {
                    let found = problem.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string());
                    PyTypeError::new_err(format!("build: expected to return a Problem, found {found}"))
                })?;
                let result = evaluate(&mut *lock("the problem that build returned", &problem.get().inner)?);
                problem.get().raise()?;
                result.map_err(problem_error)
            })();
            built.map_err(|error| {
                raised = Some(error);
                rust::Error::Sensitivity { what: "`build` has raised an exception".to_owned() }
            })
        });
        match (found, raised) {
            (_, Some(error)) => Err(error),
            (found, None) => {
                lock("sensitivity", &self.jacobians)?.insert(name.to_owned(), found.map_err(problem_error)?);
                Ok(())
            }
        }
    }

    /// Computes the derivative of the first control with respect to the initial state, (nu, ndx): the gradient of the
    /// policy that a controller executes. Without active limits, it is a gain of the factorisation.
    fn first_control_by_x0<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.check()?;
        lock("sensitivity", &self.inner)?.first_control_by_x0().map_err(problem_error)?.give(py, None)
    }

    fn __repr__(&self) -> PyResult<String> {
        let inner = lock("sensitivity", &self.inner)?;
        let report = inner.report();
        Ok(format!(
            "<condyle.optimal.Sensitivity: curvature {}, {} active controls, {} active rows>",
            report.curvature.name(),
            report.active_controls,
            report.active_rows
        ))
    }
}

/// Returns the curvature with this name.
fn curvature_of(name: &str) -> PyResult<Curvature> {
    match name {
        "exact" => Ok(Curvature::Exact),
        "dynamics" => Ok(Curvature::Dynamics),
        "gauss_newton" => Ok(Curvature::GaussNewton),
        other => Err(wrong_word("curvature", "'exact', 'dynamics' or 'gauss_newton'", other)),
    }
}

impl Sensitivity {
    /// Linearises the optimality conditions at a solution. Other Python threads can run meanwhile.
    fn of(
        py: Python<'_>,
        problem: &Py<Problem>,
        solution: &rust::Solution,
        outcome: Option<&rust::Outcome>,
        settings: SensitivitySettings,
    ) -> PyResult<Self> {
        let mut inner = lock("problem", &problem.get().inner)?;
        let inner = &mut *inner;
        let found = py.detach(|| rust::Sensitivity::new(inner, solution, outcome, settings));
        problem.get().raise()?;
        let (found, jacobians) = (Mutex::new(found.map_err(problem_error)?), Mutex::default());
        let revision = Mutex::new(inner.revision());
        Ok(Self { problem: problem.clone_ref(py), inner: found, jacobians, revision })
    }

    /// Returns `Ok` if the problem is still the solved one. It is evaluated only after a call that may have changed it.
    fn check(&self) -> PyResult<()> {
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let mut revision = lock("sensitivity", &self.revision)?;
        if problem.revision() != *revision {
            let found = lock("sensitivity", &self.inner)?.check_problem(&mut problem);
            self.problem.get().raise()?;
            found.map_err(problem_error)?;
            *revision = problem.revision();
        }
        Ok(())
    }

    /// Computes the derivatives with respect to a named parameter, unless they are stored.
    pub(super) fn find(&self, name: &str) -> PyResult<()> {
        if lock("sensitivity", &self.jacobians)?.contains_key(name) {
            return Ok(());
        }
        let parameter: Parameter = name.parse().map_err(problem_error)?;
        self.check()?;
        let inner = lock("sensitivity", &self.inner)?;
        let mut problem = lock("problem", &self.problem.get().inner)?;
        let found = inner.jacobian(&mut problem, &parameter);
        self.problem.get().raise()?;
        let found = found.map_err(problem_error)?;
        *lock("sensitivity", &self.revision)? = problem.revision(); // the parameter has its old value again
        lock("sensitivity", &self.jacobians)?.insert(name.to_owned(), found);
        Ok(())
    }

    /// Computes the gradients with respect to several parameters.
    fn all<'py>(
        &self,
        py: Python<'py>,
        parameters: &[String],
        [by_xs, by_us]: [Option<&Bound<'py, PyAny>>; 2],
        by_knot: &[String],
    ) -> PyResult<Vec<Bound<'py, PyAny>>> {
        self.check()?;
        parameters.iter().try_for_each(|name| self.find(name))?;
        let mut inner = lock("sensitivity", &self.inner)?;
        let [by_states, by_controls] = self.loss(by_xs, by_us)?;
        let jacobians = lock("sensitivity", &self.jacobians)?;
        let adjoint = inner.adjoint(&by_states, &by_controls).map_err(problem_error)?;
        let gradient = |name: &String| {
            let jacobian = &jacobians[name];
            if !by_knot.contains(name) {
                return adjoint.gradient(jacobian).give(py, None);
            }
            let parts = adjoint.gradient_by_knot(jacobian);
            output(py, None, &[parts.len(), jacobian.size()], |out| out.copy_from_slice(&parts.concat()))
        };
        parameters.iter().map(gradient).collect()
    }

    /// Reads the gradients of a loss.
    fn loss(&self, by_xs: Option<&Bound<'_, PyAny>>, by_us: Option<&Bound<'_, PyAny>>) -> PyResult<[Vec<f64>; 2]> {
        let problem = lock("problem", &self.problem.get().inner)?;
        let (rows, ndx) = (problem.horizon() + 1, problem.ndx());
        let by_states = match by_xs {
            Some(by_xs) => matrix("by_xs", by_xs, [rows, ndx])?.to_vec(),
            None => vec![0.0; rows * ndx],
        };
        let by_controls = match by_us {
            Some(by_us) => named_controls("by_us", &problem, by_us)?,
            None => vec![0.0; problem.control_range(rows - 1).start],
        };
        for (name, numbers) in [("by_xs", &by_states), ("by_us", &by_controls)] {
            if let Some(index) = numbers.iter().position(|x| !x.is_finite()) {
                return Err(problem_error(rust::Error::NotFinite { name, index, value: numbers[index] }));
            }
        }
        Ok([by_states, by_controls])
    }
}

/// Returns `Ok` if the names for parts by knot are names of parameters.
pub(super) fn check_names(parameters: &[String], by_knot: &[String]) -> PyResult<()> {
    match by_knot.iter().find(|name| !parameters.contains(name)) {
        Some(name) => Err(PyValueError::new_err(format!("by_knot: expected names of parameters, found {name:?}"))),
        None => Ok(()),
    }
}
