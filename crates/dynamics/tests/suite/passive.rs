//! Damping, friction, springs and gravity compensation: their laws, their slopes, MuJoCo's numbers; no other function adds them.

use crate::common;

use common::{State, Tree, Worst, all_models, embedded, moved, normal, rng};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    Data, Inertia, Joint, JointOptions, Mimic, Model, ModelBuilder, Quaternion, Se3, Sym3, Vec3, WORLD, aba, crba,
    forward_kinematics, forward_velocities, gravity, neutral, nonlinear_effects, passive_torque,
    passive_torque_derivatives, random_configuration, rnea,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// A few roundings.
const ROUNDING: f64 = 1e-14;
const SMOOTHING: f64 = 0.01;

/// A chain with losses at each joint, or without.
fn chain(losses: bool) -> Model {
    let mut builder = ModelBuilder::new("chain");
    let mut parent = WORLD;
    let x = Vec3::new(1.0, 0.0, 0.0);
    for (k, joint) in
        [Joint::Revolute { axis: x }, Joint::Prismatic { axis: x }, Joint::Spherical].into_iter().enumerate()
    {
        let (damping, friction) = if losses { (0.1 + k as f64, 0.5 * k as f64) } else { (0.0, 0.0) };
        let options = JointOptions { damping, friction, ..JointOptions::default() };
        let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
        let name = format!("{k}");
        parent = builder.body_with((&name, &name), parent, joint, Se3::identity(), I, options);
    }
    builder.build().expect("it is well-formed")
}

#[test]
fn takes_power() {
    for model in embedded().into_iter().chain([chain(true)]) {
        for seed in 0..50 {
            let v = normal(&mut rng(seed), model.nv());
            let mut tau = vec![f64::NAN; model.nv()];
            passive_torque(&model, &neutral(&model), &v, SMOOTHING, &mut tau);
            for k in 0..model.nv() {
                assert!(tau[k] * v[k] <= 0.0);
                let bound = model.damping()[k] * v[k].abs() + model.friction()[k];
                assert!(tau[k].abs() <= bound * (1.0 + ROUNDING));
            }
        }
    }
}

/// Coulomb's law, where the speed is not small; no friction at rest; odd in v.
#[test]
fn friction_is_smoothed() {
    let model = chain(true);
    let torque = |speed: f64| {
        let mut tau = vec![0.0; model.nv()];
        passive_torque(&model, &neutral(&model), &vec![speed; model.nv()], SMOOTHING, &mut tau);
        tau
    };
    assert!(torque(0.0).iter().all(|&x| x == 0.0));
    for (k, &tau) in torque(7.3 * SMOOTHING).iter().enumerate() {
        let expected = -model.damping()[k] * 7.3 * SMOOTHING - model.friction()[k];
        assert!((tau - expected).abs() <= 1e-6 * model.friction()[k] + ROUNDING); // as the documentation says
    }
    assert!(torque(0.3).iter().zip(torque(-0.3)).all(|(a, b)| *a == -b));
}

/// The derivatives equal those of dual numbers, for every kind of joint with springs, polynomial damping, friction and gravity
/// compensation, and for joints that follow others.
#[test]
fn slopes_are_the_derivatives() {
    let mut worst = Worst::new("∂(passive torque)", 1e-12);
    for (seed, model) in all_models(8).iter().enumerate() {
        let (nv, random) = (model.nv(), &mut rng(seed as u64));
        let State { q, v, .. } = State::random(model, random);
        let v: Vec<f64> = v.iter().map(|x| x * 2.0 * SMOOTHING).collect();
        let [mut dq, mut dv] = [(); 2].map(|()| DMatrix::from_element(nv, nv, f64::NAN));
        passive_torque_derivatives(model, &q, &v, SMOOTHING, &mut dq, &mut dv);
        let [mut expected_dq, mut expected_dv] = [(); 2].map(|()| DMatrix::zeros(nv, nv));
        for k in 0..nv {
            let one = |on: bool, x: f64, j: usize| Dual64::new(x, if on && j == k { 1.0 } else { 0.0 });
            for (expected, by_q) in [(&mut expected_dq, true), (&mut expected_dv, false)] {
                let way: Vec<Dual64> = (0..nv).map(|j| one(by_q, 0.0, j)).collect();
                let at: Vec<Dual64> = q.iter().map(|&q| q.into()).collect();
                let speed: Vec<Dual64> = v.iter().enumerate().map(|(j, &v)| one(!by_q, v, j)).collect();
                let mut tau = vec![Dual64::from(0.0); nv];
                passive_torque(model, &moved(model, &at, &way), &speed, SMOOTHING, &mut tau);
                expected.column_mut(k).copy_from_slice(&common::eps(&tau));
            }
        }
        worst.see(model, dq.as_slice(), expected_dq.as_slice());
        worst.see(model, dv.as_slice(), expected_dv.as_slice());
    }
}

