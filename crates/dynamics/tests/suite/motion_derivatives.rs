//! Tests of analytical derivatives of the motion of frames, momentum, energies and static efforts. The results are
//! compared with dual numbers.

use crate::common;

use common::{State, Worst, all_models, dual, eps, lift, lift_forces, moved, rng, unit};
use condyle_dynamics::{
    Data, Force, Model, ReferenceFrame, centroidal_derivatives, centroidal_map, coriolis_derivatives,
    energy_derivatives, forward_accelerations, forward_kinematics, forward_velocities, gravity, nonlinear_effects,
    static_torque, static_torque_derivative,
};
use nalgebra::DMatrix;
use num_dual::Dual64;

/// Tolerance between two exact methods with some hundred rounding errors each.
const EXACT: f64 = 1e-12;
const TREES: u64 = 5;
const FRAMES: [ReferenceFrame; 3] = [ReferenceFrame::Local, ReferenceFrame::World, ReferenceFrame::LocalWorldAligned];

/// Computes the derivative of a function of (q, v, a) with respect to the argument `which`.
fn by_duals(
    model: &Model,
    s: &State,
    which: usize,
    f: impl Fn(&mut Data<Dual64>, &[Dual64], &[Dual64], &[Dual64]) -> Vec<Dual64>,
) -> DMatrix<f64> {
    let (nv, mut data) = (model.nv(), Data::new(model));
    let columns: Vec<Vec<f64>> = (0..nv)
        .map(|k| {
            let seed = |argument: usize| if argument == which { unit(nv, k) } else { vec![0.0; nv] };
            let q = moved(model, &lift(&s.q), &dual(&vec![0.0; nv], &seed(0)));
            eps(&f(&mut data, &q, &dual(&s.v, &seed(1)), &dual(&s.a, &seed(2))))
        })
        .collect();
    DMatrix::from_fn(columns[0].len(), nv, |i, k| columns[k][i])
}

/// Returns a 6 × nv matrix of NaN. After a call, NaN shows which entries the call did not write.
fn six(model: &Model) -> DMatrix<f64> {
    DMatrix::from_element(6, model.nv(), f64::NAN)
}

#[test]
fn frames_and_bodies() {
    let mut worst = Worst::new("∂(motion of a frame)", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        for r in FRAMES {
            for f in 0..model.frames().len() {
                let mut of = [(); 5].map(|()| six(model));
                let [v_q, a_q, a_v, c_q, c_v] = &mut of;
                let motion = forward_accelerations(model, &mut data, &s.q, &s.v, &s.a);
                motion.frame_velocity_derivative(f, r, v_q);
                motion.frame_acceleration_derivatives(f, r, a_q, a_v);
                motion.frame_classical_acceleration_derivatives(f, r, c_q, c_v);
                let velocity = |d: &mut Data<_>, q: &[_], v: &[_], _: &[_]| {
                    forward_velocities(model, d, q, v).frame_velocity(f, r).to_array().to_vec()
                };
                let spatial = |d: &mut Data<_>, q: &[_], v: &[_], a: &[_]| {
                    forward_accelerations(model, d, q, v, a).frame_acceleration(f, r).to_array().to_vec()
                };
                let classical = |d: &mut Data<_>, q: &[_], v: &[_], a: &[_]| {
                    forward_accelerations(model, d, q, v, a).frame_classical_acceleration(f, r).to_array().to_vec()
                };
                worst.see(model, v_q.as_slice(), by_duals(model, &s, 0, velocity).as_slice());
                worst.see(model, a_q.as_slice(), by_duals(model, &s, 0, spatial).as_slice());
                worst.see(model, a_v.as_slice(), by_duals(model, &s, 1, spatial).as_slice());
                worst.see(model, c_q.as_slice(), by_duals(model, &s, 0, classical).as_slice());
                worst.see(model, c_v.as_slice(), by_duals(model, &s, 1, classical).as_slice());
            }
            for b in 0..model.bodies().len() {
                let [mut v_q, mut a_q, mut a_v] = [(); 3].map(|()| six(model));
                let motion = forward_accelerations(model, &mut data, &s.q, &s.v, &s.a);
                motion.body_velocity_derivative(b, r, &mut v_q);
                motion.body_acceleration_derivatives(b, r, &mut a_q, &mut a_v);
                let velocity = |d: &mut Data<_>, q: &[_], v: &[_], _: &[_]| {
                    forward_velocities(model, d, q, v).body_velocity(b, r).to_array().to_vec()
                };
                let spatial = |d: &mut Data<_>, q: &[_], v: &[_], a: &[_]| {
                    forward_accelerations(model, d, q, v, a).body_acceleration(b, r).to_array().to_vec()
                };
                worst.see(model, v_q.as_slice(), by_duals(model, &s, 0, velocity).as_slice());
                worst.see(model, a_q.as_slice(), by_duals(model, &s, 0, spatial).as_slice());
                worst.see(model, a_v.as_slice(), by_duals(model, &s, 1, spatial).as_slice());
            }
        }
    }
}

