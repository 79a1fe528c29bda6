//! Numbers that carry their first and second derivatives in all directions, at several knots at a time. With such
//! numbers, one call of a Python function computes the function's derivatives at all knots of a horizon. A number x
//! carries its gradient gₓ and its Hessian Hₓ. The gradient g and the Hessian H of a function follow by the chain rule:
//!
//! ```text
//! f(x):      g = f′ gₓ,                 H = f′ Hₓ + f″ gₓ gₓᵀ
//! f(x, y):   g = f_x gₓ + f_y g_y,      H = f_x Hₓ + f_y H_y + f_xx gₓgₓᵀ + f_xy (gₓ g_yᵀ + g_y gₓᵀ) + f_yy g_y g_yᵀ
//! ```

use numpy::{PyArray1, PyUntypedArray};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::pyclass::CompareOp;

/// Number of directions of differentiation, and whether second derivatives are computed, too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Directions {
    pub n: usize,
    pub second: bool,
}

impl Directions {
    /// Returns the count of numbers that are stored for each knot: the value, the gradient, and the Hessian's lower
    /// triangle, row by row.
    pub(super) fn stride(self) -> usize {
        1 + self.n + if self.second { self.n * (self.n + 1) / 2 } else { 0 }
    }

    /// Returns the index of ∂²/∂i∂j among the numbers of a knot.
    pub(super) fn place(self, i: usize, j: usize) -> usize {
        let (i, j) = (i.max(j), i.min(j));
        1 + self.n + i * (i + 1) / 2 + j
    }
}

/// A number with its derivatives at each of several knots.
#[derive(Clone)]
#[pyclass(frozen, module = "condyle.optimal")]
pub(crate) struct Expansion {
    directions: Directions,
    /// The value and the derivatives, knot by knot.
    numbers: Vec<f64>,
}

/// Placeholder for the index t when several knots are computed in one call. A function that depends on t cannot be
/// evaluated for all knots at once.
#[pyclass(frozen, module = "condyle.optimal")]
pub(super) struct SeveralKnots;

#[pymethods]
impl SeveralKnots {
    fn __richcmp__(&self, _other: &Bound<'_, PyAny>, _by: CompareOp) -> PyResult<bool> {
        Err(Self::refused())
    }
    fn __bool__(&self) -> PyResult<bool> {
        Err(Self::refused())
    }
    fn __hash__(&self) -> PyResult<isize> {
        Err(Self::refused())
    }
    fn __repr__(&self) -> PyResult<String> {
        Err(Self::refused())
    }
}

impl SeveralKnots {
    fn refused() -> PyErr {
        PyTypeError::new_err("t: all knots are evaluated in one call here, so t cannot be used as one integer")
    }
}

/// The operand of an operation that is not `self`: a real number, or a number with derivatives.
enum Other<'py> {
    Real(f64),
    Expansion(Bound<'py, Expansion>),
}

impl<'py> FromPyObject<'_, 'py> for Other<'py> {
    type Error = PyErr;
    fn extract(given: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(number) = given.cast::<Expansion>() {
            return Ok(Self::Expansion(number.to_owned()));
        }
        if given.cast::<PyUntypedArray>().is_ok() {
            return Err(PyTypeError::new_err("expected a number, found an array"));
        }
        Ok(Self::Real(given.extract::<f64>()?))
    }
}

impl Expansion {
    pub(super) fn new(directions: Directions, numbers: Vec<f64>) -> Self {
        Self { directions, numbers }
    }

    /// Creates a variable whose derivative is 1 in one direction and 0 in the others; `values` are its values at the
    /// knots.
    pub(super) fn variable(directions: Directions, direction: usize, values: impl Iterator<Item = f64>) -> Self {
        let mut numbers = Vec::new();
        for value in values {
            let start = numbers.len();
            numbers.resize(start + directions.stride(), 0.0);
            (numbers[start], numbers[start + 1 + direction]) = (value, 1.0);
        }
        Self { directions, numbers }
    }

    /// Creates a constant; `values` are its values at the knots.
    pub(super) fn constant(directions: Directions, values: impl Iterator<Item = f64>) -> Self {
        let mut numbers = Vec::new();
        for value in values {
            numbers.push(value);
            numbers.resize(numbers.len() + directions.stride() - 1, 0.0);
        }
        Self { directions, numbers }
    }

