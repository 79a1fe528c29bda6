//! Coriolis matrix of a robot, with the Christoffel symbols as coefficients.
//!
//! Source: Echeandia and Wensing, *Numerical methods to compute the Coriolis matrix and Christoffel symbols for
//! rigid-body systems* (2021), algorithm 1, in the world's frame. For a body with velocity v and inertia I, the matrix
//! B is defined by 2B m = v ×* I m − I (v × m) + m ×* I v for all m. Iᶜ and Bᶜ are the sums of I and B over all bodies
//! that the joint of column d carries. Column e belongs to the same joint, or to a joint on the path from this joint to
//! the root. Then
//!
//! ```text
//! C_de = S_dᵀ (Iᶜ Ṡ_e + Bᶜ S_e)     C_ed = S_eᵀ (Iᶜ Ṡ_d + Bᶜ S_d)
//! ```
//!
//! B + Bᵀ is the rate of a body's inertia, so Ṁ = C + Cᵀ. The momentum (p, l) = I v and the rate Σ of the rotational
//! inertia determine 2B: 2B m = [2 m_ω × p; Σ m_ω + m_ω × l].

use crate::passes::free_armature;
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Pairs, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Force, Inertia, Matrix, Motion, Scalar, Sym3, Vec3, same_layout};

/// Matrix 2B of one body, or the sum of these matrices over all bodies that a joint carries. For each motion m, 2B m =
/// v ×* I m − I (v × m) + m ×* I v, with the velocity v and inertia I of the body.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Coriolis<S> {
    /// Momentum I v.
    pub momentum: Force<S>,
    /// Rate Σ = dĪ/dt of the rotational inertia.
    pub rate: Sym3<S>,
}

same_layout!(Coriolis { momentum, rate });

impl<S: Scalar> core::ops::AddAssign for Coriolis<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.momentum += o.momentum;
        self.rate += o.rate;
    }
}

impl<S: Scalar> Coriolis<S> {
    /// Returns the matrix 2B of a body at rest, which is zero.
    pub(crate) fn zero() -> Self {
        Self { momentum: Force::zero(), rate: Sym3::zero() }
    }

    /// Returns the matrix 2B of a body with velocity (v, ω), first moment h and rotational inertia Ī. The rate of Ī is
    /// Σ = [ω]ₓĪ + ([ω]ₓĪ)ᵀ + 2 (v·h) 1 − h vᵀ − v hᵀ.
    #[inline(always)]
    pub(crate) fn of(I: Inertia<S>, v: Motion<S>) -> Self {
        let turning = v.angular.skew() * I.rotational.full();
        let (x, y, z) = (turning.x, turning.y, turning.z);
        let two = S::splat(2.0);
        let turning = Sym3 { xx: two * x.x, xy: x.y + y.x, yy: two * y.y, xz: x.z + z.x, yz: y.z + z.y, zz: two * z.z };
        let shifting = Sym3::outer_sum(I.mass_com, v.linear);
        let rate = (turning - shifting).add_diagonal(two * v.linear.dot(I.mass_com));
        Self { momentum: I * v, rate }
    }

    /// Returns the product of the matrix 2B with a motion m, a force.
    #[inline(always)]
    pub(crate) fn apply(self, m: Motion<S>) -> Force<S> {
        let (p, l) = (self.momentum.linear, self.momentum.angular);
        Force {
            linear: m.angular.cross(p).scale(S::splat(2.0)),
            angular: self.rate.mul_add(m.angular, m.angular.cross(l)),
        }
    }

    /// Returns the angular part of the force 2Bᵀ m for a motion m. The linear part of this force is zero.
    #[inline(always)]
    pub(crate) fn apply_transpose(self, m: Motion<S>) -> Vec3<S> {
        let (p, l) = (self.momentum.linear, self.momentum.angular);
        self.rate.mul_add(m.angular, l.cross_add(m.angular, p.cross(m.linear).scale(S::splat(2.0))))
    }

    /// Returns the rate İ of the inertia: İ m = v ×* I m − I (v × m). Stored as an `Inertia`, İ has mass 0, and its
    /// first moment is the linear momentum.
    #[inline(always)]
    pub(crate) fn inertia_rate(self) -> Inertia<S> {
        Inertia { mass: S::zero(), mass_com: self.momentum.linear, rotational: self.rate }
    }
}

workspace! {
    /// Scratch for the Coriolis matrix, in the world's frame.
    pub(crate) struct Workspace<S>(size) {
        /// Composite inertia Iᶜ of all bodies that a joint carries. Written by: `pass`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Matrix 2Bᶜ of all bodies that a joint carries. Written by: `pass`.
        pub BC: Array<Coriolis<S>> = filled(Coriolis::zero, size.bodies),
        /// Coriolis matrix C. Written by: `pass`.
        pub C: Matrix<S> = zero_matrix(size.nv, size.nv),
    }
}

/// Computes the Coriolis matrix C without the terms of free joints' armature. The velocities of the bodies must already
/// be computed.
#[inline(always)]
fn pass<L: Pairs>(l: &L, w: &World<L::S>, m: &Moving<L::S>, d: &mut Workspace<L::S>) {
    let (S, dS, half) = (&w.S, &m.dS, L::S::splat(0.5));
    let Workspace { IC, BC, C } = d;
    for i in l.bodies() {
        IC[i] = w.oX[i].act(l.inertia(i));
        BC[i] = Coriolis::of(IC[i], m.v[i]);
    }
    let C = C.as_mut_slice();
    l.clear(C);
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let s = l.column(i) + k;
            let column = own[k];
            let IS = IC[i] * S[s]; // Iᶜ S_d
            let BS = BC[i].apply_transpose(S[s]).scale(half); // Bᵀ S_d
            let F = IC[i] * dS[s] + BC[i].apply(S[s]).scale(half); // Iᶜ Ṡ_d + B S_d
            for &e in before {
                let (S_e, dS_e) = (l.at(S, e), l.at(dS, e));
                l.set_entry(C, column, e, dS_e.dot(IS) + S_e.angular.dot(BS)); // C_de
                l.set_entry(C, e, column, S_e.dot(F)); // C_ed
            }
            for &e in own {
                let (S_e, dS_e) = (l.at(S, e), l.at(dS, e));
                l.set_entry(C, column, e, dS_e.dot(IS) + S_e.angular.dot(BS));
            }
        }
        let (IC_i, BC_i) = (IC[i], BC[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(BC, i, BC_i);
    }
}

kernel! {
    /// Computes the Coriolis matrix C. The velocities of the bodies must already be computed.
    pub(crate) fn run<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        pass(&Single::new(model), world, moving, d);
        free_armature::add_coriolis(model, &moving.qd, d.C.as_mut_slice());
    }
}
