//! Tests of sparse and dense factors of M: products of the factors, solutions of linear systems, and zeros of the
//! factors.

use crate::common;

use common::{State, Worst, all_models, dual, normal, rng};
use condyle_dynamics::{
    Cholesky, Data, Inertia, Joint, Ltdl, Mimic, Model, ModelBuilder, Se3, Vec3, WORLD, crba, minv,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance of some hundred rounding errors, relative to the largest entry of M.
const RECONSTRUCTED: f64 = 1e-13;
/// Tolerance of some hundred rounding errors times the condition number of M, which is 1e2 to 1e5 for these robots.
const INVERTED: f64 = 1e-10;
const TREES: u64 = 30;

fn inertia_matrix(model: &Model, seed: u64) -> DMatrix<f64> {
    let q = State::random(model, &mut rng(seed)).q;
    crba(model, &mut Data::new(model), &q).clone_owned()
}

/// Returns the factors L and D of M = Lᵀ D L, with rows and columns in the order that the factor uses.
fn unpack(factor: &Ltdl<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let D = nalgebra::DVector::from_iterator(factor.order().len(), factor.diagonal());
    let mut L = DMatrix::identity(D.len(), D.len());
    for k in 0..D.len() {
        for (e, x) in factor.row(k) {
            L[(k, e)] = x;
        }
    }
    (L, DMatrix::from_diagonal(&D))
}

/// Returns P M Pᵀ, which is M with rows and columns in the given order.
fn ordered(M: &DMatrix<f64>, order: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(M.nrows(), M.nrows(), |i, j| M[(order[i], order[j])])
}

/// Checks that the product of the factors is M, and that D is positive.
#[test]
fn reconstructs() {
    let mut sparse = Worst::new("Lᵀ D L = M", RECONSTRUCTED);
    let mut dense = Worst::new("L Lᵀ = M", RECONSTRUCTED);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let M = inertia_matrix(model, seed as u64);
        let mut factor = Ltdl::new(model);
        factor.factorize(&M);
        let (L, D) = unpack(&factor);
        assert!(factor.diagonal().all(|d| d > 0.0), "{model}");
        let product = L.transpose() * D * L;
        sparse.see(model, product.as_slice(), ordered(&M, factor.order()).as_slice());
        let mut factor = Cholesky::new(model.nv());
        factor.factorize(&M);
        let L = factor.lower().lower_triangle();
        dense.see(model, (&L * L.transpose()).as_slice(), M.as_slice());
    }
}

/// Checks solutions of linear systems with both factors. The right-hand sides are vectors, matrices and the identity.
#[test]
fn solves() {
    let mut vector = Worst::new("M M⁻¹ b = b", INVERTED);
    let mut agree = Worst::new("sparse = dense", INVERTED);
    let mut inverse = Worst::new("M⁻¹ = minv", INVERTED);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let (nv, rng) = (model.nv(), &mut rng(seed as u64));
        let q = State::random(model, rng).q;
        let mut data = Data::new(model);
        let M = crba(model, &mut data, &q).clone();
        let Minv = minv(model, &mut data, &q);
        let (mut sparse, mut dense) = (Ltdl::new(model), Cholesky::new(nv));
        sparse.factorize(&M);
        dense.factorize(&M);
        let B = DMatrix::from_vec(nv, 3, normal(rng, 3 * nv));
        let (mut X, mut Y) = (B.clone(), B.clone());
        sparse.solve_matrix(&mut X);
        dense.solve_matrix(&mut Y);
        vector.see(model, (&M * &X).as_slice(), B.as_slice());
        agree.see(model, X.as_slice(), Y.as_slice());
        let mut x = B.column(1).as_slice().to_vec();
        sparse.solve(&mut x);
        assert_eq!(x, X.column(1).as_slice());
        let mut x = B.column(2).as_slice().to_vec();
        dense.solve(&mut x);
        assert_eq!(x, Y.column(2).as_slice());
        let mut X = DMatrix::from_element(nv, nv, f64::NAN);
        sparse.inverse(&mut X);
        assert_eq!(X, X.transpose());
        inverse.see(model, X.as_slice(), Minv.as_slice());
        X.fill(f64::NAN);
        dense.inverse(&mut X);
        assert_eq!(X, X.transpose());
        inverse.see(model, X.as_slice(), Minv.as_slice());
    }
}

