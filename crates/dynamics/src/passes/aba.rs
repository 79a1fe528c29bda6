//! Forward dynamics by the articulated-body algorithm.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1. All quantities are in the world's frame,
//! so the inertia and force of a body are added to the inertia and force of its parent without a change of coordinates.
//! A joint with several degrees of freedom is treated as a chain of joints with one degree of freedom, between massless
//! bodies. The columns of such a joint are eliminated one by one, beginning with the last column, so no matrix is
//! inverted. Two dot products determine the time of a pass: Sᵀ U in the inward pass and Uᵀ a' in the outward pass. S is
//! a joint column, U = Iᴬ S, and a' is the parent's acceleration plus the velocity-dependent acceleration. To shorten
//! the chain of dependent operations, the linear and the angular half of each product are computed independently.

use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, ArticulatedInertia, Cross, Force, Motion, Scalar, Vec3};

workspace! {
    /// Scratch of the articulated-body algorithm, in the world's frame.
    pub(crate) struct Workspace<S>(size) {
        /// Articulated inertia of each body. Written by: `factorize`, `inward`.
        pub IA: Array<ArticulatedInertia<S>> = filled(ArticulatedInertia::zero, size.body_depth),
        /// Force U = Iᴬ S of each column S, with the articulated inertia Iᴬ. Written by: `factorize`, `inward`.
        pub U: Array<Force<S>> = filled(Force::zero, size.columns),
        /// Reciprocal 1/D of each column, where D = Sᵀ U + armature. Written by: `factorize`, `inward`.
        pub D_inv: Array<S> = filled(S::zero, size.columns),
        /// Velocity of each body; the world's velocity stays 0. Written by: `inward`.
        pub v: Array<Motion<S>> = filled(Motion::zero, size.body_depth),
        /// Acceleration of each body; the world's acceleration is −g, which accounts for gravity. Written by:
        /// `outward`.
        pub a: Array<Motion<S>> = filled(Motion::zero, size.body_depth),
        /// Velocity-dependent acceleration v × v_J of each body, with the velocity v_J of the body's joint. Written by:
        /// `inward`.
        pub c: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Articulated bias force pᴬ of each body. Written by: `inward`.
        pub pA: Array<Force<S>> = filled(Force::zero, size.body_depth),
        /// Effort u = τ − Sᵀ pᴬ of each column, with the bias force pᴬ. Written by: `inward`.
        pub u: Array<S> = filled(S::zero, size.columns),
        /// Joint accelerations. Written by: `outward`, `forward_dynamics`.
        pub qdd: Array<S> = filled(S::zero, size.nv),
        /// Joint efforts τ minus the bias efforts of free joints with armature. Written by: `aba`.
        pub effort: Array<S> = filled(S::zero, size.nv),
    }
}

/// Eliminates the degrees of freedom of joint i. Returns Iᵃ, the articulated inertia that the parent feels through the
/// joint.
#[inline(always)]
fn eliminate<L: Layout>(
    l: &L,
    S: &[Motion<L::S>],
    U: &mut [Force<L::S>],
    D_inv: &mut [L::S],
    i: usize,
    mut Ia: ArticulatedInertia<L::S>,
) -> ArticulatedInertia<L::S> {
    let column = l.column(i);
    l.sum_lanes(i, &mut Ia);
    for k in (0..l.joint(i).nv()).rev() {
        let (c, Sc) = (column + k, S[column + k]);
        let Uc = Ia * Sc; // U = Iᴬ S
        let inverse = (Sc.linear.dot(Uc.linear) + Sc.angular.dot_add(Uc.angular, l.armature(i, k))).recip(); // D = Sᵀ U
        (U[c], D_inv[c]) = (Uc, inverse);
        Ia = Ia.minus_outer(Uc, inverse); // Iᵃ = Iᴬ − U D⁻¹ Uᵀ
    }
    Ia
}

/// Computes U = Iᴬ S and 1/D for all joint columns S, with the articulated inertia Iᴬ and D = Sᵀ U + armature. U and D
/// depend only on q. The placements of the bodies must already be computed.
#[inline(always)]
pub(crate) fn factorize<L: Layout>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IA, U, D_inv, .. } = d;
    let (IA, U, D_inv, oX, S) = (&mut IA[..], &mut U[..], &mut D_inv[..], &w.oX[..], &w.S[..]);
    for i in l.bodies() {
        IA[l.stack_index(i)] = ArticulatedInertia::from(oX[i].act(l.inertia(i)));
        for &j in l.subtrees_ending_at(i) {
            let Ia = eliminate(l, S, U, D_inv, j, IA[l.stack_index(j)]);
            l.add_to_parent_on_stack(IA, j, Ia); // Iᴬ_λ += Iᵃ
        }
    }
}

