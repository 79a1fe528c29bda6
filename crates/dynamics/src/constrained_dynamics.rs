//! Forward dynamics under constraints.
//!
//! Gauss's principle: of all accelerations that satisfy J q̈ + γ = 0, the robot takes the one that is nearest to its free
//! acceleration in the metric of M. With the forces λ of the constraints,
//!
//! ```text
//! [ M   Jᵀ ] [  q̈ ]   [ τ − h ]         J M⁻¹ Jᵀ λ = −(γ + J M⁻¹ (τ − h)),
//! [ J   0  ] [ −λ ] = [ −γ    ],        q̈ = M⁻¹ (τ − h + Jᵀ λ)
//! ```
//!
//! Source: Udwadia and Kalaba, *A new perspective on constrained motion* (1992); Carpentier, Budhiraja, Mansard, *Proximal
//! and sparse resolution of constrained dynamic equations* (2021).

use crate::constrained_work::{self, Algorithm, Inputs};
use crate::constraint_motion::Ends;
use crate::constraint_set::ConstraintSet;
use crate::crba;
use crate::data::{Data, Size};
use crate::dispatch::Kernel;
use crate::kinematics::{World, place};
use crate::limbs;
use condyle_linalg::Ltdl;
use condyle_model::Model;
use condyle_model::layout::{Pairs, Single};
use condyle_spatial::{Act, Constant, Cross, Force, Inertia, Motion, Scalar, Vec3};
use nalgebra::DMatrix;

/// In the world's frame.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Workspace<S> {
    /// Velocity. Shape: bodies. Written by: `bias`.
    v: Vec<Motion<S>>,
    /// Acceleration for q̈ = 0, with gravity as the world's. Shape: bodies. Written by: `bias`.
    a: Vec<Motion<S>>,
    /// Iᶜ. Shape: bodies. Written by: `bias`, `inertia`.
    IC: Vec<Inertia<S>>,
    /// Force through the joint for q̈ = 0. Shape: bodies. Written by: `bias`.
    F: Vec<Force<S>>,
    /// Shape: nv × nv. Written by: `bias`, `inertia`.
    pub M: DMatrix<S>,
    /// Its factor. Written by: `constrained_dynamics`, `impulse_dynamics`.
    pub factor: Ltdl<S>,
    /// τ − h. Shape: nv. Written by: `bias`, `constrained_dynamics`.
    effort: Vec<S>,
    /// The acceleration, or the change of velocity. Shape: nv. Written by: `constrained_dynamics`, `impulse_dynamics`.
    pub qdd: Vec<S>,
}

impl<S: Scalar> Workspace<S> {
    pub(crate) fn new<R>(size: Size, model: &Model<R>) -> Self {
        Self {
            v: vec![Motion::zero(); size.bodies],
            a: vec![Motion::zero(); size.bodies],
            IC: vec![Inertia::zero(); size.bodies],
            F: vec![Force::zero(); size.bodies],
            M: DMatrix::from_element(size.nv, size.nv, S::zero()),
            factor: Ltdl::new(model),
            effort: vec![S::zero(); size.nv],
            qdd: vec![S::zero(); size.nv],
        }
    }
}

/// M, h and the bodies' motion for q̈ = 0, for bodies that are placed: the Newton–Euler and the composite-rigid-body
/// algorithm in one pass to the tips and one back.
#[inline(always)]
fn bias<L: Pairs>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>, qd: &[L::S], f_ext: &[Force<L::S>]) {
    let Workspace { v, a, IC, F, M, effort, .. } = d;
    a[0] = Motion::new(l.minus_gravity(), Vec3::zero());
    for i in l.bodies() {
        let mut vJ = Motion::zero();
        for k in 0..l.joint(i).nv() {
            vJ = w.S[l.column(i) + k].scale_add(l.joint_velocity(qd, i, k), vJ); // v_J = S q̇
        }
        v[i] = l.parent(v, i) + vJ; // v_i = v_λ + v_J
        a[i] = l.parent(a, i) + v[i].cross(vJ); // a_i = a_λ + v_i × v_J
        IC[i] = w.oX[i].act(l.inertia(i));
        F[i] = IC[i] * a[i] + v[i].cross(IC[i] * v[i]); // F_i = I a_i + v_i ×* I v_i
        if let Some(external) = l.force(f_ext, i) {
            F[i] -= w.oX[i].act(external);
        }
    }
    effort.fill(L::S::zero());
    for i in l.bodies().rev() {
        for k in 0..l.joint(i).nv() {
            l.add_joint_effort(effort, i, k, w.S[l.column(i) + k].dot(F[i])); // h = Sᵀ F
        }
        let F_i = F[i];
        l.add_to_parent(F, i, F_i); // F_λ += F_i
    }
    crba::carry(l, w, IC, M.as_mut_slice());
}

