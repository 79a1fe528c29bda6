//! Tests of the armature of free joints. In free space, armature must equal a mass at the origin of the body, in every
//! algorithm.

use crate::common;

use common::{State, Worst, rng};
use condyle_dynamics::simulation::{Integrator, Settings, Simulation};
use condyle_dynamics::{
    ConstraintSet, ContactConstraint, Data, DivideConquer, ForwardDynamicsMethod, Inertia, Joint, Model, ModelBuilder,
    Se3, Sym3, Vec3, WORLD, aba, aba_derivatives, aba_hessian, compute_all_terms, constrained_dynamics,
    constrained_dynamics_derivatives, constrained_inverse_dynamics, coriolis_derivatives, coriolis_matrix, crba,
    energy_derivatives, forward_dynamics, forward_velocities, gravity, impulse_dynamics_derivatives, minv,
    nonlinear_effects, rnea, rnea_derivatives, rnea_hessian, robots,
};

/// Tolerance between the same sums in different orders. For results with M⁻¹, `CONDITIONED` includes the condition
/// number of M.
const ROUNDING: f64 = 1e-11;
const CONDITIONED: f64 = 1e-8;
/// Apparent mass (kg).
const MASS: f64 = 2.5;

/// Returns two robots in free space. The base of the first robot has armature; the base of the second robot has an
/// additional mass instead.
fn pair(robot: &Model) -> [Model; 2] {
    let free = robot.clone().with_gravity(Vec3::zero()).unwrap();
    let nv = robot.nv();
    let armature = |linear: f64| -> Vec<f64> { (0..nv).map(|k| if k < 3 { linear } else { 0.1 }).collect() };
    let mass = Inertia::from_com(MASS, Vec3::zero(), Sym3::zero());
    let heavier = free.with_inertias(|body, I| if body == 1 { I + mass } else { I }).unwrap();
    [free.with_armature(&armature(MASS)).unwrap(), heavier.with_armature(&armature(0.0)).unwrap()]
}

/// Returns all numbers that the algorithms compute for a model: results without M⁻¹, and results with M⁻¹.
fn numbers(model: &Model, s: &State, frames: [&str; 2]) -> [Vec<f64>; 2] {
    let (State { q, v, a, tau, f_ext }, nv) = (s, model.nv());
    let data = &mut Data::new(model);
    let (mut sums, mut solved) = (Vec::new(), Vec::new());
    sums.extend_from_slice(rnea(model, data, q, v, a, f_ext));
    sums.extend_from_slice(nonlinear_effects(model, data, q, v));
    sums.extend_from_slice(crba(model, data, q).as_slice());
    sums.extend_from_slice(coriolis_matrix(model, data, q, v).as_slice());
    let d = coriolis_derivatives(model, data, q, v);
    [d.dq, d.dv].iter().for_each(|x| sums.extend_from_slice(x.as_slice()));
    let d = rnea_derivatives(model, data, q, v, a, f_ext);
    [d.dtau_dq, d.dtau_dv, d.dtau_da].iter().for_each(|x| sums.extend_from_slice(x.as_slice()));
    let d = rnea_hessian(model, data, q, v, a, f_ext, tau);
    [d.dqdq, d.dvdq, d.dvdv, d.dadq].iter().for_each(|x| sums.extend_from_slice(x.as_slice()));
    let terms = compute_all_terms(model, data, q, v);
    sums.push(terms.kinetic_energy);
    sums.extend_from_slice(terms.h);
    sums.push(forward_velocities(model, data, q, v).kinetic_energy());
    let d = energy_derivatives(model, data, q, v);
    [d.dT_dq, d.dT_dv].iter().for_each(|x| sums.extend_from_slice(x));

    solved.extend_from_slice(aba(model, data, q, v, tau, f_ext));
    for method in [ForwardDynamicsMethod::Dense, ForwardDynamicsMethod::Sparse] {
        solved.extend_from_slice(forward_dynamics(model, data, q, v, tau, f_ext, Some(method)));
    }
    solved.extend_from_slice(DivideConquer::new(model, 3).aba(model, q, v, tau, f_ext));
    solved.extend_from_slice(minv(model, data, q).as_slice());
    let d = aba_derivatives(model, data, q, v, tau, f_ext);
    [d.da_dq, d.da_dv, d.da_dtau].iter().for_each(|x| solved.extend_from_slice(x.as_slice()));
    let d = aba_hessian(model, data, q, v, tau, f_ext, a);
    [d.dqdq, d.dvdq, d.dvdv, d.dtaudq].iter().for_each(|x| solved.extend_from_slice(x.as_slice()));
    let contacts = frames.map(|name| ContactConstraint::point(model.frame(name).unwrap()));
    let set = &mut ConstraintSet::new(model, &contacts).unwrap();
    let d = constrained_dynamics(model, data, set, q, v, tau, f_ext);
    let (qdd, lambda) = (d.a.to_vec(), d.lambda.to_vec());
    solved.extend_from_slice(&qdd);
    solved.extend_from_slice(&lambda);
    let d = constrained_inverse_dynamics(model, data, set, q, v, &qdd, &lambda, f_ext);
    solved.extend_from_slice(d.tau);
    let d = constrained_dynamics_derivatives(model, data, set, q, v, tau, f_ext);
    [d.da_dq, d.da_dv, d.dlambda_dq, d.dlambda_dv].iter().for_each(|x| solved.extend_from_slice(x.as_slice()));
    let d = impulse_dynamics_derivatives(model, data, set, q, v, 0.3);
    [d.dv_dq, d.dv_dv, d.dlambda_dq].iter().for_each(|x| solved.extend_from_slice(x.as_slice()));
    assert_eq!(solved.len(), solved.iter().filter(|x| x.is_finite()).count());
    for integrator in [Integrator::SemiImplicitEuler, Integrator::RungeKutta4, Integrator::Variational] {
        let settings = Settings { integrator, dt: 1e-3, tolerance: 1e-12, ..Settings::default() };
        let mut simulation = Simulation::new(model, settings);
        simulation.set_state(q, v).unwrap();
        assert!(simulation.step(tau, f_ext).is_done() && simulation.step(&vec![0.0; nv], &[]).is_done());
        solved.extend_from_slice(simulation.q());
        solved.extend_from_slice(simulation.v());
    }
    [sums, solved]
}

