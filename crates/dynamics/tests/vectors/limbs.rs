//! Tests of limbs: branches of one robot that are computed in parallel lanes. The results are compared with a
//! computation body by body. (At the baseline SIMD level, both computations are body by body.)

use crate::best_level;
use crate::common::contacts::random_constraints;
use crate::common::panics::assert_panic;
use crate::common::{State, Tree, Worst, all_models, relative, rng};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, Inertia, Input, Joint, Model, ModelBuilder, ProximalSettings,
    ReferenceFrame, Se3, Sym3, Vec3, WORLD, aba, aba_derivatives, constrained_dynamics, crba, forward_kinematics, minv,
    neutral, nonlinear_effects, rnea, rnea_derivatives, robots,
};
use nalgebra::DMatrix;

/// Tolerance between sums over at most some tens of bodies, added in different orders. `TOLERANCE_ABA` is for results
/// with M⁻¹ and includes the condition number of M.
const TOLERANCE: f64 = 1e-12;
const TOLERANCE_ABA: f64 = 1e-8;

/// Creates a robot with three to six limbs of random joints on a base with the joint `root`. One limb has branches.
fn many_limbs(seed: u64, root: Joint) -> Model {
    let mut rng = rng(seed);
    let mut tree = Tree { parts: Vec::new(), gravity: [0.0, 1.0, -9.0].into(), smooth: false };
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

/// Returns two records of the largest error: for sums, and for results that contain M⁻¹.
fn sums_and_inverses() -> [Worst; 2] {
    [Worst::new("sums", TOLERANCE), Worst::new("inverses", TOLERANCE_ABA)]
}

fn compare(model: &Model, worst: &mut [Worst; 2], seed: u64) {
    let serial = model.clone().with_limbs(false);
    let (mut data, mut one) = (Data::new(model), Data::new(&serial));
    let (m, mut rng) = (model, rng(seed));
    for _ in 0..3 {
        let state = State::random(model, &mut rng);
        let State { q, v, a, tau, f_ext, .. } = state.clone();
        for f_ext in [&f_ext[..], &[]] {
            let expected = rnea(&serial, &mut one, &q, &v, &a, f_ext).to_vec();
            worst[0].see(m, rnea(m, &mut data, &q, &v, &a, f_ext), &expected);
            if model.singular_joints().is_empty() {
                let expected = aba(&serial, &mut one, &q, &v, &tau, f_ext).to_vec();
                worst[1].see(m, aba(m, &mut data, &q, &v, &tau, f_ext), &expected);
            }
        }
        let expected = nonlinear_effects(&serial, &mut one, &q, &v).to_vec();
        worst[0].see(m, nonlinear_effects(m, &mut data, &q, &v), &expected);
        let expected = crba(&serial, &mut one, &q);
        let found = crba(m, &mut data, &q);
        assert_eq!(found, &found.transpose());
        worst[0].see(m, found.as_slice(), expected.as_slice());
        for f_ext in [&f_ext[..], &[]] {
            let expected = rnea_derivatives(&serial, &mut one, &q, &v, &a, f_ext);
            let found = rnea_derivatives(m, &mut data, &q, &v, &a, f_ext);
            worst[0].see(m, found.dtau_dq.as_slice(), expected.dtau_dq.as_slice());
            worst[0].see(m, found.dtau_dv.as_slice(), expected.dtau_dv.as_slice());
            worst[0].see(m, found.dtau_da.as_slice(), expected.dtau_da.as_slice());
            for input in inputs(m) {
                let mut dtau = [(); 2].map(|()| DMatrix::zeros(m.nv(), input.len(m)));
                expected.with_respect_to(input, &mut dtau[0]);
                found.with_respect_to(input, &mut dtau[1]);
                worst[0].see(m, dtau[1].as_slice(), dtau[0].as_slice());
            }
        }
        if model.singular_joints().is_empty() {
            compare_inverses(model, &serial, [&mut data, &mut one], worst, &state);
        }
    }
}

/// Returns the inputs with derivatives that use the results of an earlier pass.
fn inputs(model: &Model) -> impl Iterator<Item = Input> {
    let last = model.bodies().len() - 1;
    [
        Input::Force(1),
        Input::Force(last),
        Input::Inertia(1),
        Input::Inertia(last),
        Input::Gravity,
        Input::Armature,
        Input::Damping,
    ]
    .into_iter()
}

fn compare_inverses(
    m: &Model,
    serial: &Model,
    [data, one]: [&mut Data<f64>; 2],
    worst: &mut [Worst; 2],
    state: &State,
) {
    let State { q, v, tau, f_ext, .. } = state;
    let expected = minv(serial, one, q);
    let found = minv(m, data, q);
    assert_eq!(found, &found.transpose());
    worst[1].see(m, found.as_slice(), expected.as_slice());
    for f_ext in [&f_ext[..], &[]] {
        let expected = aba_derivatives(serial, one, q, v, tau, f_ext);
        let found = aba_derivatives(m, data, q, v, tau, f_ext);
        worst[1].see(m, found.a, expected.a);
        worst[1].see(m, found.da_dq.as_slice(), expected.da_dq.as_slice());
        worst[1].see(m, found.da_dv.as_slice(), expected.da_dv.as_slice());
        worst[1].see(m, found.da_dtau.as_slice(), expected.da_dtau.as_slice());
        for input in inputs(m) {
            let mut da = [(); 2].map(|()| DMatrix::zeros(m.nv(), input.len(m)));
            expected.with_respect_to(input, &mut da[0]);
            found.with_respect_to(input, &mut da[1]);
            worst[1].see(m, da[1].as_slice(), da[0].as_slice());
        }
    }
}

#[test]
fn the_numbers_of_body_after_body() {
    let _level = best_level();
    let mut worst = sums_and_inverses();
    let axis = [0.0, 0.6, 0.8].into();
    for seed in 0..24 {
        let roots = [Joint::FreeFlyer, Joint::Revolute { axis }, Joint::Planar];
        compare(&many_limbs(seed, roots[seed as usize % 3]), &mut worst, seed);
    }
    for (seed, model) in all_models(12).iter().enumerate() {
        compare(model, &mut worst, seed as u64);
    }
}

/// Compares the q̈, λ and J of limbs in lanes with the values computed body by body. The residuals must agree up to
/// rounding.
fn compare_constrained(
    m: &Model,
    constraints: &[ContactConstraint],
    proximal: ProximalSettings,
    worst: &mut [Worst; 2],
    s: &State,
) {
    let serial = m.clone().with_limbs(false);
    let (mut data, mut one) = (Data::new(m), Data::new(&serial));
    let [mut set, mut other] = [m, &serial].map(|m| ConstraintSet::new(m, constraints).expect("they are right"));
    (set.proximal, other.proximal) = (proximal, proximal);
    for f_ext in [&s.f_ext[..], &[]] {
        let expected = constrained_dynamics(&serial, &mut one, &mut other, &s.q, &s.v, &s.tau, f_ext);
        let found = constrained_dynamics(m, &mut data, &mut set, &s.q, &s.v, &s.tau, f_ext);
        worst[1].see(m, found.a, expected.a);
        worst[1].see(m, found.lambda, expected.lambda);
        worst[1].see(m, &[found.residual], &[expected.residual]);
        assert_eq!(found.redundant, expected.redundant);
        let [mut J, mut K] = [(); 2].map(|()| DMatrix::from_element(set.rows(), m.nv(), f64::NAN));
        set.jacobian(&mut J);
        other.jacobian(&mut K);
        worst[0].see(m, J.as_slice(), K.as_slice());
    }
}

/// Checks constrained dynamics against a computation body by body. The constraints are between all kinds of bodies,
/// including the base and the world.
#[test]
fn constrained_dynamics_of_body_after_body() {
    let _level = best_level();
    let mut worst = sums_and_inverses();
    let axis = [0.0, 0.6, 0.8].into();
    let roots = [Joint::FreeFlyer, Joint::Revolute { axis }, Joint::Planar];
    let models = (0..24).map(|seed| many_limbs(seed, roots[seed as usize % 3])).chain(all_models(12));
    for (seed, model) in models.enumerate().filter(|(_, model)| model.singular_joints().is_empty()) {
        let mut rng = rng(seed as u64);
        let state = State::random(&model, &mut rng);
        let mut constraints = random_constraints(&model, &state, &mut rng);
        constraints.retain(|c| c.kind.rows() >= 3); // constraints to lines and planes do not support lanes
        for proximal in [ProximalSettings::default(), ProximalSettings { mu: 1e-6, iterations: 3 }] {
            compare_constrained(&model, &constraints, proximal, &mut worst, &state);
        }
    }
}

/// Checks redundant constraints. One sole of the humanoid is constrained twice, so that six rows are redundant. The
/// other sole is constrained at points.
#[test]
fn redundant_constraints_of_body_after_body() {
    let _level = best_level();
    let mut worst = sums_and_inverses();
    let model = robots::humanoid();
    let [left, right] = ["left_sole", "right_sole"].map(|name| model.frame(name).unwrap());
    let body = model.frames()[left].body;
    let again = (0..model.frames().len()).find(|&f| f != left && model.frames()[f].body == body).unwrap();
    let constraints =
        [ContactConstraint::rigid(left), ContactConstraint::point(right), ContactConstraint::rigid(again)];
    let state = State::random(&model, &mut rng(0));
    compare_constrained(&model, &constraints, ProximalSettings::default(), &mut worst, &state);
    compare_constrained(&model, &[], ProximalSettings::default(), &mut worst, &state);
}

/// Checks that a `Data` can also be used with a copy of its robot that has another armature, gravity or inertia.
#[test]
fn of_the_model_that_is_given() {
    let _level = best_level();
    let quadruped = robots::quadruped();
    let mut data = Data::new(&quadruped);
    let State { q, v, a, .. } = State::random(&quadruped, &mut rng(0));
    let heavier = |_, I: Inertia<f64>| I.scale(2.0);
    for other in [
        quadruped.clone().with_armature(&[0.3; 18]).unwrap(),
        quadruped.clone().with_gravity([1.0, 2.0, 3.0].into()).unwrap(),
        quadruped.with_inertias(heavier).unwrap(),
    ] {
        let found = rnea(&other, &mut data, &q, &v, &a, &[]).to_vec();
        let M = crba(&other, &mut data, &q).clone();
        let Minv = minv(&other, &mut data, &q).clone();
        let serial = other.with_limbs(false);
        assert!(relative(&found, rnea(&serial, &mut data, &q, &v, &a, &[])) < TOLERANCE);
        assert!(relative(M.as_slice(), crba(&serial, &mut data, &q).as_slice()) < TOLERANCE);
        assert!(relative(Minv.as_slice(), minv(&serial, &mut data, &q).as_slice()) < TOLERANCE_ABA);
    }
}

/// Checks that a clone of a `Data` computes the same bits, with and without forces, if the original was never used with
/// forces.
#[test]
fn with_cloned_data() {
    let _level = best_level();
    let quadruped = robots::quadruped();
    let State { q, v, a, f_ext, .. } = State::random(&quadruped, &mut rng(0));
    let mut data = Data::new(&quadruped);
    let mut clone = data.clone();
    for f_ext in [&f_ext[..], &[]] {
        let expected = rnea(&quadruped, &mut data, &q, &v, &a, f_ext);
        assert_eq!(rnea(&quadruped, &mut clone, &q, &v, &a, f_ext), expected);
        let expected = aba_derivatives(&quadruped, &mut data, &q, &v, &a, f_ext);
        let found = aba_derivatives(&quadruped, &mut clone, &q, &v, &a, f_ext);
        assert_eq!((found.da_dq, found.da_dv, found.da_dtau), (expected.da_dq, expected.da_dv, expected.da_dtau));
    }
}

/// Checks that a NaN in one limb affects only the results of this limb and of the base.
#[test]
fn what_is_not_a_number_stays_in_its_limb() {
    let _level = best_level();
    let model = robots::quadruped();
    let State { q, mut v, a, .. } = State::random(&model, &mut rng(0));
    v[7] = f64::NAN; // second joint of the first leg
    let mut data = Data::new(&model);
    let tau = rnea(&model, &mut data, &q, &v, &a, &[]);
    assert!(tau[6..9].iter().all(|x| x.is_nan()) && tau[9..].iter().all(|x| x.is_finite()), "{tau:?}");
}

#[test]
fn a_robot_of_loose_bodies() {
    let _level = best_level();
    let mut builder = ModelBuilder::new("loose");
    for k in 0..7 {
        let joint = if k % 2 == 0 { Joint::Translation } else { Joint::FreeFlyer };
        let inertia = Inertia::from_com(1.0, [0.1, 0.0, 0.0].into(), Sym3::diagonal(0.1));
        builder.body(&format!("body{k}"), WORLD, joint, Se3::identity(), inertia);
    }
    let mut worst = sums_and_inverses();
    compare(&builder.build().expect("it is well-formed"), &mut worst, 0);
}

/// Checks hands whose fingers have different lengths. Then some steps do not have a body in each lane, and the order of
/// the steps differs from the order of the bodies.
#[test]
fn fingers_of_all_lengths() {
    let _level = best_level();
    let mut worst = sums_and_inverses();
    for (seed, lengths) in [&[1, 3, 2, 4, 1][..], &[2, 1, 5], &[1, 1, 4, 4, 4, 4, 2]].into_iter().enumerate() {
        let mut rng = rng(seed as u64);
        let mut tree = Tree { parts: Vec::new(), gravity: [0.0, 1.0, -9.0].into(), smooth: false };
        for &length in lengths {
            let mut last = 0;
            for _ in 0..length {
                last = tree.add(&mut rng, last, Joint::Revolute { axis: [0.0, 0.6, 0.8].into() });
            }
        }
        compare(&tree.build(), &mut worst, seed as u64);
    }
}

/// Checks the placements that each algorithm leaves in a `Data`. They must be the placements at the position of the
/// last call. An algorithm that computes no placements leaves none.
#[test]
fn calls_leave_their_placements() {
    let _level = best_level();
    let mut worst = Worst::new("placements left behind", TOLERANCE);
    let models = all_models(10).into_iter().chain((0..8).map(|seed| many_limbs(seed, Joint::FreeFlyer)));
    for (seed, model) in models.enumerate().filter(|(_, model)| model.singular_joints().is_empty()) {
        let (mut rng, nv, m) = (rng(seed as u64), model.nv(), &model);
        let (mut data, mut own) = (Data::new(m), Data::new(m));
        assert!(data.placements(m).is_none(), "{}: nothing was computed yet", m.name());
        let mut set = ConstraintSet::new(m, &random_constraints(m, &State::random(m, &mut rng), &mut rng)).unwrap();
        set.proximal = ProximalSettings { mu: 1e-6, ..ProximalSettings::default() };
        for call in 0..4 {
            let State { q, v, tau, .. } = State::random(m, &mut rng);
            match call {
                0 => _ = aba(m, &mut data, &q, &v, &tau, &[]),
                1 => _ = constrained_dynamics(m, &mut data, &mut set, &q, &v, &tau, &[]),
                2 => _ = aba_derivatives(m, &mut data, &q, &v, &tau, &[]),
                _ => _ = crba(m, &mut data, &q),
            }
            let (left, expected) = (data.placements(m).unwrap(), forward_kinematics(m, &mut own, &q));
            let (mut J, mut J_expected) = (DMatrix::zeros(6, nv), DMatrix::zeros(6, nv));
            for frame in 0..m.frames().len() {
                let (found, pose) = (left.frame(frame), expected.frame(frame));
                worst.see(m, &found.translation.to_array(), &pose.translation.to_array());
                let [R, R_expected] = [found, pose].map(|X| X.rotation.columns().map(Vec3::to_array).concat());
                worst.see(m, &R, &R_expected);
                left.frame_jacobian(frame, ReferenceFrame::Local, &mut J);
                expected.frame_jacobian(frame, ReferenceFrame::Local, &mut J_expected);
                worst.see(m, J.as_slice(), J_expected.as_slice());
            }
            rnea(m, &mut data, &q, &v, &tau, &[]);
            assert!(data.placements(m).is_none(), "{}: rnea places no bodies", m.name());
        }
    }
}

/// Checks that placements stored in lanes are rejected for a robot whose base has another placement.
#[test]
fn placements_of_limbs_know_their_robot() {
    let _level = best_level();
    let quadruped = robots::quadruped();
    let mut builder = ModelBuilder::new("raised");
    builder.append(WORLD, Se3 { translation: Vec3::new(0.0, 0.0, 1.0), ..Se3::identity() }, &quadruped, "");
    let raised = builder.build().unwrap();
    assert_eq!(raised.tree_hash(), quadruped.tree_hash());
    let (mut data, q, o) = (Data::<f64>::new(&quadruped), neutral(&quadruped), [0.0; 18]);
    aba(&quadruped, &mut data, &q, &o, &o, &[]);
    assert_panic("tests/vectors/limbs.rs", "another robot than `raised`", || _ = data.placements(&raised));
    assert!(data.placements(&quadruped).is_some());
    // Placements stored in lanes are accepted for the same robot with other inertias.
    aba(&quadruped, &mut data, &q, &o, &o, &[]);
    assert!(data.placements(&quadruped.with_inertias(|_, I| I.scale(2.0)).unwrap()).is_some());
}
