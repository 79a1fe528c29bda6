//! The derivatives of inverse dynamics, by hand.
//!
//! Source: Singh, Russell, Wensing, *Efficient analytical derivatives of rigid-body dynamics using spatial vector
//! algebra* (2022), in the world's frame. When coordinate e of joint j changes, all that joint j carries turns rigidly
//! about S_e, and beside that the velocities and accelerations there change by
//!
//! ```text
//! Ψ̇_e = v_λ × S_e,   Ψ̈_e = a_λ × S_e + v_λ × Ψ̇_e          (λ: the parent of joint j)
//! ∂v_i/∂q_e = S_e × v_i + Ψ̇_e,   ∂a_i/∂q_e = S_e × a_i + Ψ̈_e + Ψ̇_e × v_i
//! ∂v_i/∂q̇_e = S_e,              ∂a_i/∂q̇_e = Ψ̇_e + Ṡ_e + S_e × v_i       (Ṡ_e = v_j × S_e)
//! ```
//!
//! so that with composite quantities (sums over all that a joint carries: inertia Iᶜ, force F, and the matrix B of
//! 2 B m = v ×* I m − I (v × m) + m ×* I v) each pair of a column d and a column e before it costs a few products:
//!
//! ```text
//! ∂τ_d/∂q_e = S_dᵀ (Iᶜ Ψ̈_e + 2B Ψ̇_e)               ∂τ_d/∂q̇_e = S_dᵀ (Iᶜ (Ψ̇_e + Ṡ_e) + 2B S_e)
//! ∂τ_e/∂q_d = S_eᵀ (Iᶜ Ψ̈_d + 2B Ψ̇_d + S_d ×* F)     ∂τ_e/∂q̇_d = S_eᵀ (Iᶜ (Ψ̇_d + Ṡ_d) + 2B S_d)
//! ```
//!
//! (Iᶜ, B, F of the joint of d). 2B has 9 numbers other than zero, given by the momentum (p, l) = I v and the rate Σ
//! of the rotational inertia: 2B m = [2 m_ω × p; Σ m_ω + m_ω × l].

use crate::data::{Data, Size, check, check_forces};
use crate::kinematics::{World, place};
use crate::layout::{Layout, Single};
use crate::model::Model;
use condyle_spatial::{Act, Constant, Cross, Force, Inertia, Motion, Scalar, Sym3, Vec3};
use nalgebra::DMatrix;

/// The matrix 2B of a body or of all that a joint carries.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Coriolis<S> {
    /// I v.
    pub momentum: Force<S>,
    /// Σ = dĪ/dt.
    pub rate: Sym3<S>,
}

impl<S: Scalar> core::ops::AddAssign for Coriolis<S> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        self.momentum += o.momentum;
        self.rate += o.rate;
    }
}

impl<S: Scalar> Coriolis<S> {
    /// Of a body at rest.
    pub(crate) fn zero() -> Self {
        Self { momentum: Force::zero(), rate: Sym3::zero() }
    }

    /// Of a body: Σ = [ω]ₓĪ + ([ω]ₓĪ)ᵀ + 2 (v·h) 1 − h vᵀ − v hᵀ.
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

    /// 2B m.
    #[inline(always)]
    pub(crate) fn apply(self, m: Motion<S>) -> Force<S> {
        let (p, l) = (self.momentum.linear, self.momentum.angular);
        Force { linear: m.angular.cross(p).scale(S::splat(2.0)), angular: self.rate * m.angular + m.angular.cross(l) }
    }

    /// 2Bᵀ m, of which only the angular part is not zero.
    #[inline(always)]
    pub(crate) fn apply_transpose(self, m: Motion<S>) -> Vec3<S> {
        let (p, l) = (self.momentum.linear, self.momentum.angular);
        self.rate * m.angular + l.cross(m.angular) + p.cross(m.linear).scale(S::splat(2.0))
    }
}

