//! Actions of one's own: given as matrices, or written in Python.

use crate::arrays::{bounds, matrix, vector};
use crate::exceptions::within;
use condyle::optimal as rust;
use nalgebra::DMatrix;
use numpy::PyArray1;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rust::{ActionModel, LqNode};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The most numbers of a state, a control or a constraint: of their matrices there is one for each knot.
const MOST_SIZE: usize = rust::LqNode::MOST_SIZE;

/// The first error that the actions and constraints of a problem which are written in Python raised during a solve. From
/// then on none of them is called.
pub(super) type Fault = Arc<Mutex<Option<PyErr>>>;

/// The functions of an action or a constraint that is written in Python. Its object and its copies in problems share them,
/// and only the object shows them to Python's collector of garbage: a problem shows its objects.
#[derive(Clone)]
struct Functions(Arc<Mutex<[Option<Py<PyAny>>; 2]>>);

impl Functions {
    fn new(calc: Py<PyAny>, calc_diff: Option<Py<PyAny>>) -> Self {
        Self(Arc::new(Mutex::new([Some(calc), calc_diff])))
    }

    /// The functions; the lock is never held while Python runs.
    fn both(&self) -> MutexGuard<'_, [Option<Py<PyAny>>; 2]> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn has_calc_diff(&self) -> bool {
        self.both()[1].is_some()
    }

    /// The result of `calc` at (t, x, u).
    fn calc<'py>(&self, py: Python<'py>, t: usize, x: &[f64], u: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        self.call(py, 0, t, x, u)
    }

    /// The result of `calc_diff` at (t, x, u).
    fn calc_diff<'py>(&self, py: Python<'py>, t: usize, x: &[f64], u: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        self.call(py, 1, t, x, u)
    }

    fn call<'py>(&self, py: Python<'py>, k: usize, t: usize, x: &[f64], u: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let function = self.both()[k].as_ref().map(|f| f.clone_ref(py));
        let gone = || PyRuntimeError::new_err("the action's functions have been collected as garbage");
        function.ok_or_else(gone)?.bind(py).call1((t, PyArray1::from_slice(py, x), PyArray1::from_slice(py, u)))
    }

    fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.both().iter().try_for_each(|function| visit.call(function))
    }

    fn clear(&self) {
        let functions = std::mem::take(&mut *self.both());
        drop(functions); // what they call on their way out must not find the lock held
    }
}

/// An action with linear dynamics and a quadratic cost: x⁺ = A x + B u + f, ½ xᵀQx + xᵀSu + ½ uᵀRu + qᵀx + rᵀu, lower ≤
/// u ≤ upper.
///
/// A, Q: (nx, nx); B, S: (nx, nu); R: (nu, nu); f, q: nx numbers; r, lower, upper: nu. What is None is zero, or no
/// bound; without R and B it has no controls, as at a terminal knot. nx and nu are at most 4096.
///
/// >>> from condyle.optimal import Lqr
/// >>> knot, end = Lqr([[1.0]], B=[[1.0]], Q=[[1.0]], R=[[1.0]]), Lqr([[1.0]], Q=[[1.0]])
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Lqr(pub(super) rust::Lqr);

#[pymethods]
impl Lqr {
    #[new]
    #[pyo3(signature = (A, B=None, f=None, Q=None, S=None, R=None, q=None, r=None, lower=None, upper=None))]
    #[allow(non_snake_case, clippy::too_many_arguments)]
    fn new(
        A: &Bound<'_, PyAny>,
        B: Option<&Bound<'_, PyAny>>,
        f: Option<&Bound<'_, PyAny>>,
        Q: Option<&Bound<'_, PyAny>>,
        S: Option<&Bound<'_, PyAny>>,
        R: Option<&Bound<'_, PyAny>>,
        q: Option<&Bound<'_, PyAny>>,
        r: Option<&Bound<'_, PyAny>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let nx = within("A, rows", A.len()?, 0, MOST_SIZE)?;
        let nu = match (R, B) {
            (Some(R), _) => R.len()?,
            (None, Some(B)) if nx > 0 => B.get_item(0)?.len()?,
            _ => 0,
        };
        within("R, rows, or B, columns", nu, 0, MOST_SIZE)?;
        let mut node = LqNode::zeros(nx, nu);
        let parts = [("B", B), ("f", f), ("Q", Q), ("S", S), ("R", R), ("q", q), ("r", r)];
        for (name, given) in [("A", Some(A)), ("lower", lower), ("upper", upper)].into_iter().chain(parts) {
            given.map_or(Ok(()), |given| write(&mut node, name, given))?;
        }
        Ok(Self(rust::Lqr::new(node)))
    }
}

