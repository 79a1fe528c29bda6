//! Derivatives of a Python function whose derivatives the user did not give. Four methods are tried in this order: one
//! call for all knots with numbers that carry their derivatives; one such call for each knot; hyper-dual numbers, which
//! the functions of a model also accept; and central differences. A method that fails for a function is not tried
//! again.

use super::expansion::{Directions, Expansion, SeveralKnots, objects};
use super::functions::Functions;
use super::space::{Space, hyper_slopes, hyper_state};
use crate::arrays::Number;
use crate::hyper_dual::Hyper;
use condyle::Scalar;
use condyle::optimal::LqKnot;
use pyo3::exceptions::{PyException, PyTypeError};
use pyo3::prelude::*;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Methods of differentiation, numbered in the order in which they are tried. Method 2, hyper-dual numbers, has no
/// constant.
const TOGETHER: u8 = 0;
const ALONE: u8 = 1;
const DIFFERENCES: u8 = 3;

/// Method of differentiation of a function: the first one that has not failed yet.
#[derive(Clone, Default)]
pub(in crate::optimal) struct Way(Arc<AtomicU8>);

/// A function of (t, x, u) to be differentiated.
pub(super) struct Differentiated<'a> {
    pub functions: &'a Functions,
    pub space: &'a Space,
    pub nu: usize,
    /// Whether the function takes arrays with a row for each knot.
    pub batch: bool,
    /// Whether the function may return None instead of the next state.
    pub terminal: bool,
}

impl Way {
    /// Calls `each` with the methods in their order until a method works. Returns `Ok(false)` if only differences are
    /// left.
    fn descend(&self, py: Python<'_>, mut each: impl FnMut(u8) -> PyResult<()>) -> PyResult<bool> {
        loop {
            let way = self.0.load(Ordering::Relaxed);
            if way == DIFFERENCES {
                return Ok(false);
            }
            match each(way) {
                Ok(()) => return Ok(true),
                Err(error) if error.is_instance_of::<PyException>(py) => self.0.store(way + 1, Ordering::Relaxed),
                Err(error) => return Err(error),
            }
        }
    }
}

