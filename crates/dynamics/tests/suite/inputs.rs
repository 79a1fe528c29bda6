//! Tests of derivatives with respect to forces, inertial parameters, gravity, armature, damping and friction.

use crate::common;

use common::{State, Worst, all_models, eps, lift, lift_forces, rng};
use condyle_dynamics::{
    Body, Data, Force, Input, Joint, Model, Quaternion, Vec3, aba, aba_derivatives, inertial_parameters, rnea,
    rnea_derivatives,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance between two exact methods with some thousand rounding errors each. For forward dynamics, the tolerance
/// includes the condition number of M.
const EXACT: f64 = 1e-11;
const TREES: u64 = 6;
const SMOOTHING: f64 = 0.3;

/// Computes the derivatives of effort and acceleration along one direction of an input, by dual numbers.
fn by_duals(model: &Model, s: &State, qdd: &[f64], input: Input, k: usize) -> [Vec<f64>; 2] {
    let nv = model.nv();
    let mut f_ext: Vec<Force<Dual64>> = lift_forces(&s.f_ext);
    let mut passive = vec![Dual64::from(0.0); nv]; // losses for one unit of damping or friction in a joint
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
        Input::Armature => {
            let armature: Vec<Dual64> = model.armature().iter().enumerate().map(|(j, &a)| one(j == k) + a).collect();
            seeded = seeded.with_scalar_armature(&armature);
        }
        Input::Damping => lost(model, s, k, |v| v).iter().zip(&mut passive).for_each(|(&x, p)| *p -= one(true) * x),
        Input::Friction { smoothing } => {
            let loss = lost(model, s, k, |v| (v / smoothing).tanh());
            loss.iter().zip(&mut passive).for_each(|(&x, p)| *p -= one(true) * x);
        }
        _ => unreachable!("there are no other inputs"),
    }
    let mut data = Data::new(&seeded);
    let (q, v) = (lift(&s.q), lift(&s.v));
    let effort: Vec<Dual64> = rnea(&seeded, &mut data, &q, &v, &lift(qdd), &f_ext).to_vec();
    let effort: Vec<Dual64> = effort.iter().zip(&passive).map(|(&tau, &p)| tau - p).collect();
    let tau: Vec<Dual64> = s.tau.iter().zip(&passive).map(|(&tau, &p)| p + tau).collect();
    [eps(&effort), eps(aba(&seeded, &mut data, &q, &v, &tau, &f_ext))]
}

/// Computes the efforts of all coordinates if only coordinate k has damping or friction, with a coefficient of 1. `law`
/// maps a component of the velocity to the effort along this component. For the linear coordinates of a free joint, the
/// components are along the axes of the joint's parent.
fn lost(model: &Model, s: &State, k: usize, law: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut loss = vec![0.0; model.nv()];
    let is_linear = |body: &&Body| body.joint == Joint::FreeFlyer && (body.idx_v..body.idx_v + 3).contains(&k);
    match model.bodies()[1..].iter().find(is_linear) {
        None => loss[k] = law(s.v[k]),
        Some(Body { idx_q, idx_v, .. }) => {
            let (q, v) = (&s.q[idx_q + 3..idx_q + 7], &s.v[*idx_v..]);
            let R = Quaternion::new(q[0], q[1], q[2], q[3]).to_rotation();
            let axis = Vec3::from([0, 1, 2].map(|r| if idx_v + r == k { 1.0 } else { 0.0 }));
            let along = axis.scale(law((R * Vec3::new(v[0], v[1], v[2])).dot(axis)));
            loss[*idx_v..idx_v + 3].copy_from_slice(&R.transpose_mul(along).to_array());
        }
    }
    loss
}

#[test]
fn every_input() {
    let mut efforts = Worst::new("∂τ/∂(input)", EXACT);
    let mut accelerations = Worst::new("∂q̈/∂(input)", EXACT);
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
            efforts.see(model, found.as_slice(), expected[0].as_slice());
            let d = aba_derivatives(model, &mut data, &s.q, &s.v, &s.tau, &s.f_ext);
            d.with_respect_to(input, &mut found);
            accelerations.see(model, found.as_slice(), expected[1].as_slice());
        }
    }
}

/// Checks that a force on the world has no effect.
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
