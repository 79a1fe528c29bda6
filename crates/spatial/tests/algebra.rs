//! Identities of spatial algebra on random motions, forces, poses and inertias.
#![allow(non_snake_case)]

mod common;

use common::{config, distance, flat, force, inertia, motion, pose, rotation, vec3};
use condyle_spatial::{Act, ArticulatedInertia, Cross, Force, Inertia, Motion, Se3, Sym3, Vec3};
use proptest::prelude::*;

/// Rounding error of a few operations on numbers of at most some hundreds.
const ROUNDING: f64 = 1e-12;

fn unit(k: usize) -> Motion<f64> {
    core::array::from_fn(|i| if i == k { 1.0 } else { 0.0 }).into()
}

fn flat_inertia(I: Inertia<f64>) -> [f64; 10] {
    let (h, r) = (I.mass_com, I.rotational);
    [I.mass, h.x, h.y, h.z, r.xx, r.xy, r.yy, r.xz, r.yz, r.zz]
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn power_has_no_frame(X in pose(), m in motion(), f in force()) {
        prop_assert!((X.act(m).dot(X.act(f)) - m.dot(f)).abs() < ROUNDING);
        prop_assert!((X.act_inv(m).dot(X.act_inv(f)) - m.dot(f)).abs() < ROUNDING);
    }

    #[test]
    fn act_inv_undoes_act(X in pose(), m in motion(), f in force(), x in vec3(), I in inertia()) {
        prop_assert!(distance(X.act_inv(X.act(m)).to_array(), m.to_array()) < ROUNDING);
        prop_assert!(distance(X.act_inv(X.act(f)).to_array(), f.to_array()) < ROUNDING);
        prop_assert!(distance(X.act_inv(X.act(x)).to_array(), x.to_array()) < ROUNDING);
        prop_assert!(distance(flat_inertia(X.act_inv(X.act(I))), flat_inertia(I)) < 10.0 * ROUNDING);
        prop_assert!(distance(X.inverse().act(m).to_array(), X.act_inv(m).to_array()) < ROUNDING);
        prop_assert!(distance(X.inverse().act(f).to_array(), X.act_inv(f).to_array()) < ROUNDING);
        prop_assert!(distance(X.inverse().act(x).to_array(), X.act_inv(x).to_array()) < ROUNDING);
    }

    #[test]
    fn poses_compose(X in pose(), Y in pose(), m in motion(), f in force(), x in vec3()) {
        prop_assert!(distance((X * Y).act(m).to_array(), X.act(Y.act(m)).to_array()) < ROUNDING);
        prop_assert!(distance((X * Y).act(f).to_array(), X.act(Y.act(f)).to_array()) < ROUNDING);
        prop_assert!(distance((X * Y).act(x).to_array(), X.act(Y.act(x)).to_array()) < ROUNDING);
        let one = X * X.inverse();
        prop_assert!(distance(flat(one.rotation), flat(Se3::identity().rotation)) < ROUNDING);
        prop_assert!(distance(one.translation.to_array(), [0.0; 3]) < ROUNDING);
    }

    #[test]
    fn cross_products(u in motion(), v in motion(), m in motion(), f in force(), X in pose()) {
        let jacobi = u.cross(v.cross(m)) + v.cross(m.cross(u)) + m.cross(u.cross(v));
        prop_assert!(distance(jacobi.to_array(), [0.0; 6]) < ROUNDING);
        prop_assert!((v.cross(m).dot(f) + m.dot(v.cross(f))).abs() < ROUNDING); // the transpose of v× is −(v×*)
        let expected = u.cross(v.cross(f)) - v.cross(u.cross(f));
        prop_assert!(distance((u.cross(v)).cross(f).to_array(), expected.to_array()) < ROUNDING);
        prop_assert!(distance(v.cross(v).to_array(), [0.0; 6]) < ROUNDING);
        prop_assert!(distance(X.act(v.cross(m)).to_array(), X.act(v).cross(X.act(m)).to_array()) < ROUNDING);
        prop_assert!(distance(X.act(v.cross(f)).to_array(), X.act(v).cross(X.act(f)).to_array()) < ROUNDING);
    }

    #[test]
    fn inertia_moves_by_congruence(X in pose(), I in inertia(), m in motion()) {
        // transforming the inertia gives the same as X* I X⁻¹ m: m transformed back, multiplied by I, and transformed
        prop_assert!(distance((X.act(I) * m).to_array(), X.act(I * X.act_inv(m)).to_array()) < 10.0 * ROUNDING);
    }

    #[test]
    fn inertia_is_symmetric_and_positive(I in inertia(), u in motion(), v in motion()) {
        prop_assert!((u.dot(I * v) - v.dot(I * u)).abs() < ROUNDING);
        prop_assert!(v.dot(I * v) > 0.0);
        // a rotation of the body produces no power: v · (v ×* I v) = 0
        prop_assert!(v.dot(v.cross(I * v)).abs() < 10.0 * ROUNDING);
    }

    #[test]
    fn gyroscopic_torque(c in vec3(), mass in 0.1..2.0, w in vec3(), d in prop::array::uniform3(0.1..2.0)) {
        // a body rotates about its centre of mass: with the angular velocity ω and the inertia J, the moment about this
        // point is n = ω × J ω, and the force is zero
        let J = Sym3 { xx: d[0], yy: d[1], zz: d[2], ..Sym3::zero() };
        let at_com = Inertia::from_com(mass, Vec3::zero(), J);
        let v = Motion::new(Vec3::zero(), w);
        let f = v.cross(at_com * v);
        prop_assert!(distance(f.linear.to_array(), [0.0; 3]) < ROUNDING);
        prop_assert!(distance(f.angular.to_array(), w.cross(J * w).to_array()) < ROUNDING);
        // if the body rotates about another point, the centripetal force m ω × (ω × c) is added; it acts at c
        let away = Inertia::from_com(mass, c, J);
        let f = v.cross(away * v);
        let pull = w.cross(w.cross(c)).scale(mass);
        prop_assert!(distance(f.linear.to_array(), pull.to_array()) < 10.0 * ROUNDING);
        prop_assert!(distance(f.angular.to_array(), (w.cross(J * w) + c.cross(pull)).to_array()) < 10.0 * ROUNDING);
    }

    #[test]
    fn inertia_is_a_sum_of_points(points in prop::collection::vec((0.1..2.0, vec3()), 3), v in motion()) {
        // the momentum of a mass point m at c is m (v + ω × c), with a moment about the origin
        let mut I = Inertia::zero();
        let mut momentum = Force::zero();
        for (m, c) in points {
            I += Inertia::from_com(m, c, Sym3::zero());
            let p = (v.linear + v.angular.cross(c)).scale(m);
            momentum += Force::new(p, c.cross(p));
        }
        prop_assert!(distance((I * v).to_array(), momentum.to_array()) < 10.0 * ROUNDING);
    }

    #[test]
    fn articulated_inertia(I in inertia(), s in motion(), v in motion()) {
        let IA = ArticulatedInertia::from(I);
        prop_assert!(distance((IA * v).to_array(), (I * v).to_array()) < 10.0 * ROUNDING);
        let U = IA * s;
        let eliminated = IA.minus_outer(U, 1.0 / s.dot(U)); // no force acts along s, so the body moves freely along s
        prop_assert!(distance((eliminated * s).to_array(), [0.0; 6]) < 100.0 * ROUNDING);
        for k in 0..6 {
            let expected = (IA * unit(k)).to_array()[k] - U.to_array()[k] * U.to_array()[k] / s.dot(U);
            prop_assert!(((eliminated * unit(k)).to_array()[k] - expected).abs() < 10.0 * ROUNDING);
        }
    }

    #[test]
    fn articulated_inertia_in_another_frame(I in inertia(), X in pose(), s in motion(), v in motion()) {
        let IA = ArticulatedInertia::from(I);
        let U = IA * s;
        let Ia = IA.minus_outer(U, 1.0 / s.dot(U));
        let there = X.act(Ia);
        // X (Iᴬ v) = (X Iᴬ X⁻¹) (X v), and the inverse transformation undoes this
        prop_assert!(distance((there * X.act(v)).to_array(), X.act(Ia * v).to_array()) < 1000.0 * ROUNDING);
        prop_assert!(distance((X.act_inv(there) * v).to_array(), (Ia * v).to_array()) < 1000.0 * ROUNDING);
    }

    #[test]
    fn matrices(R in rotation(), a in vec3(), b in vec3(), I in inertia()) {
        prop_assert!(distance((a.skew() * b).to_array(), a.cross(b).to_array()) < ROUNDING);
        prop_assert!(distance(R.transpose_mul(a).to_array(), (R.transpose() * a).to_array()) < ROUNDING);
        prop_assert!(distance(flat(R * R.transpose()), flat(Se3::identity().rotation)) < ROUNDING);
        prop_assert!(distance((R * a).cross(R * b).to_array(), (R * a.cross(b)).to_array()) < ROUNDING);
        let J = I.rotational;
        prop_assert!(distance(flat(J.rotate(R).full()), flat(R * J.full() * R.transpose())) < 10.0 * ROUNDING);
        prop_assert!(distance((J * a).to_array(), (J.full() * a).to_array()) < ROUNDING);
        prop_assert!(distance((Sym3::outer(a) * b).to_array(), a.scale(a.dot(b)).to_array()) < ROUNDING);
        let expected = a.scale(b.dot(a)) + b.scale(a.dot(a));
        prop_assert!(distance((Sym3::outer_sum(a, b) * a).to_array(), expected.to_array()) < ROUNDING);
        prop_assert!(distance(flat(J.add_diagonal(0.5).full()), flat(J.full().add_diagonal(0.5))) < ROUNDING);
        prop_assert!(distance((-a + b.scale_add(3.0, a) - b.scale(3.0)).to_array(), [0.0; 3]) < ROUNDING);
    }
}
