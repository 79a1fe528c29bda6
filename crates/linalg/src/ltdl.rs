//! Sparse factorization M = Lᵀ D L of the joint-space inertia matrix, without fill-in.
//!
//! Source: Featherstone, *Efficient factorization of the joint-space inertia matrix for branched kinematic trees*
//! (2005). Mᵢⱼ is zero unless one of the coordinates i, j is an ancestor of the other. The matrix keeps its zeros if
//! the elimination goes from the tips to the root. Row k of L has entries only at the coordinates between k and the
//! root.
//!
//! If joints share a coordinate (mimic), the tree is the elimination tree of `elimination_tree.rs`.

use crate::axpy::{axpy, dot};
use crate::elimination_tree::{ColumnTree, EliminationTree, NONE};
use crate::{check, check_index};
use condyle_spatial::{Array, Dense, DenseMatrix, Scalar, same_layout};

/// Returns the step: row lengths are rounded up to a multiple of this number, so that the innermost loop has no
/// remainder. The content of the padding after a row has no meaning.
const fn step<S: Scalar>() -> usize {
    if S::LANES == 1 { 4 } else { 1 }
}

/// Computes y += Σ sₖ xₖ for N vectors xₖ with factors sₖ. Each number of y is loaded and stored only once. All lengths
/// are multiples of `step`.
#[inline(always)]
fn update<S: Scalar, const N: usize>(s: [S; N], x: [&[S]; N], y: &mut [S]) {
    if step::<S>() == 1 {
        for j in 0..y.len() {
            for k in 0..N {
                y[j] = x[k][j].mul_add(s[k], y[j]);
            }
        }
        return;
    }
    let y = y.as_chunks_mut::<4>().0;
    let x = x.map(|x| &x.as_chunks::<4>().0[..y.len()]);
    for (i, y) in y.iter_mut().enumerate() {
        let mut sum = *y;
        for k in 0..N {
            for j in 0..4 {
                sum[j] = x[k][i][j].mul_add(s[k], sum[j]);
            }
        }
        *y = sum;
    }
}

/// Eliminates N consecutive positions of a run and returns N.
#[inline(always)]
fn eliminate<S: Scalar, const N: usize>(
    tree: &EliminationTree,
    rows: &mut [S],
    D_inv: &mut [S],
    start: usize,
) -> usize {
    let EliminationTree { parent, depth, first, .. } = tree;
    let (above, block) = rows.split_at_mut(first[start]);
    let at = |k: usize| first[k] - first[start];
    for k in (start..start + N).rev() {
        let (before, row) = block.split_at_mut(at(k));
        D_inv[k] = row[depth[k]].recip();
        for e in start..k {
            let p = depth[e];
            update([-(row[p] * D_inv[k])], [row], &mut before[at(e)..at(e + 1)]); // H_e −= (H_ke / D_k) H_k
        }
    }
    let mut own = [&block[..0]; N]; // `from_fn` would not be inlined here
    for i in 0..N {
        own[i] = &block[at(start + i)..at(start + i + 1)];
    }
    let mut e = parent[start];
    for p in (0..depth[start]).rev() {
        let mut scale = [S::zero(); N];
        for i in 0..N {
            scale[i] = -(own[i][p] * D_inv[start + i]);
        }
        update(scale, own, &mut above[first[e]..first[e + 1]]);
        e = parent[e];
    }
    for k in start..start + N {
        for x in &mut block[at(k)..at(k) + depth[k]] {
            *x = *x * D_inv[k]; // L_ke = H_ke / D_k
        }
    }
    N
}