/// M alone, for bodies that are placed.
#[inline(always)]
pub(crate) fn inertia<L: Pairs>(l: &L, w: &World<L::S>, d: &mut Workspace<L::S>) {
    for i in l.bodies() {
        d.IC[i] = w.oX[i].act(l.inertia(i));
    }
    crba::carry(l, w, &mut d.IC, d.M.as_mut_slice());
}

impl<S: Scalar> ConstraintSet<S> {
    /// y = J x + y.
    #[inline(always)]
    pub(crate) fn add_motion(&self, x: &[S], y: &mut [S]) {
        for plan in &self.plans {
            for r in 0..plan.rows() {
                let (row, mut sum) = (&self.J[plan.range(r)], y[plan.row + r]);
                for (k, &coordinate) in plan.coordinates.iter().enumerate() {
                    sum = row[k].mul_add(x[coordinate], sum);
                }
                y[plan.row + r] = sum;
            }
        }
    }

    /// y = Jᵀ λ + y.
    #[inline(always)]
    pub(crate) fn add_effort(&self, y: &mut [S]) {
        for plan in &self.plans {
            for r in 0..plan.rows() {
                let (row, x) = (&self.J[plan.range(r)], self.lambda[plan.row + r]);
                for (k, &coordinate) in plan.coordinates.iter().enumerate() {
                    y[coordinate] = row[k].mul_add(x, y[coordinate]);
                }
            }
        }
    }

    /// λ and the acceleration x for an effort, so that J x + γ = 0; for M that is factorised.
    #[inline(always)]
    pub(crate) fn solve(&mut self, factor: &Ltdl<S>, effort: &[S], x: &mut [S]) {
        x.copy_from_slice(effort);
        factor.solve(x); // M⁻¹ (τ − h)
        let mut b = core::mem::take(&mut self.error);
        b.copy_from_slice(&self.gamma);
        self.add_motion(x, &mut b);
        for r in 0..b.len() {
            self.lambda[r] = -b[r]; // −(γ + J M⁻¹ (τ − h))
        }
        self.delassus.multiply(&self.plans, &self.J, factor);
        self.delassus.decompose(self.proximal, &mut self.lambda);
        x.copy_from_slice(effort);
        self.add_effort(x);
        factor.solve(x); // q̈ = M⁻¹ (τ − h + Jᵀ λ)
        b.copy_from_slice(&self.gamma);
        self.add_motion(x, &mut b);
        self.error = b; // J q̈ + γ
    }

    /// The largest |J q̈ + γ|.
    #[inline(always)]
    pub(crate) fn residual(&self) -> S {
        let mut largest = S::zero();
        S::enter(Largest(&self.error, &mut largest));
        largest
    }

    /// The force of constraint k as the last call left it, at the origin of its frame, along the axes of its rows; of a
    /// point without moment. It acts on the body of the frame, its opposite on the other body or the world.
    ///
    /// # Panics
    /// If there is no such constraint.
    pub fn force(&self, k: usize) -> Force<S> {
        let mut f = [S::zero(); 6];
        let range = self.range(k);
        f[..range.len()].copy_from_slice(&self.lambda[range]);
        f.into()
    }
}

/// What [`constrained_dynamics`] gives.
#[derive(Clone, Copy, Debug)]
pub struct Constrained<'d, S> {
    /// q̈, nv numbers (rad/s², m/s²).
    pub a: &'d [S],
    /// λ, the force of each constraint on the body of its frame, along the axes of its rows (N, N m); as many numbers as
    /// there are rows.
    pub lambda: &'d [S],
    /// The largest number in J q̈ + γ (m/s², rad/s²): how well the constraints are satisfied.
    pub residual: S,
    /// How many rows of J depend on rows before them, up to rounding: they have no force of their own (in f64, J M⁻¹ Jᵀ +
    /// μ 1 is singular to 13 digits). 0 says that the solution is the only one.
    pub redundant: S,
}

