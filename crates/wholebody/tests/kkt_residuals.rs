//! Tests that each command satisfies dynamics, contacts and cones, and that each command is optimal.
#![allow(non_snake_case)]

mod common;

use common::*;
use condyle_dynamics::{Data, ReferenceFrame, Vec3, forward_kinematics, neutral, rnea, robots};
use condyle_wholebody::{FrictionContact, Gains, Normal, Settings, Status, Task, WholeBodyController};
use nalgebra::{DMatrix, DVector};

#[test]
fn standing_still() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let contacts = feet(0.7);
    let mut controller = controller(&model, &contacts);
    let references = controller.hold(&q).unwrap();
    let command = controller.step(&q, &v, &references).solved().unwrap();
    check(&model, &contacts, &q, &v, &references, command);
    // All tasks can be satisfied at rest. Only the reference forces, equal shares of the weight, contradict them, with
    // a weight of 1e-7.
    assert!(max_abs(command.a.iter().copied()) < 1e-2, "{:?}", command.a);
    for (contact, &f) in contacts.iter().zip(&command.forces) {
        assert!(margin(contact, f) > 10.0, "{f:?}");
    }
    assert!(!command.reduced_accuracy);
}

#[test]
fn moving_anyhow() {
    let model = robots::quadruped();
    let contacts = feet(0.7);
    let mut controller = controller(&model, &contacts);
    let references = controller.hold(&stance()).unwrap();
    for seed in 0..100 {
        let (q, v) = state(&model, seed, 0.1, 0.3);
        let command = controller.step(&q, &v, &references).solved().unwrap_or_else(|status| panic!("{seed}: {status}"));
        check(&model, &contacts, &q, &v, &references, command);
        for (tau, limit) in command.tau[6..].iter().zip(&model.limits().effort()[6..]) {
            assert!(tau.abs() < limit + EQUALITY);
        }
    }
}

#[test]
fn a_humanoid_on_two_points() {
    let model = robots::humanoid();
    let contacts = [FrictionContact::point("left_sole", 0.7), FrictionContact::point("right_sole", 0.7)];
    let mut controller =
        WholeBodyController::new(&model, &contacts, &[Task::com(), Task::posture()], Settings::default()).unwrap();
    for seed in 0..20 {
        let (q, v) = near(&model, &neutral(&model), seed, 0.2, 0.1);
        let references = controller.hold(&q).unwrap();
        let command = controller.step(&q, &v, &references).solved().unwrap_or_else(|status| panic!("{seed}: {status}"));
        check(&model, &contacts, &q, &v, &references, command);
    }
}

/// Checks that a single task for the centre of mass is satisfied exactly. Then q̈ is a minimiser, whatever the solver
/// reports.
#[test]
fn a_feasible_task_is_met() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let settings = Settings { force_weight: 1e-9, acceleration_weight: 1e-9, ..Settings::default() };
    let tasks = [Task::com(), Task::orientation("trunk")];
    let mut controller = WholeBodyController::new(&model, &feet(0.7), &tasks, settings).unwrap();
    let mut references = controller.hold(&q).unwrap();
    references.com.acceleration = Vec3::new(0.5, -0.4, 0.3);
    let c = controller.step(&q, &v, &references).solved().unwrap().com_acceleration;
    assert!(norm(c - references.com.acceleration) < 1e-5, "{c:?}");
}

/// Checks the forces on ice: the task needs more friction than the ice allows. So the forces must lie on the boundaries
/// of their cones.
#[test]
fn little_friction_tilts_forces_to_the_cone() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let contacts = feet(0.1);
    let mut controller = controller(&model, &contacts);
    let mut references = controller.hold(&q).unwrap();
    references.com.acceleration.x = 3.0; // an acceleration of 0.1 · 9.81 would be feasible
    let command = controller.step(&q, &v, &references).solved().unwrap();
    check(&model, &contacts, &q, &v, &references, command);
    for (contact, &f) in contacts.iter().zip(&command.forces) {
        assert!(margin(contact, f) < 1e-4 * f.linear.z, "{f:?} is inside of its cone");
        assert!(f.linear.x > 0.0);
    }
    // If all forces point forward, ẍ = Σ f_x / m = μ Σ f_z / m.
    let c = command.com_acceleration;
    assert!((c.x - 0.1 * (c.z + 9.81)).abs() < 0.02, "{c:?}");
}