/// At the rest of all springs and without weight to carry nothing acts, and the slopes are finite.
#[test]
fn springs_at_rest() {
    let mut builder = ModelBuilder::new("at rest");
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let joints = [Joint::FreeFlyer, Joint::Spherical, Joint::Planar, Joint::Translation];
    let mut parent = WORLD;
    for (k, joint) in joints.into_iter().enumerate() {
        parent = builder.body(&format!("b{k}"), parent, joint, Se3::identity(), I);
        let (q, quaternion) = ([0.3, -0.2, 0.1], [0.1, -0.5, 0.5, 0.7]);
        let norm = quaternion.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rest: Vec<f64> = match joint {
            Joint::FreeFlyer => q.into_iter().chain(quaternion.map(|x| x / norm)).collect(),
            Joint::Spherical => quaternion.map(|x| x / norm).to_vec(),
            Joint::Planar => vec![0.3, -0.2, 0.6, 0.8],
            _ => q.to_vec(),
        };
        builder.spring(parent, [2.0, 3.0, 4.0], &rest);
    }
    let model = builder.build().expect("it is well-formed");
    let q: Vec<f64> = model.springs().iter().flat_map(|spring| spring.rest.clone()).collect();
    let (nv, mut tau) = (model.nv(), vec![f64::NAN; model.nv()]);
    passive_torque(&model, &q, &vec![0.0; nv], SMOOTHING, &mut tau);
    assert!(tau.iter().all(|x| x.abs() < 1e-14), "{tau:?}");
    let [mut dq, mut dv] = [(); 2].map(|()| DMatrix::from_element(nv, nv, f64::NAN));
    passive_torque_derivatives(&model, &q, &vec![0.0; nv], SMOOTHING, &mut dq, &mut dv);
    assert!((dq + DMatrix::identity(nv, nv) * 2.0).amax() < 1e-13);
}

/// The spring of a joint that follows another one: its own displacement, its effort times the ratio.
#[test]
fn springs_of_followers() {
    const AXIS: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let (endless, hinge) = (Joint::Continuous { axis: AXIS }, Joint::Revolute { axis: AXIS });
    // (leader, follower, its rest, ratio); what follows a joint without limits is known up to whole turns
    for (leads, follows, rest, ratio, turns) in [
        (hinge, hinge, vec![0.4], -0.7, false),
        (hinge, Joint::Prismatic { axis: AXIS }, vec![0.4], 1.5, false),
        (hinge, endless, vec![f64::cos(0.4), f64::sin(0.4)], 3.0, true),
        (endless, hinge, vec![0.4], 2.0, true),
        (endless, endless, vec![f64::cos(0.4), f64::sin(0.4)], -3.0, true),
    ] {
        let (offset, stiffness) = (0.25, [2.0, 0.5, 0.3]);
        let mut builder = ModelBuilder::new("pair");
        let leader = builder.body("leader", WORLD, leads, Se3::identity(), I);
        let follower = builder.body("follower", leader, follows, Se3::identity(), I);
        builder.mimic(follower, leader, Mimic { ratio, offset });
        builder.spring(follower, stiffness, &rest);
        let model = builder.build().expect("it is well-formed");
        for x in [-2.0, -0.3, 0.0, 0.9, 2.9] {
            let q = if leads.nq() == 2 { vec![f64::cos(x), f64::sin(x)] } else { vec![x] };
            let mut tau = [f64::NAN];
            passive_torque(&model, &q, &[0.0], SMOOTHING, &mut tau);
            let mut way: f64 = ratio * x + offset - 0.4;
            if turns {
                way = way.sin().atan2(way.cos());
            }
            let expected = -ratio * (2.0 + 0.5 * way + 0.3 * way * way) * way;
            assert!((tau[0] - expected).abs() < 1e-13, "{leads:?}, {follows:?} at {x}: {} and {expected}", tau[0]);
        }
    }
}