/// In the world's frame.
#[derive(Clone, Debug)]
pub(crate) struct Workspace<S> {
    /// Velocity. Shape: bodies. Written by: `pass`.
    v: Vec<Motion<S>>,
    /// Acceleration, with gravity as the world's. Shape: bodies. Written by: `pass`.
    a: Vec<Motion<S>>,
    /// Iᶜ. Shape: bodies. Written by: `pass`.
    IC: Vec<Inertia<S>>,
    /// 2Bᶜ. Shape: bodies. Written by: `pass`.
    BC: Vec<Coriolis<S>>,
    /// F. Shape: bodies. Written by: `pass`.
    F: Vec<Force<S>>,
    /// Ψ̇. Shape: columns. Written by: `pass`.
    Psid: Vec<Motion<S>>,
    /// Ψ̈. Shape: columns. Written by: `pass`.
    Psidd: Vec<Motion<S>>,
    /// Ψ̇ + Ṡ. Shape: columns. Written by: `pass`.
    PsidSd: Vec<Motion<S>>,
    /// Shape: nv × nv. Written by: `pass`.
    dtau_dq: DMatrix<S>,
    /// Shape: nv × nv. Written by: `pass`.
    dtau_dv: DMatrix<S>,
    /// Shape: nv × nv. Written by: `pass`.
    dtau_da: DMatrix<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        let square = DMatrix::from_element(size.nv, size.nv, S::zero());
        Self {
            v: vec![Motion::zero(); size.bodies],
            a: vec![Motion::zero(); size.bodies],
            IC: vec![Inertia::zero(); size.bodies],
            BC: vec![Coriolis::zero(); size.bodies],
            F: vec![Force::zero(); size.bodies],
            Psid: vec![Motion::zero(); size.columns],
            Psidd: vec![Motion::zero(); size.columns],
            PsidSd: vec![Motion::zero(); size.columns],
            dtau_dq: square.clone(),
            dtau_dv: square.clone(),
            dtau_da: square,
        }
    }
}

/// The whole algorithm, for bodies that are placed.
#[inline(always)]
pub(crate) fn pass<L: Layout>(
    l: &L,
    w: &World<L::S>,
    d: &mut Workspace<L::S>,
    qd: &[L::S],
    qdd: &[L::S],
    f_ext: &[Force<L::S>],
) {
    let (oX, S) = (&w.oX, &w.S);
    let Workspace { v, a, IC, BC, F, Psid, Psidd, PsidSd, dtau_dq, dtau_dv, dtau_da } = d;
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        let (v_parent, a_parent) = (l.parent(v, i), l.parent(a, i));
        let (mut vJ, mut aJ) = (Motion::zero(), Motion::zero());
        for k in 0..l.joint(i).nv() {
            let c = l.slot(i) + k;
            vJ = S[c].scale_add(l.load(qd, i, k), vJ); // v_J = S q̇
            aJ = S[c].scale_add(l.load(qdd, i, k), aJ); // S q̈
        }
        v[i] = v_parent + vJ; // v_i = v_λ + v_J
        a[i] = a_parent + aJ + v[i].cross(vJ); // a_i = a_λ + S q̈ + v_i × v_J
        for k in 0..l.joint(i).nv() {
            let c = l.slot(i) + k;
            Psid[c] = v_parent.cross(S[c]); // Ψ̇ = v_λ × S
            Psidd[c] = a_parent.cross(S[c]) + v_parent.cross(Psid[c]); // Ψ̈ = a_λ × S + v_λ × Ψ̇
            PsidSd[c] = Psid[c] + v[i].cross(S[c]); // Ψ̇ + Ṡ
        }
        IC[i] = oX[i].act(l.inertia(i));
        BC[i] = Coriolis::of(IC[i], v[i]);
        F[i] = IC[i] * a[i] + v[i].cross(BC[i].momentum); // F = I a + v ×* I v
        if let Some(external) = l.force(f_ext, i) {
            F[i] -= oX[i].act(external);
        }
    }
    let (dq, dv, da) = (dtau_dq.as_mut_slice(), dtau_dv.as_mut_slice(), dtau_da.as_mut_slice());
    dq.fill(L::S::zero());
    dv.fill(L::S::zero());
    da.fill(L::S::zero());
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let s = l.slot(i) + k;
            let column = own[k];
            let IS = IC[i] * S[s]; // Iᶜ S_d
            let BS = BC[i].apply_transpose(S[s]); // 2Bᵀ S_d
            let by_q = IC[i] * Psidd[s] + BC[i].apply(Psid[s]) + S[s].cross(F[i]); // Iᶜ Ψ̈_d + 2B Ψ̇_d + S_d ×* F
            let by_v = IC[i] * PsidSd[s] + BC[i].apply(S[s]); // Iᶜ (Ψ̇_d + Ṡ_d) + 2B S_d
            for &e in before {
                let (S_e, Psid_e, Psidd_e, PsidSd_e) = (l.at(S, e), l.at(Psid, e), l.at(Psidd, e), l.at(PsidSd, e));
                l.add_at(dq, column, e, Psidd_e.dot(IS) + Psid_e.angular.dot(BS)); // ∂τ_d/∂q_e
                l.add_at(dv, column, e, PsidSd_e.dot(IS) + S_e.angular.dot(BS)); // ∂τ_d/∂q̇_e
                l.add_at(dq, e, column, S_e.dot(by_q)); // ∂τ_e/∂q_d
                l.add_at(dv, e, column, S_e.dot(by_v)); // ∂τ_e/∂q̇_d
                let x = S_e.dot(IS); // M_de
                l.add_at(da, column, e, x);
                l.add_at(da, e, column, x);
            }
            for &e in own {
                let (S_e, Psid_e, Psidd_e, PsidSd_e) = (l.at(S, e), l.at(Psid, e), l.at(Psidd, e), l.at(PsidSd, e));
                l.add_at(dq, column, e, Psidd_e.dot(IS) + Psid_e.angular.dot(BS));
                l.add_at(dv, column, e, PsidSd_e.dot(IS) + S_e.angular.dot(BS));
                l.add_at(da, column, e, S_e.dot(IS));
            }
        }
        let (IC_i, BC_i, F_i) = (IC[i], BC[i], F[i]);
        l.push(IC, i, IC_i);
        l.push(BC, i, BC_i);
        l.push(F, i, F_i);
    }
    l.add_armature(da);
}