/// Checks that friction is a cone and not a pyramid: the greatest friction force is equal in all directions.
#[test]
fn friction_has_no_preferred_direction() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let contacts = feet(0.1);
    let mut controller = controller(&model, &contacts);
    for k in 0..8 {
        let angle = f64::from(k) * std::f64::consts::TAU / 8.0;
        let mut references = controller.hold(&q).unwrap();
        references.com.acceleration = Vec3::new(3.0 * angle.cos(), 3.0 * angle.sin(), 0.0);
        let command = controller.step(&q, &v, &references).solved().unwrap();
        let sum = command.forces.iter().fold(Vec3::zero(), |sum, &f| sum + f.linear);
        assert!((sum.x.hypot(sum.y) / (0.1 * sum.z) - 1.0).abs() < 0.02, "{angle}: {sum:?}");
    }
}

#[test]
fn torque_limits_bind() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let contacts = feet(0.7);
    let free = controller(&model, &contacts).step(&q, &v, &{ controller(&model, &contacts).hold(&q).unwrap() }).clone();
    let strongest = max_abs(free.tau.iter().copied());
    let limit = 0.5 * strongest; // internal forces cannot compensate for this limit
    let settings = Settings { effort: Some(vec![limit; 18]), ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks(), settings).unwrap();
    let references = controller.hold(&q).unwrap();
    let command = controller.step(&q, &v, &references).solved().unwrap();
    check(&model, &contacts, &q, &v, &references, command);
    let used = max_abs(command.tau.iter().copied());
    assert!((used - limit).abs() < 1e-4 * limit, "{used} of {limit}");
    assert!(command.tau.iter().all(|t| t.abs() < limit + EQUALITY));
    assert!(command.com_acceleration.z < -0.5, "too weak to stand, it sinks: {:?}", command.com_acceleration);
}

#[test]
fn force_bounds_bind() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let mut contacts = feet(0.7);
    contacts[0].max_force = 50.0;
    contacts[3].min_force = 95.0;
    let mut controller = controller(&model, &contacts);
    let references = controller.hold(&q).unwrap();
    let command = controller.step(&q, &v, &references).solved().unwrap();
    check(&model, &contacts, &q, &v, &references, command);
    assert!(command.forces[0].linear.z < 50.0 + EQUALITY && command.forces[3].linear.z > 95.0 - EQUALITY);
}

/// Checks that a robot on tilted ground and the same robot in a tilted world get the same result.
#[test]
fn a_slope_is_a_tilted_world() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let slope = 0.3f64;
    let (sin, cos) = slope.sin_cos();
    // In the first case the ground is level, and the gravity vector leans backwards.
    let leaning = model.clone().with_gravity(Vec3::new(-9.81 * sin, 0.0, -9.81 * cos)).unwrap();
    let contacts = feet(0.5);
    let mut level = controller(&leaning, &contacts);
    let references = level.hold(&q).unwrap();
    let expected = level.step(&q, &v, &references).solved().unwrap().clone();
    // In the second case gravity is vertical. The base and the normals are rotated by −slope about y.
    let mut turned = q.clone();
    let (s, c) = (-slope / 2.0).sin_cos();
    let (x, z) = (q[0], q[2]);
    turned[..7].copy_from_slice(&[x * cos - z * sin, q[1], x * sin + z * cos, 0.0, s, 0.0, c]);
    let normal = Normal::World(Vec3::new(-2.0 * sin, 0.0, 2.0 * cos)); // a normal may have any length
    let contacts: Vec<_> = contacts.into_iter().map(|c| FrictionContact { normal, ..c }).collect();
    let mut tilted = controller(&model, &contacts);
    let references = tilted.hold(&turned).unwrap();
    let found = tilted.step(&turned, &v, &references).solved().unwrap();
    for (f, e) in found.forces.iter().zip(&expected.forces) {
        let e = e.linear;
        let rotated = Vec3::new(e.x * cos - e.z * sin, e.y, e.x * sin + e.z * cos);
        assert!(norm(f.linear - rotated) < 1e-3, "{f:?} for {rotated:?}");
    }
    assert!(max_abs(found.tau.iter().zip(&expected.tau).map(|(a, b)| a - b)) < 1e-3);
}

