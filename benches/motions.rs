//! Optimal control problems of a motion that several benchmarks solve.

use condyle::optimal::robot::{
    Activation, Actuation, Contact, ContactDynamics, Cost, FreeAcceleration, FreeDynamics, Integrator, Residual,
};
use condyle::optimal::{ActionModel, Problem};
use condyle::{ContactConstraint, Model, Se3, neutral};
use nalgebra::DMatrix;
use std::sync::Arc;

/// Builds the optimal control problem of a robot for a horizon of `knots` knots, with a warm start (states, controls).
/// The robot is a cart with a pole, a quadrotor, an arm of seven joints, a quadruped or a humanoid.
pub fn motion(robot: &Arc<Model>, knots: usize) -> (Problem, Vec<f64>, Vec<f64>) {
    let (feet, bent): (&[&str], &[(&str, f64)]) = match robot.nv() {
        7 => (&[], &[]),
        18 => (
            &["LF_foot", "LH_foot", "RF_foot", "RH_foot"],
            &[("LF_KFE", -1.4), ("LH_KFE", 1.4), ("RF_KFE", -1.4), ("RH_KFE", 1.4)],
        ),
        _ => (&["left_sole", "right_sole"], &[("left_knee", 0.8), ("right_knee", 0.8)]),
    };
    if robot.nv() < 7 { small(robot, knots) } else { bend(robot, feet, bent, knots) }
}

/// Builds the optimal control problem of a motion, with a warm start. A robot bends its joints and then comes to rest.
/// If the robot has feet, the feet stay on the ground.
fn bend(robot: &Arc<Model>, feet: &[&str], bent: &[(&str, f64)], knots: usize) -> (Problem, Vec<f64>, Vec<f64>) {
    let (nv, mut q) = (robot.nv(), neutral(robot));
    for (joint, angle) in bent {
        q[robot.bodies()[robot.joint(joint).expect("one of its joints")].idx_q] = *angle;
    }
    let x0 = [q, vec![0.0; nv]].concat();
    let mut there = x0.clone();
    for (i, x) in there[..robot.nq()].iter_mut().enumerate().skip(if feet.is_empty() { 0 } else { 7 }) {
        *x += 0.1 * (i as f64).sin();
    }
    let rest = Cost::new("rest", 1e1, Residual::State { reference: there }, Activation::Quadratic);
    let nu = if feet.is_empty() { nv } else { nv - 6 };
    let effort = Cost::new("effort", 1e-3, Residual::Control { reference: vec![0.0; nu] }, Activation::Quadratic);
    let tip = robot.frames().last().expect("a robot has frames");
    let reach = Residual::FrameTranslation { frame: tip.into(), target: [0.4, 0.2, 0.5].into() };
    let reach = Cost::new("reach", 1e0, reach, Activation::Quadratic);
    let running = vec![rest.clone(), effort, reach];
    let (action, u): (Box<dyn ActionModel>, _) = if feet.is_empty() {
        let mut action = FreeDynamics::running(robot.clone(), 0.02, running).expect("costs of an arm");
        let u = action.quasi_static(&x0);
        (Box::new(action), u)
    } else {
        let contact = |foot: &&str| {
            let frame = robot.frame(foot).expect("one of its feet");
            let constraint =
                if feet.len() == 4 { ContactConstraint::point(frame) } else { ContactConstraint::rigid(frame) };
            Contact::new(foot, ContactConstraint { kd: 50.0, ..constraint })
        };
        let contacts: Vec<_> = feet.iter().map(contact).collect();
        let mut action = ContactDynamics::running(robot.clone(), &contacts, 0.02, running).expect("costs on feet");
        let u = action.quasi_static(&x0);
        (Box::new(action), u)
    };
    let end = FreeDynamics::terminal(robot.clone(), vec![rest]).expect("a cost of states");
    let problem = Problem::new(x0.clone(), vec![action], vec![0; knots], Box::new(end)).expect("knots of one robot");
    (problem, x0.repeat(knots + 1), u.repeat(knots))
}

/// Time between two knots of a small robot (s).
const DT: f64 = 0.03;

/// Builds the optimal control problem of a body that flies to a pose, or of a cart with a pole that moves to its
/// target. The rotors, and the force on the cart, act through a map.
fn small(robot: &Arc<Model>, knots: usize) -> (Problem, Vec<f64>, Vec<f64>) {
    let (nv, x0) = (robot.nv(), [neutral(robot), vec![0.0; robot.nv()]].concat());
    let drives = match nv {
        2 => DMatrix::from_column_slice(2, 1, &[1.0, 0.0]),
        _ => DMatrix::from_fn(6, 4, |row, k| match row {
            2 => 1.0,                               // thrust
            3 => [0.0, 0.15, 0.0, -0.15][k],        // y f
            4 => [-0.15, 0.0, 0.15, 0.0][k],        // −x f
            5 => [0.015, -0.015, 0.015, -0.015][k], // drag
            _ => 0.0,
        }),
    };
    let drives = Actuation::matrix(robot, drives).expect("a map of this robot");
    let weighted = Activation::Weighted((0..2 * nv).map(|k| if k < 3 { 0.1 } else { 100.0 }).collect());
    let rest = |weight| Cost::new("rest", weight, Residual::State { reference: x0.clone() }, weighted.clone());
    let effort = Residual::Control { reference: vec![0.0; drives.nu()] };
    let effort = Cost::new("effort", 1e-5, effort, Activation::Quadratic);
    let frame = robot.frames().last().expect("a robot has frames");
    let there = |weight| match nv {
        2 => {
            let point = Residual::FrameTranslation { frame: frame.into(), target: [1.0, 0.0, 0.0].into() };
            Cost::new("there", weight, point, Activation::Quadratic)
        }
        _ => {
            let pose = Se3 { translation: [1.0, 0.5, 0.8].into(), ..Se3::identity() };
            let pose = Residual::FramePlacement { frame: frame.into(), target: pose };
            Cost::new("there", weight, pose, Activation::Quadratic)
        }
    };
    let (nu, running) = (drives.nu(), vec![there(1e-2), rest(1e-5), effort]);
    let model = FreeAcceleration::new(robot.clone(), drives, running).expect("costs of this robot");
    let action = FreeDynamics::new(model, Integrator::SemiImplicitEuler, DT).expect("a step forward in time");
    let end = FreeDynamics::terminal(robot.clone(), vec![there(1e2), rest(1e-3)]).expect("costs of this robot");
    let problem = Problem::new(x0.clone(), vec![Box::new(action)], vec![0; knots], Box::new(end));
    (problem.expect("knots of one robot"), x0.repeat(knots + 1), vec![0.0; knots * nu])
}
