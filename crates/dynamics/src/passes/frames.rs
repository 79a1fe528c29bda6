//! Queries on bodies and frames whose placements are already computed: pose, velocity, acceleration, Jacobian and rate
//! of the Jacobian.
//!
//! All quantities are stored in the world's frame: the joint columns S with their rates Ṡ, and the velocity v_i and
//! acceleration a_i of each body i. In a reference frame r with pose oXr and velocity v_r, the Jacobian J, the velocity
//! v and the acceleration a are
//!
//! ```text
//! J = oXr⁻¹ S     dJ/dt = oXr⁻¹ (Ṡ − v_r × S)     v = oXr⁻¹ v_i     a = oXr⁻¹ a_i
//! ```
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), sections 2.10 (differentiation) and 2.11
//! (acceleration). A Jacobian costs O(depth + nv); any other query about one body or frame costs O(1). Queries do not
//! allocate.

use crate::passes::answers::answers;
use crate::passes::kinematics::{Moving, World};
use condyle_linalg::{check, check_index};
use condyle_model::Model;
use condyle_model::layout::{Columns, Single};
use condyle_spatial::gate::{FusedF64, Rename};
use condyle_spatial::{
    Act, Constant, Cross, Dense, DenseMatrix, Force, Mat3, Motion, Scalar, Se3, Vec3, kernel, same_layout,
};
use core::ops::Deref;

/// Reference frame in which a velocity, an acceleration or a Jacobian of a frame or body is expressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum ReferenceFrame {
    /// Frame or body whose quantity is computed: the quantity is expressed in the frame itself, or in the body's frame.
    Local,
    /// World's frame: a linear velocity is the velocity of the body-fixed point at the world's origin.
    World,
    /// Axes of the world at the frame's origin: a linear velocity is the velocity of this origin.
    LocalWorldAligned,
}

same_layout!(ReferenceFrame);

impl ReferenceFrame {
    /// Returns oXr, the pose of the reference frame in the world, for a frame with pose oXf.
    #[inline(always)]
    pub(crate) fn pose<S: Scalar>(self, oXf: Se3<S>) -> Se3<S> {
        match self {
            Self::Local => oXf,
            Self::World => Se3::identity(),
            Self::LocalWorldAligned => Se3::new(Mat3::identity(), oXf.translation),
        }
    }

    /// Returns v_r, the velocity of the reference frame, expressed in the world's frame. The queried frame has the pose
    /// oXf and is fixed to a body with velocity v.
    #[inline(always)]
    pub(crate) fn velocity<S: Scalar>(self, oXf: Se3<S>, v: Motion<S>) -> Motion<S> {
        match self {
            Self::Local => v,
            Self::World => Motion::zero(),
            Self::LocalWorldAligned => Motion::new(v.linear + v.angular.cross(oXf.translation), Vec3::zero()),
        }
    }
}

/// Placements of a robot at one position, computed by [`forward_kinematics`](crate::forward_kinematics).
#[derive(Clone, Copy, Debug)]
pub struct Placements<'d, S, R = f64> {
    pub(crate) model: &'d Model<R>,
    pub(crate) world: &'d World<S>,
}

/// Placements and velocities of a robot, computed by [`forward_velocities`](crate::forward_velocities). Dereferences to
/// [`Placements`].
#[derive(Clone, Copy, Debug)]
pub struct Velocities<'d, S, R = f64> {
    pub(crate) placements: Placements<'d, S, R>,
    pub(crate) moving: &'d Moving<S>,
}

/// Placements, velocities and accelerations of a robot, computed by
/// [`forward_accelerations`](crate::forward_accelerations). Dereferences to [`Velocities`], and so to [`Placements`].
#[derive(Clone, Copy, Debug)]
pub struct Accelerations<'d, S, R = f64> {
    pub(crate) velocities: Velocities<'d, S, R>,
}

#[doc(hidden)]
impl<'d> Rename<Placements<'d, FusedF64>> for Placements<'d, f64> {
    #[inline(always)]
    fn renamed(self) -> Placements<'d, FusedF64> {
        Placements { model: self.model, world: self.world.renamed() }
    }
}

