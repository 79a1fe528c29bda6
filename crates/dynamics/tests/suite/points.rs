//! Tests of points on bodies and frames. The results are compared with frames at these points, and with derivatives by
//! dual numbers.

use crate::common::{State, all_models, dual, eps, lift, moved, normal3, relative, rng};
use condyle_dynamics::{
    Act, ConstraintSet, ContactConstraint, Data, Force, FrameKind, FrameParent, Model, ReferenceFrame, Se3, Vec3, aba,
    constrained_dynamics, forward_kinematics, forward_velocities, robots,
};
use nalgebra::{DMatrix, DVector, Vector3};

/// Tolerance of sums over the bodies of a robot, relative to the largest number.
const ROUNDING: f64 = 1e-12;

fn flat(v: Vec3<f64>) -> [f64; 3] {
    v.to_array()
}

/// Checks the Jacobian and the velocity of a point. They must equal the linear rows of the Jacobian, and the linear
/// velocity, of a frame at this point. The test uses every body of each robot.
#[test]
fn points_are_frames_put_there() {
    for (seed, model) in all_models(4).iter().enumerate() {
        let mut random = rng(seed as u64);
        let State { q, v, .. } = State::random(model, &mut random);
        for body in 0..model.bodies().len() {
            let point = normal3(&mut random);
            let at = Se3 { translation: point, ..Se3::identity() };
            let with = model.with_frame("point", FrameParent::Body(body), at).unwrap();
            let frame = with.frame("point").unwrap();
            let mut data = Data::new(model); // both models have the same tree
            let motion = forward_velocities(&with, &mut data, &q, &v);
            let axes = ReferenceFrame::LocalWorldAligned;
            let [mut J, mut here, mut there] = [3, 6, 3].map(|rows| DMatrix::zeros(rows, model.nv()));
            motion.body_point_jacobian(body, point, &mut J);
            motion.frame_jacobian(frame, axes, &mut here);
            motion.frame_point_jacobian(frame, Vec3::zero(), &mut there);
            assert!(relative(J.as_slice(), here.rows(0, 3).into_owned().as_slice()) < ROUNDING);
            assert!(relative(J.as_slice(), there.as_slice()) < ROUNDING);
            let velocity = motion.body_point_velocity(body, point);
            let expected = motion.frame_velocity(frame, axes).linear;
            assert!(relative(&flat(velocity), &flat(expected)) < ROUNDING);
            let by_jacobian = &J * DVector::from_row_slice(&v);
            assert!((by_jacobian - Vector3::from(velocity)).amax() < ROUNDING * (1.0 + expected.norm()));
        }
    }
}

/// Checks that J δ is the derivative of the point's position along δ.
#[test]
fn jacobians_are_derivatives() {
    for (seed, model) in all_models(4).iter().enumerate() {
        let mut random = rng(seed as u64);
        let State { q, v: delta, .. } = State::random(model, &mut random);
        let q_dual = moved(model, &lift(&q), &dual(&vec![0.0; model.nv()], &delta));
        let (mut data, mut duals) = (Data::new(model), Data::new(model));
        let mut J = DMatrix::zeros(3, model.nv());
        for frame in 0..model.frames().len() {
            let point = normal3(&mut random);
            forward_kinematics(model, &mut data, &q).frame_point_jacobian(frame, point, &mut J);
            let place = forward_kinematics(model, &mut duals, &q_dual).frame(frame).act(point.lift());
            let expected = eps(&place.to_array());
            let found = &J * DVector::from_row_slice(&delta);
            assert!(relative(found.as_slice(), &expected) < 1e-10, "{found} {expected:?}");
        }
    }
}

/// Checks that a force f at a point, along the world's axes, accelerates the robot by M⁻¹ Jᵀ f.
#[test]
fn forces_at_points() {
    for (seed, model) in all_models(2).iter().enumerate() {
        if !model.singular_joints().is_empty() {
            continue;
        }
        let mut random = rng(seed as u64);
        let State { q, v, tau, .. } = State::random(model, &mut random);
        let body = model.bodies().len() - 1;
        let (point, force) = (normal3(&mut random), normal3(&mut random));
        let mut data = Data::new(model);
        let mut J = DMatrix::zeros(3, model.nv());
        let placements = forward_kinematics(model, &mut data, &q);
        placements.body_point_jacobian(body, point, &mut J);
        let mut f_ext = vec![Force::zero(); model.bodies().len()];
        f_ext[body] = placements.force_on_body(body, placements.body(body).act(point), force);
        let efforts = J.transpose() * Vector3::from(force) + DVector::from_row_slice(&tau);
        let expected = aba(model, &mut data, &q, &v, efforts.as_slice(), &[]).to_vec();
        let found = aba(model, &mut data, &q, &v, &tau, &f_ext);
        assert!(relative(found, &expected) < 1e-8, "{found:?} {expected:?}");
    }
}

