//! The class `HyperDual`: hyper-dual numbers as Python objects. NumPy stores them in arrays of objects.

use crate::arrays::{Give, Number, check_shape};
use condyle::Scalar;
use core::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use num_dual::{DualNum, HyperDual64};
use numpy::ndarray::Dimension;
use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::CompareOp;

/// A hyper-dual number for the library's computations. Its operations are not inlined, because the library's functions
/// contain thousands of operations and would become very long. Little speed is lost: most of the time is spent on
/// creating and reading Python objects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Hyper(HyperDual64);

impl Hyper {
    /// Returns a number that changes in the first direction at the rate 1.
    pub(crate) fn first(x: f64) -> Self {
        Self(HyperDual64::new(x, 1.0, 0.0, 0.0))
    }
    /// Returns a number that changes in the second direction at the rate 1.
    pub(crate) fn second(x: f64) -> Self {
        Self(HyperDual64::new(x, 0.0, 1.0, 0.0))
    }
    /// Returns a number that changes in the two directions at the given rates.
    pub(crate) fn with(x: f64, [first, second]: [f64; 2]) -> Self {
        Self(HyperDual64::new(x, first, second, 0.0))
    }
    /// Returns the number without derivatives.
    pub(crate) fn value(self) -> f64 {
        self.0.re
    }
    /// Returns the mixed second derivative in the two directions.
    pub(crate) fn curvature(self) -> f64 {
        self.0.eps1eps2
    }
    /// Returns the derivatives in the two directions.
    pub(crate) fn slopes(self) -> [f64; 2] {
        [self.0.eps1, self.0.eps2]
    }
}

macro_rules! operators {
    ($($trait:ident $name:ident),*; $($assign:ident $assign_name:ident $operator:tt),*) => {
        $(impl $trait for Hyper {
            type Output = Self;
            #[inline(never)]
            fn $name(self, other: Self) -> Self {
                Self(self.0.$name(other.0))
            }
        })*
        $(impl $assign for Hyper {
            #[inline]
            fn $assign_name(&mut self, other: Self) {
                *self = *self $operator other;
            }
        })*
    };
}
operators!(Add add, Sub sub, Mul mul, Div div; AddAssign add_assign +, SubAssign sub_assign -);

impl Neg for Hyper {
    type Output = Self;
    #[inline(never)]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}

impl Scalar for Hyper {
    type Mask = bool;
    const LANES: usize = 1;

    fn splat(x: f64) -> Self {
        Self(x.into())
    }
    #[inline(never)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Self(self.0 * b.0 + c.0)
    }
    fn recip(self) -> Self {
        Self(Scalar::recip(self.0))
    }
    fn sqrt(self) -> Self {
        Self(Scalar::sqrt(self.0))
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Scalar::sin_cos(self.0);
        (Self(sin), Self(cos))
    }
    fn atan2(self, x: Self) -> Self {
        Self(Scalar::atan2(self.0, x.0))
    }
    fn abs(self) -> Self {
        Self(Scalar::abs(self.0))
    }
    fn lt(self, other: Self) -> bool {
        Scalar::lt(self.0, other.0)
    }
    fn select(mask: bool, a: Self, b: Self) -> Self {
        if mask { a } else { b }
    }
    fn and(a: bool, b: bool) -> bool {
        a && b
    }
    fn or(a: bool, b: bool) -> bool {
        a || b
    }
}

/// A hyper-dual number re + eps1 ε₁ + eps2 ε₂ + eps1eps2 ε₁ε₂ with ε₁² = ε₂² = 0. The number carries its derivatives in
/// two directions, and the mixed second derivative.
///
/// Store these numbers in NumPy arrays of objects. Arithmetic, NumPy's elementary functions, and all functions of a
/// model and a state accept such arrays, and then return such arrays. Comparisons use `re`. `condyle.jacobian`,
/// `gradient` and `hessian` create these numbers and read the derivatives.
///
/// Source: Fike and Alonso, The development of hyper-dual numbers for exact second-derivative calculations (2011).
///
/// >>> x = np.array([condyle.HyperDual(0.5, eps1=1.0), condyle.HyperDual(2.0, eps2=1.0)])
/// >>> y = np.sin(x[0]) * x[1] ** 2
/// >>> bool(abs(y.eps1eps2 - 2.0 * np.cos(0.5) * 2.0) < 1e-15)  # ∂²y/∂x₀∂x₁
/// True
#[pyclass(frozen, module = "condyle")]
pub(crate) struct HyperDual(HyperDual64);

/// The operand of an operation that is not `self`: a hyper-dual or real number. Arrays are not accepted, since NumPy
/// handles operations with arrays.
pub(crate) struct Operand(HyperDual64);

