//! Momentum ∂L/∂v and slope ∂L/∂q of the Lagrangian L(q, v) = ½ vᵀ M(q) v − V(q), with the derivatives of the momentum
//! and the slope.
//!
//! All quantities are in the world's frame. Composite quantities are sums over all bodies that a joint carries: inertia
//! Iᶜ, momentum hᶜ, and the force Fᶜ that holds the bodies still. Ψ̇ = v_λ × S and Ψ̈ = −g × S, where v_λ is the
//! velocity of the joint's parent. When coordinate e of joint j changes, the bodies that j carries turn about the joint
//! column S_e. The velocity v_i of each such body i also changes by Ψ̇_e: ∂v_i/∂q_e = S_e × v_i + Ψ̇_e (see
//! `rnea_derivatives.rs`). The turn does not change the kinetic energy, so
//!
//! ```text
//! p_e = (M v)_e = S_e · hᶜ,   ∂L/∂q_e = Ψ̇_e · hᶜ − S_e · Fᶜ
//! ∂hᶜ/∂q_d = S_d ×* hᶜ + Iᶜ Ψ̇_d,   ∂Fᶜ/∂q_d = S_d ×* Fᶜ + Iᶜ Ψ̈_d      (Iᶜ, hᶜ, Fᶜ of the joint of d)
//! ```
//!
//! For each column d and each column e on the path from d to the root,
//!
//! ```text
//! ∂p_d/∂q_e = Ψ̇_e · Iᶜ S_d                        ∂p_e/∂q_d = S_e · ∂hᶜ/∂q_d
//! ∂²L/∂q_d∂q_e = Ψ̇_e · ∂hᶜ/∂q_d − Ψ̈_e · Iᶜ S_d     ∂²L/∂q_e∂q_d = Ψ̇_e · ∂hᶜ/∂q_d − S_e · ∂Fᶜ/∂q_d
//! ```

use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace};
use condyle_model::layout::Pairs;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Motion, Scalar, Vec3};

workspace! {
    /// Scratch for the derivatives of the Lagrangian, in the world's frame. Matrices are stored by columns.
    pub(super) struct Workspace<S>(size) {
        /// Velocities of the bodies. Written by: `pass`.
        v: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Composite inertia Iᶜ of each joint. Written by: `pass`.
        IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Momentum hᶜ of all bodies that a joint carries. Written by: `pass`.
        hC: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Force Fᶜ that holds still all bodies that a joint carries. Written by: `pass`.
        FC: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Motion Ψ̇ = v_λ × S of each column S, with the velocity v_λ of the joint's parent. Written by: `pass`.
        Psid: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Motion Ψ̈ = −g × S of each column S, with the gravity g. Written by: `pass`.
        Psidd: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Momentum p = M v. Written by: `pass`.
        pub(super) p: Array<S> = filled(S::zero, size.nv),
        /// Slope ∂L/∂q of the Lagrangian. Written by: `pass`.
        pub(super) L_q: Array<S> = filled(S::zero, size.nv),
        /// Inertia matrix M = ∂p/∂v. Written by: `pass`.
        pub(super) M: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Derivative ∂p/∂q of the momentum p; the transpose of ∂²L/∂q∂v. Written by: `pass`.
        pub(super) p_q: Array<S> = filled(S::zero, size.nv * size.nv),
        /// Second derivatives ∂²L/∂q∂q of the Lagrangian; row i is the derivative of entry i of ∂L/∂q. Written by:
        /// `pass`.
        pub(super) L_qq: Array<S> = filled(S::zero, size.nv * size.nv),
    }
}

/// Computes all quantities of the workspace in O(n · depth). The placements of the bodies must already be computed.
/// External forces are added to ∂L/∂q as if they had a potential. If they have no potential, ∂²L/∂q∂q is not symmetric.
#[inline(always)]
pub(super) fn pass<L: Pairs>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>, qd: &[L::S], f_ext: &[Force<L::S>]) {
    let (oX, S) = (&w.oX, &w.S);
    let Workspace { v, IC, hC, FC, Psid, Psidd, p, L_q, M, p_q, L_qq } = d;
    let minus_g = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        let v_parent = l.parent(v, i);
        v[i] = v_parent;
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            v[i] = S[c].scale_add(l.joint_velocity(qd, i, k), v[i]); // v_i = v_λ + S q̇
            Psid[c] = v_parent.cross(S[c]); // Ψ̇ = v_λ × S
            Psidd[c] = minus_g.cross(S[c]); // Ψ̈ = −g × S
        }
        IC[i] = oX[i].act(l.inertia(i));
        hC[i] = IC[i] * v[i]; // h = I v
        FC[i] = IC[i] * minus_g; // F = −I g
        if let Some(external) = l.force(f_ext, i) {
            FC[i] -= oX[i].act(external);
        }
    }
    p.fill(L::S::zero());
    L_q.fill(L::S::zero());
    M.fill(L::S::zero());
    p_q.fill(L::S::zero());
    L_qq.fill(L::S::zero());
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let s = l.column(i) + k;
            let column = own[k];
            l.add_joint_effort(p, i, k, S[s].dot(hC[i])); // p_d = S_d · hᶜ
            l.add_joint_effort(L_q, i, k, Psid[s].dot(hC[i]) - S[s].dot(FC[i])); // ∂L/∂q_d = Ψ̇_d · hᶜ − S_d · Fᶜ
            let IS = IC[i] * S[s];
            let dh = S[s].cross(hC[i]) + IC[i] * Psid[s]; // ∂hᶜ/∂q_d
            let dF = S[s].cross(FC[i]) + IC[i] * Psidd[s]; // ∂Fᶜ/∂q_d
            for &e in before {
                let (S_e, Psid_e, Psidd_e) = (l.at(S, e), l.at(Psid, e), l.at(Psidd, e));
                let (x, curvature) = (S_e.dot(IS), Psid_e.dot(dh));
                l.add_entry(M, column, e, x);
                l.add_entry(M, e, column, x);
                l.add_entry(p_q, column, e, Psid_e.dot(IS)); // ∂p_d/∂q_e
                l.add_entry(p_q, e, column, S_e.dot(dh)); // ∂p_e/∂q_d
                l.add_entry(L_qq, column, e, curvature - Psidd_e.dot(IS)); // ∂²L/∂q_d∂q_e
                l.add_entry(L_qq, e, column, curvature - S_e.dot(dF)); // ∂²L/∂q_e∂q_d
            }
            for &e in own {
                let (Psid_e, Psidd_e) = (l.at(Psid, e), l.at(Psidd, e));
                l.add_entry(M, column, e, l.at(S, e).dot(IS));
                l.add_entry(p_q, column, e, Psid_e.dot(IS));
                l.add_entry(L_qq, column, e, Psid_e.dot(dh) - Psidd_e.dot(IS));
            }
        }
        let (IC_i, hC_i, FC_i) = (IC[i], hC[i], FC[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(hC, i, hC_i);
        l.add_to_parent(FC, i, FC_i);
    }
    l.add_armature(M);
    l.add_armature_torque(qd, p);
}
