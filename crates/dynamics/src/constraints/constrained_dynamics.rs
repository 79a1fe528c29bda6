//! Forward dynamics under constraints.
//!
//! Gauss's principle determines q̈: among all accelerations with J q̈ + γ = 0, the robot has the one nearest to its
//! acceleration without constraints. The distance is measured in the metric of the inertia matrix M. With the forces λ
//! of the constraints,
//!
//! ```text
//! [ M   Jᵀ ] [  q̈ ]   [ τ − h ]         J M⁻¹ Jᵀ λ = −(γ + J M⁻¹ (τ − h)),
//! [ J   0  ] [ −λ ] = [ −γ    ],        q̈ = M⁻¹ (τ − h + Jᵀ λ)
//! ```
//!
//! Source: Udwadia and Kalaba, *A new perspective on constrained motion* (1992); Carpentier, Budhiraja, Mansard,
//! *Proximal and sparse resolution of constrained dynamic equations* (2021).

use crate::constraints::constraint::ConstraintKind;
use crate::constraints::constraint_motion::FramePair;
use crate::constraints::constraint_set::ConstraintSet;
use crate::passes::crba;
use crate::passes::free_armature::add_armature_bias;
use crate::passes::kinematics::World;
use crate::workspace::{filled, workspace, zero_matrix};
use condyle_linalg::Ltdl;
use condyle_model::Model;
use condyle_model::layout::{Layout, Pairs, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Cross, Force, Inertia, Mat3, Matrix, Motion, Scalar, Vec3};

workspace! {
    /// Scratch of constrained dynamics, in the world's frame.
    pub(crate) struct Workspace<S>(size, model: &Model<R>) {
        /// Velocity of each body. Written by: `bias`.
        pub v: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Acceleration of each body for q̈ = 0; the world's acceleration is −g, which accounts for gravity. Written
        /// by: `bias`.
        pub a: Array<Motion<S>> = filled(Motion::zero, size.bodies),
        /// Composite inertia Iᶜ of each body. Written by: `bias`, `inertia`.
        pub IC: Array<Inertia<S>> = filled(Inertia::zero, size.bodies),
        /// Force that each joint transmits for q̈ = 0. Written by: `bias`.
        pub F: Array<Force<S>> = filled(Force::zero, size.bodies),
        /// Inertia matrix M. Written by: `bias`, `inertia`.
        pub M: Matrix<S> = zero_matrix(size.nv, size.nv),
        /// Sparse factor of the inertia matrix M. Written by: `constrained_dynamics`, `impulse_dynamics`.
        pub factor: Ltdl<S> = Ltdl::new(model),
        /// Bias efforts h, which the difference τ − h overwrites. Written by: `bias`, `constrained_dynamics`.
        pub effort: Array<S> = filled(S::zero, size.nv),
        /// Joint accelerations, or changes of the joint velocities in an impact. Written by: `constrained_dynamics`,
        /// `impulse_dynamics`.
        pub qdd: Array<S> = filled(S::zero, size.nv),
    }
}

/// Computes the inertia matrix M, the bias efforts h, and the motion of all bodies for q̈ = 0. `w` must contain the
/// placements of the bodies. The Newton–Euler algorithm and the composite-rigid-body algorithm run together, in one
/// outward and one inward pass.
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
    /// Adds J x to y, with the constraint Jacobian J. x has one number per coordinate, and y has one number per row of
    /// J.
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

    /// Adds the efforts Jᵀ λ of the constraints to y.
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

    /// Returns the largest absolute value of the constraint accelerations J q̈ + γ.
    pub(crate) fn residual(&self) -> S {
        let mut residual = S::zero();
        largest(&self.error, &mut residual);
        residual
    }

    /// Returns the force of constraint k from the last call, at the origin of the constraint's frame. The force is
    /// expressed in the axes of the constraint's `reference`. Only rigid constraints have a moment. The force acts on
    /// the body of the frame. The opposite force acts on the other body or the world.
    ///
    /// # Panics
    /// Panics if constraint k does not exist.
    #[inline(always)]
    #[track_caller]
    pub fn force(&self, k: usize) -> Force<S> {
        let mut f = [S::zero(); 6];
        let (lambda, plan) = (&self.lambda[self.range(k)], &self.plans[k]);
        let axes: Mat3<S> = plan.axes.lift();
        match plan.kind {
            ConstraintKind::Line => return Force::new(axes.z.scale(lambda[0]), Vec3::zero()),
            ConstraintKind::Plane => {
                return Force::new(axes.x.scale(lambda[0]) + axes.z.scale(lambda[1]), Vec3::zero());
            }
            _ => f[..lambda.len()].copy_from_slice(lambda),
        }
        f.into()
    }
}