/// Factorization M = Lᵀ D L of a robot's inertia matrix: L is unit lower triangular with the zeros of the tree, D is
/// diagonal.
///
/// Costs depend on n = nv and on the depth d of the tree, the largest number of columns on a path to the root.
/// [`factorize`](Self::factorize) costs O(n d²), [`solve`](Self::solve) O(n d), and [`inverse`](Self::inverse) O(n² d).
/// A chain has d = n. [`new`](Self::new) allocates all memory. Source: Featherstone (2005).
/// [`Cholesky`](crate::Cholesky) has the same methods for any positive definite matrix.
///
/// ```
/// use condyle_linalg::Ltdl;
/// use nalgebra::dmatrix;
/// let tree = [None, Some(0), Some(0)]; // a trunk with two branches; a robot's model has such a tree
/// let mut factor = Ltdl::new(&tree[..]);
/// factor.factorize(&dmatrix![3.0, 1.0, 1.0; 1.0, 1.0, 0.0; 1.0, 0.0, 1.0]);
/// let mut x = [5.0, 2.0, 2.0];
/// factor.solve(&mut x); // M x = b
/// assert_eq!(x, [1.0, 1.0, 1.0]);
/// assert_eq!(factor.nonzeros(), 5); // not 6
/// ```
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Ltdl<S> {
    tree: EliminationTree,
    /// Rows of L, one for each position, from the root on; each row ends with the entry of D. Each row is padded to a
    /// multiple of the step. Length: the sum of the padded row lengths. Written by: `factorize`.
    rows: Array<S>,
    /// 1/D. Length: nv. Written by: `factorize`.
    D_inv: Array<S>,
}

same_layout!(Ltdl { rows, D_inv } same { tree });

impl<S: Scalar> Ltdl<S> {
    /// Creates the factor of a matrix whose zeros follow the given tree, for example a robot's model. Determines the
    /// zeros and allocates all memory.
    pub fn new(tree: &(impl ColumnTree + ?Sized)) -> Self {
        let tree = EliminationTree::new(tree, step::<S>());
        let n = tree.order.len();
        Self { rows: vec![S::zero(); tree.first[n]].into(), D_inv: vec![S::zero(); n].into(), tree }
    }

    /// Returns the elimination tree, with the order of its positions.
    #[doc(hidden)]
    pub fn tree(&self) -> &EliminationTree {
        &self.tree
    }

    /// Returns row k of L from the root on, without its diagonal.
    #[doc(hidden)]
    #[inline(always)]
    pub fn row_from_root(&self, k: usize) -> &[S] {
        &self.rows[self.tree.first[k]..][..self.tree.depth[k]]
    }

    /// Returns the reciprocals of the diagonal entries of D, in elimination order.
    #[doc(hidden)]
    #[inline(always)]
    pub fn inverse_diagonal(&self) -> &[S] {
        &self.D_inv
    }

    /// Returns the number of entries of L and D that may differ from zero, without the diagonal of L.
    pub fn nonzeros(&self) -> usize {
        self.tree.depth.iter().map(|d| d + 1).sum()
    }

    /// Returns the coordinates, ordered from the root to the tips. The elimination goes from the last coordinate to the
    /// first.
    ///
    /// The order is 0, 1, 2, … unless joints share coordinates.
    pub fn order(&self) -> &[usize] {
        &self.tree.order
    }

    /// Returns row k of L, in the [`order`](Self::order) of positions, as pairs (position, value). The row goes from
    /// the entry left of the diagonal to the root.
    ///
    /// # Panics
    /// If k is not less than nv.
    #[track_caller]
    pub fn row(&self, k: usize) -> impl Iterator<Item = (usize, S)> {
        check_index("k", k, self.D_inv.len(), "rows");
        let above = |k: usize| Some(self.tree.parent[k]).filter(|&p| p != NONE);
        let row = &self.rows[self.tree.first[k]..][..self.tree.depth[k]];
        core::iter::successors(above(k), move |&k| above(k)).zip(row.iter().rev().copied())
    }

    /// Returns the diagonal entries of D, in the [`order`](Self::order) of positions.
    pub fn diagonal(&self) -> impl Iterator<Item = S> {
        self.tree.first.iter().zip(&self.tree.depth).map(|(&first, &depth)| self.rows[first + depth])
    }

    /// Factorizes M = Lᵀ D L, in O(n d²) for n = nv and a tree of depth d. Reads only the diagonal and the entries
    /// below it, after rows and columns are put in the [`order`](Self::order) of positions.
    ///
    /// M: nv × nv, symmetric, positive definite (as `crba` returns it). If M is not positive definite, at least one
    /// entry of D is not positive. Allocates nothing. Source: Featherstone (2005).
    ///
    /// # Panics
    /// If `M` is not nv × nv.
    #[inline(always)]
    #[track_caller]
    pub fn factorize(&mut self, M: &DenseMatrix<S, impl Dense<S>>) {
        self.factorize_while(M, || true);
    }