/// The derivatives of τ = rnea(q, v, a), each a full nv × nv matrix.
#[derive(Clone, Copy, Debug)]
pub struct RneaDerivatives<'d, S> {
    /// ∂τ/∂q in the tangent space: the change of τ when q moves to q ⊕ δ, per δ.
    pub dtau_dq: &'d DMatrix<S>,
    /// ∂τ/∂v.
    pub dtau_dv: &'d DMatrix<S>,
    /// ∂τ/∂a = M(q), armature included.
    pub dtau_da: &'d DMatrix<S>,
}

/// The derivatives of [`rnea`](crate::rnea) with respect to q, v and a, exact, in O(n · depth).
///
/// q: nq numbers; v, a: nv; f_ext: a force on each body in its frame (it moves with the body), or empty for none.
/// Returns three nv × nv matrices, row by row ∂τᵢ/∂·. Allocates nothing. Source: Singh, Russell, Wensing (2022),
/// algorithm 1; see the head of the file.
///
/// ```
/// use condyle_dynamics::{Data, crba, rnea_derivatives, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let (q, v, a) = ([0.3; 7], [0.1; 7], [0.2; 7]);
/// let M = rnea_derivatives(&arm, &mut data, &q, &v, &a, &[]).dtau_da.clone();
/// assert!((M - crba(&arm, &mut data, &q)).amax() < 1e-14);
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another size.
pub fn rnea_derivatives<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
) -> RneaDerivatives<'d, S> {
    data.check(model);
    check("q", q.len(), model.nq);
    check("v", v.len(), model.nv);
    check("a", a.len(), model.nv);
    check_forces(f_ext.len(), model.nodes.len());
    let l = Single::new(model);
    place(&l, &mut data.world, q);
    pass(&l, &data.world, &mut data.rnea_derivatives, v, a, f_ext);
    data.rnea_derivatives.view()
}

impl<S> Workspace<S> {
    pub(crate) fn view(&self) -> RneaDerivatives<'_, S> {
        RneaDerivatives { dtau_dq: &self.dtau_dq, dtau_dv: &self.dtau_dv, dtau_da: &self.dtau_da }
    }
}