    /// Reads a result that has this number of entries at each knot.
    pub(super) fn read(
        what: &str,
        given: &Bound<'_, PyAny>,
        directions: Directions,
        count: usize,
        knots: usize,
    ) -> PyResult<Vec<Self>> {
        let array = given.py().import("numpy")?.call_method1("asarray", (given, "O"))?;
        let one = |x: Bound<'_, PyAny>| match x.extract()? {
            Other::Real(x) => Ok(Self::constant(directions, std::iter::repeat_n(x, knots))),
            Other::Expansion(x) if x.get().directions == directions => Ok(x.get().clone()),
            Other::Expansion(_) => Err(PyValueError::new_err(format!("{what}: a number of another differentiation"))),
        };
        let all = array.getattr("flat")?.try_iter()?.map(|x| one(x?)).collect::<PyResult<Vec<_>>>()?;
        if all.len() != count || all.iter().any(|x| x.numbers.len() != knots * directions.stride()) {
            let found = all.len();
            return Err(PyValueError::new_err(format!("{what}: expected {count} numbers, found {found}")));
        }
        Ok(all)
    }

    /// Returns the value and the derivatives at knot k.
    pub(super) fn knot(&self, k: usize) -> &[f64] {
        let stride = self.directions.stride();
        &self.numbers[k * stride..(k + 1) * stride]
    }

    /// Applies a function at each knot; `f` returns the function's value and its first two derivatives, f, f′ and f″.
    fn map(&self, f: impl Fn(f64) -> [f64; 3]) -> Self {
        let (d, mut numbers) = (self.directions, self.numbers.clone());
        for knot in numbers.chunks_exact_mut(d.stride()) {
            let [value, first, second] = f(knot[0]);
            let (g, H) = knot[1..].split_at_mut(d.n);
            let mut k = 0;
            for i in 0..if d.second { d.n } else { 0 } {
                let row = second * g[i];
                for j in 0..=i {
                    H[k + j] = first * H[k + j] + row * g[j];
                }
                k += i + 1;
            }
            knot[0] = value;
            knot[1..=d.n].iter_mut().for_each(|g| *g *= first);
        }
        Self { directions: d, numbers }
    }

    /// Applies a function of two numbers at each knot; `f` returns the function's value and its derivatives f_x, f_y,
    /// f_xx, f_xy, f_yy.
    fn combine(&self, other: &Self, f: impl Fn(f64, f64) -> [f64; 6]) -> PyResult<Self> {
        let d = self.directions;
        if d != other.directions || self.numbers.len() != other.numbers.len() {
            return Err(PyValueError::new_err("numbers of two differentiations"));
        }
        let mut numbers = self.numbers.clone();
        for (knot, theirs) in numbers.chunks_exact_mut(d.stride()).zip(other.numbers.chunks_exact(d.stride())) {
            let [value, x, y, xx, xy, yy] = f(knot[0], theirs[0]);
            let ((g, H), (theirs_g, theirs_H)) = (knot[1..].split_at_mut(d.n), theirs[1..].split_at(d.n));
            let mut k = 0;
            for i in 0..if d.second { d.n } else { 0 } {
                let (own, other) = (xx * g[i] + xy * theirs_g[i], xy * g[i] + yy * theirs_g[i]);
                for j in 0..=i {
                    H[k + j] = x * H[k + j] + y * theirs_H[k + j] + own * g[j] + other * theirs_g[j];
                }
                k += i + 1;
            }
            knot[0] = value;
            knot[1..=d.n].iter_mut().zip(theirs_g).for_each(|(g, theirs)| *g = x * *g + y * theirs);
        }
        Ok(Self { directions: d, numbers })
    }

    /// Returns whether a comparison of two numbers is true. Returns an error if the comparison differs between knots.
    fn compare(&self, other: &Other<'_>, by: CompareOp) -> PyResult<bool> {
        let stride = self.directions.stride();
        let theirs = |k: usize| match other {
            Other::Real(x) => *x,
            Other::Expansion(x) => x.get().numbers[k * stride],
        };
        let holds = |(k, x): (usize, &f64)| {
            let order = x.partial_cmp(&theirs(k)); // `None` if one of the numbers is NaN
            order.map_or(matches!(by, CompareOp::Ne), |order| by.matches(order))
        };
        if matches!(other, Other::Expansion(x) if x.get().numbers.len() != self.numbers.len()) {
            return Err(PyValueError::new_err("numbers of two differentiations"));
        }
        let mut all = self.numbers.iter().step_by(stride).enumerate().map(holds);
        let first = all.next().unwrap_or(true);
        match all.all(|one| one == first) {
            true => Ok(first),
            false => Err(PyValueError::new_err("the comparison differs from knot to knot")),
        }
    }
}