impl Differentiated<'_> {
    fn directions(&self, second: bool) -> Directions {
        Directions { n: self.space.ndx() + self.nu, second }
    }

    /// Writes the derivatives of an action at these knots. Returns false if no method works, so that differences must
    /// be used.
    pub(super) fn action(
        &self,
        py: Python<'_>,
        way: &Way,
        knots: &[usize],
        [xs, us]: [&[f64]; 2],
        lq_knots: &mut [LqKnot],
    ) -> PyResult<bool> {
        let (nx, nu) = (self.space.nx(), self.nu);
        way.descend(py, |way| match way {
            TOGETHER => self.expand_action(py, knots, [xs, us], lq_knots),
            _ => knots.iter().zip(lq_knots.iter_mut()).enumerate().try_for_each(|(k, (t, knot))| {
                let at = [&xs[k * nx..][..nx], &us[k * nu..][..nu]];
                match way {
                    ALONE => self.expand_action(py, &[*t], at, std::slice::from_mut(knot)),
                    _ => self.hyper_action(py, *t, at, knot),
                }
            }),
        })
    }

    /// Writes the derivatives of the accelerations at a knot to `slopes`, row by row: nv rows, and a column for each
    /// direction of the state and the controls. Writes the derivatives of the cost to `knot`. Returns false if no
    /// method works.
    pub(super) fn dynamics(
        &self,
        py: Python<'_>,
        way: &Way,
        t: usize,
        at: [&[f64]; 2],
        slopes: &mut [f64],
        knot: &mut LqKnot,
    ) -> PyResult<bool> {
        let d = self.directions(true);
        let nv = slopes.len() / d.n.max(1);
        way.descend(py, |way| match way {
            TOGETHER | ALONE => {
                let (a, cost) = next_and_cost(&self.expand(py, d, &[t], at)?)?;
                let cost = Expansion::read("calc, the cost", &cost, d, 1, 1)?;
                write_cost(knot, d, cost[0].knot(0));
                if !a.is_none() {
                    let a = Expansion::read("calc, the accelerations", &a, d, nv, 1)?;
                    for (row, y) in slopes.chunks_exact_mut(d.n).zip(&a) {
                        row.copy_from_slice(&y.knot(0)[1..=d.n]);
                    }
                }
                Ok(())
            }
            _ => self.hyper_pairs(py, t, at, |[i, j], state, cost| {
                let cost = Hyper::read_one("calc, the cost", &cost)?;
                write_curvature(knot, i, j, cost.curvature());
                if i != j {
                    return Ok(());
                }
                write_gradient(knot, i, cost.slopes()[0]);
                if !state.is_none() {
                    let a = Hyper::read::<numpy::Ix1>("calc, the accelerations", &state, &[nv])?;
                    for (row, y) in slopes.chunks_exact_mut(d.n).zip(a) {
                        row[i] = y.slopes()[0];
                    }
                }
                Ok(())
            }),
        })
    }

    /// Writes the derivatives of a vector at a knot, row by row: a row for each number of the vector, and a column for
    /// each direction of the state and the controls. Returns false if no method works.
    pub(super) fn vector(
        &self,
        py: Python<'_>,
        way: &Way,
        t: usize,
        at: [&[f64]; 2],
        jacobian: &mut [f64],
    ) -> PyResult<bool> {
        let d = self.directions(false);
        let m = jacobian.len() / d.n.max(1);
        way.descend(py, |way| match way {
            TOGETHER | ALONE => {
                let result = self.expand(py, d, &[t], at)?;
                for (row, y) in jacobian.chunks_exact_mut(d.n).zip(Expansion::read("calc", &result, d, m, 1)?) {
                    row.copy_from_slice(&y.knot(0)[1..=d.n]);
                }
                Ok(())
            }
            _ => self.hyper(py, t, at, |[i, j], result| {
                for (row, y) in jacobian.chunks_exact_mut(d.n).zip(Hyper::read::<numpy::Ix1>("calc", &result, &[m])?) {
                    [row[i], row[j]] = y.slopes();
                }
                Ok(())
            }),
        })
    }

    /// Writes the gradient and the Hessian of a scalar function at a knot. Returns false if no method works.
    pub(super) fn number(
        &self,
        py: Python<'_>,
        way: &Way,
        t: usize,
        at: [&[f64]; 2],
        knot: &mut LqKnot,
    ) -> PyResult<bool> {
        let d = self.directions(true);
        way.descend(py, |way| match way {
            TOGETHER | ALONE => {
                let cost = Expansion::read("calc", &self.expand(py, d, &[t], at)?, d, 1, 1)?;
                write_cost(knot, d, cost[0].knot(0));
                Ok(())
            }
            _ => (0..d.n).try_for_each(|i| {
                (0..=i).try_for_each(|j| {
                    let cost = Hyper::read_one("calc", &self.hyper_result(py, t, at, [i, j])?)?;
                    write_curvature(knot, i, j, cost.curvature());
                    if i == j {
                        write_gradient(knot, i, cost.slopes()[0]);
                    }
                    Ok(())
                })
            }),
        })
    }

    /// Writes the derivatives of the accelerations a at a knot, as `dynamics` does, and the second derivatives of μᵀ a
    /// for multipliers μ. The second derivatives are stored in the fields of `knot` that otherwise contain the Hessian
    /// of a cost. Returns false if no method works.
    pub(super) fn curvature(
        &self,
        py: Python<'_>,
        way: &Way,
        t: usize,
        at: [&[f64]; 2],
        mu: &[f64],
        slopes: &mut [f64],
        knot: &mut LqKnot,
    ) -> PyResult<bool> {
        let d = self.directions(true);
        way.descend(py, |way| match way {
            TOGETHER | ALONE => {
                let (a, _) = next_and_cost(&self.expand(py, d, &[t], at)?)?;
                let a = Expansion::read("calc, the accelerations", &a, d, mu.len(), 1)?;
                for (row, y) in slopes.chunks_exact_mut(d.n).zip(&a) {
                    row.copy_from_slice(&y.knot(0)[1..=d.n]);
                }
                for i in 0..d.n {
                    for j in 0..=i {
                        let sum = a.iter().zip(mu).map(|(y, mu)| mu * y.knot(0)[d.place(i, j)]).sum();
                        write_curvature(knot, i, j, sum);
                    }
                }
                Ok(())
            }
            _ => self.hyper_pairs(py, t, at, |[i, j], a, _| {
                let a = Hyper::read::<numpy::Ix1>("calc, the accelerations", &a, &[mu.len()])?;
                write_curvature(knot, i, j, a.iter().zip(mu).map(|(y, mu)| mu * y.curvature()).sum());
                if i == j {
                    slopes.chunks_exact_mut(d.n).zip(&a).for_each(|(row, y)| row[i] = y.slopes()[0]);
                }
                Ok(())
            }),
        })
    }

    /// Computes the function's result at these knots, with its derivatives.
    fn expand<'py>(
        &self,
        py: Python<'py>,
        d: Directions,
        knots: &[usize],
        [xs, us]: [&[f64]; 2],
    ) -> PyResult<Bound<'py, PyAny>> {
        let x = self.space.expand(py, d, xs)?;
        let u = (0..self.nu)
            .map(|k| Expansion::variable(d, self.space.ndx() + k, us.iter().skip(k).step_by(self.nu.max(1)).copied()));
        let u = objects(py, u)?;
        let t = match knots {
            [t] => t.into_pyobject(py)?.into_any(),
            _ => Bound::new(py, SeveralKnots)?.into_any(),
        };
        if !self.batch {
            return self.functions.call(py, 0, (t, x, u));
        }
        let row = |x: Bound<'py, PyAny>| x.call_method1("reshape", (1, -1));
        let t = py.import("numpy")?.call_method1("array", ([t], "O"))?;
        self.functions.call(py, 0, (t, row(x)?, row(u)?))
    }

    fn expand_action(&self, py: Python<'_>, knots: &[usize], at: [&[f64]; 2], lq_knots: &mut [LqKnot]) -> PyResult<()> {
        let (d, nx, ndx, count) = (self.directions(true), self.space.nx(), self.space.ndx(), knots.len());
        let (state, cost) = next_and_cost(&self.expand(py, d, knots, at)?)?;
        let cost = Expansion::read("calc, the cost", &cost, d, 1, count)?;
        if !state.is_none() {
            let next = Expansion::read("calc, the next state", &state, d, nx, count)?;
            let slopes = self.space.slopes(py, d, &next, count)?;
            for (knot, slopes) in lq_knots.iter_mut().zip(slopes.chunks_exact(ndx * d.n)) {
                for (i, row) in slopes.chunks_exact(d.n).enumerate() {
                    row.iter().enumerate().for_each(|(j, slope)| write_slope(knot, i, j, *slope));
                }
            }
        } else if !self.terminal {
            return Err(PyTypeError::new_err("calc, the next state: found None"));
        }
        for (k, knot) in lq_knots.iter_mut().enumerate() {
            write_cost(knot, d, cost[0].knot(k));
        }
        Ok(())
    }

    /// Calls the function with hyper-dual numbers, each call for a pair of directions. Each direction occurs in at
    /// least one pair.
    fn hyper(
        &self,
        py: Python<'_>,
        t: usize,
        [x, u]: [&[f64]; 2],
        mut read: impl FnMut([usize; 2], Bound<'_, PyAny>) -> PyResult<()>,
    ) -> PyResult<()> {
        let n = self.directions(false).n;
        for i in (0..n).step_by(2) {
            let pair = [i, (i + 1).min(n - 1)];
            read(pair, self.hyper_result(py, t, [x, u], pair)?)?;
        }
        Ok(())
    }

    fn hyper_result<'py>(
        &self,
        py: Python<'py>,
        t: usize,
        [x, u]: [&[f64]; 2],
        [i, j]: [usize; 2],
    ) -> PyResult<Bound<'py, PyAny>> {
        if self.space.functions().is_some() || self.batch {
            return Err(PyTypeError::new_err("hyper-dual numbers are for one knot, and states of vectors or robots"));
        }
        let ndx = self.space.ndx();
        let mut delta = vec![Hyper::zero(); ndx + self.nu];
        delta[i] += Hyper::first(0.0);
        delta[j] += Hyper::second(0.0);
        let x = hyper_state(py, self.space, x, &delta[..ndx])?;
        let u = Hyper::output(py, None, &[self.nu], |out| {
            (0..self.nu).for_each(|k| out[k] = Hyper::splat(u[k]) + delta[ndx + k]);
        })?;
        self.functions.call(py, 0, (t, x, u))
    }

    /// Calls the function with hyper-dual numbers for each pair of directions. Passes both results of each call to
    /// `read`.
    fn hyper_pairs(
        &self,
        py: Python<'_>,
        t: usize,
        at: [&[f64]; 2],
        mut read: impl FnMut([usize; 2], Bound<'_, PyAny>, Bound<'_, PyAny>) -> PyResult<()>,
    ) -> PyResult<()> {
        for i in 0..self.directions(true).n {
            for j in 0..=i {
                let (state, cost) = next_and_cost(&self.hyper_result(py, t, at, [i, j])?)?;
                read([i, j], state, cost)?;
            }
        }
        Ok(())
    }

    fn hyper_action(&self, py: Python<'_>, t: usize, at: [&[f64]; 2], knot: &mut LqKnot) -> PyResult<()> {
        self.hyper_pairs(py, t, at, |[i, j], state, cost| {
            let cost = Hyper::read_one("calc, the cost", &cost)?;
            write_curvature(knot, i, j, cost.curvature());
            if i != j {
                return Ok(());
            }
            write_gradient(knot, i, cost.slopes()[0]);
            if !state.is_none() {
                let next = Hyper::read::<numpy::Ix1>("calc, the next state", &state, &[self.space.nx()])?;
                for (row, slopes) in hyper_slopes(self.space, &next).into_iter().enumerate() {
                    write_slope(knot, row, i, slopes[0]);
                }
            }
            Ok(())
        })
    }
}

