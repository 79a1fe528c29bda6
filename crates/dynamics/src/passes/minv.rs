//! Inverse of the joint-space inertia matrix, by one of three methods ([`InverseMethod`]).
//!
//! 1. For short chains: from M by Gauss–Jordan elimination. Because M is positive definite, the elimination needs no
//!    pivoting.
//! 2. If the sparse factor ([`Ltdl`]) has short rows: from M by this factor, in O(n d) operations per column for n
//!    coordinates and a tree of depth d.
//! 3. Otherwise, without M: Carpentier, *Analytical inverse of the joint space inertia matrix* (2018), in O(n) per
//!    column. This is the articulated-body algorithm for all unit efforts at once. In the inward pass, a joint needs
//!    only the efforts in its subtree. Because quantities are in the world's frame, all bodies can share one array of
//!    bias forces.

use crate::passes::aba;
use crate::passes::kinematics::World;
use crate::selection::{InverseMethod, SHORT_CHAIN};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_linalg::Ltdl;
use condyle_linalg::axpy::axpy;
use condyle_linalg::gauss_jordan::gauss_jordan;
use condyle_model::Model;
use condyle_model::tree::Column;
use condyle_spatial::kernel;
use condyle_spatial::{Array, Matrix, Scalar};

workspace! {
    pub(crate) struct Workspace<S>(size, model: &Model<R>) {
        /// Bias force for each unit effort, stored in six rows, one per component. Shape: 6 × columns. Written by:
        /// `sweep`.
        pub P: Array<S> = filled(S::zero, 6 * size.columns),
        /// Acceleration for each unit effort, in blocks: a block of zeros for the world, followed by one block for each
        /// depth of the tree. Shape: (1 + depth) × 6 × columns. Written by: `sweep`.
        pub A: Array<S> = filled(S::zero, (1 + size.depth) * 6 * size.columns),
        /// Inverse M⁻¹ of the inertia matrix. Written by: `minv`.
        pub Minv: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Sparse factor of the inertia matrix M. Written by: `from_matrix`.
        pub factor: Ltdl<S> = Ltdl::new(model),
    }
}

/// Computes y −= Σ sᵣ xᵣ for six rows xᵣ of n numbers each. Entry 0 of y corresponds to entry `from` of each row.
#[inline(always)]
fn subtract_six<S: Scalar>(s: [S; 6], x: &[S], n: usize, from: usize, y: &mut [S]) {
    let to = from + y.len();
    let (x0, x1, x2) = (&x[from..to], &x[n + from..n + to], &x[2 * n + from..2 * n + to]);
    let (x3, x4, x5) = (&x[3 * n + from..3 * n + to], &x[4 * n + from..4 * n + to], &x[5 * n + from..5 * n + to]);
    for j in 0..y.len() {
        let linear = x0[j].mul_add(s[0], x1[j].mul_add(s[1], x2[j] * s[2]));
        let angular = x3[j].mul_add(s[3], x4[j].mul_add(s[4], x5[j] * s[5]));
        y[j] -= linear + angular;
    }
}

/// Computes M⁻¹ from the factors of `aba::factorize`. In each row c, the entries j ≥ c are computed. The other entries
/// are copies, because M⁻¹ is symmetric.
#[inline(always)]
fn sweep<S: Scalar>(columns: &[Column], w: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>) {
    let n = columns.len();
    let Workspace { P, A, Minv, .. } = d;
    // Row c of M⁻¹ is written as column c, because M⁻¹ is symmetric and its columns are contiguous.
    let rows = Minv.as_mut_slice();
    P.fill(S::zero());
    for c in (0..n).rev() {
        let (U, end) = (f.U[c].to_array(), columns[c].end);
        let row = &mut rows[c * n..(c + 1) * n];
        row.fill(S::zero());
        row[c] = f.D_inv[c];
        subtract_six(w.S[c].scale(f.D_inv[c]).to_array(), P, n, c + 1, &mut row[c + 1..end]); // −D⁻¹ Sᵀ P
        for r in 0..6 {
            axpy(U[r], &row[c..end], &mut P[r * n + c..r * n + end]); // P += U u/D
        }
    }
    for c in 0..n {
        let S_c = w.S[c].to_array();
        let row = &mut rows[c * n + c..(c + 1) * n];
        let (above, here) = A.split_at_mut((columns[c].depth + 1) * 6 * n);
        let above = &above[columns[c].depth * 6 * n..]; // block of the parent; zeros if the parent is the world
        subtract_six(f.U[c].scale(f.D_inv[c]).to_array(), above, n, c, row); // −D⁻¹ Uᵀ A_λ
        for r in 0..6 {
            let (A_parent, A) = (&above[r * n + c..(r + 1) * n], &mut here[r * n + c..(r + 1) * n]);
            for j in 0..row.len() {
                A[j] = row[j].mul_add(S_c[r], A_parent[j]); // A = A_λ + S q̈
            }
        }
    }
    for c in 0..n {
        for j in 0..c {
            rows[c * n + j] = rows[j * n + c];
        }
    }
}

kernel! {
    /// Computes M⁻¹ from M, by Gauss–Jordan elimination or by the sparse factor.
    pub(crate) fn from_matrix<S>(d: &mut Workspace<S>, M: &Matrix<S>, method: InverseMethod) {
        if method == InverseMethod::GaussJordan {
            return gauss_jordan::<S, SHORT_CHAIN>(M, &mut d.Minv);
        }
        d.factor.factorize(M);
        d.factor.inverse(&mut d.Minv);
    }
}

kernel! {
    /// Computes M⁻¹ from the factors of the articulated-body algorithm.
    pub(crate) fn from_factors<S>(columns: &[Column], w: &World<S>, f: &aba::Workspace<S>, d: &mut Workspace<S>) {
        sweep(columns, w, f, d);
    }
}
