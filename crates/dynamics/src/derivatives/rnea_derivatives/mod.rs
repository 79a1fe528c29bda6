//! Analytical derivatives of inverse dynamics.
//!
//! Source: Singh, Russell, Wensing, *Efficient analytical derivatives of rigid-body dynamics using spatial vector
//! algebra* (2022), in the world's frame. When coordinate e of joint j changes, the bodies that joint j carries turn
//! rigidly about the joint column S_e. The velocities and accelerations of these bodies also change because the parent
//! of joint j moves:
//!
//! ```text
//! Ψ̇_e = v_λ × S_e,   Ψ̈_e = a_λ × S_e + v_λ × Ψ̇_e          (λ: the parent of joint j)
//! ∂v_i/∂q_e = S_e × v_i + Ψ̇_e,   ∂a_i/∂q_e = S_e × a_i + Ψ̈_e + Ψ̇_e × v_i
//! ∂v_i/∂q̇_e = S_e,              ∂a_i/∂q̇_e = Ψ̇_e + Ṡ_e + S_e × v_i       (Ṡ_e = v_j × S_e)
//! ```
//!
//! Composite quantities are sums over all bodies that a joint carries: the inertia Iᶜ, the force F, and the matrix B.
//! For one body, B is defined by 2 B m = v ×* I m − I (v × m) + m ×* I v. Let d be a column, and e an earlier column on
//! the path to the root. Then each pair (d, e) costs only a few dot products:
//!
//! ```text
//! ∂τ_d/∂q_e = S_dᵀ (Iᶜ Ψ̈_e + 2B Ψ̇_e)               ∂τ_d/∂q̇_e = S_dᵀ (Iᶜ (Ψ̇_e + Ṡ_e) + 2B S_e)
//! ∂τ_e/∂q_d = S_eᵀ (Iᶜ Ψ̈_d + 2B Ψ̇_d + S_d ×* F)     ∂τ_e/∂q̇_d = S_eᵀ (Iᶜ (Ψ̇_d + Ṡ_d) + 2B S_d)
//! ```
//!
//! Here Iᶜ, B and F are the composite quantities of the joint of column d.

mod vectorized;

use crate::passes::coriolis::Coriolis;
use crate::passes::free_armature;
use crate::passes::kinematics::World;
use crate::selection::pairs_by_rows;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Matrix, Motion, Vec3};
use vectorized::Rows;

workspace! {
    /// Quantities of the bodies and of the joint columns, in the world's frame.
    pub(crate) struct Bodies<S>(size) {
        /// Velocity of each body. Written by: `pass`.
        pub v: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Acceleration of each body; the world's acceleration is −g, which accounts for gravity. Written by: `pass`.
        pub a: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Composite inertia Iᶜ of each joint. Written by: `pass`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Matrix 2B of each joint, summed over the bodies that the joint carries. Written by: `pass`.
        pub BC: Array<Coriolis<S>> = filled(Coriolis::zero, size.bodies),
        /// Force F that each joint transmits. Written by: `pass`.
        pub F: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Motion Ψ̇ = v_λ × S of each column S, with the velocity v_λ of the joint's parent. Written by: `pass`.
        pub Psid: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Motion Ψ̈ = a_λ × S + v_λ × Ψ̇ of each column S, with the velocity v_λ and acceleration a_λ of the joint's
        /// parent. Written by: `pass`.
        pub Psidd: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Sum Ψ̇ + Ṡ of each column S, with the rate Ṡ of the column. Written by: `pass`.
        pub PsidSd: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Values of each column d that `vectorized` needs for all pairs of columns (d, e). Written by: `pass`.
        pub rows: Rows<S> = Rows::new(size.columns),
    }
}

