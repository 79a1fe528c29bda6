//! NumPy arrays in and out.
//!
//! In: a float64 C-contiguous array is read where it lies; other dtypes and strides are converted; a wrong shape is a
//! `ValueError`. Out: a new array, or the caller's. Matrices are column-major in nalgebra and row-major here. Arrays of
//! hyper-dual numbers are arrays of objects, see `hyper_dual.rs`.

use condyle::{Force, Inertia, Mat3, Motion, Scalar, Se3, Vec3};
use nalgebra::{DMatrix, Dim, Matrix, RawStorage};
use numpy::ndarray::Dimension;
use numpy::{
    Element, Ix1, Ix2, Ix3, PyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArray, PyReadwriteArrayDyn, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use std::fmt::Write;
use std::ops::{Deref, Range};

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

/// An argument with three indices.
pub(crate) fn tensor<'py>(argument: &str, value: &Bound<'py, PyAny>, shape: [usize; 3]) -> PyResult<Input<'py, Ix3>> {
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
    if !"biuf".contains(kind) && array.len() > 0 {
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
    let array = place(py, out, shape)?;
    let mut numbers = writable(&array)?;
    fill(numbers.as_slice_mut()?);
    drop(numbers);
    Ok(out.cloned().unwrap_or_else(|| array.into_any()))
}

/// So many numbers and more are asked of NumPy in a way that can fail.
const LARGE: usize = 1 << 24;

/// An array in C order to be filled: the caller's, if it has the shape, or a new one.
pub(crate) fn place<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let Some(out) = out else {
        if shape.iter().try_fold(1, |size: usize, n| size.checked_mul(*n)).is_some_and(|size| size < LARGE) {
            return Ok(PyArray::<f64, _>::zeros(py, shape, false));
        }
        return Ok(py.import("numpy")?.call_method1("zeros", (shape.to_vec(),))?.cast_into()?); // or a `MemoryError`
    };
    let wanted = || format!("expected a writable C-contiguous float64 array of shape {}", tuple(shape));
    let array = out
        .cast::<PyUntypedArray>()
        .map_err(|_| PyTypeError::new_err(format!("out: {}, found {}", wanted(), type_name(out))))?;
    check_shape("out", array.shape(), shape)?;
    let double = out.cast::<PyArrayDyn<f64>>().ok().filter(|a| a.is_c_contiguous() && a.is_aligned());
    let other = || {
        let (dtype, strides) = (array.dtype(), array.strides());
        PyValueError::new_err(format!("out: {}, found dtype {dtype} and strides {strides:?}", wanted()))
    };
    Ok(double.ok_or_else(other)?.clone())
}

/// The numbers of an array, to be written.
pub(crate) fn writable<'py>(array: &Bound<'py, PyArrayDyn<f64>>) -> PyResult<PyReadwriteArrayDyn<'py, f64>> {
    array.try_readwrite().map_err(|error| PyValueError::new_err(format!("out: {error}")))
}

fn type_name(value: &Bound<'_, PyAny>) -> String {
    value.get_type().name().map_or_else(|_| "?".to_owned(), |name| name.to_string())
}

/// An array, as Python will see it.
pub(crate) trait Array {
    /// The type of its numbers.
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

/// A matrix: column-major in Rust, row-major in Python.
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

/// Rows of one length.
impl<S: Number, const N: usize> Array for [[S; N]] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.len(), N]
    }
    fn write(&self, x: &mut [S]) {
        x.copy_from_slice(self.as_flattened());
    }
}

/// A matrix that is stored by columns.
impl<S: Number> Array for Mat3<S> {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [3, 3]
    }
    fn write(&self, x: &mut [S]) {
        let Self { x: a, y: b, z: c } = self;
        x.copy_from_slice(&[a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z]);
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

/// The inertia of a whole robot about its centre of mass, [m 1, 0; 0, Ī].
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

/// Types that are a row of numbers.
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

/// A value that a function can return: an array, a number, or a tuple of them.
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

/// The derivatives of an acceleration by q and by v.
impl<S: Number> Give for (DMatrix<S>, DMatrix<S>) {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let mut out = members(out, &["da_dq", "da_dv"])?.into_iter();
        let mut give = |matrix: &DMatrix<S>| matrix.give(py, out.next().flatten().as_ref());
        Ok((give(&self.0)?, give(&self.1)?).into_pyobject(py)?.into_any())
    }
}

