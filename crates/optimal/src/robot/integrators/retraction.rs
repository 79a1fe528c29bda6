//! Retraction q ⊕ δ of a configuration q by a step δ, and its Jacobians T = ∂(q ⊕ δ)/∂q and E = ∂(q ⊕ δ)/∂δ. Both
//! Jacobians are the identity, except for a block for each group of positions that is not a vector space.
#![allow(non_snake_case)] // names follow the literature: T, E

use crate::EulerBlock;
use crate::lq::LARGEST_BLOCK;
use crate::robot::continuous::ContinuousModel;
use crate::robot::dynamics::group_kernel::BLOCK;
use condyle_linalg::{Vector, Vectorized, at_level};
use core::ops::Range;
use nalgebra::DMatrix;

/// Step of a configuration, and the Jacobians of the retraction.
#[derive(Debug)]
pub(super) struct Retraction {
    /// Step δ. Shape: nv.
    pub delta: Vec<f64>,
    /// Jacobian T; only the blocks of groups are written. Shape: nv × nv. Written by: `differentiate`.
    T: DMatrix<f64>,
    /// Jacobian E; only the blocks of groups are written. Shape: nv × nv. Written by: `differentiate`.
    pub E: DMatrix<f64>,
}

impl Retraction {
    pub(super) fn new(nv: usize) -> Self {
        let square = DMatrix::zeros(nv, nv);
        Self { delta: vec![0.0; nv], T: square.clone(), E: square }
    }

    /// Sets δ to the step of semi-implicit Euler, δ = v Δt + a Δt².
    pub(super) fn set_euler(&mut self, v: &[f64], a: &[f64], dt: f64) {
        for k in 0..v.len() {
            self.delta[k] = v[k] * dt + a[k] * dt * dt;
        }
    }

    /// Computes the Jacobians T and E.
    pub(super) fn differentiate<M: ContinuousModel>(&mut self, model: &M) {
        if !model.groups().is_empty() {
            model.integrate_jacobians(&self.delta, &mut self.T, &mut self.E);
        }
    }

    /// Sets the Jacobians T and E to the blocks of all groups, in the layout of
    /// [`KnotData::steps`](crate::robot::knot_data::KnotData::steps).
    pub(super) fn set_jacobians(&mut self, groups: &[Range<usize>], blocks: &[f64]) {
        let Self { delta, T, E } = self;
        for (group, blocks) in groups.iter().zip(blocks.chunks_exact(2 * BLOCK)) {
            let (start, n) = (group.start, group.len());
            let (by_q, by_delta) = blocks.split_at(BLOCK);
            for k in 0..n {
                let at = (start + k) * delta.len() + start;
                T.as_mut_slice()[at..][..n].copy_from_slice(&by_q[k * n..][..n]);
                E.as_mut_slice()[at..][..n].copy_from_slice(&by_delta[k * n..][..n]);
            }
        }
    }

    /// Copies the blocks of T and E to `blocks`, one pair for each group.
    pub(super) fn write_blocks(&self, groups: &[Range<usize>], blocks: &mut [EulerBlock]) {
        for (group, block) in groups.iter().zip(blocks) {
            let (start, n) = (group.start, group.len());
            for k in 0..n {
                let at = (start + k) * self.delta.len() + start;
                block.T.as_mut_slice()[k * n..][..n].copy_from_slice(&self.T.as_slice()[at..][..n]);
                block.E.as_mut_slice()[k * n..][..n].copy_from_slice(&self.E.as_slice()[at..][..n]);
            }
        }
    }

    /// Replaces X by E X. The first nv rows of X are derivatives of δ.
    pub(super) fn multiply(&self, groups: &[Range<usize>], X: &mut DMatrix<f64>) {
        for group in groups {
            let rows = X.nrows();
            at_level(Multiply { E: &self.E, group, X: X.as_mut_slice(), rows });
        }
    }

    /// Replaces X = ∂(δ, δv) by ∂(x ⊕ (δ, δv)), by the chain rule: E X + T in the rows of positions, X + 1 in the rows
    /// of velocities. The first columns of X are derivatives with respect to x.
    pub(super) fn chain(&self, groups: &[Range<usize>], X: &mut DMatrix<f64>) {
        self.multiply(groups, X);
        let n = X.nrows();
        let mut from = 0;
        for group in groups {
            (from..group.start).for_each(|k| X[(k, k)] += 1.0);
            from = group.end;
            for (r, c) in group.clone().flat_map(|c| group.clone().map(move |r| (r, c))) {
                X[(r, c)] += self.T[(r, c)];
            }
        }
        (from..n).for_each(|k| X[(k, k)] += 1.0);
    }
}

/// Multiplication of a group's rows by the group's block of E, in place.
struct Multiply<'a> {
    E: &'a DMatrix<f64>,
    group: &'a Range<usize>,
    X: &'a mut [f64],
    rows: usize,
}

impl Vectorized for Multiply<'_> {
    #[inline(always)]
    fn run<V: Vector>(self) {
        let Self { E, group, X, rows } = self;
        let (start, size) = (group.start, group.len());
        let mut block = [[0.0; 8]; LARGEST_BLOCK]; // column by column, padded with zeros to a whole register
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
