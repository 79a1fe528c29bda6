//! Linear system of each iteration. Its matrix H for x is positive definite; the equalities are solved by a Schur
//! complement.
//!
//! ```text
//! [ H   −Eᵀ ] [dx]   [r₁]        H = P + Gᵀ D G + Fᵀ W⁻² F
//! [ E    0  ] [dy] = [r₂]
//! ```
//!
//! With H = L Lᵀ and X = E L⁻ᵀ: X Xᵀ dy = r₂ − X L⁻¹ r₁, Lᵀ dx = L⁻¹ r₁ + Xᵀ dy. If equalities exist, Eᵀ E is added to
//! H and Eᵀ r₂ to r₁. The solution stays the same, and H + Eᵀ E can be regular even if H is singular.

use super::scaled::Scaled;
use condyle_linalg::{
    OuterProducts, SLACK, View, add_product_vector, add_scaled_product, backward_solve, eliminate, forward_solve, mask,
    transposed_product_vector,
};

/// Regularisation added to diagonal entries of the matrix H of the linear system. These entries have size one for costs
/// of size one. Iterative refinement removes the effect of the regularisation.
const REGULARISATION: f64 = 1e-13;
/// Regularisation relative to the diagonal entry, as large as a few rounding errors of a factorisation.
const RELATIVE_REGULARISATION: f64 = 1e-15;
/// Regularisation added to diagonal entries of the Schur complement X Xᵀ of the equalities. These entries have size one
/// for costs of size one.
const DUAL_REGULARISATION: f64 = 1e-13;
/// Factor by which the regularisation grows after a pivot that was not positive.
const GROWTH: f64 = 1e3;
const ATTEMPTS: usize = 4;

#[derive(Clone, Debug, Default)]
pub(super) struct System {
    /// Lower triangle of [H; E], the matrices of the linear system, later overwritten by its factor.
    H: Vec<f64>,
    ldh: usize,
    /// Inverse of the factor's diagonal.
    inverse: Vec<f64>,
    /// Scaled rows of G and F (√D G and W⁻¹ F), then the rows of E. Only non-zero blocks of these rows are written and
    /// multiplied.
    pub B: OuterProducts,
    n: usize,
    me: usize,
    r: Vec<f64>,
    /// Right side r₂ during a refinement.
    re: Vec<f64>,
    more: Vec<f64>,
    more_y: Vec<f64>,
}

impl System {
    pub(super) fn new(n: usize, me: usize, columns: usize) -> Self {
        Self {
            H: vec![0.0; (n + me + SLACK) * (n + me + SLACK)],
            inverse: vec![0.0; n + me],
            B: OuterProducts::with_capacity((n + SLACK) * (columns + me + SLACK), columns + me),
            r: vec![0.0; n + 4 * SLACK],
            re: vec![0.0; me + SLACK],
            more: vec![0.0; n + 4 * SLACK],
            more_y: vec![0.0; me + SLACK],
            ..Self::default()
        }
    }

    /// Copies the sizes of a program and the non-zero blocks of its columns. Writes the rows of E, and writes zeros
    /// into the rows of G and F.
    pub(super) fn prepare(&mut self, data: &Scaled) {
        let (n, me, columns, ld) = (data.n, data.equalities(), data.columns(), data.ld);
        (self.n, self.me, self.ldh) = (n, me, n + me + SLACK);
        let B = &mut self.B;
        B.clear(n, ld);
        B.rows[..(columns + me) * ld].fill(0.0);
        B.add_rows(columns + me);
        B.rows[columns * ld..][..me * ld].copy_from_slice(&data.E[..me * ld]);
        for k in 0..columns + me {
            let row = &if k < columns { &data.K[k * ld..] } else { &data.E[(k - columns) * ld..] }[..ld];
            // The scaling W⁻¹ combines the rows of a cone: each resulting row has the union of the blocks of these
            // rows.
            let mask = if k < columns { data.masks[k] } else { mask(row) };
            B.multiply([k, k], [mask, mask]);
        }
    }

