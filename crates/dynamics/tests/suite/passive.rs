//! Damping and friction: they take power, they have the slope they say, and nobody adds them unasked.

use crate::common;

use common::{State, embedded, normal, rng};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    Data, Inertia, Joint, JointOptions, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, aba, forward_velocities,
    passive_torque, passive_torque_derivative, rnea,
};
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
            passive_torque(&model, &v, SMOOTHING, &mut tau);
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
        passive_torque(&model, &vec![speed; model.nv()], SMOOTHING, &mut tau);
        tau
    };
    assert!(torque(0.0).iter().all(|&x| x == 0.0));
    for (k, &tau) in torque(7.3 * SMOOTHING).iter().enumerate() {
        let expected = -model.damping()[k] * 7.3 * SMOOTHING - model.friction()[k];
        assert!((tau - expected).abs() <= 1e-6 * model.friction()[k] + ROUNDING); // as the documentation says
    }
    assert!(torque(0.3).iter().zip(torque(-0.3)).all(|(a, b)| *a == -b));
}

#[test]
fn slope_is_the_derivative() {
    let model = chain(true);
    for seed in 0..50 {
        let v: Vec<f64> = normal(&mut rng(seed), model.nv()).iter().map(|x| x * 2.0 * SMOOTHING).collect();
        let (mut slope, mut tau) = (vec![f64::NAN; model.nv()], vec![Dual64::from(0.0); model.nv()]);
        passive_torque_derivative(&model, &v, SMOOTHING, &mut slope);
        let dual: Vec<Dual64> = v.iter().map(|&v| Dual64::new(v, 1.0)).collect();
        passive_torque(&model, &dual, SMOOTHING, &mut tau);
        for (found, expected) in slope.iter().zip(&tau) {
            assert!((found - expected.eps).abs() < 100.0 * ROUNDING * (1.0 + expected.eps.abs()));
        }
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
    passive_torque(&chain(true), &[0.0; 5], SMOOTHING, &mut [0.0; 4]);
}

#[test]
#[should_panic(expected = "smoothing: expected a positive speed, found 0")]
fn no_smoothing() {
    passive_torque(&chain(true), &[0.0; 5], 0.0, &mut [0.0; 5]);
}
