//! Tests states in which all joints are beyond a limit, and the held feet prevent their return. The program of each
//! state must have a solution.
#![allow(non_snake_case)]

mod common;

use common::*;
use condyle_dynamics::{Model, robots};
use condyle_wholebody::{Backend, FrictionContact, JointLimits, Settings, Status, Task, WholeBodyController};

/// Tolerance of accelerations, relative to the greatest acceleration. The objectives of two solutions agree to 1e-9.
/// Accelerations then agree to about the square root of 1e-9, times the ratio of the weights of limits and forces.
const APART: f64 = 5e-3;
const STATES: u64 = 96;

/// Compares the commands of both back ends in many states: at rest in the stance, near the stance, and far from the
/// stance with high velocities. The joints are slightly or far beyond their limits.
fn both_solve(model: &Model, contacts: &[FrictionContact], tasks: &[Task], stance: &[f64]) {
    let mut relaxed = 0;
    for seed in 0..STATES {
        let (distance, speed) = [(0.0, 0.0), (0.02, 0.1), (0.2, 1.0), (0.5, 5.0)][seed as usize % 4];
        let beyond = [0.01, 0.2, 0.6][seed as usize / 4 % 3];
        let (q, v) = near(model, stance, seed, distance, speed);
        let from = if seed % 2 == 0 { &q } else { stance };
        let mut upper = model.limits().upper.clone();
        (7..model.nq()).for_each(|i| upper[i] = from[i] - beyond);
        let commands = [Backend::InteriorPoint, Backend::Clarabel].map(|backend| {
            let limits = JointLimits { upper: Some(upper.clone()), ..JointLimits::default() };
            let settings = Settings { backend, joint_limits: Some(limits), ..Settings::default() };
            let mut controller = WholeBodyController::new(model, contacts, tasks, settings).unwrap();
            let references = controller.hold(stance).unwrap();
            controller.step(&q, &v, &references).clone()
        });
        let [ours, theirs] = &commands;
        assert_eq!(ours.status, Status::Solved, "state {seed}");
        relaxed += u32::from(ours.limits_relaxed);
        if theirs.status == Status::Solved && !theirs.reduced_accuracy {
            assert_eq!(ours.limits_relaxed, theirs.limits_relaxed, "state {seed}");
            let size = 1.0 + max_abs(theirs.a.iter().copied());
            let apart = max_abs(ours.a.iter().zip(&theirs.a).map(|(a, b)| a - b)) / size;
            assert!(apart < APART, "state {seed}: {apart:e}");
        }
    }
    assert!(relaxed > STATES as u32 / 2, "limits gave way in {relaxed} states only");
}

#[test]
fn a_quadruped_beyond_its_limits() {
    both_solve(&robots::quadruped(), &feet(0.7), &tasks(), &stance());
}

#[test]
fn a_humanoid_beyond_its_limits() {
    let model = robots::humanoid();
    both_solve(&model, &soles(0.7), &humanoid_tasks(), &squat(&model));
}