/// Reads the next state and the cost that `calc` returns.
pub(super) fn next_and_cost<'py>(result: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    result.extract().map_err(|_| {
        let found = result.repr().map_or_else(|_| String::new(), |text| text.to_string());
        PyTypeError::new_err(format!("expected a pair (next state, cost), found {found}"))
    })
}

/// Writes the gradient and the Hessian of a cost.
fn write_cost(knot: &mut LqKnot, d: Directions, numbers: &[f64]) {
    for i in 0..d.n {
        write_gradient(knot, i, numbers[1 + i]);
        (0..=i).for_each(|j| write_curvature(knot, i, j, numbers[d.place(i, j)]));
    }
}

fn write_slope(knot: &mut LqKnot, i: usize, j: usize, slope: f64) {
    match knot.q.len() {
        ndx if j < ndx => knot.A[(i, j)] = slope,
        ndx => knot.B[(i, j - ndx)] = slope,
    }
}

fn write_gradient(knot: &mut LqKnot, i: usize, slope: f64) {
    match knot.q.len() {
        ndx if i < ndx => knot.q[i] = slope,
        ndx => knot.r[i - ndx] = slope,
    }
}

/// Writes ∂²ℓ/∂zᵢ∂zⱼ for j ≤ i, with z = (x, u).
pub(super) fn write_curvature(knot: &mut LqKnot, i: usize, j: usize, curvature: f64) {
    let ndx = knot.q.len();
    match (i < ndx, j < ndx) {
        (true, _) => (knot.Q[(i, j)], knot.Q[(j, i)]) = (curvature, curvature),
        (false, true) => knot.S[(j, i - ndx)] = curvature,
        (false, false) => (knot.R[(i - ndx, j - ndx)], knot.R[(j - ndx, i - ndx)]) = (curvature, curvature),
    }
}
