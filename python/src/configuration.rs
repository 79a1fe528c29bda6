//! Functions of positions and of tangent vectors between them.

use crate::arrays::{Computed, Give};
use crate::exceptions::wrong_word;
use crate::functions::functions;
use crate::model::Model;
use condyle::{
    Scalar,
    configuration::{DifferenceArgument, IntegrateArgument},
};
use nalgebra::DMatrix;
use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use rand::SeedableRng;
use rand::rngs::{StdRng, SysRng};

/// Draws a random position, nq numbers: uniform between the limits, within ±3 (rad, m) for a coordinate without limits,
/// and uniform over the whole group for rotations.
///
/// seed: a number below 2⁶⁴; the same seed gives the same position. None draws a new seed from the system.
#[pyfunction]
#[pyo3(signature = (model, seed=None))]
pub(crate) fn random_configuration<'py>(model: &Bound<'py, Model>, seed: Option<u64>) -> PyResult<Bound<'py, PyAny>> {
    let mut rng = match seed {
        Some(seed) => StdRng::seed_from_u64(seed),
        // each call takes a new seed from the system: otherwise forked processes would draw equal numbers
        None => StdRng::try_from_rng(&mut SysRng).map_err(|error| PyOSError::new_err(error.to_string()))?,
    };
    condyle::random_configuration(&model.get().inner, &mut rng).give(model.py(), None)
}

functions! {
/// Returns the neutral position, nq numbers: zeros, and the identity for rotations.
///
/// >>> condyle.neutral(condyle.robots.quadruped())[:7]
/// array([0., 0., 0., 0., 0., 0., 1.])
fn neutral(model;) {
    condyle::neutral(model)
}

/// Computes the position q ⊕ v that is reached from q with the velocity v after one unit of time, nq numbers.
///
/// q: position, nq numbers; v: tangent vector, nv numbers.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q0 = condyle.neutral(quadruped)
/// >>> q1 = condyle.integrate(quadruped, q0, np.full(18, 0.1))
/// >>> np.allclose(condyle.difference(quadruped, q0, q1), 0.1)
/// True
fn integrate(model; q: Position, v: Tangent; out) {
    Computed::new([model.nq()], |moved| condyle::integrate(model, &q, &v, moved))
}
each(q: Position, v: Tangent) -> [nq] |moved| { condyle::integrate(model, q, v, moved); }

/// Computes the tangent vector v = q₁ ⊖ q₀ with q₀ ⊕ v = q₁, nv numbers. For rotations, v is the shortest vector with
/// this property.
///
/// q0, q1: positions, nq numbers each.
fn difference(model; q0: Position, q1: Position; out) {
    Computed::new([model.nv()], |v| condyle::difference(model, &q0, &q1, v))
}
each(q0: Position, q1: Position) -> [nv] |v| { condyle::difference(model, q0, q1, v); }

/// Computes the position q₀ ⊕ t (q₁ ⊖ q₀) on the path from q₀ (t = 0) to q₁ (t = 1) at constant velocity, nq numbers.
///
/// q0, q1: positions, nq numbers each; t: a number, which may be below 0 or above 1.
///
/// >>> condyle.interpolate(condyle.robots.arm7(), [0.0] * 7, [1.0] * 7, 0.25)
/// array([0.25, 0.25, 0.25, 0.25, 0.25, 0.25, 0.25])
fn interpolate(model; q0: Position, q1: Position, t: Real; out) {
    let (mut tangent, mut q) = (vec![Scalar::zero(); model.nv()], vec![Scalar::zero(); model.nq()]);
    condyle::configuration::interpolate(model, &q0, &q1, t, &mut tangent, &mut q);
    q
}
each(q0: Position, q1: Position; t: Real) -> [nq] |q| {
    condyle::configuration::interpolate(model, q0, q1, t, &mut vec![0.0; model.nv()], q)
}

/// Computes the distance ‖q₁ ⊖ q₀‖, in which lengths (m) and angles (rad) have equal weight.
///
/// q0, q1: positions, nq numbers each.
fn distance(model; q0: Position, q1: Position) {
    condyle::configuration::distance(model, &q0, &q1, &mut vec![Scalar::zero(); model.nv()])
}
each(q0: Position, q1: Position) -> [] |to| {
    to[0] = condyle::configuration::distance(model, q0, q1, &mut vec![0.0; model.nv()])
}

/// Returns the position q with its quaternions and its pairs (cos, sin) scaled to length 1, nq numbers. The argument q
/// does not change unless q is also `out`.
///
/// q: position, nq numbers.
///
/// Raises `ModelError` for a quaternion or a pair whose length is 0 or not finite.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> q = condyle.neutral(quadruped)
/// >>> q[6] = 2.0
/// >>> np.array_equal(condyle.normalize(quadruped, q), condyle.neutral(quadruped))
/// True
fn normalize(model; q: Scalable; out) {
    let mut q = q.to_vec();
    condyle::normalize(model, &mut q);
    q
}
each(q: Scalable) -> [nq] |to| {
    to.copy_from_slice(q);
    condyle::normalize(model, to)
}

/// Transports the columns of X, which are tangent vectors at q ⊕ v, to the tangent space at q: (∂(q ⊕ v)/∂q)⁻¹ X.
///
/// v: tangent vector, nv numbers; X: a matrix of nv rows. Pinocchio's `dIntegrateTransport` multiplies X by ∂(q ⊕ v)/∂q
/// instead. Its result equals `transport` with −v.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> v = np.full(18, 0.1)
/// >>> J = condyle.integrate_jacobian(quadruped, v, "position")
/// >>> np.allclose(condyle.transport(quadruped, v, J), np.eye(18))
/// True
fn transport(model; v: Tangent, X: Tangents; out) {
    let mut moved = X;
    condyle::configuration::transport(model, &v, &mut moved);
    moved
}

/// Computes the Jacobian ∂(q ⊕ v)/∂q or ∂(q ⊕ v)/∂v between tangent spaces: (nv, nv), block-diagonal. The Jacobian does
/// not depend on q.
///
/// v: tangent vector, nv numbers; argument: 'position' for q or 'velocity' for v.
fn integrate_jacobian(model; v: Tangent, argument: Word; out) {
    let argument = match argument {
        "position" => IntegrateArgument::Position,
        "velocity" => IntegrateArgument::Velocity,
        other => return Err(wrong_word("argument", "'position' or 'velocity'", other)),
    };
    let mut J = DMatrix::from_element(model.nv(), model.nv(), condyle::Scalar::zero());
    condyle::configuration::integrate_jacobian(model, &v, argument, &mut J);
    J
}

/// Computes the Jacobian ∂(q₁ ⊖ q₀)/∂q₀ or ∂(q₁ ⊖ q₀)/∂q₁ between tangent spaces: (nv, nv), block-diagonal. The
/// Jacobian depends only on the difference of the positions.
///
/// d: q₁ ⊖ q₀, nv numbers; argument: 'from' for q₀ or 'to' for q₁.
fn difference_jacobian(model; d: Tangent, argument: Word; out) {
    let argument = match argument {
        "from" => DifferenceArgument::From,
        "to" => DifferenceArgument::To,
        other => return Err(wrong_word("argument", "'from' or 'to'", other)),
    };
    let mut J = DMatrix::from_element(model.nv(), model.nv(), condyle::Scalar::zero());
    condyle::configuration::difference_jacobian(model, &d, argument, &mut J);
    J
}
}