    /// Factorizes as [`factorize`](Self::factorize) does, and calls `go_on` every few rows. Stops if `go_on` returns
    /// `false`. Returns whether the factorization is complete.
    #[doc(hidden)]
    #[inline(always)]
    #[track_caller]
    pub fn factorize_while(&mut self, M: &DenseMatrix<S, impl Dense<S>>, mut go_on: impl FnMut() -> bool) -> bool {
        let nv = self.D_inv.len();
        assert!(M.shape() == (nv, nv), "M: expected {nv} × {nv}, found {:?}", M.shape());
        let Self { tree, rows, D_inv } = self;
        let EliminationTree { order, parent, depth, run, first, .. } = &*tree;
        let M = M.as_slice();
        for k in 0..nv {
            let (row, rest) = rows[first[k]..first[k + 1]].split_at_mut(depth[k] + 1);
            rest.fill(S::zero());
            let mut e = k;
            for x in row.iter_mut().rev() {
                *x = M[order[e] * nv + order[k]];
                e = parent[e];
            }
        }
        let mut end = nv; // rows from here on are finished
        while end > 0 {
            if !go_on() {
                return false;
            }
            // Eliminates several positions of a run at once where possible. The rows of their ancestors are then loaded
            // and stored only once for all these positions.
            end -= match end - run[end - 1] {
                4.. => eliminate::<S, 4>(tree, rows, D_inv, end - 4),
                2.. => eliminate::<S, 2>(tree, rows, D_inv, end - 2),
                _ => eliminate::<S, 1>(tree, rows, D_inv, end - 1),
            };
        }
        true
    }

    /// Solves M x = b in place for the factorized M = Lᵀ D L: Lᵀ y = b, then L x = D⁻¹ y. This takes O(n d) for n = nv
    /// and a tree of depth d.
    ///
    /// b: nv numbers, overwritten with x. Allocates nothing. Source: Featherstone (2005).
    ///
    /// # Panics
    /// If `b` does not have nv numbers.
    #[inline(always)]
    #[track_caller]
    pub fn solve(&self, b: &mut [S]) {
        check("b", b.len(), self.D_inv.len());
        let EliminationTree { swaps, parent, depth, run, first, .. } = &self.tree;
        for &(i, k) in swaps {
            b.swap(i, k);
        }
        for k in (0..b.len()).rev() {
            let row = &self.rows[first[k]..];
            let (x, mut lo, mut hi) = (-b[k], run[k], k);
            loop {
                axpy(x, &row[depth[lo]..], &mut b[lo..hi]); // b_e −= L_ke b_k for all ancestors e of k
                if parent[lo] == NONE {
                    break;
                }
                hi = parent[lo] + 1;
                lo = run[hi - 1];
            }
            b[k] = b[k] * self.D_inv[k];
        }
        for k in 0..b.len() {
            let row = &self.rows[first[k]..];
            let (mut x, mut lo, mut hi) = (b[k], run[k], k);
            loop {
                x -= dot(&b[lo..hi], &row[depth[lo]..]); // x_k = y_k − Σ L_ke x_e
                if parent[lo] == NONE {
                    break;
                }
                hi = parent[lo] + 1;
                lo = run[hi - 1];
            }
            b[k] = x;
        }
        for &(i, k) in swaps.iter().rev() {
            b.swap(i, k);
        }
    }

