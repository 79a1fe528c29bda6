//! Tests of integrators: the order of each method, and the quantities that each method conserves.

use crate::common::{self, State as Random, Tree, lift, moved, normal, relative, rng};
use crate::counting::allocations;
use condyle_dynamics::simulation::{Integrator, Settings, Simulation, State, Status};
use condyle_dynamics::{
    Act, Data, Force, Inertia, Joint, JointOptions, Model, ModelBuilder, Se3, Sym3, Vec3, WORLD, difference,
    forward_kinematics, forward_velocities, joint_torque_regressor, kinetic_energy_regressor, lie, neutral,
    passive_torque, potential_energy_regressor, robots,
};
use num_dual::Dual64;
use std::sync::Arc;

const ALL: [(Integrator, f64); 3] =
    [(Integrator::SemiImplicitEuler, 1.0), (Integrator::RungeKutta4, 4.0), (Integrator::Variational, 2.0)];

/// Tolerance of an observed order. At these step lengths h, error terms of higher order in h still have an effect.
const ORDER: f64 = 0.15;
/// Tolerance of sums over all bodies and some thousand steps, relative to the largest number.
const ROUNDING: f64 = 1e-10;

fn settings(integrator: Integrator, dt: f64) -> Settings {
    Settings { integrator, dt, ..Settings::default() }
}

/// Returns the position and the velocity of the robot after a simulation of the given time without efforts.
fn simulate(model: &Model, settings: Settings, (q, v): (&[f64], &[f64]), time: f64) -> (Vec<f64>, Vec<f64>) {
    let mut simulation = Simulation::new(model, settings);
    simulation.set_state(q, v).unwrap();
    let steps = (time / settings.dt).round() as usize;
    assert_eq!(simulation.run(steps, |_| {}), Status::Done);
    assert!((simulation.time() - time).abs() < 1e-9);
    (simulation.q().to_vec(), simulation.v().to_vec())
}

/// Returns the distance between two states.
fn distance(model: &Model, (q, v): (&[f64], &[f64]), (q_other, v_other): (&[f64], &[f64])) -> f64 {
    let mut d = vec![0.0; model.nv()];
    difference(model, q_other, q, &mut d);
    d.iter().map(|d| d * d).chain(v.iter().zip(v_other).map(|(a, b)| (a - b).powi(2))).sum::<f64>().sqrt()
}

/// Creates two hanging rods of 1 m and 1 kg.
fn double_pendulum(options: &JointOptions) -> Model {
    let axis = Vec3::new(0.0, 1.0, 0.0);
    let rod = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -0.5), Sym3 { zz: 0.001, ..Sym3::diagonal(1.0 / 12.0) });
    let mut builder = ModelBuilder::new("double pendulum");
    let elbow = Se3 { translation: Vec3::new(0.0, 0.0, -1.0), ..Se3::identity() };
    let joint = Joint::Revolute { axis };
    let upper = builder.body_with(("upper", "shoulder"), WORLD, joint, Se3::identity(), rod, options.clone());
    builder.body_with(("lower", "elbow"), upper, joint, elbow, rod, options.clone());
    builder.build().expect("it is well-formed")
}

/// Creates a symmetric body that moves freely in free space. Two of its principal moments of inertia are equal (A), the
/// third is C.
fn top() -> Model {
    let mut builder = ModelBuilder::new("top");
    builder.gravity(Vec3::zero());
    let moments = Sym3 { zz: 0.5, ..Sym3::diagonal(0.3) };
    builder.body("top", WORLD, Joint::FreeFlyer, Se3::identity(), Inertia::from_com(2.0, Vec3::zero(), moments));
    builder.build().expect("it is well-formed")
}

/// Returns the observed order: log₂ of the factor by which the error falls if the step length is halved.
fn observed_order(coarse: f64, fine: f64) -> f64 {
    (coarse / fine).log2()
}

/// Checks that the error falls according to the order of the method if the step length dt is halved.
fn check_order(what: &str, order: f64, dt: f64, error: impl Fn(f64) -> f64) {
    let (coarse, fine) = (error(dt), error(dt / 2.0));
    let observed = observed_order(coarse, fine);
    println!("{what}: order {observed:.3}, error {fine:.1e} at h = {}", dt / 2.0);
    assert!((observed - order).abs() < ORDER, "{what}: {observed}");
}

