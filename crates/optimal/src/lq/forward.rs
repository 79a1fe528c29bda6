//! Forward pass: the step of the trajectory that solves the linear-quadratic problem.
#![allow(non_snake_case)] // names follow the literature: A, B, D, E, L, T, U, X

use super::feedback::Factors;
use super::knot::LqKnot;
use super::structure::InverseDynamicsForm;
use condyle_linalg::{Vector, Vectorized, View, add_scaled_product, at_level, dot};

/// Scratch of the forward pass.
#[derive(Debug, Clone, Default)]
pub(crate) struct Forward {
    /// Unknowns and changes of the state, (w, δv, δq) or (δu, δx). Shape: nu + ndx.
    z: Vec<f64>,
    /// Change of the velocity after the step, y. Shape: ndx / 2.
    y: Vec<f64>,
}

impl Forward {
    /// Computes δu of a knot from δx, and δx⁺ into `next`. Returns the changes of the unknowns: δu, or, for a knot
    /// given as equations of inverse dynamics, the changes w of accelerations and forces.
    pub(crate) fn step(
        &mut self,
        knot: &LqKnot,
        factors: &Factors,
        dx: &[f64],
        du: &mut [f64],
        next: &mut [f64],
    ) -> &[f64] {
        let (n, m) = (knot.ndx(), knot.nu());
        let Self { z, y } = self;
        z.resize(m + n, 0.0);
        let (w, x) = z.split_at_mut(m);
        let turned = n - factors.turn;
        x[..turned].copy_from_slice(&dx[factors.turn..]);
        x[turned..].copy_from_slice(&dx[..factors.turn]);
        at_level(Solve { w, x, factors });
        next.copy_from_slice(knot.f.as_slice());
        if knot.structure.is_inverse_dynamics() {
            add_motion(knot, z, y, du, next);
        } else {
            du.copy_from_slice(w);
            add_scaled_product(next, 1.0, View::new(knot.A.as_slice(), n), dx);
            add_scaled_product(next, 1.0, View::new(knot.B.as_slice(), n), du);
        }
        &self.z[..m]
    }
}

/// Computes δu = U z, and adds δq⁺ = T δq + Δt E y and δv⁺ = y to `next`, for z = (w, δv, δq).
fn add_motion(knot: &LqKnot, z: &[f64], y: &mut Vec<f64>, du: &mut [f64], next: &mut [f64]) {
    let (n, m, InverseDynamicsForm { own, dependent, efforts, steps, stride, .. }) =
        (knot.ndx(), knot.nu(), &knot.inverse_dynamics);
    let nv = n / 2;
    let (dt, blocks) = knot.structure.euler().expect("the form is that of Euler steps");
    for (du, U) in du.iter_mut().zip(efforts.numbers.chunks_exact(*stride)) {
        *du = dot(&U[..m + n], z);
    }
    y.clear();
    y.extend_from_slice(&z[m..m + nv]);
    for &[c, k, length] in own {
        y[c..c + length].iter_mut().zip(&z[k..]).for_each(|(y, w)| *y += w);
    }
    for (&d, D) in dependent.iter().zip(steps.numbers.chunks_exact(*stride)) {
        y[d] += dot(&D[..m + n], z);
    }
    let (next_q, next_v) = next.split_at_mut(nv);
    let dq = &z[m + nv..];
    let mut from = 0;
    for block in blocks {
        let range = block.range();
        (from..range.start).for_each(|i| next_q[i] += dq[i] + dt * y[i]);
        for (row, i) in range.clone().enumerate() {
            for (column, j) in range.clone().enumerate() {
                next_q[i] += block.T[(row, column)] * dq[j] + dt * block.E[(row, column)] * y[j];
            }
        }
        from = range.end;
    }
    (from..nv).for_each(|i| next_q[i] += dq[i] + dt * y[i]);
    next_v.iter_mut().zip(&*y).for_each(|(next, y)| *next += y);
}

/// Solution of Lᵀ w = −(y + Xᵀ x).
struct Solve<'a> {
    w: &'a mut [f64],
    x: &'a [f64],
    factors: &'a Factors,
}

impl Vectorized for Solve<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { w, x, factors } = self;
        let (m, n) = (w.len(), x.len());
        let stride = m + n + 1;
        for j in (0..m).rev() {
            let column = &factors.numbers[j * stride..][..stride];
            let sum = column[m + n] + inner::<V>(&column[j + 1..m], &w[j + 1..]) + inner::<V>(&column[m..m + n], x);
            w[j] = -sum / column[j];
        }
    }
}

/// Returns the inner product of a and b.
#[inline(always)]
fn inner<V: Vector>(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = V::splat(0.0);
    let whole = a.len().min(b.len()) / V::N * V::N;
    let mut i = 0;
    while i < whole {
        sums = sums.add(V::load(&a[i..]).mul(V::load(&b[i..])));
        i += V::N;
    }
    let mut lanes = [0.0; 8];
    sums.store(&mut lanes);
    let mut sum: f64 = lanes[..V::N].iter().sum();
    (whole..a.len()).for_each(|i| sum += a[i] * b[i]);
    sum
}
