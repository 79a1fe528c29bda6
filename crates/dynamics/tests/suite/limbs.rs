//! The limbs of one robot side by side: the numbers of body after body. (At the baseline, both are that.)

use crate::common::{State, Tree, Worst, all_models, rng};
use condyle_dynamics::{
    Data, Inertia, Joint, Model, ModelBuilder, Se3, Sym3, WORLD, aba, nonlinear_effects, rnea, robots,
};

/// Sums in another order, over at most some tens of bodies; what contains M⁻¹ also by its condition.
const TOLERANCE: f64 = 1e-12;
const TOLERANCE_ABA: f64 = 1e-8;

/// Robots with three to six limbs of random joints on a random base, some of them with branches.
fn many_limbs(seed: u64, root: Joint) -> Model {
    let mut rng = rng(seed);
    let mut tree = Tree { parts: Vec::new(), gravity: [0.0, 1.0, -9.0].into() };
    let base = tree.add(&mut rng, 0, root);
    for limb in 0..3 + seed as usize % 4 {
        let axis = crate::common::normal3(&mut rng);
        let joints = [
            Joint::Revolute { axis },
            Joint::Revolute { axis },
            [Joint::Prismatic { axis }, Joint::Continuous { axis }, Joint::Spherical, Joint::Planar][seed as usize % 4],
            Joint::Helical { axis, pitch: if limb % 2 == 0 { 0.1 } else { 0.2 } },
            Joint::Revolute { axis },
        ];
        let (mut last, first) = (base, tree.parts.len() + 1);
        for joint in &joints[..2 + (seed as usize + limb) % 4] {
            last = tree.add(&mut rng, last, *joint);
        }
        if seed.is_multiple_of(3) {
            tree.follow(first + 1, first, -0.5, 0.2);
        }
        if limb == 1 {
            let fork = last;
            for _ in 0..3 {
                last = tree.add(&mut rng, fork, Joint::Revolute { axis });
                tree.add(&mut rng, last, Joint::Revolute { axis });
            }
        }
    }
    tree.build()
}

fn compare(model: &Model, worst: &mut [Worst; 2], seed: u64) {
    let in_turn = model.clone().with_limbs(false);
    let (mut data, mut one) = (Data::new(model), Data::new(&in_turn));
    let (m, mut rng) = (model, rng(seed));
    for _ in 0..3 {
        let State { q, v, a, tau, f_ext, .. } = State::random(model, &mut rng);
        for f_ext in [&f_ext[..], &[]] {
            let expected = rnea(&in_turn, &mut one, &q, &v, &a, f_ext).to_vec();
            worst[0].see(m, rnea(m, &mut data, &q, &v, &a, f_ext), &expected);
            if model.singular_joints().is_empty() {
                let expected = aba(&in_turn, &mut one, &q, &v, &tau, f_ext).to_vec();
                worst[1].see(m, aba(m, &mut data, &q, &v, &tau, f_ext), &expected);
            }
        }
        let expected = nonlinear_effects(&in_turn, &mut one, &q, &v).to_vec();
        worst[0].see(m, nonlinear_effects(m, &mut data, &q, &v), &expected);
    }
}

#[test]
fn the_numbers_of_body_after_body() {
    let mut worst = [Worst::new("rnea", TOLERANCE), Worst::new("aba", TOLERANCE_ABA)];
    let axis = [0.0, 0.6, 0.8].into();
    for seed in 0..24 {
        let roots = [Joint::FreeFlyer, Joint::Revolute { axis }, Joint::Planar];
        compare(&many_limbs(seed, roots[seed as usize % 3]), &mut worst, seed);
    }
    for (seed, model) in all_models(12).iter().enumerate() {
        compare(model, &mut worst, seed as u64);
    }
}

/// Another armature, gravity or inertia is seen by the same `Data`.
#[test]
fn of_the_model_that_is_given() {
    let quadruped = robots::quadruped();
    let mut data = Data::new(&quadruped);
    let State { q, v, a, .. } = State::random(&quadruped, &mut rng(0));
    let heavier = |_, I: Inertia<f64>| I.scale(2.0);
    for other in [
        quadruped.clone().with_armature(&[0.3; 18]),
        quadruped.clone().with_gravity([1.0, 2.0, 3.0].into()),
        quadruped.with_inertias(heavier),
    ] {
        let found = rnea(&other, &mut data, &q, &v, &a, &[]).to_vec();
        let in_turn = other.with_limbs(false);
        let expected = rnea(&in_turn, &mut data, &q, &v, &a, &[]);
        assert!(crate::common::relative(&found, expected) < TOLERANCE);
    }
}

/// Scratch that was cloned, before a force was ever given, computes the same way.
#[test]
fn with_cloned_data() {
    let quadruped = robots::quadruped();
    let State { q, v, a, f_ext, .. } = State::random(&quadruped, &mut rng(0));
    let mut data = Data::new(&quadruped);
    let mut clone = data.clone();
    for f_ext in [&f_ext[..], &[]] {
        let expected = rnea(&quadruped, &mut data, &q, &v, &a, f_ext);
        assert_eq!(rnea(&quadruped, &mut clone, &q, &v, &a, f_ext), expected);
    }
}

/// A number that is not one comes out at the limb that holds it and at the base, and nowhere else.
#[test]
fn what_is_not_a_number_stays_in_its_limb() {
    let model = robots::quadruped();
    let State { q, mut v, a, .. } = State::random(&model, &mut rng(0));
    v[7] = f64::NAN; // the first leg's second joint
    let mut data = Data::new(&model);
    let tau = rnea(&model, &mut data, &q, &v, &a, &[]);
    assert!(tau[6..9].iter().all(|x| x.is_nan()) && tau[9..].iter().all(|x| x.is_finite()), "{tau:?}");
}

#[test]
fn a_robot_of_loose_bodies() {
    let mut builder = ModelBuilder::new("loose");
    for k in 0..7 {
        let joint = if k % 2 == 0 { Joint::Translation } else { Joint::FreeFlyer };
        let inertia = Inertia::from_com(1.0, [0.1, 0.0, 0.0].into(), Sym3::diagonal(0.1));
        builder.body(&format!("body{k}"), WORLD, joint, Se3::identity(), inertia);
    }
    let mut worst = [Worst::new("rnea", TOLERANCE), Worst::new("aba", TOLERANCE_ABA)];
    compare(&builder.build().expect("it is well-formed"), &mut worst, 0);
}