/// Checks the order of each integrator on a free symmetric body. The motion of this body has a closed form: with the
/// angular momentum L = I ω and the principal moments A, A and C, the attitude at time t is exp(t L/A) exp(t ω₃(1 −
/// C/A) e₃).
#[test]
fn order_on_a_free_body() {
    let model = top();
    let q = neutral(&model);
    let v = [0.3, -0.2, 0.5, 1.0, 0.0, 2.0];
    let (A, C, time) = (0.3, 0.5, 1.0);
    let precession = lie::exp3(Vec3::new(v[3], 0.0, v[5] * C / A).scale(time));
    let spin = lie::exp3(Vec3::new(0.0, 0.0, v[5] * (1.0 - C / A) * time));
    let attitude = precession * spin;
    let (R, u) = (attitude.to_rotation(), attitude.vector);
    let linear = R.transpose_mul(Vec3::new(v[0], v[1], v[2])); // the same velocity, in body coordinates
    let angular = spin.to_rotation().transpose_mul(Vec3::new(v[3], 0.0, v[5]));
    let expected_q = [v[0] * time, v[1] * time, v[2] * time, u.x, u.y, u.z, attitude.scalar];
    let expected_v: Vec<f64> = linear.to_array().into_iter().chain(angular.to_array()).collect();
    for (integrator, order) in ALL {
        let error = |dt| {
            let (q, v) = simulate(&model, settings(integrator, dt), (&q, &v), time);
            distance(&model, (&q, &v), (&expected_q, &expected_v))
        };
        let dt = if integrator == Integrator::SemiImplicitEuler { 1e-3 } else { 0.02 };
        check_order(&format!("{integrator:?} on a free body"), order, dt, error);
    }
}

/// Checks the order of each integrator on random trees, compared with fine steps. The trees have every type of joint,
/// mimic joints, efforts, external forces, damping and friction.
#[test]
fn order_on_trees() {
    let losses = JointOptions { damping: 0.2, friction: 0.3, armature: 0.1, ..JointOptions::default() };
    let [tree, mimics] = [Tree::random(&mut rng(0)), Tree::random_with_mimics(&mut rng(1))];
    let [tree, mimics] = [tree, mimics].map(|tree| Tree { smooth: true, ..tree });
    for (seed, model) in [tree.build(), mimics.build(), double_pendulum(&losses)].into_iter().enumerate() {
        let mut random = rng(seed as u64);
        let Random { q, v, tau, f_ext, .. } = Random::random(&model, &mut random);
        let v: Vec<f64> = v.iter().map(|v| 0.3 * v).collect();
        let end = |integrator, dt: f64| {
            let settings = Settings { passive: Some(0.5), ..settings(integrator, dt) };
            let mut simulation = Simulation::new(&model, settings);
            simulation.set_state(&q, &v).unwrap();
            for _ in 0..(0.16 / dt).round() as usize {
                assert!(simulation.step(&tau, &f_ext).is_done());
            }
            (simulation.q().to_vec(), simulation.v().to_vec())
        };
        let (q_end, v_end) = end(Integrator::RungeKutta4, 1e-4);
        for (integrator, order) in ALL {
            let error = |dt| {
                let (q, v) = end(integrator, dt);
                distance(&model, (&q, &v), (&q_end, &v_end))
            };
            let dt = match integrator {
                Integrator::SemiImplicitEuler => 2e-4,
                Integrator::RungeKutta4 => 4e-3,
                _ => 1e-3,
            };
            check_order(&format!("{integrator:?} on a tree"), order, dt, error);
        }
    }
}

/// Checks the period of a pendulum with a large angle θ₀, which is 4 K(sin(θ₀/2)) √(I/(m g l)). m is the mass, l its
/// distance from the hinge, and I the inertia about the hinge. The arithmetic-geometric mean gives the elliptic
/// integral K.
#[test]
fn period_of_a_pendulum() {
    let mut builder = ModelBuilder::new("pendulum");
    let joint = Joint::Continuous { axis: Vec3::new(0.0, 1.0, 0.0) };
    let I = Inertia::from_com(1.0, Vec3::new(0.0, 0.0, -1.0), Sym3::diagonal(0.0));
    builder.body("bob", WORLD, joint, Se3::identity(), I);
    let model = builder.build().expect("it is well-formed");
    let swing = 2.5f64;
    let (mut a, mut b) = (1.0, (swing / 2.0).cos());
    for _ in 0..6 {
        (a, b) = ((a + b) / 2.0, f64::sqrt(a * b));
    }
    let period = core::f64::consts::TAU / a / 9.81f64.sqrt();
    let start = [swing.cos(), swing.sin()];
    for (integrator, order) in ALL {
        let error = |steps: f64| {
            let (q, v) = simulate(&model, settings(integrator, period / steps), (&start, &[0.0]), period);
            distance(&model, (&q, &v), (&start, &[0.0]))
        };
        let observed = observed_order(error(1000.0), error(2000.0));
        println!("{integrator:?}: order {observed:.3} on a pendulum, error {:.1e}", error(2000.0));
        assert!(observed > order - ORDER, "{integrator:?}: {observed}"); // Euler's errors of order 1 cancel in a period
    }
}