/// Runs the articulated-body algorithm: the inward pass, then the outward pass.
#[inline(always)]
pub(crate) fn pass<L: Layout>(
    l: &L,
    w: &World<L::S>,
    d: &mut Workspace<L::S>,
    qd: &[L::S],
    tau: &[L::S],
    f_ext: &[Force<L::S>],
) {
    inward(l, w, d, qd, tau, f_ext);
    outward(l, w, d);
}

/// Computes the articulated inertia and bias force of each body, branch by branch: from the start of the branch to its
/// tip, and back.
#[inline(always)]
pub(crate) fn inward<L: Layout>(
    l: &L,
    w: &World<L::S>,
    d: &mut Workspace<L::S>,
    qd: &[L::S],
    tau: &[L::S],
    f_ext: &[Force<L::S>],
) {
    let Workspace { IA, U, D_inv, v, c, pA, u, .. } = d;
    let (IA, U, D_inv, v, c) = (&mut IA[..], &mut U[..], &mut D_inv[..], &mut v[..], &mut c[..]);
    let (pA, u, oX, S) = (&mut pA[..], &mut u[..], &w.oX[..], &w.S[..]);
    for i in l.bodies() {
        let (mut vJ, column) = (Motion::zero(), l.column(i));
        for k in 0..l.joint(i).nv() {
            vJ = S[column + k].scale_add(l.joint_velocity(qd, i, k), vJ); // v_J = S q̇
        }
        let vi = l.parent_on_stack(v, i) + vJ; // v_i = v_λ + v_J
        let here = l.stack_index(i);
        v[here] = vi; // stored here, so that `vi` needs no stack memory later
        c[i] = vi.cross(vJ); // c_i = v_i × v_J
        let I = oX[i].act(l.inertia(i));
        IA[here] = ArticulatedInertia::from(I);
        let mut pi = vi.cross(I * vi); // p_i = v_i ×* I_i v_i
        if let Some(external) = l.force(f_ext, i) {
            pi -= oX[i].act(external);
        }
        pA[here] = pi;
        for &j in l.subtrees_ending_at(i) {
            let here = l.stack_index(j);
            let Ia = eliminate(l, S, U, D_inv, j, IA[here]);
            l.sum_lanes(j, &mut pA[here]);
            let mut pa = pA[here];
            let column = l.column(j);
            for k in (0..l.joint(j).nv()).rev() {
                let s = column + k;
                let us = l.joint_velocity(tau, j, k) - S[s].dot(pa); // u = τ − Sᵀ pᴬ
                u[s] = us;
                pa = U[s].scale_add(D_inv[s] * us, pa);
            }
            l.add_to_parent_on_stack(IA, j, Ia); // Iᴬ_λ += Iᵃ
            l.add_to_parent_on_stack(pA, j, pa + Ia * c[j]); // pᴬ_λ += pᵃ = pᴬ + Iᵃ c + U D⁻¹ u
        }
    }
}

/// Computes the accelerations of bodies and joints, from the root to the tips.
#[inline(always)]
pub(crate) fn outward<L: Layout>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { U, D_inv, a, c, u, qdd, .. } = d;
    let (U, D_inv, a, c, u, qdd, S) = (&U[..], &D_inv[..], &mut a[..], &c[..], &u[..], &mut qdd[..], &w.S[..]);
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    qdd.fill(L::S::zero());
    for i in l.bodies() {
        let mut ai = l.parent_on_stack(a, i) + c[i]; // a' = a_λ + c
        let column = l.column(i);
        for k in 0..l.joint(i).nv() {
            let s = column + k;
            let Us = U[s];
            let x = D_inv[s] * ((u[s] - ai.linear.dot(Us.linear)) - ai.angular.dot(Us.angular)); // q̈ = D⁻¹ (u − Uᵀ a')
            l.add_joint_effort(qdd, i, k, x);
            ai = S[s].scale_add(x, ai); // a = a' + S q̈
        }
        a[l.stack_index(i)] = ai;
    }
}

kernel! {
    /// Runs the articulated-body algorithm body by body. The placements of the bodies must already be computed.
    pub(crate) fn run<S, R>(
        model: &Model<R>,
        world: &World<S>,
        d: &mut Workspace<S>,
        v: &[S],
        tau: &[S],
        f_ext: &[Force<S>],
    ) {
        pass(&Single::new(model), world, d, v, tau, f_ext);
    }
}

kernel! {
    /// Computes only the factors U and 1/D. The placements of the bodies must already be computed.
    pub(crate) fn factors<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        factorize(&Single::new(model), world, d);
    }
}