/// Checks the non-zero entries of the factor for robots without shared coordinates. Row k has one entry for each degree
/// of freedom between k and the root, and no other entries.
#[test]
fn zeros_are_those_of_the_tree() {
    for model in all_models(TREES).iter().filter(|m| m.bodies().iter().all(|b| b.mimic.is_none())) {
        let factor = Ltdl::<f64>::new(model);
        assert_eq!(factor.order(), (0..model.nv()).collect::<Vec<_>>());
        let mut nonzeros = 0;
        for body in model.bodies().iter().skip(1) {
            let ancestors = std::iter::successors(Some(body.parent), |&i| Some(model.bodies()[i].parent));
            let mut expected: Vec<usize> = ancestors
                .take_while(|&i| i > 0)
                .flat_map(|i| {
                    let ancestor = &model.bodies()[i];
                    (ancestor.idx_v..ancestor.idx_v + ancestor.joint.nv()).rev()
                })
                .collect();
            for k in body.idx_v..body.idx_v + body.joint.nv() {
                let row: Vec<usize> = factor.row(k).map(|(e, _)| e).collect();
                assert_eq!(row, expected, "row {k} of\n{model}");
                nonzeros += row.len() + 1;
                expected.insert(0, k);
            }
        }
        assert_eq!(factor.nonzeros(), nonzeros);
    }
}

/// Computes M = Lᵀ D L densely. Returns the number of non-zero entries in the lower triangle of L, and L itself.
fn dense_nonzeros(mut H: DMatrix<f64>) -> (usize, DMatrix<f64>) {
    let n = H.nrows();
    for k in (0..n).rev() {
        for i in 0..k {
            let a = H[(k, i)] / H[(k, k)];
            for j in 0..=i {
                H[(i, j)] -= a * H[(k, j)];
            }
        }
        for i in 0..k {
            H[(k, i)] /= H[(k, k)];
        }
    }
    (H.lower_triangle().iter().filter(|&&x| x != 0.0).count(), H)
}

/// Checks for robots with shared coordinates that the rows of the factor contain all non-zero entries. The order that
/// the library chooses must need fewer entries than the original order of the coordinates.
#[test]
fn shared_coordinates_keep_branches_apart() {
    let mut stored = (0, 0);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let M = inertia_matrix(model, seed as u64);
        let mut factor = Ltdl::new(model);
        factor.factorize(&M);
        let (L, _) = unpack(&factor);
        let (_, H) = dense_nonzeros(ordered(&M, factor.order()));
        let scale = 1.0 + L.amax();
        for k in 0..model.nv() {
            for j in 0..k {
                assert!((L[(k, j)] - H[(k, j)]).abs() <= INVERTED * scale, "entry ({k}, {j}) of\n{model}");
            }
        }
        let (natural, _) = dense_nonzeros(M);
        if model.bodies().iter().any(|b| b.mimic.is_some()) {
            stored.0 += factor.nonzeros();
            stored.1 += natural;
        }
    }
    println!("{} entries are stored, {} in the coordinates' own order", stored.0, stored.1);
    assert!(stored.0 < stored.1);
}

