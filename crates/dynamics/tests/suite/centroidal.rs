//! Tests of centre of mass, centroidal momentum, energies, and the function that computes all terms at once. The
//! results are compared with time derivatives by dual numbers and with other algorithms.

use crate::common;

use common::{State, Worst, all_models, dual, embedded, eps, lift, moved, real, rng, unit};
use condyle_dynamics::{
    Act, Data, Force, Inertia, Mat3, Model, ReferenceFrame, Se3, Vec3, aba, centroidal_map, centroidal_map_rate,
    compute_all_terms, crba, forward_accelerations, forward_kinematics, forward_velocities, gravity, nonlinear_effects,
    rnea,
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-11;
/// Tolerance after forward dynamics: sums over all bodies, times the condition number of M.
const INVERTED: f64 = 1e-9;
const TREES: u64 = 15;

fn vector(x: &[f64]) -> DVector<f64> {
    DVector::from_column_slice(x)
}

/// Returns the position q ⊕ t v, as dual numbers in t.
fn moving(model: &Model, q: &[f64], v: &[f64]) -> Vec<Dual64> {
    moved(model, &lift(q), &dual(&vec![0.0; model.nv()], v))
}

/// Checks that the velocity ċ = Jcom v and the acceleration c̈ of the centre of mass equal time derivatives by dual
/// numbers. The linear momentum must be m ċ, with the total mass m.
#[test]
fn centre_of_mass() {
    let mut place = Worst::new("c = Σ m_i c_i / m", ROUNDING);
    let mut velocity = Worst::new("ċ = Jcom v = dc/dt", ROUNDING);
    let mut acceleration = Worst::new("c̈ = dċ/dt", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut other, mut duals) = (Data::new(model), Data::new(model), Data::new(model));
        let k = forward_accelerations(model, &mut data, &q, &v, &a);
        let total = model.bodies()[1..]
            .iter()
            .enumerate()
            .fold(Inertia::zero(), |I, (i, body)| I + k.body(i + 1).act(body.inertia));
        place.see(model, &k.com().to_array(), &total.mass_com.scale(1.0 / total.mass).to_array());
        let map = centroidal_map_rate(model, &mut other, &q, &v);
        assert_eq!(map.com, centroidal_map(model, &mut Data::new(model), &q).com);
        place.see(model, &map.com.to_array(), &k.com().to_array());
        let k_moving = forward_velocities(model, &mut duals, &moving(model, &q, &v), &dual(&v, &a));
        let rate = eps(&k_moving.com().to_array());
        velocity.see(model, &k.com_velocity().to_array(), &rate);
        velocity.see(model, &map.com_velocity.to_array(), &rate);
        velocity.see(model, (map.Jcom * vector(&v)).as_slice(), &rate);
        velocity.see(model, &k.centroidal_momentum().linear.scale(1.0 / total.mass).to_array(), &rate);
        acceleration.see(model, &k.com_acceleration().to_array(), &eps(&k_moving.com_velocity().to_array()));
    }
}

/// Checks the centroidal momentum hg = Ag v and its rate dhg = Ag a + dAg v, where dAg is the rate of the matrix Ag.
/// The centroidal inertia Ig must be the inertia of all bodies as one rigid body.
#[test]
fn momentum() {
    let mut momentum = Worst::new("Ag v = hg", ROUNDING);
    let mut map_rate = Worst::new("dAg = d/dt Ag", ROUNDING);
    let mut rate = Worst::new("Ag a + dAg v = dhg", ROUNDING);
    let mut inertia = Worst::new("Ig", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut other, mut duals) = (Data::new(model), Data::new(model), Data::new(model));
        let k = forward_accelerations(model, &mut data, &q, &v, &a);
        let hg = k.centroidal_momentum().to_array();
        let map = centroidal_map_rate(model, &mut other, &q, &v);
        momentum.see(model, (map.Ag * vector(&v)).as_slice(), &hg);
        momentum.see(model, &map.hg.to_array(), &hg);
        let q_moving = moving(model, &q, &v);
        let Ag_moving = centroidal_map(model, &mut duals, &q_moving).Ag;
        momentum.see(model, map.Ag.as_slice(), &real(Ag_moving.as_slice()));
        map_rate.see(model, map.dAg.as_slice(), &eps(Ag_moving.as_slice()));
        let hg_moving = forward_velocities(model, &mut duals, &q_moving, &dual(&v, &a)).centroidal_momentum();
        let dhg = k.centroidal_momentum_rate().to_array();
        rate.see(model, &dhg, &eps(&hg_moving.to_array()));
        rate.see(model, (map.Ag * vector(&a) + map.dAg * vector(&v)).as_slice(), &dhg);
        let cXo = Se3::new(Mat3::identity(), -map.com);
        let expected = model.bodies()[1..]
            .iter()
            .enumerate()
            .fold(Inertia::zero(), |I, (i, body)| I + (cXo * k.body(i + 1)).act(body.inertia));
        let flat =
            |I: Inertia<f64>| [I.rotational.full().columns().map(Vec3::to_array).concat(), vec![I.mass]].concat();
        inertia.see(model, &flat(map.Ig), &flat(expected));
        inertia.see(model, &flat(centroidal_map(model, &mut other, &q).Ig), &flat(expected));
    }
}