impl<'py> FromPyObject<'_, 'py> for Operand {
    type Error = PyErr;
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(number) = given.cast::<HyperDual>() {
            return Ok(Self(number.get().0));
        }
        if given.cast::<PyUntypedArray>().is_ok() {
            return Err(PyTypeError::new_err("expected a number, found an array"));
        }
        Ok(Self(given.extract::<f64>()?.into()))
    }
}

#[pymethods]
impl HyperDual {
    #[new]
    #[pyo3(signature = (re, eps1=0.0, eps2=0.0, eps1eps2=0.0))]
    fn new(re: f64, eps1: f64, eps2: f64, eps1eps2: f64) -> Self {
        Self(HyperDual64::new(re, eps1, eps2, eps1eps2))
    }

    /// The value of the number, without derivatives.
    #[getter]
    fn re(&self) -> f64 {
        self.0.re
    }
    /// The derivative of the number in the first direction.
    #[getter]
    fn eps1(&self) -> f64 {
        self.0.eps1
    }
    /// The derivative of the number in the second direction.
    #[getter]
    fn eps2(&self) -> f64 {
        self.0.eps2
    }
    /// The mixed second derivative of the number in the two directions.
    #[getter]
    fn eps1eps2(&self) -> f64 {
        self.0.eps1eps2
    }

    fn __repr__(&self) -> String {
        let HyperDual64 { re, eps1, eps2, eps1eps2, .. } = self.0;
        format!("HyperDual({re}, eps1={eps1}, eps2={eps2}, eps1eps2={eps1eps2})")
    }
    /// Returns the class and the arguments from which `pickle` makes an equal number.
    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let HyperDual64 { re, eps1, eps2, eps1eps2, .. } = slf.get().0;
        Ok((slf.get_type(), (re, eps1, eps2, eps1eps2)).into_pyobject(slf.py())?.into_any())
    }
    fn __add__(&self, other: Operand) -> Self {
        Self(self.0 + other.0)
    }
    fn __radd__(&self, other: Operand) -> Self {
        Self(other.0 + self.0)
    }
    fn __sub__(&self, other: Operand) -> Self {
        Self(self.0 - other.0)
    }
    fn __rsub__(&self, other: Operand) -> Self {
        Self(other.0 - self.0)
    }
    fn __mul__(&self, other: Operand) -> Self {
        Self(self.0 * other.0)
    }
    fn __rmul__(&self, other: Operand) -> Self {
        Self(other.0 * self.0)
    }
    fn __truediv__(&self, other: Operand) -> Self {
        Self(self.0 / other.0)
    }
    fn __rtruediv__(&self, other: Operand) -> Self {
        Self(other.0 / self.0)
    }
    fn __pow__(&self, exponent: &Bound<'_, PyAny>, _modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        if let Ok(n) = exponent.extract::<i32>() {
            return Ok(Self(self.0.powi(n)));
        }
        if let Ok(exponent) = exponent.cast::<Self>() {
            return Ok(Self((DualNum::ln(&self.0) * exponent.get().0).exp()));
        }
        Ok(Self(self.0.powf(exponent.extract()?)))
    }
    fn __rpow__(&self, base: Operand, _modulo: Option<&Bound<'_, PyAny>>) -> Self {
        Self((DualNum::ln(&base.0) * self.0).exp())
    }
    fn __neg__(&self) -> Self {
        Self(-self.0)
    }
    fn __pos__(&self) -> Self {
        Self(self.0)
    }
    fn __abs__(&self) -> Self {
        Self(Scalar::abs(self.0))
    }
    fn __richcmp__(&self, other: Operand, by: CompareOp) -> bool {
        let order = self.0.re.partial_cmp(&other.0.re); // `None` if one of the numbers is NaN
        order.map_or(matches!(by, CompareOp::Ne), |order| by.matches(order))
    }
    fn __bool__(&self) -> bool {
        self.0.re != 0.0
    }

    /// Returns the angle of the point (x, self) in the plane.
    fn arctan2(&self, x: Operand) -> Self {
        Self(Scalar::atan2(self.0, x.0))
    }
    /// Returns the hypotenuse √(self² + other²).
    fn hypot(&self, other: Operand) -> Self {
        Self(DualNum::sqrt(&(self.0 * self.0 + other.0 * other.0)))
    }
    /// Returns the absolute value of self.
    fn fabs(&self) -> Self {
        self.__abs__()
    }

    // NumPy calls the methods with these names for its elementary functions of objects

    /// Returns the square root of self.
    fn sqrt(&self) -> Self {
        Self(DualNum::sqrt(&self.0))
    }
    /// Returns the cubic root of self.
    fn cbrt(&self) -> Self {
        Self(DualNum::cbrt(&self.0))
    }
    /// Returns the exponential of self, e to the power of self.
    fn exp(&self) -> Self {
        Self(DualNum::exp(&self.0))
    }
    /// Returns the power of 2 with exponent self.
    fn exp2(&self) -> Self {
        Self(DualNum::exp2(&self.0))
    }
    /// Returns the exponential of self, minus 1.
    fn expm1(&self) -> Self {
        Self(DualNum::exp_m1(&self.0))
    }
    /// Returns the natural logarithm of self.
    fn log(&self) -> Self {
        Self(DualNum::ln(&self.0))
    }
    /// Returns the logarithm of self to the base 2.
    fn log2(&self) -> Self {
        Self(DualNum::log2(&self.0))
    }
    /// Returns the logarithm of self to the base 10.
    fn log10(&self) -> Self {
        Self(DualNum::log10(&self.0))
    }
    /// Returns the natural logarithm of 1 + self.
    fn log1p(&self) -> Self {
        Self(DualNum::ln_1p(&self.0))
    }
    /// Returns the sine of self.
    fn sin(&self) -> Self {
        Self(DualNum::sin(&self.0))
    }
    /// Returns the cosine of self.
    fn cos(&self) -> Self {
        Self(DualNum::cos(&self.0))
    }
    /// Returns the tangent of self.
    fn tan(&self) -> Self {
        Self(DualNum::tan(&self.0))
    }
    /// Returns the angle whose sine is self.
    fn arcsin(&self) -> Self {
        Self(DualNum::asin(&self.0))
    }
    /// Returns the angle whose cosine is self.
    fn arccos(&self) -> Self {
        Self(DualNum::acos(&self.0))
    }
    /// Returns the angle whose tangent is self.
    fn arctan(&self) -> Self {
        Self(DualNum::atan(&self.0))
    }
    /// Returns the hyperbolic sine of self.
    fn sinh(&self) -> Self {
        Self(DualNum::sinh(&self.0))
    }
    /// Returns the hyperbolic cosine of self.
    fn cosh(&self) -> Self {
        Self(DualNum::cosh(&self.0))
    }
    /// Returns the hyperbolic tangent of self.
    fn tanh(&self) -> Self {
        Self(DualNum::tanh(&self.0))
    }
    /// Returns the number whose hyperbolic sine is self.
    fn arcsinh(&self) -> Self {
        Self(DualNum::asinh(&self.0))
    }
    /// Returns the number whose hyperbolic cosine is self.
    fn arccosh(&self) -> Self {
        Self(DualNum::acosh(&self.0))
    }
    /// Returns the number whose hyperbolic tangent is self.
    fn arctanh(&self) -> Self {
        Self(DualNum::atanh(&self.0))
    }
}

