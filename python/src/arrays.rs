//! NumPy arrays in and out.
//!
//! In: a float64 C-contiguous array is read where it lies; other dtypes and strides are converted; a wrong shape is a
//! `ValueError`. Out: a new array, or the caller's. Matrices are column-major in nalgebra and row-major here. Arrays of
//! hyper-dual numbers are arrays of objects, see `hyper_dual.rs`.

use crate::data::Data;
use condyle::{Force, Inertia, Mat3, Model, Motion, Scalar, Se3, Vec3};
use nalgebra::{DMatrix, Dim, Matrix, RawStorage};
use numpy::ndarray::Dimension;
use numpy::{Element, Ix1, Ix2, PyArray, PyArrayMethods, PyReadonlyArray, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyType};
use std::fmt::Write;
use std::ops::Deref;

/// A number that functions of the library can be called with.
pub(crate) trait Number: Scalar {
    /// The numbers of an argument, in C order.
    type Input<'py, D: Dimension>: Deref<Target = [Self]>;

    /// Reads an argument of some shape.
    fn read<'py, D: Dimension>(
        argument: &str,
        value: &Bound<'py, PyAny>,
        shape: &[usize],
    ) -> PyResult<Self::Input<'py, D>>;
    /// Reads a number.
    fn read_one(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Self>;
    /// Gives an array in C order, the caller's or a new one, when it is filled.
    fn output<'py>(
        py: Python<'py>,
        out: Option<&Bound<'py, PyAny>>,
        shape: &[usize],
        fill: impl FnOnce(&mut [Self]),
    ) -> PyResult<Bound<'py, PyAny>>;
    /// The algorithms' scratch.
    fn scratch<'d>(data: &'d mut Data, model: &Model) -> &'d mut condyle::Data<Self>;
}

impl Number for f64 {
    type Input<'py, D: Dimension> = Input<'py, D>;

    fn read<'py, D: Dimension>(
        argument: &str,
        value: &Bound<'py, PyAny>,
        shape: &[usize],
    ) -> PyResult<Self::Input<'py, D>> {
        input(argument, value, shape)
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
        output(py, out, shape, fill)
    }
    fn scratch<'d>(data: &'d mut Data, _: &Model) -> &'d mut condyle::Data<Self> {
        &mut data.inner
    }
}

/// The doubles of an argument, in C order.
pub(crate) struct Input<'py, D: Dimension>(PyReadonlyArray<'py, f64, D>);

impl<D: Dimension> Deref for Input<'_, D> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        self.0.as_slice().expect("was made contiguous and aligned")
    }
}

impl Input<'_, Ix2> {
    /// The matrix, column by column.
    pub(crate) fn to_matrix(&self) -> DMatrix<f64> {
        let &[rows, columns] = self.0.shape() else { unreachable!("has two dimensions") };
        DMatrix::from_row_slice(rows, columns, self)
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

pub(crate) fn check_shape(argument: &str, found: &[usize], expected: &[usize]) -> PyResult<()> {
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

/// An array, as Python will see it.
pub(crate) trait Array {
    /// What it is made of.
    type Number: Number;
    /// Its shape.
    fn shape(&self) -> impl AsRef<[usize]>;
    /// Writes its numbers in C order.
    fn write(&self, x: &mut [Self::Number]);
}

impl<S: Number> Array for [S] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.len()]
    }
    fn write(&self, x: &mut [S]) {
        x.copy_from_slice(self);
    }
}

/// Column-major in Rust, row-major in Python.
impl<N: Number, R: Dim, C: Dim, S: RawStorage<N, R, C>> Array for Matrix<N, R, C, S> {
    type Number = N;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.nrows(), self.ncols()]
    }
    fn write(&self, x: &mut [N]) {
        let columns = self.ncols();
        for (c, column) in self.column_iter().enumerate() {
            for (r, &number) in column.iter().enumerate() {
                x[r * columns + c] = number;
            }
        }
    }
}

