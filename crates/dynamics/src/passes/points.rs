//! Points of bodies and frames: velocities, Jacobians, and forces at points.
//!
//! A point is given in the frame of its body, or in a frame that is fixed to the body, and moves with the body. p is
//! the position of the point in the world. S are the columns of the joints on the path to the root, in the world's
//! frame. Then
//!
//! ```text
//! ṗ = v + ω × p     J = ∂ṗ/∂v = S_v + S_ω × p
//! ```
//!
//! Source: Featherstone, *Rigid Body Dynamics Algorithms* (2008), section 2.3 (velocities of points).

use super::frames::{Placements, Velocities, check_body, check_frame};
use condyle_model::layout::{Columns, Single};
use condyle_spatial::{Act, Constant, Dense, DenseMatrix, Force, Scalar, Vec3, kernel};

kernel! {
    /// Computes the Jacobian J of a point of a body, 3 × nv, stored by columns. p is the position of the point in the
    /// world.
    pub(crate) fn point_jacobian<S, R>(of: Placements<'_, S, R>, body: usize, p: &Vec3<S>, J: &mut [S]) {
        J.fill(S::zero());
        for &c in Single::<S, R>::new(of.model).support(body) {
            let (s, column) = (of.world.S[c], &of.model.columns()[c]);
            let moved = s.velocity_at(*p).scale(S::splat(column.ratio)).to_array(); // S_v + S_ω × p
            let J = &mut J[3 * column.coordinate..][..3];
            for (J, &x) in J.iter_mut().zip(&moved) {
                *J += x;
            }
        }
    }
}

impl<S: Scalar, R: Constant<S>> Placements<'_, S, R> {
    /// Computes the Jacobian J of a point of a body, 3 × nv: J v is the point's velocity along the axes of the world
    /// (m/s). Overwrites J.
    ///
    /// point: position in the frame of the body (m). Costs O(depth + nv) and allocates nothing. The equation is in
    /// [`frame_point_jacobian`](Self::frame_point_jacobian).
    ///
    /// # Panics
    /// Panics if the body does not exist, or `J` is not 3 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn body_point_jacobian(&self, body: usize, point: Vec3<S>, J: &mut DenseMatrix<S, impl Dense<S>>) {
        point_jacobian(*self, body, &self.body(body).act(point), columns(J, self.model.nv()));
    }

    /// Computes the Jacobian J of a point of a frame, 3 × nv: J v is the point's velocity along the axes of the world
    /// (m/s). Overwrites J.
    ///
    /// point: position in the frame (m). J = S_v + S_ω × p, where p = oXf · point, and S are the columns of the joints
    /// on the path to the root. J equals the linear rows of the Jacobian in `LocalWorldAligned` for a frame with its
    /// origin at the point. Costs O(depth + nv) and allocates nothing.
    ///
    /// ```
    /// use condyle_dynamics::{Act, Data, Vec3, forward_velocities, robots};
    /// use nalgebra::{DMatrix, DVector, Vector3};
    /// let arm = robots::arm7();
    /// let (tool, mut data, tip) = (arm.frame("tool")?, Data::new(&arm), Vec3::new(0.0, 0.02, 0.1));
    /// let motion = forward_velocities(&arm, &mut data, &[0.3; 7], &[0.5; 7]);
    /// let mut J = DMatrix::zeros(3, 7);
    /// motion.frame_point_jacobian(tool, tip, &mut J);
    /// let velocity = Vector3::from(motion.frame_point_velocity(tool, tip));
    /// assert!((J * DVector::from_element(7, 0.5) - velocity).amax() < 1e-14);
    /// let place = motion.frame(tool).act(tip); // the point in the world
    /// assert!(place.z > 0.3);
    /// # Ok::<(), condyle_dynamics::Error>(())
    /// ```
    ///
    /// # Panics
    /// Panics if the frame does not exist, or `J` is not 3 × nv.
    #[inline(always)]
    #[track_caller]
    pub fn frame_point_jacobian(&self, frame: usize, point: Vec3<S>, J: &mut DenseMatrix<S, impl Dense<S>>) {
        let p = self.frame(frame).act(point);
        point_jacobian(*self, self.model.frames()[frame].body, &p, columns(J, self.model.nv()));
    }

    /// Converts a force that acts on a body at a point given in the world's frame. The result has the convention of
    /// `f_ext`: it is in the body's frame, with the moment about the body's origin.
    ///
    /// point: position at which the force acts, in the world's frame (m); force: force along the axes of the world (N).
    /// With the body's pose (R, p), the result is f = Rᵀ force and n = Rᵀ ((point − p) × force). If the point is given
    /// in the body's frame, pass `body(body).act(point)`.
    ///
    /// ```
    /// use condyle_dynamics::{Data, Force, Vec3, forward_kinematics, aba, robots};
    /// let quadruped = robots::quadruped();
    /// let (mut data, q) = (Data::new(&quadruped), condyle_dynamics::neutral(&quadruped));
    /// let mut f_ext = vec![Force::zero(); quadruped.bodies().len()];
    /// let placements = forward_kinematics(&quadruped, &mut data, &q);
    /// let push = Vec3::new(0.0, 0.0, 9.81 * quadruped.total_mass()); // its weight, at its trunk
    /// f_ext[1] += placements.force_on_body(1, placements.body(1).translation, push);
    /// let a = aba(&quadruped, &mut data, &q, &[0.0; 18], &[0.0; 18], &f_ext);
    /// assert!(a[2] > 0.0);
    /// ```
    ///
    /// # Panics
    /// Panics if the body does not exist.
    #[inline(always)]
    #[track_caller]
    pub fn force_on_body(&self, body: usize, point: Vec3<S>, force: Vec3<S>) -> Force<S> {
        self.body(body).act_inv(Force::at_point(point, force))
    }
}

impl<S: Scalar, R: Constant<S>> Velocities<'_, S, R> {
    /// Returns the velocity ṗ = v + ω × p of a point of a body, along the axes of the world (m/s). point: position in
    /// the frame of the body (m).
    ///
    /// # Panics
    /// Panics if the body does not exist.
    #[inline(always)]
    #[track_caller]
    pub fn body_point_velocity(&self, body: usize, point: Vec3<S>) -> Vec3<S> {
        check_body(self.model, body);
        self.moving.v[body].velocity_at(self.body(body).act(point))
    }

    /// Returns the velocity ṗ = v + ω × p of a point of a frame, along the axes of the world (m/s). point: position in
    /// the frame (m).
    ///
    /// # Panics
    /// Panics if the frame does not exist.
    #[inline(always)]
    #[track_caller]
    pub fn frame_point_velocity(&self, frame: usize, point: Vec3<S>) -> Vec3<S> {
        check_frame(self.model, frame);
        self.moving.v[self.model.frames()[frame].body].velocity_at(self.frame(frame).act(point))
    }
}

/// Returns the entries of a point's Jacobian, column by column. Panics unless the Jacobian is 3 × nv.
#[inline]
#[track_caller]
fn columns<S>(J: &mut DenseMatrix<S, impl Dense<S>>, nv: usize) -> &mut [S] {
    assert!(J.shape() == (3, nv), "J: expected 3 × {nv}, found {:?}", J.shape());
    J.as_mut_slice()
}
