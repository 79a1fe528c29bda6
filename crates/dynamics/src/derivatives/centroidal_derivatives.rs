//! Derivatives of the centre of mass, of the centroidal momentum and of the rate of this momentum, with respect to
//! position, velocity and acceleration.
//!
//! The momentum about the world's origin is h = Σ I v, and its rate is F = Σ (I a + v ×* I v). When coordinate e
//! changes, only the terms of the bodies that the joint of e carries change. hᶜ, Fᶜ, Iᶜ and Bᶜ are sums over these
//! bodies. S is the joint column of e. Ψ̇, Ψ̈ and B are defined in `rnea_derivatives`, and Y = Ψ̇ + Ṡ:
//!
//! ```text
//! ∂h/∂q_e = S ×* hᶜ + Iᶜ Ψ̇     ∂F/∂q_e = S ×* Fᶜ + Iᶜ Ψ̈ + 2Bᶜ Ψ̇     ∂F/∂q̇_e = Iᶜ Y + 2Bᶜ S     ∂F/∂q̈_e = Iᶜ S
//! ```
//!
//! Shifted to the centre of mass c, a force [f; n] becomes [f; n − c × f], and the derivative of the moment has the
//! additional term −∂c × f. The linear rows of the derivatives, divided by the mass, are the derivatives of ċ and c̈.
//!
//! Source: Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018), applied to the
//! root of the tree.

use crate::passes::centroidal::{about, add};
use crate::passes::coriolis::Coriolis;
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Matrix, Motion, Scalar, Vec3, same_layout};

/// Derivatives of the momentum h and its rate F, about the world's origin, with respect to the position q, velocity v
/// and acceleration a of one joint column.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
struct Column<S> {
    h_q: Force<S>,
    F_q: Force<S>,
    F_v: Force<S>,
    F_a: Force<S>,
}

same_layout!(Column { h_q, F_q, F_v, F_a });

impl<S: Scalar> Column<S> {
    fn zero() -> Self {
        let o = Force::zero();
        Self { h_q: o, F_q: o, F_v: o, F_a: o }
    }
}

workspace! {
    /// Scratch of the centroidal derivatives, in the world's frame. Moments are about the world's origin unless a field
    /// says "about the centre of mass".
    pub(crate) struct Workspace<S>(size) {
        /// Composite inertia Iᶜ of all bodies that a joint carries. Index 0 holds the sum over all moving bodies.
        /// Written by: `pass`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Momentum hᶜ, and the matrix 2Bᶜ as in `rnea_derivatives`, of all bodies that a joint carries. Index 0 holds
        /// the sum over all moving bodies. Written by: `pass`.
        pub BC: Array<Coriolis<S>> = filled(Coriolis::zero, size.bodies),
        /// Rate of momentum Fᶜ of all bodies that a joint carries. Index 0 holds the sum over all moving bodies.
        /// Written by: `pass`.
        pub F: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Derivatives of the momentum h and its rate F with respect to the coordinate of each joint column. Written
        /// by: `pass`.
        columns: Array<Column<S>> = filled(Column::zero, size.columns),
        /// Derivatives of the centroidal momentum and of its rate, about the centre of mass. Written by: `shift`.
        pub dh_dq: Matrix<S> = zero_matrix(6, size.nv),
        pub drate_dq: Matrix<S> = zero_matrix(6, size.nv),
        pub drate_dv: Matrix<S> = zero_matrix(6, size.nv),
        pub drate_da: Matrix<S> = zero_matrix(6, size.nv),
        /// Derivatives of the position, velocity and acceleration of the centre of mass. Written by: `shift`.
        pub dcom_dq: Matrix<S> = zero_matrix(3, size.nv),
        pub dvcom_dq: Matrix<S> = zero_matrix(3, size.nv),
        pub dacom_dq: Matrix<S> = zero_matrix(3, size.nv),
        pub dacom_dv: Matrix<S> = zero_matrix(3, size.nv),
    }
}

impl<S> Workspace<S> {
    /// Returns a view of the results of `run`.
    pub(crate) fn view(&self) -> CentroidalDerivatives<'_, S> {
        CentroidalDerivatives {
            dh_dq: &self.dh_dq,
            dh_dv: &self.drate_da,
            drate_dq: &self.drate_dq,
            drate_dv: &self.drate_dv,
            drate_da: &self.drate_da,
            dcom_dq: &self.dcom_dq,
            dvcom_dq: &self.dvcom_dq,
            dacom_dq: &self.dacom_dq,
            dacom_dv: &self.dacom_dv,
        }
    }
}

