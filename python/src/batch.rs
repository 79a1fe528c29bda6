//! Calls for many states: arguments and results have one more axis, along which the states are stored.
//!
//! An argument without this axis is shared by all states. Functions that the library computes in SIMD lanes release the
//! interpreter's lock. These functions compute groups of states, which take some milliseconds each, and write directly
//! to the returned arrays. Functions without `Data` are computed state by state, also without the lock. All other
//! functions are called once for each state. Signals are checked between groups and between states.

use crate::arrays::{Expected, Input, check_shape, matrix, members, named, place, writable};
use crate::hyper_dual;
use crate::signals::{self, Signals};
use condyle::{Batch, Force, Scalar, batch::BatchWriter};
use numpy::{Ix2, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyString, PyTuple, PyType};
use std::iter;
use std::ops::{Deref, Range};

/// Properties of an argument that are determined before the argument's numbers are read.
#[derive(Clone, Copy, Default)]
pub(crate) struct Look {
    /// Whether the argument contains hyper-dual numbers.
    pub(crate) dual: bool,
    /// Number of states for which the argument is given. `None` if the argument is given for a single state, or does
    /// not depend on the state.
    pub(crate) states: Option<usize>,
}

/// Inspects an argument that has the given shape for one state.
#[inline]
pub(crate) fn look(name: &str, given: &Bound<'_, PyAny>, shape: &[usize]) -> PyResult<Look> {
    let Ok(array) = given.cast::<PyUntypedArray>() else {
        return Ok(Look { dual: hyper_dual::within(given), states: states(given, shape.len())? });
    };
    let dual = array.dtype().kind() == b'O' && hyper_dual::within(given);
    let found = array.shape();
    if found.len() != shape.len() + 1 {
        return check_shape(name, found, shape).map(|()| Look { dual, states: None });
    }
    if found[1..] != *shape {
        return Err(Expected::States(shape).error(name, found));
    }
    Ok(Look { dual, states: Some(found[0]) })
}

/// Returns the number of states for which an argument is given; `None` for a single state, where the argument has
/// `axes` axes.
fn states(given: &Bound<'_, PyAny>, axes: usize) -> PyResult<Option<usize>> {
    if let Ok(array) = given.cast::<PyUntypedArray>() {
        return Ok((array.ndim() == axes + 1).then(|| array.shape()[0]));
    }
    if given.get_item(0).and_then(|first| first.len()).is_err() {
        return Ok(None); // a vector of numbers belongs to one state
    }
    let shape = given.py().import("numpy")?.call_method1("shape", (given,)).and_then(|shape| shape.extract::<Vec<_>>());
    // if NumPy found no shape, the function that reads the argument reports the error later
    Ok(shape.ok().filter(|shape| shape.len() == axes + 1).map(|shape| shape[0]))
}

/// Returns the number of states of a call; `None` if all arguments are given for a single state. Arguments with
/// different numbers of states are an error.
pub(crate) fn agreed(arguments: &[(&str, Look)]) -> PyResult<Option<usize>> {
    let mut all = arguments.iter().filter_map(|(name, look)| Some((name, look.states?)));
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

/// Returns the numbers of an argument for one state. An argument without an axis for states is returned unchanged.
pub(crate) fn at<'py>(given: &Bound<'py, PyAny>, axes: usize, state: Option<usize>) -> PyResult<Bound<'py, PyAny>> {
    match state {
        Some(k) if states(given, axes)?.is_some() => given.get_item(k),
        _ => Ok(given.clone()),
    }
}

/// Reads an argument for all states, `length` numbers per state; an argument for a single state is repeated.
pub(crate) fn all<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    axes: usize,
    states: usize,
    length: usize,
) -> PyResult<Input<'py, Ix2>> {
    let is_of_states = self::states(given, axes)?.is_some();
    if is_of_states && axes == 1 {
        return matrix(name, given, [states, length]);
    }
    let numpy = given.py().import("numpy")?;
    if is_of_states {
        let flat = numpy.call_method1("reshape", (given, (states, -1)))?;
        return matrix(name, &flat, [states, length]);
    }
    let flat = numpy.call_method1("ravel", (given,))?;
    matrix(name, &numpy.call_method1("broadcast_to", (flat, (states, length)))?, [states, length])
}