    /// Solves M X = B in place for the factorized M, column by column. Each column takes O(n d) for n = nv and a tree
    /// of depth d.
    ///
    /// B: nv rows, any number of columns, overwritten with X. Allocates nothing.
    ///
    /// ```
    /// use condyle_linalg::Ltdl;
    /// use nalgebra::{DMatrix, dmatrix};
    /// let M = dmatrix![2.0, 1.0; 1.0, 3.0];
    /// let mut factor = Ltdl::new(&[None, Some(0)][..]);
    /// factor.factorize(&M);
    /// let mut B = M.clone();
    /// factor.solve_matrix(&mut B);
    /// assert!((B - DMatrix::<f64>::identity(2, 2)).amax() < 1e-15);
    /// ```
    ///
    /// # Panics
    /// If `B` does not have nv rows.
    #[inline(always)]
    #[track_caller]
    pub fn solve_matrix(&self, B: &mut DenseMatrix<S, impl Dense<S>>) {
        check("B", B.nrows(), self.D_inv.len());
        for column in B.as_mut_slice().chunks_exact_mut(self.D_inv.len().max(1)) {
            self.solve(column);
        }
    }

    /// Computes X = M⁻¹ for the factorized M = Lᵀ D L, in O(n² d) for n = nv and a tree of depth d. X is the full
    /// symmetric matrix.
    ///
    /// The right-hand side of L X = D⁻¹ L⁻ᵀ is upper triangular. So row k of X follows from the rows above it: X_kj =
    /// −Σ L_ke X_ej for j < k, and X_kk = 1/D_k − Σ L_ke X_ke. X: nv × nv, overwritten. Allocates nothing.
    ///
    /// # Panics
    /// If `X` is not nv × nv.
    #[inline(always)]
    #[track_caller]
    pub fn inverse(&self, X: &mut DenseMatrix<S, impl Dense<S>>) {
        self.inverse_while(X, || true);
    }

    /// Inverts as [`inverse`](Self::inverse) does, and calls `go_on` before each row. Stops if `go_on` returns `false`.
    /// Returns whether X is complete.
    #[doc(hidden)]
    #[inline(always)]
    #[track_caller]
    pub fn inverse_while(&self, X: &mut DenseMatrix<S, impl Dense<S>>, mut go_on: impl FnMut() -> bool) -> bool {
        let nv = self.D_inv.len();
        assert!(X.shape() == (nv, nv), "X: expected {nv} × {nv}, found {:?}", X.shape());
        let EliminationTree { swaps, parent, depth, first, .. } = &self.tree;
        let rows = X.as_mut_slice(); // row k is column k: X is symmetric
        let mut root = 0; // root of the current tree; columns outside this tree are zero
        for k in 0..nv {
            if !go_on() {
                return false;
            }
            if parent[k] == NONE {
                root = k;
            }
            let L = &self.rows[first[k]..first[k] + depth[k]];
            let (above, rest) = rows.split_at_mut(k * nv);
            rest[..k].fill(S::zero());
            let row = &mut rest[root..k];
            let m = row.len();
            let (mut e, mut p) = (parent[k], depth[k]);
            while p >= 4 {
                let (e1, e2, e3) = (parent[e], parent[parent[e]], parent[parent[parent[e]]]);
                let (x0, x1) = (&above[e * nv + root..][..m], &above[e1 * nv + root..][..m]);
                let (x2, x3) = (&above[e2 * nv + root..][..m], &above[e3 * nv + root..][..m]);
                let (s0, s1, s2, s3) = (-L[p - 1], -L[p - 2], -L[p - 3], -L[p - 4]);
                for j in 0..m {
                    row[j] = x0[j].mul_add(s0, x1[j].mul_add(s1, x2[j].mul_add(s2, x3[j].mul_add(s3, row[j]))));
                }
                (e, p) = (parent[e3], p - 4);
            }
            while p > 0 {
                axpy(-L[p - 1], &above[e * nv + root..], row);
                (e, p) = (parent[e], p - 1);
            }
            let (mut diagonal, mut e) = (self.D_inv[k], parent[k]);
            for &L in L.iter().rev() {
                diagonal = (-L).mul_add(row[e - root], diagonal);
                e = parent[e];
            }
            rest[k] = diagonal;
            for (column, &x) in above.chunks_exact_mut(nv).zip(&rest[..k]) {
                column[k] = x; // by symmetry
            }
        }
        for &(i, k) in swaps.iter().rev() {
            X.swap_rows(i, k);
            X.swap_columns(i, k);
        }
        true
    }
}