#[doc(hidden)]
impl<'d> Rename<Velocities<'d, FusedF64>> for Velocities<'d, f64> {
    #[inline(always)]
    fn renamed(self) -> Velocities<'d, FusedF64> {
        Velocities { placements: self.placements.renamed(), moving: self.moving.renamed() }
    }
}

#[doc(hidden)]
impl<'d> Rename<Accelerations<'d, FusedF64>> for Accelerations<'d, f64> {
    #[inline(always)]
    fn renamed(self) -> Accelerations<'d, FusedF64> {
        Accelerations { velocities: self.velocities.renamed() }
    }
}

impl<'d, S, R> Placements<'d, S, R> {
    /// Returns the robot's model.
    #[inline(always)]
    pub(crate) fn robot(&self) -> &'d Model<R> {
        self.model
    }
}

impl<'d, S, R> Deref for Velocities<'d, S, R> {
    type Target = Placements<'d, S, R>;
    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.placements
    }
}

impl<'d, S, R> Deref for Accelerations<'d, S, R> {
    type Target = Velocities<'d, S, R>;
    #[inline(always)]
    fn deref(&self) -> &Self::Target {
        &self.velocities
    }
}

/// Multiplies `s` by the ratio of joint column c, and adds the product to the column of J for the coordinate that
/// drives column c.
#[inline(always)]
pub(crate) fn add<S: Scalar, R>(model: &Model<R>, J: &mut [S], c: usize, s: Motion<S>) {
    let column = &model.columns()[c];
    let s = s.scale(S::splat(column.ratio)).to_array();
    let J = &mut J[6 * column.coordinate..][..6];
    for (J, &s) in J.iter_mut().zip(&s) {
        *J += s;
    }
}

/// Panics unless the model has a body with this index.
#[inline(always)]
#[track_caller]
pub(crate) fn check_body<R>(model: &Model<R>, body: usize) {
    check_index("body", body, model.nodes().len(), "bodies");
}

/// Panics unless the model has a frame with this index.
#[inline(always)]
#[track_caller]
pub(crate) fn check_frame<R>(model: &Model<R>, frame: usize) {
    check_index("frame", frame, model.frames().len(), "frames");
}

/// Returns the entries of a Jacobian, column by column. Panics unless the Jacobian is 6 × nv.
#[inline]
#[track_caller]
pub(crate) fn columns<'a, S>(name: &str, J: &'a mut DenseMatrix<S, impl Dense<S>>, nv: usize) -> &'a mut [S] {
    assert!(J.shape() == (6, nv), "{name}: expected 6 × {nv}, found {:?}", J.shape());
    J.as_mut_slice()
}

/// Returns the classical acceleration v̇ + ω × v at a frame's origin, from the spatial acceleration and velocity of the
/// frame.
#[inline(always)]
pub(crate) fn classical<S: Scalar>(a: Motion<S>, v: Motion<S>) -> Motion<S> {
    Motion::new(a.linear + v.angular.cross(v.linear), a.angular)
}