/// Converts numbers to forces, six numbers for each body and state.
pub(crate) fn forces<S: Scalar>(numbers: &[S]) -> Vec<Force<S>> {
    numbers.as_chunks::<6>().0.iter().map(|&six| six.into()).collect()
}

/// Stacks the results of all states into one array, or into one tuple of arrays.
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
    let names = match first.getattr("_fields") {
        Ok(fields) => fields.extract()?,
        Err(_) => (0..tuple.len()).map(|k| k.to_string()).collect::<Vec<_>>(),
    };
    let out = members(out, &names.iter().map(String::as_str).collect::<Vec<_>>())?;
    let member = |k: usize| {
        let parts = results.iter().map(|r| r.get_item(k)).collect::<PyResult<Vec<_>>>()?;
        stack(py, parts, out.get(k).and_then(Option::as_ref))
    };
    let members = PyTuple::new(py, (0..tuple.len()).map(member).collect::<PyResult<Vec<_>>>()?)?;
    match first.get_type().getattr("_make") {
        Ok(make) => make.call1((members,)),
        Err(_) => Ok(members.into_any()),
    }
}

/// The numbers of an argument for all states, state by state.
pub(crate) enum Rows<'py> {
    /// The numbers in the caller's array, without a copy.
    Array(Input<'py, Ix2>),
    /// A copy of the caller's numbers, because results may be written over the argument.
    Copy(Vec<f64>),
}

impl Deref for Rows<'_> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        match self {
            Self::Array(input) => input,
            Self::Copy(numbers) => numbers,
        }
    }
}

/// The Python type of the results of a function that is computed in SIMD lanes.
#[derive(Clone, Copy)]
pub(crate) enum Kind {
    /// A single array.
    One,
    /// The derivatives of an acceleration with respect to q and v, as two arrays.
    Pair,
    /// A named tuple of this class.
    Named(&'static str),
    /// The result of `compute_all_terms`, which contains another named tuple.
    AllTerms,
}

impl Kind {
    /// Combines the computed arrays into the object that the Python function returns.
    fn assembled<'py>(self, py: Python<'py>, mut arrays: Vec<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        match self {
            Self::One => Ok(arrays.remove(0)),
            Self::Pair => Ok(PyTuple::new(py, arrays)?.into_any()),
            Self::Named(class) => named(&class_of(py, class)?, PyTuple::new(py, arrays)?),
            Self::AllTerms => {
                let centroidal = arrays.drain(2..9).collect();
                arrays.insert(2, Self::Named("CentroidalMapRate").assembled(py, centroidal)?);
                Self::Named("AllTerms").assembled(py, arrays)
            }
        }
    }

    /// Returns the caller's arrays in `out`, to which the results are written. Without `out`, no entry of the returned
    /// list is an array.
    fn places<'py>(self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Vec<Option<Bound<'py, PyAny>>>> {
        match self {
            Self::One => Ok(vec![out.cloned()]),
            Self::Pair => members(out, &["da_dq", "da_dv"]),
            Self::Named(class) if out.is_some() => {
                let names: Vec<Bound<'py, PyString>> =
                    class_of(py, class)?.getattr(intern!(py, "_fields"))?.extract()?;
                members(out, &names.iter().map(|name| name.to_str()).collect::<PyResult<Vec<_>>>()?)
            }
            Self::Named(_) | Self::AllTerms => Ok(Vec::new()),
        }
    }
}

/// Returns the class of named tuples with this name in `condyle._types`.
fn class_of<'py>(py: Python<'py>, class: &str) -> PyResult<Bound<'py, PyType>> {
    static TYPES: PyOnceLock<Py<PyModule>> = PyOnceLock::new();
    let types = TYPES.get_or_try_init(py, || PyResult::Ok(py.import("condyle._types")?.unbind()))?;
    Ok(types.bind(py).getattr(class)?.cast_into()?)
}

