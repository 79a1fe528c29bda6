//! Analytical derivatives of forward dynamics under constraints.
//!
//! The equations of motion M q̈ + h − Jᵀ λ = τ and the constraints J q̈ + γ = 0 hold for every q, v and τ. These
//! equations are linear in (q̈, −λ), with a matrix K. The derivatives of the equations are linear equations with the
//! same matrix K. Let r = ∂(M q̈ + h − Jᵀ λ)/∂x and c = ∂(J q̈ + γ)/∂x at fixed q̈ and λ, for x = q or v. With the
//! blocks of K⁻¹:
//!
//! ```text
//! K⁻¹ = [ P    J̄  ]      Λ = (J M⁻¹ Jᵀ)⁻¹,   J̄ = M⁻¹ Jᵀ Λ,   P = M⁻¹ − J̄ J M⁻¹
//!       [ J̄ᵀ  −Λ ]
//! ∂q̈/∂x = −P r − J̄ c,   ∂λ/∂x = J̄ᵀ r − Λ c,   ∂q̈/∂τ = P,   ∂λ/∂τ = −J̄ᵀ
//! ```
//!
//! `kkt_derivatives.rs` computes the derivatives r and c of the equations. Source: Carpentier and Mansard, *Analytical
//! derivatives of rigid body dynamics algorithms* (2018), for the equations; Budhiraja, Carpentier, Mastalli, Mansard,
//! *Differential dynamic programming for multi-phase rigid contact dynamics* (2018).

use crate::constraints::constraint_set::ConstraintSet;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_linalg::Ltdl;
use condyle_linalg::axpy::axpy;
use condyle_linalg::tree_product::{minus_block_product, subtract_column};
use condyle_spatial::kernel;
use condyle_spatial::{Array, Force, Matrix, Scalar, same_layout};
use core::ops::Range;

