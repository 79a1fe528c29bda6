//! Tests, with plain numbers, the algorithms that are otherwise used only for recording.
#![allow(non_snake_case)] // matrices are named M and X

use condyle_codegen::{Branches, Carried, JointPlacement};
use condyle_linalg::Ltdl;
use condyle_spatial::{ArticulatedInertia, Force, Inertia, Mat3, Motion, Se3, Sym3, Vec3};
use nalgebra::DMatrix;

/// Tolerance for the rounding errors of several dozen products of numbers of size 1.
const ROUNDING: f64 = 1e-13;

/// Checks solutions and the inverse for a factor of two trees. In the first tree, a trunk of two indices carries three
/// branches, and one of these branches forks again. The second tree is a single index.
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

/// Tolerance for the rounding errors of a few products of numbers of size 1.
const FEW: f64 = 1e-14;

fn is_equal(a: Force<f64>, b: Force<f64>) -> bool {
    a.to_array().iter().zip(b.to_array()).all(|(a, b)| (a - b).abs() < FEW)
}

/// Checks that the short form of a rotation about z gives the same results as a general pose.
#[test]
fn about_z_is_a_pose() {
    let (sin, cos) = 0.7_f64.sin_cos();
    let o = Vec3::zero();
    let rotation = Mat3 { x: Vec3::new(cos, sin, 0.0), y: Vec3::new(-sin, cos, 0.0), ..Mat3::identity() };
    let (short, long) = (JointPlacement::AboutZ { sin, cos }, JointPlacement::General(Se3::new(rotation, o)));
    let f = Force::new(Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.7, 0.1, -0.4));
    let m = Motion::new(Vec3::new(-0.6, 0.8, 0.2), Vec3::new(0.4, 0.9, -0.3));
    let I = Inertia::from_com(
        1.5,
        Vec3::new(0.1, 0.2, -0.3),
        Sym3 { xx: 0.4, xy: 0.03, yy: 0.5, xz: -0.02, yz: 0.05, zz: 0.6 },
    );
    let IA = ArticulatedInertia::from(I).minus_outer(f, 0.2);
    assert!(is_equal(f.carried_by(&short), f.carried_by(&long)));
    assert!(is_equal(I.carried_by(&short) * m, I.carried_by(&long) * m));
    assert!(is_equal(IA.carried_by(&short) * m, IA.carried_by(&long) * m));
    let [a, b] = [short, long].map(|X| Force::from(X.act_inv(m).to_array()));
    assert!(is_equal(a, b));
    let [a, b] = [short, long].map(|X| Force::new(X.turn_inv(m.linear), X.translation()));
    assert!(is_equal(a, b));
}
