//! Linearised optimality conditions, factorised by one sweep, and their solution for given right-hand sides.
//!
//! For right-hand sides g, e and c, the solution ξ, υ, η, γ satisfies
//!
//! ```text
//! Qξ + Sυ + Aᵀη⁺ + Cᵀγ − η = g_x      Sᵀξ + Rυ + Bᵀη⁺ + Dᵀγ = g_u
//! ξ⁺ = Aξ + Bυ + e⁺,   ξ₀ = e₀        Cξ + Dυ + c = 0
//! ```
//!
//! Controls at a bound are taken out: their columns of B, S and D are zero, and their rows of R are rows of the
//! identity. The rows C, D enter by a method of multipliers: ρ (Cξ + Dυ + c)² / 2 is added to the cost, whose sweep is
//! factorised, and γ ← γ + ρ (Cξ + Dυ + c) is repeated until the rows hold. Source: Bertsekas, Constrained
//! Optimization and Lagrange Multiplier Methods, 1982, ch. 2.

use super::point::Point;
use super::wrong;
use crate::error::Error;
use crate::lq::{LqKnot, Sweep};
use crate::problem::Shape;
use nalgebra::{DMatrix, DVector, DVectorView, DVectorViewMut};

/// Weight ρ of the active rows, relative to the largest diagonal entry of a Hessian and to the square of a row. A
/// larger weight makes the method of multipliers faster, and loses digits.
const WEIGHT: f64 = 1e4;
/// Tolerance of the rows, relative to the terms of a row.
const TOLERANCE: f64 = 1e-12;
/// Maximum number of updates of the multipliers of the rows.
const MOST_UPDATES: usize = 200;
/// Largest error of the rows after these updates, relative to the terms of a row; above it, the rows are contradictory.
const CONTRADICTION: f64 = 1e-7;

/// Knot of the system, without its controls at a bound.
#[derive(Debug, Clone)]
pub(super) struct KnotFactor {
    pub A: DMatrix<f64>,
    pub B: DMatrix<f64>,
    C: DMatrix<f64>,
    D: DMatrix<f64>,
    /// Weight ρ of each active row.
    rho: DVector<f64>,
    /// Gain K, Cholesky factor of Quu, and Hessian of the value function, from the sweep.
    pub K: DMatrix<f64>,
    pub L: DMatrix<f64>,
    pub P: DMatrix<f64>,
}

/// Factors of the linearised optimality conditions, with the vectors of one solution.
#[derive(Debug, Clone)]
pub(super) struct System {
    knots: Vec<KnotFactor>,
    shape: Shape,
    /// Gradient p of the value function at each knot, (N + 1) · ndx. Written by: `pass`.
    p: Vec<f64>,
    /// Feed-forward k of each knot, as the controls. Written by: `pass`.
    k: Vec<f64>,
    /// Right-hand side g with the terms of the rows. Written by: `solve`.
    effective: Vectors,
}

/// Vectors at all knots: numbers for the states, the controls, the dynamics and the active rows.
#[derive(Debug, Clone, Default)]
pub(super) struct Vectors {
    /// Vectors g_x or ξ, (N + 1) · ndx.
    pub x: Vec<f64>,
    /// Vectors g_u or υ, one after the other.
    pub u: Vec<f64>,
    /// Vectors e or η, (N + 1) · ndx.
    pub dynamics: Vec<f64>,
    /// Vectors c or γ of each knot's active rows.
    pub rows: Vec<DVector<f64>>,
}

impl Vectors {
    /// Creates vectors of zeros.
    pub(super) fn zeros(point: &Point) -> Self {
        let states = vec![0.0; (point.shape.horizon() + 1) * point.shape.ndx];
        let rows = point.rows.iter().map(|rows| DVector::zeros(rows.active.len())).collect();
        Self { x: states.clone(), u: vec![0.0; point.us.len()], dynamics: states, rows }
    }

    /// Sets all numbers to zero.
    pub(super) fn clear(&mut self) {
        [&mut self.x, &mut self.u, &mut self.dynamics].into_iter().for_each(|numbers| numbers.fill(0.0));
        self.rows.iter_mut().for_each(|rows| rows.fill(0.0));
    }
}

impl System {
    /// Factorises the optimality conditions at a solution.
    pub(super) fn new(point: &Point) -> Result<Self, Error> {
        let scale = point.knots.iter().map(largest_diagonal).fold(f64::MIN_POSITIVE, f64::max);
        let (mut lq, mut knots) = (Vec::new(), Vec::new());
        for (t, knot) in point.knots.iter().enumerate() {
            let (knot, factor) = without_bounded(point, t, knot, scale);
            lq.push(knot);
            knots.push(factor);
        }
        let mut sweep = Sweep::new(&lq);
        sweep.run(&lq, 0.0).map_err(|error| {
            wrong(format!("the solution is no strict minimum, so its derivatives do not exist ({error})"))
        })?;
        for (t, (factor, feedback)) in knots.iter_mut().zip(sweep.feedback()).enumerate() {
            factor.K.copy_from(&feedback.K);
            factor.P.copy_from(&feedback.Vxx);
            if !feedback.k.is_empty() {
                let cholesky = feedback.Quu.clone().cholesky();
                factor.L = cholesky.ok_or_else(|| wrong(format!("knot {t}: Quu is not positive definite")))?.unpack();
            }
        }
        let (shape, effective) = (point.shape.clone(), Vectors::zeros(point));
        Ok(Self { knots, shape, p: effective.x.clone(), k: effective.u.clone(), effective })
    }

