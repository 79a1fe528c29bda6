//! What a segment of a horizon costs, for every state at its start and whatever comes after its end.
//!
//! Let x be the state at the first knot of a segment and z that after its last one. The least cost of the segment plus
//! λᵀz, with a multiplier λ as a parameter, is quadratic in both,
//!
//! ```text
//! V(x, λ) = ½ xᵀPx + pᵀx + λᵀ(Θ x + θ) − ½ λᵀC λ + const
//! ```
//!
//! and with P = 0, p = 0, Θ = 1, θ = 0, C = 0 behind the segment, the elimination of a Riccati step gives it knot by knot, if
//! λ has rows below H ([`Sweep`](crate::Sweep) has the rest):
//!
//! ```text
//! ⎡ H       ⎤      ⎡ L  ·   ⎤      Y = Θ⁺B L⁻ᵀ,   Θ = Θ⁺A − Y Xᵀ
//! ⎢         ⎥  →   ⎢ X  Vxx ⎥      θ = θ⁺ + Θ⁺f − Y y
//! ⎣ Θ⁺[B A] ⎦      ⎣ Y  Θ   ⎦      C = C⁺ + Y Yᵀ
//! ```
//!
//! The best z is ∂V/∂λ = Θ x + θ − C λ. If what comes after is worth ½ zᵀP₁z + p₁ᵀz, its multiplier is λ = P₁z + p₁; with
//! both eliminated, P₁ = L Lᵀ and M = 1 + LᵀC L, the value function at the start of the segment has
//!
//! ```text
//! P₀ = P + (ΘᵀL) M⁻¹ (ΘᵀL)ᵀ,      p₀ = p + Θᵀp₁ + (ΘᵀL) M⁻¹ Lᵀ(θ − C p₁)
//! ```
//!
//! Särkkä and García-Fernández, "Temporal parallelization of dynamic programming and linear quadratic control" (IEEE
//! TAC, 2023), call V a conditional value function, and have it of x and z; Jallet, Dantec, Arlaud, Mansard, Carpentier,
//! "Parallel and proximal constrained linear-quadratic methods for real-time nonlinear MPC" (RSS 2024), of x and λ.
#![allow(non_snake_case)] // the names of the literature

use crate::dense::{
    SLACK, Store, View, add_product_lower, add_scaled_product, column_block, copy, copy_symmetric, dot, product,
    transpose,
};
use crate::factor::eliminate;
use crate::lq::LqNode;
use crate::riccati::Work;
use crate::vector::{Dense, Vector};

/// A value function; P is symmetric and full, with slack rows.
#[derive(Debug, Clone)]
pub(crate) struct Value {
    pub(crate) P: Vec<f64>,
    pub(crate) p: Vec<f64>,
}

impl Value {
    pub(crate) fn zeros(n: usize) -> Self {
        Self { P: vec![0.0; (n + SLACK) * n], p: vec![0.0; n] }
    }

    pub(crate) fn copy_from(&mut self, P: &[f64], p: &[f64]) {
        self.P.copy_from_slice(P);
        self.p.copy_from_slice(p);
    }
}

/// How the end of a segment depends on its start and on the multiplier; beside P and p, which are in its [`Work`].
/// Matrices have slack rows.
#[derive(Debug, Clone)]
pub(crate) struct Transfer {
    Theta: Vec<f64>,
    theta: Vec<f64>,
    /// Its lower triangle.
    C: Vec<f64>,
}

impl Transfer {
    pub(crate) fn zeros(n: usize) -> Self {
        let square = || vec![0.0; (n + SLACK) * n];
        Self { Theta: square(), theta: vec![0.0; n], C: square() }
    }

    /// P, p, Θ, θ and C of a segment from its nodes. Whether all Quu were positive definite.
    #[inline(always)]
    pub(crate) fn run<V: Vector, const NR: usize>(
        &mut self,
        work: &mut Work,
        nodes: &[LqNode],
        regularisation: f64,
    ) -> bool {
        let (n, ld) = (self.theta.len(), self.theta.len() + SLACK);
        for zero in [&mut work.P, &mut work.p, &mut self.Theta, &mut self.theta, &mut self.C] {
            zero.fill(0.0);
        }
        for j in 0..n {
            self.Theta[j * ld + j] = 1.0;
        }
        for i in (0..nodes.len()).rev() {
            if !self.step::<V, NR>(work, &nodes[i], regularisation) {
                return false;
            }
        }
        true
    }

