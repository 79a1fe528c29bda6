//! Tests of soles, edges and pyramids. Both forms of the program must give the same command.
#![allow(non_snake_case)]

mod common;

use common::*;
use condyle_dynamics::{Model, Vec3, robots};
use condyle_wholebody::{
    Backend, Command, Formulation, Friction, FrictionContact, Normal, References, Settings, Shape, Status, Task,
    WholeBodyController,
};

/// Tolerance of q̈ for two solvers with tolerance 1e-10, relative to 1 plus the largest entry of q̈.
const AGREEMENT: f64 = 1e-6;

fn solve(
    model: &Model,
    contacts: &[FrictionContact],
    tasks: &[Task],
    settings: Settings,
    q: &[f64],
    v: &[f64],
    change: impl Fn(&mut References),
) -> (References, Command) {
    let mut controller = WholeBodyController::new(model, contacts, tasks, settings).unwrap();
    let mut references = controller.hold(q).unwrap();
    change(&mut references);
    let command = controller.step(q, v, &references).solved().unwrap().clone();
    (references, command)
}

#[test]
fn a_humanoid_stands_on_soles() {
    let model = robots::humanoid();
    for contacts in [soles(0.7), soles(0.7).into_iter().map(FrictionContact::by_corners).collect()] {
        let mut controller =
            WholeBodyController::new(&model, &contacts, &humanoid_tasks(), Settings::default()).unwrap();
        let references = controller.hold(&squat(&model)).unwrap();
        for seed in 0..20 {
            let (q, v) = near(&model, &squat(&model), seed, 0.02, 0.05);
            let command = controller.step(&q, &v, &references);
            check(&model, &contacts, &q, &v, &references, command);
            assert!(!command.limits_relaxed);
        }
    }
}

/// Checks a strong push to the side. The push moves the centre of pressure to the edge of a sole, or a force to the
/// boundary of its friction cone.
#[test]
fn the_centre_of_pressure_stays_within() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    for (push, mu) in [(Vec3::new(2.0, 0.0, 0.0), 0.7), (Vec3::new(0.5, 4.0, 0.0), 0.2)] {
        for contacts in [soles(mu), soles(mu).into_iter().map(FrictionContact::by_corners).collect()] {
            let (references, command) =
                solve(&model, &contacts, &humanoid_tasks(), Settings::default(), &q, &v, |r| r.com.acceleration = push);
            check(&model, &contacts, &q, &v, &references, &command);
            assert!(norm(command.com_acceleration - push) > 0.1, "so much cannot be had");
        }
    }
}

/// Checks that a wrench and corner forces distribute the load in the same way. (The cost of a force is quadratic. So
/// four corner forces, each a quarter of the load, cost a quarter of one force that carries the load.) When the robot
/// leans halfway to the side, the pressure must be outside of the middle of the soles, but far from their edges.
#[test]
fn pressure_keeps_away_from_the_edges() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    let tasks = [Task { weight: 1e4, ..Task::com() }, Task { weight: 1e4, ..Task::posture() }];
    let corners: Vec<_> = soles(0.7).into_iter().map(FrictionContact::by_corners).collect();
    let [wrench, corners] = [(soles(0.7), 0.25), (corners, 1.0)].map(|(contacts, part)| {
        let settings = Settings { force_weight: 1e-2 * part, ..Settings::default() };
        let (references, command) = solve(&model, &contacts, &tasks, settings, &q, &v, |r| r.com.acceleration.y = 0.6);
        check(&model, &contacts, &q, &v, &references, &command);
        command
    });
    let weight = 9.81 * model.total_mass();
    for (one, other) in wrench.forces.iter().zip(&corners.forces) {
        assert!(max_abs((*one - *other).to_array()) < 1e-5 * weight, "{one:?} and {other:?}");
        let aside = one.angular.x / one.linear.z; // y of the centre of pressure (m); a sole is 0.1 m wide
        assert!(aside.abs() > 1e-3 && aside.abs() < 0.025, "{aside}");
    }
    let [left, right] = [0, 1].map(|k| wrench.forces[k].linear.z);
    assert!((left - right).abs() > 0.05 * weight, "{left} and {right}");
}

