//! Spaces of states: vectors, a robot's states, or a space whose ⊕ and ⊖ are written in Python.

use super::expansion::{Directions, Expansion, objects};
use super::functions::{Fault, Functions, unless_failed};
use crate::arrays::{Number, vector};
use crate::hyper_dual::Hyper;
use crate::model::Model;
use condyle::Scalar;
use numpy::PyArray1;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use std::sync::Arc;

/// A space of states.
#[derive(Clone)]
pub(in crate::optimal) enum Space {
    /// Vectors with this number of entries.
    Vector(usize),
    /// States (q, v) of a robot.
    Robot(Arc<condyle::Model>),
    /// User-defined space: the sizes of a state and of a change of the state, and the functions `integrate` and
    /// `difference`.
    Own(usize, usize, Functions),
}

impl Space {
    /// Reads the space from an argument: a model, (ndx, integrate, difference), or `None` for vectors.
    pub(super) fn new(nx: usize, given: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let Some(given) = given else { return Ok(Self::Vector(nx)) };
        if let Ok(model) = given.cast::<Model>() {
            let model = model.get().inner.clone();
            let expected = model.nq() + model.nv();
            return match nx == expected {
                true => Ok(Self::Robot(model)),
                false => {
                    Err(PyValueError::new_err(format!("nx: expected {expected}, as the states of space, found {nx}")))
                }
            };
        }
        let parts: Result<(usize, Py<PyAny>, Py<PyAny>), _> = given.extract();
        let (ndx, integrate, difference) = parts.map_err(|_| {
            PyTypeError::new_err("space: expected a Model, or a tuple (ndx, integrate, difference) with two functions")
        })?;
        Ok(Self::Own(
            nx,
            crate::exceptions::within("ndx", ndx, 0, super::MOST_SIZE)?,
            Functions::named(["space: integrate", "space: difference"], integrate, Some(difference))?,
        ))
    }