/// Where all weights are carried the efforts are those that hold the robot still; half of them for half of the weight.
#[test]
fn gravity_that_is_compensated() {
    for seed in 0..10 {
        let tree = Tree::random_with_mimics(&mut rng(seed));
        let model = tree.build();
        for factor in [1.0, 0.5] {
            let mut builder = ModelBuilder::new("carried");
            let mut ids = vec![WORLD];
            for (i, body) in model.bodies().iter().enumerate().skip(1) {
                let name = format!("{i}");
                let names = (name.as_str(), name.as_str());
                let options = JointOptions::default();
                ids.push(builder.body_with(names, ids[body.parent], body.joint, body.placement, body.inertia, options));
                // in two parts, one of them in a frame of its own
                let X = Se3 { translation: Vec3::new(0.3, -0.2, 0.5), ..Se3::identity() };
                builder.compensate_gravity(ids[i], Se3::identity(), body.inertia, 0.25 * factor);
                builder.compensate_gravity(ids[i], X, condyle_dynamics::Act::act_inv(&X, body.inertia), 0.75 * factor);
            }
            for (i, body) in model.bodies().iter().enumerate().skip(1) {
                if let Some(mimic) = body.mimic {
                    let leads = |b: &condyle_dynamics::Body| b.mimic.is_none() && b.idx_v == body.idx_v;
                    let leader = 1 + model.bodies()[1..].iter().position(leads).expect("it follows a joint");
                    builder.mimic(ids[i], ids[leader], mimic);
                }
            }
            builder.gravity(*model.gravity());
            let carried = builder.build().expect("it is well-formed");
            let (q, nv) = (random_configuration(&carried, &mut rng(seed)), carried.nv());
            let mut tau = vec![f64::NAN; nv];
            passive_torque(&carried, &q, &vec![0.0; nv], SMOOTHING, &mut tau);
            let expected: Vec<f64> =
                gravity(&carried, &mut Data::new(&carried), &q).iter().map(|g| factor * g).collect();
            assert!(common::relative(&tau, &expected) < 1e-12, "{carried}");
        }
    }
}

/// The robot of `passive.xml`, with MuJoCo's laws of springs and damping, and the armature of its free joint.
fn like_mujoco() -> Model {
    let mut builder = ModelBuilder::new("passive");
    let full =
        |mass, com, [xx, yy, zz, xy, xz, yz]: [f64; 6]| Inertia::from_com(mass, com, Sym3 { xx, xy, yy, xz, yz, zz });
    let at = |x, y, z| Se3 { translation: Vec3::new(x, y, z), ..Se3::identity() };
    let options = |armature, damping, damping_polynomial| JointOptions {
        armature,
        damping,
        damping_polynomial,
        ..JointOptions::default()
    };
    let I = full(3.0, Vec3::new(0.1, 0.02, -0.05), [0.4, 0.5, 0.6, 0.03, -0.02, 0.01]);
    let free = options(2.5, 0.4, [0.3, 0.2]);
    let base = builder.body_with(("base", "float"), WORLD, Joint::FreeFlyer, Se3::identity(), I, free);
    builder.spring(base, [3.0, 1.0, 0.5], &[0.2, -0.1, 0.8, 0.0, 0.6, 0.0, 0.8]);
    builder.compensate_gravity(base, Se3::identity(), I, 0.5);
    let I = full(1.5, Vec3::new(0.2, 0.0, 0.1), [0.1, 0.2, 0.15, 0.0, 0.0, 0.0]);
    let joint = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let arm = builder.body_with(("arm", "hinge"), base, joint, at(0.3, 0.1, 0.0), I, options(0.1, 0.3, [0.2, 0.1]));
    builder.spring(arm, [3.0, 1.0, 0.5], &[0.4]);
    builder.compensate_gravity(arm, Se3::identity(), I, 1.0);
    let I = full(0.8, Vec3::new(0.05, 0.1, 0.0), [0.03, 0.02, 0.04, 0.0, 0.0, 0.0]);
    let ball = options(0.05, 0.2, [0.0, 0.4]);
    let wrist = builder.body_with(("wrist", "ball"), arm, Joint::Spherical, at(0.4, 0.0, 0.1), I, ball);
    builder.spring(wrist, [2.0, 0.7, 0.3], &[0.0, 0.0, 0.0, 1.0]);
    let I = full(0.5, Vec3::new(0.0, 0.05, 0.05), [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]);
    let joint = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
    let tip = builder.body_with(("tip", "slide"), wrist, joint, at(0.0, 0.1, 0.2), I, options(0.0, 1.0, [0.0; 2]));
    builder.spring(tip, [40.0, 0.0, 9.0], &[-0.1]);
    builder.compensate_gravity(tip, Se3::identity(), I, 0.3);
    builder.build().expect("it is well-formed")
}