/// Checks that condensed and full programs agree, with clarabel and with Condyle's own solver. The weight of the forces
/// is large compared to the tolerance.
#[test]
fn all_ways_agree() {
    let (humanoid, quadruped) = (robots::humanoid(), robots::quadruped());
    let corners: Vec<_> = soles(0.4).into_iter().map(FrictionContact::by_corners).collect();
    for (model, contacts, tasks, centre) in [
        (&quadruped, feet(0.4), tasks(), stance()),
        (&humanoid, soles(0.4), humanoid_tasks(), squat(&humanoid)),
        (&humanoid, corners, humanoid_tasks(), squat(&humanoid)),
    ] {
        for seed in 0..5 {
            let (q, v) = near(model, &centre, seed, 0.02, 0.1);
            let command = |backend, formulation| {
                let tolerance = if backend == Backend::Clarabel { 1e-11 } else { 1e-10 };
                let settings = Settings { formulation, backend, tolerance, force_weight: 1e-5, ..Settings::default() };
                let (references, command) =
                    solve(model, &contacts, &tasks, settings, &q, &v, |r| r.com.acceleration.x = 2.0);
                check(model, &contacts, &q, &v, &references, &command);
                command
            };
            let reference = command(Backend::Clarabel, Formulation::Full);
            for (backend, formulation) in [
                (Backend::Clarabel, Formulation::Condensed),
                (Backend::InteriorPoint, Formulation::Condensed),
                (Backend::InteriorPoint, Formulation::Full),
            ] {
                let apart = max_abs(command(backend, formulation).a.iter().zip(&reference.a).map(|(a, b)| a - b));
                let bound = AGREEMENT * (1.0 + max_abs(reference.a.iter().copied()));
                assert!(apart < bound, "q̈ of seed {seed} by {backend:?}, {formulation:?}: {apart:.1e}");
            }
        }
    }
}

/// Checks that a larger set of forces does not raise the cost of a task: inscribed pyramid ⊂ cone ⊂ circumscribed
/// pyramid.
#[test]
fn the_cone_lies_between_the_pyramids() {
    let model = robots::quadruped();
    let (q, v, push) = (stance(), vec![0.0; 18], Vec3::new(3.0, 1.0, 0.0));
    let missed = |friction| {
        let settings = Settings { friction, ..Settings::default() };
        let tasks = [Task::com(), Task::orientation("trunk")];
        let command = solve(&model, &feet(0.2), &tasks, settings, &q, &v, |r| r.com.acceleration = push).1;
        // the cost of the task, without the regularisation
        (command.com_acceleration - push).norm_squared()
    };
    let cone = missed(Friction::Cone);
    for sides in [3, 4, 8, 16] {
        let inner = missed(Friction::Pyramid { sides, inscribed: true });
        let outer = missed(Friction::Pyramid { sides, inscribed: false });
        assert!(outer < cone && cone < inner, "{sides} sides: {outer} {cone} {inner}");
        if sides == 16 {
            assert!(inner - outer < 0.1 * cone, "many sides come near the cone");
        }
    }
}

/// Checks a foot that rolls over the edge of its toe, and hands that push against a wall. The normals of the hands turn
/// with the hands.
#[test]
fn edges_and_walls() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    let toe = [Vec3::new(0.1, 0.05, 0.0), Vec3::new(0.1, -0.05, 0.0)];
    let edge = FrictionContact::surface("left_sole", 0.7, &toe);
    let wall = FrictionContact {
        normal: Normal::Frame(Vec3::new(-1.0, 0.0, 0.0)),
        shape: Shape::Point,
        max_force: 30.0,
        ..FrictionContact::point("left_hand", 0.4)
    };
    for edge in [edge.clone(), edge.by_corners()] {
        let contacts = [edge, FrictionContact::sole("right_sole", 0.7, [0.2, 0.1]), wall.clone()];
        let (_, command) = solve(&model, &contacts, &humanoid_tasks(), Settings::default(), &q, &v, |_| ());
        assert_eq!(command.status, Status::Solved);
        let tau = inverse_dynamics(&model, &contacts, &q, &v, &command);
        assert!(max_abs(tau.iter().zip(&command.tau).map(|(a, b)| a - b)) < EQUALITY);
        // The moment about the edge is zero.
        let (f, p) = (command.forces[0], toe[0]);
        let R = orientation(&model, &q, "left_sole");
        let about = f.angular - (R * p).cross(f.linear);
        assert!(about.dot(R * Vec3::new(0.0, 1.0, 0.0)).abs() < EQUALITY);
        // The wall can only push. Its force is limited, and its normal turns with the hand.
        let R = orientation(&model, &q, "left_hand");
        let f_n = command.forces[2].linear.dot(R * Vec3::new(-1.0, 0.0, 0.0));
        assert!((-EQUALITY..30.0 + EQUALITY).contains(&f_n), "{f_n}");
    }
}

/// Checks a hand that leans on a wall next to the robot. The normal is given in the world: the wall pushes along the
/// normal, with friction perpendicular to it.
#[test]
fn a_hand_leans_on_a_wall() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    let wall = FrictionContact {
        normal: Normal::World(Vec3::new(0.0, -1.0, 0.0)),
        min_force: 20.0,
        ..FrictionContact::point("left_hand", 0.4)
    };
    let contacts = [soles(0.7), vec![wall]].concat();
    let settings = Settings { force_weight: 1e-2, ..Settings::default() }; // makes the wall's force small
    // The reference force on the wall is a share of the weight. This share exceeds the available friction.
    let (references, command) = solve(&model, &contacts, &humanoid_tasks(), settings, &q, &v, |r| {
        r.contacts[2].force.linear = Vec3::new(0.0, 0.0, 100.0);
    });
    check(&model, &contacts, &q, &v, &references, &command);
    let f = command.forces[2].linear;
    assert!(f.y < -20.0 + EQUALITY, "{f:?}");
    assert!(f.z > 0.0 && (f.x.hypot(f.z) / (-0.4 * f.y) - 1.0).abs() < 1e-3, "at the edge of its cone: {f:?}");
}

