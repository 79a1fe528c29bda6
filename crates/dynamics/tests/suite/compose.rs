//! Tests of models that are composed of other models, and of interpolation between positions.

use crate::common;

use common::{State, all_models, embedded, relative, rng};
use condyle_dynamics::{
    Data, IntegrateArgument, Joint, Mimic, ModelBuilder, Se3, Vec3, WORLD, crba, difference, distance,
    forward_kinematics, integrate_jacobian, interpolate, nonlinear_effects, normalize, robots, transport,
};
use nalgebra::DMatrix;

/// Tolerance between two computations of some hundred operations each, on numbers of order one.
const ROUNDING: f64 = 1e-12;

#[test]
fn a_locked_joint_takes_its_row_and_column_out_of_the_dynamics() {
    for model in embedded() {
        let state = State::random(&model, &mut rng(1));
        let locked: Vec<usize> = (1..model.bodies().len()).filter(|i| i % 3 == 2).collect();
        let stiff = model.lock(&locked, &state.q).unwrap();
        let kept: Vec<usize> = (1..model.bodies().len()).filter(|i| !locked.contains(i)).collect();
        let of = |i: &usize| (model.bodies()[*i].idx_v, model.bodies()[*i].idx_q, model.bodies()[*i].joint);
        let iv: Vec<usize> = kept.iter().map(of).flat_map(|(v, _, j)| v..v + j.nv()).collect();
        let iq: Vec<usize> = kept.iter().map(of).flat_map(|(_, q, j)| q..q + j.nq()).collect();
        let q: Vec<f64> = iq.iter().map(|&k| state.q[k]).collect();
        let mut v = vec![0.0; model.nv()];
        iv.iter().for_each(|&k| v[k] = state.v[k]);
        let v_stiff: Vec<f64> = iv.iter().map(|&k| v[k]).collect();

        let (mut data, mut stiff_data) = (Data::new(&model), Data::new(&stiff));
        let M = crba(&model, &mut data, &state.q).select_rows(&iv).select_columns(&iv);
        assert!(relative(crba(&stiff, &mut stiff_data, &q).as_slice(), M.as_slice()) < ROUNDING, "{}", model.name());
        let h = nonlinear_effects(&model, &mut data, &state.q, &v);
        let h: Vec<f64> = iv.iter().map(|&k| h[k]).collect();
        assert!(relative(nonlinear_effects(&stiff, &mut stiff_data, &q, &v_stiff), &h) < ROUNDING);

        let (there, here) =
            (forward_kinematics(&model, &mut data, &state.q), forward_kinematics(&stiff, &mut stiff_data, &q));
        for (i, frame) in model.frames().iter().enumerate() {
            let same = here.frame(stiff.frame(&frame.name).unwrap());
            assert!(relative(&common::flat(same), &common::flat(there.frame(i))) < ROUNDING, "{}", frame.name);
        }
    }
}

#[test]
fn a_joint_that_follows_a_locked_one_is_locked_with_it() {
    let axis = Vec3::new(0.0, 1.0, 0.0);
    let mut builder = ModelBuilder::new("pair");
    let I = common::random_inertia(&mut rng(2));
    let leader = builder.body("leader", WORLD, Joint::Revolute { axis }, Se3::identity(), I);
    let follower = builder.body("follower", leader, Joint::Prismatic { axis }, Se3::identity(), I);
    builder.body("free", follower, Joint::Revolute { axis }, Se3::identity(), I);
    builder.mimic(follower, leader, Mimic { ratio: -2.0, offset: 0.5 });
    let model = builder.build().unwrap();
    let stiff = model.lock(&[model.joint("leader").unwrap()], &[0.3, 0.0]).unwrap();
    assert_eq!((stiff.nv(), stiff.bodies().len()), (1, 2));
    let there = forward_kinematics(&model, &mut Data::new(&model), &[0.3, 0.7]).body(3);
    let here = forward_kinematics(&stiff, &mut Data::new(&stiff), &[0.7]).body(1);
    assert!(relative(&common::flat(here), &common::flat(there)) < ROUNDING);
}

#[test]
fn two_appended_robots_do_not_feel_each_other() {
    let arm = robots::arm7();
    let mut builder = ModelBuilder::new("two");
    builder.append(WORLD, common::random_pose(&mut rng(3)), &arm, "a_");
    builder.append(WORLD, common::random_pose(&mut rng(4)), &arm, "b_");
    let two = builder.build().unwrap();
    let state = State::random(&arm, &mut rng(5));
    let M = crba(&two, &mut Data::new(&two), &[&state.q[..], &state.q].concat()).clone();
    let alone = crba(&arm, &mut Data::new(&arm), &state.q).clone();
    for at in [0, 7] {
        assert!(relative(M.view((at, at), (7, 7)).clone_owned().as_slice(), alone.as_slice()) < ROUNDING);
    }
    assert_eq!(M.view((0, 7), (7, 7)).amax(), 0.0);
    assert_eq!(two.limits().upper, [&arm.limits().upper[..], &arm.limits().upper].concat());
}