/// Checks a hand whose fingers all follow one coordinate, which is at the tip of the first finger. The factor must
/// place this coordinate directly after the palm. The row of a finger then contains this coordinate, the coordinates of
/// the finger, and the coordinates of the arm.
#[test]
fn fingers_that_follow() {
    let link = Inertia::from_com(0.1, Vec3::new(0.01, 0.02, 0.03), condyle_dynamics::Sym3::diagonal(1e-3));
    let joint = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let at = Se3 { translation: Vec3::new(0.0, 0.0, 0.1), ..Se3::identity() };
    let mut hand = ModelBuilder::new("hand");
    let arm = hand.body("arm", WORLD, joint, at, link);
    let palm = hand.body("palm", arm, joint, at, link);
    let mut leader = None;
    for finger in 0..4 {
        let base = hand.body(&format!("base {finger}"), palm, joint, at, link);
        let tip = hand.body(&format!("tip {finger}"), base, joint, at, link);
        match leader {
            None => leader = Some(tip),
            Some(leader) => hand.mimic(tip, leader, Mimic { ratio: 0.5, offset: 0.1 }),
        }
    }
    let hand = hand.build().expect("a hand is well-formed");
    let mut factor = Ltdl::new(&hand);
    assert_eq!(factor.order(), [0, 1, 3, 2, 4, 5, 6], "arm, palm, the tips' coordinate, the fingers' bases");
    assert_eq!(factor.nonzeros(), 1 + 2 + 3 + 4 * 4);
    let M = inertia_matrix(&hand, 0);
    factor.factorize(&M);
    let mut X = M.clone();
    factor.solve_matrix(&mut X);
    assert!((X - DMatrix::identity(7, 7)).amax() < INVERTED);
}

/// Checks the derivative of a solution on dual numbers: d(M⁻¹ b) = −M⁻¹ dM M⁻¹ b.
#[test]
fn on_dual_numbers() {
    let mut worst = Worst::new("d(M⁻¹ b)", INVERTED);
    for (seed, model) in all_models(4).iter().enumerate() {
        let (nv, rng) = (model.nv(), &mut rng(seed as u64));
        let q = State::random(model, rng).q;
        let q = common::moved(model, &common::lift(&q), &dual(&vec![0.0; nv], &normal(rng, nv)));
        let M = crba(model, &mut Data::new(model), &q).clone();
        let b = normal(rng, nv);
        let (mut sparse, mut dense) = (Ltdl::<Dual64>::new(model), Cholesky::new(nv));
        sparse.factorize(&M);
        dense.factorize(&M);
        let (mut x, mut y): (Vec<Dual64>, Vec<Dual64>) = (common::lift(&b), common::lift(&b));
        sparse.solve(&mut x);
        dense.solve(&mut y);
        let dM = M.map(|x| x.eps);
        let mut expected = -(dM * nalgebra::DVector::from_vec(common::real(&x)));
        let mut plain = Ltdl::new(model);
        plain.factorize(&M.map(|x| x.re));
        plain.solve(expected.as_mut_slice());
        worst.see(model, &common::eps(&x), expected.as_slice());
        worst.see(model, &common::eps(&y), expected.as_slice());
    }
}

/// Checks that a factorisation does not depend on the previous content of the factor.
#[test]
fn may_be_used_again() {
    for (seed, model) in all_models(4).iter().enumerate() {
        let (mut used, mut fresh) = (Ltdl::new(model), Ltdl::new(model));
        used.factorize(&DMatrix::from_element(model.nv(), model.nv(), f64::NAN));
        for factor in [&mut used, &mut fresh] {
            factor.factorize(&inertia_matrix(model, seed as u64));
        }
        assert_eq!(unpack(&used), unpack(&fresh));
    }
}

#[test]
#[should_panic(expected = "M: expected 7 × 7, found (7, 6)")]
fn wrong_matrix() {
    Ltdl::new(&condyle_dynamics::robots::arm7()).factorize(&DMatrix::<f64>::zeros(7, 6));
}

#[test]
#[should_panic(expected = "b: expected 7 numbers, found 8")]
fn wrong_vector() {
    Ltdl::new(&condyle_dynamics::robots::arm7()).solve(&mut [0.0; 8]);
}