/// Writes the part of a node that has this name.
fn write(node: &mut LqNode, name: &str, given: &Bound<'_, PyAny>) -> PyResult<()> {
    let LqNode { A, B, Q, S, R, f, q, r, lower, upper, .. } = node;
    let vectors = [("f", f), ("q", q), ("r", r), ("lower", lower), ("upper", upper)];
    let matrices = [("A", A), ("B", B), ("Q", Q), ("S", S), ("R", R)];
    if let Some((_, to)) = vectors.into_iter().find(|(known, _)| *known == name) {
        let length = to.len();
        to.copy_from_slice(&vector(name, given, length)?);
    } else if let Some((_, to)) = matrices.into_iter().find(|(known, _)| *known == name) {
        to.copy_from(&matrix(name, given, to.shape().into())?.to_matrix());
    }
    Ok(())
}

/// An action written in Python.
///
/// nx, nu: the numbers of a state and of a control, at most 4096; nu is 0 at a terminal knot.
/// calc: a function of (t, x, u) that returns the next state and the cost; of the terminal knot, and of no other, the next
///     state may be None.
/// calc_diff: a function of (t, x, u) that returns a dict of what is not zero among A = ∂x⁺/∂x, B = ∂x⁺/∂u,
///     q = ∂ℓ/∂x, r = ∂ℓ/∂u, Q = ∂²ℓ/∂x², S = ∂²ℓ/∂x∂u, R = ∂²ℓ/∂u². Without it, central differences of calc.
/// lower, upper: bounds on the controls, nu numbers each, infinite where there is none; or None.
///
/// >>> from condyle.optimal import Action, Fddp, Problem
/// >>> knot = Action(1, 1, lambda t, x, u: (x + u, 0.5 * (x @ x + u @ u)))
/// >>> end = Action(1, 0, lambda t, x, u: (None, 0.5 * x @ x))
/// >>> problem = Problem([1.0], [knot], [0] * 30, end)
/// >>> round(Fddp(problem).solve(np.zeros((31, 1)), np.zeros((30, 1))).cost, 6)
/// 0.809017
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Action {
    nx: usize,
    nu: usize,
    functions: Functions,
    bounds: Option<[Vec<f64>; 2]>,
}

#[pymethods]
impl Action {
    #[new]
    #[pyo3(signature = (nx, nu, calc, calc_diff=None, lower=None, upper=None))]
    fn new(
        nx: usize,
        nu: usize,
        calc: Py<PyAny>,
        calc_diff: Option<Py<PyAny>>,
        lower: Option<&Bound<'_, PyAny>>,
        upper: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (nx, nu) = (within("nx", nx, 0, MOST_SIZE)?, within("nu", nu, 0, MOST_SIZE)?);
        Ok(Self { nx, nu, functions: Functions::new(calc, calc_diff), bounds: bounds(nu, lower, upper)? })
    }

    fn __traverse__(&self, visit: PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.functions.traverse(&visit)
    }

    fn __clear__(&self) {
        self.functions.clear();
    }
}

impl Action {
    /// A copy for a problem, at the end of the horizon or before it, whose errors go to `fault`.
    pub(super) fn boxed(&self, terminal: bool, fault: &Fault) -> Box<dyn ActionModel> {
        let Self { nx, nu, ref functions, ref bounds } = *self;
        let (functions, bounds, fault) = (functions.clone(), bounds.clone(), fault.clone());
        let differentiated = functions.has_calc_diff();
        let own = Own { terminal, nx, nu, functions, bounds, fault };
        if differentiated { Box::new(own) } else { Box::new(rust::NumDiff(own)) }
    }
}

/// An `Action` as the solver calls it. An error becomes a cost that is not a number, and is raised after the solve.
struct Own {
    /// Whether it serves the end, after which there is no state.
    terminal: bool,
    nx: usize,
    nu: usize,
    functions: Functions,
    bounds: Option<[Vec<f64>; 2]>,
    fault: Fault,
}

