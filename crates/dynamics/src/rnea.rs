//! Inverse dynamics by the recursive Newton–Euler algorithm.
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 5.1; in the bodies' own frames.

use crate::data::{Data, Size, check, check_forces};
use crate::dispatch::kernel;
use crate::joint::Joint;
use crate::layout::{Layout, Single};
use crate::model::Model;
use condyle_spatial::{Act, Constant, Cross, Force, Motion, Scalar, Se3, Vec3};

/// In the bodies' turned frames.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// λXi. Shape: bodies. Written by: `pass`.
    X: Vec<Se3<S>>,
    /// Velocity. Shape: bodies. Written by: `pass`.
    v: Vec<Motion<S>>,
    /// Acceleration, with gravity as the world's. Shape: bodies. Written by: `pass`.
    a: Vec<Motion<S>>,
    /// Force through the joint. Shape: bodies. Written by: `pass`.
    f: Vec<Force<S>>,
    /// Joint efforts. Shape: nv. Written by: `pass`.
    tau: Vec<S>,
    /// Zeros, for the accelerations and velocities that are not given. Shape: nv. Written by: nobody.
    zero: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self {
            X: vec![Se3::identity(); size.bodies],
            v: vec![Motion::zero(); size.bodies],
            a: vec![Motion::zero(); size.bodies],
            f: vec![Force::zero(); size.bodies],
            tau: vec![S::zero(); size.nv],
            zero: vec![S::zero(); size.nv],
        }
    }
}

impl<S> Workspace<S> {
    pub(crate) fn tau(&self) -> &[S] {
        &self.tau
    }
}

/// The whole algorithm.
#[inline(always)]
fn pass<L: Layout>(l: &L, d: &mut Workspace<L::S>, q: &[L::S], qd: &[L::S], qdd: &[L::S], f_ext: &[Force<L::S>]) {
    let Workspace { X, v, a, f, tau, .. } = d;
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        let vJ = Joint::motion(l, i, qd); // v_J = S q̇
        let aJ = Joint::motion(l, i, qdd); // S q̈
        let I = l.inertia(i);
        X[i] = Joint::placement(l, i, q); // λXi = X_T X_J
        v[i] = X[i].act_inv(l.parent(v, i)) + vJ; // v_i = iXλ v_λ + v_J
        a[i] = X[i].act_inv(l.parent(a, i)) + aJ + vJ.crossed_by(v[i]); // a_i = iXλ a_λ + S q̈ + v_i × v_J
        f[i] = I * a[i] + v[i].cross(I * v[i]); // f_i = I a_i + v_i ×* I v_i
        if let Some(external) = l.force(f_ext, i) {
            f[i] -= external;
        }
    }
    tau.fill(L::S::zero());
    for i in l.bodies().rev() {
        Joint::project(l, i, f[i], tau); // τ_i = Sᵀ f_i
        let f_parent = X[i].act(f[i]);
        l.push(f, i, f_parent); // f_λ += λXi f_i
    }
    l.add_armature_torque(qdd, tau);
}

kernel! {
    fn run(model, data, q: &[S], v: &[S], a: &[S], f_ext: &[Force<S>]) {
        pass(&Single::new(model), &mut data.rnea, q, v, a, f_ext);
    }
}

/// τ = M(q) a + h(q, v) − Σ Jᵢᵀ f_ext,i: the joint efforts that make the robot accelerate with a, in O(n).
///
/// q: nq numbers; v, a: nv; f_ext: a force on each body (N, N m), acting at the body's origin and expressed in its
/// frame, number 0 being the world's; or empty for none. Returns nv numbers (N m, N). Allocates nothing.
/// Source: Featherstone (2008), table 5.1.
///
/// ```
/// use condyle_dynamics::{Data, robots, rnea};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let tau = rnea(&arm, &mut data, &[0.3; 7], &[0.0; 7], &[0.0; 7], &[]);
/// assert!(f64::abs(tau[0]) < 1e-9); // gravity does not turn a vertical axis
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another tree.
pub fn rnea<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
    f_ext: &[Force<S>],
) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq);
    check("v", v.len(), model.nv);
    check("a", a.len(), model.nv);
    check_forces(f_ext.len(), model.nodes.len());
    run(model, data, q, v, a, f_ext);
    &data.rnea.tau
}

/// h(q, v) = C(q, v) v + g(q): the efforts that keep the velocity as it is, in O(n). It is [`rnea`] with a = 0.
///
/// q: nq numbers; v: nv. Returns nv numbers (N m, N). Allocates nothing.
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another tree.
pub fn nonlinear_effects<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq);
    check("v", v.len(), model.nv);
    let zero = core::mem::take(&mut data.rnea.zero);
    run(model, data, q, v, &zero, &[]);
    data.rnea.zero = zero;
    &data.rnea.tau
}

/// g(q): the efforts that hold the robot still, in O(n). It is [`rnea`] with v = a = 0.
///
/// q: nq numbers. Returns nv numbers (N m, N). Allocates nothing.
///
/// ```
/// use condyle_dynamics::{Data, gravity, robots};
/// let quadruped = robots::quadruped();
/// let mut data = Data::new(&quadruped);
/// let q = condyle_dynamics::neutral(&quadruped);
/// let g = gravity(&quadruped, &mut data, &q);
/// assert!((g[2] - 9.81 * quadruped.total_mass()).abs() < 1e-9); // the base carries the weight
/// ```
///
/// # Panics
/// If `q` has not nq numbers, or `data` was made for a model of another tree.
pub fn gravity<'d, S: Scalar, R: Constant<S>>(model: &Model<R>, data: &'d mut Data<S>, q: &[S]) -> &'d [S] {
    data.check(model);
    check("q", q.len(), model.nq);
    let zero = core::mem::take(&mut data.rnea.zero);
    run(model, data, q, &zero, &zero, &[]);
    data.rnea.zero = zero;
    &data.rnea.tau
}
