//! Dynamics and energies as linear functions of the inertial parameters.
//!
//! π stacks the ten [parameters](crate::inertial_parameters) of each body except the world. All regressors use one
//! bilinear form y: ⟨m, I w⟩ = y(m, w) · π_i, where I is the inertia and π_i are the parameters of body i. v and a are
//! the velocity and acceleration of this body, and S is a column of a joint on the path from the body to the root. v, a
//! and S are expressed in the body's frame. Then
//!
//! ```text
//! τ_S = ⟨S, I a + v ×* I v⟩ = (y(S, a) − y(v × S, v)) · π_i,     T_i = ½ y(v, v) · π_i
//! ```
//!
//! Source: Atkeson, An, Hollerbach, *Estimation of inertial parameters of manipulator loads and links* (1986); the form
//! y replaces the 6 × 10 matrices of this paper.

use crate::passes::frames::Placements;
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Columns, Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Matrix, Motion, Scalar};

/// Number of inertial parameters of a body.
pub(crate) const PARAMETERS: usize = 10;

workspace! {
    pub(crate) struct Workspace<S>(size) {
        /// Regressor Y of the joint efforts. Written by: `joint_torque_regressor`.
        pub torque: Matrix<S> = zero_matrix(size.nv, PARAMETERS * (size.bodies - 1)),
        /// Regressor y of the kinetic energy. Written by: `kinetic_energy_regressor`.
        pub kinetic: Array<S> = filled(S::zero, PARAMETERS * (size.bodies - 1)),
        /// Regressor y of the potential energy. Written by: `potential_energy_regressor`.
        pub potential: Array<S> = filled(S::zero, PARAMETERS * (size.bodies - 1)),
    }
}

/// Returns the ten numbers y(m, w) that satisfy ⟨m, I w⟩ = y · π for each inertia I with parameters π. y is symmetric
/// in m and w.
#[inline(always)]
pub(crate) fn pairing<S: Scalar>(m: Motion<S>, w: Motion<S>) -> [S; PARAMETERS] {
    let (a, b) = (m.angular, w.angular);
    let h = m.linear.cross(b) + w.linear.cross(a); // ⟨m_v, −h × w_ω⟩ + ⟨m_ω, h × w_v⟩
    [
        m.linear.dot(w.linear), // m m_v · w_v
        h.x,
        h.y,
        h.z,
        a.x * b.x, // m_ω · Ī w_ω
        a.x.mul_add(b.y, a.y * b.x),
        a.y * b.y,
        a.x.mul_add(b.z, a.z * b.x),
        a.y.mul_add(b.z, a.z * b.y),
        a.z * b.z,
    ]
}

/// Returns y(S, a) − y(v × S, v), the derivatives of the effort at joint column S with respect to the ten parameters of
/// a body. v and a are the velocity and acceleration of the body.
#[inline(always)]
pub(crate) fn effort<S: Scalar>(column: Motion<S>, v: Motion<S>, a: Motion<S>) -> [S; PARAMETERS] {
    let (mut y, quadratic) = (pairing(column, a), pairing(v.cross(column), v));
    for k in 0..PARAMETERS {
        y[k] -= quadratic[k];
    }
    y
}

/// Returns the ten entries that belong to body i, in a vector with the parameters of all bodies.
#[inline(always)]
fn of_body<S>(parameters: &mut [S], i: usize) -> &mut [S] {
    &mut parameters[PARAMETERS * (i - 1)..PARAMETERS * i]
}

kernel! {
    /// Computes the regressor Y of the joint efforts. The accelerations of the bodies must already be computed.
    pub(crate) fn torque<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        let l = Single::new(model);
        let minus_g = l.minus_gravity();
        let Y = d.torque.as_mut_slice();
        Y.fill(S::zero());
        for i in l.bodies() {
            let oXb = Placements { model, world }.body(i);
            let a_i = Motion { linear: moving.a[i].linear + minus_g, ..moving.a[i] };
            let (v_b, a_b) = (oXb.act_inv(moving.v[i]), oXb.act_inv(a_i));
            for &c in l.support(i) {
                let column = &model.columns()[c];
                let S_b = oXb.act_inv(world.S[c]).scale(S::splat(column.ratio));
                let y = effort(S_b, v_b, a_b);
                for k in 0..PARAMETERS {
                    // τ_S = (y(S, a) − y(v × S, v)) · π_i
                    Y[column.coordinate + model.nv() * (PARAMETERS * (i - 1) + k)] += y[k];
                }
            }
        }
    }
}

kernel! {
    /// Computes the regressor y of the kinetic energy. The velocities of the bodies must already be computed.
    pub(crate) fn kinetic<S, R>(model: &Model<R>, world: &World<S>, moving: &Moving<S>, d: &mut Workspace<S>) {
        for i in 1..model.nodes().len() {
            let v_b = Placements { model, world }.body(i).act_inv(moving.v[i]);
            of_body(&mut d.kinetic, i).copy_from_slice(&pairing(v_b.scale(S::splat(0.5)), v_b)); // ½ y(v, v)
        }
    }
}

kernel! {
    /// Computes the regressor y of the potential energy. The placements of the bodies must already be computed.
    pub(crate) fn potential<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        let minus_g = Single::<S, R>::new(model).minus_gravity();
        for i in 1..model.nodes().len() {
            let oXb = Placements { model, world }.body(i);
            let first = oXb.rotation.transpose_mul(minus_g);
            let o = S::zero();
            let row = [minus_g.dot(oXb.translation), first.x, first.y, first.z, o, o, o, o, o, o];
            of_body(&mut d.potential, i).copy_from_slice(&row); // V_i = −g · p m − Rᵀ g · m c
        }
    }
}
