//! NumPy arrays as arguments and results.
//!
//! Arguments (`input`): a float64 C-contiguous array is read without a copy; other dtypes and strides are converted; a
//! wrong shape is a `ValueError`. Results (`output`) are written to a new array, or to the caller's `out`. Matrices are
//! column-major in nalgebra and row-major in NumPy. Arrays of hyper-dual numbers are arrays of objects, see
//! `hyper_dual.rs`. The attributes of a model are read-only arrays, see `read_only`.

mod input;
mod output;
mod read_only;

pub(crate) use input::{
    Expected, Input, array, at_once, bounds, check_last_row, check_shape, found_type, in_place, matrix, numbers, pose,
    rotation, tensor, three, vector,
};
pub(crate) use output::{
    Array, Computed, Give, Symmetric, class, destinations, give_named, members, named, named_tuples, output, place,
    writable,
};
pub(crate) use read_only::read_only;

use condyle::Scalar;
use numpy::PyArray1;
use numpy::ndarray::Dimension;
use pyo3::prelude::*;
use std::ops::Deref;

/// A scalar type that the library's functions accept.
pub(crate) trait Number: Scalar {
    /// The numbers of an argument, in C order, for a call that keeps the interpreter's lock.
    type Input<'py, D: Dimension>: Deref<Target = [Self]>;

    /// Reads an argument of the given shape.
    fn read<'py, D: Dimension>(
        argument: &str,
        value: &Bound<'py, PyAny>,
        shape: &[usize],
    ) -> PyResult<Self::Input<'py, D>>;
    /// Returns the number without its derivatives.
    fn real(&self) -> f64;
    /// Reads an argument that is a single number.
    fn read_one(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Self>;
    /// Fills the caller's array `out`, or a new array in C order, and returns the array. `fill` must set all numbers.
    fn output<'py>(
        py: Python<'py>,
        out: Option<&Bound<'py, PyAny>>,
        shape: &[usize],
        fill: impl FnOnce(&mut [Self]),
    ) -> PyResult<Bound<'py, PyAny>>;
    /// Returns a new vector of these numbers if this type has a faster method than `output`; otherwise `None`.
    fn new_vector<'py>(_: Python<'py>, _: &[Self]) -> Option<Bound<'py, PyAny>> {
        None
    }
}

impl Number for f64 {
    type Input<'py, D: Dimension> = input::InPlace<'py, D>;

    fn read<'py, D: Dimension>(
        argument: &str,
        value: &Bound<'py, PyAny>,
        shape: &[usize],
    ) -> PyResult<Self::Input<'py, D>> {
        input::InPlace::read(argument, value, shape)
    }
    fn real(&self) -> f64 {
        *self
    }
    fn read_one(_: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        value.extract()
    }
    fn output<'py>(
        py: Python<'py>,
        out: Option<&Bound<'py, PyAny>>,
        shape: &[usize],
        fill: impl FnOnce(&mut [Self]),
    ) -> PyResult<Bound<'py, PyAny>> {
        output::set(py, out, shape, fill)
    }
    fn new_vector<'py>(py: Python<'py>, numbers: &[Self]) -> Option<Bound<'py, PyAny>> {
        Some(PyArray1::from_slice(py, numbers).into_any())
    }
}
