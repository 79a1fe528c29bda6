//! The derivatives with respect to forces, inertial parameters, gravity, armature, damping and friction.

use crate::common;

use common::{State, Worst, all_models, eps, lift, lift_forces, rng, unit};
use condyle_dynamics::{
    Data, Force, Input, Model, Vec3, aba, aba_derivatives, inertial_parameters, rnea, rnea_derivatives,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Two exact ways, some thousand roundings each; forward dynamics times the condition number of M.
const EXACT: f64 = 1e-11;
/// Central differences with a step of 1e-5: rounding of 1e-16/step.
const DIFFERENCES: f64 = 1e-6;
const TREES: u64 = 6;
const SMOOTHING: f64 = 0.3;

/// The effort and the acceleration along one direction of an input, by dual numbers.
fn by_duals(model: &Model, s: &State, qdd: &[f64], input: Input, k: usize) -> [Vec<f64>; 2] {
    let nv = model.nv();
    let mut f_ext: Vec<Force<Dual64>> = lift_forces(&s.f_ext);
    let mut passive = vec![Dual64::from(0.0); nv]; // the losses of one unit of damping or friction in a joint
    let mut seeded: Model<Dual64> = model.with_inertias(|_, I| I.lift()).unwrap();
    let one = |on: bool| Dual64::new(0.0, f64::from(u8::from(on)));
    match input {
        Input::Force(b) => {
            let mut six = f_ext[b].to_array();
            six[k] += one(true);
            f_ext[b] = Force::from(six);
        }
        Input::Inertia(b) => {
            seeded = model
                .with_inertias(|i, I| {
                    let pi = inertial_parameters::from_inertia(I);
                    let pi: [Dual64; 10] = core::array::from_fn(|j| one(i == b && j == k) + pi[j]);
                    inertial_parameters::to_inertia(pi)
                })
                .unwrap();
        }
        Input::Gravity => {
            let g = model.gravity().to_array();
            let g: [Dual64; 3] = core::array::from_fn(|j| one(j == k) + g[j]);
            seeded = seeded.with_gravity(Vec3::from(g)).unwrap();
        }
        Input::Armature => return by_differences(model, s, qdd, k),
        Input::Damping => passive[k] -= one(true) * s.v[k],
        Input::Friction { smoothing } => passive[k] -= one(true) * (s.v[k] / smoothing).tanh(),
        _ => unreachable!("there are no other inputs"),
    }
    let mut data = Data::new(&seeded);
    let (q, v) = (lift(&s.q), lift(&s.v));
    let effort: Vec<Dual64> = rnea(&seeded, &mut data, &q, &v, &lift(qdd), &f_ext).to_vec();
    let effort: Vec<Dual64> = effort.iter().zip(&passive).map(|(&tau, &p)| tau - p).collect();
    let tau: Vec<Dual64> = s.tau.iter().zip(&passive).map(|(&tau, &p)| p + tau).collect();
    [eps(&effort), eps(aba(&seeded, &mut data, &q, &v, &tau, &f_ext))]
}

/// The same for the armature, to one side: τ is linear in it, q̈ nearly so.
fn by_differences(model: &Model, s: &State, qdd: &[f64], k: usize) -> [Vec<f64>; 2] {
    const STEP: f64 = 1e-5;
    let run = |h: f64| {
        let armature: Vec<f64> = model.armature().iter().zip(unit(model.nv(), k)).map(|(x, e)| x + h * e).collect();
        let other = model.clone().with_armature(&armature).unwrap();
        let mut data = Data::new(&other);
        let tau = rnea(&other, &mut data, &s.q, &s.v, qdd, &s.f_ext).to_vec();
        [tau, aba(&other, &mut data, &s.q, &s.v, &s.tau, &s.f_ext).to_vec()]
    };
    let [here, near, far] = [0.0, STEP, 2.0 * STEP].map(run); // an armature is never negative
    let slope = |i: usize, j: usize| (4.0 * near[i][j] - far[i][j] - 3.0 * here[i][j]) / (2.0 * STEP);
    core::array::from_fn(|i| (0..here[i].len()).map(|j| slope(i, j)).collect())
}

#[test]
fn every_input() {
    let mut efforts = Worst::new("∂τ/∂(input)", EXACT);
    let mut accelerations = Worst::new("∂q̈/∂(input)", EXACT);
    let mut near = Worst::new("by armature", DIFFERENCES);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let (nv, mut data) = (model.nv(), Data::new(model));
        let qdd = aba(model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext).to_vec();
        let whole = [Input::Gravity, Input::Armature, Input::Damping, Input::Friction { smoothing: SMOOTHING }];
        let of_bodies = (1..model.bodies().len()).flat_map(|b| [Input::Force(b), Input::Inertia(b)]);
        for input in whole.into_iter().chain(of_bodies) {
            let mut expected = [(); 2].map(|()| DMatrix::zeros(nv, input.len(model)));
            for k in 0..input.len(model) {
                for (matrix, column) in expected.iter_mut().zip(by_duals(model, &s, &qdd, input, k)) {
                    matrix.column_mut(k).copy_from_slice(&column);
                }
            }
            let mut found = DMatrix::from_element(nv, input.len(model), f64::NAN);
            let d = rnea_derivatives(model, &mut data, &s.q, &s.v, &qdd, &s.f_ext);
            d.with_respect_to(input, &mut found);
            let by_duals = input != Input::Armature;
            if by_duals { &mut efforts } else { &mut near }.see(model, found.as_slice(), expected[0].as_slice());
            let d = aba_derivatives(model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext);
            d.with_respect_to(input, &mut found);
            if by_duals { &mut accelerations } else { &mut near }.see(model, found.as_slice(), expected[1].as_slice());
        }
    }
}

/// A force on the world moves nothing.
#[test]
fn the_world() {
    let quadruped = condyle_dynamics::robots::quadruped();
    let s = State::random(&quadruped, &mut rng(1));
    let mut data = Data::new(&quadruped);
    let mut found = DMatrix::from_element(18, 6, f64::NAN);
    let d = aba_derivatives(&quadruped, &mut data, &s.q, &s.v, &s.tau, &[]);
    d.with_respect_to(Input::Force(0), &mut found);
    assert_eq!(found, DMatrix::zeros(18, 6));
}

#[test]
#[should_panic(expected = "dtau: expected 7 × 10, found (7, 6)")]
fn wrong_shape() {
    let arm = condyle_dynamics::robots::arm7();
    let mut data = Data::new(&arm);
    let d = rnea_derivatives(&arm, &mut data, &[0.0; 7], &[0.0; 7], &[0.0; 7], &[]);
    d.with_respect_to(Input::Inertia(1), &mut DMatrix::zeros(7, 6));
}
