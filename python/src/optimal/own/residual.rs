//! Residuals and costs that are written in Python.

use super::automatic::{Differentiated, Way, write_curvature};
use super::functions::{Fault, Functions, unless_failed};
use super::lqr::write;
use super::space::Space;
use crate::arrays::{matrix, vector};
use condyle::optimal::robot::{Cost, Knot, Limit, Residual, ResidualFunction};
use condyle::optimal::{Hessian, LqKnot};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::any::Any;

/// Step of central differences: about ε^⅓, with the rounding error ε of f64.
const STEP: f64 = 6e-6;

/// Step of second central differences: about ε^¼, with the rounding error ε of f64.
const SECOND_STEP: f64 = 1e-4;

/// A residual of a robot that is written in Python.
pub(in crate::optimal) struct OwnFunction {
    pub size: usize,
    /// Whether the function is a scalar cost with a gradient and a Hessian.
    pub number: bool,
    pub functions: Functions,
    pub space: Space,
    pub way: Way,
    /// First error that the function raised.
    pub fault: Fault,
}

/// Returns the variables that store the errors of a knot's residuals, for all residuals written in Python.
pub(in crate::optimal) fn faults(knot: &Knot) -> Vec<Fault> {
    let costs = knot.costs.iter().chain(knot.costs_at.values().flatten());
    let limits = knot.limits.iter().chain(knot.limits_at.values().flatten());
    let residuals = costs.map(|Cost { residual, .. }| residual).chain(limits.map(|Limit { residual, .. }| residual));
    let fault = |residual: &Residual| {
        let Residual::Own(own) = residual else { return None };
        let own: &dyn Any = &**own;
        own.downcast_ref::<OwnFunction>().map(|own| own.fault.clone())
    };
    residuals.filter_map(fault).collect()
}

impl OwnFunction {
    fn try_calc(&self, py: Python<'_>, t: usize, x: &[f64], u: &[f64], r: &mut [f64]) -> PyResult<()> {
        let value = self.functions.at(py, 0, t, x, u)?;
        if self.number {
            let found = value.get_type();
            let wrong = |_| PyTypeError::new_err(format!("the cost: expected a number, found {found}"));
            r[0] = value.extract().map_err(wrong)?;
            return Ok(());
        }
        r.copy_from_slice(&vector("the residual", &value, r.len())?);
        Ok(())
    }

    fn try_calc_diff(
        &self,
        py: Python<'_>,
        t: usize,
        [x, u]: [&[f64]; 2],
        [by_x, by_u]: [&mut [f64]; 2],
    ) -> PyResult<()> {
        let (ndx, nu) = (self.space.ndx(), u.len());
        if self.functions.has(1) && !self.number {
            let (x, u): (Bound<'_, PyAny>, Bound<'_, PyAny>) = self.functions.at(py, 1, t, x, u)?.extract()?;
            by_x.copy_from_slice(&matrix("∂r/∂x", &x, [self.size, ndx])?);
            by_u.copy_from_slice(&matrix("∂r/∂u", &u, [self.size, nu])?);
            return Ok(());
        }
        if self.number {
            let knot = self.try_number(py, t, [x, u])?;
            by_x.copy_from_slice(knot.q.as_slice());
            by_u.copy_from_slice(knot.r.as_slice());
            return Ok(());
        }
        let mut slopes = vec![0.0; self.size * (ndx + nu)];
        let (functions, space) = (&self.functions, &self.space);
        let all = Differentiated { functions, space, nu, batch: false, terminal: false };
        if !all.vector(py, &self.way, t, [x, u], &mut slopes)? {
            self.differ(py, t, [x, u], &mut slopes)?;
        }
        for (i, row) in slopes.chunks_exact((ndx + nu).max(1)).enumerate() {
            by_x[i * ndx..][..ndx].copy_from_slice(&row[..ndx]);
            by_u[i * nu..][..nu].copy_from_slice(&row[ndx..]);
        }
        Ok(())
    }