answers! {
    /// Returns oXb, the pose of a body in the world. The body's frame is the link's frame in the URDF.
    ///
    /// # Panics
    /// Panics if the body does not exist.
    fn body(of: Placements, body: usize) -> Se3 = Se3::identity(); {
        let zXb = Se3::new(of.model.nodes()[body].axis_rotation.transpose(), Vec3::zero());
        of.world.oX[body] * zXb.lift()
    }

    /// Returns oXf, the pose of a frame in the world.
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    fn frame(of: Placements, frame: usize) -> Se3 = Se3::identity(); {
        let frame = &of.model.frames()[frame];
        of.body(frame.body) * frame.placement.lift()
    }

    /// Returns the spatial velocity of a body. It consists of the velocity of the body-fixed point at the origin of the
    /// reference frame (m/s), and the body's angular velocity (rad/s).
    ///
    /// # Panics
    /// Panics if the body does not exist.
    fn body_velocity(of: Velocities, body: usize, reference: ReferenceFrame) -> Motion = Motion::zero(); {
        reference.pose(of.body(body)).act_inv(of.moving.v[body])
    }

    /// Returns the spatial velocity of a frame. It consists of the velocity of the body-fixed point at the origin of
    /// the reference frame (m/s), and the angular velocity (rad/s).
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    fn frame_velocity(of: Velocities, frame: usize, reference: ReferenceFrame) -> Motion = Motion::zero(); {
        reference.pose(of.frame(frame)).act_inv(of.moving.v[of.model.frames()[frame].body])
    }

    /// Returns the spatial acceleration of a body (m/s², rad/s²), without gravity. The acceleration is the rate of the
    /// body's spatial velocity in the world's frame, expressed in the reference frame.
    ///
    /// # Panics
    /// Panics if the body does not exist.
    fn body_acceleration(of: Accelerations, body: usize, reference: ReferenceFrame) -> Motion = Motion::zero(); {
        reference.pose(of.body(body)).act_inv(of.moving.a[body])
    }

    /// Returns the spatial acceleration of a frame (m/s², rad/s²), without gravity. The acceleration is the rate of the
    /// frame's spatial velocity in the world's frame, expressed in the reference frame.
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    fn frame_acceleration(of: Accelerations, frame: usize, reference: ReferenceFrame) -> Motion = Motion::zero(); {
        reference.pose(of.frame(frame)).act_inv(of.moving.a[of.model.frames()[frame].body])
    }

    /// Returns the classical acceleration v̇ + ω × v of the body-fixed point at the origin of the reference frame
    /// (m/s²), and the body's angular acceleration (rad/s²).
    ///
    /// # Panics
    /// Panics if the body does not exist.
    fn body_classical_acceleration(
        of: Accelerations, body: usize, reference: ReferenceFrame
    ) -> Motion = Motion::zero(); {
        classical(of.body_acceleration(body, reference), of.body_velocity(body, reference))
    }

    /// Returns the classical acceleration v̇ + ω × v of the frame's point at the origin of the reference frame (m/s²),
    /// and the frame's angular acceleration (rad/s²). In `LocalWorldAligned`, the linear part is the acceleration p̈ of
    /// the frame's origin. Source: Featherstone (2008), section 2.11.
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    fn frame_classical_acceleration(
        of: Accelerations, frame: usize, reference: ReferenceFrame
    ) -> Motion = Motion::zero(); {
        classical(of.frame_acceleration(frame, reference), of.frame_velocity(frame, reference))
    }
}

kernel! {
    /// Computes the Jacobian J of a frame. The frame is fixed to `body` and has the pose oXf.
    fn jacobian<S, R>(
        of: Placements<'_, S, R>,
        body: usize,
        oXf: &Se3<S>,
        reference: ReferenceFrame,
        J: &mut [S],
    ) {
        J.fill(S::zero());
        let oXr = reference.pose(*oXf);
        for &c in Single::<S, R>::new(of.model).support(body) {
            add(of.model, J, c, oXr.act_inv(of.world.S[c])); // J = oXr⁻¹ S
        }
    }
}

kernel! {
    /// Adds the joint efforts Jᵀ f of a force f on `body` to `tau`. The force f and the Jacobian J are expressed in the
    /// world's frame.
    fn add_efforts<S, R>(of: Placements<'_, S, R>, body: usize, f: &Force<S>, tau: &mut [S]) {
        for &c in Single::<S, R>::new(of.model).support(body) {
            let column = &of.model.columns()[c];
            tau[column.coordinate] += of.world.S[c].dot(*f) * S::splat(column.ratio); // τ += Sᵀ f
        }
    }
}

kernel! {
    /// Computes the rate dJ/dt of the Jacobian of a frame. The frame is fixed to `body` and has the pose oXf.
    fn jacobian_rate<S, R>(
        of: Velocities<'_, S, R>,
        body: usize,
        oXf: &Se3<S>,
        reference: ReferenceFrame,
        dJ: &mut [S],
    ) {
        dJ.fill(S::zero());
        let (oXr, v_r) = (reference.pose(*oXf), reference.velocity(*oXf, of.moving.v[body]));
        for &c in Single::<S, R>::new(of.model).support(body) {
            let s = of.moving.dS[c] - v_r.cross(of.world.S[c]);
            add(of.model, dJ, c, oXr.act_inv(s)); // dJ/dt = oXr⁻¹ (Ṡ − v_r × S)
        }
    }
}

