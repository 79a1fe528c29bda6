//! Constraints that are written in Python.

use super::MOST_SIZE;
use super::functions::{Fault, Functions, unless_failed};
use crate::arrays::{bounds, matrix, vector};
use crate::exceptions::within;
use condyle::optimal as rust;
use nalgebra::DMatrix;
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use rust::ActionModel;

/// An action of any kind with a constraint lower ≤ g(x, u) ≤ upper, which `InteriorPoint` and `AugmentedLagrangian`
/// enforce.
///
/// `Fddp` without `AugmentedLagrangian` treats the constraint as a cost of values outside the bounds. For residuals of
/// a robot, `Limit` is faster.
///
/// action: the action.
/// size: the number of entries of g, at most 4096.
/// calc: a function of (t, x, u) that returns g; at a terminal knot u is empty.
/// calc_diff: a function of (t, x, u) that returns (∂g/∂x, ∂g/∂u) of shapes (size, ndx) and (size, nu), in the tangent
///     space of the state. Without calc_diff, central differences of calc are used.
/// lower, upper: bounds of g, infinite for no bound. If both are None, the constraint is g = 0.
///
/// >>> from condyle.optimal import Action, AugmentedLagrangian, ConstrainedAction, Problem
/// >>> knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * u @ u))
/// >>> end = ConstrainedAction(Action(1, 0, lambda t, x, u: (None, 0.0)), 1, lambda t, x, u: x - 3.0)  # x = 3
/// >>> problem = Problem([0.0], [knot], [0] * 6, end)
/// >>> solver = AugmentedLagrangian(problem)
/// >>> solver.solve(np.zeros((7, 1)), np.zeros((6, 1))).us.round(6).ravel().tolist()
/// [0.5, 0.5, 0.5, 0.5, 0.5, 0.5]
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct ConstrainedAction {
    pub(in crate::optimal) action: Py<PyAny>,
    functions: Functions,
    bounds: [Vec<f64>; 2],
}

#[pymethods]
impl ConstrainedAction {
    #[new]
    #[pyo3(signature = (action, size, calc, calc_diff=None, lower=None, upper=None))]
    fn new(
        action: Py<PyAny>,
        size: usize,
        calc: Py<PyAny>,
        calc_diff: Option<Py<PyAny>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        within("size", size, 0, MOST_SIZE)?;
        let bounds = bounds(size, lower, upper)?.unwrap_or_else(|| [vec![0.0; size], vec![0.0; size]]);
        Ok(Self { action, functions: Functions::new(calc, calc_diff)?, bounds })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let action = self.action.bind(py).repr()?;
        Ok(format!("<condyle.optimal.ConstrainedAction of {} numbers, {action}>", self.bounds[0].len()))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, this) = (slf.py(), slf.get());
        let ([calc, calc_diff], [lower, upper]) = (this.functions.clones(py), this.bounds.clone());
        let arguments = (this.action.clone_ref(py), lower.len(), calc, calc_diff, lower, upper);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        visit.call(&self.action)?;
        self.functions.traverse(&visit)
    }

    fn __clear__(&self) {
        self.functions.clear();
    }
}

impl ConstrainedAction {
    /// Adds a copy of the constraint to a copy of its action. Errors of the constraint are stored in `fault`.
    pub(in crate::optimal) fn boxed(&self, action: Box<dyn ActionModel>, fault: &Fault) -> Box<dyn ActionModel> {
        let (functions, columns) = (self.functions.clone(), [action.ndx(), action.nu()]);
        let constraint = Written { functions, bounds: self.bounds.clone(), columns, fault: fault.clone() };
        Box::new(rust::Constrained::new(action, Box::new(constraint)))
    }
}

/// The constraint of a `ConstrainedAction` in the solver's interface. An error becomes a value of NaN, and is raised
/// after the solve.
struct Written {
    functions: Functions,
    bounds: [Vec<f64>; 2],
    /// Numbers of columns of ∂g/∂x and ∂g/∂u.
    columns: [usize; 2],
    fault: Fault,
}

impl rust::PathConstraint for Written {
    fn size(&self) -> usize {
        self.bounds[0].len()
    }

    fn bounds(&self, _: usize) -> (&[f64], &[f64]) {
        (&self.bounds[0], &self.bounds[1])
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], g: &mut [f64]) {
        let written = unless_failed(&self.fault, |py| {
            let value = self.functions.at(py, 0, t, x, u)?;
            g.copy_from_slice(&vector("the constraint", &value, g.len())?);
            Ok(())
        });
        if written.is_none() {
            g.fill(f64::NAN);
        }
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        if !self.functions.has(1) {
            return false;
        }
        let (size, [ndx, nu]) = (self.bounds[0].len(), self.columns);
        let written = unless_failed(&self.fault, |py| {
            let (by_x, by_u): (Bound<'_, PyAny>, Bound<'_, PyAny>) = self.functions.at(py, 1, t, x, u)?.extract()?;
            gx.copy_from(&matrix("∂g/∂x", &by_x, [size, ndx])?.to_matrix());
            gu.copy_from(&matrix("∂g/∂u", &by_u, [size, nu])?.to_matrix());
            Ok(())
        });
        if written.is_none() {
            gx.fill(f64::NAN);
        }
        true
    }
}
