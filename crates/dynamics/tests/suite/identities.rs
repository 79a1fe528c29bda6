//! Tests that compare algorithms with each other: inverse dynamics, inertia matrix, forward dynamics, inverse inertia
//! matrix.

use crate::common;

use common::{State, Tree, Worst, all_models, embedded, joint_placement, own_position, rng};
use condyle_dynamics::{
    Act, Data, Force, Joint, Mat3, Model, Quaternion, Se3, Vec3, aba, aba_derivatives, crba, forward_kinematics,
    gravity, minv, nonlinear_effects, rnea, rnea_derivatives,
};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;

/// Tolerance of some hundreds of operations, relative to the largest effort.
const ROUNDING: f64 = 1e-12;
/// Tolerance of some hundreds of operations times the condition number of M, which is 1e2 to 1e5 for these robots.
const INVERTED: f64 = 1e-10;
const STATES: usize = 1000;
const TREES: u64 = 30;

fn vector(x: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(x)
}

/// Checks rnea = M a + h, M M⁻¹ = 1, aba = M⁻¹ (τ − h), rnea ∘ aba = 1 and ∂q̈ = −M⁻¹ ∂τ. The two sides of each
/// equation come from different algorithms. Identities within one algorithm are in `by_construction`.
fn check(model: &Model, states: usize, seed: u64) {
    let mut inverse = Worst::new("M a + h = rnea", ROUNDING);
    let mut identity = Worst::new("M M⁻¹ = 1", INVERTED);
    let mut forward = Worst::new("aba = M⁻¹ (τ − h)", INVERTED);
    let mut round = Worst::new("rnea(aba(τ)) = τ", INVERTED);
    let mut forced = Worst::new("the same with external forces", INVERTED);
    let mut slopes = Worst::new("∂q̈ = −M⁻¹ ∂τ at q̈", INVERTED);
    let mut symmetric = Worst::new("M⁻¹ = M⁻ᵀ", ROUNDING);
    let nv = model.nv();
    let (mut data, mut rng) = (Data::new(model), rng(seed));
    for _ in 0..states {
        let State { q, v, a, tau, f_ext } = State::random(model, &mut rng);
        let h = vector(nonlinear_effects(model, &mut data, &q, &v));
        let M = crba(model, &mut data, &q).clone();
        inverse.see(model, (&M * vector(&a) + &h).as_slice(), rnea(model, &mut data, &q, &v, &a, &[]));
        let Minv = minv(model, &mut data, &q).clone();
        identity.see(model, (&Minv * &M).as_slice(), DMatrix::identity(nv, nv).as_slice());
        let qdd = aba(model, &mut data, &q, &v, &tau, &[]).to_vec();
        forward.see(model, (&Minv * (vector(&tau) - &h)).as_slice(), &qdd);
        round.see(model, rnea(model, &mut data, &q, &v, &qdd, &[]), &tau);
        let qdd = aba(model, &mut data, &q, &v, &tau, &f_ext).to_vec();
        forced.see(model, rnea(model, &mut data, &q, &v, &qdd, &f_ext), &tau);
        let d = rnea_derivatives(model, &mut data, &q, &v, &qdd, &f_ext);
        let products = [-&Minv * d.dtau_dq, -&Minv * d.dtau_dv];
        let d = aba_derivatives(model, &mut data, &q, &v, &tau, &f_ext);
        slopes.see(model, d.da_dq.as_slice(), products[0].as_slice());
        slopes.see(model, d.da_dv.as_slice(), products[1].as_slice());
        symmetric.see(model, d.da_dtau.as_slice(), d.da_dtau.transpose().as_slice());
    }
}

#[test]
fn arm() {
    check(&embedded()[0], STATES, 1);
}

#[test]
fn quadruped() {
    check(&embedded()[1], STATES, 2);
}

#[test]
fn humanoid() {
    check(&embedded()[2], STATES, 3);
}

#[test]
fn random_trees() {
    for seed in 0..TREES {
        check(&Tree::random(&mut rng(seed)).build(), 5, seed);
    }
}