/// Returns whether an argument contains a hyper-dual number.
pub(crate) fn within(given: &Bound<'_, PyAny>) -> bool {
    if given.cast::<PyUntypedArray>().is_ok_and(|array| array.dtype().kind() != b'O') {
        return false;
    }
    if given.is_instance_of::<HyperDual>() {
        return true;
    }
    let all = given.getattr("flat").or_else(|_| given.try_iter().map(Bound::into_any));
    all.and_then(|all| all.try_iter()).is_ok_and(|all| all.flatten().any(|x| x.is_instance_of::<HyperDual>()))
}

impl Number for Hyper {
    type Input<'py, D: Dimension> = Vec<Self>;

    fn read<'py, D: Dimension>(argument: &str, value: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<Vec<Self>> {
        let array = value.py().import("numpy")?.call_method1("asarray", (value, "O"))?;
        check_shape(argument, array.cast::<PyUntypedArray>()?.shape(), shape)?;
        array.getattr("flat")?.try_iter()?.map(|x| Self::read_one(argument, &x?)).collect()
    }
    fn real(&self) -> f64 {
        self.0.re
    }
    fn read_one(argument: &str, value: &Bound<'_, PyAny>) -> PyResult<Self> {
        value.extract::<Operand>().map(|x| Self(x.0)).map_err(|_| {
            let found = value.get_type();
            PyTypeError::new_err(format!("{argument}: expected real or hyper-dual numbers, found {found}"))
        })
    }
    fn output<'py>(
        py: Python<'py>,
        out: Option<&Bound<'py, PyAny>>,
        shape: &[usize],
        fill: impl FnOnce(&mut [Self]),
    ) -> PyResult<Bound<'py, PyAny>> {
        if out.is_some() {
            return Err(PyValueError::new_err("out: expected none, since arguments have hyper-dual numbers"));
        }
        let mut numbers = vec![Scalar::zero(); shape.iter().product()];
        fill(&mut numbers);
        let array = py.import("numpy")?.call_method1("empty", (shape.to_vec(), "O"))?;
        let flat = array.getattr("flat")?;
        for (k, x) in numbers.into_iter().enumerate() {
            flat.set_item(k, HyperDual(x.0))?;
        }
        Ok(array)
    }
}

impl Give for Hyper {
    fn give<'py>(&self, py: Python<'py>, _: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        Ok(Bound::new(py, HyperDual(self.0))?.into_any())
    }
}
