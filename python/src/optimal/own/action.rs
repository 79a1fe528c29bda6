//! Actions that are written in Python.

use super::MOST_SIZE;
use super::automatic::{Differentiated, Way, next_and_cost};
use super::functions::{Fault, Functions, unless_failed};
use super::lqr::write;
use super::space::Space;
use crate::arrays::{bounds, matrix, vector};
use crate::exceptions::within;
use condyle::optimal as rust;
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use rust::{ActionModel, GroupModel, LqKnot};
use std::any::Any;
use std::sync::Arc;

/// An action written in Python.
///
/// nx, nu: the sizes of a state and of a control, at most 4096; nu is 0 at a terminal knot.
/// calc: a function of (t, x, u) that returns the next state x⁺ and the cost ℓ; the next state may be None only at the
///     terminal knot.
/// calc_diff: a function of (t, x, u) that returns a dict of the nonzero matrices among A = ∂x⁺/∂x, B = ∂x⁺/∂u, q =
///     ∂ℓ/∂x, r = ∂ℓ/∂u, Q = ∂²ℓ/∂x², S = ∂²ℓ/∂x∂u, R = ∂²ℓ/∂u². Without calc_diff, calc is called with arrays of
///     numbers that carry their exact derivatives. So calc must make new arrays for its results (`np.array([...])`,
///     `np.concatenate`), and not write into arrays of floats. One call serves all knots if calc does not use t and has
///     no branches that differ between knots. If this method fails, calc is differentiated by hyper-dual numbers, and
///     if they also fail, by differences.
/// lower, upper: bounds on the controls, nu numbers each, infinite for no bound; or None.
/// space: the space of states: None for vectors; a model, for its states (q, v); or a tuple (ndx, integrate,
///     difference). In this tuple, integrate(x, dx) returns x ⊕ dx, difference(x0, x1) returns the dx with x0 ⊕ dx =
///     x1, and dx has ndx numbers. Derivatives are taken with respect to dx.
/// batch: whether calc and calc_diff take all knots at once: t of shape (N,), x (N, nx), u (N, nu), and results with N
///     rows.
///
/// >>> from condyle.optimal import Action, Fddp, Problem
/// >>> knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * (x @ x + u @ u)))
/// >>> end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
/// >>> problem = Problem([1.0], [knot], [0] * 30, end)
/// >>> round(Fddp(problem).solve(np.zeros((31, 1)), np.zeros((30, 1))).cost, 6)
/// 0.809017
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Action(Written);

/// The functions and sizes of an `Action`. The copies of the action in problems share the functions.
#[derive(Clone)]
struct Written {
    space: Space,
    nu: usize,
    functions: Functions,
    bounds: Option<[Vec<f64>; 2]>,
    batch: bool,
    way: Way,
}

#[pymethods]
impl Action {
    #[new]
    #[pyo3(signature = (nx, nu, calc, calc_diff=None, lower=None, upper=None, space=None, batch=false))]
    #[allow(clippy::too_many_arguments)]
    fn new(
        nx: usize,
        nu: usize,
        calc: Py<PyAny>,
        calc_diff: Option<Py<PyAny>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
        space: Option<&Bound<'_, PyAny>>,
        batch: bool,
    ) -> PyResult<Self> {
        let (nx, nu) = (within("nx", nx, 0, MOST_SIZE)?, within("nu", nu, 0, MOST_SIZE)?);
        let (space, functions) = (Space::new(nx, space)?, Functions::new(calc, calc_diff)?);
        Ok(Self(Written { space, nu, functions, bounds: bounds(nu, lower, upper)?, batch, way: Way::default() }))
    }

    fn __repr__(&self) -> String {
        let Written { space, nu, functions, batch, .. } = &self.0;
        let space = match space {
            Space::Vector(_) => String::new(),
            _ => format!(", ndx {}", space.ndx()),
        };
        let batch = if *batch { ", all knots at once" } else { "" };
        let written = if functions.has(1) { "calc_diff" } else { "derivatives of calc" };
        format!("<condyle.optimal.Action nx {}{space}, nu {nu}, {written}{batch}>", self.0.space.nx())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, Written { space, nu, functions, bounds, batch, .. }) = (slf.py(), &slf.get().0);
        let [calc, calc_diff] = functions.clones(py);
        let (lower, upper) = bounds.clone().map(|[lower, upper]| (lower, upper)).unzip();
        let arguments = (space.nx(), *nu, calc, calc_diff, lower, upper, space.argument(py)?, *batch);
        Ok((slf.get_type(), arguments).into_pyobject(py)?.into_any())
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.0.functions.traverse(&visit)?;
        self.0.space.functions().map_or(Ok(()), |functions| functions.traverse(&visit))
    }

    fn __clear__(&self) {
        self.0.functions.clear();
        if let Some(functions) = self.0.space.functions() {
            functions.clear();
        }
    }
}

