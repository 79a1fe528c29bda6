//! Solutions and inverses by the branches of a factor.
#![allow(non_snake_case)] // M, X

use condyle_linalg::Ltdl;
use condyle_linalg::branches::Branches;
use nalgebra::DMatrix;

/// The rounding of a few dozen products of numbers about 1.
const ROUNDING: f64 = 1e-13;

/// Two trees: a trunk of two places with three branches, one of which branches again, and a single place.
#[test]
fn solutions_and_inverse_are_those_of_the_factor() {
    let tree = [None, Some(0), Some(1), Some(2), Some(1), Some(4), Some(5), Some(5), Some(0), None];
    let (n, mut factor) = (tree.len(), Ltdl::<f64>::new(&tree[..]));
    let ways: Vec<Vec<usize>> = (0..n).map(|k| core::iter::successors(Some(k), |&k| tree[k]).collect()).collect();
    let mut M = DMatrix::identity(n, n);
    for (k, way) in ways.iter().enumerate() {
        for &e in way {
            let x = if e == k { 3.0 } else { 0.2 + 0.03 * (k as f64) - 0.05 * (e as f64) };
            (M[(k, e)], M[(e, k)]) = (x, x);
        }
    }
    factor.factorize(&M);
    let mut branches = Branches::new(&factor);
    let [mut X, mut expected] = [(); 2].map(|()| DMatrix::zeros(n, n));
    branches.inverse(&mut X);
    factor.inverse(&mut expected);
    assert!((&X - &expected).amax() < ROUNDING, "{}", &X - &expected);
    for k in 0..n {
        let mut b: Vec<f64> = (0..n).map(|e| if ways[k].contains(&e) { 1.0 + e as f64 } else { 0.0 }).collect();
        let mut expected = b.clone();
        branches.minus_solve(&mut b);
        factor.solve(&mut expected);
        assert!(b.iter().zip(&expected).all(|(a, b)| (a + b).abs() < ROUNDING), "{b:?}, expected minus {expected:?}");
    }
}
