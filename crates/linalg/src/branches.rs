//! Solutions and the inverse by the factor of a tree, in fewest operations: for numbers that are recorded.
//!
//! Where no number of b stands on the way from place k to an ancestor, all that x_k knows of b comes through that ancestor:
//!
//! ```text
//! x_k = −Σ L_ke x_e = −Σ G_ke x_e     with G_ke = L_ke − Σ L_kf G_fe
//! ```
//!
//! where e goes over the ancestor and what is before it, and f over the places between. Rows of G are as short as the
//! branches' common way to the root, and serve all b whose numbers stand in other branches.

use crate::elimination_tree::NONE;
use crate::{Ltdl, check};
use alloc::collections::BTreeMap;
use alloc::vec::Vec;
use condyle_spatial::Scalar;
use nalgebra::DMatrix;

/// The rows of G, by the place k and the number of places before it that they go over.
pub struct Branches<'f, S> {
    factor: &'f Ltdl<S>,
    /// The places before each on the way from the root.
    before: Vec<Vec<usize>>,
    rows: BTreeMap<(usize, usize), Vec<S>>,
}

impl<'f, S: Scalar> Branches<'f, S> {
    /// Those of a factor.
    pub fn new(factor: &'f Ltdl<S>) -> Self {
        let mut before: Vec<Vec<usize>> = Vec::new();
        for &parent in &factor.tree().parent {
            let way = if parent == NONE { Vec::new() } else { [&before[parent][..], &[parent]].concat() };
            before.push(way);
        }
        Self { factor, before, rows: BTreeMap::new() }
    }

    /// G_ke for the first m places e before k.
    fn row(&mut self, k: usize, m: usize) -> Vec<S> {
        if let Some(row) = self.rows.get(&(k, m)) {
            return row.clone();
        }
        let L = self.factor.row_from_root(k);
        let mut row = L[..m].to_vec();
        for p in m..L.len() {
            let G = self.row(self.before[k][p], m);
            for (x, g) in row.iter_mut().zip(G) {
                *x -= L[p] * g; // G_ke = L_ke − Σ L_kf G_fe
            }
        }
        self.rows.insert((k, m), row.clone());
        row
    }

    /// −Σ G_ke x_e over the first m places before k, x being given by place.
    fn through(&mut self, k: usize, m: usize, x: impl Fn(usize) -> S) -> S {
        let G = self.row(k, m);
        (0..m).fold(S::zero(), |sum, p| sum - G[p] * x(self.before[k][p]))
    }

    /// x = M⁻¹ b in place of b. Numbers that are zero are left out.
    ///
    /// # Panics
    /// If `b` has not nv numbers.
    pub fn solve(&mut self, b: &mut [S]) {
        let (factor, n) = (self.factor, self.before.len());
        check("b", b.len(), n);
        let mut x: Vec<S> = factor.order().iter().map(|&row| b[row]).collect();
        for k in (0..n).rev() {
            let y = x[k];
            for (&e, &L) in self.before[k].iter().zip(factor.row_from_root(k)) {
                x[e] -= L * y; // Lᵀ y = b
            }
        }
        let is_given: Vec<bool> = x.iter().map(|&y| y != S::zero()).collect();
        for k in 0..n {
            let way = self.before[k].clone();
            let m = if is_given[k] { way.len() } else { way.iter().rposition(|&e| is_given[e]).map_or(0, |p| p + 1) };
            x[k] = if m < way.len() {
                self.through(k, m, |e| x[e])
            } else {
                let L = factor.row_from_root(k);
                (0..m).fold(x[k] * factor.inverse_diagonal()[k], |sum, p| sum - L[p] * x[way[p]]) // L x = D⁻¹ y
            };
        }
        for (&row, x) in factor.order().iter().zip(x) {
            b[row] = x;
        }
    }

    /// X = M⁻¹, as [`Ltdl::inverse`]: X_kj of two branches comes through the places before both.
    ///
    /// # Panics
    /// If `X` is not nv × nv.
    pub fn inverse(&mut self, X: &mut DMatrix<S>) {
        let (factor, n) = (self.factor, self.before.len());
        assert!(X.shape() == (n, n), "X: expected {n} × {n}, found {:?}", X.shape());
        let order = factor.order();
        let at = |k: usize, j: usize| (order[k], order[j]);
        for k in 0..n {
            for j in 0..k {
                let ways = self.before[k].iter().zip(self.before[j].iter().chain([&j]));
                let common = ways.take_while(|(a, b)| a == b).count();
                // of a place on the way from the root, all that are before k
                let m =
                    if self.before[k].get(common.wrapping_sub(1)) == Some(&j) { self.before[k].len() } else { common };
                let x = self.through(k, m, |e| X[at(e, j)]);
                (X[at(k, j)], X[at(j, k)]) = (x, x);
            }
            let L = factor.row_from_root(k);
            let start = factor.inverse_diagonal()[k];
            X[at(k, k)] = (0..L.len()).fold(start, |sum, p| sum - L[p] * X[at(self.before[k][p], k)]);
        }
    }
}