/// Checks that armature in free space acts like a mass. The bodies are computed one by one, and also as limbs in
/// parallel lanes.
#[test]
fn in_free_space_it_is_a_mass() {
    let mut sums = Worst::new("armature of a base = mass", ROUNDING);
    let mut solved = Worst::new("the same, with M⁻¹", CONDITIONED);
    for (robot, frames) in [
        (robots::quadruped(), ["LF_foot", "RH_foot"]),
        (robots::quadruped().with_limbs(false), ["LF_foot", "RH_foot"]),
        (robots::humanoid(), ["left_sole", "right_sole"]),
    ] {
        let [apparent, heavy] = pair(&robot);
        assert_eq!(
            (apparent.limbs().is_some(), heavy.limbs().is_some()),
            (robot.limbs().is_some(), robot.limbs().is_some())
        );
        for seed in 0..5 {
            let state = State::random(&robot, &mut rng(seed));
            let ([a, b], [c, d]) = (numbers(&apparent, &state, frames), numbers(&heavy, &state, frames));
            sums.see(&robot, &a, &c);
            solved.see(&robot, &b, &d);
        }
    }
}

/// Checks that armature has no weight: the efforts of gravity do not depend on it.
#[test]
fn it_has_no_weight() {
    let quadruped = robots::quadruped();
    let heavier = quadruped.clone().with_armature(&[MASS; 18]).unwrap();
    let q = State::random(&quadruped, &mut rng(1)).q;
    let weight = gravity(&quadruped, &mut Data::new(&quadruped), &q).to_vec();
    assert_eq!(gravity(&heavier, &mut Data::new(&heavier), &q), weight);
}

/// Checks a free joint whose parent moves. The armature must resist motion relative to the parent, along the parent's
/// axes.
#[test]
fn on_a_body_that_moves() {
    let I = Inertia::from_com(1.0, Vec3::new(0.1, 0.2, 0.3), Sym3::diagonal(0.1));
    let mut builder = ModelBuilder::new("carousel");
    let table = builder.body("table", WORLD, Joint::Revolute { axis: Vec3::new(0.0, 0.0, 1.0) }, Se3::identity(), I);
    let at = Se3 { translation: Vec3::new(1.0, 0.0, 0.0), ..Se3::identity() };
    builder.body("cup", table, Joint::FreeFlyer, at, I);
    let model = builder.build().unwrap();
    let heavier = model.clone().with_armature(&[0.0, MASS, MASS, MASS, 0.0, 0.0, 0.0]).unwrap();
    let State { q, v, a, .. } = State::random(&model, &mut rng(1));
    let without = rnea(&model, &mut Data::new(&model), &q, &v, &a, &[]).to_vec();
    let with = rnea(&heavier, &mut Data::new(&heavier), &q, &v, &a, &[]).to_vec();
    let [linear, angular] = [1, 4].map(|k| Vec3::new(v[k], v[k + 1], v[k + 2]));
    let acceleration = Vec3::new(a[1], a[2], a[3]) + angular.cross(linear); // v̇ + ω × v
    assert!((with[0] - without[0]).abs() < 1e-12); // the armature does not act on the parent, a table
    for (k, x) in acceleration.to_array().into_iter().enumerate() {
        assert!((with[k + 1] - without[k + 1] - MASS * x).abs() < 1e-12);
        assert!((with[k + 4] - without[k + 4]).abs() < 1e-12);
    }
}

/// Checks that the armature of a free joint is the same number along all three linear axes, for models from any source.
#[test]
fn three_equal_numbers() {
    let quadruped = robots::quadruped();
    let mut armature = [0.0; 18];
    armature[..6].copy_from_slice(&[0.5, 0.5, 0.5, 0.1, 0.2, 0.3]);
    let good = quadruped.clone().with_armature(&armature).unwrap();
    let text = serde_json::to_string(&good).unwrap();
    let again: Model = serde_json::from_str(&text).unwrap();
    let State { q, v, .. } = State::random(&good, &mut rng(1));
    let h = nonlinear_effects(&good, &mut Data::new(&good), &q, &v).to_vec();
    assert_eq!(nonlinear_effects(&again, &mut Data::new(&again), &q, &v), h);
    armature[1] = 0.25;
    let error = quadruped.with_armature(&armature).unwrap_err().to_string();
    let expected = "joint `root_joint`: armature is 0.5, 0.25 and 0.5 along its linear coordinates, expected three equal \
                    numbers: the armature of a free joint is a mass in the axes of its parent";
    assert_eq!(error, expected);
    let broken = text.replace("\"armature\":[0.5,0.5,", "\"armature\":[0.5,0.25,");
    assert!(broken != text && serde_json::from_str::<Model>(&broken).unwrap_err().to_string().starts_with(expected));
}