/// Maximum number of states that each thread computes between two checks for signals.
pub(crate) const MOST_STATES: usize = 2048;

/// Returns the number of states in a part, which is the unit of work of a thread. `numbers` is the size of the results
/// per state. The computation of a part takes up to a millisecond, and its start a third of a microsecond. A part fills
/// at least two SIMD registers.
fn part_size(numbers: usize) -> usize {
    const NUMBERS: usize = 1 << 18;
    (NUMBERS / numbers.max(1)).next_multiple_of(16).clamp(16, MOST_STATES)
}

/// Returns an argument's numbers for the states with indices in the range `some`.
pub(crate) fn part<'a, T>(of: &'a [T], some: &Range<usize>, states: usize) -> &'a [T] {
    let each = of.len() / states;
    &of[some.start * each..some.end * each]
}

/// Computes all states in parts, with the interpreter's lock released, into `out` or new arrays. If a signal stops the
/// computation, `out` holds the states computed so far.
pub(crate) fn run<'py>(
    py: Python<'py>,
    batch: &mut Batch,
    kind: Kind,
    states: usize,
    out: Option<&Bound<'py, PyAny>>,
    mut compute: impl FnMut(&mut BatchWriter<'_, '_, f64>, Range<usize>) + Send,
) -> PyResult<Bound<'py, PyAny>> {
    compute(&mut batch.writer(&mut []), 0..0); // a call without states finds the shapes of the results
    let shapes: Vec<Vec<usize>> = batch.last_shapes().map(<[_]>::to_vec).collect();
    let mut given = kind.places(py, out)?.into_iter().chain(iter::repeat(None));
    let sizes: Vec<usize> = shapes.iter().map(|shape| shape.iter().product()).collect();
    let mut arrays = Vec::new();
    for shape in &shapes {
        let shape = iter::once(states).chain(shape.iter().copied()).collect::<Vec<_>>();
        arrays.push(place(py, given.next().flatten().as_ref(), &shape)?);
    }
    let mut borrowed = arrays.iter().map(writable).collect::<PyResult<Vec<_>>>()?;
    let mut numbers = borrowed.iter_mut().map(|array| Ok(array.as_slice_mut()?)).collect::<PyResult<Vec<_>>>()?;
    let mut signals = Signals::new(signals::SHORT);
    py.detach(|| {
        let step = batch.capacity().min(part_size(sizes.iter().sum()) * batch.threads());
        for from in (0..states).step_by(step) {
            let some = from..states.min(from + step);
            let places = numbers.iter_mut().zip(&sizes).map(|(to, size)| &mut to[some.start * size..some.end * size]);
            compute(&mut batch.writer(&mut places.collect::<Vec<_>>()), some);
            if signals.go_on().is_break() {
                return;
            }
        }
    });
    signals.finish()?;
    drop(borrowed);
    match (kind, out) {
        (Kind::One, Some(out)) => Ok(out.clone()),
        _ => kind.assembled(py, arrays.into_iter().map(Bound::into_any).collect()),
    }
}

/// Computes all states one by one, with the interpreter's lock released, into `out` or a new array.
pub(crate) fn each<'py>(
    py: Python<'py>,
    states: usize,
    shape: &[usize],
    out: Option<&Bound<'py, PyAny>>,
    mut compute: impl FnMut(usize, &mut [f64]) + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let (size, all) = (shape.iter().product::<usize>(), iter::once(states).chain(shape.iter().copied()));
    let array = place(py, out, &all.collect::<Vec<_>>())?;
    let mut borrowed = writable(&array)?;
    let numbers = borrowed.as_slice_mut()?;
    let mut signals = Signals::new(signals::SHORT);
    py.detach(|| {
        for k in 0..states {
            compute(k, &mut numbers[k * size..(k + 1) * size]);
            if signals.go_on().is_break() {
                return;
            }
        }
    });
    signals.finish()?;
    drop(borrowed);
    Ok(out.cloned().unwrap_or_else(|| array.into_any()))
}
