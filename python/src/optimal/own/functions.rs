//! Python functions of the user, and the errors that they raise during a solve.

use numpy::PyArray1;
use pyo3::call::PyCallArgs;
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::gc::{PyTraverseError, PyVisit};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The first error that an action or a constraint written in Python raises during a solve. After this error, no action
/// or constraint of the problem is called.
pub(in crate::optimal) type Fault = Arc<Mutex<Option<PyErr>>>;

/// Two Python functions, usually `calc` and `calc_diff`, of an action or a constraint. The object and its copies in
/// problems share the functions. Only the object reports the functions to Python's garbage collector; a problem reports
/// the objects.
#[derive(Clone)]
pub(in crate::optimal) struct Functions(Arc<Mutex<[Option<Py<PyAny>>; 2]>>);

/// Compares two pairs of functions. Pairs are equal if they share the same Python functions.
impl PartialEq for Functions {
    fn eq(&self, other: &Self) -> bool {
        self.are(other)
    }
}

impl Functions {
    /// Stores `calc`, and `calc_diff` if it is given.
    pub(in crate::optimal) fn new(calc: Py<PyAny>, calc_diff: Option<Py<PyAny>>) -> PyResult<Self> {
        Self::named(["calc", "calc_diff"], calc, calc_diff)
    }

    /// Stores functions; `names` are the names of the arguments, for errors.
    pub(in crate::optimal) fn named(names: [&str; 2], first: Py<PyAny>, second: Option<Py<PyAny>>) -> PyResult<Self> {
        Python::attach(|py| {
            for (name, given) in names.into_iter().zip([Some(&first), second.as_ref()]) {
                if let Some(given) = given.map(|given| given.bind(py)).filter(|given| !given.is_callable()) {
                    let found = given.repr()?;
                    return Err(PyTypeError::new_err(format!("{name}: expected a function, found {found}")));
                }
            }
            Ok(())
        })?;
        Ok(Self(Arc::new(Mutex::new([Some(first), second]))))
    }

    /// Returns whether both pairs share the same functions.
    pub(in crate::optimal) fn are(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Returns new references to the functions.
    pub(in crate::optimal) fn clones(&self, py: Python<'_>) -> [Option<Py<PyAny>>; 2] {
        self.both().each_ref().map(|function| function.as_ref().map(|function| function.clone_ref(py)))
    }

    /// Locks the functions; the lock is never held while Python code runs.
    fn both(&self) -> MutexGuard<'_, [Option<Py<PyAny>>; 2]> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn has(&self, k: usize) -> bool {
        self.both()[k].is_some()
    }

    /// Calls function k of the pair with the given arguments.
    pub(super) fn call<'py>(
        &self,
        py: Python<'py>,
        k: usize,
        arguments: impl PyCallArgs<'py>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let function = self.both()[k].as_ref().map(|f| f.clone_ref(py));
        let gone = || PyRuntimeError::new_err("the action's functions have been collected as garbage");
        function.ok_or_else(gone)?.bind(py).call1(arguments)
    }

    /// Calls function k of the pair with the arguments (t, x, u).
    pub(super) fn at<'py>(
        &self,
        py: Python<'py>,
        k: usize,
        t: usize,
        x: &[f64],
        u: &[f64],
    ) -> PyResult<Bound<'py, PyAny>> {
        self.call(py, k, (t, PyArray1::from_slice(py, x), PyArray1::from_slice(py, u)))
    }

    pub(in crate::optimal) fn traverse(&self, visit: &PyVisit<'_>) -> Result<(), PyTraverseError> {
        self.both().iter().try_for_each(|function| visit.call(function))
    }

    pub(in crate::optimal) fn clear(&self) {
        let functions = std::mem::take(&mut *self.both());
        drop(functions); // the functions are dropped after the lock is released, since destructors may call Python code
    }
}

/// Returns the result of a Python function. If the function raises an error, stores the error and returns `None`. After
/// the first error of the problem, no function is called.
pub(super) fn unless_failed<T>(fault: &Fault, call: impl FnOnce(Python<'_>) -> PyResult<T>) -> Option<T> {
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
