//! Checks identities that hold for every robot in every state.
//!
//! An error is max |found − expected|, relative to 1 + the largest number involved. For results that contain the
//! inverse of the inertia matrix M, the bound is proportional to the condition number κ(M), if this bound is larger
//! than the usual bound.

use super::ledger::Row;
use crate::states::States;
use condyle::{
    Data, Joint, Model, aba,
    centroidal::centroidal_map_rate,
    crba,
    derivatives::energy_derivatives,
    dynamics::add_armature_bias,
    forward_accelerations, forward_kinematics, forward_velocities, integrate, minv, nonlinear_effects,
    regressors::{inertial_parameters, joint_torque_regressor},
    rnea,
    spatial::Matrix,
    terms::{coriolis_matrix, gravity},
};
use nalgebra::{DMatrix, DVector};
use num_dual::Dual64;

/// Bound for the rounding of several hundred operations.
const ROUNDING: f64 = 1e-12;
/// Bound for the difference of results that two functions compute by the same operations on the same numbers.
const EXACT: f64 = 1e-14;
/// Bound for results that use a factorisation of M, or sums of the results of several algorithms.
const INVERTED: f64 = 1e-10;
/// Bound for the error of a central difference with step h = 1e-6. The error consists of a term h² from the function
/// and a term ε/h from the rounding error ε.
const DIFFERENCE: f64 = 1e-6;
const STEP: f64 = 1e-6;
/// Maximum relative error of M⁻¹. With this error, three digits are still correct.
const LOST: f64 = 1e-3;
/// Rounding error of a solve with the inertia matrix M, in units of ε κ(M): the rounding error of 1 times the condition
/// number of M.
const ROUNDINGS: f64 = 100.0;

/// Reasons for the bounds, as shown in the report of `condyle check`.
const SAME: &str = "same operations";
const SUMS: &str = "sums of some hundreds of terms";
const PATHS: &str = "two computations of the same sums";
pub(super) const SOLVES: &str = "100 ε κ(M), at least 1e-10";
const STEPS: &str = "central differences";
const DIGITS: &str = "three digits of M⁻¹ are left";

/// Returns the allowed error of results that contain the inverse of the inertia matrix M. `condition` is the condition
/// number of M.
pub(super) fn inverted(condition: f64) -> f64 {
    INVERTED.max(ROUNDINGS * f64::EPSILON * condition)
}

/// Returns the smallest eigenvalue and the condition number of M.
pub(super) fn spectrum(M: &Matrix<f64>) -> (f64, f64) {
    let values = M.clone().symmetric_eigenvalues();
    (values.min(), if values.min() > 0.0 { values.max() / values.min() } else { f64::INFINITY })
}

/// Returns whether the first body floats and carries all other bodies. A base with armature does not count as floating,
/// because gravity does not act on armature.
fn floats(model: &Model) -> bool {
    let bodies = model.bodies();
    let floats = bodies.len() > 1 && bodies[1].joint == Joint::FreeFlyer && bodies[2..].iter().all(|b| b.parent > 0);
    floats && model.armature()[..3] == [0.0; 3]
}

