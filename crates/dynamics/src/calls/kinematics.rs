//! Kinematics: placements, velocities and accelerations of the bodies, and Jacobians of single frames.

use super::limbs::spread;
use crate::data::Data;
use crate::passes::frames::{Accelerations, Placements, ReferenceFrame, Velocities, check_body, check_frame, columns};
use crate::passes::kinematics::{PlacementCache, accelerations, positions, velocities};
use crate::passes::path_jacobian::path_jacobian;
use condyle_linalg::check;
use condyle_model::Model;
use condyle_spatial::{Constant, Dense, DenseMatrix, Scalar, Se3, Vec3};

impl<S: Scalar> Data<S> {
    /// Returns the placements that the last call with this data computed, without a new computation. Returns `None` if
    /// the last call did not compute placements, for example [`rnea`](crate::rnea()).
    ///
    /// The model must have the same joints and frames as the model of the last call. Inertias and gravity may differ.
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
    /// Panics if this data was made for a model of another tree, or the last call used a model with other placements of
    /// joints or frames.
    #[track_caller]
    pub fn placements<'d, R: Constant<S>>(&'d mut self, model: &'d Model<R>) -> Option<Placements<'d, S, R>> {
        self.check(model);
        let (PlacementCache::Bodies(geometry) | PlacementCache::Limbs(geometry)) = self.world.placed else {
            return None;
        };
        if geometry != model.geometry_hash() {
            wrong_geometry(model.name());
        }
        if let PlacementCache::Limbs(_) = self.world.placed {
            spread(model, self);
        }
        matches!(self.world.placed, PlacementCache::Bodies(_)).then_some(Placements { model, world: &self.world })
    }
}

/// Panics because the placements in the data belong to another robot.
#[cold]
#[inline(never)]
#[track_caller]
fn wrong_geometry(name: &str) -> ! {
    panic!(
        "data: its placements are those of another robot than `{name}`, with the same tree but joints or frames elsewhere"
    );
}

/// Computes the placements of all bodies, oXi = oXλ λXi(q), in O(n) for n bodies. λ is the parent of body i.
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
/// Panics if `q` does not have nq numbers, or `data` was made for a model of another tree.
#[track_caller]
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

/// Computes the Jacobian J of one frame, 6 × nv, linear rows first: the frame's velocity is J v. Overwrites J.
///
/// q: nq numbers. The function needs no `Data` and visits only the joints between the frame and the world, in O(depth +
/// nv). If several quantities are needed at one position, use [`Placements::frame_jacobian`], which gives the same
/// Jacobian up to rounding. Allocates nothing. Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), example
/// 4.1.
///
/// ```
/// use condyle_dynamics::{Data, ReferenceFrame, forward_kinematics, frame_jacobian, robots};
/// let (arm, q) = (robots::arm7(), [0.3; 7]);
/// let (tool, axes) = (arm.frame("tool")?, ReferenceFrame::LocalWorldAligned);
/// let [mut J, mut same] = [(); 2].map(|()| nalgebra::DMatrix::zeros(6, 7));
/// frame_jacobian(&arm, &q, tool, axes, &mut J);
/// forward_kinematics(&arm, &mut Data::new(&arm), &q).frame_jacobian(tool, axes, &mut same);
/// assert!((J - same).amax() < 1e-15);
/// # Ok::<(), condyle_dynamics::Error>(())
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, the frame does not exist, or `J` is not 6 × nv.
#[track_caller]
pub fn frame_jacobian<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    frame: usize,
    reference: ReferenceFrame,
    J: &mut DenseMatrix<S, impl Dense<S>>,
) {
    frame_jacobian_strided(model, q, frame, reference, columns("J", J, model.nv()), [1, 6]);
}