#[test]
fn contacts_are_pulled_back() {
    let (model, contacts) = (robots::quadruped(), feet(0.7));
    let gains = Gains { stiffness: 400.0, damping: 40.0 };
    let settings = Settings { contact_gains: gains, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks(), settings).unwrap();
    let (q, mut references) = (stance(), controller.hold(&stance()).unwrap());
    references.contacts[1].pose.translation.x += 1e-3;
    let command = controller.step(&q, &[0.0; 18], &references).solved().unwrap();
    let (feet, _) = accelerations(&model, &contacts, &q, &[0.0; 18], &command.a);
    assert!(norm(feet[1] - Vec3::new(0.4, 0.0, 0.0)) < EQUALITY, "k · 1 mm, found {:?}", feet[1]);
    assert!(norm(feet[0]) < EQUALITY);
}

#[test]
fn a_fixed_base_arm_leans_on_its_tool() {
    let model = robots::arm7();
    let q = [0.3, 0.6, 0.0, 1.2, 0.0, 0.5, 0.0];
    let contact = FrictionContact { min_force: 20.0, ..FrictionContact::point("tool", 0.5) };
    let mut controller = WholeBodyController::new(&model, &[contact], &[Task::posture()], Settings::default()).unwrap();
    let references = controller.hold(&q).unwrap();
    let command = controller.step(&q, &[0.0; 7], &references).solved().unwrap();
    assert!(command.forces[0].linear.z > 20.0 - EQUALITY);
    assert!(command.tau.iter().all(|&tau| tau != 0.0));
}

#[test]
fn what_cannot_be_is_infeasible() {
    let (model, q, v) = (robots::quadruped(), stance(), vec![0.0; 18]);
    let contacts: Vec<_> = feet(0.7).into_iter().map(|c| FrictionContact { min_force: 1000.0, ..c }).collect();
    let mut controller = controller(&model, &contacts);
    let references = controller.hold(&q).unwrap();
    assert_eq!(controller.step(&q, &v, &references).status, Status::Infeasible); // the knees have only 80 N m
}