    /// One knot.
    #[inline(always)]
    fn step<V: Vector, const NR: usize>(&mut self, work: &mut Work, node: &LqNode, regularisation: f64) -> bool {
        let (n, m) = (node.ndx(), node.nu());
        let (ld, ldt, last) = (work.stride(m), n + SLACK, m + n);
        let Self { Theta, theta, C } = self;
        for k in 0..n {
            if node.f[k] != 0.0 {
                add_scaled_product(theta, node.f[k], &Theta[k * ldt..][..n], &[1.0]); // θ + Θ f
            }
        }
        let shift = work.form::<V, NR>(0, node, regularisation, &mut |_, _, _| false);
        match node.euler() {
            Some((dt, blocks)) if node.implicit.active => {
                work.add_implicit_below::<V, NR>(Theta, node, dt, blocks);
            }
            Some((dt, blocks)) => work.add_euler_below::<V, NR>(Theta, m, dt, blocks),
            None => {
                let (Theta, F) = (View { data: Theta, stride: ldt }, View { data: &work.F, stride: ld });
                product::<V, NR>(&mut work.H[last + 1..], ld, [n, last, n], Theta, F);
            }
        }
        if eliminate::<V, NR>(&mut work.H, ld, last + 1 + n, last, m).is_err() {
            return false;
        }
        work.take_value::<V>(ld, m, shift);
        for j in 0..n {
            work.P[j * ldt + j] += regularisation;
            let state = if j < n - shift { j + shift } else { j + shift - n };
            copy::<V>(&mut Theta[state * ldt..], &work.H[(m + j) * ld + last + 1..][..n]);
        }
        for j in 0..m {
            let (y, Y) = work.H[j * ld + last..][..n + 1].split_at(1);
            add_scaled_product(theta, -y[0], Y, &[1.0]);
        }
        let Y = View { data: &work.H[last + 1..], stride: ld };
        add_product_lower::<V, NR>(C, ldt, [n, n, m], Y, Y);
        true
    }
}

/// Scratch for the value function at the start of a segment, given that at its end. Matrices have slack rows, and the
/// stride n + 1 + SLACK.
#[derive(Debug, Clone)]
pub(crate) struct Link {
    /// C, both triangles.
    C: Vec<f64>,
    L: Vec<f64>,
    /// Lᵀ, with its zeros.
    upper: Vec<f64>,
    /// C L.
    CL: Vec<f64>,
    /// (C L)ᵀ, and then [Θ, θ − C p₁]ᵀ.
    rows: Vec<f64>,
    /// [M ·; ΘᵀL −P₀; (θ − C p₁)ᵀL −p₀ᵀ]; with the stride 2n + 1 + SLACK.
    H: Vec<f64>,
}

impl Link {
    pub(crate) fn new(n: usize) -> Self {
        let square = || vec![0.0; (n + 1 + SLACK) * n];
        let H = vec![0.0; (2 * n + 1 + SLACK) * 2 * n];
        Self { C: square(), L: square(), upper: square(), CL: square(), rows: square(), H }
    }

    /// L of P₁ = L Lᵀ, and its transpose. Where states cost nothing P₁ may be singular, and then rounding decides whether
    /// a pivot is positive: a second try has a little more on the diagonal.
    #[inline(always)]
    fn factorise<V: Vector, const NR: usize>(&mut self, P: &[f64], n: usize) -> bool {
        let (ld, ldp) = (n + 1 + SLACK, n + SLACK);
        let mut largest = 0.0_f64;
        for j in 0..n {
            largest = largest.max(P[j * ldp + j]);
        }
        for more in [0.0, n as f64 * f64::EPSILON * largest] {
            for j in 0..n {
                copy::<V>(&mut self.L[j * ld + j..], &P[j * ldp + j..][..n - j]);
                self.L[j * ld + j] += more;
            }
            if eliminate::<V, NR>(&mut self.L, ld, n, n, n).is_ok() {
                transpose::<V>(&mut self.upper, ld, 0, &self.L, ld, 0..n, 0..n);
                for k in 0..n {
                    self.upper[k * ld + k + 1..(k + 1) * ld].fill(0.0);
                }
                return true;
            }
        }
        false
    }