/// Returns the product x y, with its derivatives.
fn product(x: f64, y: f64) -> [f64; 6] {
    [x * y, y, x, 0.0, 1.0, 0.0]
}

/// Returns the quotient x / y, with its derivatives.
fn quotient(x: f64, y: f64) -> [f64; 6] {
    let r = 1.0 / y;
    [x / y, r, -x * r * r, 0.0, -r * r, 2.0 * x * r * r * r]
}

/// Returns the power xᵖ for a constant p, with its derivatives.
fn power(x: f64, p: f64) -> [f64; 3] {
    let derivative = |factor: f64, p: f64| if factor == 0.0 { 0.0 } else { factor * x.powf(p) };
    [x.powf(p), derivative(p, p - 1.0), derivative(p * (p - 1.0), p - 2.0)]
}

/// Returns the angle of the point (x, y), with its derivatives with respect to y and x.
fn angle(y: f64, x: f64) -> [f64; 6] {
    let s = 1.0 / (x * x + y * y);
    let xy = 2.0 * x * y * s * s;
    [y.atan2(x), x * s, -y * s, -xy, (y * y - x * x) * s * s, xy]
}

/// Defines the methods of a class: elementary functions, each with its first two derivatives, and other methods.
macro_rules! methods {
    ($class:ident { $($name:ident: $x:ident => $f:expr;)* } { $($others:tt)* }) => {
        #[pymethods]
        impl $class {
            $(fn $name(&self) -> Self {
                self.map(|$x| $f)
            })*
            $($others)*
        }
    };
}

