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

use crate::constraint_motion::Ends;
use crate::constraint_set::ConstraintSet;
use crate::crba;
use crate::data::{Data, check_forces};
use crate::kinematics::{World, positions};
use crate::limbs;
use crate::workspace::{Size, filled, zero_matrix};
use condyle_linalg::Ltdl;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_model::layout::{Layout, Pairs, Single};
use condyle_spatial::kernel;
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
            v: filled(Motion::zero(), size.bodies),
            a: filled(Motion::zero(), size.bodies),
            IC: filled(Inertia::zero(), size.bodies),
            F: filled(Force::zero(), size.bodies),
            M: zero_matrix(size.nv, size.nv),
            factor: Ltdl::new(model),
            effort: filled(S::zero(), size.nv),
            qdd: filled(S::zero(), size.nv),
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
    fn solve(&mut self, factor: &Ltdl<S>, effort: &[S], x: &mut [S]) {
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
    pub(crate) fn residual(&self) -> S {
        let mut residual = S::zero();
        largest(&self.error, &mut residual);
        residual
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
    inputs.check(model, data, constraints);
    if !limbs::run_constrained(model, data, constraints, inputs) {
        run(model, data, constraints, inputs);
    }
    Constrained {
        a: &data.constrained_dynamics.qdd,
        lambda: &constraints.lambda,
        residual: constraints.residual(),
        redundant: constraints.delassus.redundant,
    }
}

/// What dynamics under constraints read.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a, S> {
    pub q: &'a [S],
    pub v: &'a [S],
    pub tau: &'a [S],
    pub f_ext: &'a [Force<S>],
}

impl<S: Scalar> Inputs<'_, S> {
    /// Panics unless the arguments of forward dynamics fit.
    #[inline]
    #[track_caller]
    pub(crate) fn check<R>(&self, model: &Model<R>, data: &Data<S>, constraints: &ConstraintSet<S>) {
        data.check(model);
        constraints.check(model);
        model.check_regular();
        check("q", self.q.len(), model.nq());
        check("v", self.v.len(), model.nv());
        check("tau", self.tau.len(), model.nv());
        check_forces(self.f_ext.len(), model.nodes().len());
    }
}

/// The whole algorithm over the factor of M, for arguments that fit.
pub(crate) fn run<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    data: &mut Data<S>,
    constraints: &mut ConstraintSet<S>,
    Inputs { q, v, tau, f_ext }: Inputs<'_, S>,
) {
    positions(model, &mut data.world, q);
    let (world, d) = (&data.world, &mut data.constrained_dynamics);
    equations(model, world, d, v, tau, f_ext);
    factorize(d);
    constrain(world, d, constraints);
    solve(constraints, &d.factor, &d.effort, &mut d.qdd);
}

kernel! {
    /// M and τ − h, for bodies that are placed.
    fn equations<S, R>(
        model: &Model<R>,
        world: &World<S>,
        d: &mut Workspace<S>,
        v: &[S],
        tau: &[S],
        f_ext: &[Force<S>],
    ) {
        bias(&Single::new(model), world, d, v, f_ext);
        for k in 0..tau.len() {
            d.effort[k] = tau[k] - d.effort[k]; // τ − h
        }
    }
}

kernel! {
    /// M alone, for bodies that are placed.
    pub(crate) fn inertia<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        let l = Single::new(model);
        for i in l.bodies() {
            d.IC[i] = world.oX[i].act(l.inertia(i));
        }
        crba::carry(&l, world, &mut d.IC, d.M.as_mut_slice());
    }
}

kernel! {
    /// The factor of M.
    pub(crate) fn factorize<S>(d: &mut Workspace<S>) {
        d.factor.factorize(&d.M);
    }
}

kernel! {
    /// J and γ, for bodies whose motion is known.
    fn constrain<S>(world: &World<S>, d: &Workspace<S>, set: &mut ConstraintSet<S>) {
        for (i, plan) in set.plans.iter().enumerate() {
            let target = &set.targets[i];
            let ends = Ends::new(plan, target, world, &d.v, &d.a);
            ends.jacobian(plan, &world.S, &mut set.J);
            let gamma = ends.acceleration(plan, target).to_array();
            for r in 0..plan.rows() {
                set.gamma[plan.row + r] = gamma[r];
            }
        }
    }
}

kernel! {
    /// λ and the acceleration x for an effort.
    pub(crate) fn solve<S>(set: &mut ConstraintSet<S>, factor: &Ltdl<S>, effort: &[S], x: &mut [S]) {
        set.solve(factor, effort, x);
    }
}

kernel! {
    /// The largest absolute value of some numbers.
    fn largest<S>(of: &[S], largest: &mut S) {
        for &x in of {
            *largest = S::select(largest.lt(x.abs()), x.abs(), *largest);
        }
    }
}
