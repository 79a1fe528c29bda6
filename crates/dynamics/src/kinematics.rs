//! Where the bodies are and how they move: one pass from the root to the tips for all bodies. What can then be asked is
//! in `frames.rs`.

use crate::data::Data;
use crate::frames::{Accelerations, Placements, Velocities};
use crate::limbs;
use crate::workspace::{Size, filled};
use condyle_linalg::check;
use condyle_model::Model;
use condyle_model::joint::Joint;
use condyle_model::joint::kinematics::JointSinCos;
use condyle_model::layout::{Layout, Single};
use condyle_spatial::kernel;
use condyle_spatial::{Constant, Cross, Motion, Scalar, Se3};

/// What depends on the position alone, in the world's frame.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct World<S> {
    /// Written by: `place`, and by `rnea`.
    pub sin_cos: JointSinCos<S>,
    /// oXi: the body's turned frame in the world. Shape: bodies. Written by: `place`.
    pub oX: Vec<Se3<S>>,
    /// S: what each degree of freedom moves the body by. Shape: columns. Written by: `place`.
    pub S: Vec<Motion<S>>,
    /// Where the last call has placed the bodies. Written by: `place`, by `rnea`, and by limbs.
    pub placed: Placed,
}

/// Where the bodies' placements stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Placed {
    /// They were not computed.
    Nowhere,
    /// Body by body.
    Bodies,
    /// In the steps of limbs side by side.
    Limbs,
}

impl<S: Scalar> World<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self {
            sin_cos: JointSinCos::new(size.bodies),
            oX: filled(Se3::identity(), size.bodies),
            S: filled(Motion::zero(), size.columns),
            placed: Placed::Nowhere,
        }
    }
}

/// oXi = oXλ λXi, and the columns of S, for all bodies.
#[inline(always)]
pub(crate) fn place<L: Layout>(l: &L, World { sin_cos, oX, S, placed }: &mut World<L::S>, q: &[L::S]) {
    *placed = Placed::Bodies;
    Joint::sin_cos(l, q, sin_cos);
    for i in l.bodies() {
        oX[i] = l.parent(oX, i) * Joint::placement_with(l, i, q, sin_cos.sin[i], sin_cos.cos[i]); // oXi = oXλ λXi
        let joint = l.joint(i);
        for k in 0..joint.nv() {
            S[l.column(i) + k] = joint.column(&oX[i], k); // oXi S, in the world
        }
    }
}

/// How the bodies move, in the world's frame: what depends on the velocity and the acceleration too.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Moving<S> {
    /// Velocity of the body; the world's stays 0. Shape: bodies. Written by: `advance`.
    pub v: Vec<Motion<S>>,
    /// Ṡ = v × S: how fast each column of S turns with its body. Shape: columns. Written by: `advance`.
    pub dS: Vec<Motion<S>>,
    /// The velocity coordinates. Shape: nv. Written by: `advance`.
    pub qd: Vec<S>,
    /// Spatial acceleration of the body, without gravity; the world's stays 0. Shape: bodies. Written by: `accelerate`.
    pub a: Vec<Motion<S>>,
}

impl<S: Scalar> Moving<S> {
    pub(crate) fn new(size: Size) -> Self {
        Self {
            v: filled(Motion::zero(), size.bodies),
            dS: filled(Motion::zero(), size.columns),
            qd: filled(S::zero(), size.nv),
            a: filled(Motion::zero(), size.bodies),
        }
    }
}

/// v_i and the columns of Ṡ, for bodies that are placed.
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
            dS[l.column(i) + k] = v_i.cross(S[l.column(i) + k]); // Ṡ = v_i × S: S is fixed in the body
        }
    }
}

/// a_i, for bodies whose velocities are known.
#[inline(always)]
fn accelerate<L: Layout>(l: &L, World { S, .. }: &World<L::S>, m: &mut Moving<L::S>, qdd: &[L::S]) {
    let Moving { dS, qd, a, .. } = m;
    for i in l.bodies() {
        let mut a_i = l.parent(a, i);
        for k in 0..l.joint(i).nv() {
            let c = l.column(i) + k;
            a_i = S[c].scale_add(l.joint_velocity(qdd, i, k), dS[c].scale_add(l.joint_velocity(qd, i, k), a_i)); // a_i = a_λ + S q̈ + Ṡ q̇
        }
        a[i] = a_i;
    }
}

kernel! {
    /// Places all bodies.
    pub(crate) fn positions<S, R>(model: &Model<R>, world: &mut World<S>, q: &[S]) {
        place(&Single::new(model), world, q);
    }
}

