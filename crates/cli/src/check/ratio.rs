//! Checks forward dynamics with a mass ratio of 10⁶. Heavy tips on light limbs cause the largest rounding errors.

use super::identities::{SOLVES, inverted, largest, spectrum};
use super::ledger::Row;
use crate::error::Error;
use crate::robot;
use crate::states::States;
use condyle::{Data, Inertia, Model, aba, crba, nonlinear_effects, regressors::inertial_parameters, rnea};
use nalgebra::DVector;

/// Mass of a tip relative to the body that carries it.
const RATIO: f64 = 1e6;

/// Checks ABA of the robot with heavy tips. Compares ABA with RNEA, and with the solution of a linear system with the
/// inertia matrix M. Returns no rows if no body with mass carries another body with mass.
pub(super) fn check(model: &Model, states: usize, seed: u64, armature: f64) -> Result<Vec<Row>, Error> {
    let mut round = Row::new("mass ratio 10⁶", "rnea(q, v, aba(q, v, τ)) = τ", SOLVES);
    let mut forward = Row::new("mass ratio 10⁶", "aba(q, v, τ) = M⁻¹ (τ − h)", SOLVES);
    let factors = factors(model);
    if factors.iter().all(|&f| f == 1.0) {
        return Ok(Vec::new());
    }
    let scaled = |i: usize, I: Inertia<f64>| {
        // Scale the parameters, because an inertia is linear in its parameters.
        inertial_parameters::to_inertia(inertial_parameters::from_inertia(I).map(|x| x * factors[i]))
    };
    let (model, _) = robot::regular(model.with_inertias(scaled)?, armature)?;
    let (mut data, all) = (Data::new(&model), States::new(&model, states, seed));
    let mut worst = 0.0_f64;
    for k in 0..states {
        let [q, v, _, tau] = all.at(&model, k);
        let vector = DVector::from_column_slice;
        let M = crba(&model, &mut data, q).clone();
        let (_, condition) = spectrum(&M);
        worst = worst.max(condition);
        let h = nonlinear_effects(&model, &mut data, q, v).to_vec();
        let qdd = aba(&model, &mut data, q, v, tau, &[]).to_vec();
        let parts = largest((M.abs() * vector(&qdd).abs()).as_slice()) + largest(&h);
        let bound = inverted(condition);
        round.compare(rnea(&model, &mut data, q, v, &qdd, &[]), tau, parts, bound);
        if let Some(factor) = M.cholesky() {
            forward.compare(&qdd, factor.solve(&(vector(tau) - vector(&h))).as_slice(), 0.0, bound);
        }
    }
    round.note = format!("κ(M) up to {worst:.0e}");
    Ok(vec![round, forward].into_iter().filter(|row| row.cases > 0).collect())
}

/// Returns a factor for the inertia of each body. A body with mass at the end of a limb becomes 10⁶ times as heavy as
/// the next body with mass on the path to the root.
fn factors(model: &Model) -> Vec<f64> {
    let bodies = model.bodies();
    let mut factors = vec![1.0; bodies.len()];
    let mut carries = vec![false; bodies.len()]; // whether each body carries a body with mass
    for i in (1..bodies.len()).rev() {
        let (b, mut below) = (&bodies[i], bodies[i].parent);
        while below > 0 && bodies[below].inertia.mass == 0.0 {
            below = bodies[below].parent;
        }
        if b.inertia.mass > 0.0 && !carries[i] && below > 0 {
            factors[i] = RATIO * bodies[below].inertia.mass / b.inertia.mass;
        }
        carries[b.parent] |= carries[i] || b.inertia.mass > 0.0;
    }
    factors
}