impl Action {
    /// Copies the action for a problem, for the terminal knot or for other knots. Errors of the copy are stored in
    /// `fault`.
    pub(in crate::optimal) fn boxed(&self, terminal: bool, fault: &Fault) -> Box<dyn ActionModel> {
        Box::new(Own { written: self.0.clone(), terminal, fault: fault.clone() })
    }
}

/// An `Action` in the solver's interface. An error becomes a cost of NaN, and is raised after the solve.
#[derive(Clone)]
struct Own {
    written: Written,
    /// Whether the action serves the terminal knot, which has no next state.
    terminal: bool,
    fault: Fault,
}

/// Adds the names of the function and the knot to an error message about a result of wrong type or size.
pub(super) fn named(py: Python<'_>, function: &str, knots: &[usize], error: PyErr) -> PyErr {
    let knot = match knots {
        [t] => format!("knot {t}"),
        [first, .., last] => format!("knots {first} to {last}"),
        [] => String::new(),
    };
    let text = format!("{function} of {knot}: {}", error.value(py));
    let named = if error.is_instance_of::<PyTypeError>(py) {
        PyTypeError::new_err(text)
    } else if error.is_instance_of::<PyValueError>(py) {
        PyValueError::new_err(text)
    } else {
        return error;
    };
    named.set_cause(py, Some(error));
    named
}

impl Own {
    /// Returns the arguments of a call for these knots.
    fn arguments<'py>(&self, py: Python<'py>, knots: &[usize], [xs, us]: [&[f64]; 2]) -> PyResult<Bound<'py, PyTuple>> {
        let (x, u) = (PyArray1::from_slice(py, xs), PyArray1::from_slice(py, us));
        if !self.written.batch {
            return (knots[0], x, u).into_pyobject(py);
        }
        let t = PyArray1::from_iter(py, knots.iter().map(|t| *t as i64));
        let rows = knots.len();
        let shaped = |of: Bound<'py, PyArray1<f64>>, columns: usize| of.call_method1("reshape", (rows, columns));
        (t, shaped(x, self.written.space.nx())?, shaped(u, self.written.nu)?).into_pyobject(py)
    }

    fn try_calc(
        &self,
        py: Python<'_>,
        knots: &[usize],
        at: [&[f64]; 2],
        next: &mut [f64],
        costs: &mut [f64],
    ) -> PyResult<()> {
        let result = self.written.functions.call(py, 0, self.arguments(py, knots, at)?)?;
        let mut read = || {
            let (state, cost) = next_and_cost(&result)?;
            let (nx, rows) = (self.written.space.nx(), knots.len());
            match state.is_none() {
                false if self.written.batch => {
                    next.copy_from_slice(&matrix("the next states", &state, [rows, nx])?);
                }
                false => next.copy_from_slice(&vector("the next state", &state, nx)?),
                true if self.terminal => {}
                true => {
                    return Err(PyValueError::new_err(format!("the next state: expected {nx} numbers, found None")));
                }
            }
            if self.written.batch {
                costs.copy_from_slice(&vector("the costs", &cost, rows)?);
            } else {
                costs[0] = cost.extract().map_err(|_| {
                    let found = cost.get_type();
                    PyTypeError::new_err(format!("the cost: expected a number, found {found}"))
                })?;
            }
            Ok(())
        };
        read().map_err(|error| named(py, "calc", knots, error))
    }

    fn try_calc_diff(&self, py: Python<'_>, knots: &[usize], at: [&[f64]; 2], lq_knots: &mut [LqKnot]) -> PyResult<()> {
        let result = self.written.functions.call(py, 1, self.arguments(py, knots, at)?)?;
        let mut read = || {
            let given = result.cast::<PyDict>().map_err(|_| {
                let found = result.get_type();
                PyTypeError::new_err(format!("expected a dict, found {found}"))
            })?;
            for (name, entry) in given.iter() {
                let name: String = name.extract()?;
                if !["A", "B", "Q", "S", "R", "q", "r"].contains(&name.as_str()) {
                    return Err(PyValueError::new_err(format!("expected A, B, Q, S, R, q or r, found '{name}'")));
                }
                for (k, knot) in lq_knots.iter_mut().enumerate() {
                    let entry = if self.written.batch { &entry.get_item(k)? } else { &entry };
                    write(knot, &name, entry)?;
                }
            }
            Ok(())
        };
        read().map_err(|error| named(py, "calc_diff", knots, error))
    }

    /// Writes the derivatives at these knots, unless only central differences can compute them.
    fn try_derivatives(
        &self,
        py: Python<'_>,
        knots: &[usize],
        [xs, us]: [&[f64]; 2],
        lq_knots: &mut [LqKnot],
    ) -> PyResult<bool> {
        let Written { space, nu, functions, batch, way, .. } = &self.written;
        if !functions.has(1) {
            let all = Differentiated { functions, space, nu: *nu, batch: *batch, terminal: self.terminal };
            return all.action(py, way, knots, [xs, us], lq_knots);
        }
        if *batch {
            return self.try_calc_diff(py, knots, [xs, us], lq_knots).map(|()| true);
        }
        let nx = space.nx();
        for (k, t) in knots.iter().enumerate() {
            let at = [&xs[k * nx..][..nx], &us[k * nu..][..*nu]];
            self.try_calc_diff(py, &[*t], at, &mut lq_knots[k..=k])?;
        }
        Ok(true)
    }
}

