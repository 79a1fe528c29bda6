//! Makes arrays that are returned to Python.

use super::Number;
use super::input::{check_shape, tuple, type_name};
use condyle::{Force, Inertia, Motion, Se3, Vec3, spatial::Mat3};
use nalgebra::{DMatrix, Dim, Matrix, RawStorage};
use numpy::{
    BorrowError, PyArray, PyArrayDyn, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyTuple, PyType};
use std::marker::PhantomData;
use std::ops::Range;

/// Fills the caller's array `out`, or a new array of zeros in C order, and returns the array.
pub(crate) fn output<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    let array = place(py, out, shape)?;
    match out {
        Some(out) => {
            fill(writable(&array)?.as_slice_mut()?);
            Ok(out.clone())
        }
        None => Ok(filled(array, fill)),
    }
}

/// Fills the caller's array `out`, or a new array in C order, and returns the array. `fill` must set all numbers.
pub(super) fn set<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]),
) -> PyResult<Bound<'py, PyAny>> {
    if out.is_some() || !is_small(shape) {
        return output(py, out, shape, fill);
    }
    // SAFETY: any bit pattern in the memory from NumPy is a valid f64, and all numbers are set before the array is
    // returned.
    #[allow(unsafe_code)]
    let array = unsafe { PyArray::<f64, _>::new(py, shape, false) };
    Ok(filled(array, fill))
}

/// Fills a new array in C order, and returns the array.
fn filled<'py>(array: Bound<'py, PyArrayDyn<f64>>, fill: impl FnOnce(&mut [f64])) -> Bound<'py, PyAny> {
    // SAFETY: no other code has a reference to the array yet, and its `len` numbers are contiguous.
    #[allow(unsafe_code)]
    let numbers = unsafe { core::slice::from_raw_parts_mut(array.data(), array.len()) };
    fill(numbers);
    array.into_any()
}

/// Minimum number of elements of a large array. A large array is allocated by a call of NumPy that can raise
/// `MemoryError`.
const LARGE: usize = 1 << 24;

/// Returns whether an array of this shape has fewer than `LARGE` elements. The allocation of such a small array is
/// assumed to succeed.
fn is_small(shape: &[usize]) -> bool {
    shape.iter().try_fold(1, |size: usize, n| size.checked_mul(*n)).is_some_and(|size| size < LARGE)
}

/// Returns an array in C order for a result: the caller's array, whose shape is checked, or a new array.
pub(crate) fn place<'py>(
    py: Python<'py>,
    out: Option<&Bound<'py, PyAny>>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let Some(out) = out else {
        if is_small(shape) {
            return Ok(PyArray::<f64, _>::zeros(py, shape, false));
        }
        // this call raises `MemoryError` if the array is too large
        return Ok(py.import("numpy")?.call_method1("zeros", (shape.to_vec(),))?.cast_into()?);
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

/// Borrows the numbers of an array for writing.
pub(crate) fn writable<'py>(array: &Bound<'py, PyArrayDyn<f64>>) -> PyResult<PyReadwriteArrayDyn<'py, f64>> {
    array.try_readwrite().map_err(|error| {
        PyValueError::new_err(match error {
            BorrowError::NotWriteable => "out: expected a writable array, found a read-only one".to_owned(),
            BorrowError::AlreadyBorrowed | _ => format!("out: {error}"),
        })
    })
}

/// An array that is returned to Python.
pub(crate) trait Array {
    /// Type of the array's numbers.
    type Number: Number;
    /// Returns the array's shape.
    fn shape(&self) -> impl AsRef<[usize]>;
    /// Writes the array's numbers to `x` in C order.
    fn write(&self, x: &mut [Self::Number]);
    /// Returns the array's numbers without a copy if the array is a vector; otherwise `None`.
    fn vector(&self) -> Option<&[Self::Number]> {
        None
    }
}

impl<S: Number> Array for [S] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.len()]
    }
    fn write(&self, x: &mut [S]) {
        x.copy_from_slice(self);
    }
    fn vector(&self) -> Option<&[S]> {
        Some(self)
    }
}

/// A matrix: column-major in Rust, row-major in Python.
impl<N: Number, R: Dim, C: Dim, S: RawStorage<N, R, C>> Array for Matrix<N, R, C, S> {
    type Number = N;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.nrows(), self.ncols()]
    }
    fn write(&self, x: &mut [N]) {
        let (rows, columns) = self.shape();
        if self.strides() == (1, rows) && !self.is_empty() {
            // SAFETY: the strides show that the matrix consists of rows × columns contiguous numbers.
            #[allow(unsafe_code)]
            let numbers = unsafe { core::slice::from_raw_parts(self.as_ptr(), rows * columns) };
            return transpose(numbers, rows, columns, x);
        }
        for (c, column) in self.column_iter().enumerate() {
            for (r, &number) in column.iter().enumerate() {
                x[r * columns + c] = number;
            }
        }
    }
}

