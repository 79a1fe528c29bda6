//! Searches find postures for targets that some posture within the limits reaches, and say what holds back others.
#![allow(non_snake_case)] // names follow the literature

use condyle_dynamics::{
    Data, Model, Quaternion, Se3, Vec3, distance, forward_kinematics, lie, neutral, random_configuration, robots,
};
use condyle_ik::{GlobalIk, Outcome, Posture, Rank, SearchSettings};
use rand::SeedableRng;
use rand::rngs::StdRng;

/// Returns the poses of frames at random configurations, one target after the other.
fn targets(model: &Model, frames: &[&str], count: usize, seed: u64) -> Vec<Se3<f64>> {
    let (mut rng, mut data) = (StdRng::seed_from_u64(seed), Data::new(model));
    let frames: Vec<usize> = frames.iter().map(|name| model.frame(name).unwrap()).collect();
    let mut targets = Vec::new();
    for _ in 0..count {
        let placements = forward_kinematics(model, &mut data, &random_configuration(model, &mut rng));
        targets.extend(frames.iter().map(|&frame| placements.frame(frame)));
    }
    targets
}

/// Checks an answer against forward kinematics and the limits of the model.
fn check(model: &Model, frames: &[&str], targets: &[Se3<f64>], answer: &Posture) {
    let mut data = Data::new(model);
    model.check_position(&answer.q).unwrap();
    let placements = forward_kinematics(model, &mut data, &answer.q);
    let mut most = [0.0_f64; 2];
    for (name, oXt) in frames.iter().zip(targets) {
        let fXt = placements.frame(model.frame(name).unwrap()).inverse() * *oXt;
        most[0] = most[0].max(fXt.translation.norm_squared().sqrt());
        most[1] = most[1].max(lie::log3(Quaternion::from_rotation(fXt.rotation)).norm_squared().sqrt());
    }
    for k in 0..2 {
        assert!((most[k] - answer.error[k]).abs() < 1e-9, "{most:?}, reported {:?}", answer.error);
    }
    for body in model.bodies()[1..].iter().filter(|body| body.joint.nq() == body.joint.nv()) {
        for i in body.idx_q..body.idx_q + body.joint.nq() {
            let (lower, upper) = (model.limits().lower[i], model.limits().upper[i]);
            assert!(lower <= answer.q[i] && answer.q[i] <= upper, "{}: {}", body.joint_name, answer.q[i]);
        }
    }
}

#[test]
fn reachable_targets_are_reached() {
    for (model, frames, count) in [
        (robots::arm7(), vec!["tool"], 300),
        (robots::humanoid(), vec!["left_hand", "right_hand", "left_foot", "right_foot"], 40),
        (robots::quadruped(), vec!["LF_foot"], 40),
    ] {
        let ik = GlobalIk::new(&model, &frames, SearchSettings::default()).unwrap();
        let targets = targets(&model, &frames, count, 1);
        let answers = ik.solve_many(&targets, &neutral(&model)).unwrap();
        let mut reached = 0;
        for (answer, targets) in answers.iter().zip(targets.chunks_exact(frames.len())) {
            check(&model, &frames, targets, answer);
            reached += usize::from(answer.reached());
            if answer.reached() {
                assert!(answer.error[0] <= 1e-4 && answer.error[1] <= 1e-3, "{:?}", answer.error);
            }
        }
        assert!(100 * reached >= 99 * count, "{frames:?}: {reached} of {count}");
    }
}

/// The answer for a target depends neither on the other targets nor on the number of threads.
#[test]
fn answers_are_reproducible() {
    let model = robots::arm7();
    let settings = || SearchSettings { solutions: 3, rank: Rank::Nearest, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings()).unwrap();
    let targets = targets(&model, &["tool"], 37, 2);
    let together = ik.solve_many(&targets, &[0.0; 7]).unwrap();
    let divided = GlobalIk::new(&model, &["tool"], SearchSettings { threads: 3, ..settings() }).unwrap();
    assert_eq!(together, divided.solve_many(&targets, &[0.0; 7]).unwrap());
    for (target, answer) in targets.iter().zip(&together) {
        assert_eq!(*answer, ik.solve(&[*target], &[0.0; 7]).unwrap());
    }
}