impl ActionModel for Own {
    fn nx(&self) -> usize {
        self.written.space.nx()
    }

    fn ndx(&self) -> usize {
        self.written.space.ndx()
    }

    fn nu(&self) -> usize {
        self.written.nu
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        self.written.bounds.as_ref().map(|[lower, upper]| (lower.as_slice(), upper.as_slice()))
    }

    fn group_model(&mut self) -> Option<&mut dyn GroupModel> {
        Some(self)
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        let mut cost = [0.0];
        let done = unless_failed(&self.fault, |py| self.try_calc(py, &[t], [x, u], next, &mut cost));
        done.map_or(f64::NAN, |()| cost[0])
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], knot: &mut LqKnot) {
        self.calc_diff_group(&[t], x, u, std::slice::from_mut(knot));
    }

    fn check_state(&self, x: &[f64]) -> Result<(), String> {
        self.written.space.check(x)
    }

    fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64]) {
        self.written.space.integrate(x, dx, out, &self.fault);
    }

    fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64]) {
        self.written.space.difference(x0, x1, out, &self.fault);
    }
}

impl GroupModel for Own {
    /// Returns whether `other` is a copy of the same action. Knots with copies of one action form one group.
    fn is_same(&self, other: &dyn ActionModel) -> bool {
        let other: &dyn Any = other;
        let same = |other: &Self| {
            self.written.functions.are(&other.written.functions)
                && self.written.space.is(&other.written.space)
                && Arc::ptr_eq(&self.fault, &other.fault)
        };
        other.downcast_ref::<Self>().is_some_and(same)
    }

    fn calc_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], next: &mut [f64], costs: &mut [f64]) {
        if self.written.batch {
            let done = unless_failed(&self.fault, |py| self.try_calc(py, knots, [xs, us], next, costs));
            if done.is_none() {
                costs.fill(f64::NAN);
            }
            return;
        }
        let (nx, nu) = (self.nx(), self.nu());
        for (i, &t) in knots.iter().enumerate() {
            costs[i] = self.calc(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut next[i * nx..][..nx]);
        }
    }

    fn calc_diff_group(&mut self, knots: &[usize], xs: &[f64], us: &[f64], lq_knots: &mut [LqKnot]) {
        for knot in lq_knots.iter_mut() {
            for field in [&mut knot.A, &mut knot.B, &mut knot.Q, &mut knot.S, &mut knot.R] {
                field.fill(0.0);
            }
            knot.q.fill(0.0);
            knot.r.fill(0.0);
        }
        match unless_failed(&self.fault, |py| self.try_derivatives(py, knots, [xs, us], lq_knots)) {
            Some(true) => {}
            Some(false) => {
                let (nx, nu, mut by_differences) = (self.nx(), self.nu(), rust::NumDiff(self.clone()));
                for (i, &t) in knots.iter().enumerate() {
                    by_differences.calc_diff(t, &xs[i * nx..][..nx], &us[i * nu..][..nu], &mut lq_knots[i]);
                }
            }
            None => lq_knots.iter_mut().for_each(|knot| knot.q.fill(f64::NAN)),
        }
    }
}
