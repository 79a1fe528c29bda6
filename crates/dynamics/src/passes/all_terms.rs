//! All terms of the equations of motion, computed in one outward pass and one inward pass.
//!
//! The composite-rigid-body algorithm, the centroidal map and its rate, and the nonlinear effects need the same four
//! quantities: the placements, the velocities, the bodies' inertias in the world's frame, and the columns Iᶜ S
//! (composite inertia times joint column).

use crate::passes::answers::answers;
use crate::passes::centroidal::{self, CentroidalMapRate};
use crate::passes::coriolis::Coriolis;
use crate::passes::energy::rotors;
use crate::passes::frames::{ReferenceFrame, Velocities, classical};
use crate::passes::free_armature::add_armature_bias;
use crate::passes::kinematics::{Moving, World};
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_model::Model;
use condyle_model::layout::{Layout, Pairs, Single};
use condyle_spatial::gate::{FusedF64, Rename};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Matrix, Motion, Scalar, Vec3};

workspace! {
    /// Scratch for all terms, in the world's frame. Other intermediate results are in the workspaces of kinematics and
    /// of the centroidal map.
    pub(crate) struct Workspace<S>(size) {
        /// Acceleration of each body for q̈ = 0; the world's acceleration is −g, which accounts for gravity. Written
        /// by: `pass`.
        pub a: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Force that each joint transmits for q̈ = 0. Written by: `pass`.
        pub f: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Inertia matrix M. Written by: `pass`.
        pub M: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Nonlinear effects h. Written by: `pass`.
        pub h: Array<S> = filled(S::zero, size.nv),
        /// Kinetic energy. `pass` stores twice the energy of the bodies, and `run` replaces this value by the total
        /// energy. Written by: `pass`, `run`.
        pub kinetic_energy: S = S::zero(),
        /// Potential energy. Written by: `run`.
        pub potential_energy: S = S::zero(),
    }
}

/// Computes the inertia matrix M, the bias efforts h, the kinetic energy of the bodies and the columns of the
/// centroidal map. The velocities of the bodies must already be computed.
#[inline(always)]
fn pass<L: Pairs>(
    l: &L,
    World { oX, S, .. }: &World<L::S>,
    Moving { v, dS, qd, .. }: &Moving<L::S>,
    centroidal::Workspace { IC, BC, F, dF, .. }: &mut centroidal::Workspace<L::S>,
    Workspace { a, f, M, h, kinetic_energy: twice, .. }: &mut Workspace<L::S>,
) {
    (IC[0], BC[0]) = (Inertia::zero(), Coriolis::zero());
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    *twice = L::S::zero();
    for i in l.bodies() {
        let mut a_i = l.parent(a, i);
        for k in 0..l.joint(i).nv() {
            a_i = dS[l.column(i) + k].scale_add(l.joint_velocity(qd, i, k), a_i); // a_i = a_λ + Ṡ q̇
        }
        let I = oX[i].act(l.inertia(i));
        a[i] = a_i;
        IC[i] = I;
        BC[i] = Coriolis::of(I, v[i]); // momentum I v and rate of inertia İ
        f[i] = I * a_i + v[i].cross(BC[i].momentum); // f_i = I a_i + v_i ×* I v_i
        *twice += v[i].dot(BC[i].momentum); // 2T = Σ v_iᵀ I v_i
    }
    let M = M.as_mut_slice();
    l.clear(M);
    h.fill(L::S::zero());
    for i in l.bodies().rev() {
        let dIC = BC[i].inertia_rate();
        let support = l.support(i);
        let nv = l.joint(i).nv();
        for k in 0..nv {
            let (c, own) = (l.column(i) + k, support.len() - nv + k);
            let F_c = IC[i] * S[c]; // Iᶜ S
            F[c] = F_c;
            dF[c] = dIC * S[c] + IC[i] * dS[c]; // İᶜ S + Iᶜ Ṡ
            l.add_joint_effort(h, i, k, S[c].dot(f[i])); // h = Sᵀ f
            for &e in &support[..own] {
                let x = l.at(S, e).dot(F_c); // M_ej = S_eᵀ Iᶜ S_j for every ancestor e
                l.set_entry(M, e, support[own], x);
                l.set_entry(M, support[own], e, x);
            }
            l.set_entry(M, support[own], support[own], S[c].dot(F_c));
        }
        let (IC_i, BC_i, f_i) = (IC[i], BC[i], f[i]);
        l.add_to_parent(IC, i, IC_i); // Iᶜ_λ += Iᶜ_i
        l.add_to_parent(BC, i, BC_i);
        l.add_to_parent(f, i, f_i); // f_λ += f_i
    }
    l.add_armature(M);
}

