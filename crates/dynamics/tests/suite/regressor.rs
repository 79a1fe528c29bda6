//! Tests of regressors: dynamics and energies are linear in the inertial parameters.

use crate::common;

use common::{State, Worst, all_models, armature_torque, lift, rng};
use condyle_dynamics::{
    Data, Inertia, Model, forward_kinematics, forward_velocities, inertial_parameters, joint_torque_regressor,
    kinetic_energy_regressor, potential_energy_regressor, rnea, robots,
};
use nalgebra::{DVector, RowDVector};
use num_dual::Dual64;

/// Tolerance of sums over all bodies, relative to the largest number.
const ROUNDING: f64 = 1e-12;
const TREES: u64 = 8;

/// Returns the inertial parameters π of all bodies except the world.
fn parameters(model: &Model) -> DVector<f64> {
    DVector::from_iterator(
        10 * (model.bodies().len() - 1),
        model.bodies()[1..].iter().flat_map(|b| inertial_parameters::from_inertia(b.inertia)),
    )
}

/// Checks that the efforts are τ = Y π + armature · a, with the regressor Y and the inertial parameters π.
#[test]
fn torques() {
    let mut worst = Worst::new("Y π = rnea", ROUNDING);
    for (seed, model) in all_models(4 * TREES).iter().enumerate() {
        let mut data = Data::new(model);
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let Y = joint_torque_regressor(model, &mut data, &q, &v, &a);
        assert_eq!(Y.shape(), (model.nv(), 10 * (model.bodies().len() - 1)));
        let mut tau = Y * parameters(model);
        tau += DVector::from(armature_torque(model, &v, &a));
        worst.see(model, tau.as_slice(), rnea(model, &mut data, &q, &v, &a, &[]));
    }
}

/// Checks that each column of Y is the derivative of the torques with respect to a parameter, by dual numbers in the
/// model's constants.
#[test]
fn columns_are_derivatives() {
    let mut worst = Worst::new("Y = ∂τ/∂π", ROUNDING);
    for (seed, model) in all_models(2).iter().enumerate() {
        let mut data = Data::new(model);
        let State { q, v, a, .. } = State::random(model, &mut rng(seed as u64));
        let Y = joint_torque_regressor(model, &mut data, &q, &v, &a);
        for column in (0..Y.ncols()).step_by(3) {
            let dual = model
                .with_inertias(|body, I| -> Inertia<Dual64> {
                    let mut pi = inertial_parameters::from_inertia(I.lift::<Dual64>());
                    if body == column / 10 + 1 {
                        pi[column % 10].eps = 1.0;
                    }
                    inertial_parameters::to_inertia(pi)
                })
                .unwrap();
            let mut data = Data::new(&dual);
            let tau = rnea(&dual, &mut data, &lift(&q), &lift(&v), &lift(&a), &[]);
            worst.see(model, Y.column(column).as_slice(), &common::eps(tau));
        }
    }
}

#[test]
fn energies() {
    let mut kinetic = Worst::new("y π = T", ROUNDING);
    let mut potential = Worst::new("y π = V", ROUNDING);
    for (seed, model) in all_models(4 * TREES).iter().enumerate() {
        let mut data = Data::new(model);
        let State { q, v, .. } = State::random(model, &mut rng(seed as u64));
        let pi = parameters(model);
        let mut T = RowDVector::from_row_slice(kinetic_energy_regressor(model, &mut data, &q, &v)) * &pi;
        for k in 0..model.nv() {
            T[0] += 0.5 * model.armature()[k] * v[k] * v[k];
        }
        let V = RowDVector::from_row_slice(potential_energy_regressor(model, &mut data, &q)) * &pi;
        let found = forward_velocities(model, &mut data, &q, &v).kinetic_energy();
        kinetic.see(model, T.as_slice(), &[found]);
        potential.see(model, V.as_slice(), &[forward_kinematics(model, &mut data, &q).potential_energy()]);
    }
}

/// Checks that the regressor Y does not contain results of earlier calls with the same `Data`.
#[test]
fn nothing_is_left_over() {
    let model = robots::quadruped();
    let mut data = Data::new(&model);
    let [one, other] = [1, 2].map(|seed| State::random(&model, &mut rng(seed)));
    let first = joint_torque_regressor(&model, &mut data, &one.q, &one.v, &one.a).clone();
    joint_torque_regressor(&model, &mut data, &other.q, &other.v, &other.a);
    assert_eq!(&first, joint_torque_regressor(&model, &mut data, &one.q, &one.v, &one.a));
}

#[test]
#[should_panic(expected = "a: expected 7 numbers, found 6")]
fn wrong_shape() {
    let arm = robots::arm7();
    joint_torque_regressor(&arm, &mut Data::new(&arm), &[0.0; 7], &[0.0; 7], &[0.0; 6]);
}