/// Checks that the energy of the variational integrator oscillates but does not drift, over 400 s of a chaotic double
/// pendulum.
#[test]
fn energy_does_not_drift() {
    let model = double_pendulum(&JointOptions::default());
    let mut data = Data::new(&model);
    let (q, v) = ([1.2, -0.7], [0.0, 0.0]);
    let mut energy = |q: &[f64], v: &[f64]| forward_velocities(&model, &mut data, q, v).mechanical_energy();
    let start = energy(&q, &v);
    let mut simulation = Simulation::new(&model, settings(Integrator::Variational, 5e-3));
    simulation.set_state(&q, &v).unwrap();
    let mut largest = [0.0; 4]; // one entry for each quarter of 400 s
    for largest in &mut largest {
        for _ in 0..20_000 {
            assert!(simulation.step(&[0.0; 2], &[]).is_done());
            let error: f64 = energy(simulation.q(), simulation.v()) - start;
            *largest = error.abs().max(*largest);
        }
    }
    println!("energy error in each 100 s: {largest:.4?} J of {start:.1} J");
    assert!(largest.iter().all(|&x| x < 1.2 * largest[0] && x < 2e-2));
}

/// Checks that the variational step is symmetric. After the velocity is reversed, a second step must undo the first
/// step, up to rounding. The test reverses the velocity, because negative time steps are rejected.
#[test]
fn variational_steps_are_symmetric() {
    for seed in 0..4 {
        let mut random = rng(seed);
        let model = Tree::random_with_mimics(&mut random).build();
        let Random { q, v, tau, f_ext, .. } = Random::random(&model, &mut random);
        let mut simulation = Simulation::new(&model, settings(Integrator::Variational, 1e-3));
        simulation.set_state(&q, &v).unwrap();
        assert!(simulation.step(&tau, &f_ext).is_done());
        let (there, back) = (simulation.q().to_vec(), simulation.v().iter().map(|v| -v).collect::<Vec<_>>());
        simulation.set_state(&there, &back).unwrap();
        assert!(simulation.step(&tau, &f_ext).is_done());
        let begin: Vec<f64> = v.iter().map(|v| -v).collect();
        assert!(distance(&model, (simulation.q(), simulation.v()), (&q, &begin)) < 1e-9, "seed {seed}");
    }
}

/// Checks that Newton's method doubles the number of correct digits in each iteration. This requires the exact
/// derivative of the equation.
#[test]
fn variational_steps_converge_quadratically() {
    let trees = (0..8).map(|seed| Tree { smooth: true, ..Tree::random_with_mimics(&mut rng(seed)) }.build());
    let damped = double_pendulum(&JointOptions { damping: 5.0, ..JointOptions::default() });
    for (seed, model) in trees.chain([damped]).enumerate() {
        let Random { q, v, tau, f_ext, .. } = Random::random(&model, &mut rng(seed as u64));
        let iterations = |tolerance: f64| {
            let takes = |&max_iterations: &usize| {
                let variational = settings(Integrator::Variational, 0.1);
                let settings = Settings { passive: Some(1.0), tolerance, max_iterations, ..variational };
                let mut simulation = Simulation::new(&model, settings);
                simulation.set_state(&q, &v).unwrap();
                simulation.step(&tau, &f_ext).is_done()
            };
            (1..50).find(takes).expect("it converges")
        };
        let (half, all) = (iterations(1e-5), iterations(1e-10));
        assert!(all <= half + 1, "{half} iterations to 1e-5, {all} to 1e-10, on\n{model}");
    }
}

