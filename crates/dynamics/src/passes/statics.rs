//! Efforts that hold a robot still against gravity and external forces, and the derivatives of these efforts. Weights
//! and external forces are summed from the tips to the root.
//!
//! Coordinate e turns all bodies that the joint of e carries about the joint column S_e. The weights of these bodies
//! keep their direction, whereas external forces turn with the bodies. With the symbols of `rnea_derivatives`, a robot
//! at rest has a₀ = −g and Ψ̈ = a₀ × S. Iᶜ is the inertia of all bodies that a joint carries, and F is the sum of I a₀
//! − f_ext over these bodies. For a joint column d and a column e on the path from d to the root,
//!
//! ```text
//! ∂τ_d/∂q_e = S_dᵀ Iᶜ Ψ̈_e     ∂τ_e/∂q_d = S_eᵀ (Iᶜ Ψ̈_d + S_d ×* F)     (e before d; Iᶜ, F of the joint of d)
//! ```

use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Pairs, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Matrix, Motion, Scalar, Vec3};

workspace! {
    /// Scratch for the efforts that hold a robot still, in the world's frame.
    pub(crate) struct Workspace<S>(size) {
        /// Sum of the weights and external forces of all bodies that a joint carries. Written by: `pass`.
        pub F: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Joint efforts. Written by: `pass`.
        pub tau: Array<S> = filled(S::zero, size.nv),
        /// Inertia of all bodies that a joint carries. Written by: `derivative`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Derivative ∂τ/∂q of the joint efforts. Written by: `derivative`.
        pub dtau_dq: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

/// Computes the efforts τ. The placements of the bodies must already be computed.
#[inline(always)]
fn pass<L: Pairs>(l: &L, World { oX, S, .. }: &World<L::S>, d: &mut Workspace<L::S>, f_ext: &[Force<L::S>]) {
    let Workspace { F, tau, .. } = d;
    let g = -l.minus_gravity();
    for i in l.bodies() {
        let I = l.inertia(i);
        let moment = oX[i].rotation * I.mass_com + oX[i].translation.scale(I.mass); // m c about the world's origin
        F[i] = Force::new(g.scale(I.mass), moment.cross(g)); // weight: [m g; c × m g]
        if let Some(external) = l.force(f_ext, i) {
            F[i] += oX[i].act(external);
        }
    }
    tau.fill(L::S::zero());
    for i in l.bodies().rev() {
        for k in 0..l.joint(i).nv() {
            l.add_joint_effort(tau, i, k, -S[l.column(i) + k].dot(F[i])); // τ = −Sᵀ F
        }
        let F_i = F[i];
        l.add_to_parent(F, i, F_i); // F_λ += F_i
    }
}

kernel! {
    /// Computes the efforts τ that hold a robot still. The placements of the bodies must already be computed.
    pub(crate) fn run<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>, f_ext: &[Force<S>]) {
        pass(&Single::new(model), world, d, f_ext);
    }
}

/// Computes ∂τ/∂q of the efforts that hold a robot still. The placements of the bodies must already be computed.
#[inline(always)]
fn derivative<L: Pairs>(l: &L, World { oX, S, .. }: &World<L::S>, d: &mut Workspace<L::S>, f_ext: &[Force<L::S>]) {
    let Workspace { F, IC, dtau_dq, .. } = d;
    let a_0 = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
        F[i] = IC[i] * a_0; // F = I a₀ − f_ext
        if let Some(external) = l.force(f_ext, i) {
            F[i] -= oX[i].act(external);
        }
    }
    let dq = dtau_dq.as_mut_slice();
    l.clear(dq);
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let (S_d, column) = (S[l.column(i) + k], own[k]);
            let weight = (IC[i] * S_d).linear.cross(a_0.linear); // S_dᵀ Iᶜ (a₀ × S_e) = S_e · [0; (Iᶜ S_d)_linear × a₀]
            let by_q = IC[i] * a_0.cross(S_d) + S_d.cross(F[i]); // Iᶜ Ψ̈_d + S_d ×* F
            for &e in before {
                let S_e = l.at(S, e);
                l.set_entry(dq, column, e, S_e.angular.dot(weight)); // ∂τ_d/∂q_e
                l.set_entry(dq, e, column, S_e.dot(by_q)); // ∂τ_e/∂q_d
            }
            for &e in own {
                l.set_entry(dq, column, e, l.at(S, e).angular.dot(weight));
            }
        }
        let (IC_i, F_i) = (IC[i], F[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(F, i, F_i);
    }
}

kernel! {
    /// Computes ∂τ/∂q of the efforts that hold a robot still. The placements of the bodies must already be computed.
    pub(crate) fn run_derivative<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>, f_ext: &[Force<S>]) {
        derivative(&Single::new(model), world, d, f_ext);
    }
}
