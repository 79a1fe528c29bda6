//! Dynamics and energies as linear functions of the inertial parameters.

use super::kinematics::{forward_accelerations, forward_kinematics, forward_velocities};
use crate::data::Data;
use crate::passes::regressor;
use condyle_model::Model;
use condyle_spatial::{Constant, Matrix, Scalar};

/// Computes the regressor Y(q, v, a) of inverse dynamics, τ = Y π, in O(n · depth). π are the inertial parameters of
/// all bodies; armature is excluded.
///
/// q: nq numbers; v, a: nv numbers each. Returns an nv × 10 (bodies − 1) matrix. Columns 10 (i − 1) to 10 i − 1 belong
/// to body i, in the order and frame of
/// [`inertial_parameters::from_inertia`](crate::inertial_parameters::from_inertia). Armature is not an inertial
/// parameter: with armature, τ = Y π + armature a. Along the linear coordinates of a free joint, armature adds armature
/// · (v̇ + ω × v). Allocates nothing. Source: Atkeson, An, Hollerbach (1986).
///
/// ```
/// use condyle_dynamics::{Data, inertial_parameters, joint_torque_regressor, rnea, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
/// let pi: Vec<f64> = arm.bodies()[1..].iter().flat_map(|b| inertial_parameters::from_inertia(b.inertia)).collect();
/// let tau = joint_torque_regressor(&arm, &mut data, &q, &v, &a) * nalgebra::DVector::from(pi);
/// for (found, expected) in tau.iter().zip(rnea(&arm, &mut data, &q, &v, &a, &[])) {
///     assert!((found - expected).abs() < 1e-12);
/// }
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn joint_torque_regressor<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> &'d Matrix<S> {
    forward_accelerations(model, data, q, v, a);
    regressor::torque(model, &data.world, &data.moving, &mut data.regressor);
    &data.regressor.torque
}

/// Computes the regressor y(q, v) of the kinetic energy, T = y · π, in O(n) for n bodies. π are the inertial parameters
/// of all bodies. The energy ½ armature v² of the rotors is excluded.
///
/// q: nq numbers; v: nv numbers. Returns 10 (bodies − 1) numbers: ½ y(v_i, v_i) for each body i with velocity v_i, in
/// the order and frame of [`inertial_parameters::from_inertia`](crate::inertial_parameters::from_inertia). Allocates
/// nothing. Source: Gautier and Khalil, *Direct calculation of minimum set of inertial parameters of serial robots*
/// (1990).
///
/// ```
/// use condyle_dynamics::{Data, kinetic_energy_regressor, neutral, robots};
/// let quadruped = robots::quadruped();
/// let mut v = [0.0; 18];
/// v[1] = 2.0; // all bodies move with 2 m/s
/// let y = kinetic_energy_regressor(&quadruped, &mut Data::new(&quadruped), &neutral(&quadruped), &v).to_vec();
/// assert!((0..12).all(|body| f64::abs(y[10 * body] - 0.5 * 2.0 * 2.0) < 1e-12)); // ½ v² of each mass
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn kinetic_energy_regressor<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> &'d [S] {
    forward_velocities(model, data, q, v);
    regressor::kinetic(model, &data.world, &data.moving, &mut data.regressor);
    &data.regressor.kinetic
}

/// Computes the regressor y(q) of the potential energy, V = y · π, in O(n) for n bodies. π are the inertial parameters
/// of all bodies. V is zero for a mass at the world's origin.
///
/// q: nq numbers. Returns 10 (bodies − 1) numbers, \[−g · p_i, −R_iᵀ g, 0\] for each body i with pose (R_i, p_i), in
/// the order and frame of [`inertial_parameters::from_inertia`](crate::inertial_parameters::from_inertia). Allocates
/// nothing. Source: V_i = −g · (m p_i + R_i m c); Gautier and Khalil (1990).
///
/// ```
/// use condyle_dynamics::{Data, neutral, potential_energy_regressor, robots};
/// let quadruped = robots::quadruped();
/// let mut q = neutral(&quadruped);
/// q[2] = 3.0;
/// let y = potential_energy_regressor(&quadruped, &mut Data::new(&quadruped), &q).to_vec();
/// assert_eq!(y[0], 9.81 * 3.0); // of each kilogram of the trunk
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, or `data` was made for a model of another tree.
#[track_caller]
pub fn potential_energy_regressor<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
) -> &'d [S] {
    forward_kinematics(model, data, q);
    regressor::potential(model, &data.world, &mut data.regressor);
    &data.regressor.potential
}