/// What a Python function gives, unless it raises an error, which is kept, or one of the problem's has before.
fn unless_failed<T>(fault: &Fault, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> Option<T> {
    let kept = || fault.lock().unwrap_or_else(PoisonError::into_inner);
    if kept().is_some() {
        return None;
    }
    Python::attach(|py| match call(py) {
        Ok(value) => Some(value),
        Err(error) => {
            kept().get_or_insert(error);
            None
        }
    })
}

impl Own {
    fn try_calc(&self, py: Python<'_>, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> PyResult<f64> {
        let (state, cost): (Bound<'_, PyAny>, f64) = self.functions.calc(py, t, x, u)?.extract()?;
        match state.is_none() {
            false => next.copy_from_slice(&vector("the next state", &state, self.nx)?),
            true if self.terminal => {}
            true => {
                let what = format!("the next state of knot {t}: expected {} numbers, found None", self.nx);
                return Err(PyValueError::new_err(what));
            }
        }
        Ok(cost)
    }

    fn try_calc_diff(&self, py: Python<'_>, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) -> PyResult<()> {
        let given = self.functions.calc_diff(py, t, x, u)?.cast_into::<PyDict>()?;
        for (name, entry) in given.iter() {
            let name: String = name.extract()?;
            if !["A", "B", "Q", "S", "R", "q", "r"].contains(&name.as_str()) {
                let what = format!("calc_diff: expected A, B, Q, S, R, q or r, found '{name}'");
                return Err(PyValueError::new_err(what));
            }
            write(node, &name, &entry)?;
        }
        Ok(())
    }
}

impl ActionModel for Own {
    fn nx(&self) -> usize {
        self.nx
    }

    fn nu(&self) -> usize {
        self.nu
    }

    fn bounds(&self, _: usize) -> Option<(&[f64], &[f64])> {
        self.bounds.as_ref().map(|[lower, upper]| (lower.as_slice(), upper.as_slice()))
    }

    fn calc(&mut self, t: usize, x: &[f64], u: &[f64], next: &mut [f64]) -> f64 {
        unless_failed(&self.fault, |py| self.try_calc(py, t, x, u, next)).unwrap_or(f64::NAN)
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], node: &mut LqNode) {
        for field in [&mut node.A, &mut node.B, &mut node.Q, &mut node.S, &mut node.R] {
            field.fill(0.0);
        }
        node.q.fill(0.0);
        node.r.fill(0.0);
        if unless_failed(&self.fault, |py| self.try_calc_diff(py, t, x, u, node)).is_none() {
            node.q.fill(f64::NAN);
        }
    }
}

/// An action of any kind under a constraint lower ≤ g(x, u) ≤ upper, which `AugmentedLagrangian` holds.
///
/// To `Fddp` alone it is a cost for leaving the bounds. For a robot's residuals see `Limit`, which is faster.
///
/// action: the action.
/// size: the number of entries of g, at most 4096.
/// calc: a function of (t, x, u) that returns g; at a terminal knot u is empty.
/// calc_diff: a function of (t, x, u) that returns (∂g/∂x, ∂g/∂u) of shapes (size, ndx) and (size, nu), in the tangent
///     space of the state. Without it, central differences of calc.
/// lower, upper: least and greatest values, infinite where there is none; g = 0 if both are None.
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
    pub(super) action: Py<PyAny>,
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
        Ok(Self { action, functions: Functions::new(calc, calc_diff), bounds })
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
    /// A copy around a copy of its action, whose errors go to `fault`.
    pub(super) fn boxed(&self, action: Box<dyn ActionModel>, fault: &Fault) -> Box<dyn ActionModel> {
        let (functions, columns) = (self.functions.clone(), [action.ndx(), action.nu()]);
        let constraint = Written { functions, bounds: self.bounds.clone(), columns, fault: fault.clone() };
        Box::new(rust::Constrained::new(action, Box::new(constraint)))
    }
}

/// The constraint of a `ConstrainedAction` as the solver calls it. An error becomes a value that is not a number, and
/// is raised after the solve.
struct Written {
    functions: Functions,
    bounds: [Vec<f64>; 2],
    /// The numbers of columns of ∂g/∂x and ∂g/∂u.
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
            let value = self.functions.calc(py, t, x, u)?;
            g.copy_from_slice(&vector("the constraint", &value, g.len())?);
            Ok(())
        });
        if written.is_none() {
            g.fill(f64::NAN);
        }
    }

    fn calc_diff(&mut self, t: usize, x: &[f64], u: &[f64], gx: &mut DMatrix<f64>, gu: &mut DMatrix<f64>) -> bool {
        if !self.functions.has_calc_diff() {
            return false;
        }
        let (size, [ndx, nu]) = (self.bounds[0].len(), self.columns);
        let written = unless_failed(&self.fault, |py| {
            let (by_x, by_u): (Bound<'_, PyAny>, Bound<'_, PyAny>) =
                self.functions.calc_diff(py, t, x, u)?.extract()?;
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