/// Checks commands without active inequalities against the solution of a linear system. The test builds this system
/// without functions of the controller: columns of M are differences of RNEA, and columns of Jacobians are differences
/// of accelerations along a path.
#[test]
fn inside_all_cones_the_kkt_system_is_solved() {
    let (model, contacts) = (robots::quadruped(), feet(2.0));
    let (q, v) = state(&model, 3, 0.05, 0.05);
    let settings = Settings { force_weight: 1e-5, ..Settings::default() };
    let mut controller = WholeBodyController::new(&model, &contacts, &tasks(), settings).unwrap();
    let mut references = controller.hold(&q).unwrap();
    references.com.acceleration = Vec3::new(0.3, -0.2, 0.4);
    let command = controller.step(&q, &v, &references).solved().unwrap();
    for (contact, &f) in contacts.iter().zip(&command.forces) {
        assert!(margin(contact, f) > 1.0, "the state is chosen inside of all cones: {f:?}");
    }

    let (nv, n, rows) = (18, 30, 18); // x = (q̈, f); rows of the free base and of four feet
    let mut data = Data::new(&model);
    let mut at = |a: &[f64]| {
        let (feet, com) = accelerations(&model, &contacts, &q, &v, a);
        let feet: Vec<f64> = feet.into_iter().flat_map(Vec3::to_array).collect();
        (rnea(&model, &mut data, &q, &v, a, &[]).to_vec(), feet, com.to_array())
    };
    let (h, feet_bias, com_bias) = at(&vec![0.0; nv]);
    let (mut A, mut b) = (DMatrix::zeros(rows, n), DVector::zeros(rows));
    let mut Jc = DMatrix::zeros(3, nv);
    for j in 0..nv {
        let unit: Vec<f64> = (0..nv).map(|i| f64::from(u8::from(i == j))).collect();
        let (tau, feet, com) = at(&unit);
        (0..6).for_each(|i| A[(i, j)] = tau[i] - h[i]);
        (0..3).for_each(|i| Jc[(i, j)] = com[i] - com_bias[i]);
        for i in 0..12 {
            A[(6 + i, j)] = feet[i] - feet_bias[i];
            if j < 6 {
                A[(j, nv + i)] = -A[(6 + i, j)]; // −Jᵀ
            }
        }
    }
    (0..6).for_each(|i| b[i] = -h[i]);
    (0..12).for_each(|i| b[6 + i] = -feet_bias[i]);

    let mut Jw = DMatrix::zeros(6, nv); // ω of the root is R ω_b, so its ω̇ at q̈ = 0 is R (ω_b × ω_b) = 0.
    let placements = forward_kinematics(&model, &mut data, &q);
    placements.frame_jacobian(model.frame("trunk").unwrap(), ReferenceFrame::LocalWorldAligned, &mut Jw);
    let (Jw, v) = (Jw.rows(3, 3).into_owned(), DVector::from_vec(v));
    let damping = 20.0; // damping of all tasks; errors of position are zero
    let com = DVector::from_column_slice(&references.com.acceleration.to_array())
        - DVector::from_column_slice(&com_bias)
        - damping * &Jc * &v;
    let (mut P, mut c) = (DMatrix::zeros(n, n), DVector::zeros(n));
    P.view_mut((0, 0), (nv, nv)).copy_from(&(10.0 * Jc.transpose() * &Jc + 10.0 * Jw.transpose() * &Jw));
    c.rows_mut(0, nv).copy_from(&(-10.0 * Jc.transpose() * com + 10.0 * damping * Jw.transpose() * &Jw * &v));
    (6..nv).for_each(|i| P[(i, i)] += 0.1);
    (6..nv).for_each(|i| c[i] += 0.1 * damping * v[i]);
    (0..nv).for_each(|i| P[(i, i)] += 1e-6);
    for i in nv..n {
        P[(i, i)] = 1e-5;
        c[i] = if (i - nv) % 3 == 2 { -1e-5 * 9.81 * model.total_mass() / 4.0 } else { 0.0 };
    }
    // Solve [P Aᵀ; A 0] [x; λ] = [−c; b].
    let mut K = DMatrix::zeros(n + rows, n + rows);
    K.view_mut((0, 0), (n, n)).copy_from(&P);
    K.view_mut((n, 0), (rows, n)).copy_from(&A);
    K.view_mut((0, n), (n, rows)).copy_from(&A.transpose());
    let right = DVector::from_iterator(n + rows, c.iter().map(|c| -c).chain(b.iter().copied()));
    let x = K.lu().solve(&right).unwrap();
    let found = command.a.iter().copied().chain(command.forces.iter().flat_map(|f| f.linear.to_array()));
    // The tolerance follows from the duality gap of 1e-9. Where only w_f = 1e-5 determines a force, this gap bounds the
    // force's error by √(1e-9 / 1e-5) = 1e-2 N. The last Newton step of an interior-point method squares this error.
    let error = max_abs(found.zip(&x).map(|(found, x)| found - x));
    assert!(error < 1e-4, "{error:.1e}");
}