kernel! {
    /// The velocities of bodies that are placed.
    pub(crate) fn velocities<S, R>(model: &Model<R>, world: &World<S>, moving: &mut Moving<S>, v: &[S]) {
        advance(&Single::new(model), world, moving, v);
    }
}

kernel! {
    /// The accelerations of bodies whose velocities are known.
    pub(crate) fn accelerations<S, R>(model: &Model<R>, world: &World<S>, moving: &mut Moving<S>, a: &[S]) {
        accelerate(&Single::new(model), world, moving, a);
    }
}

impl<S: Scalar> Data<S> {
    /// The placements at the position of the last call on this data: they need not be computed again. There are none if it
    /// did without them, as [`rnea`](crate::rnea()) does.
    ///
    /// ```
    /// use condyle_dynamics::{Data, aba, forward_kinematics, robots};
    /// let arm = robots::arm7();
    /// let (tool, mut data, q) = (arm.frame("tool")?, Data::new(&arm), [0.3; 7]);
    /// aba(&arm, &mut data, &q, &[0.0; 7], &[0.0; 7], &[]);
    /// let there = data.placements(&arm).unwrap().frame(tool);
    /// assert_eq!(there, forward_kinematics(&arm, &mut data, &q).frame(tool));
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// If this was made for a model of another tree.
    pub fn placements<'d, R: Constant<S>>(&'d mut self, model: &'d Model<R>) -> Option<Placements<'d, S, R>> {
        self.check(model);
        if self.world.placed == Placed::Limbs {
            limbs::spread(model, self);
        }
        (self.world.placed == Placed::Bodies).then_some(Placements { model, world: &self.world })
    }
}

/// Places all bodies: oXi = oXλ λXi(q), in O(n).
///
/// q: nq numbers. Allocates nothing. Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), table 4.1.
///
/// ```
/// use condyle_dynamics::{Data, forward_kinematics, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let placements = forward_kinematics(&arm, &mut data, &[0.0; 7]);
/// let tool = placements.frame(arm.frame("tool")?);
/// assert!(tool.translation.z > 0.5); // stretched upwards
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If `q` has not nq numbers, or `data` was made for a model of another tree.
pub fn forward_kinematics<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
) -> Placements<'d, S, R> {
    data.check(model);
    check("q", q.len(), model.nq());
    positions(model, &mut data.world, q);
    Placements { model, world: &data.world }
}

/// Places all bodies and gives their velocities: v_i = v_λ + S q̇, in O(n).
///
/// q: nq numbers; v: nv. Allocates nothing. Source: Featherstone (2008), table 5.1; in the world's frame.
///
/// ```
/// use condyle_dynamics::{Data, ReferenceFrame, forward_velocities, robots};
/// let arm = robots::arm7();
/// let mut data = Data::new(&arm);
/// let velocities = forward_velocities(&arm, &mut data, &[0.0; 7], &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let tool = velocities.frame_velocity(arm.frame("tool")?, ReferenceFrame::World);
/// assert_eq!(tool.to_array(), [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]); // all turns about the vertical
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another tree.
pub fn forward_velocities<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> Velocities<'d, S, R> {
    data.check(model);
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    positions(model, &mut data.world, q);
    velocities(model, &data.world, &mut data.moving, v);
    Velocities { placements: Placements { model, world: &data.world }, moving: &data.moving }
}

/// Places all bodies and gives their velocities and accelerations: a_i = a_λ + S q̈ + Ṡ q̇, in O(n).
///
/// q: nq numbers; v, a: nv. Gravity is not among the accelerations. Allocates nothing. Source: Featherstone (2008),
/// table 5.1; in the world's frame.
///
/// ```
/// use condyle_dynamics::{Data, ReferenceFrame, forward_accelerations, robots};
/// let arm = robots::arm7();
/// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
/// let (q, v) = ([0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// let motion = forward_accelerations(&arm, &mut data, &q, &v, &[0.0; 7]);
/// let a = motion.frame_classical_acceleration(tool, ReferenceFrame::LocalWorldAligned);
/// assert!(f64::abs(a.linear.x + 4.0 * motion.frame(tool).translation.x) < 1e-12); // −ω² r, towards the axis
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// If an argument has the wrong length, or `data` was made for a model of another tree.
pub fn forward_accelerations<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Accelerations<'d, S, R> {
    data.check(model);
    check("q", q.len(), model.nq());
    check("v", v.len(), model.nv());
    check("a", a.len(), model.nv());
    positions(model, &mut data.world, q);
    velocities(model, &data.world, &mut data.moving, v);
    accelerations(model, &data.world, &mut data.moving, a);
    let velocities = Velocities { placements: Placements { model, world: &data.world }, moving: &data.moving };
    Accelerations { velocities }
}