/// A class of `condyle._types`, or of another module, looked up once.
macro_rules! class {
    ($py:expr, $name:expr) => {
        $crate::arrays::class!($py, "condyle._types", $name)
    };
    ($py:expr, $module:expr, $name:expr) => {{
        static CLASS: pyo3::sync::PyOnceLock<Py<pyo3::types::PyType>> = pyo3::sync::PyOnceLock::new();
        CLASS.import($py, $module, $name)
    }};
}
pub(crate) use class;

/// A named tuple of `condyle._types`, made of members that are given by name, in those of `out` if there is one.
macro_rules! give_named {
    ($py:ident, $out:ident, $class:expr, { $($name:expr => $member:expr),* }) => {{
        let mut out = $crate::arrays::members($out, &[$($name),*])?.into_iter();
        let members = [$($member.give($py, out.next().flatten().as_ref())?),*];
        $crate::arrays::class!($py, $class)?.call1(pyo3::types::PyTuple::new($py, members)?)
    }};
}
pub(crate) use give_named;

/// Implementations of `Give` for structs of the library: each becomes the named tuple of the same name, with the
/// members that stand here, some of them under other names.
macro_rules! named_tuples {
    (@name $member:ident) => { stringify!($member) };
    (@name $member:ident as $name:ident) => { stringify!($name) };
    ($($type:ident $(<$life:lifetime>)? { $($member:ident $(as $name:ident)?),* })*) => {$(
        impl<S: $crate::arrays::Number + $crate::arrays::Give> $crate::arrays::Give for condyle::$type<$($life,)? S> {
            fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
                $crate::arrays::give_named!(py, out, stringify!($type), {
                    $($crate::arrays::named_tuples!(@name $member $(as $name)?) => self.$member),*
                })
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
    let members = out.try_iter()?.collect::<PyResult<Vec<_>>>()?;
    if members.len() != names.len() {
        let (expected, names, found) = (names.len(), names.join(", "), members.len());
        return Err(PyValueError::new_err(format!("out: expected {expected} arrays ({names}), found {found}")));
    }
    let places: Vec<_> = members.iter().map(memory).collect();
    for (k, one) in places.iter().enumerate() {
        if let Some(other) = places[..k].iter().position(|other| one.start < other.end && other.start < one.end) {
            let (other, one) = (names[other], names[k]);
            return Err(PyValueError::new_err(format!("out: the arrays for {other} and {one} share memory")));
        }
    }
    Ok(members.into_iter().map(Some).collect())
}

/// The addresses of the numbers of a C-contiguous array of doubles; none of anything else, which is refused later.
fn memory(array: &Bound<'_, PyAny>) -> Range<usize> {
    let Ok(array) = array.cast::<PyArrayDyn<f64>>() else { return 0..0 };
    let start = array.data().addr();
    start..start + array.len() * size_of::<f64>()
}

/// A pose that is given as a homogeneous 4 × 4 matrix.
pub(crate) fn pose(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Se3<f64>> {
    let m = matrix(argument, value, [4, 4])?;
    let column = |c: usize| [m[c], m[4 + c], m[8 + c]].into();
    Ok(Se3::new(Mat3 { x: column(0), y: column(1), z: column(2) }, column(3)))
}

/// The numbers of a vector of length N.
pub(crate) fn array<const N: usize>(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let x = vector(argument, value, N)?;
    Ok(core::array::from_fn(|k| x[k]))
}

/// Three numbers.
pub(crate) fn three(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec3<f64>> {
    Ok(array::<3>(argument, value)?.into())
}

/// A rotation that is given as a 3 × 3 matrix.
pub(crate) fn rotation(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Mat3<f64>> {
    let m = matrix(argument, value, [3, 3])?;
    let column = |c: usize| [m[c], m[3 + c], m[6 + c]].into();
    Ok(Mat3 { x: column(0), y: column(1), z: column(2) })
}

/// The numbers of a vector of any length.
pub(crate) fn numbers(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let length = value.len().map_err(|_| PyValueError::new_err(format!("{argument}: expected a list of numbers")))?;
    Ok(vector(argument, value, length)?.to_vec())
}

/// Least and greatest values of some numbers, infinite where none is given; none if neither is given.
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