kernel! {
    /// Computes the inertia matrix M and the efforts τ − h. `world` must contain the placements of the bodies.
    pub(crate) fn equations<S, R>(
        model: &Model<R>,
        world: &World<S>,
        d: &mut Workspace<S>,
        v: &[S],
        tau: &[S],
        f_ext: &[Force<S>],
    ) {
        bias(&Single::new(model), world, d, v, f_ext);
        add_armature_bias(model, v, &mut d.effort);
        for k in 0..tau.len() {
            d.effort[k] = tau[k] - d.effort[k]; // τ − h
        }
    }
}

kernel! {
    /// Computes only the inertia matrix M. `world` must contain the placements of the bodies.
    pub(crate) fn inertia<S, R>(model: &Model<R>, world: &World<S>, d: &mut Workspace<S>) {
        let l = Single::new(model);
        for i in l.bodies() {
            d.IC[i] = world.oX[i].act(l.inertia(i));
        }
        crba::carry(&l, world, &mut d.IC, d.M.as_mut_slice());
    }
}

kernel! {
    /// Factorises the inertia matrix M.
    pub(crate) fn factorize<S>(d: &mut Workspace<S>) {
        d.factor.factorize(&d.M);
    }
}

kernel! {
    /// Computes the constraint Jacobian J and the constraint accelerations J q̈ + γ from the velocities v and
    /// accelerations a of the bodies. If a are the accelerations of the bodies for q̈ = 0, the result J q̈ + γ is γ.
    pub(crate) fn evaluate<S>(world: &World<S>, set: &mut ConstraintSet<S>, v: &[Motion<S>], a: &[Motion<S>]) {
        for (i, plan) in set.plans.iter().enumerate() {
            let target = &set.targets[i];
            let ends = FramePair::new(plan, target, world, v, a);
            ends.jacobian(plan, &world.S, &mut set.J);
            let acceleration = ends.acceleration(plan, target).to_array();
            for r in 0..plan.rows() {
                set.error[plan.row + r] = acceleration[r];
            }
        }
    }
}

kernel! {
    /// Computes the constraint forces λ and the joint accelerations x for given efforts, so that J x + γ = 0. M must be
    /// factorised.
    pub(crate) fn solve<S>(set: &mut ConstraintSet<S>, factor: &Ltdl<S>, effort: &[S], x: &mut [S]) {
        x.copy_from_slice(effort);
        factor.solve(x); // M⁻¹ (τ − h)
        let mut b = core::mem::take(&mut set.error);
        b.copy_from_slice(&set.gamma);
        set.add_motion(x, &mut b);
        for r in 0..b.len() {
            set.lambda[r] = -b[r]; // −(γ + J M⁻¹ (τ − h))
        }
        set.delassus.redundant = S::zero();
        for island in &set.islands {
            set.delassus.multiply(&set.plans, island, &set.J, factor);
            set.delassus.decompose(island, set.proximal, &mut set.lambda);
        }
        x.copy_from_slice(effort);
        set.add_effort(x);
        factor.solve(x); // q̈ = M⁻¹ (τ − h + Jᵀ λ)
        b.copy_from_slice(&set.gamma);
        set.add_motion(x, &mut b);
        set.error = b; // J q̈ + γ
    }
}

kernel! {
    /// Sets `largest` to the maximum of `largest` and all absolute values in `of`.
    pub(crate) fn largest<S>(of: &[S], largest: &mut S) {
        for &x in of {
            *largest = S::select(largest.lt(x.abs()), x.abs(), *largest);
        }
    }
}
