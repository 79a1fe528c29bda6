//! Tests of commands at recorded ticks of stands, walks and trots under pushes. Each command must be the optimum, and
//! the back ends must agree.
#![allow(non_snake_case)]

mod common;
#[path = "common/kkt_residuals.rs"]
mod kkt_residuals;
#[path = "common/workload.rs"]
mod workload;

use common::{check_forces, max_abs};
use condyle_wholebody::{Backend, Command, Formulation, Friction, Settings, Status};
use kkt_residuals::{OPTIMALITY, check_optimality};
use workload::{Robot, Tick, record};

/// Number of recorded ticks. They contain the first step of each foot of a biped, or nine steps of a quadruped.
const TICKS: usize = 2000;
/// Interval between checked ticks.
const EACH: usize = 8;

/// Tolerance of objective and q̈ for solutions with tolerances 1e-14 and 1e-13, relative to 1 plus their size. The
/// objective is a few hundred. A relative error of the objective causes an error of q̈ of about the square root of this
/// error. Where only the posture's weight of 0.1 determines q̈, the error of q̈ is four times larger.
const AGREEMENT: f64 = 1e-6;

/// Calls a function for each recording of each robot.
fn all(mut look: impl FnMut(&Robot, &str, &[Tick])) {
    for name in ["quadruped", "humanoid"] {
        let robot = Robot::new(name, None).unwrap();
        for moves in [false, true] {
            let what = format!("{name}, {}", if moves { robot.gait() } else { "stand" });
            look(&robot, &what, &record(&robot, moves, TICKS));
        }
    }
}

/// Checks the Karush–Kuhn–Tucker conditions of the assembled program, before any elimination or scaling. Also checks
/// forces and torques by formulas that the controller does not use: τ from RNEA, Σ f = m (c̈ − g) for the acceleration
/// c̈ of the centre of mass and the gravity g, cones, and centres of pressure.
#[test]
fn every_command_is_optimal() {
    all(|robot, what, ticks| {
        let mut controller = robot.controller(Robot::settings());
        for (k, Tick { q, v, references }) in ticks.iter().enumerate() {
            let command = controller.step(q, v, references).clone();
            if k % EACH == 0 {
                check_forces(&robot.model, &robot.contacts, q, v, references, &command);
                assert!(!command.reduced_accuracy && !command.limits_relaxed, "{what}, tick {k}");
                check_optimality(&mut controller, q, v, references, &format!("{what}, tick {k}"));
            }
        }
    });
}

/// Compares the commands of two solvers. Condyle's own solver gets the condensed program and warm starts. Clarabel gets
/// the full program and cold starts.
#[test]
fn back_ends_agree_on_every_command() {
    all(|robot, what, ticks| {
        let settings =
            |backend, formulation, tolerance| Settings { backend, formulation, tolerance, ..Robot::settings() };
        let mut ours = robot.controller(settings(Backend::InteriorPoint, Formulation::Condensed, 1e-14));
        let mut theirs = robot.controller(settings(Backend::Clarabel, Formulation::Full, 3e-13));
        let (mut compared, mut reduced) = (0, 0);
        for (k, Tick { q, v, references }) in ticks.iter().enumerate() {
            let Command { a, status, reduced_accuracy, .. } = ours.step(q, v, references).clone();
            if k % EACH != 0 {
                continue;
            }
            let expected = theirs.step(q, v, references).solved().unwrap().clone();
            compared += 1;
            if expected.reduced_accuracy || reduced_accuracy || status != Status::Solved {
                reduced += 1; // one of the solvers was too inaccurate for the comparison
                continue;
            }
            let expected = expected.a;
            let apart = max_abs(a.iter().zip(&expected).map(|(a, b)| a - b));
            let bound = AGREEMENT * (1.0 + max_abs(expected.iter().copied()));
            assert!(apart < bound, "{what}, tick {k}: q̈ by {apart:.1e} of {bound:.1e}");
            let program = ours.program(q, v, references);
            let [a, b] = [&ours, &theirs].map(|controller| program.objective(&controller.optimum().x));
            assert!((a - b).abs() < AGREEMENT * (1.0 + b.abs()), "{what}, tick {k}: objectives {a} and {b}");
        }
        assert!(20 * reduced <= compared, "{what}: {reduced} of {compared} fell short of the tolerance");
    });
}

/// Checks that a larger set of forces does not raise the optimal cost: inscribed pyramid ⊂ cone ⊂ circumscribed
/// pyramid.
#[test]
fn optima_on_cones_lie_between_those_on_pyramids() {
    let mut differ = 0;
    all(|robot, what, ticks| {
        let pyramid = |inscribed| Friction::Pyramid { sides: 4, inscribed };
        let mut controllers = [pyramid(false), Friction::Cone, pyramid(true)]
            .map(|friction| robot.controller(Settings { friction, tolerance: 1e-13, ..Robot::settings() }));
        for (k, Tick { q, v, references }) in ticks.iter().enumerate().step_by(EACH) {
            let [outer, cone, inner] = controllers.each_mut().map(|controller| {
                controller.step(q, v, references).solved().unwrap();
                let x = controller.optimum().x;
                controller.program(q, v, references).objective(&x)
            });
            let slack = OPTIMALITY * (1.0 + cone.abs());
            assert!(outer < cone + slack && cone < inner + slack, "{what}, tick {k}: {outer} {cone} {inner}");
            differ += usize::from(inner - outer > 10.0 * slack);
        }
    });
    assert!(differ > 0, "friction never mattered");
}

/// Checks warm starts in a trot, in which contacts fade in and out twice in half a second. Only 1 tick in 100 may take
/// more than a few iterations; a cold start takes about ten.
#[test]
fn contacts_that_come_and_go_need_no_new_start() {
    let robot = Robot::new("quadruped", None).unwrap();
    let mut controller = robot.controller(Robot::settings());
    let ticks = record(&robot, true, TICKS);
    let step = |Tick { q, v, references }: &Tick| controller.step(q, v, references).iterations;
    let mut iterations: Vec<u32> = ticks.iter().map(step).collect();
    iterations.sort_unstable();
    let [median, most] = [50, 99].map(|percent| iterations[TICKS * percent / 100]);
    assert!(median <= 3 && most <= 8, "iterations of half of the ticks {median}, of 99 % {most}");
}