/// Checks that time steps that are negative, zero or not finite are rejected.
#[test]
fn time_runs_forwards() {
    let arm = robots::arm7();
    for dt in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        let run = || Simulation::<f64>::new(&arm, settings(Integrator::RungeKutta4, dt)).run(1, |_| ());
        let said = std::panic::catch_unwind(run).unwrap_err().downcast::<String>().unwrap();
        assert_eq!(*said, format!("settings.dt: expected a finite number above 0, found {dt}"));
    }
}

/// Returns the momentum of a robot in the world's frame, about the origin of the world.
fn momentum(model: &Model, data: &mut Data<f64>, q: &[f64], v: &[f64]) -> [f64; 6] {
    let velocities = forward_velocities(model, data, q, v);
    let of = |i: usize| {
        let oXb = velocities.body(i);
        oXb.act(model.bodies()[i].inertia * velocities.body_velocity(i, condyle_dynamics::ReferenceFrame::Local))
    };
    (1..model.bodies().len()).fold(Force::zero(), |sum, i| sum + of(i)).to_array()
}

/// Checks that the momentum of a free robot without gravity is constant, for any motion of the joints.
#[test]
fn momentum_is_conserved() {
    let model = robots::humanoid().with_gravity(Vec3::zero()).unwrap();
    let mut data = Data::new(&model);
    let (q, v) = (neutral(&model), normal(&mut rng(3), model.nv()));
    let efforts = normal(&mut rng(4), model.nv());
    let start = momentum(&model, &mut data, &q, &v);
    let mut error = |integrator, dt: f64| {
        let mut simulation = Simulation::new(&model, settings(integrator, dt));
        simulation.set_state(&q, &v).unwrap();
        let status = simulation.run((0.5 / dt).round() as usize, |now| {
            for k in 6..now.tau.len() {
                now.tau[k] = 0.1 * efforts[k] - 0.05 * now.v[k];
            }
        });
        assert!(status.is_done());
        relative(&momentum(&model, &mut data, simulation.q(), simulation.v()), &start)
    };
    let found = error(Integrator::Variational, 1e-3);
    println!("change of momentum by the variational integrator: {found:.1e}");
    assert!(found < ROUNDING, "{found:.1e}");
    let (coarse, fine) = (error(Integrator::RungeKutta4, 2e-3), error(Integrator::RungeKutta4, 1e-3));
    assert!(fine < 1e-6 && observed_order(coarse, fine) > 3.5, "{coarse:.1e} {fine:.1e}");
}

/// Checks that the centre of mass of a falling humanoid follows a parabola, for any motion of the joints.
#[test]
fn centre_of_mass_falls_along_a_parabola() {
    let model = robots::humanoid();
    let mut data = Data::new(&model);
    let (q, v) = (neutral(&model), normal(&mut rng(5), model.nv()));
    let g = *model.gravity();
    let com = |data: &mut Data<f64>, q: &[f64]| {
        let placements = forward_kinematics(&model, data, q);
        let moment = (1..model.bodies().len()).fold(Vec3::zero(), |sum: Vec3<f64>, i| {
            let I = model.bodies()[i].inertia;
            let X = placements.body(i);
            sum + X.translation.scale(I.mass) + X.rotation * I.mass_com
        });
        moment.scale(1.0 / model.total_mass())
    };
    let (start, P) = (com(&mut data, &q), momentum(&model, &mut data, &q, &v));
    let speed = Vec3::new(P[0], P[1], P[2]).scale(1.0 / model.total_mass());
    let time = 0.5;
    let expected = start + speed.scale(time) + g.scale(0.5 * time * time);
    for (integrator, order) in ALL {
        let mut error = |dt| {
            let (q, _) = simulate(&model, settings(integrator, dt), (&q, &v), time);
            (com(&mut data, &q) - expected).norm_squared().sqrt()
        };
        let (coarse, fine) = (error(2e-3), error(1e-3));
        println!("{integrator:?}: the centre of mass is {fine:.1e} m off the parabola");
        assert!(fine < 0.05 && observed_order(coarse, fine) > order - 0.5, "{integrator:?}: {coarse:.1e} {fine:.1e}");
    }
}