    /// Returns the argument from which `new` creates this space.
    pub(super) fn argument<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(match self {
            Self::Vector(_) => None,
            Self::Robot(model) => Some(Bound::new(py, Model::from((**model).clone()))?.into_any()),
            Self::Own(_, ndx, functions) => {
                let [integrate, difference] = functions.clones(py);
                Some((*ndx, integrate, difference).into_pyobject(py)?.into_any())
            }
        })
    }

    /// Returns the functions that are written in Python, if there are any.
    pub(super) fn functions(&self) -> Option<&Functions> {
        match self {
            Self::Own(.., functions) => Some(functions),
            _ => None,
        }
    }

    /// Returns whether both spaces are the same.
    pub(super) fn is(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Vector(a), Self::Vector(b)) => a == b,
            (Self::Robot(a), Self::Robot(b)) => Arc::ptr_eq(a, b),
            (Self::Own(.., a), Self::Own(.., b)) => a.are(b),
            _ => false,
        }
    }

    pub(super) fn nx(&self) -> usize {
        match self {
            Self::Vector(nx) | Self::Own(nx, ..) => *nx,
            Self::Robot(model) => model.nq() + model.nv(),
        }
    }

    pub(super) fn ndx(&self) -> usize {
        match self {
            Self::Vector(nx) => *nx,
            Self::Own(_, ndx, _) => *ndx,
            Self::Robot(model) => 2 * model.nv(),
        }
    }

    /// Checks a state; an error describes why the state is invalid.
    pub(super) fn check(&self, x: &[f64]) -> Result<(), String> {
        match self {
            Self::Robot(model) => model.check_position(&x[..model.nq()]).map_err(|error| error.to_string()),
            _ => Ok(()),
        }
    }

    /// Computes x ⊕ δ. Errors of Python functions are stored in `fault`; then the result is NaN.
    pub(super) fn integrate(&self, x: &[f64], dx: &[f64], out: &mut [f64], fault: &Fault) {
        match self {
            Self::Vector(_) => (0..out.len()).for_each(|k| out[k] = x[k] + dx[k]),
            Self::Robot(model) => robot_integrate(model, x, dx, out),
            Self::Own(.., functions) => call(functions, 0, "integrate: the state", [x, dx], out, fault),
        }
    }

    /// Computes x₁ ⊖ x₀; errors are handled as by `integrate`.
    pub(super) fn difference(&self, x0: &[f64], x1: &[f64], out: &mut [f64], fault: &Fault) {
        match self {
            Self::Vector(_) => (0..out.len()).for_each(|k| out[k] = x1[k] - x0[k]),
            Self::Robot(model) => robot_difference(model, x0, x1, out),
            Self::Own(.., functions) => call(functions, 1, "difference: the change", [x0, x1], out, fault),
        }
    }

    /// Returns x ⊕ δ at several knots, with derivatives with respect to δ. In `d`, the first directions of
    /// differentiation are the entries of δ. `xs` contains the states of the knots one after the other.
    pub(super) fn expand<'py>(&self, py: Python<'py>, d: Directions, xs: &[f64]) -> PyResult<Bound<'py, PyAny>> {
        let (nx, ndx) = (self.nx(), self.ndx());
        let each = |i: usize| xs.iter().skip(i).step_by(nx).copied();
        match self {
            Self::Vector(_) => objects(py, (0..nx).map(|i| Expansion::variable(d, i, each(i)))),
            Self::Robot(model) => {
                let mut numbers = vec![Vec::new(); nx];
                for x in xs.chunks_exact(nx) {
                    expand_robot(model, d, x, &mut numbers);
                }
                objects(py, numbers.into_iter().map(|numbers| Expansion::new(d, numbers)))
            }
            Self::Own(.., functions) => {
                let zero = xs.len() / nx.max(1);
                let deltas = (0..ndx).map(|i| Expansion::variable(d, i, std::iter::repeat_n(0.0, zero)));
                let x = objects(py, (0..nx).map(|i| Expansion::constant(d, each(i))))?;
                functions.call(py, 0, (x, objects(py, deltas)?))
            }
        }
    }

    /// Returns the derivatives of x ⊖ x̄ at each of several knots, row by row: ndx rows, and a column for each
    /// direction. `next` contains the numbers of x with their derivatives; x̄ is the value of x.
    pub(super) fn slopes(&self, py: Python<'_>, d: Directions, next: &[Expansion], knots: usize) -> PyResult<Vec<f64>> {
        let row = |y: &Expansion, k: usize| y.knot(k)[1..=d.n].to_vec();
        match self {
            Self::Vector(_) => Ok((0..knots).flat_map(|k| next.iter().flat_map(move |y| row(y, k))).collect()),
            Self::Robot(model) => {
                let mut slopes = Vec::new();
                for k in 0..knots {
                    slopes.extend(robot_slopes(model, d, next, k));
                }
                Ok(slopes)
            }
            Self::Own(_, ndx, functions) => {
                let centre = next.iter().map(|y| Expansion::constant(d, (0..knots).map(|k| y.knot(k)[0])));
                let moved =
                    next.iter().map(|y| Expansion::new(d, (0..knots).flat_map(|k| y.knot(k).to_vec()).collect()));
                let change = functions.call(py, 1, (objects(py, centre)?, objects(py, moved)?))?;
                let change = Expansion::read("difference: the change", &change, d, *ndx, knots)?;
                Ok((0..knots).flat_map(|k| change.iter().flat_map(move |y| row(y, k))).collect())
            }
        }
    }
}

/// Calls a Python function of two vectors.
fn call(functions: &Functions, k: usize, what: &str, [a, b]: [&[f64]; 2], out: &mut [f64], fault: &Fault) {
    let written = unless_failed(fault, |py| {
        let result = functions.call(py, k, (PyArray1::from_slice(py, a), PyArray1::from_slice(py, b)))?;
        out.copy_from_slice(&vector(what, &result, out.len())?);
        Ok(())
    });
    if written.is_none() {
        out.fill(f64::NAN);
    }
}

fn robot_integrate<S: Scalar>(model: &condyle::Model, x: &[S], dx: &[S], out: &mut [S]) {
    let (nq, nv) = (model.nq(), model.nv());
    condyle::integrate(model, &x[..nq], &dx[..nv], &mut out[..nq]);
    (0..nv).for_each(|k| out[nq + k] = x[nq + k] + dx[nv + k]);
}

