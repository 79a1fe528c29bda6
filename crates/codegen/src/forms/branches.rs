//! The inverse of M, and products with it, from the factor of a tree. The forms here have few operations, for recorded
//! numbers.
//!
//! Let L x = b. If all entries of b on the path from k to an ancestor are zero, x_k depends on b only through that
//! ancestor:
//!
//! ```text
//! x_k = −Σ L_ke x_e = Σ G_ke x_e     with G_ke = −L_ke − Σ L_kf G_fe
//! ```
//!
//! Here e runs over the ancestor and the indices before it, and f runs over the indices between the ancestor and k.
//! Rows of G are as short as the branches' common path to the root. They serve every b whose non-zero entries are in
//! other branches. Rows of one branch give sums with the same structure, which compilers can vectorise.

use condyle_linalg::elimination_tree::NONE;
use condyle_linalg::{Ltdl, check};
use condyle_spatial::{Dense, DenseMatrix, Scalar};
use std::collections::BTreeMap;

/// Rows of G. The key of a row is the index k and the number of indices before k that the row covers.
pub struct Branches<'f, S> {
    factor: &'f Ltdl<S>,
    /// Indices before each index, on its path from the root.
    before: Vec<Vec<usize>>,
    /// Number of indices before each index that are not in its branch. A branch begins after the last index with
    /// several children.
    before_branch: Vec<usize>,
    /// −D⁻¹.
    minus_inverse_diagonal: Vec<S>,
    rows: BTreeMap<(usize, usize), Vec<S>>,
}

impl<'f, S: Scalar> Branches<'f, S> {
    /// Creates the object for a factor. Rows are computed when they are needed.
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

    /// Returns the row G_ke for the first m indices e before k.
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

    /// Replaces b by x = −M⁻¹ b. Zeros are skipped.
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
            // L x = −D⁻¹ y. First add the contribution of k's own branch, then the contribution of the indices before
            // this branch.
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

    /// Computes X = M⁻¹, as [`Ltdl::inverse`] does. X_kj of two branches is computed through the indices before both
    /// branches.
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
                // if j is on the path from the root to k, take all indices before k
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