#[test]
fn random_trees_with_mimics() {
    for seed in 0..TREES {
        check(&Tree::random_with_mimics(&mut rng(seed)).build(), 5, seed);
    }
}

/// Checks h = rnea(q, v, 0), g = rnea(q, 0, 0) and M = Mᵀ to the bit. These identities hold by construction: h and g
/// are computed by the passes of rnea, and one triangle of M is copied. So this test only protects the construction,
/// and checks no physics. Other tests check h, g and M themselves: `book` (another formulation), `energy` (g and M as
/// derivatives of energies), `closed_forms`, and the comparisons with Pinocchio.
#[test]
fn by_construction() {
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let (mut data, zero) = (Data::new(model), vec![0.0; model.nv()]);
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let h = nonlinear_effects(model, &mut data, &q, &v).to_vec();
        assert_eq!(rnea(model, &mut data, &q, &v, &zero, &[]), h);
        let g = gravity(model, &mut data, &q).to_vec();
        assert_eq!(rnea(model, &mut data, &q, &zero, &zero, &[]), g);
        let M = crba(model, &mut data, &q).clone();
        assert_eq!(M, M.transpose());
    }
}

/// Checks that M is positive definite, for trees of all shapes and with every type of joint.
#[test]
fn inertia_matrix_is_positive() {
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let mut data = Data::new(model);
        let q = State::random(model, &mut rng(seed as u64)).q;
        assert!(crba(model, &mut data, &q).clone().cholesky().is_some(), "{model}");
    }
}

/// Checks that a robot with mimic joints equals the same robot without mimics under the constraint v_joint = G v, with
/// the matrix G of the ratios: τ = Gᵀ τ_joint and M = Gᵀ M_joint G.
#[test]
fn mimics_are_a_projection() {
    let mut efforts = Worst::new("τ = Gᵀ rnea(G q + o, G v, G a)", ROUNDING);
    let mut matrix = Worst::new("M = Gᵀ M G", ROUNDING);
    for seed in 0..TREES {
        let tree = Tree::random_with_mimics(&mut rng(seed));
        let (model, free) = (tree.build(), tree.without_mimics().build());
        assert_eq!(free.nv() - model.nv(), 7);
        let mut G = DMatrix::zeros(free.nv(), model.nv());
        let State { q, v, a, f_ext, .. } = State::random(&model, &mut rng(seed));
        let mut q_free = vec![0.0; free.nq()];
        for (i, (own, other)) in model.bodies().iter().zip(free.bodies()).enumerate().skip(1) {
            assert_eq!(own.name, other.name);
            q_free[other.idx_q..other.idx_q + other.joint.nq()].copy_from_slice(&own_position(&model, i, &q));
            let ratio = own.mimic.map_or(1.0, |m| m.ratio);
            for k in 0..own.joint.nv() {
                G[(other.idx_v + k, own.idx_v + k)] = ratio;
            }
        }
        let (v_free, a_free) = (&G * vector(&v), &G * vector(&a));
        let mut data = (Data::new(&model), Data::new(&free));
        let tau_free = rnea(&free, &mut data.1, &q_free, v_free.as_slice(), a_free.as_slice(), &f_ext);
        let projected = G.transpose() * vector(tau_free);
        efforts.see(&model, rnea(&model, &mut data.0, &q, &v, &a, &f_ext), projected.as_slice());
        let M = G.transpose() * crba(&free, &mut data.1, &q_free) * &G;
        matrix.see(&model, crba(&model, &mut data.0, &q).as_slice(), M.as_slice());
    }
}