/// Checks that constraints can use a frame that was added to a robot. A constraint set made before this addition must
/// be rejected for the robot with the new frame.
#[test]
fn frames_can_be_added() {
    let arm = robots::arm7();
    let at = Se3 { translation: Vec3::new(0.0, 0.05, 0.1), ..Se3::identity() };
    let with = arm.with_frame("tip", "tool", at).unwrap();
    assert_ne!(with.geometry_hash(), arm.geometry_hash());
    assert_eq!(with.tree_hash(), arm.tree_hash());
    assert_eq!(with.frames().len(), arm.frames().len() + 1);
    assert_eq!(with.frames().last().unwrap().kind, FrameKind::User);
    let tip = with.frame("tip").unwrap();
    let mut held = ConstraintSet::new(&with, &[ContactConstraint::point(tip)]).unwrap();
    let mut data = Data::new(&with);
    let result = constrained_dynamics(&with, &mut data, &mut held, &[0.3; 7], &[0.0; 7], &[0.0; 7], &[]);
    assert!(result.residual < 1e-9);
    let acceleration = result.a.to_vec();
    let motion = condyle_dynamics::forward_accelerations(&with, &mut data, &[0.3; 7], &[0.0; 7], &acceleration);
    let still = motion.frame_classical_acceleration(tip, ReferenceFrame::LocalWorldAligned);
    assert!(still.linear.norm() < 1e-8, "{still:?}");
    // A constraint set made for the same tree with other frames is rejected.
    let old = std::panic::catch_unwind(|| {
        let mut set = ConstraintSet::new(&arm, &[ContactConstraint::point(arm.frame("tool").unwrap())]).unwrap();
        let _ = constrained_dynamics(&with, &mut Data::new(&with), &mut set, &[0.3; 7], &[0.0; 7], &[0.0; 7], &[]);
    });
    assert!(old.is_err(), "a plan of another geometry is refused");
}

#[test]
fn frames_that_cannot_be() {
    let arm = robots::arm7();
    let said = |name: &str, parent: FrameParent<'_>, placement: Se3<f64>| {
        arm.with_frame(name, parent, placement).unwrap_err().to_string()
    };
    let here = Se3::identity();
    assert_eq!(said("tip", FrameParent::Body(8), here), "frame `tip`: there is no body 8: the model has 8");
    let frames = arm.frames().len();
    let expected = format!("frame `tip`: there is no frame 99: the model has {frames}");
    assert_eq!(said("tip", FrameParent::Frame(99), here), expected);
    assert_eq!(said("tip", "tol".into(), here), "unknown frame `tol`; nearest is `tool`");
    let mut sheared = here;
    sheared.rotation.x.y = 0.1;
    assert_eq!(said("tip", "tool".into(), sheared), "frame `tip`: placement is no rotation and translation");
    let mut infinite = here;
    infinite.translation.z = f64::INFINITY;
    assert_eq!(said("tip", "tool".into(), infinite), "frame `tip`: placement is not finite");
    let twice = arm.with_frame("tip", FrameParent::Body(0), here).unwrap().with_frame("tip", "tool", here);
    assert_eq!(twice.unwrap_err().to_string(), "two frames are named `tip`");
    assert_eq!(said("tool", "tool".into(), here), "two frames are named `tool`"); // name of a frame of the robot
    assert_eq!(said("", "tool".into(), here), "frame ``: a frame without a name cannot be found");
}

/// Checks that a model equals its clone, and the model read from its file. A model in which one number differs must not
/// be equal.
#[test]
fn models_are_compared() {
    for model in all_models(2) {
        let text = serde_json::to_string(&model).unwrap();
        let back: Model = serde_json::from_str(&text).unwrap();
        assert_eq!(model, model.clone());
        assert_eq!(back, model);
        assert_eq!(back.clone().with_limbs(false), back);
        let frame = model.with_frame("one more", FrameParent::Body(0), Se3::identity()).unwrap();
        assert_ne!(frame, model);
        let heavier = model.with_inertias(|_, I| I.scale(1.5)).unwrap();
        assert!(heavier != model || model.nv() == 0);
        assert_ne!(model.clone().with_gravity(Vec3::zero()).unwrap(), model);
    }
}
