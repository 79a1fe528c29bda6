//! Derivatives of a user's own function of the state, by dual numbers.
//!
//! A state x begins with a position q of nq numbers, which moves to q ⊕ δ; whatever follows (velocity, effort, …) moves
//! straight. So x of n numbers has n − nq + nv directions, and derivatives are by these: of f(x ⊕ δ) at δ = 0.
//!
//! One direction is a dual number, two are a hyper-dual one (Fike and Alonso, *The development of hyper-dual numbers for
//! exact second-derivative calculations*, 2011): derivatives are exact, and cost one evaluation of f for each direction or
//! pair of directions. What has a derivative by hand has it many times faster.

use crate::configuration::integrate;
use crate::model::Model;
use condyle_spatial::Scalar;
use nalgebra::{DMatrix, DVector};
use num_dual::{Dual64, HyperDual64};

/// x ⊕ δ, on numbers that know the directions of δ.
fn moved<S: Scalar, R>(model: &Model<R>, x: &[f64], delta: &[S]) -> Vec<S> {
    let mut out: Vec<S> = x.iter().map(|&x| S::splat(x)).collect();
    let (q, rest) = out.split_at_mut(model.nq);
    let here = q.to_vec();
    integrate(model, &here, &delta[..model.nv], q);
    rest.iter_mut().zip(&delta[model.nv..]).for_each(|(x, &d)| *x += d);
    out
}

/// How many directions a state has.
fn directions<R>(model: &Model<R>, x: &[f64]) -> usize {
    assert!(x.len() >= model.nq, "x: expected at least {} numbers, found {}", model.nq, x.len());
    x.len() - model.nq + model.nv
}

/// f(x) and its Jacobian ∂f(x ⊕ δ)/∂δ, exact, in one evaluation of f for each direction.
///
/// x: a position of nq numbers, then any others. Returns f(x), m numbers, and an m × (nv + others) matrix.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, jacobian, robots};
/// let arm = robots::arm7();
/// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
/// let (p, J) = jacobian(&arm, &[0.3; 7], |q| {
///     forward_kinematics(&arm, &mut data, q).frame(tool).translation.to_array().to_vec()
/// });
/// assert_eq!((p.len(), J.shape()), (3, (3, 7)));
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If x has fewer than nq numbers, or f gives another number of results for another x.
pub fn jacobian<R>(
    model: &Model<R>,
    x: &[f64],
    mut f: impl FnMut(&[Dual64]) -> Vec<Dual64>,
) -> (DVector<f64>, DMatrix<f64>) {
    let n = directions(model, x);
    let mut delta = vec![Dual64::from(0.0); n];
    let value = f(&moved(model, x, &delta));
    let mut J = DMatrix::zeros(value.len(), n);
    for k in 0..n {
        delta[k].eps = 1.0;
        let along = f(&moved(model, x, &delta));
        delta[k].eps = 0.0;
        assert!(along.len() == value.len(), "f: gave {} results, then {}", value.len(), along.len());
        J.column_mut(k).iter_mut().zip(&along).for_each(|(to, from)| *to = from.eps);
    }
    (DVector::from_iterator(value.len(), value.iter().map(|x| x.re)), J)
}

/// f(x) and its gradient ∂f(x ⊕ δ)/∂δ, exact, in one evaluation of f for each direction.
///
/// x: a position of nq numbers, then any others. Returns f(x) and nv + others numbers.
///
/// ```
/// use condyle_dynamics::{Data, gradient, rnea, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
/// // what the motors heat up by, as a function of position, velocity and acceleration
/// let (heat, by_all) = gradient(&arm, &[q, v, a].concat(), |x| {
///     rnea(&arm, &mut data, &x[..7], &x[7..14], &x[14..], &[]).iter().map(|&tau| tau * tau).sum()
/// });
/// assert!(heat > 0.0);
/// assert_eq!(by_all.len(), 21);
/// ```
///
/// # Panics
/// If x has fewer than nq numbers.
pub fn gradient<R>(model: &Model<R>, x: &[f64], mut f: impl FnMut(&[Dual64]) -> Dual64) -> (f64, DVector<f64>) {
    let (value, J) = jacobian(model, x, |x| vec![f(x)]);
    (value[0], J.row(0).transpose())
}

/// f(x), its gradient and its Hessian ∂²f(x ⊕ δ)/∂δ∂δ, exact, in one evaluation of f for each pair of directions.
///
/// x: a position of nq numbers, then any others. Returns f(x), nv + others numbers, and as many squared.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, hessian, robots, static_torque_derivative};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (_, g, stiffness) = hessian(&arm, &[0.3; 7], |q| forward_kinematics(&arm, &mut data, q).potential_energy());
/// let mut data = Data::new(&arm);
/// assert!((stiffness - static_torque_derivative(&arm, &mut data, &[0.3; 7], &[])).amax() < 1e-12);
/// assert_eq!(g.len(), 7);
/// ```
///
/// # Panics
/// If x has fewer than nq numbers.
pub fn hessian<R>(
    model: &Model<R>,
    x: &[f64],
    mut f: impl FnMut(&[HyperDual64]) -> HyperDual64,
) -> (f64, DVector<f64>, DMatrix<f64>) {
    let n = directions(model, x);
    let mut delta = vec![HyperDual64::from(0.0); n];
    let mut value = f(&moved(model, x, &delta)).re;
    let (mut g, mut H) = (DVector::zeros(n), DMatrix::zeros(n, n));
    for j in 0..n {
        delta[j].eps1 = 1.0;
        for k in 0..=j {
            delta[k].eps2 = 1.0;
            let along = f(&moved(model, x, &delta));
            delta[k].eps2 = 0.0;
            (value, g[j]) = (along.re, along.eps1);
            (H[(j, k)], H[(k, j)]) = (along.eps1eps2, along.eps1eps2);
        }
        delta[j].eps1 = 0.0;
    }
    (value, g, H)
}
