//! Reads arrays that Python passes as arguments.

use condyle::{Se3, Vec3, spatial::Mat3};
use nalgebra::DMatrix;
use numpy::ndarray::Dimension;
use numpy::npyffi::{NPY_ARRAY_ALIGNED, NPY_ARRAY_C_CONTIGUOUS, PyArrayObject};
use numpy::{
    Element, Ix1, Ix2, Ix3, PyArray, PyArrayDescr, PyArrayMethods, PyReadonlyArray, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::{PyTypeInfo, ffi};
use std::ffi::c_int;
use std::fmt::{self, Display};
use std::ops::Deref;

/// The f64 numbers of an argument, in C order. While an `Input` exists, other Rust code that uses NumPy cannot write to
/// the array.
pub(crate) struct Input<'py, D: Dimension>(PyReadonlyArray<'py, f64, D>);

impl<D: Dimension> Deref for Input<'_, D> {
    type Target = [f64];
    fn deref(&self) -> &[f64] {
        self.0.as_slice().expect("was made contiguous and aligned")
    }
}

impl Input<'_, Ix2> {
    /// Copies the array's numbers to a matrix of nalgebra, in column-major order.
    pub(crate) fn to_matrix(&self) -> DMatrix<f64> {
        let &[rows, columns] = self.0.shape() else { unreachable!("has two dimensions") };
        DMatrix::from_row_slice(rows, columns, self)
    }
}

/// The f64 numbers of an argument, in C order, for calls that keep the interpreter's lock. The borrow of the array is
/// not registered with the crate `numpy`, because the registration takes as long as the dynamics of a small robot.
pub(crate) enum InPlace<'py, D: Dimension> {
    /// An array of NumPy, kept alive by this reference.
    Array(Bound<'py, PyArray<f64, D>>),
    /// The address and the count of an argument's f64 numbers. The call must use these numbers before it runs any
    /// Python code.
    AtOnce(*const f64, usize),
}

impl<'py, D: Dimension> InPlace<'py, D> {
    pub(super) fn read(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Self> {
        as_it_lies_or_converted(argument, value, shape).map(Self::Array)
    }
}

#[allow(unsafe_code)]
impl<D: Dimension> Deref for InPlace<'_, D> {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        // SAFETY: this code holds the interpreter's lock and runs no Python code, so no other code writes to the array
        // or moves it. An argument stays alive until the call returns.
        unsafe {
            match *self {
                Self::AtOnce(numbers, count) => core::slice::from_raw_parts(numbers, count),
                Self::Array(ref array) => array.as_slice().expect("was made contiguous and aligned"),
            }
        }
    }
}

/// Returns the numbers of a float64 array with this shape in C order; `None` for all other objects. Runs no Python
/// code.
#[inline(always)]
#[allow(unsafe_code)]
pub(crate) fn at_once<'py, D: Dimension>(value: &Bound<'py, PyAny>, shape: &[usize]) -> Option<InPlace<'py, D>> {
    static DOUBLE: PyOnceLock<Py<PyArrayDescr>> = PyOnceLock::new();
    const PLAIN: c_int = NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED;
    let double = DOUBLE.get_or_init(value.py(), || f64::get_dtype(value.py()).unbind()).as_ptr();
    // SAFETY: an object of exactly this type is an array of NumPy, and its field `nd` is the number of its dimensions.
    unsafe {
        if ffi::Py_TYPE(value.as_ptr()) != PyUntypedArray::type_object_raw(value.py()) {
            return None;
        }
        let array = &(*value.as_ptr().cast::<PyArrayObject>()).fields;
        if array.descr.cast::<ffi::PyObject>() != double
            || array.flags & PLAIN != PLAIN
            || array.nd as usize != shape.len()
        {
            return None;
        }
        let mut count = 1;
        for (k, &expected) in shape.iter().enumerate() {
            if *array.dimensions.add(k) as usize != expected {
                return None;
            }
            count *= expected;
        }
        Some(InPlace::AtOnce(array.data.cast::<f64>().cast_const(), count))
    }
}

/// Reads an argument for a call that keeps the interpreter's lock, and runs no Python code before it has used the
/// numbers. Allocates nothing if the argument is a float64 array in C order.
pub(crate) fn in_place<'py, D: Dimension>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    shape: &[usize],
) -> PyResult<InPlace<'py, D>> {
    match at_once(value, shape) {
        Some(numbers) => Ok(numbers),
        None => InPlace::read(argument, value, shape),
    }
}

/// Reads a vector argument of `length` numbers.
pub(crate) fn vector<'py>(argument: &str, value: &Bound<'py, PyAny>, length: usize) -> PyResult<Input<'py, Ix1>> {
    input(argument, value, &[length])
}

/// Reads a matrix argument.
pub(crate) fn matrix<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: [usize; 2]) -> PyResult<Input<'py, Ix2>> {
    input(argument, value, &shape)
}

/// Reads an argument with three axes.
pub(crate) fn tensor<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: [usize; 3]) -> PyResult<Input<'py, Ix3>> {
    input(argument, value, &shape)
}

fn input<'py, D: Dimension>(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Input<'py, D>> {
    Ok(Input(as_it_lies_or_converted(argument, value, shape)?.try_readonly()?))
}

/// Returns the argument itself if the argument is a float64 array in C order, else a new array with the same numbers.
#[inline]
fn as_it_lies_or_converted<'py, D: Dimension>(
    argument: &str,
    value: &Bound<'py, PyAny>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArray<f64, D>>> {
    if let Ok(array) = value.cast::<PyArray<f64, D>>()
        && array.is_c_contiguous()
        && array.is_aligned()
    {
        check_shape(argument, array.shape(), shape)?;
        return Ok(array.clone());
    }
    Ok(convert(argument, value, shape)?.cast_into::<PyArray<f64, D>>()?)
}

