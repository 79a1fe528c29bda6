//! Tests of passive efforts. Damping and friction must only remove power, and all derivatives must be exact. No other
//! function may add passive efforts.

use crate::common;

use common::{State, Worst, all_models, embedded, moved, normal, rng};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    Data, Inertia, Joint, JointOptions, Model, ModelBuilder, Quaternion, Se3, Sym3, Vec3, WORLD, aba,
    forward_velocities, neutral, passive_torque, passive_torque_derivatives, rnea,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance of a few rounding errors.
const ROUNDING: f64 = 1e-14;
const SMOOTHING: f64 = 0.01;

/// Creates a chain, with or without damping and friction at each joint.
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

/// Checks that friction follows Coulomb's law except at small speeds. The friction must be zero at rest, and odd in v.
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
        assert!((tau - expected).abs() <= 1e-6 * model.friction()[k] + ROUNDING); // the documented bound of the error
    }
    assert!(torque(0.3).iter().zip(torque(-0.3)).all(|(a, b)| *a == -b));
}

/// Checks the derivatives against dual numbers, for every type of joint and for mimic joints. The joints have springs,
/// polynomial damping, friction and gravity compensation.
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

/// Checks that friction acts on a free body along the axes of the world, for any orientation of the body.
#[test]
fn friction_of_a_free_joint() {
    let mut builder = ModelBuilder::new("box");
    let losses = JointOptions { friction: 2.0, ..JointOptions::default() };
    let I = Inertia::from_com(1.0, Vec3::zero(), Sym3::diagonal(0.1));
    builder.body_with(("box", "float"), WORLD, Joint::FreeFlyer, Se3::identity(), I, losses);
    let model = builder.build().expect("it is well-formed");
    let mut q = neutral(&model);
    q[3..].copy_from_slice(&[0.1, -0.5, 0.5, 0.7].map(|x: f64| x)); // a quaternion of length 1
    let R = Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation();
    let along = R.transpose_mul(Vec3::new(1.0, -1.0, 0.0)).to_array();
    let mut tau = [f64::NAN; 6];
    passive_torque(&model, &q, &[along[0], along[1], along[2], 0.0, 0.0, 0.0], SMOOTHING, &mut tau);
    let force = R * Vec3::new(tau[0], tau[1], tau[2]); // 2 N along each of the world's axes along which the body moves
    assert!((force - Vec3::new(-2.0, 2.0, 0.0)).norm_squared() < 1e-20, "{force:?}");
}

/// Checks that damping and friction do not change the results of dynamics, unless the caller adds passive efforts.
#[test]
fn acts_only_where_asked_for() {
    let (with, without) = (chain(true), chain(false));
    let State { q, v, a, tau, .. } = State::random(&with, &mut rng(1));
    let (mut data, mut other) = (Data::new(&with), Data::new(&without));
    assert_eq!(rnea(&with, &mut data, &q, &v, &a, &[]), rnea(&without, &mut other, &q, &v, &a, &[]));
    assert_eq!(aba(&with, &mut data, &q, &v, &tau, &[]), aba(&without, &mut other, &q, &v, &tau, &[]));
}

/// Checks a simulation with friction: a sliding body must stop at the expected point, and the energy must only
/// decrease.
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
        assert!((way - 6.0).abs() < 1e-9 && (speed - 3.0).abs() < 1e-9); // friction is switched off
        let (way, speed): (f64, f64) = slide(lossy);
        assert!((way - 3.0 * 3.0 / (2.0 * 4.0 / 2.0)).abs() < 5e-3); // v²/(2 f/m), reached after 1.5 s
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