    /// Factorises the matrix P + B Bᵀ of the linear system, after the caller has written `B`. Returns false if the
    /// factorisation fails even with the greatest regularisation.
    pub(super) fn factorize(&mut self, data: &Scaled) -> bool {
        let Self { H, ldh, B, n, me, inverse, .. } = self;
        let (n, me, ldh, ld) = (*n, *me, *ldh, data.ld);
        let mut regularisation = 1.0;
        for _ in 0..ATTEMPTS {
            for j in 0..n {
                let column = &mut H[j * ldh..][..ldh];
                column[..n].copy_from_slice(&data.P[j * ld..][..n]);
                for i in 0..me {
                    column[n + i] = data.E[i * ld + j];
                }
                column[n + me..].fill(0.0);
            }
            H[n * ldh..][..me * ldh].fill(0.0);
            B.add_to(H, ldh);
            for j in 0..n {
                let x = &mut H[j * ldh + j];
                *x += regularisation * (REGULARISATION + RELATIVE_REGULARISATION * *x);
            }
            if eliminate(H, ldh, [n + me, n + me, n]).is_ok()
                && factorize_schur(&mut H[n * ldh + n..], ldh, me, regularisation)
            {
                for j in 0..n + me {
                    inverse[j] = H[j * ldh + j].recip();
                }
                return true;
            }
            regularisation *= GROWTH;
        }
        false
    }

    /// Solves the linear system with the factor: replaces its right-hand sides r₁ by dx and r₂ by dy.
    fn solve_once(&mut self, data: &Scaled, x: &mut [f64], y: &mut [f64]) {
        let (n, me, ldh) = (self.n, self.me, self.ldh);
        let (L, (inverse, inverse_S)) = (View::new(&self.H, ldh), self.inverse[..n + me].split_at(n));
        if me > 0 {
            add_product_vector(x, n, View::new(&data.E, data.ld), &y[..me]);
        }
        forward_solve(L, inverse, x);
        if me > 0 {
            add_scaled_product(&mut y[..me], -1.0, View::new(&self.H[n..], ldh), &x[..n]);
            let S = L.at(n, n);
            forward_solve(S, inverse_S, y);
            backward_solve(S, inverse_S, y);
            for j in 0..n {
                let X = &self.H[j * ldh + n..][..me];
                x[j] += X.iter().zip(&*y).map(|(a, b)| a * b).sum::<f64>();
            }
        }
        backward_solve(L, inverse, x);
    }

    /// Solves the linear system: replaces its right-hand sides r₁ in `x` by dx and r₂ in `y` by dy. Also writes K dx,
    /// which is G dx and F dx. In each refinement, `weigh` replaces K dx by [D G dx; W⁻² F dx].
    pub(super) fn solve(
        &mut self,
        data: &Scaled,
        [x, y]: [&mut [f64]; 2],
        Kdx: &mut [f64],
        refinements: usize,
        mut weigh: impl FnMut(&mut [f64]),
    ) {
        let (n, me, ld) = (self.n, self.me, data.ld);
        let (mut r, mut re) = (std::mem::take(&mut self.r), std::mem::take(&mut self.re));
        let (mut more, mut more_y) = (std::mem::take(&mut self.more), std::mem::take(&mut self.more_y));
        r[..n].copy_from_slice(&x[..n]);
        re[..me].copy_from_slice(&y[..me]);
        self.solve_once(data, x, y);
        for _ in 0..refinements {
            // Compute the residuals r₁ − H dx + Eᵀ dy and r₂ − E dx of the linear system.
            data.multiply(x, Kdx);
            weigh(Kdx);
            for i in 0..n {
                more[i] = 0.0;
            }
            data.add_transposed(Kdx, &mut more);
            add_product_vector(&mut more, n, View::new(&data.P, ld), &x[..n]);
            for i in 0..n {
                more[i] = r[i] - more[i];
            }
            if me > 0 {
                add_product_vector(&mut more, n, View::new(&data.E, ld), &y[..me]);
                transposed_product_vector(&mut more_y[..me], n, View::new(&data.E, ld), x);
                for i in 0..me {
                    more_y[i] = re[i] - more_y[i];
                }
            }
            self.solve_once(data, &mut more, &mut more_y);
            for i in 0..n {
                x[i] += more[i];
            }
            for i in 0..me {
                y[i] += more_y[i];
            }
        }
        data.multiply(x, Kdx);
        (self.r, self.re, self.more, self.more_y) = (r, re, more, more_y);
    }
}

/// Replaces S, which is not positive definite, by the factor of −S. Returns whether the factorisation succeeds.
fn factorize_schur(S: &mut [f64], stride: usize, me: usize, regularisation: f64) -> bool {
    for j in 0..me {
        for x in &mut S[j * stride + j..][..me - j] {
            *x = -*x;
        }
        S[j * stride + j] += regularisation * DUAL_REGULARISATION;
    }
    me == 0 || eliminate(S, stride, [me, me, me]).is_ok()
}