/// Converts any object from which NumPy can make an array of numbers to a new float64 C-contiguous array.
#[cold]
fn convert<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Bound<'py, PyAny>> {
    let py = value.py();
    if value.is_none() {
        let shape = Expected::Shape(shape);
        return Err(PyTypeError::new_err(format!("{argument}: expected real numbers of {shape}, found None")));
    }
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
    if !"biuf".contains(kind) && array.len() > 0 {
        return Err(PyTypeError::new_err(format!("{argument}: expected real numbers, found dtype {dtype}")));
    }
    check_shape(argument, array.shape(), shape)?;
    array.call_method1("astype", (f64::get_dtype(py), "C"))
}

/// The expected shape of an argument, for error messages.
pub(crate) enum Expected<'a> {
    /// The only accepted shape.
    Shape(&'a [usize]),
    /// The accepted shape for one state. For many states, the shape has an additional first axis.
    States(&'a [usize]),
}

impl Display for Expected<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Shape(shape) => write!(f, "shape {}", tuple(shape)),
            Self::States(shape) => write!(f, "shape {}, or (N, {}) for N states", tuple(shape), list(shape)),
        }
    }
}

impl Expected<'_> {
    /// Returns the error for an argument whose shape `found` is not the expected shape.
    #[cold]
    pub(crate) fn error(&self, argument: &str, found: &[usize]) -> PyErr {
        let (Self::Shape(shape) | Self::States(shape)) = self;
        let column = matches!((*shape, found), ([n], [rows, 1]) if rows == n);
        let hint = if column { ", a column: give x.ravel()" } else { "" };
        PyValueError::new_err(format!("{argument}: expected {self}, found {}{hint}", tuple(found)))
    }
}

pub(crate) fn check_shape(argument: &str, found: &[usize], expected: &[usize]) -> PyResult<()> {
    if found == expected { Ok(()) } else { Err(Expected::Shape(expected).error(argument, found)) }
}

/// Formats a shape as Python does.
pub(super) fn tuple(shape: &[usize]) -> String {
    if let [n] = shape { format!("({n},)") } else { format!("({})", list(shape)) }
}

/// Formats the sizes of a shape, separated by commas.
fn list(shape: &[usize]) -> String {
    shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

/// Returns the name of a value's type.
pub(crate) fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string())
}

/// Returns the name of a value's type with an article, such as `an int`, for error messages.
pub(crate) fn found_type(value: &Bound<'_, PyAny>) -> String {
    let name = type_name(value);
    let article = if name.starts_with(['a', 'e', 'i', 'o', 'u', 'A', 'E', 'I', 'O']) { "an" } else { "a" };
    format!("{article} {name}")
}

/// Reads a pose, given as a homogeneous 4 × 4 matrix.
pub(crate) fn pose(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Se3<f64>> {
    let m = matrix(argument, value, [4, 4])?;
    check_last_row(argument, &m[12..])?;
    let column = |c: usize| [m[c], m[4 + c], m[8 + c]].into();
    Ok(Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3)))
}

/// Largest rounding error in the last row of a pose.
const LAST_ROW: f64 = 1e-9;

/// Returns an error unless the last row of a pose is (0, 0, 0, 1).
pub(crate) fn check_last_row(argument: &str, row: &[f64]) -> PyResult<()> {
    let is_near = |(x, expected): (&f64, f64)| (x - expected).abs() <= LAST_ROW;
    match row.iter().zip([0.0, 0.0, 0.0, 1.0]).all(is_near) {
        true => Ok(()),
        false => Err(PyValueError::new_err(format!("{argument}: expected the last row (0, 0, 0, 1), found {row:?}"))),
    }
}

/// Reads a vector of N numbers.
pub(crate) fn array<const N: usize>(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let x = vector(argument, value, N)?;
    Ok(core::array::from_fn(|k| x[k]))
}

/// Reads a vector of three numbers.
pub(crate) fn three(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3<f64>> {
    Ok(array::<3>(argument, value)?.into())
}

/// Reads a rotation, given as a 3 × 3 matrix.
pub(crate) fn rotation(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Mat3<f64>> {
    let m = matrix(argument, value, [3, 3])?;
    let column = |c: usize| [m[c], m[3 + c], m[6 + c]].into();
    Ok(Mat3 { x: column(0), y: column(1), z: column(2) })
}

/// Reads a vector of any length.
pub(crate) fn numbers(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let length = value.len().map_err(|_| PyValueError::new_err(format!("{argument}: expected a list of numbers")))?;
    Ok(vector(argument, value, length)?.to_vec())
}

/// Reads lower and upper bounds. If only one bound is given, the other bound is infinite. If no bound is given, returns
/// `None`.
pub(crate) fn bounds(
    length: usize,
    lower: Option<&Bound<'_, PyAny>>,
    upper: Option<&Bound<'_, PyAny>>,
) -> PyResult<Option<[Vec<f64>; 2]>> {
    if lower.is_none() && upper.is_none() {
        return Ok(None);
    }
    let bound = |name, given: Option<&Bound<'_, PyAny>>, none| match given {
        Some(numbers) => PyResult::Ok(vector(name, numbers, length)?.to_vec()),
        None => Ok(vec![none; length]),
    };
    Ok(Some([bound("lower", lower, f64::NEG_INFINITY)?, bound("upper", upper, f64::INFINITY)?]))
}