/// A symmetric matrix. The columns of the matrix are written as rows of the result. Row k and column k of the matrix
/// differ only by rounding errors.
pub(crate) struct Symmetric<'a, N>(pub(crate) &'a condyle::spatial::Matrix<N>);

impl<N: Number> Array for Symmetric<'_, N> {
    type Number = N;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.0.nrows(), self.0.ncols()]
    }
    fn write(&self, x: &mut [N]) {
        x.copy_from_slice(self.0.as_slice());
    }
}

/// Returns the four numbers of `from` that begin at index `at`.
#[inline(always)]
fn four<N: Copy>(from: &[N], at: usize) -> [N; 4] {
    *from[at..].first_chunk().expect("a matrix has as many")
}

/// Sets the four numbers of `to` that begin at index `at`.
#[inline(always)]
fn set_four<N>(to: &mut [N], at: usize, numbers: [N; 4]) {
    *to[at..].first_chunk_mut().expect("a row has as many") = numbers;
}

/// Transposes a matrix that is stored by columns, and writes the result row by row, in tiles of 4 × 4. A tile is read
/// and written with a few instructions. If numbers were written one by one, each write would touch another cache line.
fn transpose<N: Number>(from: &[N], rows: usize, columns: usize, to: &mut [N]) {
    assert!(from.len() == rows * columns && to.len() == rows * columns, "as many numbers as a matrix has");
    let mut r = 0;
    while r + 4 <= rows {
        let (first, others) = to[r * columns..(r + 4) * columns].split_at_mut(columns);
        let (second, others) = others.split_at_mut(columns);
        let (third, fourth) = others.split_at_mut(columns);
        let mut c = 0;
        while c + 4 <= columns {
            let (a, b) = (four(from, c * rows + r), four(from, (c + 1) * rows + r));
            let (d, e) = (four(from, (c + 2) * rows + r), four(from, (c + 3) * rows + r));
            set_four(first, c, [a[0], b[0], d[0], e[0]]);
            set_four(second, c, [a[1], b[1], d[1], e[1]]);
            set_four(third, c, [a[2], b[2], d[2], e[2]]);
            set_four(fourth, c, [a[3], b[3], d[3], e[3]]);
            c += 4;
        }
        while c < columns {
            let column = four(from, c * rows + r);
            [first[c], second[c], third[c], fourth[c]] = column;
            c += 1;
        }
        r += 4;
    }
    while r < rows {
        let to = &mut to[r * columns..(r + 1) * columns];
        for c in 0..columns {
            to[c] = from[c * rows + r];
        }
        r += 1;
    }
}

/// A pose, written as a homogeneous matrix.
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

/// A matrix, given as rows of equal length.
impl<S: Number, const N: usize> Array for [[S; N]] {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [self.len(), N]
    }
    fn write(&self, x: &mut [S]) {
        x.copy_from_slice(self.as_flattened());
    }
}

/// A 3 × 3 matrix, stored by columns.
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

/// The poses of bodies, written as one homogeneous matrix for each body.
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

/// The inertia of a whole robot about its centre of mass: the 6 × 6 matrix [m 1, 0; 0, Ī] with the mass m and the
/// rotational inertia Ī.
impl<S: Number> Array for Inertia<S> {
    type Number = S;
    fn shape(&self) -> impl AsRef<[usize]> {
        [6, 6]
    }
    fn write(&self, x: &mut [S]) {
        x.fill(S::zero());
        for (k, column) in self.rotational.full().columns().into_iter().enumerate() {
            x[7 * k] = self.mass;
            x[6 * (3 + k) + 3..6 * (4 + k)].copy_from_slice(&column.to_array()); // symmetric matrix
        }
    }
}

/// Implements `Array` for types that consist of N numbers and become vectors.
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

/// A result that a function can return: an array, a number, or a tuple of them.
pub(crate) trait Give {
    /// Returns the result to Python, in the caller's `out` if it is given.
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>>;
}

impl<T: Array + ?Sized> Give for T {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        if let (None, Some(numbers)) = (out, self.vector())
            && let Some(array) = T::Number::new_vector(py, numbers)
        {
            return Ok(array);
        }
        T::Number::output(py, out, self.shape().as_ref(), |x| self.write(x))
    }
}

