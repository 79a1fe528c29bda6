//! Semi-implicit Euler, as Crocoddyl's: v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²), ℓ Δt.

use super::integrated::{ContinuousModel, Derivatives};
use crate::lq::LqNode;
use core::ops::Range;
use nalgebra::DMatrix;

/// The next state; returns ℓ Δt. Of a state that was prepared, `lane` is its number.
pub(super) fn calc<M: ContinuousModel>(
    model: &mut M,
    lane: Option<usize>,
    dt: f64,
    t: usize,
    x: &[f64],
    u: &[f64],
    dq: &mut [f64],
    next: &mut [f64],
) -> f64 {
    let (q, v) = x.split_at(model.nq());
    let (q_next, v_next) = next.split_at_mut(q.len());
    let (a, cost) = match lane {
        Some(i) => model.calc_prepared(i, t, x, u),
        None => model.calc(t, x, u),
    };
    for k in 0..v.len() {
        v_next[k] = v[k] + a[k] * dt; // v⁺ = v + a Δt
        dq[k] = v[k] * dt + a[k] * dt * dt; // v Δt + a Δt²
    }
    model.integrate(q, dq, q_next);
    dt * cost
}

/// Its derivatives, with T = ∂(q ⊕ dq)/∂q and E = ∂(q ⊕ dq)/∂dq, the identity but for the groups' blocks:
///
/// A = [T + E ∂a/∂q Δt², E (Δt 1 + ∂a/∂v Δt²); ∂a/∂q Δt, 1 + ∂a/∂v Δt],   B = [E ∂a/∂u Δt²; ∂a/∂u Δt]
pub(super) fn calc_diff<M: ContinuousModel>(
    model: &mut M,
    lane: Option<usize>,
    dt: f64,
    t: usize,
    x: &[f64],
    u: &[f64],
    dq: &mut [f64],
    [transport, exp]: [&mut DMatrix<f64>; 2],
    node: &mut LqNode,
) {
    let (nv, v) = (model.nv(), &x[model.nq()..]);
    let Derivatives { a, da_dq, da_dv, da_du } = match lane {
        Some(i) => model.calc_diff_prepared(i, t, x, u, dt, node),
        None => model.calc_diff(t, x, u, dt, node),
    };
    for k in 0..nv {
        dq[k] = v[k] * dt + a[k] * dt * dt;
    }
    let (by_q, by_v) = node.A.as_mut_slice().split_at_mut(2 * nv * nv);
    for (to, da) in [(by_q, da_dq.as_slice()), (by_v, da_dv.as_slice()), (node.B.as_mut_slice(), da_du)] {
        for (column, da) in to.chunks_exact_mut(2 * nv).zip(da.chunks_exact(nv)) {
            let (position, velocity) = column.split_at_mut(nv);
            for k in 0..nv {
                velocity[k] = da[k] * dt;
                position[k] = velocity[k] * dt;
            }
        }
    }
    let A = node.A.as_mut_slice();
    for k in 0..nv {
        A[(nv + k) * 2 * nv + k] += dt;
        A[(nv + k) * (2 * nv + 1)] += 1.0;
    }
    let mut from = 0;
    for group in model.groups().iter().cloned().chain(core::iter::once(nv..nv)) {
        (from..group.start).for_each(|k| A[k * (2 * nv + 1)] += 1.0);
        from = group.end;
    }
    let blocks = node.structure.set_euler(dt, model.groups());
    if model.groups().is_empty() {
        return;
    }
    model.integrate_jacobians(dq, transport, exp);
    for (group, block) in model.groups().iter().zip(blocks) {
        let (start, size) = ((group.start, group.start), (group.len(), group.len()));
        block.T.copy_from(&transport.view(start, size));
        block.E.copy_from(&exp.view(start, size));
        apply_block(exp, group, &mut node.A);
        apply_block(exp, group, &mut node.B);
        for c in group.clone() {
            for r in group.clone() {
                node.A[(r, c)] += transport[(r, c)];
            }
        }
    }
}

/// The rows of a group times its block of E, in place.
pub(super) fn apply_block(E: &DMatrix<f64>, group: &Range<usize>, X: &mut DMatrix<f64>) {
    let (size, rows, start) = (group.len(), X.nrows(), group.start);
    let mut block = [[0.0; 6]; 6];
    for (c, column) in block.iter_mut().enumerate().take(size) {
        for (r, x) in column.iter_mut().enumerate().take(size) {
            *x = E[(start + r, start + c)];
        }
    }
    for column in X.as_mut_slice().chunks_exact_mut(rows) {
        let (mut sum, part) = ([0.0; 6], &mut column[group.clone()]);
        for (column, x) in block.iter().zip(part.iter()) {
            (0..6).for_each(|r| sum[r] += column[r] * x);
        }
        part.copy_from_slice(&sum[..size]);
    }
}
