//! Residuals that are written in Python.

use super::automatic::{Differentiated, Way};
use super::functions::{Fault, Functions, unless_failed};
use super::space::Space;
use crate::arrays::{matrix, vector};
use condyle::optimal::robot::{Cost, Knot, Limit, Residual, ResidualFunction};
use pyo3::prelude::*;
use std::any::Any;

/// The step of central differences, about ε^⅓.
const STEP: f64 = 6e-6;

/// A residual of a robot that is written in Python.
pub(in crate::optimal) struct OwnFunction {
    pub size: usize,
    pub functions: Functions,
    pub space: Space,
    pub way: Way,
    /// Its first error.
    pub fault: Fault,
}

/// The places where the residuals of a knot that are written in Python leave their errors.
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
        if self.functions.has(1) {
            let (x, u): (Bound<'_, PyAny>, Bound<'_, PyAny>) = self.functions.at(py, 1, t, x, u)?.extract()?;
            by_x.copy_from_slice(&matrix("∂r/∂x", &x, [self.size, ndx])?);
            by_u.copy_from_slice(&matrix("∂r/∂u", &u, [self.size, nu])?);
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
}