    /// Returns the factors of all knots.
    pub(super) fn factors(&self) -> &[KnotFactor] {
        &self.knots
    }

    /// Returns the gain of the first knot.
    pub(super) fn first_gain(&self) -> &DMatrix<f64> {
        &self.knots[0].K
    }

    /// Solves the system for the right-hand side `given` into `out`.
    ///
    /// # Errors
    /// [`Error::Sensitivity`] if the active rows contradict each other.
    pub(super) fn solve(&mut self, given: &Vectors, out: &mut Vectors) -> Result<(), Error> {
        out.rows.iter_mut().for_each(|rows| rows.fill(0.0));
        if self.knots.iter().all(|knot| knot.rho.is_empty()) {
            self.pass(given, &given.x, &given.u, out);
            return Ok(());
        }
        let mut effective = std::mem::take(&mut self.effective);
        let mut worst = f64::INFINITY;
        for _ in 0..MOST_UPDATES {
            self.add_rows(given, &out.rows, &mut effective);
            self.pass(given, &effective.x, &effective.u, out);
            let before = std::mem::replace(&mut worst, self.update_rows(given, out));
            // rounding errors end the decrease
            if worst <= TOLERANCE || (worst <= 1e3 * TOLERANCE && worst >= 0.5 * before) {
                break;
            }
        }
        self.effective = effective;
        match worst <= CONTRADICTION {
            true => Ok(()),
            false => Err(wrong(
                "the active constraints contradict each other, so the derivatives of the solution do not exist",
            )),
        }
    }

    /// Writes g − Cᵀ(γ + ρ c) and g − Dᵀ(γ + ρ c).
    fn add_rows(&self, given: &Vectors, gamma: &[DVector<f64>], effective: &mut Vectors) {
        effective.x.copy_from_slice(&given.x);
        effective.u.copy_from_slice(&given.u);
        for (t, KnotFactor { C, D, rho, .. }) in self.knots.iter().enumerate() {
            if rho.is_empty() {
                continue;
            }
            let force = &gamma[t] + rho.component_mul(&given.rows[t]);
            slice_mut(&mut effective.x[self.shape.dx(t)]).gemv_tr(-1.0, C, &force, 1.0);
            slice_mut(&mut effective.u[self.shape.u(t)]).gemv_tr(-1.0, D, &force, 1.0);
        }
    }

    /// Updates γ ← γ + ρ (Cξ + Dυ + c). Returns the largest row |Cξ + Dυ + c|, relative to its terms.
    fn update_rows(&self, given: &Vectors, out: &mut Vectors) -> f64 {
        let mut worst = 0.0_f64;
        for (t, KnotFactor { C, D, rho, .. }) in self.knots.iter().enumerate() {
            if rho.is_empty() {
                continue;
            }
            let (x, u) = (slice(&out.x[self.shape.dx(t)]), slice(&out.u[self.shape.u(t)]));
            let largest = out.x.iter().chain(&out.u).fold(0.0_f64, |largest, x| largest.max(x.abs()));
            let mut error = given.rows[t].clone();
            error.gemv(1.0, C, &x, 1.0);
            error.gemv(1.0, D, &u, 1.0);
            for i in 0..error.len() {
                let size = (C.row(i).norm_squared() + D.row(i).norm_squared()).sqrt();
                let terms = given.rows[t][i].abs() + size * largest;
                if terms > 0.0 {
                    worst = worst.max(error[i].abs() / terms);
                }
            }
            out.rows[t] += rho.component_mul(&error);
        }
        worst
    }

