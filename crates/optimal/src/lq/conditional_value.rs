//! Conditional value functions. Such a function is the lowest cost of a segment of a horizon, as a function of the
//! state at the start of the segment and of a multiplier for the state after its end.
//!
//! Let x be the state at the first knot of a segment and z the state after its last knot. The lowest cost of the
//! segment plus λᵀz, with a multiplier λ as a parameter, is quadratic in x and λ:
//!
//! ```text
//! V(x, λ) = ½ xᵀPx + pᵀx + λᵀ(Θ x + θ) − ½ λᵀC λ + const
//! ```
//!
//! The recursion starts after the last knot of the segment with P = 0, p = 0, Θ = 1, θ = 0, C = 0. Rows for λ are
//! appended below the quadratic form H of a Riccati step (notation as in [`Sweep`](crate::Sweep)). The elimination in
//! the step then computes V knot by knot:
//!
//! ```text
//! ⎡ H       ⎤      ⎡ L  ·   ⎤      Y = Θ⁺B L⁻ᵀ,   Θ = Θ⁺A − Y Xᵀ
//! ⎢         ⎥  →   ⎢ X  Vxx ⎥      θ = θ⁺ + Θ⁺f − Y y
//! ⎣ Θ⁺[B A] ⎦      ⎣ Y  Θ   ⎦      C = C⁺ + Y Yᵀ
//! ```
//!
//! The optimal z is ∂V/∂λ = Θ x + θ − C λ. Let the cost after the segment be ½ zᵀP₁z + p₁ᵀz; the multiplier is then λ =
//! P₁z + p₁. Eliminating z and λ, with P₁ = L Lᵀ and M = 1 + LᵀC L, gives the value function at the start of the
//! segment:
//!
//! ```text
//! P₀ = P + (ΘᵀL) M⁻¹ (ΘᵀL)ᵀ,      p₀ = p + Θᵀp₁ + (ΘᵀL) M⁻¹ Lᵀ(θ − C p₁)
//! ```
//!
//! Särkkä and García-Fernández, "Temporal parallelization of dynamic programming and linear quadratic control" (IEEE
//! TAC, 2023), introduce conditional value functions, with x and z as variables. Jallet, Dantec, Arlaud, Mansard,
//! Carpentier, "Parallel and proximal constrained linear-quadratic methods for real-time nonlinear MPC" (RSS 2024), use
//! x and λ as variables, as here.
#![allow(non_snake_case)] // names follow the literature

use super::knot::LqKnot;
use super::step::Step;
use condyle_linalg::{
    View, add_product_lower, add_scaled_product, copy_lower, copy_matrix, copy_symmetric, dot, eliminate, padded,
    product_of_upper_lower, product_with_upper, transpose,
};

/// Value function V(x) = ½ xᵀP x + pᵀx. P is symmetric, with both triangles filled and with padding rows.
#[derive(Debug, Clone)]
pub(crate) struct Value {
    pub(crate) P: Vec<f64>,
    pub(crate) p: Vec<f64>,
}

impl Value {
    /// Creates the value function of n states that is zero everywhere.
    pub(crate) fn zeros(n: usize) -> Self {
        Self { P: vec![0.0; padded(n) * n], p: vec![0.0; n] }
    }

    pub(crate) fn copy_from(&mut self, P: &[f64], p: &[f64]) {
        self.P.copy_from_slice(P);
        self.p.copy_from_slice(p);
    }
}

/// Terms Θ, θ and C of a conditional value function, which depend on the multiplier. The terms P and p are stored in
/// the [`Step`] of the segment. Matrices have padding rows.
#[derive(Debug, Clone)]
pub(crate) struct SegmentValue {
    /// Matrix Θ of the term λᵀΘ x, n × n.
    Theta: Vec<f64>,
    /// Vector θ of the term λᵀθ, n entries.
    theta: Vec<f64>,
    /// Lower triangle of the matrix C of the term −½ λᵀC λ.
    C: Vec<f64>,
}

impl SegmentValue {
    /// Creates matrices Θ and C and a vector θ of zeros, for n states.
    pub(crate) fn zeros(n: usize) -> Self {
        let square = || vec![0.0; padded(n) * n];
        Self { Theta: square(), theta: vec![0.0; n], C: square() }
    }

    /// Computes P, p, Θ, θ and C of a segment from its knots. Returns whether Quu was positive definite at all knots.
    pub(crate) fn run(&mut self, step: &mut Step, knots: &[LqKnot], regularisation: f64) -> bool {
        let (n, ld) = (self.theta.len(), padded(self.theta.len()));
        let work = &mut step.work;
        for zero in [&mut work.P[..], &mut work.p, &mut self.Theta, &mut self.theta, &mut self.C] {
            zero.fill(0.0);
        }
        for j in 0..n {
            self.Theta[j * ld + j] = 1.0;
        }
        knots.iter().rev().all(|knot| self.step(step, knot, regularisation))
    }