#[test]
fn a_screw_is_a_slide_that_follows_a_turn() {
    let axis = common::normal3(&mut rng(6));
    let unit = axis.scale(1.0 / axis.norm_squared().sqrt());
    let (placement, I) = (common::random_pose(&mut rng(7)), common::random_inertia(&mut rng(8)));
    let pitch = 0.3;
    let mut builder = ModelBuilder::new("screw");
    builder.body("nut", WORLD, Joint::Helical { axis, pitch }, placement, I);
    let screw = builder.build().unwrap();
    let mut builder = ModelBuilder::new("pair");
    let turn = builder.body(
        "turn",
        WORLD,
        Joint::Revolute { axis },
        placement,
        common::random_inertia(&mut rng(9)).scale(0.0),
    );
    let slide = builder.body("slide", turn, Joint::Prismatic { axis: unit }, Se3::identity(), I);
    builder.mimic(slide, turn, Mimic { ratio: pitch, offset: 0.0 });
    let pair = builder.build().unwrap();
    let (q, v) = ([0.8], [1.7]);
    let M = |m: &condyle_dynamics::Model| crba(m, &mut Data::new(m), &q).clone();
    let h = |m: &condyle_dynamics::Model| nonlinear_effects(m, &mut Data::new(m), &q, &v).to_vec();
    assert!(relative(M(&screw).as_slice(), M(&pair).as_slice()) < ROUNDING);
    assert!(relative(&h(&screw), &h(&pair)) < ROUNDING);
}

#[test]
fn a_universal_joint_is_two_turns() {
    let (x, y) = (Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0));
    let mut builder = ModelBuilder::new("universal");
    let joints = [(Joint::Revolute { axis: x }, Se3::identity()), (Joint::Revolute { axis: y }, Se3::identity())];
    builder.chain("wheel", WORLD, &joints, common::random_inertia(&mut rng(10)));
    let model = builder.build().unwrap();
    let R = forward_kinematics(&model, &mut Data::new(&model), &[0.4, -0.9]).body(2).rotation;
    let expected = common::joint_placement(Joint::Revolute { axis: x }, &[0.4]).rotation
        * common::joint_placement(Joint::Revolute { axis: y }, &[-0.9]).rotation;
    let columns = |R: condyle_dynamics::Mat3<f64>| R.columns().map(Vec3::to_array).concat();
    assert!(relative(&columns(R), &columns(expected)) < ROUNDING);
}

#[test]
fn ways_between_positions() {
    for model in all_models(3) {
        let mut rng = rng(11);
        let (a, b) = (State::random(&model, &mut rng), State::random(&model, &mut rng));
        let (mut d, mut q, mut rest) = (vec![0.0; model.nv()], a.q.clone(), vec![0.0; model.nv()]);
        let whole = distance(&model, &a.q, &b.q, &mut d);
        difference(&model, &a.q, &b.q, &mut rest);
        assert!((whole - rest.iter().map(|x| x * x).sum::<f64>().sqrt()).abs() < ROUNDING * (1.0 + whole));
        interpolate(&model, &a.q, &b.q, 0.3, &mut d, &mut q);
        // The interpolated motion has constant velocity, so the remaining distance is proportional to the remaining
        // time.
        assert!((distance(&model, &q, &b.q, &mut rest) - 0.7 * whole).abs() < 1e-10 * (1.0 + whole));
        let mut long: Vec<f64> = q.clone();
        normalize(&model, &mut long);
        assert!(relative(&long, &q) < ROUNDING);
    }
}

#[test]
fn transport_is_the_inverse_of_the_jacobian_of_integrate() {
    for model in all_models(3) {
        let state = State::random(&model, &mut rng(12));
        let mut J = DMatrix::zeros(model.nv(), model.nv());
        integrate_jacobian(&model, &state.v, IntegrateArgument::Position, &mut J);
        transport(&model, &state.v, &mut J);
        let identity = DMatrix::<f64>::identity(model.nv(), model.nv());
        assert!((J - identity).amax() < ROUNDING * 1e2, "{model}"); // velocities of several units are exponentiated
    }
}