/// Checks that an external force on a body acts like the equivalent joint efforts.
#[test]
fn external_forces_act() {
    for (integrator, _) in ALL {
        let model = top();
        let mut simulation = Simulation::new(&model, settings(integrator, 1e-3));
        assert!(simulation.run(1000, |now| now.f_ext[1].linear.y = 4.0).is_done()); // acceleration of 2 m/s² for 1 s
        let (way, speed): (f64, f64) = (simulation.q()[1], simulation.v()[1]);
        assert!((speed - 2.0).abs() < 1e-9 && (way - 1.0).abs() < 2e-3);
        let by_force = simulation.q().to_vec();
        simulation.set_state(&neutral(&model), &[0.0; 6]).unwrap();
        for _ in 0..1000 {
            assert!(simulation.step(&[0.0, 4.0, 0.0, 0.0, 0.0, 0.0], &[]).is_done());
        }
        assert!(relative(simulation.q(), &by_force) < ROUNDING);
    }
}

/// Checks that an invalid state is rejected with the joint and the invalid numbers, and that the previous state is
/// kept.
#[test]
fn invalid_states_are_refused() {
    let quadruped = robots::quadruped();
    let mut simulation = Simulation::new(&quadruped, Settings::default());
    let (q, v) = (neutral(&quadruped), [0.0; 18]);
    for (scale, length) in [(1.1, "1.1"), (2.0, "2"), (0.0, "0"), (f64::NAN, "NaN")] {
        let mut bad = q.clone();
        bad[6] *= scale;
        let said = simulation.set_state(&bad, &v).unwrap_err().to_string();
        let expected = if scale.is_nan() {
            "joint `root_joint`: q[6] is NaN, which is not finite".to_owned()
        } else {
            format!("joint `root_joint`: its rotation, q[3..7], has the length {length}, expected 1")
        };
        assert_eq!(said, expected);
    }
    let mut fast = v;
    fast[7] = f64::INFINITY;
    let said = simulation.set_state(&q, &fast).unwrap_err().to_string();
    assert_eq!(said, "joint `LF_HFE`: v[7] is inf, which is not finite");
    assert_eq!((simulation.q(), simulation.v()), (&q[..], &v[..]));
}

/// Checks that a simulation shares its model, can be cloned, and continues from a stored state with the same bits.
#[test]
fn simulations_are_values() {
    fn shared<T: Clone + Send + Sync + 'static>(_: &T) {}
    let arm = Arc::new(robots::arm7());
    for (integrator, _) in ALL {
        let mut simulation = Simulation::<f64>::new(Arc::clone(&arm), settings(integrator, 1e-3));
        shared(&simulation);
        assert!(Arc::ptr_eq(simulation.model(), &arm));
        assert!(simulation.run(10, |now| now.tau.fill(0.3)).is_done());
        let (state, mut twin) = (simulation.state(), simulation.clone());
        let mut restored = Simulation::new(robots::arm7(), settings(integrator, 1e-3));
        restored.restore(&state).unwrap();
        for simulation in [&mut simulation, &mut twin, &mut restored] {
            assert!(simulation.run(10, |now| now.tau.fill(0.3)).is_done());
        }
        let end = simulation.state();
        assert_eq!((&twin.state(), &restored.state()), (&end, &end));
        let short = State { q: vec![0.0; 6], ..end.clone() };
        assert_eq!(restored.restore(&short).unwrap_err().to_string(), "state.q: expected 7 entries, found 6");
        assert_eq!(restored.state(), end);
    }
    assert_eq!(Status::Done.to_string(), "done");
    let said = Status::NotConverged { iterations: 3 }.to_string();
    assert_eq!(said, "Newton's method did not converge in 3 iterations; the step was not taken");
}

/// Checks that a failed step keeps the state and reports the reason.
#[test]
fn failures_are_typed() {
    let model = robots::arm7();
    let state = Random::random(&model, &mut rng(1));
    let mut simulation = Simulation::new(&model, settings(Integrator::Variational, 1e-3));
    simulation.set_state(&state.q, &state.v).unwrap();
    simulation.settings.max_iterations = 1;
    assert_eq!(simulation.step(&state.tau, &[]), Status::NotConverged { iterations: 1 });
    assert_eq!((simulation.q(), simulation.v(), simulation.time()), (&state.q[..], &state.v[..], 0.0));
    simulation.settings.max_iterations = 20;
    for (integrator, _) in ALL {
        simulation.settings.integrator = integrator;
        simulation.set_state(&state.q, &state.v).unwrap();
        let status = simulation.run(3, |now| now.tau.fill(f64::MAX));
        assert!(!status.is_done(), "{integrator:?}");
        assert_eq!((simulation.q(), simulation.v(), simulation.time()), (&state.q[..], &state.v[..], 0.0));
    }
}

