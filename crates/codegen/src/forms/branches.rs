//! M⁻¹, and products with M⁻¹, from the factor L of M = Lᵀ D L. The tree of the robot determines the non-zero entries
//! of L. These algorithms need few operations, which makes recorded code short.
//!
//! Let L x = b. Let the entries of b be zero from index k back to an ancestor of k. Then x_k depends only on the
//! entries of x at the ancestor and at the indices before the ancestor:
//!
//! ```text
//! x_k = −Σ L_ke x_e = Σ G_ke x_e     with G_ke = −L_ke − Σ L_kf G_fe
//! ```
//!
//! Here e runs over the ancestor and the indices before it, and f runs over the indices between the ancestor and k. A
//! row of G has one entry for each index that two branches have in common on their paths to the root. So the row is
//! short. The same row applies to every b whose non-zero entries are in other branches. All rows of a branch give sums
//! with the same structure, which compilers can vectorise.

use condyle_linalg::elimination_tree::NONE;
use condyle_linalg::{Ltdl, check};
use condyle_spatial::{Dense, DenseMatrix, Scalar};
use std::collections::BTreeMap;

/// Rows of the matrix G (see the documentation of the module). The key of a row is the index k and the number of
/// indices before k that the row covers.
pub struct Branches<'f, S> {
    factor: &'f Ltdl<S>,
    /// For each index, the indices before it on the path from the root.
    before: Vec<Vec<usize>>,
    /// For each index, the number of indices before it that belong to other branches. A branch begins after the last
    /// index with several children.
    before_branch: Vec<usize>,
    /// Entries of the diagonal matrix −D⁻¹, where M = Lᵀ D L is the inertia matrix.
    minus_inverse_diagonal: Vec<S>,
    rows: BTreeMap<(usize, usize), Vec<S>>,
}

impl<'f, S: Scalar> Branches<'f, S> {
    /// Creates `Branches` for a factor. Each row of G is computed when it is first needed.
    pub fn new(factor: &'f Ltdl<S>) -> Self {
        let parents = &factor.tree().parent;
        let (mut before, mut before_branch): (Vec<Vec<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for &parent in parents {
            let (way, of_branch) = match parent {
                NONE => (Vec::new(), 0),
                _ => {
                    let way = [&before[parent][..], &[parent]].concat();
                    let forks = parents.iter().filter(|&&other| other == parent).count() > 1;
                    let of_branch = if forks { way.len() } else { before_branch[parent] };
                    (way, of_branch)
                }
            };
            before.push(way);
            before_branch.push(of_branch);
        }
        let minus_inverse_diagonal = factor.inverse_diagonal().iter().map(|&x| (-x).kept()).collect();
        Self { factor, before, before_branch, minus_inverse_diagonal, rows: BTreeMap::new() }
    }

    /// Returns the entries G_ke of row k of G, for the first m indices e before k.
    fn row(&mut self, k: usize, m: usize) -> Vec<S> {
        if let Some(row) = self.rows.get(&(k, m)) {
            return row.clone();
        }
        let L = self.factor.row_from_root(k);
        let mut row: Vec<S> = L[..m].iter().map(|&x| -x).collect();
        for p in m..L.len() {
            let G = self.row(self.before[k][p], m);
            for (x, g) in row.iter_mut().zip(G) {
                *x -= L[p] * g; // G_ke = −L_ke − Σ L_kf G_fe
            }
        }
        row.iter_mut().for_each(|x| *x = x.kept());
        self.rows.insert((k, m), row.clone());
        row
    }

    /// Returns `start` + Σ G_ke x_e over the first m indices e before k. `x` returns an entry by its index.
    fn through(&mut self, k: usize, m: usize, start: S, x: impl Fn(usize) -> S) -> S {
        let G = self.row(k, m);
        (0..m).fold(start, |sum, p| sum + G[p] * x(self.before[k][p]))
    }

    /// Replaces b by x = −M⁻¹ b, with the inertia matrix M. Zeros of b cost no operations.
    ///
    /// # Panics
    /// If `b` does not have nv numbers.
    pub fn minus_solve(&mut self, b: &mut [S]) {
        let (factor, n) = (self.factor, self.before.len());
        check("b", b.len(), n);
        let mut y: Vec<S> = factor.order().iter().map(|&row| b[row]).collect();
        for k in (0..n).rev() {
            let y_k = y[k];
            for (&e, &L) in self.before[k].iter().zip(factor.row_from_root(k)) {
                y[e] -= L * y_k; // Lᵀ y = b
            }
        }
        let is_given: Vec<bool> = y.iter().map(|&y| y != S::zero()).collect();
        let (mut x, mut own) = (vec![S::zero(); n], vec![S::zero(); n]);
        for k in 0..n {
            let (way, L) = (&self.before[k][..], factor.row_from_root(k));
            // Solve L x = −D⁻¹ y, where M = Lᵀ D L. For each index k, add the contribution of k's own branch first,
            // then the contribution of the indices before this branch.
            let m = if is_given[k] {
                let m = self.before_branch[k];
                let start = y[k] * self.minus_inverse_diagonal[k];
                own[k] = (m..way.len()).fold(start, |sum, p| sum - L[p] * own[way[p]]).kept();
                m
            } else {
                way.iter().rposition(|&e| is_given[e]).map_or(0, |p| p + 1)
            };
            x[k] = self.through(k, m, own[k], |e| x[e]).kept();
        }
        for (&row, x) in factor.order().iter().zip(x) {
            b[row] = x;
        }
    }

    /// Computes X = M⁻¹, the inverse of the inertia matrix, as [`Ltdl::inverse`] does. If k and j are in different
    /// branches, X_kj is computed from the entries X_ej, where e runs over the common ancestors of k and j.
    ///
    /// # Panics
    /// If `X` is not nv × nv.
    pub fn inverse(&mut self, X: &mut DenseMatrix<S, impl Dense<S>>) {
        let (factor, n) = (self.factor, self.before.len());
        assert!(X.shape() == (n, n), "X: expected {n} × {n}, found {:?}", X.shape());
        let order = factor.order();
        let at = |k: usize, j: usize| (order[k], order[j]);
        for k in 0..n {
            for j in 0..k {
                let ways = self.before[k].iter().zip(self.before[j].iter().chain([&j]));
                let common = ways.take_while(|(a, b)| a == b).count();
                // If j is an ancestor of k, the sum runs over all indices before k.
                let m =
                    if self.before[k].get(common.wrapping_sub(1)) == Some(&j) { self.before[k].len() } else { common };
                let x = self.through(k, m, S::zero(), |e| X[at(e, j)]).kept();
                (X[at(k, j)], X[at(j, k)]) = (x, x);
            }
            let L = factor.row_from_root(k);
            let start = factor.inverse_diagonal()[k];
            let x = (0..L.len()).fold(start, |sum, p| sum - L[p] * X[at(self.before[k][p], k)]);
            X[at(k, k)] = x.kept();
        }
    }
}