/// Checks that only weight and external forces change the momentum of a floating robot: dhg = [m g; 0] + Σ f_ext.
#[test]
fn newton_and_euler() {
    let mut worst = Worst::new("dhg = [m g; 0] + Σ f_ext", INVERTED);
    let [_, quadruped, humanoid] = embedded();
    for (model, seed) in [quadruped, humanoid].iter().flat_map(|model| (0..20).map(move |seed| (model, seed))) {
        let State { q, v, mut tau, f_ext, .. } = State::random(model, &mut rng(seed));
        tau[..6].fill(0.0); // no motor acts on the base
        let mut data = Data::new(model);
        let a = aba(model, &mut data, &q, &v, &tau, &f_ext).to_vec();
        let k = forward_accelerations(model, &mut data, &q, &v, &a);
        let cXo = Se3::new(Mat3::identity(), -k.com());
        let mut sum = Force::new(model.gravity().scale(model.total_mass()), Vec3::zero());
        for (i, &f) in f_ext.iter().enumerate().skip(1) {
            sum += cXo.act(k.body(i).act(f));
        }
        worst.see(model, &k.centroidal_momentum_rate().to_array(), &sum.to_array());
    }
}

/// Checks the kinetic energy T and the potential energy V: T = ½ vᵀ M v, ∂V/∂q = g, d(T + V)/dt = vᵀ τ.
#[test]
fn energies() {
    let mut kinetic = Worst::new("T = ½ vᵀ M v", ROUNDING);
    let mut slope = Worst::new("∂V/∂q = g", ROUNDING);
    let mut power = Worst::new("dE/dt = vᵀ τ", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut duals, nv) = (Data::new(model), Data::new(model), model.nv());
        let M = crba(model, &mut data, &q);
        let expected = 0.5 * vector(&v).dot(&(M * vector(&v)));
        kinetic.see(model, &[forward_velocities(model, &mut data, &q, &v).kinetic_energy()], &[expected]);
        let slopes: Vec<f64> = (0..nv)
            .map(|k| {
                let q_moving = moving(model, &q, &unit(nv, k));
                forward_kinematics(model, &mut duals, &q_moving).potential_energy().eps
            })
            .collect();
        slope.see(model, &slopes, gravity(model, &mut data, &q));
        let rate = forward_velocities(model, &mut duals, &moving(model, &q, &v), &dual(&v, &a)).mechanical_energy().eps;
        let tau = vector(rnea(model, &mut data, &q, &v, &a, &[]));
        power.see(model, &[rate], &[tau.dot(&vector(&v))]);
    }
}

/// Checks the function that computes all terms at once: each term must equal the result of the single algorithm.
#[test]
fn all_terms() {
    let mut worst = Worst::new("compute_all_terms", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut other) = (Data::new(model), Data::new(model));
        let terms = compute_all_terms(model, &mut data, &q, &v);
        worst.see(model, terms.M.as_slice(), crba(model, &mut other, &q).as_slice());
        assert_eq!(terms.M, &terms.M.transpose());
        worst.see(model, terms.h, nonlinear_effects(model, &mut other, &q, &v));
        let (c, e) = (terms.centroidal, centroidal_map_rate(model, &mut other, &q, &v));
        for (found, expected) in [(c.Ag, e.Ag), (c.dAg, e.dAg), (c.Jcom, e.Jcom)] {
            worst.see(model, found.as_slice(), expected.as_slice());
        }
        worst.see(model, &c.hg.to_array(), &e.hg.to_array());
        for (found, expected) in [(c.com, e.com), (c.com_velocity, e.com_velocity)] {
            worst.see(model, &found.to_array(), &expected.to_array());
        }
        assert_eq!(c.Ig, e.Ig);
        let k = forward_velocities(model, &mut other, &q, &v);
        worst.see(model, &[terms.kinetic_energy, terms.potential_energy], &[k.kinetic_energy(), k.potential_energy()]);
        let (mut found, mut expected) = (DMatrix::zeros(6, model.nv()), DMatrix::zeros(6, model.nv()));
        for f in 0..model.frames().len() {
            let r = ReferenceFrame::Local;
            assert_eq!(terms.kinematics.frame_velocity(f, r), k.frame_velocity(f, r));
            terms.kinematics.frame_jacobian_rate(f, r, &mut found);
            k.frame_jacobian_rate(f, r, &mut expected);
            assert_eq!(found, expected);
        }
    }
}