    /// The value function `start` at the start of a segment with P, p in `work`, from the one at its `end`. Whether
    /// that one is convex.
    #[inline(always)]
    pub(crate) fn run<V: Vector, const NR: usize>(
        &mut self,
        work: &Work,
        transfer: &Transfer,
        end: &Value,
        start: &mut Value,
    ) -> bool {
        let n = end.p.len();
        let (ld, ldp, ldh) = (n + 1 + SLACK, n + SLACK, 2 * n + 1 + SLACK);
        if !self.factorise::<V, NR>(&end.P, n) {
            return false;
        }
        let Self { C, upper, CL, rows, H, .. } = self;

        // M = 1 + Lᵀ(C L)
        copy_symmetric::<V>(C, ld, &transfer.C, ldp, n);
        times_lower::<V, NR>(CL, ld, n, n, View { data: C, stride: ld }, upper, ld, false);
        transpose::<V>(rows, ld, 0, CL, ld, 0..n, 0..n);
        times_lower::<V, NR>(H, ldh, n, n, View { data: upper, stride: ld }, rows, ld, true);
        for j in 0..n {
            H[j * ldh + j] += 1.0;
        }

        // [Θ, θ − C p₁]ᵀL
        transpose::<V>(rows, ld, 0, &transfer.Theta, ldp, 0..n, 0..n);
        for k in 0..n {
            rows[k * ld + n] = transfer.theta[k] - dot(&C[k * ld..][..n], &end.p);
        }
        times_lower::<V, NR>(&mut H[n..], ldh, n + 1, n, View { data: rows, stride: ld }, upper, ld, false);

        // −P and −(p + Θᵀp₁), from which the elimination subtracts what is to be added to P and p
        for j in 0..n {
            let (H, P) = (&mut H[(n + j) * ldh + n..][..n + 1], &work.P[j * ldp..][..n]);
            for i in j..n {
                H[i] = -P[i];
            }
            H[n] = -work.p[j] - dot(&transfer.Theta[j * ldp..][..n], &end.p);
        }
        if eliminate::<V, NR>(H, ldh, 2 * n + 1, 2 * n, n).is_err() {
            return false;
        }
        copy_symmetric::<V>(&mut start.P, ldp, &H[n * ldh + n..], ldh, n);
        for j in 0..n {
            for i in 0..n {
                start.P[j * ldp + i] = -start.P[j * ldp + i];
            }
            start.p[j] = -H[(n + j) * ldh + 2 * n];
        }
        true
    }
}

/// C ← A B for n rows k of B, of which the j-th entry is zero for j > k, given as columns of Bᵀ (`b`, stride `ldb`); all
/// `rows` rows, or the lower triangle for a lower A.
#[inline(always)]
fn times_lower<V: Vector, const NR: usize>(
    c: &mut [f64],
    ldc: usize,
    rows: usize,
    n: usize,
    a: View<'_>,
    b: &[f64],
    ldb: usize,
    lower: bool,
) {
    let mut j = 0;
    while j < n {
        let first = if lower { j } else { 0 };
        let (a, b) = (View { data: &a.data[j * a.stride..], ..a }, View { data: &b[j * ldb..], stride: ldb });
        column_block::<V, NR>(c, ldc, first..rows, j, NR.min(n - j), a, b, n - j, Store::Set);
        j += NR;
    }
}

/// A link, to be compiled for the processor.
pub(crate) struct Linking<'a> {
    pub(crate) link: &'a mut Link,
    pub(crate) work: &'a Work,
    pub(crate) transfer: &'a Transfer,
    pub(crate) end: &'a Value,
    pub(crate) start: &'a mut Value,
    pub(crate) good: &'a mut bool,
}

impl Dense for Linking<'_> {
    #[inline(always)]
    fn run<V: Vector, const NR: usize>(self) {
        *self.good = self.link.run::<V, NR>(self.work, self.transfer, self.end, self.start);
    }
}
