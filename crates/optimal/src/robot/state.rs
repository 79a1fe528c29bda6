//! The state x = (q, v) of a robot, and the linear algebra that its Jacobians' sparsity allows.

use condyle_dynamics::{Joint, Model, difference, integrate};
use core::ops::Range;

/// x ⊕ δx, with δx = (δq, δv): q ⊕ δq in the configuration space, v + δv.
pub(super) fn state_integrate(model: &Model, x: &[f64], dx: &[f64], out: &mut [f64]) {
    let (nq, nv) = (model.nq(), model.nv());
    integrate(model, &x[..nq], &dx[..nv], &mut out[..nq]);
    for k in 0..nv {
        out[nq + k] = x[nq + k] + dx[nv + k];
    }
}

/// x₁ ⊖ x₀ = (q₁ ⊖ q₀, v₁ − v₀).
pub(super) fn state_difference(model: &Model, x0: &[f64], x1: &[f64], out: &mut [f64]) {
    let (nq, nv) = (model.nq(), model.nv());
    difference(model, &x0[..nq], &x1[..nq], &mut out[..nv]);
    for k in 0..nv {
        out[nv + k] = x1[nq + k] - x0[nq + k];
    }
}

/// The degrees of freedom of each joint whose group is not commutative: elsewhere the Jacobians of ⊕ and ⊖ are ±1.
pub(super) fn groups(model: &Model) -> Vec<Range<usize>> {
    let group = |joint| matches!(joint, Joint::Spherical | Joint::Planar | Joint::FreeFlyer);
    model.bodies()[1..].iter().filter(|b| group(b.joint)).map(|b| b.idx_v..b.idx_v + b.joint.nv()).collect()
}
