//! Centre of mass, momentum and energies: one Python function for each function of the library.

use crate::arrays::named_tuples;
use crate::functions::{any, functions};
use pyo3::prelude::*;

named_tuples! {
    CentroidalMap<'_> { Ag, Ig, com, Jcom }
    CentroidalMapRate<'_> { Ag, dAg, hg, Ig, com, com_velocity, Jcom }
    AllTerms<'_> { M, h, centroidal, kinetic_energy, potential_energy }
}

functions! {
/// Computes the centre of mass c of the moving bodies in the world's frame, 3 numbers (m); O(n).
///
/// q: position, nq numbers. Bodies fixed to the world are not included. The result is NaN if no moving body has a mass.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> com = condyle.com(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(com[1]) < 1e-12)  # left and right weigh the same
/// True
fn com(model, data; q: Position; out) {
    condyle::forward_kinematics(model, data, &q).com()
}
batch b: any(q: Position) -> One { b.com(model, q) }

/// Computes the velocity ċ of the centre of mass of the moving bodies in the world's frame, 3 numbers (m/s); O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers.
fn com_velocity(model, data; q: Position, v: Tangent; out) {
    condyle::forward_velocities(model, data, &q, &v).com_velocity()
}
batch b: any(q: Position, v: Tangent) -> One { b.com_velocity(model, q, v) }

/// Computes the acceleration c̈ of the centre of mass of the moving bodies in the world's frame, 3 numbers (m/s²);
/// O(n). Gravity is not subtracted.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
fn com_acceleration(model, data; q: Position, v: Tangent, a: Tangent; out) {
    condyle::forward_accelerations(model, data, &q, &v, &a).com_acceleration()
}
batch b: any(q: Position, v: Tangent, a: Tangent) -> One { b.com_acceleration(model, q, v, a) }

/// Computes the Jacobian Jcom(q) of the centre of mass, (3, nv), with ċ = Jcom v; O(n).
///
/// q: position, nq numbers. The result is also a member of `centroidal_map`.
fn com_jacobian(model, data; q: Position; out) {
    condyle::centroidal::centroidal_map(model, data, &q).Jcom
}
batch b: any(q: Position) -> One { b.com_jacobian(model, q) }

/// Computes the centroidal momentum matrix Ag(q), with hg = Ag v, and the centroidal inertia, the centre of mass and
/// its Jacobian, in O(n), as `CentroidalMap(Ag, Ig, com, Jcom)`.
///
/// q: position, nq numbers. Bodies fixed to the world are not included. The results are NaN if no moving body has a
/// mass. out: four arrays, such as an earlier result.
///
/// >>> quadruped = condyle.robots.quadruped()
/// >>> map = condyle.centroidal_map(quadruped, condyle.Data(quadruped), condyle.neutral(quadruped))
/// >>> bool(abs(map.Ag[0, 0] - quadruped.total_mass) < 1e-9)  # pushed forwards, all goes forwards
/// True
fn centroidal_map(model, data; q: Position; out) {
    condyle::centroidal::centroidal_map(model, data, &q)
}
batch b: any(q: Position) -> Named("CentroidalMap") { b.centroidal_map(model, q) }

/// Computes the centroidal momentum matrix Ag(q), its rate along v, and the momentum hg = Ag v, in O(n), as
/// `CentroidalMapRate(Ag, dAg, hg, Ig, com, com_velocity, Jcom)`. The rate of hg is Ag a + dAg v.
///
/// q: position, nq numbers; v: velocity, nv numbers. Bodies fixed to the world are not included. The results are NaN if
/// no moving body has a mass. out: seven arrays, such as an earlier result.
fn centroidal_map_rate(model, data; q: Position, v: Tangent; out) {
    condyle::centroidal::centroidal_map_rate(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> Named("CentroidalMapRate") { b.centroidal_map_rate(model, q, v) }

/// Computes the centroidal momentum hg of the moving bodies, about their centre of mass and along the world's axes: 6
/// numbers (kg m/s, then kg m²/s); O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers.
fn centroidal_momentum(model, data; q: Position, v: Tangent; out) {
    condyle::forward_velocities(model, data, &q, &v).centroidal_momentum()
}
batch b: any(q: Position, v: Tangent) -> One { b.centroidal_momentum(model, q, v) }

/// Computes the rate of the centroidal momentum hg, along the world's axes: 6 numbers (N, then N m); O(n). The rate
/// equals the sum of the weight and the external forces about the centre of mass.
///
/// q: position, nq numbers; v, a: velocity and acceleration, nv numbers each.
fn centroidal_momentum_rate(model, data; q: Position, v: Tangent, a: Tangent; out) {
    condyle::forward_accelerations(model, data, &q, &v, &a).centroidal_momentum_rate()
}
batch b: any(q: Position, v: Tangent, a: Tangent) -> One { b.centroidal_momentum_rate(model, q, v, a) }

/// Computes the kinetic energy T = ½ vᵀ M(q) v of the moving bodies and the rotors (J); O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers.
///
/// >>> arm = condyle.robots.arm7()
/// >>> data, q, v = condyle.Data(arm), [0.3] * 7, np.full(7, 0.5)
/// >>> np.isclose(condyle.kinetic_energy(arm, data, q, v), 0.5 * v @ condyle.crba(arm, data, q) @ v).item()
/// True
fn kinetic_energy(model, data; q: Position, v: Tangent) {
    condyle::forward_velocities(model, data, &q, &v).kinetic_energy()
}
batch b: any(q: Position, v: Tangent) -> One { b.kinetic_energy(model, q, v) }

/// Computes the potential energy V = −m gᵀ c(q) of the moving bodies under gravity (J), 0 at the world's origin; O(n).
///
/// q: position, nq numbers.
fn potential_energy(model, data; q: Position) {
    condyle::forward_kinematics(model, data, &q).potential_energy()
}
batch b: any(q: Position) -> One { b.potential_energy(model, q) }

/// Computes the mechanical energy E = T + V (J); O(n).
///
/// q: position, nq numbers; v: velocity, nv numbers. The rate of E is the power of the efforts and the external forces.
fn mechanical_energy(model, data; q: Position, v: Tangent) {
    condyle::forward_velocities(model, data, &q, &v).mechanical_energy()
}
batch b: any(q: Position, v: Tangent) -> One { b.mechanical_energy(model, q, v) }

/// Computes all terms of the equations of motion in O(n depth), with one pass from the root to the tips and one back,
/// as `AllTerms(M, h, centroidal, kinetic_energy, potential_energy)`.
///
/// q: position, nq numbers; v: velocity, nv numbers. Up to rounding, the numbers equal `crba`, `nonlinear_effects`,
/// `centroidal_map_rate`, `kinetic_energy` and `potential_energy`.
///
/// >>> arm = condyle.robots.arm7()
/// >>> terms = condyle.compute_all_terms(arm, condyle.Data(arm), [0.3] * 7, [0.1] * 7)
/// >>> terms.M.shape, terms.h.shape, terms.centroidal.Ag.shape
/// ((7, 7), (7,), (6, 7))
fn compute_all_terms(model, data; q: Position, v: Tangent) {
    condyle::terms::compute_all_terms(model, data, &q, &v)
}
batch b: any(q: Position, v: Tangent) -> AllTerms { b.compute_all_terms(model, q, v) }
}
