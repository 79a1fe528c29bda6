//! Derivatives of the velocity and the acceleration of bodies and frames with respect to position and velocity.
//!
//! When coordinate e changes, the bodies that the joint of e carries turn rigidly about the joint column S_e. The
//! velocities and accelerations of these bodies also change because the joint's parent λ moves (see
//! `rnea_derivatives`):
//!
//! ```text
//! Ψ̇_e = v_λ × S_e                          ∂v/∂q_e = S_e × v + Ψ̇_e                ∂v/∂q̇_e = S_e
//! Ψ̈_e = a_λ × S_e + v_λ × Ψ̇_e             ∂a/∂q_e = S_e × a + Ψ̈_e + Ψ̇_e × v     ∂a/∂q̇_e = Ψ̇_e + Ṡ_e + S_e × v
//! ```
//!
//! These derivatives are expressed in the fixed axes of the world. A frame r with pose oXr moves by the twist r_e per
//! unit of q_e. Expressed in frame r, a motion m (v or a) has the derivative oXr⁻¹ (∂m/∂q_e − r_e × m).
//!
//! Source: Carpentier and Mansard, *Analytical derivatives of rigid body dynamics algorithms* (2018), section IV. A
//! derivative costs O(depth + nv) and does not allocate.

use crate::passes::frames::{Accelerations, ReferenceFrame, Velocities, add, check_frame, columns};
use condyle_model::layout::{Layout, Single};
use condyle_spatial::{Act, Constant, Cross, Dense, DenseMatrix, Motion, Scalar, Se3, kernel};

kernel! {
    /// Computes ∂v/∂q for the velocity v of a frame. The frame is fixed to `body` and has the pose oXf.
    fn velocity_derivative<S, R>(
        of: Velocities<'_, S, R>,
        body: usize,
        oXf: &Se3<S>,
        reference: ReferenceFrame,
        dv_dq: &mut [S],
    ) {
        dv_dq.fill(S::zero());
        let (l, oXr, v) = (Single::<S, R>::new(of.model), reference.pose(*oXf), of.moving.v[body]);
        let mut i = body;
        while i > 0 {
            let parent = of.model.nodes()[i].parent;
            for c in l.column(i)..l.column(i) + l.joint(i).nv() {
                let S_c = of.world.S[c];
                let Psid = of.moving.v[parent].cross(S_c); // Ψ̇ = v_λ × S
                let r = reference.velocity(*oXf, S_c);
                add(of.model, dv_dq, c, oXr.act_inv((S_c - r).cross(v) + Psid)); // S × v + Ψ̇ − r × v
            }
            i = parent;
        }
    }
}

impl<S: Scalar, R: Constant<S>> Velocities<'_, S, R> {
    /// Computes ∂v/∂q for a body's velocity v, like [`frame_velocity_derivative`](Self::frame_velocity_derivative) for
    /// a frame's velocity.
    ///
    /// # Panics
    /// Panics if the body does not exist, or `dv_dq` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn body_velocity_derivative(
        &self,
        body: usize,
        reference: ReferenceFrame,
        dv_dq: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        velocity_derivative(*self, body, &self.body(body), reference, columns("dv_dq", dv_dq, self.model.nv()));
    }

    /// Computes ∂v/∂q of the six numbers v of a [frame's velocity](Self::frame_velocity), 6 × nv, linear rows first.
    /// Overwrites dv_dq. The derivative of v with respect to the joint velocities is the frame's Jacobian.
    ///
    /// ```
    /// use condyle_dynamics::{Data, ReferenceFrame::Local, forward_velocities, robots};
    /// use nalgebra::DMatrix;
    /// let arm = robots::arm7();
    /// let (tool, mut data, mut dv_dq) = (arm.frame("tool")?, Data::new(&arm), DMatrix::zeros(6, 7));
    /// forward_velocities(&arm, &mut data, &[0.3; 7], &[0.5; 7]).frame_velocity_derivative(tool, Local, &mut dv_dq);
    /// assert_eq!(dv_dq.column(0).amax(), 0.0); // turned as a whole, the arm moves as before
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the frame does not exist, or `dv_dq` is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_velocity_derivative(
        &self,
        frame: usize,
        reference: ReferenceFrame,
        dv_dq: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        check_frame(self.model, frame);
        velocity_derivative(
            *self,
            self.model.frames()[frame].body,
            &self.frame(frame),
            reference,
            columns("dv_dq", dv_dq, self.model.nv()),
        );
    }
}

/// Derivatives ∂v/∂q_e, ∂v/∂q̇_e, ∂a/∂q_e and ∂a/∂q̇_e of a body's velocity v and acceleration a with respect to one
/// coordinate e, in a reference frame.
struct Column<S> {
    v_q: Motion<S>,
    v_v: Motion<S>,
    a_q: Motion<S>,
    a_v: Motion<S>,
}

kernel! {
    /// Computes ∂a/∂q and ∂a/∂v for the acceleration a of a frame. The frame is fixed to `body` and has the pose oXf. a
    /// is the classical acceleration if the frame's `velocity` is given, otherwise the spatial acceleration.
    fn acceleration_derivatives<S, R>(
        of: Accelerations<'_, S, R>,
        body: usize,
        oXf: &Se3<S>,
        reference: ReferenceFrame,
        velocity: Option<&Motion<S>>,
        da_dq: &mut [S],
        da_dv: &mut [S],
    ) {
        da_dq.fill(S::zero());
        da_dv.fill(S::zero());
        let (l, mut i) = (Single::<S, R>::new(of.model), body);
        while i > 0 {
            let parent = of.model.nodes()[i].parent;
            for c in l.column(i)..l.column(i) + l.joint(i).nv() {
                let mut d = of.column(body, *oXf, reference, c, parent);
                if let Some(v) = velocity {
                    d.a_q.linear += d.v_q.angular.cross(v.linear) + v.angular.cross(d.v_q.linear); // δω × v + ω × δv
                    d.a_v.linear += d.v_v.angular.cross(v.linear) + v.angular.cross(d.v_v.linear);
                }
                add(of.model, da_dq, c, d.a_q);
                add(of.model, da_dv, c, d.a_v);
            }
            i = parent;
        }
    }
}

