//! Many states in one call: arguments with one axis more, for the states, and results likewise.
//!
//! An argument without that axis is shared by all states. What the library computes in lanes goes there at once, with
//! the interpreter's lock released, and its result is a `PerState`; everything else is called state after state.

use crate::arrays::{Array, Give, Input, give_named, matrix, output};
use condyle::{BatchAbaDerivatives, BatchRneaDerivatives, Force, Matrices, Scalar};
use numpy::{Ix2, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The number of states of an argument that has `axes` of them for a single one: none if it is given for a single one.
pub(crate) fn states(given: &Bound<'_, PyAny>, axes: usize) -> PyResult<Option<usize>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        return Ok((array.ndim() == axes + 1).then(|| array.shape()[0]));
    }
    if given.get_item(0).and_then(|first| first.len()).is_err() {
        return Ok(None); // numbers
    }
    let shape = given.py().import("numpy")?.call_method1("shape", (given,)).and_then(|shape| shape.extract::<Vec<_>>());
    // whoever reads it says what is wrong with it
    Ok(shape.ok().filter(|shape| shape.len() == axes + 1).map(|shape| shape[0]))
}

/// The number of states that a call is for, from what its arguments are given for; none if all are given for a single
/// one.
pub(crate) fn agreed(arguments: &[(&str, Option<usize>)]) -> PyResult<Option<usize>> {
    let mut all = arguments.iter().filter_map(|(name, states)| Some((name, (*states)?)));
    let Some((first, n)) = all.next() else { return Ok(None) };
    if n == 0 {
        return Err(PyValueError::new_err(format!("{first}: expected at least one state, found none")));
    }
    match all.find(|(_, states)| *states != n) {
        None => Ok(Some(n)),
        Some((name, found)) => {
            Err(PyValueError::new_err(format!("{name}: expected {n} states, as many as {first} has, found {found}")))
        }
    }
}

/// An argument for one state.
pub(crate) fn at<'py>(given: &Bound<'py, PyAny>, axes: usize, state: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
    match state {
        Some(k) if states(given, axes)?.is_some() => given.get_item(k),
        _ => Ok(given.clone()),
    }
}

/// An argument for each of some states, `length` numbers a state.
pub(crate) fn all<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    axes: usize,
    states: usize,
    length: usize,
) -> PyResult<Input<'py, Ix2>> {
    let numpy = given.py().import("numpy")?;
    if self::states(given, axes)?.is_some() {
        if axes == 1 {
            return matrix(name, given, [states, length]);
        }
        let flat = numpy.call_method1("reshape", (given, (states, -1)))?;
        return matrix(name, &flat, [states, length]);
    }
    let flat = numpy.call_method1("ravel", (given,))?;
    matrix(name, &numpy.call_method1("broadcast_to", (flat, (states, length)))?, [states, length])
}

/// A force on each body for each state.
pub(crate) fn forces<S: Scalar>(numbers: &[S]) -> Vec<Force<S>> {
    numbers.as_chunks::<6>().0.iter().map(|&six| six.into()).collect()
}

/// The results for all states as one array or tuple, from those for each state.
pub(crate) fn stack<'py>(
    py: Python<'py>,
    results: Vec<Bound<'py, PyAny>>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let numpy = py.import("numpy")?;
    let first = &results[0];
    let Ok(tuple) = first.cast::<PyTuple>() else {
        let options = PyDict::new(py);
        options.set_item("out", out)?;
        return numpy.call_method("stack", (results,), Some(&options));
    };
    let out: Vec<Option<Bound<'py, PyAny>>> = match out {
        None => vec![None; tuple.len()],
        Some(out) => out.try_iter()?.map(|x| x.map(Some)).collect::<PyResult<_>>()?,
    };
    let member = |k: usize| {
        let members = results.iter().map(|r| r.get_item(k)).collect::<PyResult<Vec<_>>>()?;
        stack(py, members, out.get(k).and_then(Option::as_ref))
    };
    let members = PyTuple::new(py, (0..tuple.len()).map(member).collect::<PyResult<Vec<_>>>()?)?;
    match first.get_type().getattr("_make") {
        Ok(make) => make.call1((members,)),
        Err(_) => Ok(members.into_any()),
    }
}

/// The result of a batch of the library, for so many states.
pub(crate) struct PerState<T> {
    pub(crate) result: T,
    pub(crate) states: usize,
}

impl Give for PerState<&[f64]> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let shape = [self.states, self.result.len() / self.states.max(1)];
        output(py, out, &shape, |x| x.copy_from_slice(self.result))
    }
}

impl Give for PerState<Matrices<'_, f64>> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let n = self.result.iter().next().map_or(0, |matrix| matrix.nrows());
        output(py, out, &[self.states, n, n], |x| {
            self.result.iter().zip(x.chunks_exact_mut((n * n).max(1))).for_each(|(matrix, x)| matrix.write(x));
        })
    }
}

/// Implementations of `Give` for results of several members, as the named tuple of a single state.
macro_rules! per_state {
    ($($batch:ident as $class:literal { $($member:ident),* })*) => {$(
        impl Give for PerState<$batch<'_, f64>> {
            fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
                let Self { result, states } = self;
                give_named!(py, out, $class, {
                    $(stringify!($member) => PerState { result: result.$member, states: *states }),*
                })
            }
        }
    )*};
}
per_state! {
    BatchRneaDerivatives as "RneaDerivatives" { dtau_dq, dtau_dv, dtau_da }
    BatchAbaDerivatives as "AbaDerivatives" { a, da_dq, da_dv, da_dtau }
}