/// M, bias and passive efforts equal MuJoCo's.
#[test]
fn the_numbers_of_mujoco() {
    let text = include_str!("../data/passive_mujoco.json");
    let states: Vec<std::collections::HashMap<String, serde_json::Value>> = serde_json::from_str(text).unwrap();
    let numbers = |x: &serde_json::Value| -> Vec<f64> {
        let all = x.as_array().unwrap().iter();
        all.flat_map(|x| x.as_array().map_or_else(|| vec![x.clone()], Clone::clone))
            .filter_map(|x| x.as_f64())
            .collect()
    };
    let model = like_mujoco();
    let (mut data, mut tau) = (Data::new(&model), vec![f64::NAN; model.nv()]);
    assert_eq!(states.len(), 4);
    for state in &states {
        let [q, v, M, bias, passive] = ["q", "v", "M", "bias", "passive"].map(|name| numbers(&state[name]));
        assert!(common::relative(crba(&model, &mut data, &q).as_slice(), &M) < 1e-12);
        assert!(common::relative(nonlinear_effects(&model, &mut data, &q, &v), &bias) < 1e-12);
        passive_torque(&model, &q, &v, SMOOTHING, &mut tau);
        assert!(common::relative(&tau, &passive) < 1e-12, "{tau:?}\n{passive:?}");
    }
}

/// A free body with friction slides against it along the axes of the world, whatever way it is turned.
#[test]
fn friction_of_a_free_joint() {
    let mut builder = ModelBuilder::new("box");
    let losses = JointOptions { friction: 2.0, ..JointOptions::default() };
    let I = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1));
    builder.body_with(("box", "float"), WORLD, Joint::FreeFlyer, Se3::identity(), I, losses);
    let model = builder.build().expect("it is well-formed");
    let mut q = neutral(&model);
    q[3..].copy_from_slice(&[0.1, -0.5, 0.5, 0.7].map(|x: f64| x)); // of length 1
    let R = Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation();
    let along = R.transpose_mul(Vec3::new(1.0, -1.0, 0.0)).to_array();
    let mut tau = [f64::NAN; 6];
    passive_torque(&model, &q, &[along[0], along[1], along[2], 0.0, 0.0, 0.0], SMOOTHING, &mut tau);
    let force = R * Vec3::new(tau[0], tau[1], tau[2]); // 2 N along each axis of the world in which it moves
    assert!((force - Vec3::new(-2.0, 2.0, 0.0)).norm_squared() < 1e-20, "{force:?}");
}

/// The energy that springs hold, −∫ τ of each: k₀ r²/2 + k₁ r³/3 + k₂ r⁴/4, with r the displacement of a joint of one degree of
/// freedom, and the length of the displacement of others.
fn spring_energy(model: &Model, q: &[f64]) -> f64 {
    let mut energy = 0.0;
    for spring in model.springs() {
        let body = &model.bodies()[spring.body];
        let at = common::own_position(model, spring.body, q);
        let turn = |q: &[f64], p: &[f64]| {
            let relative =
                Quaternion::new(p[0], p[1], p[2], p[3]).conjugate() * Quaternion::new(q[0], q[1], q[2], q[3]);
            2.0 * relative.vector.norm_squared().sqrt().atan2(relative.scalar.abs())
        };
        let angle = |q: &[f64], p: &[f64]| {
            let way = q[1].atan2(q[0]) - p[1].atan2(p[0]);
            way.sin().atan2(way.cos())
        };
        let rest = &spring.rest[..];
        let length = |n: usize| (0..n).map(|k| (at[k] - rest[k]).powi(2)).sum::<f64>().sqrt();
        let ways = match body.joint {
            Joint::Spherical => vec![turn(&at, rest)],
            Joint::FreeFlyer => vec![length(3), turn(&at[3..], &rest[3..])],
            Joint::Planar => vec![length(2), angle(&at[2..], &rest[2..]).abs()],
            Joint::Translation => vec![length(3)],
            Joint::Continuous { .. } => vec![angle(&at, rest)],
            _ => vec![at[0] - rest[0]],
        };
        let [k0, k1, k2] = spring.stiffness;
        for r in ways {
            energy += k0 * r.powi(2) / 2.0 + k1 * r.powi(3) / 3.0 + k2 * r.powi(4) / 4.0;
        }
    }
    energy
}

