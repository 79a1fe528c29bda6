//! Second derivatives of inverse dynamics, contracted with a vector, by analytical formulas.
//!
//! φ = λᵀ τ(q, v, a) is the power of the efforts when the joints move with velocity λ. So φ = Σ ⟨w_i, F_i⟩, where w_i
//! is the velocity of body i for the joint velocity λ. When coordinate e changes, the bodies that the joint of e
//! carries turn rigidly about the joint column S_e. This rigid turn does not change the power. In addition, the motions
//! w, v and a of each of these bodies change as follows (see `rnea_derivatives`), with W_e = w_λ × S_e and Y_e = Ψ̇_e +
//! Ṡ_e:
//!
//! ```text
//! by q_e:  δw = W_e,  δv = Ψ̇_e,  δa = Ψ̈_e + Ψ̇_e × v        by q̇_e:  δv = S_e,  δa = Y_e + S_e × v
//! ```
//!
//! φ is differentiated in this way twice, with respect to a column d and an earlier column e. All terms of single
//! bodies then become sums over the bodies that the joint of d carries. These sums are Iᶜ, 2Bᶜ and F as in the first
//! derivatives, the momentum P = Σ I w, the rate of inertia D = Σ (w ×* I − I w ×), and Q = Σ 2Bᵀ w. The six forces A₁
//! to C of column d are computed once for all earlier columns e:
//!
//! ```text
//! A₁ = Iᶜ Ψ̈_d + 2B Ψ̇_d + S_d ×* F     A₂ = Iᶜ W_d + S_d ×* P     A₃ = 2Bᵀ W_d + S_d ×* Q + Ψ̇_d ×* P − D Ψ̇_d
//! B₁ = Iᶜ Y_d + 2B S_d                  B₂ = S_d ×* P − D S_d       C = Iᶜ S_d
//!
//! ∂²φ/∂q_d∂q_e = ⟨W_e, A₁⟩ + ⟨Ψ̈_e, A₂⟩ + ⟨Ψ̇_e, A₃⟩
//! ∂²φ/∂q̇_e∂q_d = ⟨Y_e, A₂⟩ + ⟨S_e, A₃⟩     ∂²φ/∂q̇_d∂q_e = ⟨W_e, B₁⟩ + ⟨Ψ̇_e, B₂⟩     ∂²φ/∂q̇_d∂q̇_e = ⟨S_e, B₂⟩
//! ∂²φ/∂q̈_e∂q_d = ⟨S_e, A₂⟩                  ∂²φ/∂q̈_d∂q_e = ⟨W_e, C⟩
//! ```
//!
//! For two columns d and e of the same joint, the formulas with B₁ and C do not change, and ∂²φ/∂q̇_d∂q̇_e is −⟨S_e, D
//! S_d⟩. ∂²φ/∂q_d∂q_e is the mean of the formula above and the same formula with d and e exchanged, because q ⊕ δ is an
//! exponential of δ. The contracted second derivatives cost as much as a few first derivatives, O(n · depth), whereas
//! the tensors of second derivatives have n³ entries.
//!
//! Sources: Singh, Russell, Wensing, *On second-order derivatives of rigid-body dynamics: theory and implementation*
//! (2024), for the tensors; Nganga and Wensing, *Accelerating second-order differential dynamic programming for
//! rigid-body systems* (2021), for the contracted form. The sums above correspond to the sums of the first paper, but
//! they are contracted with λ before the expansion.

use crate::derivatives::rnea_derivatives::{self};
use crate::passes::coriolis::Coriolis;
use crate::passes::free_armature;
use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Pairs, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Matrix, Motion, Scalar, Vec3};