/// A homogeneous matrix.
impl<S: Number> Array for Se3<S> {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [4, 4]
    }
    fn write(&self, out: &mut [S]) {
        let Mat3 { x, y, z } = self.rotation;
        let (p, o, e) = (self.translation, S::zero(), S::one());
        out.copy_from_slice(&[
            x.x, y.x, z.x, p.x, //
            x.y, y.y, z.y, p.y, //
            x.z, y.z, z.z, p.z, //
            o, o, o, e,
        ]);
    }
}

/// Homogeneous matrices, one for each body.
impl<S: Number> Array for [Se3<S>] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.len(), 4, 4]
    }
    fn write(&self, x: &mut [S]) {
        for (X, x) in self.iter().zip(x.chunks_exact_mut(16)) {
            X.write(x);
        }
    }
}

/// [m 1, 0; 0, Ī]: of a whole robot about its centre of mass.
impl<S: Number> Array for Inertia<S> {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [6, 6]
    }
    fn write(&self, x: &mut [S]) {
        x.fill(S::zero());
        for (k, column) in self.rotational.full().columns().into_iter().enumerate() {
            x[7 * k] = self.mass;
            x[6 * (3 + k) + 3..6 * (4 + k)].copy_from_slice(&column.to_array()); // symmetric: a column is a row
        }
    }
}

/// Those that are a row of numbers.
macro_rules! rows {
    ($($type:ident: $n:literal),*) => {$(
        impl<S: Number> Array for $type<S> {
            type Number = S;
            fn shape(&self) -> impl AsRef<[usize]> {
                [$n]
            }
            fn write(&self, x: &mut [S]) {
                x.copy_from_slice(&self.to_array());
            }
        }
    )*};
}
rows!(Vec3: 3, Motion: 6, Force: 6);

/// What a function can return: an array, a number, or a tuple of them.
pub(crate) trait Give {
    /// Gives it to Python, in the caller's `out` if there is one.
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>>;
}

impl<T: Array + ?Sized> Give for T {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        T::Number::output(py, out, self.shape().as_ref(), |x| self.write(x))
    }
}

impl Give for f64 {
    fn give<'py>(&self, py: Python<'py>, _: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        Ok(PyFloat::new(py, *self).into_any())
    }
}

/// A struct of the library as the named tuple of `condyle._types` with the same name and members.
macro_rules! named_tuples {
    ($($type:ident { $($member:ident),* })*) => {$(
        impl<S: $crate::arrays::Number> $crate::arrays::Give for condyle::$type<'_, S>
        where
            S: $crate::arrays::Give,
        {
            fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
                static CLASS: pyo3::sync::PyOnceLock<Py<pyo3::types::PyType>> = pyo3::sync::PyOnceLock::new();
                let names = [$(stringify!($member)),*];
                let mut out = $crate::arrays::members(out, &names)?.into_iter();
                let members = [$(self.$member.give(py, out.next().flatten().as_ref())?),*];
                let members = pyo3::types::PyTuple::new(py, members)?;
                $crate::arrays::named_tuple(py, &CLASS, stringify!($type))?.call1(members)
            }
        }
    )*};
}
pub(crate) use named_tuples;

/// The members of `out` of a function that returns several arrays, or none of them.
pub(crate) fn members<'py>(
    out: Option<&Bound<'py, PyAny>>,
    names: &[&str],
) -> PyResult<Vec<Option<Bound<'py, PyAny>>>> {
    let Some(out) = out else { return Ok(Vec::new()) };
    let members = out.try_iter()?.map(|x| x.map(Some)).collect::<PyResult<Vec<_>>>()?;
    if members.len() == names.len() {
        return Ok(members);
    }
    let (expected, names, found) = (names.len(), names.join(", "), members.len());
    Err(PyValueError::new_err(format!("out: expected {expected} arrays ({names}), found {found}")))
}

/// A pose that is given as a homogeneous 4 × 4 matrix.
pub(crate) fn pose(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Se3<f64>> {
    let m = matrix(argument, value, [4, 4])?;
    let column = |c: usize| [m[c], m[4 + c], m[8 + c]].into();
    Ok(Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3)))
}

/// Three numbers.
pub(crate) fn three(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3<f64>> {
    let x = vector(argument, value, 3)?;
    Ok(Vec3::new(x[0], x[1], x[2]))
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