/// Checks a convex polygon with six corners, whose corners are given in both directions around the polygon.
#[test]
fn soles_of_many_corners() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    let heel_and_toes = [[0.12, 0.03], [0.06, 0.05], [-0.08, 0.04], [-0.1, 0.0], [-0.08, -0.04], [0.06, -0.05]];
    let corners = heel_and_toes.map(|[x, y]| Vec3::new(x, y, -0.01));
    let backwards: Vec<_> = corners.iter().rev().copied().collect();
    for push in [Vec3::zero(), Vec3::new(3.0, 0.5, 0.0)] {
        let command = |corners: &[Vec3<f64>], by_corners: bool| {
            let contacts = ["left_sole", "right_sole"].map(|sole| {
                let sole = FrictionContact::surface(sole, 0.7, corners);
                if by_corners { sole.by_corners() } else { sole }
            });
            let settings = Settings { tolerance: 1e-12, force_weight: 1e-5, ..Settings::default() };
            let change = |r: &mut References| r.com.acceleration = push;
            let (references, command) = solve(&model, &contacts, &humanoid_tasks(), settings, &q, &v, change);
            check(&model, &contacts, &q, &v, &references, &command);
            command
        };
        for by_corners in [false, true] {
            let [one, other] = [&corners[..], &backwards].map(|corners| command(corners, by_corners));
            let apart = max_abs(one.a.iter().zip(&other.a).map(|(a, b)| a - b));
            assert!(apart < AGREEMENT * (1.0 + max_abs(one.a.iter().copied())), "q̈ by {apart:.1e}");
        }
    }
}

/// Checks a robot on one foot with bounded yaw moment: the robot turns as fast as this bound allows.
#[test]
fn the_yaw_moment_binds() {
    let model = robots::humanoid();
    let (q, v) = (squat(&model), vec![0.0; 38]);
    let only_z = [false, false, true, false, false, false];
    let spin = Task { weight: 10.0, mask: only_z, ..Task::angular_momentum() };
    let tasks = [spin, Task { weight: 1e-3, ..Task::posture() }];
    let moment = |yaw: f64| {
        let contacts: Vec<_> =
            soles(0.7).into_iter().map(|c| FrictionContact { yaw_friction: Some(yaw), ..c }).collect();
        let (references, command) = solve(&model, &contacts, &tasks, Settings::default(), &q, &v, |r| {
            r.contacts[1].activation = 0.0;
            r.momentum.rate.z = 20.0;
        });
        check(&model, &contacts, &q, &v, &references, &command);
        let f = command.forces[0];
        f.angular.z / f.linear.z // soles are level, and their frames are in the middle
    };
    let (less, more) = (moment(0.003), moment(0.006));
    assert!((less - 0.003).abs() < 1e-6 && (more - 0.006).abs() < 1e-6, "{less} {more}");
}

/// Checks redundant contacts: four points on one foot give twelve equalities, and only six of them are independent.
#[test]
fn redundant_contacts_are_no_obstacle() {
    let mut builder = condyle_dynamics::ModelBuilder::new("hopper");
    let inertia = condyle_dynamics::Inertia::from_com(5.0, Vec3::zero(), condyle_dynamics::Sym3::diagonal(0.2));
    let place = |z| condyle_dynamics::Se3::new(condyle_dynamics::Mat3::identity(), Vec3::new(0.0, 0.0, z));
    let joint = condyle_dynamics::Joint::Revolute { axis: Vec3::new(1.0, 0.0, 0.0) };
    let trunk = builder.body("trunk", condyle_dynamics::WORLD, condyle_dynamics::Joint::FreeFlyer, place(0.0), inertia);
    let foot = builder.body("foot", trunk, joint, place(-0.3), inertia);
    for (k, [x, y]) in [[0.1, 0.1], [0.1, -0.1], [-0.1, 0.1], [-0.1, -0.1]].into_iter().enumerate() {
        let at = condyle_dynamics::Se3::new(condyle_dynamics::Mat3::identity(), Vec3::new(x, y, -0.1));
        builder.frame(&format!("corner{k}"), foot, at);
    }
    let model = builder.build().unwrap();
    let contacts: Vec<_> = (0..4).map(|k| FrictionContact::point(&format!("corner{k}"), 0.7)).collect();
    let (q, v) = (condyle_dynamics::neutral(&model), vec![0.0; 7]);
    let settings = Settings { backend: Backend::Clarabel, ..Settings::default() };
    let (references, command) = solve(&model, &contacts, &[Task::posture()], settings, &q, &v, |_| ());
    check(&model, &contacts, &q, &v, &references, &command);
    for f in &command.forces {
        assert!((f.linear.z - 10.0 * 9.81 / 4.0).abs() < 1e-3, "{f:?}");
    }
}
