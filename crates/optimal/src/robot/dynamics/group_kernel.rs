//! Joints whose positions are not a vector space: Jacobians of their steps and differences to references. They are
//! computed for one knot, or for several knots in the lanes of a SIMD register.
#![allow(non_snake_case)] // names follow the literature: T, E, D

use crate::lq::LARGEST_BLOCK;
use crate::robot::knot_data::{KnotData, WIDEST, unpack};
use crate::robot::residuals::kernel::KnotGroup;
use condyle_dynamics::{Body, GroupJacobian, Model};
use condyle_spatial::block::{Block, gather_rows};
use condyle_spatial::kernel;
use core::ops::Range;

/// Number of entries of the largest block.
pub(crate) const BLOCK: usize = LARGEST_BLOCK * LARGEST_BLOCK;

/// Joint whose positions are not a vector space: its body and the ranges of its coordinates.
#[derive(Clone, Debug)]
struct Curved {
    body: usize,
    q: Range<usize>,
    v: Range<usize>,
}

/// Workspace for the joints whose positions are not a vector space.
#[derive(Debug)]
pub(crate) struct GroupKernel<S> {
    joints: Vec<Curved>,
    /// Step δ of a joint, or the difference of its position to a reference.
    delta: [S; LARGEST_BLOCK],
    /// Blocks T, E or D of a joint, column after column.
    blocks: [[S; BLOCK]; 2],
    /// Position of a joint in a reference; the next field contains the durations Δt of the knots.
    reference: [S; LARGEST_BLOCK + 1],
    dt: [S; 1],
}

/// Returns the joints of a robot whose positions are not a vector space.
fn curved(model: &Model) -> Vec<Curved> {
    let joints = model.bodies().iter().enumerate().skip(1).filter(|(_, body)| !body.joint.commutes());
    let range = |start: usize, length: usize| start..start + length;
    joints
        .map(|(body, Body { joint, idx_q, idx_v, .. })| Curved {
            body,
            q: range(*idx_q, joint.nq()),
            v: range(*idx_v, joint.nv()),
        })
        .collect()
}

impl<S: Block<Number = f64>> GroupKernel<S> {
    /// Allocates the workspace for a robot.
    pub(crate) fn new(model: &Model) -> Self {
        let zero = S::zero();
        let (delta, blocks) = ([zero; LARGEST_BLOCK], [[zero; BLOCK]; 2]);
        Self { joints: curved(model), delta, blocks, reference: [zero; LARGEST_BLOCK + 1], dt: [zero] }
    }

    /// Computes the blocks of T = ∂(q ⊕ δ)/∂q and E = ∂(q ⊕ δ)/∂δ at the step δ = v Δt + a Δt² of each knot, into
    /// [`KnotData::steps`].
    pub(crate) fn run_steps(&mut self, model: &Model, [v, a]: [&[S]; 2], durations: &[f64], to: &mut [KnotData]) {
        let Self { joints, delta, blocks, dt, .. } = self;
        if joints.is_empty() || durations.is_empty() {
            return;
        }
        let each: [&[f64]; WIDEST] = core::array::from_fn(|k| &durations[k.min(to.len() - 1)..][..1]);
        gather_rows(&each[..to.len()], dt);
        for (k, Curved { body, v: iv, .. }) in joints.iter().enumerate() {
            differentiate_step(model, *body, &v[iv.clone()], &a[iv.clone()], dt[0], delta, blocks);
            let n = iv.len() * iv.len();
            for (i, block) in blocks.iter().enumerate() {
                unpack(&block[..n], to, |to| &mut to.steps[(2 * k + i) * BLOCK..][..n]);
            }
        }
    }

    /// Computes the differences of the positions to the references of state residuals, and their Jacobians D. See
    /// [`KinematicData::difference`](crate::robot::residuals::layout::KinematicData::difference).
    pub(crate) fn run_states(&mut self, model: &Model, q: &[S], group: &mut KnotGroup<'_>) {
        let Self { joints, delta, blocks: [D, _], reference, .. } = self;
        let (terms, slopes) = (group.terms, group.slopes);
        if joints.is_empty() {
            return;
        }
        for list in 0..2 {
            for i in 0..terms[0].0[list].layout().states {
                let first = terms[0].0[list].state(i);
                let (mut references, mut weight, slot) = ([first.reference; WIDEST], first.weight, first.slot);
                for (k, terms) in terms.iter().enumerate().skip(1) {
                    let own = terms.0[list].state(i);
                    (references[k], weight) = (own.reference, weight.max(own.weight));
                }
                if weight == 0.0 {
                    continue;
                }
                for Curved { body, q: iq, v: iv } in &*joints {
                    let (n, reference, mut each) = (iv.len(), &mut reference[..iq.len()], references);
                    each[..terms.len()].iter_mut().for_each(|row| *row = &row[iq.clone()]);
                    gather_rows(&each[..terms.len()], reference);
                    differentiate_difference(model, *body, reference, &q[iq.clone()], slopes, &mut delta[..n], D);
                    unpack(&delta[..n], group.data, |to| {
                        let from = slot + (1 + LARGEST_BLOCK) * iv.start;
                        &mut to.residuals.kinematic[list].states[from..][..n]
                    });
                    if slopes {
                        unpack(&D[..n * n], group.data, |to| {
                            let from = slot + (1 + LARGEST_BLOCK) * iv.start + n;
                            &mut to.residuals.kinematic[list].states[from..][..n * n]
                        });
                    }
                }
            }
        }
    }
}

kernel! {
    /// Computes δ = v Δt + a Δt² of a joint, and the blocks T and E at δ.
    fn differentiate_step<S>(
        model: &Model, body: usize, v: &[S], a: &[S], dt: S, delta: &mut [S; LARGEST_BLOCK],
        blocks: &mut [[S; BLOCK]; 2],
    ) {
        let joint = model.bodies()[body].joint;
        for k in 0..v.len() {
            delta[k] = v[k] * dt + a[k] * dt * dt;
        }
        joint.jacobian_columns(GroupJacobian::Transport, &delta[..v.len()], &mut blocks[0]);
        joint.jacobian_columns(GroupJacobian::Exp, &delta[..v.len()], &mut blocks[1]);
    }
}

kernel! {
    /// Computes q₁ ⊖ q₀ of a joint and, with `slopes`, its derivative D with respect to q₁.
    fn differentiate_difference<S>(
        model: &Model, body: usize, q0: &[S], q1: &[S], slopes: bool, delta: &mut [S], D: &mut [S; BLOCK],
    ) {
        let joint = model.bodies()[body].joint;
        joint.difference(q0, q1, delta);
        if slopes {
            joint.jacobian_columns(GroupJacobian::Log, delta, D);
        }
    }
}
