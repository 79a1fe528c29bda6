//! Derivatives of many solutions, whose adjoints are computed in SIMD lanes.

use super::evaluation::common_nu;
use super::problem::lock;
use super::sensitivity::{Sensitivity, check_names};
use crate::arrays::{matrix, output, tensor};
use crate::exceptions::problem_error;
use condyle::optimal as rust;
use pyo3::exceptions::PyValueError;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::Mutex;

/// The derivatives of many solutions. Their adjoints are computed several at a time in the lanes of SIMD registers.
///
/// The B problems have the same numbers of knots, states and controls. The results equal the results of each
/// `Sensitivity` up to rounding. Different controls may be at their bounds. The adjoint of a solution with active
/// limits is computed alone.
///
/// The derivatives with respect to parameters belong to the solved problems, one `Sensitivity` each. If the solutions
/// are of one `Problem` whose parameters were set in between, call `Sensitivity.prepare` for the parameters before the
/// problem changes.
///
/// sensitivities: the `Sensitivity` of each solution.
///
/// Raises `ProblemError` for an empty list, or if a problem has other dimensions than the first one.
///
/// >>> from condyle.optimal import Cost, Fddp, FreeDynamics, Problem, Residual, Sensitivities, Sensitivity
/// >>> arm = condyle.robots.arm7()
/// >>> rest = Cost("rest", 1.0, Residual.state(np.zeros(14)))
/// >>> effort = Cost("effort", 0.1, Residual.control(np.zeros(7)))
/// >>> knot, end = FreeDynamics(arm, 0.05, [rest, effort]), FreeDynamics(arm, None, [rest])
/// >>> problem, each = Problem(np.zeros(14), [knot], [0] * 10, end), []
/// >>> solver = Fddp(problem)
/// >>> for x in (0.1, 0.2, 0.3):
/// ...     problem.set_x0(np.full(14, x))
/// ...     solution = solver.solve(np.full((11, 14), x), np.zeros((10, 7)))
/// ...     each.append(Sensitivity(solver).prepare(["x0", "target/rest"]))
/// >>> many = Sensitivities(each)
/// >>> by_x0, by_target = many.gradients(["x0", "target/rest"], by_us=np.ones((3, 10, 7)))
/// >>> by_target.shape
/// (3, 14)
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Sensitivities {
    inner: Mutex<rust::Sensitivities>,
    members: Vec<Py<Sensitivity>>,
}

#[pymethods]
impl Sensitivities {
    #[new]
    fn new(py: Python<'_>, sensitivities: Vec<Py<Sensitivity>>) -> PyResult<Self> {
        let mut inner = None;
        for member in &sensitivities {
            let one = lock("sensitivity", &member.bind(py).get().inner)?;
            match &mut inner {
                None => inner = Some(rust::Sensitivities::new([&*one])),
                Some(Ok(many)) => many.add(&one).map_err(problem_error)?,
                Some(Err(_)) => {}
            }
        }
        let inner = inner.unwrap_or_else(|| rust::Sensitivities::new([])).map_err(problem_error)?;
        Ok(Self { inner: Mutex::new(inner), members: sensitivities })
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.members.iter().try_for_each(|member| visit.call(member))
    }

    fn __len__(&self) -> usize {
        self.members.len()
    }

    /// The number of solutions whose adjoints are computed in lanes. The others have active limits.
    #[getter]
    fn in_lanes(&self) -> PyResult<usize> {
        Ok(lock("sensitivities", &self.inner)?.in_lanes())
    }

    /// Computes the gradients of losses L(x, u), one for each solution, with respect to several parameters. The
    /// adjoints are computed once. Returns a list with an array (B, n) for each parameter.
    ///
    /// parameters: the names of the parameters.
    /// by_xs: the gradients of the losses with respect to the states, (B, N + 1, ndx), in the tangent space; None for
    ///     zeros.
    /// by_us: the gradients of the losses with respect to the controls, (B, N, nu), or a list of N arrays (B, nu) if
    ///     knots differ in nu; None for zeros.
    /// by_knot: the names of parameters for which the part of each knot is returned, (B, N + 1, n), as by
    ///     `Sensitivity.gradient`.
    ///
    /// Raises `ProblemError` as `Sensitivity.gradient` does, and if a parameter has another size than in the first
    /// problem.
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
        for member in &self.members {
            parameters.iter().try_for_each(|name| member.bind(py).get().find(name))?;
        }
        let mut inner = lock("sensitivities", &self.inner)?;
        let [by_states, by_controls] = self.losses(py, by_xs, by_us)?;
        let inner = &mut *inner;
        py.detach(|| inner.adjoints(&by_states, &by_controls)).map_err(problem_error)?;
        let mut results = Vec::with_capacity(parameters.len());
        for name in &parameters {
            let (mut all, mut shape) = (Vec::new(), Vec::new());
            for (i, member) in self.members.iter().enumerate() {
                let jacobians = lock("sensitivity", &member.bind(py).get().jacobians)?;
                let (adjoint, jacobian) = (inner.adjoint(i), &jacobians[name]);
                let size = jacobian.size();
                let expected = *shape.last().unwrap_or(&size);
                if size != expected {
                    return Err(PyValueError::new_err(format!(
                        "{name}: it has {size} numbers in problem {i}, expected {expected} as in problem 0"
                    )));
                }
                if by_knot.contains(name) {
                    let parts = adjoint.gradient_by_knot(jacobian);
                    shape = vec![self.members.len(), parts.len(), size];
                    all.extend(parts.into_iter().flatten());
                } else {
                    shape = vec![self.members.len(), size];
                    all.extend(adjoint.gradient(jacobian));
                }
            }
            results.push(output(py, None, &shape, |out| out.copy_from_slice(&all))?);
        }
        Ok(results)
    }

    fn __repr__(&self) -> PyResult<String> {
        let lanes = self.in_lanes()?;
        Ok(format!("<condyle.optimal.Sensitivities: {} solutions, {lanes} in lanes>", self.members.len()))
    }
}

impl Sensitivities {
    /// Reads the gradients of the losses, one solution after the other.
    fn losses(
        &self,
        py: Python<'_>,
        by_xs: Option<&Bound<'_, PyAny>>,
        by_us: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<[Vec<f64>; 2]> {
        let count = self.members.len();
        let problem = lock("problem", &self.members[0].bind(py).get().problem.get().inner)?;
        let (horizon, ndx) = (problem.horizon(), problem.ndx());
        let controls = problem.control_range(horizon).start;
        let by_states = match by_xs {
            Some(by_xs) => tensor("by_xs", by_xs, [count, horizon + 1, ndx])?.to_vec(),
            None => vec![0.0; count * (horizon + 1) * ndx],
        };
        let Some(by_us) = by_us else { return Ok([by_states, vec![0.0; count * controls]]) };
        if let Some(nu) = common_nu(&problem) {
            return Ok([by_states, tensor("by_us", by_us, [count, horizon, nu])?.to_vec()]);
        }
        let found = by_us.len()?;
        if found != horizon {
            return Err(PyValueError::new_err(format!("by_us: expected {horizon} arrays, found {found}")));
        }
        let mut by_controls = vec![0.0; count * controls];
        for t in 0..horizon {
            let (nu, range) = (problem.nu(t), problem.control_range(t));
            let rows = matrix(&format!("by_us[{t}]"), &by_us.get_item(t)?, [count, nu])?.to_vec();
            for (to, row) in by_controls.chunks_exact_mut(controls).zip(rows.chunks_exact(nu.max(1))) {
                to[range.clone()].copy_from_slice(row);
            }
        }
        Ok([by_states, by_controls])
    }
}
