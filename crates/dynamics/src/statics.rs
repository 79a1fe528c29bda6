//! The efforts that hold a robot still: weights and external forces, summed from the tips to the root; and their
//! derivatives.
//!
//! When coordinate e turns what its joint carries about S_e, weights stay where they point, while external forces turn
//! along. In the terms of `rnea_derivatives.rs` at rest, with a₀ = −g and Ψ̈ = a₀ × S, F the sum of Iᶜ a₀ − f_ext,
//!
//! ```text
//! ∂τ_d/∂q_e = S_dᵀ Iᶜ Ψ̈_e     ∂τ_e/∂q_d = S_eᵀ (Iᶜ Ψ̈_d + S_d ×* F)     (e before d; Iᶜ, F of the joint of d)
//! ```

use crate::data::{Data, check_forces};
use crate::kinematics::{World, positions};
use crate::workspace::{Size, filled, zero_matrix};
use condyle_linalg::check;
use condyle_model::Model;
use condyle_model::layout::{Pairs, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Constant, Cross, Force, Inertia, Motion, Scalar, Vec3};
use nalgebra::DMatrix;

/// In the world's frame.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// Weight and external force of all that a joint carries. Shape: bodies. Written by: `pass`.
    F: Vec<Force<S>>,
    /// Joint efforts. Shape: nv. Written by: `pass`.
    tau: Vec<S>,
    /// Inertia of all that a joint carries. Shape: bodies. Written by: `derivative`.
    IC: Vec<Inertia<S>>,
    /// Shape: nv × nv. Written by: `derivative`.
    dtau_dq: DMatrix<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self {
            F: filled(Force::zero(), size.bodies),
            tau: filled(S::zero(), size.nv),
            IC: filled(Inertia::zero(), size.bodies),
            dtau_dq: zero_matrix(size.nv, size.nv),
        }
    }
}

/// The whole algorithm, for bodies that are placed.
#[inline(always)]
fn pass<L: Pairs>(l: &L, World { oX, S, .. }: &World<L::S>, d: &mut Workspace<L::S>, f_ext: &[Force<L::S>]) {
    let Workspace { F, tau, .. } = d;
    let g = -l.minus_gravity();
    for i in l.bodies() {
        let I = l.inertia(i);
        let moment = oX[i].rotation * I.mass_com + oX[i].translation.scale(I.mass); // m c, from the world's origin
        F[i] = Force::new(g.scale(I.mass), moment.cross(g)); // weight: [m g; c × m g]
        if let Some(external) = l.force(f_ext, i) {
            F[i] += oX[i].act(external);
        }
    }
    tau.fill(L::S::zero());
    for i in l.bodies().rev() {
        for k in 0..l.joint(i).nv() {
            l.add_joint_effort(tau, i, k, -S[l.column(i) + k].dot(F[i])); // τ = −Sᵀ F
        }
        let F_i = F[i];
        l.add_to_parent(F, i, F_i); // F_λ += F_i
    }
}

kernel! {
    /// For bodies that are placed.
    fn run<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>, f_ext: &[Force<S>]) {
        pass(&Single::new(model), world, d, f_ext);
    }
}

/// τ = g(q) − Σ Jᵢᵀ f_ext,i: the efforts that hold the robot still under external forces, in O(n). It is
/// [`rnea`](crate::rnea) with v = a = 0, at a lower price.
///
/// q: nq numbers; f_ext: a force on each body (N, N m), acting at the body's origin and expressed in its frame, number 0
/// being the world's; or empty for none. Returns nv numbers (N m, N). Allocates nothing.
/// Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 5.3.
///
/// ```
/// use condyle_dynamics::{Data, Force, Vec3, robots, static_torque};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let q = condyle_dynamics::neutral(&quadruped);
/// let mut f_ext = vec![Force::zero(); quadruped.bodies().len()];
/// f_ext[1].linear.z = 9.81 * quadruped.total_mass(); // hung up by its trunk
/// let tau = static_torque(&quadruped, &mut data, &q, &f_ext);
/// assert!(f64::abs(tau[2]) < 1e-9); // nothing else need carry it
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another tree.
pub fn static_torque<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq());
    check_forces(f_ext.len(), model.nodes().len());
    positions(model, &mut data.world, q);
    run(model, &data.world, &mut data.statics, f_ext);
    &data.statics.tau
}

/// The derivative, for bodies that are placed.
#[inline(always)]
fn derivative<L: Pairs>(l: &L, World { oX, S, .. }: &World<L::S>, d: &mut Workspace<L::S>, f_ext: &[Force<L::S>]) {
    let Workspace { F, IC, dtau_dq, .. } = d;
    let a_0 = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        IC[i] = oX[i].act(l.inertia(i));
        F[i] = IC[i] * a_0; // F = I a₀ − f_ext
        if let Some(external) = l.force(f_ext, i) {
            F[i] -= oX[i].act(external);
        }
    }
    let dq = dtau_dq.as_mut_slice();
    l.clear(dq);
    for i in l.bodies().rev() {
        let support = l.support(i);
        let nv = l.joint(i).nv();
        let (before, own) = support.split_at(support.len() - nv);
        for k in 0..nv {
            let (S_d, column) = (S[l.column(i) + k], own[k]);
            let weight = (IC[i] * S_d).linear.cross(a_0.linear); // S_dᵀ Iᶜ (a₀ × S_e) = S_e · [0; (Iᶜ S_d)_linear × a₀]
            let by_q = IC[i] * a_0.cross(S_d) + S_d.cross(F[i]); // Iᶜ Ψ̈_d + S_d ×* F
            for &e in before {
                let S_e = l.at(S, e);
                l.set_entry(dq, column, e, S_e.angular.dot(weight)); // ∂τ_d/∂q_e
                l.set_entry(dq, e, column, S_e.dot(by_q)); // ∂τ_e/∂q_d
            }
            for &e in own {
                l.set_entry(dq, column, e, l.at(S, e).angular.dot(weight));
            }
        }
        let (IC_i, F_i) = (IC[i], F[i]);
        l.add_to_parent(IC, i, IC_i);
        l.add_to_parent(F, i, F_i);
    }
}

kernel! {
    /// For bodies that are placed.
    fn run_derivative<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>, f_ext: &[Force<S>]) {
        derivative(&Single::new(model), world, d, f_ext);
    }
}

/// ∂τ/∂q of [`static_torque`], and without forces of [`gravity`](crate::gravity): exact, in O(n · depth).
///
/// q: nq numbers; f_ext: a force on each body in its frame (it moves with the body), or empty for none. Returns the full
/// nv × nv matrix (N m/rad, N/m), entry (i, j) being ∂τᵢ/∂q_j. Allocates nothing. Source: see the head of the file.
///
/// ```
/// use condyle_dynamics::{Data, robots, static_torque_derivative};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let stiffness = static_torque_derivative(&arm, &mut data, &[0.3; 7], &[]);
/// assert!((stiffness - stiffness.transpose()).amax() < 1e-12); // gravity has a potential
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another size.
pub fn static_torque_derivative<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    f_ext: &[Force<S>],
) -> &'d DMatrix<S> {
    data.check(model);
    check("q", q.len(), model.nq());
    check_forces(f_ext.len(), model.nodes().len());
    positions(model, &mut data.world, q);
    run_derivative(model, &data.world, &mut data.statics, f_ext);
    &data.statics.dtau_dq
}
