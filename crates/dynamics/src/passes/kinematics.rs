//! Kinematics: placements, velocities and accelerations of all bodies, each computed in one pass from the root to the
//! tips. `frames.rs` contains the queries about single bodies and frames.

use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Array, Cross, Motion, Se3};

workspace! {
    /// Scratch of kinematics: quantities that depend only on the position, in the world's frame.
    pub(crate) struct World<S>(size) {
        /// Sines and cosines of the joint positions. Written by: `place`, and by `rnea`.
        pub sin_cos: JointSinCos<S> = JointSinCos::new(size.bodies),
        /// Pose oXi in the world of each body's internal frame, which is rotated to the joint axis. Written by:
        /// `place`.
        pub oX: Array<Se3<S>> = filled(Se3::identity, size.bodies),
        /// Columns S, one per degree of freedom: the velocity of the joint's body relative to its parent for a unit
        /// joint velocity. Written by: `place`.
        pub S: Array<Motion<S>> = filled(Motion::zero, size.columns),
    } same {
        /// Workspace that contains the placements of the last call. Written by: `place`, `rnea`, and the passes in
        /// lanes.
        pub placed: PlacementCache = PlacementCache::Nowhere,
    }
}

/// Name of the workspace that contains the placements of the last call, with the [geometry hash](Model::geometry_hash)
/// of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlacementCache {
    /// No workspace: the last call did not compute placements.
    Nowhere,
    /// Workspace `World` with one entry per body.
    Bodies(u64),
    /// Workspace of the passes in lanes.
    Limbs(u64),
}

/// Computes the pose oXi = oXλ λXi of each body, and the columns S.
#[inline(always)]
pub(crate) fn place<L: Layout>(l: &L, world: &mut World<L::S>, q: &[L::S]) {
    Joint::sin_cos(l, q, &mut world.sin_cos);
    place_turned(l, world, q);
}

/// Computes oXi and S like [`place`], from sines and cosines that are already computed.
#[inline(always)]
fn place_turned<L: Layout>(l: &L, World { sin_cos, oX, S, placed }: &mut World<L::S>, q: &[L::S]) {
    *placed = PlacementCache::Bodies(l.geometry_hash());
    let (oX, S, sin, cos) = (&mut oX[..], &mut S[..], &sin_cos.sin[..], &sin_cos.cos[..]);
    for i in l.bodies() {
        let X = l.parent(oX, i) * Joint::placement_with(l, i, q, sin[i], cos[i]); // oXi = oXλ λXi
        oX[i] = X;
        let (joint, column) = (l.joint(i), l.column(i));
        if let Joint::Revolute { .. } | Joint::Continuous { .. } = joint {
            S[column] = Joint::column_about_z(&X); // oXi S, read from the local copy of oXi
        } else {
            for k in 0..joint.nv() {
                S[column + k] = joint.column(&oX[i], k);
            }
        }
    }
}

workspace! {
    /// Scratch of kinematics: velocities and accelerations of the bodies, in the world's frame.
    pub(crate) struct Moving<S>(size) {
        /// Velocity of each body; the world's velocity stays 0. Written by: `advance`.
        pub v: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Rate Ṡ = v × S of each column S, where v is the velocity of the body to which S is fixed. Written by:
        /// `advance`.
        pub dS: Array<Motion<S>> = filled(Motion::zero, size.columns),
        /// Joint velocities. Written by: `advance`.
        pub qd: Array<S> = filled(S::zero, size.nv),
        /// Spatial acceleration of each body, without gravity; the world's acceleration stays 0. Written by:
        /// `accelerate`.
        pub a: Array<Motion<S>> = filled(Motion::zero, size.bodies),
    }
}

/// Computes the velocity v_i of each body and the rate Ṡ of each column S. The placements of the bodies must already be
/// computed.
#[inline(always)]
fn advance<L: Layout>(l: &L, World { S, .. }: &World<L::S>, m: &mut Moving<L::S>, qd: &[L::S]) {
    let Moving { v, dS, .. } = m;
    m.qd.copy_from_slice(qd);
    for i in l.bodies() {
        let mut v_i = l.parent(v, i);
        for k in 0..l.joint(i).nv() {
            v_i = S[l.column(i) + k].scale_add(l.joint_velocity(qd, i, k), v_i); // v_i = v_λ + S q̇
        }
        v[i] = v_i;
        for k in 0..l.joint(i).nv() {
            dS[l.column(i) + k] = v_i.cross(S[l.column(i) + k]); // Ṡ = v_i × S, because S is fixed in body i
        }
    }
}

/// Computes the acceleration a_i of each body. The velocities of the bodies must already be computed.
#[inline(always)]
fn accelerate<L: Layout>(l: &L, World { S, .. }: &World<L::S>, m: &mut Moving<L::S>, qdd: &[L::S]) {
    let Moving { dS, qd, a, .. } = m;
    for i in l.bodies() {
        let mut a_i = l.parent(a, i);
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            // a_i = a_λ + S q̈ + Ṡ q̇
            a_i = S[c].scale_add(l.joint_velocity(qdd, i, k), dS[c].scale_add(l.joint_velocity(qd, i, k), a_i));
        }
        a[i] = a_i;
    }
}

kernel! {
    /// Computes the placements of all bodies.
    pub(crate) fn positions<S, R>(model: &Model<R>, world: &mut World<S>, q: &[S]) {
        place(&Single::new(model), world, q);
    }
}

kernel! {
    /// Computes the placements of all bodies. Runs after `rnea`, which computes the sines and cosines of all joints.
    pub(crate) fn positions_after_rnea<S, R>(model: &Model<R>, world: &mut World<S>, q: &[S]) {
        place_turned(&Single::new(model), world, q);
    }
}

kernel! {
    /// Computes the velocities of the bodies. The placements of the bodies must already be computed.
    pub(crate) fn velocities<S, R>(model: &Model<R>, world: &World<S>, moving: &mut Moving<S>, v: &[S]) {
        advance(&Single::new(model), world, moving, v);
    }
}

kernel! {
    /// Computes the accelerations of the bodies. The velocities of the bodies must already be computed.
    pub(crate) fn accelerations<S, R>(model: &Model<R>, world: &World<S>, moving: &mut Moving<S>, a: &[S]) {
        accelerate(&Single::new(model), world, moving, a);
    }
}
