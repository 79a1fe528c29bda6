//! The derivatives of forward dynamics under constraints, by hand.
//!
//! M q̈ + h − Jᵀ λ = τ and J q̈ + γ = 0 hold for every q, v and τ. Differentiated at q̈ and λ as they are, with
//! r = ∂(M q̈ + h − Jᵀ λ) and c = ∂(J q̈ + γ), they are equations with the same matrix, whose inverse has the blocks
//!
//! ```text
//! K⁻¹ = [ P    J̄  ]      Λ = (J M⁻¹ Jᵀ)⁻¹,   J̄ = M⁻¹ Jᵀ Λ,   P = M⁻¹ − J̄ J M⁻¹
//!       [ J̄ᵀ  −Λ ]
//! ∂q̈/∂x = −P r − J̄ c,   ∂λ/∂x = J̄ᵀ r − Λ c,   ∂q̈/∂τ = P,   ∂λ/∂τ = −J̄ᵀ
//! ```
//!
//! r and c are those of [`constrained_equations`]. Source: Carpentier and Mansard, *Analytical derivatives of rigid body
//! dynamics algorithms* (2018), for the equations; Budhiraja, Carpentier, Mastalli, Mansard, *Differential dynamic
//! programming for multi-phase rigid contact dynamics* (2018).

use crate::constraints::constraint_set::ConstraintSet;
use crate::constraints::islands::Island;
use crate::workspace::{Size, filled, zero_matrix};
use alloc::vec::Vec;
use condyle_linalg::Ltdl;
use condyle_linalg::axpy::axpy;
use condyle_linalg::sparsity::NonzeroRows;
use condyle_linalg::tree_product::{minus_block_product, subtract_column};
use condyle_spatial::kernel;
use condyle_spatial::{Force, Scalar};
use core::ops::Range;
use nalgebra::DMatrix;

#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// All forces on each body, in its frame. Shape: bodies. Written by: `load`.
    pub forces: Vec<Force<S>>,
    /// M⁻¹, then P. Shape: nv × nv. Written by: `finish`.
    pub P: DMatrix<S>,
    /// ∂(M q̈ + h − Jᵀ λ)/∂q. Shape: nv × nv. Written by: `differentiate`.
    pub dtau_dq: DMatrix<S>,
    /// The derivative of q̈ or of the velocity. Shape: nv × nv. Written by: `constrained_dynamics_derivatives`,
    /// `impulse_dynamics_derivatives`.
    pub da_dq: DMatrix<S>,
    pub da_dv: DMatrix<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        let square = zero_matrix(size.nv, size.nv);
        Self {
            forces: filled(Force::zero, size.bodies),
            P: square.clone(),
            dtau_dq: square.clone(),
            da_dq: square.clone(),
            da_dv: square,
        }
    }
}

/// C −= A B in some columns, and some rows of C, where column j of B has zeros but in the rows `rows[j]`.
#[inline(always)]
fn subtract_product<S: Scalar, R: AsRef<[usize]>>(
    A: &DMatrix<S>,
    B: &DMatrix<S>,
    C: &mut DMatrix<S>,
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
    /// Λ, J̄ and P of K⁻¹, for M and J M⁻¹ Jᵀ that are factorised.
    #[inline(always)]
    fn invert(&mut self, factor: &Ltdl<S>, P: &mut DMatrix<S>) {
        factor.inverse(P); // M⁻¹
        for k in 0..self.islands.len() {
            self.invert_island(k, P);
        }
    }

    /// The same of an island, for M⁻¹ in place of P.
    #[inline(always)]
    fn invert_island(&mut self, k: usize, P: &mut DMatrix<S>) {
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

/// The blocks of a right-hand side [r; c] of the equations differentiated, where they may differ from zero, and K⁻¹.
struct Equations<'e, S> {
    P: &'e DMatrix<S>,
    Jbar: &'e DMatrix<S>,
    /// −J̄ᵀ.
    dlambda_dtau: &'e DMatrix<S>,
    /// Λ.
    inertia: &'e DMatrix<S>,
    r: &'e DMatrix<S>,
    c: &'e DMatrix<S>,
    nonzero_rows: &'e [NonzeroRows],
    touching: &'e [Vec<usize>],
    islands: &'e [Island],
}

impl<S: Scalar> Equations<'_, S> {
    #[inline(always)]
    fn solve(self, da: &mut DMatrix<S>, dlambda: &mut DMatrix<S>) {
        let (n, rows) = (da.nrows(), dlambda.nrows());
        for island in self.islands {
            let columns = &island.coordinates;
            island.clear_beside(da.as_mut_slice(), n, S::zero());
            let (P, r) = (self.P.as_slice(), self.r.as_slice());
            minus_block_product(P, r, da.as_mut_slice(), self.nonzero_rows, columns.clone()); // −P r − J̄ c
            if island.rows.is_empty() {
                continue;
            }
            subtract_product(self.Jbar, self.c, da, self.touching, [columns, columns]);
            for j in columns.clone() {
                dlambda.as_mut_slice()[island.rows_of_column(j, rows)].fill(S::zero());
            }
            subtract_product(self.inertia, self.c, dlambda, self.touching, [&island.rows, columns]);
            subtract_product(self.dlambda_dtau, self.r, dlambda, self.nonzero_rows, [&island.rows, columns]); // J̄ᵀ r − Λ c
        }
    }
}

impl<S: Scalar> ConstraintSet<S> {
    /// The derivatives of acceleration and forces with respect to q, for r and `dgamma_dq`.
    #[inline(always)]
    fn respond_to_q(&mut self, P: &DMatrix<S>, r: &DMatrix<S>, da: &mut DMatrix<S>) {
        let Self { Jbar, dlambda_dtau, delassus, nonzero_rows, touching, islands, dgamma_dq, dlambda_dq, .. } = self;
        let (c, inertia) = (dgamma_dq, &delassus.inverse);
        Equations { P, Jbar, dlambda_dtau, inertia, r, c, nonzero_rows, touching, islands }.solve(da, dlambda_dq);
    }

    /// The same with respect to v, for r and `dgamma_dv`.
    #[inline(always)]
    fn respond_to_v(&mut self, P: &DMatrix<S>, r: &DMatrix<S>, da: &mut DMatrix<S>) {
        let Self { Jbar, dlambda_dtau, delassus, nonzero_rows, touching, islands, dgamma_dv, dlambda_dv, .. } = self;
        let (c, inertia) = (dgamma_dv, &delassus.inverse);
        Equations { P, Jbar, dlambda_dtau, inertia, r, c, nonzero_rows, touching, islands }.solve(da, dlambda_dv);
    }
}

kernel! {
    /// The blocks of K⁻¹.
    pub(crate) fn invert<S>(set: &mut ConstraintSet<S>, factor: &Ltdl<S>, P: &mut DMatrix<S>) {
        set.invert(factor, P);
    }
}

kernel! {
    /// The derivatives of acceleration and forces with respect to q, for r and `dgamma_dq`.
    pub(crate) fn respond_to_q<S>(set: &mut ConstraintSet<S>, P: &DMatrix<S>, r: &DMatrix<S>, da: &mut DMatrix<S>) {
        set.respond_to_q(P, r, da);
    }
}

kernel! {
    /// The same with respect to v, for r and `dgamma_dv`.
    pub(crate) fn respond_to_v<S>(set: &mut ConstraintSet<S>, P: &DMatrix<S>, r: &DMatrix<S>, da: &mut DMatrix<S>) {
        set.respond_to_v(P, r, da);
    }
}
