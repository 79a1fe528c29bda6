//! Semi-implicit Euler, as Crocoddyl's: v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²), ℓ Δt; the limits' term as it is.
#![allow(non_snake_case)] // E

use super::integrated::{ContinuousModel, Derivatives};
use super::limits::limit_term;
use crate::EulerBlock;
use crate::lq::{LARGEST_BLOCK, LqNode};
use condyle_linalg::{Vector, Vectorized, at_level};
use core::ops::Range;
use nalgebra::DMatrix;

/// The next state; returns the cost. Of a state that was prepared, `lane` is its number.
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
    dt * cost + limit_term(model)
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
    let (A, B) = (node.A.as_mut_slice(), node.B.as_mut_slice());
    let (by_q, by_v) = A.split_at_mut(2 * nv * nv);
    at_level(Steps([(da_dq.as_slice(), by_q), (da_dv.as_slice(), by_v), (da_du, B)], nv, dt));
    for k in 0..nv {
        A[(nv + k) * 2 * nv + k] += dt;
        A[(nv + k) * (2 * nv + 1)] += 1.0;
    }
    let mut from = 0;
    for group in model.groups().iter().cloned().chain(core::iter::once(nv..nv)) {
        (from..group.start).for_each(|k| A[k * (2 * nv + 1)] += 1.0);
        from = group.end;
    }
    write_blocks(model, dq, [&mut *transport, &mut *exp], node.structure.set_euler(dt, model.groups()));
    for group in model.groups() {
        apply_block(exp, group, &mut node.A);
        apply_block(exp, group, &mut node.B);
        for c in group.clone() {
            for r in group.clone() {
                node.A[(r, c)] += transport[(r, c)];
            }
        }
    }
}

/// The derivatives in implicit form, of a state that was prepared for it; says whether there is one.
pub(super) fn calc_implicit<M: ContinuousModel>(
    model: &mut M,
    lane: usize,
    dt: f64,
    t: usize,
    x: &[f64],
    u: &[f64],
    dq: &mut [f64],
    [transport, exp]: [&mut DMatrix<f64>; 2],
    node: &mut LqNode,
) -> bool {
    let v = &x[model.nq()..];
    let Some(a) = model.equations_prepared(lane, t, x, u, dt, node) else { return false };
    for k in 0..v.len() {
        dq[k] = v[k] * dt + a[k] * dt * dt;
    }
    let blocks = node.structure.set_euler(dt, model.groups());
    write_blocks(model, dq, [transport, exp], blocks);
    true
}

/// T and E of the groups.
fn write_blocks<M: ContinuousModel>(
    model: &M,
    dq: &[f64],
    [transport, exp]: [&mut DMatrix<f64>; 2],
    blocks: &mut [EulerBlock],
) {
    if model.groups().is_empty() {
        return;
    }
    model.integrate_jacobians(dq, transport, exp);
    for (group, block) in model.groups().iter().zip(blocks) {
        for c in 0..group.len() {
            for r in 0..group.len() {
                block.T[(r, c)] = transport[(group.start + r, group.start + c)];
                block.E[(r, c)] = exp[(group.start + r, group.start + c)];
            }
        }
    }
}

/// Derivatives of accelerations, nv numbers a column, become those of steps: [a Δt²; a Δt].
struct Steps<'a, const N: usize>([(&'a [f64], &'a mut [f64]); N], usize, f64);

impl<const N: usize> Vectorized for Steps<'_, N> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self(parts, nv, dt) = self;
        for (from, to) in parts {
            for (column, a) in to.chunks_exact_mut(2 * nv).zip(from.chunks_exact(nv)) {
                let (position, velocity) = column.split_at_mut(nv);
                for k in 0..nv {
                    velocity[k] = a[k] * dt;
                    position[k] = a[k] * dt * dt;
                }
            }
        }
    }
}

/// The blocks of some groups from the left, in place.
struct Blocks<'a> {
    E: &'a DMatrix<f64>,
    group: &'a Range<usize>,
    X: &'a mut [f64],
    rows: usize,
}

impl Vectorized for Blocks<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { E, group, X, rows } = self;
        let (start, size) = (group.start, group.len());
        let mut block = [[0.0; 8]; LARGEST_BLOCK]; // column by column, with zeros up to a whole register
        for c in 0..size {
            for r in 0..size {
                block[c][r] = E[(start + r, start + c)];
            }
        }
        for column in X.chunks_exact_mut(rows) {
            let (mut sum, part) = ([0.0; 8], &mut column[start..start + size]);
            for c in 0..size {
                let x = part[c];
                for r in 0..8 {
                    sum[r] += block[c][r] * x;
                }
            }
            for r in 0..LARGEST_BLOCK {
                if r < size {
                    part[r] = sum[r];
                }
            }
        }
    }
}

/// The rows of a group times its block of E, in place.
pub(super) fn apply_block(E: &DMatrix<f64>, group: &Range<usize>, X: &mut DMatrix<f64>) {
    let rows = X.nrows();
    at_level(Blocks { E, group, X: X.as_mut_slice(), rows });
}
