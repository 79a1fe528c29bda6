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
use condyle_model::layout::{Layout, Single};
use condyle_model::{Joint, Model};
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
        /// Products Sⱼᵀ Uₖ for j < k of two columns of a free joint, at index 6 · (column of k) + j. Other joints have
        /// no entries. Written by: `eliminate_free`.
        pub SU: Array<S> = filled(S::zero, FREE * size.columns),
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

/// Number of columns of a free joint. The first three columns are translations, without an angular part.
const FREE: usize = 6;
const TRANSLATIONS: usize = 3;

/// Returns whether the parent of body i is the world, whose articulated inertia and bias force nothing reads.
#[inline(always)]
fn is_root<L: Layout>(l: &L, i: usize) -> bool {
    l.stack_index(i) == 1
}

/// Factors of the joint columns, which `eliminate` writes: slices of the fields of [`Workspace`].
struct Factors<'a, S> {
    U: &'a mut [Force<S>],
    D_inv: &'a mut [S],
    SU: &'a mut [S],
}

/// Eliminates the degrees of freedom of joint i. Returns Iᵃ, the articulated inertia that the parent feels through the
/// joint; for a free joint of a root, returns Iᴬ.
#[inline(always)]
fn eliminate<L: Layout>(
    l: &L,
    S: &[Motion<L::S>],
    Factors { U, D_inv, SU }: &mut Factors<'_, L::S>,
    i: usize,
    mut Ia: ArticulatedInertia<L::S>,
) -> ArticulatedInertia<L::S> {
    let column = l.column(i);
    l.sum_lanes(i, &mut Ia);
    if let Joint::FreeFlyer = l.joint(i) {
        let (U, D_inv) = (chunk_mut(U, column), chunk_mut(D_inv, column));
        eliminate_free(l, chunk(S, column), U, D_inv, chunk_mut(SU, FREE * column), i, &Ia);
        if !is_root(l, i) {
            for k in 0..FREE {
                Ia = Ia.minus_outer(U[k], D_inv[k]); // Iᵃ = Iᴬ − U D⁻¹ Uᵀ
            }
        }
        return Ia;
    }
    for k in (0..l.joint(i).nv()).rev() {
        let (c, Sc) = (column + k, S[column + k]);
        let Uc = Ia * Sc; // U = Iᴬ S
        let inverse = (Sc.linear.dot(Uc.linear) + Sc.angular.dot_add(Uc.angular, l.armature(i, k))).recip(); // D = Sᵀ U
        (U[c], D_inv[c]) = (Uc, inverse);
        if k > 0 || !is_root(l, i) {
            Ia = Ia.minus_outer(Uc, inverse); // Iᵃ = Iᴬ − U D⁻¹ Uᵀ
        }
    }
    Ia
}

/// Eliminates the six columns S of a free joint by a factorisation of the matrix H = Sᵀ Iᴬ S + armature, beginning with
/// the last column. Writes U, D⁻¹, and the products Sⱼᵀ Uₖ of its columns, which replace the entries of H.
#[inline(always)]
fn eliminate_free<L: Layout>(
    l: &L,
    S: &[Motion<L::S>; FREE],
    U: &mut [Force<L::S>; FREE],
    D_inv: &mut [L::S; FREE],
    H: &mut [L::S; FREE * FREE],
    i: usize,
    IA: &ArticulatedInertia<L::S>,
) {
    // H[6 k + j] = Sⱼᵀ Iᴬ Sₖ for j ≤ k; the other entries are not used
    for k in 0..TRANSLATIONS {
        U[k] = IA.act_linear(S[k].linear);
        for j in 0..TRANSLATIONS {
            if j <= k {
                H[FREE * k + j] = S[j].linear.dot(U[k].linear);
            }
        }
    }
    for k in TRANSLATIONS..FREE {
        U[k] = *IA * S[k];
        for j in 0..TRANSLATIONS {
            H[FREE * k + j] = S[j].linear.dot(U[k].linear);
        }
        for j in TRANSLATIONS..FREE {
            if j <= k {
                H[FREE * k + j] = S[j].linear.dot(U[k].linear) + S[j].angular.dot(U[k].angular);
            }
        }
    }
    eliminate_column::<_, 5>(H, U, D_inv, l.armature(i, 5));
    eliminate_column::<_, 4>(H, U, D_inv, l.armature(i, 4));
    eliminate_column::<_, 3>(H, U, D_inv, l.armature(i, 3));
    eliminate_column::<_, 2>(H, U, D_inv, l.armature(i, 2));
    eliminate_column::<_, 1>(H, U, D_inv, l.armature(i, 1));
    eliminate_column::<_, 0>(H, U, D_inv, l.armature(i, 0));
}

/// Eliminates column K of a free joint, after the columns behind it, from the columns before it.
#[inline(always)]
fn eliminate_column<S: Scalar, const K: usize>(
    H: &mut [S; FREE * FREE],
    U: &mut [Force<S>; FREE],
    D_inv: &mut [S; FREE],
    armature: S,
) {
    let (f, inverse) = (U[K], (H[FREE * K + K] + armature).recip());
    D_inv[K] = inverse;
    for j in 0..K {
        let x = -(H[FREE * K + j] * inverse);
        U[j] = f.scale_add(x, U[j]); // Uⱼ = (Iᴬ − U D⁻¹ Uᵀ) Sⱼ
        for h in 0..=j {
            H[FREE * j + h] = x.mul_add(H[FREE * K + h], H[FREE * j + h]);
        }
    }
}

