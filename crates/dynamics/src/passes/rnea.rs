//! Inverse dynamics by the recursive Newton–Euler algorithm.
//!
//! Source: Luh, Walker, Paul, *On-line computational scheme for mechanical manipulators* (1980). Quantities of a body
//! are in the frame of the body. Featherstone (*Rigid Body Dynamics Algorithms*, 2008, table 5.1) uses the spatial
//! acceleration of each body. This file uses the classical acceleration a of the body's origin, so it needs no linear
//! velocity. A point r of a body has the acceleration a + K r with K = ω̇× + ω× ω×. The point may be the centre of mass
//! or the origin of a joint on the body. The equations of the book correspond to the following equations:
//!
//! ```text
//! the book                            here
//! v₀ = 0, a₀ = −g                     ω₀ = ω̇₀ = 0, K₀ = 0, a₀ = −g
//! iXλ = X_J X_T                       Xi = λXi, with the sines and cosines of all joints computed before
//! v_i = iXλ v_λ + v_J                 ω = Rᵀ ω_λ + ω_J
//! a_i = iXλ a_λ + S q̈ + v_i × v_J     a = Rᵀ (a_λ + K_λ p), ω̇ = Rᵀ ω̇_λ, and what the joint adds (added_to)
//! f_i = I a_i + v_i ×* I v_i − f_x    f = m a + K h, n = I ω̇ + ω × I ω + h × a, minus f_x
//! τ_i = S_iᵀ f_i                      project, when the pass has left the subtree of body i
//! f_λ += λX*_i f_i                    add_to_parent_on_stack
//! ```
//!
//! In the right column, λ is the parent of body i, R and p are the rotation and translation of λXi, and h is the body's
//! first moment (mass times centre of mass).
//!
//! The two loops of the book are merged into one. When the pass has visited the last body of a subtree, it adds the
//! force on the root of the subtree to the force on the root's parent. The test `the_book_gives_the_same` compares this
//! pass with the equations of the book.

use crate::passes::free_armature::add_armature_bias;
use crate::passes::kinematics::{PlacementCache, World};
use crate::workspace::{filled, workspace};
use condyle_model::Model;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::joint::{ClassicalMotion, Joint};
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Act, Array, Force, Inertia, Scalar, Se3, Vec3};

workspace! {
    /// Scratch of the recursive Newton–Euler algorithm, in the internal frames of the bodies, which are rotated to the
    /// joint axes.
    pub(crate) struct Workspace<S>(size) {
        /// Pose λXi of each body in the frame of its parent. Written by: `pass`.
        pub X: Array<Se3<S>> = filled(Se3::identity, size.body_depth),
        /// Angular velocity, angular acceleration and acceleration of the origin of each body. The world's acceleration
        /// is −g, which accounts for gravity. Written by: `pass`.
        pub motion: Array<ClassicalMotion<S>> =
            filled(|| ClassicalMotion { w: Vec3::zero(), dw: Vec3::zero(), a: Vec3::zero() }, size.body_depth),
        /// Force that each joint transmits. Written by: `pass`.
        pub f: Array<Force<S>> = filled(Force::zero, size.body_depth),
        /// Joint efforts. Written by: `pass`.
        pub tau: Array<S> = filled(S::zero, size.nv),
        /// Zeros, passed as accelerations or velocities if the caller gives none. Never overwritten.
        pub zero: Array<S> = filled(S::zero, size.nv),
    }
}

/// Runs the recursive Newton–Euler algorithm branch by branch: from the start of the branch to its tip, and back.
#[inline(always)]
pub(crate) fn pass<L: Layout>(
    l: &L,
    sin_cos: &mut JointSinCos<L::S>,
    d: &mut Workspace<L::S>,
    q: &[L::S],
    qd: &[L::S],
    qdd: &[L::S],
    f_ext: &[Force<L::S>],
) {
    let Workspace { X, motion, f, tau, .. } = d;
    let (X, motion, f, tau) = (&mut X[..], &mut motion[..], &mut f[..], &mut tau[..]);
    Joint::sin_cos(l, q, sin_cos);
    let (sin, cos) = (&sin_cos.sin[..], &sin_cos.cos[..]);
    motion[0].a = l.minus_gravity();
    tau.fill(L::S::zero());
    for i in l.bodies() {
        let here = l.stack_index(i);
        let Xi = Joint::placement_with(l, i, q, sin[i], cos[i]); // λXi = X_T X_J
        X[here] = Xi; // stored here, so that `Xi` needs no stack memory later
        let (parent, R) = (l.parent_on_stack(motion, i), Xi.rotation);
        let a = parent.centripetal().mul_add(Xi.translation, parent.a); // a_λ + K_λ p
        let m = ClassicalMotion { w: R.transpose_mul(parent.w), dw: R.transpose_mul(parent.dw), a: R.transpose_mul(a) };
        let vJ = Joint::motion(l, i, qd); // v_J = S q̇
        let aJ = Joint::motion(l, i, qdd); // S q̈
        let m = vJ.added_to(aJ, m);
        motion[here] = m;
        // Newton: f = m a + K h. Euler: n = I ω̇ + ω × I ω + h × a. h is the first moment.
        let Inertia { mass, mass_com, rotational } = l.inertia(i);
        let n = mass_com.cross_add(m.a, m.w.cross_add(rotational * m.w, rotational * m.dw));
        let mut fi = Force::new(m.a.scale_add(mass, m.centripetal() * mass_com), n);
        if let Some(external) = l.force(f_ext, i) {
            fi -= external;
        }
        f[here] = fi;
        for &j in l.subtrees_ending_at(i) {
            let here = l.stack_index(j);
            l.sum_lanes(j, &mut f[here]);
            let fj = f[here];
            Joint::project(l, j, fj, tau); // τ_j = Sᵀ f_j
            l.add_to_parent_on_stack(f, j, X[here].act(fj)); // f_λ += λXj f_j
        }
    }
    l.add_armature_torque(qdd, tau);
}

kernel! {
    /// Computes the joint efforts τ body by body.
    pub(crate) fn run<S, R>(
        model: &Model<R>,
        world: &mut World<S>,
        d: &mut Workspace<S>,
        q: &[S],
        v: &[S],
        a: &[S],
        f_ext: &[Force<S>],
    ) {
        world.placed = PlacementCache::Nowhere;
        pass(&Single::new(model), &mut world.sin_cos, d, q, v, a, f_ext);
        add_armature_bias(model, v, &mut d.tau);
    }
}