workspace! {
    pub(crate) struct Workspace<S>(size) {
        pub bodies: Bodies<S> = Bodies::new(size),
        /// Joint velocities. Written by: `run`, `aba_derivatives`, `rnea_derivatives`.
        pub qd: Array<S> = filled(S::zero, size.nv),
        /// Joint accelerations that the caller of `rnea_derivatives` has passed. Written by: `rnea_derivatives`.
        pub qdd: Array<S> = filled(S::zero, size.nv),
        /// Joint accelerations of zero, for derivatives at q̈ = 0. Written by: `new`.
        pub still: Array<S> = filled(S::zero, size.nv),
        /// Derivative ∂τ/∂q of the joint efforts. Written by: `pass`.
        pub dtau_dq: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Derivative ∂τ/∂v of the joint efforts. Written by: `pass`.
        pub dtau_dv: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Derivative ∂τ/∂a of the joint efforts. Written by: `pass`.
        pub dtau_da: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

impl<S> Workspace<S> {
    /// Returns the outputs of `pass`: the quantities of the bodies, and the matrices ∂τ/∂q, ∂τ/∂v and ∂τ/∂a.
    #[inline(always)]
    pub(crate) fn parts(&mut self) -> (&mut Bodies<S>, [&mut [S]; 3]) {
        let Self { bodies, dtau_dq, dtau_dv, dtau_da, .. } = self;
        (bodies, [dtau_dq.as_mut_slice(), dtau_dv.as_mut_slice(), dtau_da.as_mut_slice()])
    }
}

/// Computes ∂τ/∂q, ∂τ/∂v and ∂τ/∂a. `w` must contain the placements of the bodies. If `by_rows` is set, the function
/// skips pairs of columns of different joints, which `vectorized` then computes.
#[inline(always)]
pub(crate) fn pass<L: Columns>(
    l: &L,
    w: &World<L::S>,
    (d, [dq, dv, da]): (&mut Bodies<L::S>, [&mut [L::Number]; 3]),
    qd: &[L::S],
    qdd: &[L::S],
    f_ext: &[Force<L::S>],
    minus_gravity: Vec3<L::S>,
    by_rows: bool,
) {
    let (oX, S) = (&w.oX[..], &w.S[..]);
    let Bodies { v, a, IC, BC, F, Psid, Psidd, PsidSd, rows } = d;
    let (v, a, IC, BC, F) = (&mut v[..], &mut a[..], &mut IC[..], &mut BC[..], &mut F[..]);
    let (Psid, Psidd, PsidSd) = (&mut Psid[..], &mut Psidd[..], &mut PsidSd[..]);
    a[0] = Motion::new(minus_gravity, Vec3::zero());
    for i in l.bodies() {
        let (v_parent, a_parent) = (l.parent(v, i), l.parent(a, i));
        let (mut vJ, mut aJ) = (Motion::zero(), Motion::zero());
        let (nv, column) = (l.joint(i).nv(), l.column(i));
        for k in 0..nv {
            let c = column + k;
            vJ = S[c].scale_add(l.joint_velocity(qd, i, k), vJ); // v_J = S q̇
            aJ = S[c].scale_add(l.joint_velocity(qdd, i, k), aJ); // S q̈
        }
        let vi = v_parent + vJ; // v_i = v_λ + v_J
        let ai = a_parent + aJ + vi.cross(vJ); // a_i = a_λ + S q̈ + v_i × v_J
        (v[i], a[i]) = (vi, ai);
        for k in 0..nv {
            let (c, Sc) = (column + k, S[column + k]);
            let dPsi = v_parent.cross(Sc); // Ψ̇ = v_λ × S
            Psidd[c] = a_parent.cross(Sc) + v_parent.cross(dPsi); // Ψ̈ = a_λ × S + v_λ × Ψ̇
            PsidSd[c] = dPsi + vi.cross(Sc); // Ψ̇ + Ṡ
            Psid[c] = dPsi;
        }
        let I = oX[i].act(l.inertia(i));
        IC[i] = I;
        let B = Coriolis::of(I, vi);
        BC[i] = B;
        let mut Fi = I * ai + vi.cross(B.momentum); // F = I a + v ×* I v
        if let Some(external) = l.force(f_ext, i) {
            Fi -= oX[i].act(external);
        }
        F[i] = Fi;
    }
    l.broadcast(Psid);
    l.broadcast(Psidd);
    l.broadcast(PsidSd);
    l.clear(dq);
    l.clear(dv);
    l.clear(da);
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        l.sum_lanes(i, &mut IC[i]);
        l.sum_lanes(i, &mut BC[i]);
        l.sum_lanes(i, &mut F[i]);
        let (IC_i, BC_i, F_i) = (IC[i], BC[i], F[i]);
        let first = l.column(i);
        for k in 0..nv {
            let (s, column) = (first + k, l.own_column(i, k));
            let Ss = S[s];
            let IS = IC_i * Ss; // Iᶜ S_d
            let BS = BC_i.apply_transpose(Ss); // 2Bᵀ S_d
            let by_q = IC_i * Psidd[s] + BC_i.apply(Psid[s]) + Ss.cross(F_i); // Iᶜ Ψ̈_d + 2B Ψ̇_d + S_d ×* F
            let by_v = IC_i * PsidSd[s] + BC_i.apply(Ss); // Iᶜ (Ψ̇_d + Ṡ_d) + 2B S_d
            if by_rows {
                rows.keep(s, IS, BS, by_q, by_v);
            }
            for &e in if by_rows { &[] } else { before } {
                let (S_e, Psid_e, Psidd_e, PsidSd_e) = (l.at(S, e), l.at(Psid, e), l.at(Psidd, e), l.at(PsidSd, e));
                let dq_de = Psid_e.angular.dot_add(BS, Psidd_e.dot(IS)); // ∂τ_d/∂q_e
                let dv_de = S_e.angular.dot_add(BS, PsidSd_e.dot(IS)); // ∂τ_d/∂q̇_e
                let (dq_ed, dv_ed) = (S_e.dot(by_q), S_e.dot(by_v)); // ∂τ_e/∂q_d, ∂τ_e/∂q̇_d
                let M_de = S_e.dot(IS);
                l.set_row(dq, column, e, dq_de); // stored last: products stay in registers
                l.set_row(dv, column, e, dv_de);
                l.set_column(dq, column, e, dq_ed);
                l.set_column(dv, column, e, dv_ed);
                l.set_row(da, column, e, M_de);
                l.set_column(da, column, e, M_de);
            }
            for &e in own {
                let (S_e, Psid_e, Psidd_e, PsidSd_e) = (l.at(S, e), l.at(Psid, e), l.at(Psidd, e), l.at(PsidSd, e));
                l.set_row(dq, column, e, Psid_e.angular.dot_add(BS, Psidd_e.dot(IS)));
                l.set_row(dv, column, e, S_e.angular.dot_add(BS, PsidSd_e.dot(IS)));
                l.set_row(da, column, e, S_e.dot(IS));
            }
        }
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(BC, i, BC_i);
        l.add_to_parent(F, i, F_i);
    }
    l.add_armature(da);
}

kernel! {
    /// Computes the derivatives of inverse dynamics. `w` must contain the placements of the bodies. `world` is the
    /// world's linear acceleration; if the slice is empty, the world has the acceleration −g of the model's gravity g.
    pub(crate) fn run<S, R>(
        model: &Model<R>,
        w: &World<S>,
        d: &mut Workspace<S>,
        v: &[S],
        a: &[S],
        f_ext: &[Force<S>],
        world: &[Vec3<S>],
    ) {
        let l = Single::new(model);
        let minus_gravity = if world.is_empty() { l.minus_gravity() } else { world[0] };
        let by_rows = pairs_by_rows::<S, R>(model);
        d.qd.copy_from_slice(v);
        pass(&l, w, d.parts(), v, a, f_ext, minus_gravity, by_rows);
        if by_rows {
            vectorized::pairs(model, w, d);
        }
        free_armature::add_slope(model, v, d.dtau_dv.as_mut_slice());
    }
}