/// Checks a robot that is described again with other body frames. Frames have any orientation; the origin of a hinge's
/// frame is anywhere on the axis, and the origin of a slide's frame is anywhere. The coordinates do not change, so
/// efforts, accelerations and M must not change either.
#[test]
fn frames_do_not_matter() {
    let mut efforts = Worst::new("rnea in other frames", ROUNDING);
    let mut accelerations = Worst::new("aba in other frames", INVERTED);
    let mut places = Worst::new("frames in other frames", ROUNDING);
    let mut slopes = ["∂τ/∂q", "∂τ/∂v", "∂τ/∂a"].map(|name| Worst::new(name, ROUNDING));
    let mut inverse_slopes = ["∂q̈/∂q", "∂q̈/∂v", "∂q̈/∂τ"].map(|name| Worst::new(name, INVERTED));
    for seed in 0..2 * TREES {
        let rng = &mut rng(seed);
        let tree = if seed % 2 == 0 { Tree::random(rng) } else { Tree::random_with_mimics(rng) };
        let mut other = tree.clone();
        // placement oXn of each body's new frame n in the old frame o
        let mut news = vec![Se3::identity()];
        for part in &mut other.parts {
            let axis = part.joint.axis().map(|a| a.scale(1.0 / a.norm_squared().sqrt()));
            let turned = common::random_rotation(rng);
            let new = match (part.joint, axis) {
                (Joint::Prismatic { .. }, _) => Se3::new(turned, common::normal3(rng)),
                (Joint::Translation, _) => Se3::new(Mat3::identity(), common::normal3(rng)),
                (_, Some(axis)) => Se3::new(turned, axis.scale(rng.random())),
                _ => Se3::identity(),
            };
            let axis = axis.map_or(Vec3::zero(), |a| new.rotation.transpose_mul(a));
            part.joint = match part.joint {
                Joint::Revolute { .. } => Joint::Revolute { axis },
                Joint::Continuous { .. } => Joint::Continuous { axis },
                Joint::Prismatic { .. } => Joint::Prismatic { axis },
                Joint::Helical { pitch, .. } => Joint::Helical { axis, pitch },
                joint => joint,
            };
            part.placement = news[part.parent].inverse() * part.placement * new;
            part.inertia = new.act_inv(part.inertia);
            part.frame = new.inverse() * part.frame;
            news.push(new);
        }
        let (one, two) = (tree.build(), other.build());
        let State { q, v, a, tau, f_ext } = State::random(&one, rng);
        let mut f_other = f_ext.clone();
        for (i, body) in two.bodies().iter().enumerate().skip(1) {
            let part: usize = body.name[1..].parse().expect("parts are named by number");
            f_other[i] = news[part].act_inv(f_ext[i]);
        }
        let mut data = (Data::new(&one), Data::new(&two));
        let expected = rnea(&one, &mut data.0, &q, &v, &a, &f_ext);
        efforts.see(&one, rnea(&two, &mut data.1, &q, &v, &a, &f_other), expected);
        let expected = aba(&one, &mut data.0, &q, &v, &tau, &f_ext);
        accelerations.see(&one, aba(&two, &mut data.1, &q, &v, &tau, &f_other), expected);
        let expected = rnea_derivatives(&one, &mut data.0, &q, &v, &a, &f_ext);
        let found = rnea_derivatives(&two, &mut data.1, &q, &v, &a, &f_other);
        let pairs =
            [(found.dtau_dq, expected.dtau_dq), (found.dtau_dv, expected.dtau_dv), (found.dtau_da, expected.dtau_da)];
        slopes.iter_mut().zip(pairs).for_each(|(slope, (x, y))| slope.see(&one, x.as_slice(), y.as_slice()));
        let expected = aba_derivatives(&one, &mut data.0, &q, &v, &tau, &f_ext);
        let found = aba_derivatives(&two, &mut data.1, &q, &v, &tau, &f_other);
        let pairs = [(found.da_dq, expected.da_dq), (found.da_dv, expected.da_dv), (found.da_dtau, expected.da_dtau)];
        inverse_slopes.iter_mut().zip(pairs).for_each(|(slope, (x, y))| slope.see(&one, x.as_slice(), y.as_slice()));
        let expected = forward_kinematics(&one, &mut data.0, &q);
        let found = forward_kinematics(&two, &mut data.1, &q);
        for f in 0..one.frames().len() {
            places.see(&one, &common::flat(found.frame(f)), &common::flat(expected.frame(f)));
        }
    }
}

