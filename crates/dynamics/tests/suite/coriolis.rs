//! Tests of the Coriolis matrix, and of the efforts that hold a robot at rest.

use crate::common;

use common::{State, Tree, Worst, all_models, dual, eps, lift, moved, normal3, rng, unit};
use condyle_dynamics::{
    Data, Joint, Model, Vec3, coriolis_matrix, crba, gravity, nonlinear_effects, rnea, robots, static_torque,
};
use nalgebra::{DMatrix, DVector};
use rand::RngExt;

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-11;
const TREES: u64 = 20;

/// Computes dM/dt along the tangent vector v.
fn inertia_rate(model: &Model, q: &[f64], v: &[f64]) -> DMatrix<f64> {
    let q_moving = moved(model, &lift(q), &dual(&vec![0.0; model.nv()], v));
    let rate = eps(crba(model, &mut Data::new(model), &q_moving).as_slice());
    DMatrix::from_column_slice(model.nv(), model.nv(), &rate)
}

/// Checks the Coriolis matrix C: C v + g = h, and Ṁ = C + Cᵀ. The matrix Ṁ − 2C is then skew-symmetric.
#[test]
fn forces_and_skewness() {
    let mut forces = Worst::new("C v + g = h", ROUNDING);
    let mut skew = Worst::new("C + Cᵀ = dM/dt", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let mut data = Data::new(model);
        let C = coriolis_matrix(model, &mut data, &q, &v).clone();
        let g = DVector::from_column_slice(gravity(model, &mut data, &q));
        let found = &C * DVector::from_column_slice(&v) + g;
        forces.see(model, found.as_slice(), nonlinear_effects(model, &mut data, &q, &v));
        skew.see(model, (&C + C.transpose()).as_slice(), inertia_rate(model, &q, &v).as_slice());
    }
}

/// Checks C against Christoffel symbols, which determine C uniquely if the velocities are rates of coordinates: C_ij =
/// ½ Σ_k (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_jk/∂q_i) v_k.
#[test]
fn christoffel_symbols() {
    let mut worst = Worst::new("C = Christoffel", ROUNDING);
    let mut models = vec![robots::arm7()];
    for seed in 0..TREES {
        let rng = &mut rng(seed);
        let mut tree = Tree { parts: Vec::new(), gravity: Vec3::zero(), smooth: false };
        for i in 0..8 {
            let axis = normal3(rng);
            let joint =
                [Joint::Revolute { axis }, Joint::Continuous { axis }, Joint::Prismatic { axis }, Joint::Translation]
                    [rng.random_range(0..4)];
            let parent = if rng.random() { i } else { rng.random_range(0..=i) };
            tree.add(rng, parent, joint);
        }
        models.push(tree.build());
    }
    for (seed, model) in models.iter().enumerate() {
        let (nv, State { q, v, .. }) = (model.nv(), State::random(model, &mut rng(seed as u64)));
        let dM: Vec<_> = (0..nv).map(|k| inertia_rate(model, &q, &unit(nv, k))).collect();
        let expected = DMatrix::from_fn(nv, nv, |i, j| {
            (0..nv).map(|k| 0.5 * (dM[k][(i, j)] + dM[j][(i, k)] - dM[i][(j, k)]) * v[k]).sum()
        });
        let mut data = Data::new(model);
        worst.see(model, coriolis_matrix(model, &mut data, &q, &v).as_slice(), expected.as_slice());
    }
}

/// Checks that `static_torque` equals `rnea` at rest. Without external forces, it must also equal `gravity`.
#[test]
fn at_rest() {
    let mut worst = Worst::new("static_torque = rnea(q, 0, 0, f_ext)", ROUNDING);
    for (seed, model) in all_models(TREES).iter().enumerate() {
        let State { q, f_ext, .. } = State::random(model, &mut rng(seed as u64));
        let (mut data, mut other, zero) = (Data::new(model), Data::new(model), vec![0.0; model.nv()]);
        let expected = rnea(model, &mut other, &q, &zero, &zero, &f_ext);
        worst.see(model, static_torque(model, &mut data, &q, &f_ext), expected);
        worst.see(model, static_torque(model, &mut data, &q, &[]), gravity(model, &mut other, &q));
    }
}