#[test]
fn momentum_and_centre_of_mass() {
    let mut worst = Worst::new("∂(centroidal)", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let motion = |d: &mut Data<Dual64>, q: &[_], v: &[_], a: &[_]| {
            let m = forward_accelerations(model, d, q, v, a);
            let (h, rate) = (m.centroidal_momentum(), m.centroidal_momentum_rate());
            let com = [m.com(), m.com_velocity(), m.com_acceleration()].map(condyle_dynamics::Vec3::to_array);
            [&h.to_array()[..], &rate.to_array(), &com[0], &com[1], &com[2]].concat()
        };
        let [by_q, by_v, by_a] = [0, 1, 2].map(|which| by_duals(model, &s, which, motion));
        let rows = |of: &DMatrix<f64>, from: usize, n: usize| of.rows(from, n).into_owned();
        let expected = [
            rows(&by_q, 0, 6),
            rows(&by_v, 0, 6),
            rows(&by_q, 6, 6),
            rows(&by_v, 6, 6),
            rows(&by_a, 6, 6),
            rows(&by_q, 12, 3),
            rows(&by_q, 15, 3),
            rows(&by_q, 18, 3),
            rows(&by_v, 18, 3),
        ];
        let d = centroidal_derivatives(model, &mut data, &s.q, &s.v, &s.a);
        let found =
            [d.dh_dq, d.dh_dv, d.drate_dq, d.drate_dv, d.drate_da, d.dcom_dq, d.dvcom_dq, d.dacom_dq, d.dacom_dv];
        for (found, expected) in found.iter().zip(&expected) {
            worst.see(model, found.as_slice(), expected.as_slice());
        }
        let Jcom = d.dcom_dq.clone();
        worst.see(model, Jcom.as_slice(), centroidal_map(model, &mut data, &s.q).Jcom.as_slice());
    }
}

#[test]
fn energies() {
    let mut worst = Worst::new("∂(energies)", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let kinetic =
            |d: &mut Data<_>, q: &[_], v: &[_], _: &[_]| vec![forward_velocities(model, d, q, v).kinetic_energy()];
        let potential =
            |d: &mut Data<_>, q: &[_], _: &[_], _: &[_]| vec![forward_kinematics(model, d, q).potential_energy()];
        let d = energy_derivatives(model, &mut data, &s.q, &s.v);
        worst.see(model, d.dT_dq, by_duals(model, &s, 0, kinetic).as_slice());
        worst.see(model, d.dT_dv, by_duals(model, &s, 1, kinetic).as_slice());
        worst.see(model, d.dV_dq, by_duals(model, &s, 0, potential).as_slice());
    }
}

#[test]
fn static_and_coriolis_efforts() {
    let mut worst = Worst::new("∂(static), ∂(C v)", EXACT);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let s = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        for f_ext in [&[][..], &s.f_ext] {
            let lifted: Vec<Force<Dual64>> = lift_forces(f_ext);
            let effort = |d: &mut Data<_>, q: &[_], _: &[_], _: &[_]| static_torque(model, d, q, &lifted).to_vec();
            let found = static_torque_derivative(model, &mut data, &s.q, f_ext);
            worst.see(model, found.as_slice(), by_duals(model, &s, 0, effort).as_slice());
        }
        let product = |d: &mut Data<Dual64>, q: &[_], v: &[_], _: &[_]| {
            let h = nonlinear_effects(model, d, q, v).to_vec();
            h.iter().zip(gravity(model, d, q)).map(|(&h, &g)| h - g).collect()
        };
        let d = coriolis_derivatives(model, &mut data, &s.q, &s.v);
        worst.see(model, d.dq.as_slice(), by_duals(model, &s, 0, product).as_slice());
        worst.see(model, d.dv.as_slice(), by_duals(model, &s, 1, product).as_slice());
    }
}