    /// Computes the gradient (q, r) and the Hessian (Q, S, R) of a scalar cost.
    fn try_number(&self, py: Python<'_>, t: usize, [x, u]: [&[f64]; 2]) -> PyResult<LqKnot> {
        let (ndx, nu) = (self.space.ndx(), u.len());
        let mut knot = LqKnot::zeros(ndx, nu);
        if self.functions.has(1) {
            let given = self.functions.at(py, 1, t, x, u)?;
            let found = given.get_type();
            let given = given.cast::<PyDict>().map_err(|_| {
                PyTypeError::new_err(format!("calc_diff of a cost: expected a dict of q, r, Q, S, R, found {found}"))
            })?;
            for (name, entry) in given.iter() {
                match name.extract::<String>()?.as_str() {
                    name @ ("q" | "r" | "Q" | "S" | "R") => write(&mut knot, name, &entry)?,
                    other => {
                        let what = format!("calc_diff of a cost: expected q, r, Q, S or R, found '{other}'");
                        return Err(PyValueError::new_err(what));
                    }
                }
            }
            return Ok(knot);
        }
        let all = Differentiated { functions: &self.functions, space: &self.space, nu, batch: false, terminal: false };
        if !all.number(py, &self.way, t, [x, u], &mut knot)? {
            let mut slopes = vec![0.0; ndx + nu];
            self.differ(py, t, [x, u], &mut slopes)?;
            knot.q.copy_from_slice(&slopes[..ndx]);
            knot.r.copy_from_slice(&slopes[ndx..]);
            self.differ_twice(py, t, [x, u], &mut knot)?;
        }
        Ok(knot)
    }

    /// Computes the Hessian of a scalar cost by central differences.
    fn differ_twice(&self, py: Python<'_>, t: usize, [x, u]: [&[f64]; 2], knot: &mut LqKnot) -> PyResult<()> {
        let (ndx, n) = (self.space.ndx(), self.space.ndx() + u.len());
        let mut moved = x.to_vec();
        let mut at = |steps: [(usize, f64); 2]| {
            let mut z = vec![0.0; n];
            steps.iter().for_each(|(k, step)| z[*k] += step);
            self.space.integrate(x, &z[..ndx], &mut moved, &self.fault);
            let u: Vec<f64> = u.iter().zip(&z[ndx..]).map(|(u, z)| u + z).collect();
            let mut value = [0.0];
            self.try_calc(py, t, &moved, &u, &mut value)?;
            Ok::<_, PyErr>(value[0])
        };
        let h = SECOND_STEP;
        for i in 0..n {
            for j in 0..=i {
                let same = at([(i, h), (j, h)])? + at([(i, -h), (j, -h)])?;
                let curvature = (same - at([(i, h), (j, -h)])? - at([(i, -h), (j, h)])?) / (4.0 * h * h);
                write_curvature(knot, i, j, curvature);
            }
        }
        Ok(())
    }

    fn differ(&self, py: Python<'_>, t: usize, [x, u]: [&[f64]; 2], slopes: &mut [f64]) -> PyResult<()> {
        let (ndx, n) = (self.space.ndx(), self.space.ndx() + u.len());
        let (mut moved, mut values) = (x.to_vec(), [vec![0.0; self.size], vec![0.0; self.size]]);
        for k in 0..n {
            for (values, step) in values.iter_mut().zip([STEP, -STEP]) {
                let mut z = vec![0.0; n];
                z[k] = step;
                self.space.integrate(x, &z[..ndx], &mut moved, &self.fault);
                let u: Vec<f64> = u.iter().zip(&z[ndx..]).map(|(u, z)| u + z).collect();
                self.try_calc(py, t, &moved, &u, values)?;
            }
            for i in 0..self.size {
                slopes[i * n + k] = (values[0][i] - values[1][i]) / (2.0 * STEP);
            }
        }
        Ok(())
    }
}

impl ResidualFunction for OwnFunction {
    fn size(&self) -> usize {
        self.size
    }

    fn calc(&self, t: usize, x: &[f64], u: &[f64], r: &mut [f64]) {
        if unless_failed(&self.fault, |py| self.try_calc(py, t, x, u, r)).is_none() {
            r.fill(f64::NAN);
        }
    }

    fn calc_diff(&self, t: usize, x: &[f64], u: &[f64], by_x: &mut [f64], by_u: &mut [f64]) {
        let done = unless_failed(&self.fault, |py| self.try_calc_diff(py, t, [x, u], [&mut *by_x, &mut *by_u]));
        if done.is_none() {
            by_x.fill(f64::NAN);
        }
    }

    fn has_hessian(&self) -> bool {
        self.number
    }

    fn calc_hessian(
        &self,
        t: usize,
        x: &[f64],
        u: &[f64],
        d: &[f64],
        [by_x, by_u]: [&mut [f64]; 2],
        hessian: &mut Hessian,
    ) {
        let Some(knot) = unless_failed(&self.fault, |py| self.try_number(py, t, [x, u])) else {
            by_x.fill(f64::NAN);
            return;
        };
        by_x.copy_from_slice(knot.q.as_slice());
        by_u.copy_from_slice(knot.r.as_slice());
        hessian.xx.copy_from(&(knot.Q * d[0]));
        hessian.xu.copy_from(&(knot.S * d[0]));
        hessian.uu.copy_from(&(knot.R * d[0]));
    }
}