/// Computes the Jacobian like [`frame_jacobian`], and writes it with the given strides. `strides[0]` is the distance
/// between rows, and `strides[1]` is the distance between columns. Bindings of languages that store matrices by rows
/// call this function.
#[doc(hidden)]
#[track_caller]
pub fn frame_jacobian_strided<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    frame: usize,
    reference: ReferenceFrame,
    J: &mut [S],
    strides: [usize; 2],
) {
    check_frame(model, frame);
    let frame = &model.frames()[frame];
    jacobian_on(model, q, frame.body, frame.placement, reference, J, strides);
}

/// Computes the Jacobian J of one body, 6 × nv, like [`frame_jacobian`] for a frame. The body's frame is the link's
/// frame in the URDF.
///
/// ```
/// use condyle_dynamics::{ReferenceFrame, body_jacobian, robots};
/// let arm = robots::arm7();
/// let mut J = nalgebra::DMatrix::zeros(6, 7);
/// body_jacobian(&arm, &[0.3; 7], 1, ReferenceFrame::Local, &mut J);
/// assert_eq!(J[(5, 0)], 1.0); // the first joint turns it about its own axis z
/// ```
///
/// # Panics
/// Panics if `q` does not have nq numbers, the body does not exist, or `J` is not 6 × nv.
#[track_caller]
pub fn body_jacobian<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    body: usize,
    reference: ReferenceFrame,
    J: &mut DenseMatrix<S, impl Dense<S>>,
) {
    body_jacobian_strided(model, q, body, reference, columns("J", J, model.nv()), [1, 6]);
}

/// Computes the Jacobian like [`body_jacobian`], and writes it with strides as [`frame_jacobian_strided`] does.
#[doc(hidden)]
#[track_caller]
pub fn body_jacobian_strided<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    body: usize,
    reference: ReferenceFrame,
    J: &mut [S],
    strides: [usize; 2],
) {
    jacobian_on(model, q, body, Se3::identity(), reference, J, strides);
}

#[track_caller]
fn jacobian_on<S: Scalar, R: Constant<S>>(
    model: &Model<R>,
    q: &[S],
    body: usize,
    bXf: Se3<f64>,
    reference: ReferenceFrame,
    J: &mut [S],
    strides: [usize; 2],
) {
    check("q", q.len(), model.nq());
    check("J", J.len(), 6 * model.nv());
    check_body(model, body);
    let zXb = Se3::new(model.nodes()[body].axis_rotation.transpose(), Vec3::zero());
    path_jacobian(model, q, body, (zXb * bXf).lift(), reference, J, strides);
}

/// Computes the placements and velocities of all bodies, v_i = v_λ + S q̇, in O(n) for n bodies. λ is the parent of
/// body i, and S the motion subspace of its joint.
///
/// q: nq numbers; v: nv numbers. Allocates nothing. Source: Featherstone (2008), table 5.1, in the world's frame.
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
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn forward_velocities<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
) -> Velocities<'d, S, R> {
    check("v", v.len(), model.nv());
    forward_kinematics(model, data, q);
    velocities(model, &data.world, &mut data.moving, v);
    Velocities { placements: Placements { model, world: &data.world }, moving: &data.moving }
}

/// Computes the placements, velocities and accelerations of all bodies, a_i = a_λ + S q̈ + Ṡ q̇, in O(n) for n bodies.
/// λ is the parent of body i, and S the motion subspace of its joint.
///
/// q: nq numbers; v, a: nv numbers each. Accelerations exclude gravity. Allocates nothing. Source: Featherstone (2008),
/// table 5.1, in the world's frame.
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
/// Panics if an argument has the wrong length, or `data` was made for a model of another tree.
#[track_caller]
pub fn forward_accelerations<'d, S: Scalar, R: Constant<S>>(
    model: &'d Model<R>,
    data: &'d mut Data<S>,
    q: &[S],
    v: &[S],
    a: &[S],
) -> Accelerations<'d, S, R> {
    check("a", a.len(), model.nv());
    forward_velocities(model, data, q, v);
    accelerations(model, &data.world, &mut data.moving, a);
    let velocities = Velocities { placements: Placements { model, world: &data.world }, moving: &data.moving };
    Accelerations { velocities }
}