    /// Makes the recursion step of one knot. Returns whether Quu was positive definite.
    fn step(&mut self, step: &mut Step, knot: &LqKnot, regularisation: f64) -> bool {
        let (n, m) = (knot.ndx(), knot.nu());
        let (ldt, last) = (padded(n), m + n);
        let Self { Theta, theta, C } = self;
        if knot.f.iter().any(|f| *f != 0.0) {
            add_scaled_product(theta, 1.0, View::new(Theta, ldt), knot.f.as_slice()); // θ + Θ f
        }
        let (work, turn) = step.write_with_rows_below(knot, regularisation, Theta);
        let ld = work.stride(m);
        if eliminate(&mut work.H, ld, [last + 1 + n, last, m]).is_err() {
            return false;
        }
        work.take_value(ld, m, turn);
        for j in 0..n {
            work.P[j * ldt + j] += regularisation;
        }
        // copy Θ, with its columns rotated back to the order of the state; then update θ and C with Y
        let (below, split) = (&work.H[last + 1..], n - turn);
        copy_matrix(&mut Theta[turn * ldt..], ldt, View::new(&below[m * ld..], ld), [n, split]);
        if turn > 0 {
            copy_matrix(Theta, ldt, View::new(&below[(m + split) * ld..], ld), [n, turn]);
        }
        for j in 0..m {
            let (y, Y) = work.H[j * ld + last..][..n + 1].split_at(1);
            add_scaled_product(theta, -y[0], View::new(Y, n), &[1.0]);
        }
        let Y = View::new(below, ld);
        add_product_lower(C, ldt, [n, n, m], Y, Y);
        true
    }
}

/// Computation of the value function at the start of a segment from the value function at the end of the segment, with
/// scratch. Matrices have padding rows and the stride `padded(n + 1)`.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    /// Matrix C, with both triangles filled.
    C: Vec<f64>,
    L: Vec<f64>,
    /// Matrix Lᵀ, including its zeros.
    upper: Vec<f64>,
    /// Product C L.
    CL: Vec<f64>,
    /// Matrix (C L)ᵀ, overwritten by [Θ, θ − C p₁]ᵀ.
    rows: Vec<f64>,
    /// Matrix [M ·; ΘᵀL −P₀; (θ − C p₁)ᵀL −p₀ᵀ], with the stride `padded(2 * n + 1)`.
    H: Vec<f64>,
}

impl Link {
    pub(crate) fn new(n: usize) -> Self {
        let square = || vec![0.0; padded(n + 1) * n];
        let H = vec![0.0; padded(2 * n + 1) * 2 * n];
        Self { C: square(), L: square(), upper: square(), CL: square(), rows: square(), H }
    }

    /// Computes the factor L of P₁ = L Lᵀ, and Lᵀ. Returns whether the factorisation exists. P₁ may be singular if some
    /// states have no cost; rounding then decides whether a pivot is positive. A second try therefore adds n rounding
    /// errors of the largest entry to the diagonal.
    fn factorise(&mut self, P: &[f64], n: usize) -> bool {
        let (ld, ldp) = (padded(n + 1), padded(n));
        let mut largest = 0.0_f64;
        for j in 0..n {
            largest = largest.max(P[j * ldp + j]);
        }
        for more in [0.0, n as f64 * f64::EPSILON * largest] {
            copy_lower(&mut self.L, ld, View::new(P, ldp), n);
            for j in 0..n {
                self.L[j * ld + j] += more;
            }
            if eliminate(&mut self.L, ld, [n, n, n]).is_ok() {
                transpose(&mut self.upper, ld, View::new(&self.L, ld), [n, n]);
                for k in 0..n {
                    self.upper[k * ld + k + 1..(k + 1) * ld].fill(0.0);
                }
                return true;
            }
        }
        false
    }

    /// Computes the value function `start` at the start of a segment from the value function `end` at the end of the
    /// segment. P and p of the conditional value function are in `step`. Returns whether `end` is convex.
    pub(crate) fn run(&mut self, step: &Step, segment: &SegmentValue, end: &Value, start: &mut Value) -> bool {
        let (n, work) = (end.p.len(), &step.work);
        let (ld, ldp, ldh) = (padded(n + 1), padded(n), padded(2 * n + 1));
        if !self.factorise(&end.P, n) {
            return false;
        }
        let Self { C, upper, CL, rows, H, .. } = self;
        let upper = View::new(upper, ld);

        // computes M = 1 + Lᵀ(C L)
        copy_symmetric(C, ld, View::new(&segment.C, ldp), n);
        product_with_upper(CL, ld, [n, n], View::new(C, ld), upper);
        transpose(rows, ld, View::new(CL, ld), [n, n]);
        product_of_upper_lower(H, ldh, n, upper, View::new(rows, ld));
        for j in 0..n {
            H[j * ldh + j] += 1.0;
        }

        // computes [Θ, θ − C p₁]ᵀL
        transpose(rows, ld, View::new(&segment.Theta, ldp), [n, n]);
        for k in 0..n {
            rows[k * ld + n] = segment.theta[k] - dot(&C[k * ld..][..n], &end.p);
        }
        product_with_upper(&mut H[n..], ldh, [n + 1, n], View::new(rows, ld), upper);

        // −P and −(p + Θᵀp₁): both have reversed signs, because the elimination subtracts what the equations add to P
        // and p
        for j in 0..n {
            let (H, P) = (&mut H[(n + j) * ldh + n..][..n + 1], &work.P[j * ldp..][..n]);
            for i in j..n {
                H[i] = -P[i];
            }
            H[n] = -work.p[j] - dot(&segment.Theta[j * ldp..][..n], &end.p);
        }
        if eliminate(H, ldh, [2 * n + 1, 2 * n, n]).is_err() {
            return false;
        }
        copy_symmetric(&mut start.P, ldp, View::new(&H[n * ldh + n..], ldh), n);
        for j in 0..n {
            for i in 0..n {
                start.P[j * ldp + i] = -start.P[j * ldp + i];
            }
            start.p[j] = -H[(n + j) * ldh + 2 * n];
        }
        true
    }
}