workspace! {
    pub(crate) struct Workspace<S>(size) {
        /// Sum of all external forces and constraint forces on each body, in the body's frame. Written by: `load`.
        pub forces: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Matrix M⁻¹, which the block P of K⁻¹ overwrites. K is the matrix of the constrained equations of motion.
        /// Written by: `invert`.
        pub P: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Derivative ∂(M q̈ + h − Jᵀ λ)/∂q of the equations of motion. Written by: `turn`.
        pub dtau_dq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Derivatives of q̈, or of the velocity after an impact. Written by: `constrained_dynamics_derivatives`,
        /// `impulse_dynamics_derivatives`.
        pub da_dq: Matrix<S> = zero_matrix(size.nv, size.nv),
        pub da_dv: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

/// Computes C −= A B in the rows `of_C` and the columns `columns` of C. Column j of B is zero outside the rows
/// `rows[j]`.
#[inline(always)]
fn subtract_product<S: Scalar, R: AsRef<[usize]>>(
    A: &Matrix<S>,
    B: &Matrix<S>,
    C: &mut Matrix<S>,
    rows: &[R],
    [of_C, columns]: [&Range<usize>; 2],
) {
    let (n, m) = A.shape();
    let (A, B, C) = (A.as_slice(), B.as_slice(), C.as_mut_slice());
    for j in columns.clone() {
        subtract_column(A, &B[j * m..(j + 1) * m], &mut C[j * n..(j + 1) * n], rows[j].as_ref(), of_C.clone());
    }
}

impl<S: Scalar> ConstraintSet<S> {
    /// Computes the blocks Λ, J̄ and P of K⁻¹ for one island, where K is the matrix of the constrained equations of
    /// motion. An island is a group of trees and constraints that is independent of all others. On entry, `P` must
    /// contain M⁻¹, and J M⁻¹ Jᵀ must be factorised.
    #[inline(always)]
    fn invert_island(&mut self, k: usize, P: &mut Matrix<S>) {
        let Self { U, Jbar, dlambda_dtau, delassus, proximal, .. } = self;
        let (n, rows, island) = (self.nv, self.lambda.len(), &self.islands[k]);
        let Range { start, end } = island.coordinates;
        delassus.invert(island, *proximal);
        let (U, Jbar, Minv) = (U.as_mut_slice(), Jbar.as_mut_slice(), P.as_mut_slice());
        for plan in &self.plans[island.constraints.clone()] {
            for r in 0..plan.rows() {
                let (row, u) = (&self.J[plan.range(r)], &mut U[island.of_column(plan.row + r, n)]);
                u.fill(S::zero());
                for (k, &coordinate) in plan.coordinates.iter().enumerate() {
                    axpy(row[k], &Minv[island.of_column(coordinate, n)], u); // U = M⁻¹ Jᵀ
                }
            }
        }
        if island.rows.is_empty() {
            return;
        }
        for j in start..end {
            let row = &mut dlambda_dtau.as_mut_slice()[j * rows..(j + 1) * rows];
            for r in island.rows.clone() {
                row[r] = -U[r * n + j];
            }
            delassus.solve(island, *proximal, row); // ∂λ/∂τ = −J̄ᵀ = −Λ Uᵀ
            for r in island.rows.clone() {
                Jbar[r * n + j] = -row[r];
            }
        }
        for j in start..end {
            let (above, rest) = Minv.split_at_mut(j * n);
            let column = &mut rest[j..end];
            for k in island.rows.clone() {
                axpy(-Jbar[k * n + j], &U[k * n + j..k * n + end], column); // P = M⁻¹ − U J̄ᵀ
            }
            for i in start..j {
                rest[i] = above[i * n + j];
            }
        }
    }
}

kernel! {
    /// Computes the blocks Λ, J̄ and P of K⁻¹, where K is the matrix of the constrained equations of motion.
    pub(crate) fn invert<S>(set: &mut ConstraintSet<S>, factor: &Ltdl<S>, P: &mut Matrix<S>) {
        factor.inverse(P); // M⁻¹
        for k in 0..set.islands.len() {
            set.invert_island(k, P);
        }
    }
}

/// Variable with respect to which the equations of motion and constraints are differentiated.
#[derive(Clone, Copy)]
pub(crate) enum By {
    Position,
    Velocity,
}

same_layout!(By);

kernel! {
    /// Computes the derivatives −P r − J̄ c of q̈ and J̄ᵀ r − Λ c of λ, but only the entries that may be nonzero.
    /// Inputs are the blocks P, J̄ and Λ of K⁻¹, the derivative r of the equations of motion, and the derivative c of
    /// the constraint accelerations.
    pub(crate) fn respond<S>(set: &mut ConstraintSet<S>, by: By, P: &Matrix<S>, r: &Matrix<S>, da: &mut Matrix<S>) {
        let ConstraintSet { Jbar, dlambda_dtau, delassus, nonzero_rows, touching, islands, .. } = set;
        let (c, dlambda) = match by {
            By::Position => (&set.dgamma_dq, &mut set.dlambda_dq),
            By::Velocity => (&set.dgamma_dv, &mut set.dlambda_dv),
        };
        let (n, rows) = (da.nrows(), dlambda.nrows());
        for island in islands {
            let columns = &island.coordinates;
            island.clear_beside(da.as_mut_slice(), n, S::zero());
            // This product −P r and the product with J̄ below sum to da = −P r − J̄ c.
            minus_block_product(P.as_slice(), r.as_slice(), da.as_mut_slice(), nonzero_rows, columns.clone());
            if island.rows.is_empty() {
                continue;
            }
            subtract_product(Jbar, c, da, touching, [columns, columns]);
            for j in columns.clone() {
                dlambda.as_mut_slice()[island.rows_of_column(j, rows)].fill(S::zero());
            }
            subtract_product(&delassus.inverse, c, dlambda, touching, [&island.rows, columns]);
            subtract_product(dlambda_dtau, r, dlambda, nonzero_rows, [&island.rows, columns]); // J̄ᵀ r − Λ c
        }
    }
}