fn robot_difference<S: Scalar>(model: &condyle::Model, x0: &[S], x1: &[S], out: &mut [S]) {
    let (nq, nv) = (model.nq(), model.nv());
    condyle::difference(model, &x0[..nq], &x1[..nq], &mut out[..nv]);
    (0..nv).for_each(|k| out[nv + k] = x1[nq + k] - x0[nq + k]);
}

/// Appends q ⊕ δq and v + δv of one knot, with derivatives, computed by hyper-dual numbers. A second derivative is
/// nonzero only in two directions of the same joint. All pairs are computed, since this function does not know the
/// joints.
fn expand_robot(model: &condyle::Model, d: Directions, x: &[f64], numbers: &mut [Vec<f64>]) {
    let (ndx, nv) = (2 * model.nv(), model.nv());
    let start = numbers[0].len();
    for (numbers, x) in numbers.iter_mut().zip(x) {
        numbers.resize(start + d.stride(), 0.0);
        numbers[start] = *x;
    }
    for k in nv..ndx {
        numbers[model.nq() + k - nv][start + 1 + k] = 1.0;
    }
    let position: Vec<Hyper> = x.iter().map(|x| Hyper::splat(*x)).collect();
    let mut moved = position.clone();
    for i in 0..nv {
        for j in if d.second { 0..=i } else { i..=i } {
            let mut delta = vec![Hyper::zero(); ndx];
            delta[i] += Hyper::first(0.0);
            delta[j] += Hyper::second(0.0);
            robot_integrate(model, &position, &delta, &mut moved);
            for (numbers, y) in numbers.iter_mut().zip(&moved[..model.nq()]) {
                numbers[start + 1 + i] = y.slopes()[0];
                if d.second {
                    numbers[start + d.place(i, j)] = y.curvature();
                }
            }
        }
    }
}

/// Returns the derivatives of x ⊖ x̄ at one knot, where x̄ is the value of x.
fn robot_slopes(model: &condyle::Model, d: Directions, next: &[Expansion], k: usize) -> Vec<f64> {
    let ndx = 2 * model.nv();
    let centre: Vec<Hyper> = next.iter().map(|y| Hyper::splat(y.knot(k)[0])).collect();
    let (mut moved, mut change) = (centre.clone(), vec![Hyper::zero(); ndx]);
    let mut slopes = vec![0.0; ndx * d.n];
    for i in (0..d.n).step_by(2) {
        let other = (i + 1).min(d.n - 1);
        for (moved, y) in moved.iter_mut().zip(next) {
            let y = y.knot(k);
            *moved = Hyper::with(y[0], [y[1 + i], y[1 + other]]);
        }
        robot_difference(model, &centre, &moved, &mut change);
        for (row, change) in slopes.chunks_exact_mut(d.n).zip(&change) {
            [row[i], row[other]] = change.slopes();
        }
    }
    slopes
}

/// Returns x ⊕ δ for a state of a robot or a vector, with δ in two directions.
pub(super) fn hyper_state<'py>(
    py: Python<'py>,
    space: &Space,
    x: &[f64],
    delta: &[Hyper],
) -> PyResult<Bound<'py, PyAny>> {
    let position: Vec<Hyper> = x.iter().map(|x| Hyper::splat(*x)).collect();
    Hyper::output(py, None, &[x.len()], |out| match space {
        Space::Robot(model) => robot_integrate(model, &position, delta, out),
        _ => (0..out.len()).for_each(|k| out[k] = position[k] + delta[k]),
    })
}

/// Returns the derivatives of x ⊖ x̄ in two directions, where x̄ is the value of x.
pub(super) fn hyper_slopes(space: &Space, next: &[Hyper]) -> Vec<[f64; 2]> {
    let centre: Vec<Hyper> = next.iter().map(|y| Hyper::splat(y.value())).collect();
    let mut change = vec![Hyper::zero(); space.ndx()];
    match space {
        Space::Robot(model) => robot_difference(model, &centre, next, &mut change),
        _ => (0..change.len()).for_each(|k| change[k] = next[k] - centre[k]),
    }
    change.iter().map(|change| change.slopes()).collect()
}