workspace! {
    /// Scratch for the second derivatives of φ = λᵀ τ, in the world's frame.
    pub(crate) struct Workspace<S>(size) {
        /// Velocity w of each body when the joints move with velocity λ. Written by: `pass`.
        pub w: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Motion W = w_λ × S of each column S, with the velocity w_λ of the parent. Written by: `pass`.
        pub W: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Momentum P = Σ I w for the body velocities w, and rate of inertia D, over all bodies that a joint carries.
        /// Written by: `pass`.
        pub PD: Array<Coriolis<S>> = filled(Coriolis::zero, size.bodies),
        /// Angular part of the sum Q = Σ 2Bᵀ w over all bodies that a joint carries, with the velocity w of each body.
        /// The linear part of Q is zero. Written by: `pass`.
        pub Q: Array<Vec3<S>> = filled(Vec3::zero, size.bodies),
        /// Second derivatives ∂²φ/∂q∂q of φ = λᵀ τ. Written by: `pass`.
        pub dqdq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Second derivatives ∂²φ/∂v∂q of φ = λᵀ τ. Written by: `pass`.
        pub dvdq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Second derivatives ∂²φ/∂v∂v of φ = λᵀ τ. Written by: `pass`.
        pub dvdv: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Second derivatives ∂²φ/∂a∂q of φ = λᵀ τ. Written by: `pass`.
        pub dadq: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

/// Computes all second derivatives of φ = λᵀ τ, without the terms of the armature of free joints. Reads the sums Iᶜ,
/// 2Bᶜ and F that `rnea_derivatives::pass` has computed.
#[inline(always)]
fn pass<L: Pairs>(
    l: &L,
    World { oX, S, .. }: &World<L::S>,
    first: &rnea_derivatives::Bodies<L::S>,
    d: &mut Workspace<L::S>,
    lambda: &[L::S],
) {
    let rnea_derivatives::Bodies { v, IC, BC, F, Psid, Psidd, PsidSd: Y, .. } = first;
    let Workspace { w, W, PD, Q, dqdq, dvdq, dvdv, dadq } = d;
    for i in l.bodies() {
        let w_parent = l.parent(w, i);
        let mut w_i = w_parent;
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            W[c] = w_parent.cross(S[c]); // W = w_λ × S
            w_i = S[c].scale_add(l.joint_velocity(lambda, i, k), w_i); // w_i = w_λ + S λ
        }
        w[i] = w_i;
        let I = oX[i].act(l.inertia(i));
        PD[i] = Coriolis::of(I, w_i); // P = I w, D = w ×* I − I w ×
        Q[i] = Coriolis::of(I, v[i]).apply_transpose(w_i); // Q = 2Bᵀ w
    }
    let half = L::S::splat(0.5);
    let (qq, vq) = (dqdq.as_mut_slice(), dvdq.as_mut_slice());
    let (vv, aq) = (dvdv.as_mut_slice(), dadq.as_mut_slice());
    for block in [&mut *qq, &mut *vq, &mut *vv, &mut *aq] {
        block.fill(L::S::zero());
    }
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        let (P, D) = (PD[i].momentum, PD[i].inertia_rate());
        for k in 0..nv {
            let s = l.column(i) + k;
            let column = own[k];
            let SP = S[s].cross(P);
            let DS = D * S[s];
            let A1 = IC[i] * Psidd[s] + BC[i].apply(Psid[s]) + S[s].cross(F[i]); // A₁ = Iᶜ Ψ̈ + 2B Ψ̇ + S ×* F
            let A2 = IC[i] * W[s] + SP; // A₂ = Iᶜ W + S ×* P
            let mut A3 = Psid[s].cross(P) - D * Psid[s]; // A₃ = Ψ̇ ×* P − D Ψ̇
            A3.angular += BC[i].apply_transpose(W[s]) + S[s].angular.cross(Q[i]); //  + 2Bᵀ W + S ×* Q
            let B1 = IC[i] * Y[s] + BC[i].apply(S[s]); // B₁ = Iᶜ Y + 2B S
            let B2 = SP - DS; // B₂ = S ×* P − D S
            let C = IC[i] * S[s]; // C = Iᶜ S
            for &e in before {
                let (S_e, W_e, Y_e) = (l.at(S, e), l.at(W, e), l.at(Y, e));
                let (Psid_e, Psidd_e) = (l.at(Psid, e), l.at(Psidd, e));
                let x = W_e.dot(A1) + Psidd_e.dot(A2) + Psid_e.dot(A3); // ∂²φ/∂q_d∂q_e
                l.add_entry(qq, column, e, x);
                l.add_entry(qq, e, column, x);
                l.add_entry(vq, e, column, Y_e.dot(A2) + S_e.dot(A3)); // ∂²φ/∂q̇_e∂q_d
                l.add_entry(vq, column, e, W_e.dot(B1) + Psid_e.dot(B2)); // ∂²φ/∂q̇_d∂q_e
                let x = S_e.dot(B2); // ∂²φ/∂q̇_d∂q̇_e
                l.add_entry(vv, column, e, x);
                l.add_entry(vv, e, column, x);
                l.add_entry(aq, e, column, S_e.dot(A2)); // ∂²φ/∂q̈_e∂q_d
                l.add_entry(aq, column, e, W_e.dot(C)); // ∂²φ/∂q̈_d∂q_e
            }
            for &e in own {
                let (W_e, Psid_e) = (l.at(W, e), l.at(Psid, e));
                let x = (W_e.dot(A1) + l.at(Psidd, e).dot(A2) + Psid_e.dot(A3)) * half;
                l.add_entry(qq, column, e, x);
                l.add_entry(qq, e, column, x);
                l.add_entry(vq, column, e, W_e.dot(B1) + Psid_e.dot(B2));
                l.add_entry(vv, column, e, -l.at(S, e).dot(DS));
                l.add_entry(aq, column, e, W_e.dot(C));
            }
        }
        let (PD_i, Q_i) = (PD[i], Q[i]);
        l.add_to_parent(PD, i, PD_i);
        l.add_to_parent(Q, i, Q_i);
    }
}

kernel! {
    /// Computes all second derivatives of φ = λᵀ τ. Runs after `rnea_derivatives::pass`.
    pub(crate) fn run<S, R>(
        model: &Model<R>,
        world: &World<S>,
        first: &rnea_derivatives::Bodies<S>,
        d: &mut Workspace<S>,
        lambda: &[S],
    ) {
        pass(&Single::new(model), world, first, d, lambda);
        free_armature::add_curvature(model, lambda, d.dvdv.as_mut_slice());
    }
}
