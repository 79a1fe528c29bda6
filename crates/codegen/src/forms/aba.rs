//! Forward dynamics by the articulated-body algorithm, in the bodies' own frames.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 7.1, line by line. As in RNEA, the classical
//! acceleration of each origin replaces the spatial acceleration, so no linear velocity is needed. This form is used
//! only for code that is recorded for one robot. In a body's frame, placements and inertias have many constants and
//! zeros, which the recording simplifies. In the world's frame (`aba.rs` of `dynamics`), every number depends on all
//! joints between the body and the world. Tests compare generated code with `aba.rs`.

use super::joint_placement::{Carried, JointPlacement};
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::joint::{ClassicalMotion, Joint, JointMotion};
use condyle_model::layout::Layout;
use condyle_spatial::{Act, ArticulatedInertia, Force, Inertia, Mat3, Motion, Scalar, Se3, Vec3};

/// Computes q̈ with all passes of the algorithm. The function allocates vectors: a recording also allocates memory.
pub(super) fn pass<L: Layout>(l: &L, q: &[L::S], qd: &[L::S], tau: &[L::S], f_ext: &[Force<L::S>], qdd: &mut [L::S]) {
    let n = l.bodies().end;
    let mut angles = JointSinCos::new(n);
    Joint::sin_cos(l, q, &mut angles);
    let still = JointMotion::General(Motion::zero());
    let identity = Se3::<L::S>::identity();
    let mut X = vec![(identity, JointPlacement::General(identity)); n]; // X_T and X_J of each body
    let (mut w, mut K) = (vec![Vec3::zero(); n], vec![Mat3::zero(); n]); // ω, ω× ω×
    let (mut c, mut a) = (vec![Motion::zero(); n], vec![Motion::zero(); n]);
    let (mut IA, mut pA) = (vec![ArticulatedInertia::zero(); n], vec![Force::zero(); n]);
    let mut U = vec![Vec::new(); n]; // U, D⁻¹ and u of each column, in reverse order
    for i in l.bodies() {
        let (X_T, X_J) = (l.placement(i), JointPlacement::of(l, i, q, angles.sin[i], angles.cos[i])); // λXi = X_T X_J
        let turn_inv = |x| X_J.turn_inv(X_T.rotation.transpose_mul(x));
        let a_p = l.parent(&K, i) * X_T.act(X_J.translation()); // K_λ p
        let carried = ClassicalMotion { w: turn_inv(l.parent(&w, i)), dw: Vec3::zero(), a: turn_inv(a_p) };
        let m = Joint::motion(l, i, qd).added_to(still, carried); // ω = Rᵀ ω_λ + ω_J
        c[i] = Motion::new(m.a, m.dw); // c_i, the acceleration without q̈
        let Inertia { mass_com, rotational, .. } = l.inertia(i);
        let Ki = ClassicalMotion { dw: Vec3::zero(), ..m }.centripetal();
        pA[i] = Force::new(Ki * mass_com, m.w.cross(rotational * m.w)); // p_i: K h, ω × I ω
        if let Some(external) = l.force(f_ext, i) {
            pA[i] -= external;
        }
        IA[i] = ArticulatedInertia::from(l.inertia(i));
        (X[i], w[i], K[i]) = ((X_T, X_J), m.w, Ki);
    }
    for i in l.bodies().rev() {
        let (mut Ia, mut pa) = (IA[i], pA[i]);
        for k in (0..l.joint(i).nv()).rev() {
            let S = l.joint(i).column(&identity, k);
            let Uk = Ia * S; // U = Iᴬ S
            let D_inv = (S.dot(Uk) + l.armature(i, k)).recip(); // D = Sᵀ U
            let u = l.joint_velocity(tau, i, k) - S.dot(pa); // u = τ − Sᵀ pᴬ
            Ia = Ia.minus_outer(Uk, D_inv); // Iᵃ = Iᴬ − U D⁻¹ Uᵀ
            pa = Uk.scale_add(D_inv * u, pa);
            U[i].push((Uk, D_inv, u));
        }
        let (X_T, X_J) = &X[i];
        pa += Ia * c[i]; // pᵃ = pᴬ + Iᵃ c + U D⁻¹ u
        l.add_to_parent(&mut IA, i, X_T.act(Ia.carried_by(X_J))); // Iᴬ_λ += λX*_i Iᵃ iXλ
        l.add_to_parent(&mut pA, i, X_T.act(pa.carried_by(X_J))); // pᴬ_λ += λX*_i pᵃ
    }
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    qdd.fill(L::S::zero());
    for i in l.bodies() {
        let (X_T, X_J) = &X[i];
        let mut ai = X_J.act_inv(X_T.act_inv(l.parent(&a, i))) + c[i]; // a' = iXλ a_λ + c
        for (k, &(Uk, D_inv, u)) in U[i].iter().rev().enumerate() {
            let x = D_inv * (u - ai.dot(Uk)); // q̈ = D⁻¹ (u − Uᵀ a')
            l.add_joint_effort(qdd, i, k, x);
            ai = l.joint(i).column(&identity, k).scale_add(x, ai); // a = a' + S q̈
        }
        a[i] = ai;
    }
}