/// Computes the derivatives of the momentum h and its rate F, both about the world's origin. The velocities and
/// accelerations of the bodies must already be computed.
#[inline(always)]
fn pass<L: Layout>(l: &L, World { oX, S, .. }: &World<L::S>, m: &Moving<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IC, BC, F, columns, .. } = d;
    (IC[0], BC[0], F[0]) = (Inertia::zero(), Coriolis::zero(), Force::zero());
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
        BC[i] = Coriolis::of(IC[i], m.v[i]);
        F[i] = IC[i] * m.a[i] + m.v[i].cross(BC[i].momentum); // F = I a + v ×* I v
    }
    for i in l.bodies().rev() {
        let (v_parent, a_parent): (Motion<_>, Motion<_>) = (l.parent(&m.v, i), l.parent(&m.a, i));
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            let Psid = v_parent.cross(S[c]); // Ψ̇ = v_λ × S
            let Psidd = a_parent.cross(S[c]) + v_parent.cross(Psid); // Ψ̈ = a_λ × S + v_λ × Ψ̇
            columns[c] = Column {
                h_q: S[c].cross(BC[i].momentum) + IC[i] * Psid, // S ×* hᶜ + Iᶜ Ψ̇
                F_q: S[c].cross(F[i]) + IC[i] * Psidd + BC[i].apply(Psid), // S ×* Fᶜ + Iᶜ Ψ̈ + 2Bᶜ Ψ̇
                F_v: IC[i] * (Psid + m.dS[c]) + BC[i].apply(S[c]), // Iᶜ Y + 2Bᶜ S
                F_a: IC[i] * S[c],
            };
        }
        let (IC_i, BC_i, F_i) = (IC[i], BC[i], F[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(BC, i, BC_i);
        l.add_to_parent(F, i, F_i);
    }
}

/// Returns the change [0; −∂c × f] of a force's moment when its reference point moves by ∂c.
#[inline(always)]
fn moved<S: Scalar>(dcom: Vec3<S>, f: Vec3<S>) -> Force<S> {
    Force::new(Vec3::zero(), -dcom.cross(f))
}

/// Computes the derivatives of the momentum and of its rate about the centre of mass, and the derivatives of the centre
/// of mass. Runs after `pass`.
#[inline(always)]
fn shift<S: Scalar, R>(model: &Model<R>, d: &mut Workspace<S>) {
    let per_mass = d.IC[0].mass.recip();
    let com = d.IC[0].mass_com.scale(per_mass);
    let (p, f) = (d.BC[0].momentum.linear, d.F[0].linear);
    for matrix in [&mut d.dh_dq, &mut d.drate_dq, &mut d.drate_dv, &mut d.drate_da] {
        matrix.as_mut_slice().fill(S::zero());
    }
    for (c, &Column { h_q, F_q, F_v, F_a }) in d.columns.iter().enumerate() {
        let dcom = F_a.linear.scale(per_mass); // m ∂c/∂q_e is the linear momentum for the motion S_e
        add(model, &mut d.dh_dq, c, about(com, h_q) + moved(dcom, p));
        add(model, &mut d.drate_dq, c, about(com, F_q) + moved(dcom, f));
        add(model, &mut d.drate_dv, c, about(com, F_v));
        add(model, &mut d.drate_da, c, about(com, F_a));
    }
    let of = [&d.drate_da, &d.dh_dq, &d.drate_dq, &d.drate_dv];
    for (to, from) in [&mut d.dcom_dq, &mut d.dvcom_dq, &mut d.dacom_dq, &mut d.dacom_dv].into_iter().zip(of) {
        for j in 0..model.nv() {
            for i in 0..3 {
                to[(i, j)] = from[(i, j)] * per_mass;
            }
        }
    }
}

/// Derivatives of the centroidal momentum hg, its rate dhg, and the centre of mass c. All quantities are along the axes
/// of the world.
#[derive(Clone, Copy, Debug)]
pub struct CentroidalDerivatives<'d, S> {
    /// Derivative ∂hg/∂q of the centroidal momentum, 6 × nv, linear rows first.
    pub dh_dq: &'d Matrix<S>,
    /// Derivative ∂hg/∂v = Ag of the centroidal momentum, 6 × nv.
    pub dh_dv: &'d Matrix<S>,
    /// Derivative ∂dhg/∂q of the rate of the centroidal momentum, 6 × nv.
    pub drate_dq: &'d Matrix<S>,
    /// Derivative ∂dhg/∂v of the rate of the centroidal momentum, 6 × nv.
    pub drate_dv: &'d Matrix<S>,
    /// Derivative ∂dhg/∂a = Ag of the rate of the centroidal momentum, 6 × nv.
    pub drate_da: &'d Matrix<S>,
    /// Jacobian ∂c/∂q = ∂ċ/∂v = ∂c̈/∂a of the centre of mass, 3 × nv.
    pub dcom_dq: &'d Matrix<S>,
    /// Derivative ∂ċ/∂q of the velocity of the centre of mass, 3 × nv.
    pub dvcom_dq: &'d Matrix<S>,
    /// Derivative ∂c̈/∂q of the acceleration of the centre of mass, 3 × nv.
    pub dacom_dq: &'d Matrix<S>,
    /// Derivative ∂c̈/∂v of the acceleration of the centre of mass, 3 × nv.
    pub dacom_dv: &'d Matrix<S>,
}

kernel! {
    /// Computes all derivatives of the centroidal momentum hg, its rate dhg, and the centre of mass c. The velocities
    /// and accelerations of the bodies must already be computed.
    pub(crate) fn run<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        pass(&Single::new(model), world, moving, d);
        shift(model, d);
    }
}