    /// Solves the system without rows: backward for p and k, then forward for ξ, υ and η.
    fn pass(&mut self, given: &Vectors, g_x: &[f64], g_u: &[f64], out: &mut Vectors) {
        let Self { knots, shape, p, k, .. } = self;
        let (horizon, ndx) = (shape.horizon(), shape.ndx);
        let e = &given.dynamics;
        let is_zero = |numbers: &[f64]| numbers.iter().all(|x| *x == 0.0);
        let last = (0..=horizon)
            .rev()
            .find(|&t| !is_zero(&g_x[shape.dx(t)]) || !is_zero(&g_u[shape.u(t)]) || !is_zero(&e[shape.dx(t)]));
        let last = last.unwrap_or(0);
        p[(last + 1).min(horizon) * ndx..].fill(0.0);
        k[shape.offsets[(last + 1).min(horizon)]..].fill(0.0);
        for t in (0..=last).rev() {
            let KnotFactor { A, B, K, L, .. } = &knots[t];
            let (own, after) = p.split_at_mut((t + 1) * ndx);
            let mut own = slice_mut(&mut own[t * ndx..]);
            own.copy_from_slice(&g_x[shape.dx(t)]);
            own.neg_mut();
            if t == horizon {
                continue;
            }
            // p⁺ + P⁺ e⁺, the gradient of the value function at the predicted state
            let ahead = &mut out.dynamics[shape.dx(t + 1)];
            ahead.copy_from_slice(&after[..ndx]);
            let e = &e[shape.dx(t + 1)];
            if !is_zero(e) {
                slice_mut(ahead).gemv(1.0, &knots[t + 1].P, &slice(e), 1.0);
            }
            let ahead = slice(ahead);
            let mut k = slice_mut(&mut k[shape.u(t)]);
            k.copy_from_slice(&g_u[shape.u(t)]);
            k.gemv_tr(1.0, B, &ahead, -1.0); // Qu = Bᵀ(p⁺ + P⁺ e⁺) − g_u
            own.gemv_tr(1.0, A, &ahead, 1.0);
            own.gemv_tr(1.0, K, &k, 1.0); // p = Qx + KᵀQu
            if !k.is_empty() {
                L.solve_lower_triangular_mut(&mut k);
                L.tr_solve_lower_triangular_mut(&mut k);
                k.neg_mut(); // k = −Quu⁻¹ Qu
            }
        }
        out.x[..ndx].copy_from_slice(&e[..ndx]);
        for t in 0..=horizon {
            let KnotFactor { A, B, K, P, .. } = &knots[t];
            let (now, after) = out.x.split_at_mut((t + 1) * ndx);
            let x = slice(&now[t * ndx..]);
            let mut eta = slice_mut(&mut out.dynamics[shape.dx(t)]);
            eta.copy_from_slice(&p[shape.dx(t)]);
            eta.gemv(1.0, P, &x, 1.0); // η = p + P ξ
            if t < horizon {
                let mut u = slice_mut(&mut out.u[shape.u(t)]);
                u.copy_from_slice(&k[shape.u(t)]);
                u.gemv(1.0, K, &x, 1.0);
                let mut next = slice_mut(&mut after[..ndx]);
                next.copy_from_slice(&e[shape.dx(t + 1)]);
                next.gemv(1.0, A, &x, 1.0);
                next.gemv(1.0, B, &u, 1.0);
            }
        }
    }
}

/// Returns the largest absolute value on the diagonal of a knot's Hessian.
fn largest_diagonal(knot: &LqKnot) -> f64 {
    knot.Q.diagonal().iter().chain(&knot.R.diagonal()).fold(0.0, |largest: f64, x| largest.max(x.abs()))
}

/// Returns knot t without its controls at a bound and with the weights of its active rows, and its matrices for passes.
fn without_bounded(point: &Point, t: usize, knot: &LqKnot, scale: f64) -> (LqKnot, KnotFactor) {
    let (mut knot, rows) = (knot.clone(), &point.rows[t]);
    let (C, mut D) = (rows.C.clone(), rows.D.clone());
    for &(i, _) in &point.controls[t] {
        knot.B.column_mut(i).fill(0.0);
        knot.S.column_mut(i).fill(0.0);
        knot.R.column_mut(i).fill(0.0);
        knot.R.row_mut(i).fill(0.0);
        knot.R[(i, i)] = 1.0;
        D.column_mut(i).fill(0.0);
    }
    let sizes = (0..C.nrows()).map(|i| C.row(i).norm_squared() + D.row(i).norm_squared());
    let rho = sizes.map(|size| if size > 0.0 { WEIGHT * scale / size } else { 0.0 });
    let rho = DVector::from_iterator(C.nrows(), rho);
    if !rho.is_empty() {
        let weighted = |rows: &DMatrix<f64>| DMatrix::from_diagonal(&rho) * rows;
        knot.Q += C.tr_mul(&weighted(&C));
        knot.S += C.tr_mul(&weighted(&D));
        knot.R += D.tr_mul(&weighted(&D));
    }
    let (ndx, nu) = (knot.ndx(), knot.nu());
    let (A, B) = (knot.A.clone(), knot.B.clone());
    let (K, L, P) = (DMatrix::zeros(nu, ndx), DMatrix::zeros(nu, nu), DMatrix::zeros(ndx, ndx));
    (knot, KnotFactor { A, B, C, D, rho, K, L, P })
}

/// Returns a slice as a vector.
pub(super) fn slice(numbers: &[f64]) -> DVectorView<'_, f64> {
    DVectorView::from_slice(numbers, numbers.len())
}

/// Returns a slice as a mutable vector.
fn slice_mut(numbers: &mut [f64]) -> DVectorViewMut<'_, f64> {
    let length = numbers.len();
    DVectorViewMut::from_slice(numbers, length)
}