/// Results of [`compute_all_terms`](crate::compute_all_terms()).
#[derive(Clone, Copy, Debug)]
pub struct AllTerms<'d, S, R = f64> {
    /// Placements and velocities. The methods of this field return poses, velocities, Jacobians J and rates dJ/dt of
    /// bodies and frames.
    pub kinematics: Velocities<'d, S, R>,
    /// Inertia matrix M(q), the full symmetric nv × nv matrix, as returned by [`crba`](crate::crba).
    pub M: &'d Matrix<S>,
    /// Bias efforts h(q, v), nv numbers (N m, N), as returned by [`nonlinear_effects`](crate::nonlinear_effects).
    pub h: &'d [S],
    /// Centroidal momentum hg, its map Ag, the rate dAg/dt, the centre of mass and the Jacobian of the centre of mass,
    /// as returned by [`centroidal_map_rate`](crate::centroidal_map_rate).
    pub centroidal: CentroidalMapRate<'d, S>,
    /// Kinetic energy T = ½ vᵀ M v (J).
    pub kinetic_energy: S,
    /// Potential energy V = −m gᵀ c (J), with the total mass m and the centre of mass c.
    pub potential_energy: S,
    /// Accelerations of the bodies for q̈ = 0. The world's acceleration is −g, which accounts for gravity.
    pub(crate) a: &'d [Motion<S>],
}

#[doc(hidden)]
impl<'d> Rename<AllTerms<'d, FusedF64>> for AllTerms<'d, f64> {
    #[inline(always)]
    fn renamed(self) -> AllTerms<'d, FusedF64> {
        AllTerms {
            kinematics: self.kinematics.renamed(),
            M: self.M.renamed(),
            h: self.h.renamed(),
            centroidal: self.centroidal.renamed(),
            kinetic_energy: self.kinetic_energy.renamed(),
            potential_energy: self.potential_energy.renamed(),
            a: self.a.renamed(),
        }
    }
}

impl<'d, S, R> AllTerms<'d, S, R> {
    /// Returns the robot's model.
    #[inline(always)]
    fn robot(&self) -> &'d Model<R> {
        self.kinematics.placements.model
    }
}

answers! {
    /// Returns the drift J̇ v of a frame along the world's axes, in O(1). The drift consists of the acceleration p̈ of
    /// the frame's origin and the angular acceleration ω̇ of the frame, for q̈ = 0 (m/s², rad/s²). With the Jacobian J
    /// in [`LocalWorldAligned`](ReferenceFrame::LocalWorldAligned), J q̈ + J̇ v is the frame's classical acceleration.
    ///
    /// ```
    /// use condyle_dynamics::ReferenceFrame::LocalWorldAligned;
    /// use condyle_dynamics::{Data, compute_all_terms, forward_accelerations, robots};
    /// let arm = robots::arm7();
    /// let (tool, mut data, q, v) = (arm.frame("tool")?, Data::new(&arm), [0.3; 7], [0.5; 7]);
    /// let drift = compute_all_terms(&arm, &mut data, &q, &v).frame_drift(tool);
    /// let motion = forward_accelerations(&arm, &mut data, &q, &v, &[0.0; 7]);
    /// let expected = motion.frame_classical_acceleration(tool, LocalWorldAligned);
    /// assert!((drift - expected).to_array().iter().all(|x: &f64| x.abs() < 1e-13));
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    fn frame_drift(of: AllTerms, frame: usize) -> Motion = Motion::zero(); {
        let reference = ReferenceFrame::LocalWorldAligned;
        let origin = reference.pose(of.kinematics.frame(frame));
        let body = of.kinematics.placements.model.frames()[frame].body;
        let v = of.kinematics.frame_velocity(frame, reference);
        classical(origin.act_inv(of.a[body] - of.a[0]), v)
    }
}

kernel! {
    /// Computes all terms. The velocities of the bodies must already be computed.
    pub(crate) fn run<S, R>(
        model: &Model<R>,
        world: &World<S>,
        moving: &Moving<S>,
        centroidal: &mut centroidal::Workspace<S>,
        d: &mut Workspace<S>,
    ) {
        let l = Single::new(model);
        pass(&l, world, moving, centroidal, d);
        add_armature_bias(model, &moving.qd, &mut d.h);
        d.kinetic_energy = (d.kinetic_energy + rotors(model, &moving.qd)) * S::splat(0.5);
        d.potential_energy = l.minus_gravity().dot(centroidal.IC[0].mass_com); // −gᵀ Σ m c
        centroidal::shift_rate(model, centroidal);
    }
}
