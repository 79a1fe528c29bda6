//! J M⁻¹ Jᵀ and its inverse Λ, the inertia that a robot shows to its constraints.
//!
//! With M = Lᵀ D L, the rows of Y = J L⁻¹ have entries only where J's have, or nearer to the root, and J M⁻¹ Jᵀ = Y D⁻¹ Yᵀ
//! needs what two constraints share and nothing else. It is factorised as C E Cᵀ with C unit lower triangular. A row that
//! depends on rows before it has no pivot but rounding; its force is set to zero. Source: Featherstone, *Exploiting
//! sparsity in operational-space dynamics* (2010); Golub and Van Loan, *Matrix Computations* (4th edition), section 4.1.

use crate::constraint_set::{Plan, Proximal};
use crate::ltdl::{Ltdl, axpy, dot};
use condyle_spatial::Scalar;
use nalgebra::DMatrix;

/// A pivot smaller than this many roundings of its diagonal entry is none.
const ROUNDINGS: f64 = 1e3;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Delassus<S> {
    /// J L⁻¹, and that times D⁻¹, on the places of each constraint. Shape: entries of all rows. Written by: `factorize`.
    Y: Vec<S>,
    Z: Vec<S>,
    /// C below the diagonal. Shape: rows × rows. Written by: `factorize`.
    C: DMatrix<S>,
    /// E, and 1/E; 0 where there is no pivot. Shape: rows. Written by: `factorize`.
    E: Vec<S>,
    E_inv: Vec<S>,
    /// How many rows have no pivot. Written by: `factorize`.
    pub redundant: S,
    /// What is being solved for. Shape: rows. Written by: `solve`.
    b: Vec<S>,
    /// Λ. Shape: rows × rows. Written by: `invert`.
    pub inverse: DMatrix<S>,
}

/// The smallest number that changes 1 when added to it.
#[inline(always)]
fn epsilon<S: Scalar>() -> S {
    let third = S::splat(4.0) / S::splat(3.0) - S::one();
    (third + third + third - S::one()).abs()
}

impl<S: Scalar> Delassus<S> {
    pub(crate) fn new(rows: usize, entries: usize) -> Self {
        let o = S::zero();
        let square = DMatrix::from_element(rows, rows, o);
        Self {
            Y: vec![o; entries],
            Z: vec![o; entries],
            C: square.clone(),
            E: vec![o; rows],
            E_inv: vec![o; rows],
            redundant: o,
            b: vec![o; rows],
            inverse: square,
        }
    }

    /// J M⁻¹ Jᵀ + μ 1 = C E Cᵀ, for the rows of J on their places.
    #[inline(always)]
    pub(crate) fn factorize(&mut self, plans: &[Plan], J: &[S], M: &Ltdl<S>, mu: f64) {
        let (n, D_inv) = (self.E.len(), M.inverse_diagonal());
        self.Y.copy_from_slice(J);
        let G = self.C.as_mut_slice();
        for (i, plan) in plans.iter().enumerate() {
            let Plan { places, shared, second, .. } = plan;
            for r in 0..plan.rows() {
                let (y, z) = (&mut self.Y[plan.range(r)], &mut self.Z[plan.range(r)]);
                for (j, &k) in places.iter().enumerate().rev() {
                    let (x, row) = (-y[j], M.row_from_root(k));
                    if j < *second {
                        axpy(x, row, &mut y[..j]); // y_e −= L_ke y_k on the places e between k and the root
                    } else {
                        axpy(x, &row[..*shared], &mut y[..*shared]);
                        axpy(x, &row[*shared..], &mut y[*second..j]);
                    }
                    z[j] = y[j] * D_inv[k];
                }
            }
            for (other, runs) in plans[..=i].iter().zip(&plan.common) {
                for r in 0..plan.rows() {
                    let z = &self.Z[plan.range(r)];
                    for c in 0..if other.row == plan.row { r + 1 } else { other.rows() } {
                        let y = &self.Y[other.range(c)];
                        let mut sum = S::zero();
                        for &[here, there, n] in runs {
                            sum += dot(&z[here..here + n], &y[there..there + n]);
                        }
                        G[(other.row + c) * n + plan.row + r] = sum; // z_r · y_c
                    }
                }
            }
        }
        let smallest = epsilon::<S>() * S::splat(ROUNDINGS);
        self.redundant = S::zero();
        for j in 0..n {
            let (left, rest) = G.split_at_mut(j * n);
            let column = &mut rest[j..n];
            column[0] += S::splat(mu);
            let diagonal = column[0];
            for k in 0..j {
                let other = &left[k * n + j..(k + 1) * n];
                axpy(-(other[0] * self.E[k]), other, column); // G_ij − Σ C_ik E_k C_jk
            }
            let pivot = column[0];
            let kept = (diagonal * smallest).lt(pivot);
            self.E[j] = S::select(kept, pivot, S::zero());
            self.E_inv[j] = S::select(kept, S::select(kept, pivot, S::one()).recip(), S::zero());
            self.redundant += S::select(kept, S::zero(), S::one());
            for x in &mut column[1..] {
                *x = *x * self.E_inv[j];
            }
        }
    }

    /// λ in place of b: J M⁻¹ Jᵀ λ = b, by proximal iterations if there are any.
    #[inline(always)]
    pub(crate) fn solve(&mut self, proximal: Proximal, lambda: &mut [S]) {
        let mu = S::splat(proximal.mu);
        self.b.copy_from_slice(lambda);
        back_substitute(&self.C, &self.E_inv, lambda, 0);
        for _ in 1..rounds(proximal) {
            for r in 0..lambda.len() {
                lambda[r] = lambda[r].mul_add(mu, self.b[r]); // b + μ λ'
            }
            back_substitute(&self.C, &self.E_inv, lambda, 0);
        }
    }

    /// Λ: the map from b to λ.
    #[inline(always)]
    pub(crate) fn invert(&mut self, proximal: Proximal) {
        let (n, mu) = (self.b.len(), S::splat(proximal.mu));
        let Self { C, E_inv, inverse, .. } = self;
        inverse.as_mut_slice().fill(S::zero());
        for j in 0..n {
            let column = &mut inverse.as_mut_slice()[j * n..(j + 1) * n];
            column[j] = S::one();
            back_substitute(C, E_inv, column, j);
            for _ in 1..rounds(proximal) {
                for x in column.iter_mut() {
                    *x = *x * mu;
                }
                column[j] += S::one();
                back_substitute(C, E_inv, column, 0); // Λ = (G + μ)⁻¹ (1 + μ Λ')
            }
        }
    }
}

/// How often to solve: without μ, once is exact.
fn rounds(proximal: Proximal) -> usize {
    if proximal.mu > 0.0 { proximal.iterations.max(1) } else { 1 }
}

/// x in place of b, where b is zero before `start`: C E Cᵀ x = b.
#[inline(always)]
fn back_substitute<S: Scalar>(C: &DMatrix<S>, E_inv: &[S], b: &mut [S], start: usize) {
    let (n, C) = (b.len(), C.as_slice());
    for j in start..n {
        let (x, rest) = (-b[j], &mut b[j + 1..]);
        axpy(x, &C[j * n + j + 1..(j + 1) * n], rest);
    }
    for j in start..n {
        b[j] = b[j] * E_inv[j];
    }
    for j in (0..n).rev() {
        let x = dot(&C[j * n + j + 1..(j + 1) * n], &b[j + 1..]);
        b[j] -= x;
    }
}