/// The energy of the weights that are carried.
fn carried_energy(model: &Model, q: &[f64]) -> f64 {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let energy = |carried: &condyle_dynamics::GravityCompensation| {
        let X: Se3<f64> = placements.body(carried.body);
        model.gravity().dot(X.rotation * carried.mass_com + X.translation.scale(carried.mass))
    };
    model.gravity_compensation().iter().map(energy).sum()
}

/// Efforts of springs and of gravity compensation are minus the slope of an energy.
#[test]
fn springs_have_an_energy() {
    let step = 1e-6;
    for (seed, tree) in (0..10).map(|seed| (seed, Tree::random_with_mimics(&mut rng(seed)))) {
        let model = tree.build();
        let (q, nv) = (random_configuration(&model, &mut rng(seed)), model.nv());
        let mut tau = vec![f64::NAN; nv];
        passive_torque(&model, &q, &vec![0.0; nv], SMOOTHING, &mut tau);
        let energy = |q: &[f64]| spring_energy(&model, q) + carried_energy(&model, q);
        let slope = |k: usize| {
            let way = |h: f64| -> Vec<f64> { common::unit(nv, k).iter().map(|x| h * x).collect() };
            (energy(&moved(&model, &q, &way(step))) - energy(&moved(&model, &q, &way(-step)))) / (2.0 * step)
        };
        let expected: Vec<f64> = (0..nv).map(|k| -slope(k)).collect();
        assert!(common::relative(&tau, &expected) < 1e-7, "{model}");
    }
}

/// With springs and carried weights, but without losses, a simulation keeps the energy: to the order of its integrator.
#[test]
fn simulations_keep_the_energy_of_springs() {
    let mut builder = ModelBuilder::new("springs");
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let axis = Vec3::new(0.6, 0.0, 0.8);
    let joints =
        [Joint::FreeFlyer, Joint::Revolute { axis }, Joint::Spherical, Joint::Prismatic { axis }, Joint::Planar];
    let mut parent = WORLD;
    for (k, joint) in joints.into_iter().enumerate() {
        let name = format!("{k}");
        let options = JointOptions { armature: 0.3, ..JointOptions::default() };
        parent = builder.body_with((&name, &name), parent, joint, Se3::identity(), I, options);
        builder.compensate_gravity(parent, Se3::identity(), I, 0.5);
        let rest = match joint {
            Joint::FreeFlyer => &[0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8][..],
            Joint::Spherical => &[0.0, 0.6, 0.0, 0.8],
            Joint::Planar => &[0.1, 0.2, 0.6, 0.8],
            _ => &[0.3],
        };
        builder.spring(parent, [20.0, 5.0, 3.0], rest);
    }
    let model = builder.build().expect("it is well-formed");
    let v: Vec<f64> = normal(&mut rng(1), model.nv()).iter().map(|v| 0.5 * v).collect();
    for (integrator, dt, bound) in [(Integrator::RungeKutta4, 1e-3, 1e-7), (Integrator::Variational, 1e-3, 1e-3)] {
        let settings = Settings { integrator, dt, passive: Some(SMOOTHING), ..Settings::default() };
        let (mut data, mut simulation) = (Data::new(&model), Simulation::new(&model, settings));
        simulation.set_state(&neutral(&model), &v).unwrap();
        let mut energy = |simulation: &Simulation| {
            let q = simulation.q();
            let mechanical = forward_velocities(&model, &mut data, q, simulation.v()).mechanical_energy();
            mechanical + spring_energy(&model, q) + carried_energy(&model, q)
        };
        let start = energy(&simulation);
        let mut kinetic = 0.0_f64;
        for _ in 0..20 {
            assert!(simulation.run(100, |_| {}).is_done());
            assert!(
                (energy(&simulation) - start).abs() < bound * start.abs(),
                "{integrator:?}: {}",
                energy(&simulation) - start
            );
            kinetic = kinetic.max(simulation.v().iter().map(|v| v * v).sum());
        }
        assert!(kinetic > 10.0 * v.iter().map(|v| v * v).sum::<f64>()); // the springs have moved it
    }
}

