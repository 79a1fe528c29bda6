//! Many states in one call: arguments with one axis more, for the states, and results likewise.
//!
//! An argument without that axis is shared by all states. What the library computes in lanes goes there in parts of some
//! milliseconds, with the interpreter's lock released, and each part is written to the arrays that the caller gets;
//! everything else is called state after state. Between parts and states signals are looked at.

use crate::arrays::{Expected, Input, check_shape, matrix, members, named, place, writable};
use crate::hyper_dual;
use crate::signals::{self, Signals};
use condyle::{Batch, BatchAbaDerivatives, BatchRneaDerivatives, Force, Matrices, Scalar};
use numpy::{Ix2, PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::iter;
use std::ops::{Deref, Range};

/// What a call wants to know of an argument before it reads it.
#[derive(Clone, Copy, Default)]
pub(crate) struct Look {
    /// Whether it contains hyper-dual numbers.
    pub(crate) dual: bool,
    /// The number of states that it is given for; none if it is given for a single one, or is no part of a state.
    pub(crate) states: Option<usize>,
}

/// Looks at an argument that has some shape for one state.
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

/// The number of states of an argument that has `axes` of them for a single one: none if it is given for a single one.
fn states(given: &Bound<'_, PyAny>, axes: usize) -> PyResult<Option<usize>> {
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

/// The numbers of an argument for all states, one state after the other.
pub(crate) enum Rows<'py> {
    /// The numbers as they lie in the caller's array.
    Array(Input<'py, Ix2>),
    /// Copied, where results may be written over them.
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

/// The results of a function that computes in lanes: the named tuple of a single state, if they are several, and for each
/// its name and its axes of length nv beside that of the states.
pub(crate) struct Kind {
    class: Option<&'static str>,
    members: &'static [(&'static str, u32)],
}

pub(crate) const VECTOR: Kind = Kind { class: None, members: &[("out", 1)] };
pub(crate) const MATRIX: Kind = Kind { class: None, members: &[("out", 2)] };
pub(crate) const RNEA_DERIVATIVES: Kind =
    Kind { class: Some("RneaDerivatives"), members: &[("dtau_dq", 2), ("dtau_dv", 2), ("dtau_da", 2)] };
pub(crate) const ABA_DERIVATIVES: Kind =
    Kind { class: Some("AbaDerivatives"), members: &[("a", 1), ("da_dq", 2), ("da_dv", 2), ("da_dtau", 2)] };

/// The results of some states, which know how to write themselves.
pub(crate) trait Results {
    /// Writes each result in C order.
    fn write(&self, to: &mut [&mut [f64]]);
}

impl Results for &[f64] {
    fn write(&self, to: &mut [&mut [f64]]) {
        to[0].copy_from_slice(&self[..to[0].len()]);
    }
}

impl Results for Matrices<'_, f64> {
    fn write(&self, to: &mut [&mut [f64]]) {
        self.write_rows(to[0]);
    }
}

impl Results for BatchRneaDerivatives<'_, f64> {
    fn write(&self, to: &mut [&mut [f64]]) {
        [self.dtau_dq, self.dtau_dv, self.dtau_da]
            .iter()
            .zip(to.chunks_exact_mut(1))
            .for_each(|(x, to)| Results::write(x, to));
    }
}

impl Results for BatchAbaDerivatives<'_, f64> {
    fn write(&self, to: &mut [&mut [f64]]) {
        let (a, to) = to.split_at_mut(1);
        Results::write(&self.a, a);
        [self.da_dq, self.da_dv, self.da_dtau]
            .iter()
            .zip(to.chunks_exact_mut(1))
            .for_each(|(x, to)| Results::write(x, to));
    }
}

/// The number of states of a part, at most: the three matrices nv × nv of each are in a processor's own cache, of a megabyte,
/// when they are written to the caller's arrays; a part takes some hundred microseconds. Each thread has two registers
/// full at least.
pub(crate) fn part_size(nv: usize, threads: usize) -> usize {
    const NUMBERS: usize = 1 << 15;
    (NUMBERS / (nv * nv).max(64)).next_multiple_of(16).max(16) * threads
}

/// An argument's numbers for some of all states.
pub(crate) fn part<'a, T>(of: &'a [T], some: &Range<usize>, states: usize) -> &'a [T] {
    let each = of.len() / states;
    &of[some.start * each..some.end * each]
}

/// Computes all states part after part, with the interpreter's lock released, to `out` or to new arrays. If a signal ends
/// it, `out` is written as far as it came.
pub(crate) fn run<'py>(
    py: Python<'py>,
    batch: &mut Batch,
    kind: &Kind,
    (nv, states): (usize, usize),
    out: Option<&Bound<'py, PyAny>>,
    mut compute: impl FnMut(&mut Batch, Range<usize>, &mut [&mut [f64]]) + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let names: Vec<_> = kind.members.iter().map(|(name, _)| *name).collect();
    let given = match kind.class {
        None => vec![out.cloned()],
        Some(_) => members(out, &names)?,
    };
    let mut given = given.into_iter().chain(iter::repeat(None));
    let sizes: Vec<usize> = kind.members.iter().map(|(_, axes)| nv.pow(*axes)).collect();
    let mut arrays = Vec::new();
    for (_, axes) in kind.members {
        let shape = iter::once(states).chain(iter::repeat_n(nv, *axes as usize)).collect::<Vec<_>>();
        arrays.push(place(py, given.next().flatten().as_ref(), &shape)?);
    }
    let mut borrowed = arrays.iter().map(writable).collect::<PyResult<Vec<_>>>()?;
    let mut numbers = borrowed.iter_mut().map(|array| Ok(array.as_slice_mut()?)).collect::<PyResult<Vec<_>>>()?;
    let mut signals = Signals::new(signals::SHORT);
    py.detach(|| {
        let step = batch.capacity();
        for from in (0..states).step_by(step) {
            let some = from..states.min(from + step);
            let places = numbers.iter_mut().zip(&sizes);
            let mut to: Vec<_> = places.map(|(x, size)| &mut x[some.start * size..some.end * size]).collect();
            compute(batch, some, &mut to);
            if signals.go_on().is_break() {
                return;
            }
        }
    });
    signals.finish()?;
    drop(borrowed);
    match kind.class {
        None => Ok(out.cloned().unwrap_or_else(|| arrays.remove(0).into_any())),
        Some(class) => {
            let class = py.import("condyle._types")?.getattr(class)?.cast_into()?;
            named(&class, PyTuple::new(py, arrays)?)
        }
    }
}