impl<S: Scalar, R: Constant<S>> Placements<'_, S, R> {
    /// Computes the Jacobian J of a body, 6 × nv, linear rows first: the body's velocity is J v. Overwrites J.
    ///
    /// # Panics
    /// Panics if the body does not exist, or `J` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn body_jacobian(&self, body: usize, reference: ReferenceFrame, J: &mut DenseMatrix<S, impl Dense<S>>) {
        jacobian(*self, body, &self.body(body), reference, columns("J", J, self.model.nv()));
    }

    /// Computes the Jacobian J of a frame, 6 × nv, linear rows first: the frame's velocity is J v. Overwrites J.
    ///
    /// # Panics
    /// Panics if the frame does not exist, or `J` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_jacobian(&self, frame: usize, reference: ReferenceFrame, J: &mut DenseMatrix<S, impl Dense<S>>) {
        check_frame(self.model, frame);
        jacobian(
            *self,
            self.model.frames()[frame].body,
            &self.frame(frame),
            reference,
            columns("J", J, self.model.nv()),
        );
    }

    /// Adds the joint efforts Jᵀ f of a force on a body to `tau`, in O(depth). J is the body's Jacobian in the world's
    /// frame. So f is the force along the world's axes, with its moment about the world's origin (N, N m). Allocates
    /// nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Data, Force, Vec3, forward_kinematics, robots};
    /// let arm = robots::arm7();
    /// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
    /// let placements = forward_kinematics(&arm, &mut data, &[0.3; 7]);
    /// let push = Force::at_point(placements.frame(tool).translation, Vec3::new(0.0, 0.0, 10.0));
    /// let mut tau = [0.0_f64; 7];
    /// placements.add_body_efforts(arm.frames()[tool].body, push, &mut tau);
    /// assert!(tau[0].abs() < 1e-12); // the first axis is vertical
    /// assert!(tau[1].abs() > 1.0);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the body does not exist, or `tau` does not have nv numbers.
    #[inline(always)]
    #[track_caller]
    pub fn add_body_efforts(&self, body: usize, f: Force<S>, tau: &mut [S]) {
        check_body(self.model, body);
        check("tau", tau.len(), self.model.nv());
        add_efforts(*self, body, &f, tau);
    }
}

impl<S: Scalar, R: Constant<S>> Velocities<'_, S, R> {
    /// Computes the rate dJ/dt of a body's Jacobian, 6 × nv, as [`frame_jacobian_rate`](Self::frame_jacobian_rate) does
    /// for a frame. Overwrites dJ.
    ///
    /// # Panics
    /// Panics if the body does not exist, or `dJ` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn body_jacobian_rate(&self, body: usize, reference: ReferenceFrame, dJ: &mut DenseMatrix<S, impl Dense<S>>) {
        jacobian_rate(*self, body, &self.body(body), reference, columns("dJ", dJ, self.model.nv()));
    }

    /// Computes the rate dJ/dt of a frame's Jacobian, 6 × nv, linear rows first. Overwrites dJ.
    ///
    /// With the Jacobian J and its rate dJ, dJ v + J a is the derivative of the six numbers of the frame's velocity. In
    /// `Local` and `World`, this derivative is the spatial acceleration. In `LocalWorldAligned`, the origin moves with
    /// the frame, and the derivative is the classical acceleration.
    ///
    /// ```
    /// use condyle_dynamics::{Data, ReferenceFrame::LocalWorldAligned, forward_accelerations, robots};
    /// use nalgebra::{DMatrix, DVector};
    /// let arm = robots::arm7();
    /// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
    /// let motion = forward_accelerations(&arm, &mut data, &[0.3; 7], &[0.5; 7], &[0.0; 7]);
    /// let mut dJ = DMatrix::zeros(6, 7);
    /// motion.frame_jacobian_rate(tool, LocalWorldAligned, &mut dJ);
    /// let drift = dJ * DVector::from_element(7, 0.5);
    /// let expected = motion.frame_classical_acceleration(tool, LocalWorldAligned).to_array();
    /// assert!((drift - DVector::from_row_slice(&expected)).amax() < 1e-14);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the frame does not exist, or `dJ` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_jacobian_rate(&self, frame: usize, reference: ReferenceFrame, dJ: &mut DenseMatrix<S, impl Dense<S>>) {
        check_frame(self.model, frame);
        jacobian_rate(
            *self,
            self.model.frames()[frame].body,
            &self.frame(frame),
            reference,
            columns("dJ", dJ, self.model.nv()),
        );
    }
}