/// Checks that results in the frames of a floating robot do not change if the robot and gravity are rotated and moved
/// together.
#[test]
fn moved_as_a_whole() {
    let mut slopes = ["∂τ/∂q", "∂τ/∂v", "∂τ/∂a"].map(|name| Worst::new(name, ROUNDING));
    let mut inverse_slopes = ["∂q̈/∂q", "∂q̈/∂v", "∂q̈/∂τ"].map(|name| Worst::new(name, INVERTED));
    let floats = |m: &&Model| m.bodies()[1].joint == Joint::FreeFlyer && m.bodies()[2..].iter().all(|b| b.parent > 0);
    let models = all_models(TREES);
    assert!(models.iter().filter(floats).count() > 3);
    for (seed, model) in models.iter().filter(floats).enumerate() {
        let rng = &mut rng(seed as u64);
        let State { q, v, a, tau, f_ext } = State::random(model, rng);
        let (by, place) = (Se3::new(common::random_rotation(rng), common::normal3(rng)), model.bodies()[1].placement);
        let turned = model.clone().with_gravity(by.rotation * *model.gravity()).unwrap();
        let base = Se3::new(Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation(), Vec3::new(q[0], q[1], q[2]));
        let moved = place.inverse() * by * place * base;
        let mut q_moved = q.clone();
        q_moved[..3].copy_from_slice(&moved.translation.to_array());
        let quaternion = Quaternion::from_rotation(moved.rotation);
        q_moved[3..6].copy_from_slice(&quaternion.vector.to_array());
        q_moved[6] = quaternion.scalar;
        let mut data = (Data::new(model), Data::new(model));
        let expected = rnea_derivatives(model, &mut data.0, &q, &v, &a, &f_ext);
        let found = rnea_derivatives(&turned, &mut data.1, &q_moved, &v, &a, &f_ext);
        let pairs =
            [(found.dtau_dq, expected.dtau_dq), (found.dtau_dv, expected.dtau_dv), (found.dtau_da, expected.dtau_da)];
        slopes.iter_mut().zip(pairs).for_each(|(slope, (x, y))| slope.see(model, x.as_slice(), y.as_slice()));
        let expected = aba_derivatives(model, &mut data.0, &q, &v, &tau, &f_ext);
        let found = aba_derivatives(&turned, &mut data.1, &q_moved, &v, &tau, &f_ext);
        let pairs = [(found.da_dq, expected.da_dq), (found.da_dv, expected.da_dv), (found.da_dtau, expected.da_dtau)];
        inverse_slopes.iter_mut().zip(pairs).for_each(|(slope, (x, y))| slope.see(model, x.as_slice(), y.as_slice()));
    }
}

/// Checks that the placements of bodies equal products of matrices from textbooks, in the frames of the model.
#[test]
fn placements() {
    let mut worst = Worst::new("oX_i = oX_λ X_T X_J", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let q = State::random(model, &mut rng(seed as u64)).q;
        let mut data = Data::new(model);
        let placements = forward_kinematics(model, &mut data, &q);
        assert_eq!(placements.body(0), Se3::identity());
        for (i, body) in model.bodies().iter().enumerate().skip(1) {
            let own = own_position(model, i, &q);
            let expected = placements.body(body.parent) * body.placement * joint_placement(body.joint, &own);
            worst.see(model, &common::flat(placements.body(i)), &common::flat(expected));
        }
        for (f, frame) in model.frames().iter().enumerate() {
            let expected = placements.body(frame.body) * frame.placement;
            worst.see(model, &common::flat(placements.frame(f)), &common::flat(expected));
        }
    }
}

/// Checks that a force on the world has no effect.
#[test]
fn force_on_the_world() {
    let [arm, ..] = embedded();
    let State { q, v, a, mut f_ext, .. } = State::random(&arm, &mut rng(0));
    let mut data = Data::new(&arm);
    let before = rnea(&arm, &mut data, &q, &v, &a, &f_ext).to_vec();
    f_ext[0] = Force::new(Vec3::new(1e9, 0.0, 0.0), Vec3::zero());
    assert_eq!(rnea(&arm, &mut data, &q, &v, &a, &f_ext), before);
}