methods! {
Expansion {
    __neg__: x => [-x, -1.0, 0.0];
    __pos__: x => [x, 1.0, 0.0];
    __abs__: x => [x.abs(), x.signum(), 0.0];
    fabs: x => [x.abs(), x.signum(), 0.0];
    square: x => [x * x, 2.0 * x, 2.0];
    sqrt: x => { let s = x.sqrt(); [s, 0.5 / s, -0.25 / (s * x)] };
    cbrt: x => { let c = x.cbrt(); [c, 1.0 / (3.0 * c * c), -2.0 / (9.0 * c * c * x)] };
    exp: x => { let e = x.exp(); [e, e, e] };
    exp2: x => { let (e, l) = (x.exp2(), core::f64::consts::LN_2); [e, l * e, l * l * e] };
    expm1: x => { let e = x.exp(); [x.exp_m1(), e, e] };
    log: x => [x.ln(), 1.0 / x, -1.0 / (x * x)];
    log2: x => { let r = 1.0 / (x * core::f64::consts::LN_2); [x.log2(), r, -r / x] };
    log10: x => { let r = 1.0 / (x * core::f64::consts::LN_10); [x.log10(), r, -r / x] };
    log1p: x => { let r = 1.0 / (1.0 + x); [x.ln_1p(), r, -r * r] };
    sin: x => { let (s, c) = x.sin_cos(); [s, c, -s] };
    cos: x => { let (s, c) = x.sin_cos(); [c, -s, -c] };
    tan: x => { let t = x.tan(); let d = 1.0 + t * t; [t, d, 2.0 * t * d] };
    arcsin: x => { let d = (1.0 - x * x).sqrt().recip(); [x.asin(), d, x * d * d * d] };
    arccos: x => { let d = -(1.0 - x * x).sqrt().recip(); [x.acos(), d, x * d * d * d] };
    arctan: x => { let d = 1.0 / (1.0 + x * x); [x.atan(), d, -2.0 * x * d * d] };
    sinh: x => [x.sinh(), x.cosh(), x.sinh()];
    cosh: x => [x.cosh(), x.sinh(), x.cosh()];
    tanh: x => { let t = x.tanh(); let d = 1.0 - t * t; [t, d, -2.0 * t * d] };
    arcsinh: x => { let d = (1.0 + x * x).sqrt().recip(); [x.asinh(), d, -x * d * d * d] };
    arccosh: x => { let d = (x * x - 1.0).sqrt().recip(); [x.acosh(), d, -x * d * d * d] };
    arctanh: x => { let d = 1.0 / (1.0 - x * x); [x.atanh(), d, 2.0 * x * d * d] };
}
{
    fn __add__(&self, other: Other<'_>) -> PyResult<Self> {
        match other {
            Other::Real(y) => Ok(self.map(|x| [x + y, 1.0, 0.0])),
            Other::Expansion(y) => self.combine(y.get(), |x, y| [x + y, 1.0, 1.0, 0.0, 0.0, 0.0]),
        }
    }
    fn __radd__(&self, other: f64) -> Self {
        self.map(|x| [other + x, 1.0, 0.0])
    }
    fn __sub__(&self, other: Other<'_>) -> PyResult<Self> {
        match other {
            Other::Real(y) => Ok(self.map(|x| [x - y, 1.0, 0.0])),
            Other::Expansion(y) => self.combine(y.get(), |x, y| [x - y, 1.0, -1.0, 0.0, 0.0, 0.0]),
        }
    }
    fn __rsub__(&self, other: f64) -> Self {
        self.map(|x| [other - x, -1.0, 0.0])
    }
    fn __mul__(&self, other: Other<'_>) -> PyResult<Self> {
        match other {
            Other::Real(y) => Ok(self.map(|x| [x * y, y, 0.0])),
            Other::Expansion(y) => self.combine(y.get(), product),
        }
    }
    fn __rmul__(&self, other: f64) -> Self {
        self.map(|x| [other * x, other, 0.0])
    }
    fn __truediv__(&self, other: Other<'_>) -> PyResult<Self> {
        match other {
            Other::Real(y) => Ok(self.map(|x| [x / y, 1.0 / y, 0.0])),
            Other::Expansion(y) => self.combine(y.get(), quotient),
        }
    }
    fn __rtruediv__(&self, other: f64) -> Self {
        self.map(|x| {
            let [value, _, first, _, _, second] = quotient(other, x);
            [value, first, second]
        })
    }
    fn __pow__(&self, exponent: Other<'_>, _modulo: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        match exponent {
            Other::Real(p) => Ok(self.map(|x| power(x, p))),
            Other::Expansion(p) => Ok(self.log().combine(p.get(), product)?.exp()),
        }
    }
    fn __rpow__(&self, base: f64, _modulo: Option<&Bound<'_, PyAny>>) -> Self {
        let l = base.ln();
        self.map(|x| {
            let value = base.powf(x);
            [value, l * value, l * l * value]
        })
    }
    /// Returns the angle of the point (x, self) in the plane.
    fn arctan2(&self, x: Other<'_>) -> PyResult<Self> {
        match x {
            Other::Real(x) => Ok(self.map(|y| {
                let [value, first, _, second, ..] = angle(y, x);
                [value, first, second]
            })),
            Other::Expansion(x) => self.combine(x.get(), angle),
        }
    }
    /// Returns the hypotenuse √(self² + other²).
    fn hypot(&self, other: Other<'_>) -> PyResult<Self> {
        let square = match other {
            Other::Real(y) => self.square().map(|x| [x + y * y, 1.0, 0.0]),
            Other::Expansion(y) => {
                self.square().combine(&y.get().square(), |x, y| [x + y, 1.0, 1.0, 0.0, 0.0, 0.0])?
            }
        };
        Ok(square.sqrt())
    }
    fn __richcmp__(&self, other: Other<'_>, by: CompareOp) -> PyResult<bool> {
        self.compare(&other, by)
    }
    fn __bool__(&self) -> PyResult<bool> {
        self.compare(&Other::Real(0.0), CompareOp::Ne)
    }
}
}

/// Returns an array of objects: the given numbers with their derivatives.
pub(super) fn objects<'py>(py: Python<'py>, numbers: impl Iterator<Item = Expansion>) -> PyResult<Bound<'py, PyAny>> {
    let numbers = numbers.map(|number| Ok(Py::new(py, number)?.into_any())).collect::<PyResult<Vec<_>>>()?;
    Ok(PyArray1::from_vec(py, numbers).into_any())
}
