//! Joint-space inertia matrix by the composite-rigid-body algorithm.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 6.2. All inertias are in the world's frame, in
//! which the composite inertia of several bodies is the sum of the bodies' inertias.

use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Columns, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Inertia, Matrix};

workspace! {
    pub(crate) struct Workspace<S>(size) {
        /// Composite inertia in the world's frame: the sum over a body and all bodies that it carries. Written by:
        /// `pass`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Inertia matrix M. Written by: `pass`.
        pub M: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

/// Computes M by the composite-rigid-body algorithm. The placements of the bodies must already be computed.
#[inline(always)]
pub(crate) fn pass<L: Columns>(l: &L, w: &World<L::S>, IC: &mut [Inertia<L::S>], M: &mut [L::Number]) {
    let oX = &w.oX[..];
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
    }
    carry(l, w, IC, M);
}

/// Computes M from the inertias `IC` of the bodies, and overwrites `IC` with the composite inertias.
#[inline(always)]
pub(crate) fn carry<L: Columns>(l: &L, World { S, .. }: &World<L::S>, IC: &mut [Inertia<L::S>], M: &mut [L::Number]) {
    l.clear(M);
    let S = &S[..];
    for i in l.bodies().rev() {
        let support = l.support(i);
        let (nv, first) = (l.joint(i).nv(), l.column(i));
        l.sum_lanes(i, &mut IC[i]);
        for k in 0..nv {
            let F = IC[i] * S[first + k]; // F = Iᶜ S
            let (own, column) = (support.len() - nv + k, l.own_column(i, k));
            for &e in &support[..own] {
                let x = l.at(S, e).dot(F); // M_ej = S_eᵀ F for every ancestor e
                l.set_column(M, column, e, x);
                l.set_row(M, column, e, x);
            }
            l.set_row(M, column, support[own], l.at(S, support[own]).dot(F));
        }
        let IC_i = IC[i];
        l.add_to_parent(IC, i, IC_i); // Iᶜ_λ += Iᶜ_i
    }
    l.add_armature(M);
}

kernel! {
    /// Computes M body by body. The placements of the bodies must already be computed.
    pub(crate) fn run<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        let Workspace { IC, M } = d;
        pass(&Single::new(model), world, IC, M.as_mut_slice());
    }
}