impl<S: Scalar, R: Constant<S>> Accelerations<'_, S, R> {
    /// Computes ∂a/∂q and ∂a/∂v of a body's spatial acceleration a, like
    /// [`frame_acceleration_derivatives`](Self::frame_acceleration_derivatives) for a frame's acceleration.
    ///
    /// # Panics
    /// Panics if the body does not exist, or a matrix is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn body_acceleration_derivatives(
        &self,
        body: usize,
        reference: ReferenceFrame,
        da_dq: &mut DenseMatrix<S, impl Dense<S>>,
        da_dv: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        self.differentiate(body, &self.body(body), reference, None, da_dq, da_dv);
    }

    /// Computes ∂a/∂q and ∂a/∂v of the six numbers a of a [frame's spatial acceleration](Self::frame_acceleration),
    /// each 6 × nv, linear rows first. Overwrites both matrices. The derivative of a with respect to the joint
    /// accelerations is the frame's Jacobian.
    ///
    /// # Panics
    /// Panics if the frame does not exist, or a matrix is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_acceleration_derivatives(
        &self,
        frame: usize,
        reference: ReferenceFrame,
        da_dq: &mut DenseMatrix<S, impl Dense<S>>,
        da_dv: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        check_frame(self.model, frame);
        let body = self.model.frames()[frame].body;
        self.differentiate(body, &self.frame(frame), reference, None, da_dq, da_dv);
    }

    /// Computes ∂a/∂q and ∂a/∂v of the six numbers a of a [frame's classical
    /// acceleration](Self::frame_classical_acceleration), each 6 × nv, linear rows first. Overwrites both matrices. The
    /// derivative of a with respect to the joint accelerations is the frame's Jacobian.
    ///
    /// ```
    /// use condyle_dynamics::{Data, ReferenceFrame::LocalWorldAligned, forward_accelerations, robots};
    /// use nalgebra::DMatrix;
    /// let arm = robots::arm7();
    /// let (tool, mut data) = (arm.frame("tool")?, Data::new(&arm));
    /// let (mut da_dq, mut da_dv) = (DMatrix::zeros(6, 7), DMatrix::zeros(6, 7));
    /// let motion = forward_accelerations(&arm, &mut data, &[0.3; 7], &[0.5; 7], &[0.0; 7]);
    /// motion.frame_classical_acceleration_derivatives(tool, LocalWorldAligned, &mut da_dq, &mut da_dv);
    /// // p̈ is quadratic in v, so v · ∂p̈/∂v = 2 p̈
    /// let p = motion.frame_classical_acceleration(tool, LocalWorldAligned).linear;
    /// assert!(f64::abs(da_dv.row(0).sum() * 0.5 - 2.0 * p.x) < 1e-13);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the frame does not exist, or a matrix is not 6 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_classical_acceleration_derivatives(
        &self,
        frame: usize,
        reference: ReferenceFrame,
        da_dq: &mut DenseMatrix<S, impl Dense<S>>,
        da_dv: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        check_frame(self.model, frame);
        let (body, v) = (self.model.frames()[frame].body, self.frame_velocity(frame, reference));
        self.differentiate(body, &self.frame(frame), reference, Some(&v), da_dq, da_dv);
    }

    /// Checks the shapes of both matrices and calls [`acceleration_derivatives`].
    #[inline(always)]
    #[track_caller]
    fn differentiate(
        &self,
        body: usize,
        oXf: &Se3<S>,
        reference: ReferenceFrame,
        velocity: Option<&Motion<S>>,
        da_dq: &mut DenseMatrix<S, impl Dense<S>>,
        da_dv: &mut DenseMatrix<S, impl Dense<S>>,
    ) {
        let nv = self.model.nv();
        let (da_dq, da_dv) = (columns("da_dq", da_dq, nv), columns("da_dv", da_dv, nv));
        acceleration_derivatives(*self, body, oXf, reference, velocity, da_dq, da_dv);
    }

    /// Returns the derivatives of a body's velocity and acceleration with respect to the coordinate of joint column c.
    /// The joint of column c is attached to the body `parent`.
    #[inline(always)]
    fn column(&self, body: usize, oXf: Se3<S>, reference: ReferenceFrame, c: usize, parent: usize) -> Column<S> {
        let oXr = reference.pose(oXf);
        let (v, a, S_c) = (self.moving.v[body], self.moving.a[body], self.world.S[c]);
        let (v_parent, a_parent) = (self.moving.v[parent], self.moving.a[parent]);
        let Psid = v_parent.cross(S_c); // Ψ̇ = v_λ × S
        let Psidd = a_parent.cross(S_c) + v_parent.cross(Psid); // Ψ̈ = a_λ × S + v_λ × Ψ̇
        let beside = S_c - reference.velocity(oXf, S_c); // S − r
        Column {
            v_q: oXr.act_inv(beside.cross(v) + Psid), // S × v + Ψ̇ − r × v
            v_v: oXr.act_inv(S_c),
            a_q: oXr.act_inv(beside.cross(a) + Psidd + Psid.cross(v)), // S × a + Ψ̈ + Ψ̇ × v − r × a
            a_v: oXr.act_inv(Psid + self.moving.dS[c] + S_c.cross(v)), // Ψ̇ + Ṡ + S × v
        }
    }
}