/// An array that is computed directly in its destination, in C order.
pub(crate) struct Computed<S, F, const AXES: usize> {
    shape: [usize; AXES],
    fill: F,
    number: PhantomData<S>,
}

impl<S: Number, F: Fn(&mut [S]), const AXES: usize> Computed<S, F, AXES> {
    /// Creates an array of this shape; `fill` sets all its numbers.
    pub(crate) fn new(shape: [usize; AXES], fill: F) -> Self {
        Self { shape, fill, number: PhantomData }
    }
}

impl<S: Number, F: Fn(&mut [S]), const AXES: usize> Give for Computed<S, F, AXES> {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        if out.is_none() {
            return S::output(py, None, &self.shape, &self.fill);
        }
        // the numbers are first computed in a separate buffer, because `out` may also be an input of the computation
        let mut numbers = vec![S::zero(); self.shape.iter().product()];
        (self.fill)(&mut numbers);
        S::output(py, out, &self.shape, |x| x.copy_from_slice(&numbers))
    }
}

impl Give for f64 {
    fn give<'py>(&self, py: Python<'py>, _: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        Ok(PyFloat::new(py, *self).into_any())
    }
}

/// The derivatives of an acceleration with respect to q and v, returned as a tuple of two arrays.
impl<S: Number> Give for (DMatrix<S>, DMatrix<S>) {
    fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let mut out = members(out, &["da_dq", "da_dv"])?.into_iter();
        let mut give = |matrix: &DMatrix<S>| matrix.give(py, out.next().flatten().as_ref());
        Ok((give(&self.0)?, give(&self.1)?).into_pyobject(py)?.into_any())
    }
}

/// Looks up a class of `condyle._types`, or of another module, on the first call, and stores the class.
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

/// Creates a named tuple of a class. The class's `__new__` is not called, because it is Python code and therefore
/// slower.
pub(crate) fn named<'py>(class: &Bound<'py, PyType>, members: Bound<'py, PyTuple>) -> PyResult<Bound<'py, PyAny>> {
    static NEW: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = class.py();
    let new = NEW.get_or_try_init(py, || PyResult::Ok(py.get_type::<PyTuple>().getattr("__new__")?.unbind()))?;
    new.bind(py).call1((class, members))
}

/// Creates a named tuple of `condyle._types` from members given by name. The members are written to the arrays of `out`
/// if it is given.
macro_rules! give_named {
    ($py:ident, $out:ident, $class:expr, { $($name:expr => $member:expr),* }) => {{
        let mut out = $crate::arrays::members($out, &[$($name),*])?.into_iter();
        let members = [$($member.give($py, out.next().flatten().as_ref())?),*];
        $crate::arrays::named($crate::arrays::class!($py, $class)?, pyo3::types::PyTuple::new($py, members)?)
    }};
}
pub(crate) use give_named;

/// Implements `Give` for structs of the library: each struct becomes the named tuple of the same name. The arguments of
/// the macro list the members; some members have another name than in Rust.
macro_rules! named_tuples {
    (@name $member:ident) => { stringify!($member) };
    (@name $member:ident as $name:ident) => { stringify!($name) };
    ($($type:ident $(<$life:lifetime>)? { $($member:ident $(as $name:ident)?),* })*) => {$(
        impl<S: $crate::arrays::Number + $crate::arrays::Give> $crate::arrays::Give
            for condyle::dynamics::$type<$($life,)? S>
        {
            fn give<'py>(&self, py: Python<'py>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
                $crate::arrays::give_named!(py, out, stringify!($type), {
                    $($crate::arrays::named_tuples!(@name $member $(as $name)?) => self.$member),*
                })
            }
        }
    )*};
}
pub(crate) use named_tuples;

/// Returns the arrays in `out` for a function with several results; the list is empty if `out` is not given.
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

/// Returns the ranges of addresses to which the results of a batch are written.
pub(crate) fn destinations(out: Option<&Bound<'_, PyAny>>) -> Vec<Range<usize>> {
    let Some(out) = out else { return Vec::new() };
    if out.is_instance_of::<PyUntypedArray>() {
        return vec![memory(out)];
    }
    out.try_iter().map_or_else(|_| Vec::new(), |members| members.flatten().map(|one| memory(&one)).collect())
}

/// Returns the range of addresses of a C-contiguous float64 array. The range is empty for all other objects, which
/// cause an error later.
fn memory(array: &Bound<'_, PyAny>) -> Range<usize> {
    let Ok(array) = array.cast::<PyArrayDyn<f64>>() else { return 0..0 };
    let start = array.data().addr();
    start..start + array.len() * size_of::<f64>()
}