#[test]
fn ranks_choose_among_the_postures() {
    let model = robots::arm7();
    let targets = targets(&model, &["tool"], 30, 3);
    let posture = [0.3; 7];
    let solve = |rank, solutions| {
        let settings = SearchSettings { rank, solutions, ..SearchSettings::default() };
        GlobalIk::new(&model, &["tool"], settings).unwrap().solve_many(&targets, &posture).unwrap()
    };
    let frame = model.frame("tool").unwrap();
    let manipulability = |q: &[f64]| {
        let mut J = nalgebra::DMatrix::zeros(6, 7);
        condyle_dynamics::frame_jacobian(&model, q, frame, condyle_dynamics::ReferenceFrame::World, &mut J);
        (&J * J.transpose()).determinant().sqrt()
    };
    let far = |q: &[f64]| distance(&model, &posture, q, &mut [0.0; 7]);
    let (first, near, able) = (solve(Rank::First, 1), solve(Rank::Nearest, 8), solve(Rank::Manipulability, 8));
    let (mut nearer, mut abler) = (0, 0);
    for ((first, near), able) in first.iter().zip(&near).zip(&able) {
        assert!(first.reached() && near.reached() && able.reached());
        assert!(far(&near.q) <= far(&first.q) + 1e-12);
        assert!(manipulability(&able.q) >= manipulability(&first.q) - 1e-12);
        nearer += usize::from(far(&near.q) < far(&first.q) - 1e-3);
        abler += usize::from(manipulability(&able.q) > manipulability(&first.q) + 1e-6);
    }
    assert!(nearer > 10 && abler > 10, "{nearer} {abler}");
}

#[test]
fn without_weight_rotations_do_not_count() {
    let model = robots::arm7();
    let settings = SearchSettings { orientation_weight: 0.0, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings).unwrap();
    for target in targets(&model, &["tool"], 20, 4) {
        let answer = ik.solve(&[target], &[0.1; 7]).unwrap();
        assert!(answer.reached() && answer.error[0] <= 1e-4);
        check(&model, &["tool"], &[target], &answer);
    }
}

#[test]
fn what_holds_a_posture_back_is_named() {
    let model = robots::arm7();
    let frame = model.frame("tool").unwrap();
    let mut bent = vec![0.4; 7];
    bent[3] = 1.5;
    let target = forward_kinematics(&model, &mut Data::new(&model), &bent).frame(frame);
    // The same target, but the fourth joint may bend only to 0.2.
    let (mut lower, mut upper) = (vec![-0.5; 7], vec![0.5; 7]);
    (lower[3], upper[3]) = (-0.2, 0.2);
    let settings =
        SearchSettings { lower: Some(lower.clone()), upper: Some(upper), starts: 30, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings).unwrap();
    let answer = ik.solve(&[target], &[0.0; 7]).unwrap();
    let Outcome::Unreached { held } = &answer.outcome else { panic!("reached within {:?}", answer.error) };
    let names: Vec<String> = held.iter().map(|&held| ik.describe(held)).collect();
    let expected = format!("upper limit of joint `{}`", model.bodies()[4].joint_name);
    assert!(names.contains(&expected), "{names:?}");
    check(&model, &["tool"], &[target], &answer);
    assert!(answer.error[0] > 1e-2 || answer.error[1] > 1e-2, "{:?}", answer.error);
    assert_eq!(answer.starts, 30);
    // Far out of reach: the answer is as near as the arm is long.
    let far = Se3 { translation: Vec3::new(5.0, 0.0, 0.0), ..target };
    let settings = SearchSettings { starts: 20, iterations: 100, orientation_weight: 0.0, ..SearchSettings::default() };
    let ik = GlobalIk::new(&model, &["tool"], settings).unwrap();
    let answer = ik.solve(&[far], &[0.1; 7]).unwrap();
    assert!(!answer.reached() && answer.error[0] > 3.0 && answer.error[0] < 4.6, "{:?}", answer.error);
}