/// Dynamics is the same with damping and friction as without.
#[test]
fn acts_only_where_asked_for() {
    let (with, without) = (chain(true), chain(false));
    let State { q, v, a, tau, .. } = State::random(&with, &mut rng(1));
    let (mut data, mut other) = (Data::new(&with), Data::new(&without));
    assert_eq!(rnea(&with, &mut data, &q, &v, &a, &[]), rnea(&without, &mut other, &q, &v, &a, &[]));
    assert_eq!(aba(&with, &mut data, &q, &v, &tau, &[]), aba(&without, &mut other, &q, &v, &tau, &[]));
}

/// In a simulation that is asked to, friction stops a sliding body where it should, and energy only falls.
#[test]
fn simulations_lose_energy() {
    const DT: f64 = 1e-3;
    let mut builder = ModelBuilder::new("sledge");
    let joint = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
    let losses = JointOptions { friction: 4.0, ..JointOptions::default() };
    let I = Inertia::from_com(2.0, Vec3::zero(), Sym3::zero());
    builder.body_with(("sledge", "rail"), WORLD, joint, Se3::identity(), I, losses);
    let sledge = builder.build().expect("it is well-formed");
    for integrator in [Integrator::SemiImplicitEuler, Integrator::RungeKutta4, Integrator::Variational] {
        let lossless = Settings { integrator, dt: DT, ..Settings::default() };
        let lossy = Settings { passive: Some(SMOOTHING), ..lossless };
        let slide = |settings| {
            let mut simulation = Simulation::new(&sledge, settings);
            simulation.set_state(&[0.0], &[3.0]).unwrap();
            assert!(simulation.run(2000, |_| {}).is_done());
            (simulation.q()[0], simulation.v()[0])
        };
        let (way, speed): (f64, f64) = slide(lossless);
        assert!((way - 6.0).abs() < 1e-9 && (speed - 3.0).abs() < 1e-9); // not asked for
        let (way, speed): (f64, f64) = slide(lossy);
        assert!((way - 3.0 * 3.0 / (2.0 * 4.0 / 2.0)).abs() < 5e-3); // v²/(2 f/m), after 1.5 s
        assert!(speed.abs() < 1e-3);
        let model = chain(true);
        let State { q, v, .. } = State::random(&model, &mut rng(2));
        let mut data = Data::new(&model);
        let mut simulation = Simulation::new(&model, lossy);
        simulation.set_state(&q, &v).unwrap();
        let mut last = f64::INFINITY;
        for _ in 0..20 {
            let now = forward_velocities(&model, &mut data, simulation.q(), simulation.v()).mechanical_energy();
            assert!(now < last, "{integrator:?}");
            last = now;
            assert!(simulation.run(50, |_| {}).is_done());
        }
    }
}

#[test]
#[should_panic(expected = "tau: expected 5 numbers, found 4")]
fn wrong_shape() {
    let model = chain(true);
    passive_torque(&model, &neutral(&model), &[0.0; 5], SMOOTHING, &mut [0.0; 4]);
}

#[test]
#[should_panic(expected = "smoothing: expected a positive speed, found 0")]
fn no_smoothing() {
    let model = chain(true);
    passive_torque(&model, &neutral(&model), &[0.0; 5], 0.0, &mut [0.0; 5]);
}

#[test]
#[should_panic(expected = "dtau_dv: expected 5 × 5, found (5, 1)")]
fn wrong_shape_of_slopes() {
    let (model, mut dq, mut dv) = (chain(true), DMatrix::zeros(5, 5), DMatrix::zeros(5, 1));
    passive_torque_derivatives(&model, &neutral(&model), &[0.0; 5], SMOOTHING, &mut dq, &mut dv);
}
