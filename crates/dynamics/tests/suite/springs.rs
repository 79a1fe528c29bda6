//! Tests of springs and gravity compensation: efforts, energies, and comparisons with MuJoCo.

use crate::common;

use common::{Tree, moved, normal, rng};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    Act, Body, Data, GravityCompensation, Inertia, Joint, JointOptions, Mimic, MjcfOptions, Model, ModelBuilder,
    Quaternion, Se3, Sym3, Vec3, WORLD, crba, forward_kinematics, forward_velocities, gravity, neutral,
    nonlinear_effects, passive_torque, passive_torque_derivatives, random_configuration,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

const SMOOTHING: f64 = 0.01;

/// Checks the rest position of all springs without gravity compensation: passive efforts must be 0, and derivatives
/// must be finite.
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

/// Checks that the spring of a follower acts on the displacement of the follower. The effort on the leader is the
/// spring's effort times the ratio.
#[test]
fn springs_of_followers() {
    const AXIS: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let (endless, hinge) = (Joint::Continuous { axis: AXIS }, Joint::Revolute { axis: AXIS });
    // Cases (leader, follower, rest position of the follower, ratio, turns). If the leader or the follower is a
    // continuous joint, `turns` is true: the follower's position is then known only up to full turns.
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

/// Checks the efforts of gravity compensation. If all weights are compensated, the passive efforts must equal the
/// efforts that hold the robot at rest. If half of each weight is compensated, the passive efforts must be half as
/// large.
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
                // Half of each body becomes a separate part with a compensation of 0, in a frame of its own.
                let X = Se3 { translation: Vec3::new(0.3, -0.2, 0.5), ..Se3::identity() };
                builder.compensate_gravity(ids[i], 2.0 * factor);
                builder.compensate_gravity_of_part(ids[i], X, X.act_inv(body.inertia).scale(0.5), 0.0);
            }
            for (i, body) in model.bodies().iter().enumerate().skip(1) {
                if let Some(mimic) = body.mimic {
                    let leads = |b: &Body| b.mimic.is_none() && b.idx_v == body.idx_v;
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

/// Checks that efforts of gravity compensation are linear in the masses of the bodies, and that derivatives with
/// respect to a mass are exact.
#[test]
fn compensation_has_derivatives_with_respect_to_masses() {
    let model = like_mujoco();
    let q = random_configuration(&model, &mut rng(3));
    let efforts = |mass: f64| {
        let heavier =
            model.with_inertias(|i, I| Inertia { mass: I.mass + if i == 2 { mass } else { 0.0 }, ..I }).unwrap();
        let mut tau = vec![0.0; model.nv()];
        passive_torque(&heavier, &q, &vec![0.0; model.nv()], SMOOTHING, &mut tau);
        tau
    };
    let dual = model
        .with_inertias(|i, I| Inertia::<Dual64> {
            mass: Dual64::new(I.mass, if i == 2 { 1.0 } else { 0.0 }),
            ..I.lift()
        })
        .unwrap();
    let (q, zero) = (q.iter().map(|&q| Dual64::from(q)).collect::<Vec<_>>(), Dual64::from(0.0));
    let mut tau = vec![zero; model.nv()];
    passive_torque(&dual, &q, &vec![zero; model.nv()], SMOOTHING, &mut tau);
    let slope: Vec<f64> = tau.iter().map(|tau| tau.eps).collect();
    let expected: Vec<f64> = efforts(1.0).iter().zip(efforts(0.0)).map(|(a, b)| a - b).collect();
    assert!(slope.iter().any(|x| x.abs() > 1.0) && common::relative(&slope, &expected) < 1e-12, "{slope:?}");
}

/// Creates the robot of `passive.xml`, with the springs and the damping of MuJoCo, and the armature of its free joint.
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
    builder.compensate_gravity(base, 0.5);
    let I = full(1.5, Vec3::new(0.2, 0.0, 0.1), [0.1, 0.2, 0.15, 0.0, 0.0, 0.0]);
    let joint = Joint::Revolute { axis: Vec3::new(0.0, 1.0, 0.0) };
    let arm = builder.body_with(("arm", "hinge"), base, joint, at(0.3, 0.1, 0.0), I, options(0.1, 0.3, [0.2, 0.1]));
    builder.spring(arm, [3.0, 1.0, 0.5], &[0.4]);
    builder.compensate_gravity(arm, 1.0);
    let I = full(0.8, Vec3::new(0.05, 0.1, 0.0), [0.03, 0.02, 0.04, 0.0, 0.0, 0.0]);
    let ball = options(0.05, 0.2, [0.0, 0.4]);
    let wrist = builder.body_with(("wrist", "ball"), arm, Joint::Spherical, at(0.4, 0.0, 0.1), I, ball);
    builder.spring(wrist, [2.0, 0.7, 0.3], &[0.0, 0.0, 0.0, 1.0]);
    let I = full(0.5, Vec3::new(0.0, 0.05, 0.05), [0.01, 0.01, 0.01, 0.0, 0.0, 0.0]);
    let joint = Joint::Prismatic { axis: Vec3::new(1.0, 0.0, 0.0) };
    let tip = builder.body_with(("tip", "slide"), wrist, joint, at(0.0, 0.1, 0.2), I, options(0.0, 1.0, [0.0; 2]));
    builder.spring(tip, [40.0, 0.0, 9.0], &[-0.1]);
    builder.compensate_gravity(tip, 0.3);
    builder.build().expect("it is well-formed")
}

/// Checks that the inertia matrix M, the bias efforts and the passive efforts equal MuJoCo's results, for a robot from
/// a builder and for the robot read from the file.
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
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/passive.xml");
    let read = Model::from_mjcf(file, &MjcfOptions { strict: true, ..MjcfOptions::default() }).unwrap();
    assert_eq!(states.len(), 4);
    for (model, state) in [like_mujoco(), read].iter().flat_map(|model| states.iter().map(move |state| (model, state)))
    {
        let (mut data, mut tau) = (Data::new(model), vec![f64::NAN; model.nv()]);
        let [q, v, M, bias, passive] = ["q", "v", "M", "bias", "passive"].map(|name| numbers(&state[name]));
        assert!(common::relative(crba(model, &mut data, &q).as_slice(), &M) < 1e-12);
        assert!(common::relative(nonlinear_effects(model, &mut data, &q, &v), &bias) < 1e-12);
        passive_torque(model, &q, &v, SMOOTHING, &mut tau);
        assert!(common::relative(&tau, &passive) < 1e-12, "{tau:?}\n{passive:?}");
    }
}

/// Computes the energy of all springs. A spring with the effort τ and the coefficients k₀, k₁ and k₂ has the energy −∫
/// τ dr = k₀ r²/2 + k₁ r³/3 + k₂ r⁴/4. For a joint with one degree of freedom, r is the displacement. For other joints,
/// r is the length of the displacement vector.
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

/// Computes the potential energy of the compensated weights.
fn carried_energy(model: &Model, q: &[f64]) -> f64 {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    let energy = |carried: &GravityCompensation| {
        let X: Se3<f64> = placements.body(carried.body);
        let carried = carried.carried(model.bodies()[carried.body].inertia);
        model.gravity().dot(X.rotation * carried.mass_com + X.translation.scale(carried.mass))
    };
    model.gravity_compensation().iter().map(energy).sum()
}

/// Checks that the efforts of springs and of gravity compensation are the negative gradient of an energy.
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

/// Checks that a simulation with springs and gravity compensation, but without losses, conserves energy up to the error
/// of the integrator.
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
        builder.compensate_gravity(parent, 0.5);
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
        assert!(kinetic > 10.0 * v.iter().map(|v| v * v).sum::<f64>()); // the springs have moved the robot
    }
}