/// Checks that a step on dual numbers gives the derivatives of the step.
#[test]
fn a_step_can_be_differentiated() {
    const STEP: f64 = 1e-5; // step of central differences that balances rounding and curvature errors
    const DIFFERENCES: f64 = 1e-7;
    let mut random = rng(7);
    let model = Tree::random_with_mimics(&mut random).build();
    let Random { q, v, tau, .. } = Random::random(&model, &mut random);
    let (dq, dv) = (normal(&mut random, model.nv()), normal(&mut random, model.nv()));
    for (integrator, _) in ALL {
        let mut simulation = Simulation::<Dual64>::new(&model, settings(integrator, 1e-2));
        let direction: Vec<Dual64> = dq.iter().map(|&d| Dual64::new(0.0, d)).collect();
        simulation.set_state(&moved(&model, &lift(&q), &direction), &common::dual(&v, &dv)).unwrap();
        assert!(simulation.step(&lift(&tau), &[]).is_done());
        let found = common::eps(simulation.v());
        let end = |s: f64| {
            let scaled = |d: &[f64]| d.iter().map(|d| d * s).collect::<Vec<_>>();
            let mut simulation = Simulation::new(&model, settings(integrator, 1e-2));
            let v: Vec<f64> = v.iter().zip(&dv).map(|(v, d)| v + s * d).collect();
            simulation.set_state(&moved(&model, &q, &scaled(&dq)), &v).unwrap();
            assert!(simulation.step(&tau, &[]).is_done());
            simulation.v().to_vec()
        };
        let (ahead, behind) = (end(STEP), end(-STEP));
        let expected: Vec<f64> = ahead.iter().zip(&behind).map(|(a, b)| (a - b) / (2.0 * STEP)).collect();
        let error = relative(&found, &expected);
        assert!(error < DIFFERENCES, "{integrator:?}: {error:.1e}");
    }
}

#[test]
#[should_panic(expected = "tau: expected 7 numbers, found 6")]
fn wrong_shape() {
    let arm = robots::arm7();
    let _ = Simulation::new(&arm, Settings::default()).step(&[0.0; 6], &[]);
}

/// Checks that steps, runs, regressors and passive torques do not allocate memory after construction.
#[test]
fn nothing_is_allocated() {
    for (seed, model) in common::all_models(1).iter().enumerate() {
        let Random { q, v, a, tau, f_ext } = Random::random(model, &mut rng(seed as u64));
        for (integrator, _) in ALL {
            let settings = Settings { passive: Some(0.1), ..settings(integrator, 1e-4) };
            let mut simulation = Simulation::new(model, settings);
            let count = allocations(|| {
                simulation.set_state(&q, &v).unwrap();
                let _ = simulation.step(&tau, &f_ext);
                let _ = simulation.run(3, |now| now.tau.fill(0.1));
            });
            assert_eq!(count, 0, "{integrator:?} on\n{model}");
        }
        let (mut data, mut out) = (Data::new(model), vec![0.0; model.nv()]);
        let count = allocations(|| {
            joint_torque_regressor(model, &mut data, &q, &v, &a);
            kinetic_energy_regressor(model, &mut data, &q, &v);
            potential_energy_regressor(model, &mut data, &q);
            passive_torque(model, &q, &v, 0.1, &mut out);
        });
        assert_eq!(count, 0, "on\n{model}");
    }
}

/// Checks that a step to a position that is not finite is not taken, even if the velocity is still finite.
#[test]
fn positions_stay_finite() {
    let quadruped = robots::quadruped();
    for (integrator, _) in ALL {
        let mut simulation = Simulation::new(&quadruped, settings(integrator, 1e-3));
        let q: Vec<f64> = neutral(&quadruped);
        simulation.set_state(&q, &[1e80; 18]).unwrap();
        let status = simulation.step(&[0.0; 18], &[]);
        assert!(!status.is_done() && simulation.q() == q, "{integrator:?}: {status}");
    }
}

#[test]
fn states_that_cannot_be_restored() {
    let mut simulation = Simulation::<f64>::new(robots::arm7(), Settings::default());
    simulation.set_ground(condyle_dynamics::simulation::Ground::at_frames([5])).unwrap();
    let good = simulation.state();
    let bad = State { impulses: vec![0.0, f64::INFINITY, 0.0], ..good.clone() };
    assert_eq!(simulation.restore(&bad).unwrap_err().to_string(), "ground: impulses[1] is inf, which is not finite");
    assert_eq!(simulation.state(), good);
}
