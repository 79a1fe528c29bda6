//! Tests of factorizations and products that use the zeros of a tree, compared with dense factorizations and products.
#![allow(non_snake_case)]

use condyle_linalg::sparsity::NonzeroRows;
use condyle_linalg::tree_product::{neg_product, neg_products};
use condyle_linalg::{Cholesky, ColumnTree, Ltdl};
use nalgebra::{DMatrix, DVector};

/// Rounding error of sums of about ten products of numbers near 1, and of solves with matrices of condition number 10.
const ROUNDING: f64 = 1e-13;

/// Parents of the columns: a trunk of three columns that carries two limbs of five columns each.
const PARENTS: [Option<usize>; 13] = {
    let mut parents = [None; 13];
    let mut c = 1;
    while c < 13 {
        parents[c] = Some(if c == 8 { 2 } else { c - 1 });
        c += 1;
    }
    parents
};

/// Tree with the parents `PARENTS`, where the first columns of both limbs share one row.
struct Shared;

impl ColumnTree for Shared {
    fn rows(&self) -> usize {
        12
    }
    fn columns(&self) -> usize {
        13
    }
    fn parent(&self, c: usize) -> Option<usize> {
        PARENTS[c]
    }
    fn row(&self, c: usize) -> usize {
        match c {
            0..8 => c,
            8 => 3,
            _ => c - 1,
        }
    }
}

/// Returns a pseudo-random number between −1 and 1 for each i.
fn number(i: usize) -> f64 {
    (1.0 + 7.3 * i as f64).sin()
}

/// Returns whether column c is on the path from column d to the root, or d on the path from c.
fn related(tree: &(impl ColumnTree + ?Sized), c: usize, d: usize) -> bool {
    let (low, high) = (c.min(d), c.max(d));
    core::iter::successors(Some(high), |&c| tree.parent(c)).any(|c| c == low)
}

/// Returns a positive definite matrix whose zeros follow a tree.
fn matrix(tree: &(impl ColumnTree + ?Sized)) -> DMatrix<f64> {
    let n = tree.rows();
    let mut M = DMatrix::from_diagonal_element(n, n, 10.0);
    for c in 0..tree.columns() {
        for d in 0..c {
            if related(tree, c, d) && tree.row(c) != tree.row(d) {
                let x = number(c * n + d);
                M[(tree.row(c), tree.row(d))] += x;
                M[(tree.row(d), tree.row(c))] += x;
            }
        }
    }
    M
}

fn check(tree: &(impl ColumnTree + ?Sized)) {
    let M = matrix(tree);
    let n = tree.rows();
    let (mut sparse, mut dense) = (Ltdl::new(tree), Cholesky::new(n));
    sparse.factorize(&M);
    dense.factorize(&M);
    assert!(sparse.nonzeros() < n * (n + 1) / 2, "some zeros are left");
    let b = DVector::from_fn(n, |i, _| number(i));
    let (mut x, mut y) = (b.clone(), b.clone());
    sparse.solve(x.as_mut_slice());
    dense.solve(y.as_mut_slice());
    assert!((&x - &y).amax() < ROUNDING && (&M * &x - &b).amax() < ROUNDING);
    let (mut X, mut Y) = (M.clone(), M.clone());
    sparse.inverse(&mut X);
    dense.inverse(&mut Y);
    assert!((&X - &Y).amax() < ROUNDING && (M * X - DMatrix::identity(n, n)).amax() < ROUNDING);
}

#[test]
fn factors_agree() {
    check(&PARENTS[..]);
    check(&Shared);
}

#[test]
fn products_agree() {
    let n = PARENTS.len();
    let tree = &PARENTS[..];
    let rows = (0..n).map(|c| (0..n).filter(|&d| related(tree, c, d)).collect()).collect();
    let nonzero_rows = NonzeroRows::of_columns(rows);
    let A = matrix(tree).map(|x| x - 1.0);
    let B = |k: usize| DMatrix::from_fn(n, n, |i, j| if related(tree, i, j) { number(i + n * j + k) } else { 0.0 });
    let (B0, B1) = (B(0), B(5));
    let zeros = || DMatrix::from_element(n, n, f64::NAN);
    let (mut X, mut Y, mut Z) = (zeros(), zeros(), zeros());
    neg_product(A.as_slice(), B0.as_slice(), X.as_mut_slice(), &nonzero_rows);
    let out = [Y.as_mut_slice(), Z.as_mut_slice()];
    neg_products(A.as_slice(), [B0.as_slice(), B1.as_slice()], out, &nonzero_rows);
    for (found, expected) in [(X, -&A * &B0), (Y, -&A * &B0), (Z, -&A * &B1)] {
        assert!((found - expected).amax() < ROUNDING * n as f64);
    }
}