/// Returns the N entries from index `first` on.
#[inline(always)]
fn chunk<T, const N: usize>(of: &[T], first: usize) -> &[T; N] {
    of[first..].first_chunk().expect("a free joint has six columns")
}

/// Returns the N entries from index `first` on.
#[inline(always)]
fn chunk_mut<T, const N: usize>(of: &mut [T], first: usize) -> &mut [T; N] {
    of[first..].first_chunk_mut().expect("a free joint has six columns")
}

/// Computes U = Iᴬ S and 1/D for all joint columns S, with the articulated inertia Iᴬ and D = Sᵀ U + armature. U and D
/// depend only on q. The placements of the bodies must already be computed.
#[inline(always)]
pub(crate) fn factorize<L: Layout>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IA, U, D_inv, SU, .. } = d;
    let factors = &mut Factors { U: &mut U[..], D_inv: &mut D_inv[..], SU: &mut SU[..] };
    let (IA, oX, S) = (&mut IA[..], &w.oX[..], &w.S[..]);
    for i in l.bodies() {
        IA[l.stack_index(i)] = ArticulatedInertia::from(oX[i].act(l.inertia(i)));
        for &j in l.subtrees_ending_at(i) {
            let Ia = eliminate(l, S, factors, j, IA[l.stack_index(j)]);
            if !is_root(l, j) {
                l.add_to_parent_on_stack(IA, j, Ia); // Iᴬ_λ += Iᵃ
            }
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
    let Workspace { IA, U, D_inv, SU, v, c, pA, u, .. } = d;
    let factors = &mut Factors { U: &mut U[..], D_inv: &mut D_inv[..], SU: &mut SU[..] };
    let (IA, v, c) = (&mut IA[..], &mut v[..], &mut c[..]);
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
            let Ia = eliminate(l, S, factors, j, IA[here]);
            l.sum_lanes(j, &mut pA[here]);
            let mut pa = pA[here];
            let (column, root) = (l.column(j), is_root(l, j));
            let Factors { U, D_inv, SU } = &*factors;
            if let Joint::FreeFlyer = l.joint(j) {
                let (S, U, D_inv): (&[_; FREE], &[_; FREE], &[_; FREE]) =
                    (chunk(S, column), chunk(U, column), chunk(D_inv, column));
                let SU: &[_; FREE * FREE] = chunk(SU, FREE * column);
                let mut rest = [L::S::zero(); FREE];
                for k in 0..FREE {
                    rest[k] = l.joint_velocity(tau, j, k) - S[k].dot(pa);
                }
                for k in (0..FREE).rev() {
                    let x = D_inv[k] * rest[k];
                    for h in 0..k {
                        rest[h] -= SU[FREE * k + h] * x; // u = τ − Sᵀ (pᴬ + U D⁻¹ u)
                    }
                    if !root {
                        pa = U[k].scale_add(x, pa);
                    }
                }
                u[column..][..FREE].copy_from_slice(&rest);
            } else {
                for k in (0..l.joint(j).nv()).rev() {
                    let s = column + k;
                    let us = l.joint_velocity(tau, j, k) - S[s].dot(pa); // u = τ − Sᵀ pᴬ
                    u[s] = us;
                    pa = U[s].scale_add(D_inv[s] * us, pa);
                }
            }
            if !root {
                l.add_to_parent_on_stack(IA, j, Ia); // Iᴬ_λ += Iᵃ
                l.add_to_parent_on_stack(pA, j, pa + Ia * c[j]); // pᴬ_λ += pᵃ = pᴬ + Iᵃ c + U D⁻¹ u
            }
        }
    }
}

/// Computes the accelerations of bodies and joints, from the root to the tips.
#[inline(always)]
pub(crate) fn outward<L: Layout>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { U, D_inv, SU, a, c, u, qdd, .. } = d;
    let (U, D_inv, a, c, u, qdd, S) = (&U[..], &D_inv[..], &mut a[..], &c[..], &u[..], &mut qdd[..], &w.S[..]);
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    qdd.fill(L::S::zero());
    for i in l.bodies() {
        let mut ai = l.parent_on_stack(a, i) + c[i]; // a' = a_λ + c
        let column = l.column(i);
        if let Joint::FreeFlyer = l.joint(i) {
            let (S, U, D_inv): (&[_; FREE], &[_; FREE], &[_; FREE]) =
                (chunk(S, column), chunk(U, column), chunk(D_inv, column));
            let (SU, mut rest): (&[_; FREE * FREE], [_; FREE]) = (chunk(SU, FREE * column), *chunk(u, column));
            for k in 0..FREE {
                rest[k] = (rest[k] - ai.linear.dot(U[k].linear)) - ai.angular.dot(U[k].angular);
            }
            for k in 0..FREE {
                let x = D_inv[k] * rest[k]; // q̈ = D⁻¹ (u − Uᵀ (a' + S q̈)), with the columns S before this one
                for h in k + 1..FREE {
                    rest[h] -= SU[FREE * h + k] * x;
                }
                l.add_joint_effort(qdd, i, k, x);
                ai = S[k].scale_add(x, ai); // a = a' + S q̈
            }
            a[l.stack_index(i)] = ai;
            continue;
        }
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
