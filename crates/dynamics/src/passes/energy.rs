//! Kinetic energy, potential energy, and the derivatives of the two energies, as sums over the moving bodies.

use crate::passes::answers::{Number, answers};
use crate::passes::frames::{Placements, Velocities};
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Constant, Cross, Force, Inertia, Motion, Scalar};

answers! {
    /// Returns V = −Σ m_i gᵀ c_i, the potential energy of the moving bodies under the model's gravity (J). Costs O(n)
    /// for n bodies. V is zero for a mass at the world's origin.
    ///
    /// Allocates nothing.
    fn potential_energy(of: Placements) -> Number = S::zero(); {
        let (_, moment) = of.mass_and_moment();
        Single::<S, R>::new(of.model).minus_gravity().dot(moment) // −gᵀ Σ m c
    }

    /// Returns T = ½ Σ v_iᵀ I_i v_i + ½ Σ armature q̇² = ½ q̇ᵀ M q̇, the kinetic energy of the moving bodies and the
    /// rotors (J). Costs O(n) for n bodies.
    ///
    /// Allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Data, crba, forward_velocities, robots};
    /// use nalgebra::DVector;
    /// let arm = robots::arm7();
    /// let (mut data, v) = (Data::new(&arm), DVector::from_element(7, 0.5));
    /// let energy = forward_velocities(&arm, &mut data, &[0.3; 7], v.as_slice()).kinetic_energy();
    /// let M = crba(&arm, &mut data, &[0.3; 7]);
    /// assert!(f64::abs(energy - 0.5 * v.dot(&(M * &v))) < 1e-14);
    /// ```
    fn kinetic_energy(of: Velocities) -> Number = S::zero(); {
        let l = Single::<S, R>::new(of.model);
        let mut twice = rotors(of.model, &of.moving.qd);
        for i in l.bodies() {
            let v = of.world.oX[i].act_inv(of.moving.v[i]); // in the body's frame
            twice += v.dot(l.inertia(i) * v);
        }
        twice * S::splat(0.5)
    }

    /// Returns E = T + V, the mechanical energy (J). Costs O(n) for n bodies. The rate of E is the power of the joint
    /// efforts and the external forces.
    ///
    /// Allocates nothing.
    fn mechanical_energy(of: Velocities) -> Number = S::zero(); {
        of.kinetic_energy() + of.potential_energy()
    }
}

/// Returns twice the kinetic energy of the rotors: Σ armature q̇².
#[inline(always)]
pub(crate) fn rotors<S: Scalar, R: Constant<S>>(model: &Model<R>, qd: &[S]) -> S {
    let mut twice = S::zero();
    for (&armature, &qd) in model.armature().iter().zip(qd) {
        twice += armature.lift() * qd * qd;
    }
    twice
}

workspace! {
    /// Scratch for the derivatives of the energies, in the world's frame.
    pub(crate) struct Workspace<S>(size) {
        /// Inertia of all bodies that a joint carries. Written by: `derivatives`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Momentum of all bodies that a joint carries. Written by: `derivatives`.
        pub h: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Derivative ∂T/∂q of the kinetic energy. Written by: `derivatives`.
        pub dT_dq: Array<S> = filled(S::zero, size.nv),
        /// Derivative ∂T/∂v of the kinetic energy. Written by: `derivatives`.
        pub dT_dv: Array<S> = filled(S::zero, size.nv),
        /// Derivative ∂V/∂q of the potential energy. Written by: `derivatives`.
        pub dV_dq: Array<S> = filled(S::zero, size.nv),
    }
}

impl<S> Workspace<S> {
    pub(crate) fn view(&self) -> EnergyDerivatives<'_, S> {
        let Self { dT_dq, dT_dv, dV_dq, .. } = self;
        EnergyDerivatives { dT_dq, dT_dv, dV_dq }
    }
}

/// Computes the derivatives of the energies. The velocities of the bodies must already be computed.
#[inline(always)]
fn derivatives<L: Layout>(l: &L, World { oX, S, .. }: &World<L::S>, m: &Moving<L::S>, d: &mut Workspace<L::S>) {
    let Workspace { IC, h, dT_dq, dT_dv, dV_dq } = d;
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
        h[i] = IC[i] * m.v[i];
    }
    for out in [&mut *dT_dq, &mut *dT_dv, &mut *dV_dq] {
        out.fill(L::S::zero());
    }
    for i in l.bodies().rev() {
        let v_parent: Motion<_> = l.parent(&m.v, i);
        for k in 0..l.joint(i).nv() {
            let S = S[l.column(i) + k];
            l.add_joint_effort(dT_dq, i, k, v_parent.cross(S).dot(h[i])); // ∂T/∂q = Ψ̇ᵀ hᶜ, Ψ̇ = v_λ × S
            l.add_joint_effort(dT_dv, i, k, S.dot(h[i])); // ∂T/∂v = Sᵀ hᶜ
            // The first moment m c has the derivative ∂(m c)/∂q = m S_v + S_ω × m c.
            let dmoment = S.linear.scale_add(IC[i].mass, S.angular.cross(IC[i].mass_com));
            l.add_joint_effort(dV_dq, i, k, l.minus_gravity().dot(dmoment)); // ∂V/∂q = −gᵀ ∂(m c)/∂q
        }
        let (IC_i, h_i) = (IC[i], h[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(h, i, h_i);
    }
    l.add_armature_torque(&m.qd, dT_dv);
}

/// Derivatives of the kinetic and potential energy; each has nv numbers.
#[derive(Clone, Copy, Debug)]
pub struct EnergyDerivatives<'d, S> {
    /// Derivative ∂T/∂q of the kinetic energy T.
    pub dT_dq: &'d [S],
    /// Derivative ∂T/∂v = M v of the kinetic energy T: the generalised momentum.
    pub dT_dv: &'d [S],
    /// Derivative ∂V/∂q of the potential energy V: the gravity efforts g(q).
    pub dV_dq: &'d [S],
}

kernel! {
    /// Computes the derivatives of the energies. The velocities of the bodies must already be computed.
    pub(crate) fn run<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        derivatives(&Single::new(model), world, moving, d);
    }
}
