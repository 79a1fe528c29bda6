//! Semi-implicit Euler steps, as in Crocoddyl: v⁺ = v + a Δt, q⁺ = q ⊕ (v Δt + a Δt²), cost ℓ Δt. The limit term is not
//! multiplied by Δt.
#![allow(non_snake_case)] // names follow the literature: A, B

use super::accelerations::{slopes, steps};
use super::retraction::Retraction;
use crate::lq::LqKnot;
use crate::robot::continuous::{ContinuousModel, Derivatives, KnotInput};
use crate::robot::dynamics::batch::Group;
use condyle_linalg::{Vector, Vectorized, at_level};

/// Writes the next state of a knot after `dt` seconds. Returns the cost of the knot. `values` returns the knot's
/// accelerations, its cost ℓ and its limit term.
pub(super) fn calc<M: ContinuousModel>(
    model: &mut M,
    input: KnotInput<'_>,
    dt: f64,
    step: &mut Retraction,
    next: &mut [f64],
    values: impl for<'m> FnOnce(&'m mut M) -> (&'m [f64], f64, f64),
) -> f64 {
    let (q, v) = input.x.split_at(model.nq());
    let (q_next, v_next) = next.split_at_mut(q.len());
    let (a, cost, term) = values(model);
    for k in 0..v.len() {
        v_next[k] = v[k] + a[k] * dt; // v⁺ = v + a Δt
    }
    step.set_euler(v, a, dt);
    model.integrate(q, &step.delta, q_next);
    dt * cost + term
}

/// Writes the derivatives of an Euler step, with T = ∂(q ⊕ δ)/∂q and E = ∂(q ⊕ δ)/∂δ at δ = v Δt + a Δt²:
///
/// A = [T + E ∂a/∂q Δt², E (Δt 1 + ∂a/∂v Δt²); ∂a/∂q Δt, 1 + ∂a/∂v Δt],   B = [E ∂a/∂u Δt²; ∂a/∂u Δt]
///
/// For a knot in inverse-dynamics form, only T and E are written.
pub(super) fn calc_diff<M: ContinuousModel>(
    model: &mut M,
    lane: usize,
    input: KnotInput<'_>,
    dt: f64,
    group: Group<'_>,
    step: &mut Retraction,
    knot: &mut LqKnot,
) {
    let (nv, v) = (model.nv(), &input.x[model.nq()..]);
    let Derivatives { a, da_dq, da_dv, da_du } = slopes(model, lane, input, dt, group, knot);
    step.set_euler(v, a, dt);
    let inverse = knot.structure.is_inverse_dynamics();
    if !inverse {
        let (by_q, by_v) = knot.A.as_mut_slice().split_at_mut(2 * nv * nv);
        let parts = [(da_dq.as_slice(), by_q), (da_dv.as_slice(), by_v), (da_du, knot.B.as_mut_slice())];
        at_level(Steps(parts, nv, dt));
        (0..nv).for_each(|k| knot.A[(k, nv + k)] += dt);
    }
    match steps(model, lane, &group) {
        Some(blocks) => step.set_jacobians(model.groups(), blocks),
        None => step.differentiate(model),
    }
    step.write_blocks(model.groups(), knot.structure.set_euler(dt, model.groups()));
    if !inverse {
        step.chain(model.groups(), &mut knot.A);
        step.multiply(model.groups(), &mut knot.B);
    }
}

/// Conversion of columns a of the acceleration's derivatives (nv entries) to columns [a Δt²; a Δt] of a step's
/// derivatives.
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