/// Checks the identities of rigid-body dynamics in `states` random states.
pub(super) fn check(model: &Model, states: usize, seed: u64) -> Vec<Row> {
    let mut inverse = Row::new("RNEA, CRBA", "rnea(q, v, a) = M a + h", SUMS);
    let mut round = Row::new("RNEA of ABA", "rnea(q, v, aba(q, v, τ)) = τ", SOLVES);
    let mut back = Row::new("ABA of RNEA", "aba(q, v, rnea(q, v, a)) = a", SOLVES);
    let mut columns = Row::new("CRBA, n RNEAs", "M eᵢ = rnea(q, 0, eᵢ) − g", SUMS);
    let mut forward = Row::new("ABA, solve", "aba(q, v, τ) = M⁻¹ (τ − h)", SOLVES);
    let mut identity = Row::new("M⁻¹", "M M⁻¹ = 1", SOLVES);
    let mut symmetric = Row::new("M symmetric", "M = Mᵀ", SAME);
    let mut positive = Row::new("M positive definite", "ε λ_max(M) / λ_min(M) ≪ 1", DIGITS);
    let mut weight = Row::new("gravity", "rnea(q, 0, 0) = g(q)", SAME);
    let mut bias = Row::new("nonlinear effects", "rnea(q, v, 0) = h(q, v)", SAME);
    let mut coriolis = Row::new("Coriolis matrix", "C v + g = h", SUMS);
    let mut skew = Row::new("Ṁ − 2C skew", "Ṁ = C + Cᵀ, Ṁ by dual numbers", SUMS);
    let mut kinetic = Row::new("kinetic energy", "T = ½ vᵀ M v", SUMS);
    let mut power = Row::new("power balance", "d(T + V)/dt = τᵀ v", SOLVES);
    let mut regressor = Row::new("regressor", "Y π + armature a = τ", SUMS);
    let mut linear = Row::new("linear momentum", "h_lin = m ċ, ċ by differences", STEPS);
    let mut rate = Row::new("rate of momentum", "Ag a + Ȧg v = ḣg", SUMS);
    let mut falling = Row::new("free fall", "rnea(q, 0, g) = 0 of a floating robot", PATHS);
    let mut newton = Row::new("Newton, Euler", "ḣg = (m g, 0) of a floating robot without base efforts", SOLVES);

    let nv = model.nv();
    let (mut data, all, zero) = (Data::new(model), States::new(model, states, seed), vec![0.0; nv]);
    let mass: f64 = model.bodies()[1..].iter().map(|b| b.inertia.mass).sum();
    let pi: Vec<f64> = model.bodies()[1..].iter().flat_map(|b| inertial_parameters::from_inertia(b.inertia)).collect();
    let (pi, floats, g0) = (DVector::from(pi), floats(model), *model.gravity());
    let mut lowest = f64::INFINITY;
    for k in 0..states {
        let [q, v, a, tau] = all.at(model, k);
        let vector = DVector::from_column_slice;
        let M = crba(model, &mut data, q).clone();
        let (least, condition) = spectrum(&M);
        let bound = inverted(condition);
        positive.see(f64::EPSILON * condition, LOST);
        lowest = lowest.min(least);
        symmetric.compare(M.as_slice(), M.transpose().as_slice(), 0.0, EXACT);

        let g = gravity(model, &mut data, q).to_vec();
        weight.compare(rnea(model, &mut data, q, &zero, &zero, &[]), &g, 0.0, EXACT);
        let h = nonlinear_effects(model, &mut data, q, v).to_vec();
        bias.compare(rnea(model, &mut data, q, v, &zero, &[]), &h, 0.0, EXACT);
        let tau_of_a = rnea(model, &mut data, q, v, a, &[]).to_vec();
        inverse.compare((&M * vector(a) + vector(&h)).as_slice(), &tau_of_a, 0.0, ROUNDING);
        for i in 0..nv {
            let mut unit = zero.clone();
            unit[i] = 1.0;
            let column: Vec<f64> =
                rnea(model, &mut data, q, &zero, &unit, &[]).iter().zip(&g).map(|(t, g)| t - g).collect();
            columns.compare(&column, M.column(i).as_slice(), largest(&g), ROUNDING);
        }

        let qdd = aba(model, &mut data, q, v, tau, &[]).to_vec();
        // Compute |M| |q̈| + |h|, with the inertia matrix M and the bias efforts h. It is an upper bound of the terms
        // whose sum is τ.
        let parts = largest((M.abs() * vector(&qdd).abs()).as_slice()) + largest(&h);
        round.compare(rnea(model, &mut data, q, v, &qdd, &[]), tau, parts, bound);
        let again = aba(model, &mut data, q, v, &tau_of_a, &[]);
        back.compare(again, a, 0.0, bound);
        let M_inverse = minv(model, &mut data, q).clone();
        let scale = M_inverse.amax() * M.amax();
        identity.compare((&M * &M_inverse).as_slice(), DMatrix::identity(nv, nv).as_slice(), scale, bound);
        if let Some(factor) = M.clone().cholesky() {
            forward.compare(&qdd, factor.solve(&(vector(tau) - vector(&h))).as_slice(), 0.0, bound);
        }

        let C = coriolis_matrix(model, &mut data, q, v).clone();
        coriolis.compare((&C * vector(v) + vector(&g)).as_slice(), &h, 0.0, ROUNDING);
        skew.compare(inertia_rate(model, q, v).as_slice(), (&C + C.transpose()).as_slice(), M.amax(), ROUNDING);
        let T = forward_velocities(model, &mut data, q, v).kinetic_energy();
        kinetic.compare(&[T], &[0.5 * vector(v).dot(&(&M * vector(v)))], 0.0, ROUNDING);
        let d = energy_derivatives(model, &mut data, q, v);
        let terms = [(d.dT_dq, v), (d.dV_dq, v), (d.dT_dv, &qdd[..])].map(|(d, x)| vector(d).dot(&vector(x)));
        let size = terms.iter().fold(0.0, |most: f64, x| most.max(x.abs()))
            + d.dT_dv.iter().zip(&qdd).map(|(x, y)| (x * y).abs()).sum::<f64>();
        power.compare(&[terms.iter().sum()], &[vector(tau).dot(&vector(v))], size, bound);

        let mut rotors = vector(a).component_mul(&vector(model.armature()));
        add_armature_bias(model, v, rotors.as_mut_slice());
        let Y = joint_torque_regressor(model, &mut data, q, v, a);
        let size = largest((Y.abs() * pi.abs()).as_slice());
        regressor.compare((Y * &pi + rotors).as_slice(), &tau_of_a, size, ROUNDING);

        if mass > 0.0 {
            let map = centroidal_map_rate(model, &mut data, q, v);
            let (drift, found) = ((map.Ag * vector(a) + map.dAg * vector(v)), map.hg.linear);
            let momentum = forward_accelerations(model, &mut data, q, v, a).centroidal_momentum_rate().to_array();
            rate.compare(drift.as_slice(), &momentum, 0.0, ROUNDING);
            let mut com = |s: f64| {
                let (mut moved, way) = (q.to_vec(), v.iter().map(|v| s * STEP * v).collect::<Vec<_>>());
                integrate(model, q, &way, &mut moved);
                forward_kinematics(model, &mut data, &moved).com()
            };
            let speed = (com(1.0) - com(-1.0)).scale(mass / (2.0 * STEP)).to_array();
            linear.compare(&found.to_array(), &speed, 0.0, DIFFERENCE);
        }
        if floats && mass > 0.0 {
            let R = forward_kinematics(model, &mut data, q).body(1).rotation;
            let mut fall = zero.clone();
            // Expect the acceleration of free fall, in the axes of the base.
            fall[..3].copy_from_slice(&R.transpose_mul(g0).to_array());
            falling.compare(
                rnea(model, &mut data, q, &zero, &fall, &[]),
                &zero,
                mass * g0.norm_squared().sqrt(),
                INVERTED,
            );
            let mut loose = tau.to_vec();
            loose[..6].fill(0.0);
            let qdd = aba(model, &mut data, q, v, &loose, &[]).to_vec();
            let found = forward_accelerations(model, &mut data, q, v, &qdd).centroidal_momentum_rate().to_array();
            let g = g0.scale(mass).to_array();
            let parts = largest((M.abs() * vector(&qdd).abs()).as_slice());
            newton.compare(&found, &[g[0], g[1], g[2], 0.0, 0.0, 0.0], parts, bound);
        }
    }
    positive.note = format!("λ_min {lowest:.1e}");
    let rows = vec![
        inverse, round, back, columns, forward, identity, symmetric, positive, weight, bias, coriolis, skew, kinetic,
        power, linear, rate, newton, falling, regressor,
    ];
    rows.into_iter().filter(|row| row.cases > 0).collect()
}

/// Returns the largest magnitude of the numbers.
pub(super) fn largest(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// Returns Ṁ, the derivative of the inertia matrix M along the velocity v: the ε part of M(q ⊕ ε v).
fn inertia_rate(model: &Model, q: &[f64], v: &[f64]) -> DMatrix<f64> {
    let q: Vec<Dual64> = q.iter().map(|&q| Dual64::from(q)).collect();
    let way: Vec<Dual64> = v.iter().map(|&v| Dual64::new(0.0, v)).collect();
    let mut moved = q.clone();
    integrate(model, &q, &way, &mut moved);
    crba(model, &mut Data::<Dual64>::new(model), &moved).map(|x| x.eps)
}
