//! Residuals that do not depend on the heading: the velocity in the heading frame, and the tilt.

use super::*;
use condyle_optimal::robot::Target;
use nalgebra::{Rotation3, Vector3};

fn heading(frame: &str, target: [f64; 6]) -> Residual {
    Residual::HeadingVelocity { frame: frame.into(), target: Motion::from(target) }
}

fn tilt(frame: &str, up: Vec3<f64>) -> Residual {
    Residual::Tilt { frame: frame.into(), up }
}

/// Returns a unit vector that is not vertical.
fn leaning() -> Vec3<f64> {
    Vec3::new(0.48, -0.36, 0.8)
}

/// Returns the entries of a residual, from costs that each contain one entry.
fn entries(model: &Arc<Model>, residual: &Residual, n: usize, x: &[f64]) -> Vec<f64> {
    let squares = (0..n).map(|k| {
        let weights = (0..n).map(|i| if i == k { 2.0 } else { 0.0 }).collect();
        let cost = Cost::new("r", 1.0, residual.clone(), Activation::Weighted(weights));
        FreeDynamics::terminal(model.clone(), vec![cost]).unwrap().calc(0, x, &[], &mut [])
    });
    squares.collect()
}

#[test]
fn derivatives_without_heading_are_those_of_the_action() {
    let mut rng = StdRng::seed_from_u64(17);
    for model in [robots::quadruped(), robots::humanoid()].map(Arc::new) {
        let nu = model.nv() - 6;
        let foot = feet(&model, ReferenceFrame::Local)[0].name.clone();
        let trunk = model.frames().iter().find(|frame| frame.body == 1).unwrap().name.clone();
        let mut costs = Vec::new();
        for (k, frame) in [foot, trunk].iter().enumerate() {
            let weights = magnitudes(6, &mut rng);
            let moves = heading(frame, [0.5, -0.1, 0.2, 0.3, 0.1, -0.4]);
            costs.push(Cost::new(&format!("moves {k}"), 0.4, moves, Activation::Weighted(weights)));
            costs.push(Cost::new(&format!("leans {k}"), 0.7, tilt(frame, leaning()), Activation::Quadratic));
        }
        let action = FreeDynamics::running(model.clone(), DT, costs).unwrap();
        assert_eq!(action.nu(), nu);
        check_derivatives(model.name(), action, &model, 5.0, &mut rng);
    }
}

#[test]
fn the_heading_frame_turns_with_the_heading_alone() {
    let mut rng = StdRng::seed_from_u64(19);
    let model = Arc::new(robots::quadruped());
    let frame = model.frame("RF_foot").unwrap();
    for _ in 0..20 {
        let x = random_state(&model, &mut rng);
        let mut data = Data::new(&model);
        let velocities = forward_velocities(&model, &mut data, &x[..19], &x[19..]);
        let v = velocities.frame_velocity(frame, ReferenceFrame::LocalWorldAligned).to_array();
        let [a, b, c] = velocities.frame(frame).rotation.columns().map(Vec3::to_array);
        // the heading, and the vertical in the frame, by nalgebra
        let back = Rotation3::from_axis_angle(&Vector3::z_axis(), -a[1].atan2(a[0]));
        let (linear, angular) = (back * Vector3::new(v[0], v[1], v[2]), back * Vector3::new(v[3], v[4], v[5]));
        let target = [0.5, -0.1, 0.2, 0.3, 0.1, -0.4];
        let expected = linear.iter().chain(&angular).zip(target).map(|(v, target)| (v - target).powi(2));
        for (found, expected) in entries(&model, &heading("RF_foot", target), 6, &x).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-10 * (1.0 + expected), "{found} {expected}");
        }
        let vertical = Vector3::new(a[2], b[2], c[2]) - Vector3::from(leaning().to_array());
        for (found, r) in entries(&model, &tilt("RF_foot", leaning()), 3, &x).into_iter().zip(&vertical) {
            assert!((found - r * r).abs() < 1e-12, "{found} {}", r * r);
        }
        // a robot that is turned about the vertical has the same residuals
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), 0.8);
        let turned = nalgebra::UnitQuaternion::from_rotation_matrix(&turn)
            * nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(x[6], x[3], x[4], x[5]));
        let place = turn * Vector3::new(x[0], x[1], x[2]);
        let q = [place.as_slice(), turned.as_vector().as_slice(), &x[7..]].concat();
        for (residual, n) in [(heading("RF_foot", target), 6), (tilt("RF_foot", leaning()), 3)] {
            for (a, b) in entries(&model, &residual, n, &x).iter().zip(entries(&model, &residual, n, &q)) {
                assert!((a - b).abs() < 1e-10 * (1.0 + a), "{a} {b}");
            }
        }
    }
}

#[test]
fn a_vertical_axis_has_finite_derivatives() {
    let model = Arc::new(robots::quadruped());
    let mut x = [neutral(&model), vec![0.3; 18]].concat();
    (x[4], x[6]) = (0.5_f64.sqrt(), 0.5_f64.sqrt()); // turned by 90° about y: the x axis points down
    let trunk = model.frames().iter().find(|frame| frame.body == 1).unwrap().name.clone();
    let cost = Cost::new("v", 1.0, heading(&trunk, [0.0; 6]), Activation::Quadratic);
    let mut action = FreeDynamics::running(model, DT, vec![cost]).unwrap();
    let mut knot = LqKnot::zeros(36, 12);
    action.calc_diff(0, &x, &[0.0; 12], &mut knot);
    assert!(knot.q.iter().chain(&knot.Q).all(|x| x.is_finite()));
}

#[test]
fn targets_without_heading_are_checked_and_changed() {
    let model = Arc::new(robots::quadruped());
    let refused = |residual| {
        let cost = Cost::new("c", 1.0, residual, Activation::Quadratic);
        FreeDynamics::running(model.clone(), DT, vec![cost]).map(|_| ()).unwrap_err().to_string()
    };
    let long = refused(tilt("LF_foot", Vec3::new(0.0, 0.0, 2.0)));
    assert_eq!(long, "cost `c`: its desired vertical has the length 2, expected 1");
    assert_eq!(refused(heading("LF_foot", [f64::NAN; 6])), "cost `c`: its target holds a NaN");
    let costs = vec![
        Cost::new("leans", 1.0, tilt("LF_foot", Vec3::new(0.0, 0.0, 1.0)), Activation::Quadratic),
        Cost::new("moves", 1.0, heading("LF_foot", [0.0; 6]), Activation::Quadratic),
    ];
    let knot = FreeDynamics::running(model.clone(), DT, costs.clone()).unwrap();
    let end = FreeDynamics::terminal(model.clone(), costs.clone()).unwrap();
    let x0 = [neutral(&model), vec![0.0; 18]].concat();
    let mut problem = Problem::new(x0, vec![Box::new(knot)], vec![0; 1], Box::new(end)).unwrap();
    assert!(problem.set_references("leans", &[0.6, 0.0, 0.8, 0.0, 0.6, 0.8]).unwrap());
    assert!(problem.set_references("moves", &[1.0; 12]).unwrap());
    let leans = problem.cost_at_mut(1, "leans").unwrap();
    assert_eq!(leans.target(), Some(Target::Position(Vec3::new(0.0, 0.6, 0.8))));
    let text = serde_json::to_string(&costs).unwrap();
    assert!(text.contains("heading_velocity") && text.contains("tilt"));
    assert_eq!(serde_json::from_str::<Vec<Cost>>(&text).unwrap(), costs);
}