/// q̈ = M⁻¹ (τ − h + Jᵀ λ + Σ Jᵢᵀ f_ext,i) with the forces λ that make J q̈ + γ = 0: forward dynamics under constraints.
///
/// q: nq numbers; v, tau: nv; f_ext: a force on each body in its frame (N, N m), number 0 being the world's; or empty
/// for none. Works on the tree's zeros: O(n d²) for a tree of depth d, O(d) for each pair of rows, O(rows³); of robots
/// with limbs ([`Model::with_limbs`]) on the articulated bodies, in O(n) beside the rows. Allocates nothing.
/// Constraints that contradict each other, or themselves at a singular posture, give finite numbers and a residual;
/// [`Proximal`](crate::Proximal) settings decide how redundant ones share their forces. Source: Carpentier, Budhiraja,
/// Mansard (2021), on the factorisation of Featherstone (2005); Wensing, Featherstone, Orin, *A reduced-order recursive
/// algorithm for the computation of the operational-space inertia matrix* (2012).
///
/// ```
/// use condyle_dynamics::{Constraint, ConstraintSet, Data, constrained_dynamics, neutral, robots};
/// let quadruped = robots::quadruped();
/// let feet = ["LF_foot", "LH_foot", "RF_foot", "RH_foot"].map(|name| quadruped.frame(name).unwrap());
/// let mut stance = ConstraintSet::new(&quadruped, &feet.map(Constraint::point))?;
/// let (mut data, mut q) = (Data::new(&quadruped), neutral(&quadruped));
/// (0..4).for_each(|leg| (q[8 + 3 * leg], q[9 + 3 * leg]) = (0.7, -1.4)); // knees bent
/// let d = constrained_dynamics(&quadruped, &mut data, &mut stance, &q, &[0.0; 18], &[0.0; 18], &[]);
/// assert!(d.residual < 1e-10 && d.redundant == 0.0); // the feet stay, in one way
/// assert_eq!(d.lambda.len(), 12);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, `data` or `constraints` were made for another model, or M is singular
/// ([`Model::singular_joints`]).
pub fn constrained_dynamics<'d, S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &'d mut Data<S>,
    constraints: &'d mut ConstraintSet<S>,
    q: &[S],
    v: &[S],
    tau: &[S],
    f_ext: &[Force<S>],
) -> Constrained<'d, S> {
    let inputs = Inputs { q, v, tau, f_ext };
    constrained_work::check_arguments(model, data, constraints, &inputs);
    if !limbs::run_constrained(model, data, constraints, inputs) {
        constrained_work::run(Forward, model, data, constraints, inputs);
    }
    Constrained {
        a: &data.constrained_dynamics.qdd,
        lambda: &constraints.lambda,
        residual: constraints.residual(),
        redundant: constraints.delassus.redundant,
    }
}

struct Forward;

impl Algorithm for Forward {
    #[inline(always)]
    fn run<S: Scalar, R: Constant<S>>(
        model: &Model<R>,
        data: &mut Data<S>,
        constraints: &mut ConstraintSet<S>,
        Inputs { q, v, tau, f_ext }: Inputs<'_, S>,
    ) {
        pass(&Single::new(model), data, constraints, q, v, tau, f_ext);
    }
}

/// The whole algorithm.
#[inline(always)]
pub(crate) fn pass<L: Pairs>(
    l: &L,
    data: &mut Data<L::S>,
    constraints: &mut ConstraintSet<L::S>,
    q: &[L::S],
    qd: &[L::S],
    tau: &[L::S],
    f_ext: &[Force<L::S>],
) {
    place(l, &mut data.world, q);
    let (world, d) = (&data.world, &mut data.constrained_dynamics);
    bias(l, world, d, qd, f_ext);
    for k in 0..tau.len() {
        d.effort[k] = tau[k] - d.effort[k]; // τ − h
    }
    d.factor.factorize(&d.M);
    for (i, plan) in constraints.plans.iter().enumerate() {
        let target = &constraints.targets[i];
        let ends = Ends::new(plan, target, world, &d.v, &d.a);
        ends.jacobian(plan, &world.S, &mut constraints.J);
        let gamma = ends.acceleration(plan, target).to_array();
        for r in 0..plan.rows() {
            constraints.gamma[plan.row + r] = gamma[r];
        }
    }
    constraints.solve(&d.factor, &d.effort, &mut d.qdd);
}

/// The largest absolute value of some numbers.
struct Largest<'a, S>(&'a [S], &'a mut S);

impl<S: Scalar> Kernel for Largest<'_, S> {
    #[inline(always)]
    fn run(self) {
        for &x in self.0 {
            *self.1 = S::select(self.1.lt(x.abs()), x.abs(), *self.1);
        }
    }
    #[inline(always)]
    fn run_fused(self) {
        self.run();
    }
}
