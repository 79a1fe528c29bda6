//! NumPy arrays in and out.
//!
//! In: a float64 C-contiguous array is read where it lies; other dtypes and strides are converted; a wrong shape is a
//! `ValueError`. Out: a new array, or the caller's. Matrices are column-major in nalgebra and row-major here.

use condyle::{Mat3, Se3, Vec3};
use nalgebra::DMatrix;
use numpy::ndarray::Dimension;
use numpy::{Element, Ix1, Ix2, PyArray, PyArrayMethods, PyReadonlyArray, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use std::fmt::Write;
use std::ops::Deref;

/// The numbers of an argument, in C order.
pub(crate) struct Input<'py, D: Dimension>(PyReadonlyArray<'py, f64, D>);

impl<D: Dimension> Deref for Input<'_, D> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        self.0.as_slice().expect("was made contiguous and aligned")
    }
}

/// A vector argument of `length` numbers.
pub(crate) fn vector<'py>(argument: &str, value: &Bound<'py, PyAny>, length: usize) -> PyResult<Input<'py, Ix1>> {
    input(argument, value, &[length])
}

/// A matrix argument.
pub(crate) fn matrix<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<Input<'py, Ix2>> {
    input(argument, value, &shape)
}

fn input<'py, D: Dimension>(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Input<'py, D>> {
    if let Ok(array) = value.cast::<PyArray<f64, D>>()
        && array.is_c_contiguous()
        && array.is_aligned()
    {
        check_shape(argument, array.shape(), shape)?;
        return Ok(Input(array.try_readonly()?));
    }
    let array = convert(argument, value, shape)?;
    Ok(Input(array.cast_into::<PyArray<f64, D>>()?.try_readonly()?))
}

/// A new float64 C-contiguous array with the numbers of anything that NumPy understands as an array of them.
#[cold]
fn convert<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("asarray", (value,)).map_err(|error| {
        if !error.is_instance_of::<PyValueError>(py) {
            return error;
        }
        let named = PyValueError::new_err(format!("{argument}: {}", error.value(py)));
        named.set_cause(py, Some(error));
        named
    })?;
    let array = array.cast_into::<PyUntypedArray>()?;
    let dtype = array.dtype();
    let kind: char = dtype.getattr("kind")?.extract()?;
    if !"biuf".contains(kind) {
        return Err(PyTypeError::new_err(format!("{argument}: expected real numbers, found dtype {dtype}")));
    }
    check_shape(argument, array.shape(), shape)?;
    array.call_method1("astype", (f64::get_dtype(py), "C"))
}

fn check_shape(argument: &str, found: &[usize], expected: &[usize]) -> PyResult<()> {
    if found == expected {
        return Ok(());
    }
    let (expected, found) = (tuple(expected), tuple(found));
    Err(PyValueError::new_err(format!("{argument}: expected shape {expected}, found {found}")))
}

/// A shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    let mut text = String::from("(");
    for (i, n) in shape.iter().enumerate() {
        let _ = write!(text, "{}{n}", if i == 0 { "" } else { ", " });
    }
    text.push_str(if shape.len() == 1 { ",)" } else { ")" });
    text
}

/// Fills an array in C order, the caller's or a new one, and returns it.
pub(crate) fn output<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    let array = match out {
        None => PyArray::<f64, _>::zeros(py, shape, false),
        Some(out) => {
            let wanted = || format!("expected a writable C-contiguous float64 array of shape {}", tuple(shape));
            let array = out
                .cast::<PyUntypedArray>()
                .map_err(|_| PyTypeError::new_err(format!("out: {}, found {}", wanted(), type_name(out))))?;
            check_shape("out", array.shape(), shape)?;
            let double = out.cast::<numpy::PyArrayDyn<f64>>().ok().filter(|a| a.is_c_contiguous() && a.is_aligned());
            let other = || {
                PyValueError::new_err(format!(
                    "out: {}, found dtype {} and strides {:?}",
                    wanted(),
                    array.dtype(),
                    array.strides()
                ))
            };
            double.ok_or_else(other)?.clone()
        }
    };
    let mut numbers = array.try_readwrite().map_err(|error| PyValueError::new_err(format!("out: {error}")))?;
    fill(numbers.as_slice_mut()?);
    drop(numbers);
    Ok(out.cloned().unwrap_or_else(|| array.into_any()))
}

fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string())
}

/// Gives a vector out.
pub(crate) fn give<'py>(
    py: Python<'py>,
    numbers: &[f64],
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    output(py, out, &[numbers.len()], |x| x.copy_from_slice(numbers))
}

/// Gives a matrix out.
pub(crate) fn give_matrix<'py>(
    py: Python<'py>,
    matrix: &DMatrix<f64>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    let (rows, columns) = matrix.shape();
    output(py, out, &[rows, columns], |x| {
        for (c, column) in matrix.as_slice().chunks_exact(rows.max(1)).enumerate() {
            for (r, &number) in column.iter().enumerate() {
                x[r * columns + c] = number;
            }
        }
    })
}

/// Writes a pose as a homogeneous 4 × 4 matrix, row by row.
pub(crate) fn write_pose(X: &Se3<f64>, out: &mut [f64]) {
    let Mat3 { x, y, z } = X.rotation;
    let p = X.translation;
    out.copy_from_slice(&[
        x.x, y.x, z.x, p.x, //
        x.y, y.y, z.y, p.y, //
        x.z, y.z, z.z, p.z, //
        0.0, 0.0, 0.0, 1.0,
    ]);
}

/// Gives a pose out.
pub(crate) fn give_pose<'py>(
    py: Python<'py>,
    X: &Se3<f64>,
    out: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyAny>> {
    output(py, out, &[4, 4], |x| write_pose(X, x))
}

/// Gives the rows of a small matrix out.
pub(crate) fn give_rows<'py, const N: usize>(py: Python<'py>, rows: [Vec3<f64>; N]) -> PyResult<Bound<'py, PyAny>> {
    output(py, None, &[N, 3], |x| x.as_chunks_mut().0.iter_mut().zip(rows).for_each(|(x, row)| *x = row.to_array()))
}

/// One of the named tuples of `condyle._types`.
pub(crate) fn named_tuple<'py>(
    py: Python<'py>,
    lock: &'static PyOnceLock<Py<PyType>>,
    name: &str,
) -> PyResult<&'py Bound<'py, PyType>> {
    lock.import(py, "condyle._types", name)
}
