//! Inverse dynamics: efforts that produce a given motion of a robot.

use super::kinematics::{forward_kinematics, forward_velocities};
use super::limbs;
use crate::data::{Data, check_forces};
use crate::lanes::limbs::pass::Arguments;
use crate::passes::{coriolis, rnea, statics};
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Constant, Force, Matrix, Scalar};

/// Runs the recursive Newton–Euler algorithm. Limbs are computed in parallel lanes if the robot has limbs; otherwise
/// the algorithm runs body by body.
fn run<S: Scalar, R: Constant<S>>(model: &Model<R>, data: &mut Data<S>, arguments: Arguments<'_, S>) {
    if !limbs::rnea(model, data, arguments) {
        let Arguments { q, v, x: a, f_ext } = arguments;
        rnea::run(model, &mut data.world, &mut data.rnea, q, v, a, f_ext);
    }
}

/// Computes inverse dynamics in O(n) for n bodies: the joint efforts τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i for the
/// acceleration a.
///
/// q: nq numbers; v, a: nv numbers each; f_ext: one force per body (N, N m), at the body's origin and in the body's
/// frame, or empty for no forces; index 0 is the world. Returns nv numbers (N m, N). Allocates nothing. Source: Luh,
/// Walker, Paul (1980).
///
/// ```
/// use condyle_dynamics::{Data, robots, rnea};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let tau = rnea(&arm, &mut data, &[0.3; 7], &[0.0; 7], &[0.0; 7], &[]);
/// assert!(f64::abs(tau[0]) < 1e-9); // gravity does not turn a vertical axis
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn rnea<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    let arguments = Arguments { q, v, x: a, f_ext };
    check_arguments(model, data, "a", arguments);
    run(model, data, arguments);
    &data.rnea.tau
}

/// Panics if an argument has the wrong length, or `data` was made for a model of another tree. `name` is the name of
/// the argument `x` in the message of the panic.
#[inline]
#[track_caller]
pub(crate) fn check_arguments<S, R>(model: &Model<R>, data: &Data<S>, name: &str, arguments: Arguments<'_, S>) {
    let Arguments { q, v, x, f_ext } = arguments;
    data.check(model);
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check(name, x.len(), model.nv());
    check_forces(f_ext.len(), model.nodes().len());
}

/// Computes the bias efforts h(q, v) = C(q, v) v + g(q), in O(n) for n bodies. These efforts keep the velocity
/// constant. The result equals [`rnea`] with a = 0.
///
/// q: nq numbers; v: nv numbers. Returns nv numbers (N m, N). Allocates nothing.
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn nonlinear_effects<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    let zero = core::mem::take(&mut data.rnea.zero);
    run(model, data, Arguments { q, v, x: &zero, f_ext: &[] });
    data.rnea.zero = zero;
    &data.rnea.tau
}

/// Computes the gravity efforts g(q), in O(n) for n bodies. These efforts hold the robot still. The result equals
/// [`rnea`] with v = a = 0.
///
/// q: nq numbers. Returns nv numbers (N m, N). Allocates nothing.
///
/// ```
/// use condyle_dynamics::{Data, gravity, robots};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let q = condyle_dynamics::neutral(&quadruped);
/// let g = gravity(&quadruped, &mut data, &q);
/// assert!((g[2] - 9.81 * quadruped.total_mass()).abs() < 1e-9); // the base carries the weight
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, or `data` was made for a model of another tree.
#[track_caller]
pub fn gravity<'d, S: Scalar, R: Constant<S>>(model: &Model<R>, data: &'d mut Data<S>, q: &[S]) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq());
    let zero = core::mem::take(&mut data.rnea.zero);
    run(model, data, Arguments { q, v: &zero, x: &zero, f_ext: &[] });
    data.rnea.zero = zero;
    &data.rnea.tau
}

/// Computes the efforts that hold the robot still under external forces, in O(n) for n bodies: τ = g(q) − Σ Jᵢᵀ
/// f_ext,i. The result equals [`rnea`](crate::rnea) with v = a = 0, at a lower cost.
///
/// q: nq numbers; f_ext: one force per body (N, N m), at the body's origin and in the body's frame, or empty for no
/// forces; index 0 is the world. Returns nv numbers (N m, N). Allocates nothing. Source: Featherstone, *Rigid Body
/// Dynamics Algorithms* (2008), section 5.3.
///
/// ```
/// use condyle_dynamics::{Data, Force, Vec3, robots, static_torque};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let q = condyle_dynamics::neutral(&quadruped);
/// let mut f_ext = vec![Force::zero(); quadruped.bodies().len()];
/// f_ext[1].linear.z = 9.81 * quadruped.total_mass(); // hung up by its trunk
/// let tau = static_torque(&quadruped, &mut data, &q, &f_ext);
/// assert!(f64::abs(tau[2]) < 1e-9); // nothing else need carry it
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn static_torque<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    check_forces(f_ext.len(), model.nodes().len());
    forward_kinematics(model, data, q);
    statics::run(model, &data.world, &mut data.statics, f_ext);
    &data.statics.tau
}

/// Computes the Coriolis matrix C(q, v) with the Christoffel symbols as coefficients, in O(n · depth). C satisfies C v
/// = h − g and C + Cᵀ = Ṁ, so Ṁ − 2C is skew-symmetric.
///
/// q: nq numbers; v: nv numbers. Returns the full nv × nv matrix (N m s/rad, N s/m). Allocates nothing. Source:
/// Echeandia and Wensing (2021), algorithm 1.
///
/// ```
/// use condyle_dynamics::{Data, coriolis_matrix, gravity, nonlinear_effects, robots};
/// use nalgebra::DVector;
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v) = ([0.3; 7], [0.1; 7]);
/// let forces = coriolis_matrix(&arm, &mut data, &q, &v) * DVector::from_row_slice(&v);
/// let h = DVector::from_row_slice(nonlinear_effects(&arm, &mut data, &q, &v));
/// let g = DVector::from_row_slice(gravity(&arm, &mut data, &q));
/// assert!((forces - (h - g)).amax() < 1e-13);
/// ```
///
/// # Panics
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn coriolis_matrix<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> &'d Matrix<S> {
    forward_velocities(model, data, q, v);
    coriolis::run(model, &data.world, &data.moving, &mut data.coriolis);
    &data.coriolis.C
}
