//! Effective inertia along a joint position or a tendon's length, in the initial configuration of a file. A file may
//! specify stiffness and damping relative to this inertia.

use crate::body::Frame;
use crate::joint::Joint;
use crate::layout::{Columns, Layout, Single};
use crate::model::Model;
use condyle_spatial::{Act, ArticulatedInertia, Force, Motion, Se3, Vec3};

/// Articulated bodies of a model in the initial configuration of its file, in the world's frame.
pub(super) struct Reference<'m> {
    model: &'m Model,
    poses: &'m [Se3<f64>],
    /// Columns of the motion subspace S.
    S: Vec<Motion<f64>>,
    /// Forces U = Iᴬ S of each column S of the joints, with the articulated inertia Iᴬ.
    U: Vec<Force<f64>>,
    /// Inertias D = Sᵀ Iᴬ S + armature along each column S of the joints, with the articulated inertia Iᴬ.
    D: Vec<f64>,
}

impl<'m> Reference<'m> {
    /// Computes the articulated bodies, given the pose of each body and the armature of each column.
    pub(super) fn new(model: &'m Model, poses: &'m [Se3<f64>], armature: &[f64]) -> Self {
        let l = Single::<f64, f64>::new(model);
        let turned = |i: usize| Se3::new(model.tree.nodes[i].axis_rotation, Vec3::zero());
        let oX: Vec<_> = poses.iter().enumerate().map(|(i, &X)| X * turned(i)).collect();
        let columns = l.bodies().flat_map(|i| (0..l.joint(i).nv()).map(move |k| (i, k)));
        let S: Vec<_> = columns.map(|(i, k)| Joint::column(l.joint(i), &oX[i], k)).collect();
        let (mut U, mut D) = (vec![Force::zero(); S.len()], vec![0.0; S.len()]);
        let mut IA = vec![ArticulatedInertia::zero(); model.bodies.len()];
        for i in l.bodies().rev() {
            let mut Ia = IA[i] + oX[i].act(l.inertia(i)).into();
            for k in own(&l, i).rev() {
                U[k] = Ia * S[k];
                D[k] = S[k].dot(U[k]) + armature[k];
                Ia = Ia.minus_outer(U[k], 1.0 / D[k]);
            }
            l.add_to_parent(&mut IA, i, Ia);
        }
        Self { model, poses, S, U, D }
    }

    /// Returns J M⁻¹ Jᵀ, where M is the inertia matrix and J is the Jacobian of a length: the acceleration of this
    /// length due to a unit force along it. Its reciprocal is the effective mass along the length. `J` lists the
    /// nonzero entries of J as pairs (column, entry).
    pub(super) fn response(&self, J: &[(usize, f64)]) -> f64 {
        let l = Single::<f64, f64>::new(self.model);
        let mut u = vec![0.0; self.S.len()];
        J.iter().for_each(|&(k, moment)| u[k] += moment);
        let mut p = vec![Force::zero(); self.model.bodies.len()];
        for i in l.bodies().rev() {
            let mut pa = p[i];
            for k in own(&l, i).rev() {
                u[k] -= self.S[k].dot(pa); // u = τ − Sᵀ pᴬ
                pa += self.U[k].scale(u[k] / self.D[k]);
            }
            l.add_to_parent(&mut p, i, pa);
        }
        let mut a = vec![Motion::zero(); self.model.bodies.len()];
        for i in l.bodies() {
            a[i] = l.parent(&a, i);
            for k in own(&l, i) {
                u[k] = (u[k] - a[i].dot(self.U[k])) / self.D[k]; // q̈ = (u − Uᵀ a) / D
                a[i] += self.S[k].scale(u[k]);
            }
        }
        J.iter().map(|&(k, moment)| moment * u[k]).sum()
    }

    /// Returns the joint efforts of a wrench along the axes of a frame, linear first. For an actuator at a site, these
    /// efforts are the entries of the actuator's Jacobian.
    pub(super) fn along(&self, frame: &Frame, gear: [f64; 6]) -> Vec<(usize, f64)> {
        if frame.body == 0 {
            return Vec::new();
        }
        let l = Single::<f64, f64>::new(self.model);
        let wrench = (self.poses[frame.body] * frame.placement).act(Force::from(gear));
        l.support(frame.body).iter().map(|&k| (k, self.S[k].dot(wrench))).collect()
    }
}

/// Returns the columns of a body's joint.
fn own(l: &Single<f64, f64>, i: usize) -> std::ops::Range<usize> {
    l.column(i)..l.column(i) + l.joint(i).nv()
}
