//! Batch functions for the placements and motions of bodies and frames in many states.

use super::places::{Places, Put};
use super::results::{Matrices, Poses, Take, Taken, results};
use super::table::{BODIES, NV, batched};
use crate::calls::kinematics::{
    body_jacobian, forward_accelerations, forward_kinematics, forward_velocities, frame_jacobian,
};
use crate::passes::frames::ReferenceFrame;
use condyle_spatial::Matrix;
use condyle_spatial::block::Real;

/// Derivatives of the acceleration of a frame or body, in matrices that the function for a single state fills.
struct AccelerationDerivatives<'s, S> {
    da_dq: &'s Matrix<S>,
    da_dv: &'s Matrix<S>,
}

results! {
    /// Derivatives of the acceleration of a frame or body, for many states.
    BatchAccelerationDerivatives of AccelerationDerivatives {
        /// Derivative ∂a/∂q of the acceleration in the tangent space, 6 × nv.
        da_dq: Matrices<'b, T> = [6, NV];
        /// Derivative ∂a/∂v of the acceleration, 6 × nv.
        da_dv: Matrices<'b, T> = [6, NV];
    }
}

batched! {
    /// Computes [`forward_kinematics`](crate::forward_kinematics) for each state: the placements oXb of all bodies, in
    /// order.
    ///
    /// q: nq numbers per state.
    ///
    /// ```
    /// use condyle_dynamics::{Batch, Data, forward_kinematics, robots};
    /// let arm = robots::arm7();
    /// let (q, mut batch) = ([0.3; 7].repeat(10), Batch::new(&arm, 10, 1));
    /// let hand = batch.forward_kinematics(&arm, &q).at(9, 7);
    /// assert_eq!(hand, forward_kinematics(&arm, &mut Data::new(&arm), &[0.3; 7]).body(7));
    /// ```
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea).
    fn forward_kinematics(model, data => to; q) -> Poses<'_, T> [[BODIES, 4, 4]] {
        let (placements, n) = (forward_kinematics(model, data, q), model.bodies().len());
        for body in 0..n {
            to.pose(0, [body, n], placements.body(body));
        }
    }

    /// Computes [`Placements::frame`](crate::Placements::frame) for each state: one pose, the placement oXf of the
    /// frame.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_placement(model, data => to; q; frame: usize) -> Poses<'_, T> [[4, 4]] {
        to.pose(0, [0, 1], forward_kinematics(model, data, q).frame(frame));
    }

    /// Computes [`frame_jacobian`](crate::frame_jacobian) for each state: J, 6 × nv.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_jacobian(model, data; q; frame: usize, reference: ReferenceFrame) with six -> Matrices<'_, T> [[6, NV]] {
        frame_jacobian(model, q, frame, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`body_jacobian`](crate::body_jacobian) for each state: J, 6 × nv.
    ///
    /// q: nq numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_jacobian(model, data; q; body: usize, reference: ReferenceFrame) with six -> Matrices<'_, T> [[6, NV]] {
        body_jacobian(model, q, body, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`Velocities::frame_velocity`](crate::Velocities::frame_velocity) for each state: v, six numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_velocity(model, data; q, v; frame: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_velocities(model, data, q, v).frame_velocity(frame, reference)
    }

    /// Computes [`Velocities::body_velocity`](crate::Velocities::body_velocity) for each state: v, six numbers.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_velocity(model, data; q, v; body: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_velocities(model, data, q, v).body_velocity(body, reference)
    }

    /// Computes [`Accelerations::frame_acceleration`](crate::Accelerations::frame_acceleration) for each state: a, six
    /// numbers.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_acceleration(model, data; q, v, a; frame: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).frame_acceleration(frame, reference)
    }

    /// Computes [`Accelerations::body_acceleration`](crate::Accelerations::body_acceleration) for each state: a, six
    /// numbers.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_acceleration(model, data; q, v, a; body: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).body_acceleration(body, reference)
    }

    /// Computes [`Accelerations::frame_classical_acceleration`](crate::Accelerations::frame_classical_acceleration) for
    /// each state: six numbers, v̇ + ω × v and then ω̇.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_classical_acceleration(model, data; q, v, a; frame: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).frame_classical_acceleration(frame, reference)
    }

    /// Computes [`Accelerations::body_classical_acceleration`](crate::Accelerations::body_classical_acceleration) for
    /// each state: six numbers, v̇ + ω × v and then ω̇.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_classical_acceleration(model, data; q, v, a; body: usize, reference: ReferenceFrame) -> &[T] [[6]] {
        forward_accelerations(model, data, q, v, a).body_classical_acceleration(body, reference)
    }

    /// Computes [`Velocities::frame_jacobian_rate`](crate::Velocities::frame_jacobian_rate) for each state: dJ/dt, 6 ×
    /// nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_jacobian_rate(model, data; q, v; frame: usize, reference: ReferenceFrame)
    with six -> Matrices<'_, T> [[6, NV]] {
        forward_velocities(model, data, q, v).frame_jacobian_rate(frame, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`Velocities::body_jacobian_rate`](crate::Velocities::body_jacobian_rate) for each state: dJ/dt, 6 ×
    /// nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_jacobian_rate(model, data; q, v; body: usize, reference: ReferenceFrame)
    with six -> Matrices<'_, T> [[6, NV]] {
        forward_velocities(model, data, q, v).body_jacobian_rate(body, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`Velocities::frame_velocity_derivative`](crate::Velocities::frame_velocity_derivative) for each state:
    /// ∂v/∂q, 6 × nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_velocity_derivative(model, data; q, v; frame: usize, reference: ReferenceFrame)
    with six -> Matrices<'_, T> [[6, NV]] {
        forward_velocities(model, data, q, v).frame_velocity_derivative(frame, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`Velocities::body_velocity_derivative`](crate::Velocities::body_velocity_derivative) for each state:
    /// ∂v/∂q, 6 × nv.
    ///
    /// q: nq numbers per state; v: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_velocity_derivative(model, data; q, v; body: usize, reference: ReferenceFrame)
    with six -> Matrices<'_, T> [[6, NV]] {
        forward_velocities(model, data, q, v).body_velocity_derivative(body, reference, &mut six[0]);
        &six[0]
    }

    /// Computes [`Accelerations::frame_acceleration_derivatives`](crate::Accelerations::frame_acceleration_derivatives)
    /// for each state: two matrices 6 × nv.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_acceleration_derivatives(model, data; q, v, a; frame: usize, reference: ReferenceFrame)
    with six -> BatchAccelerationDerivatives<'_, T> {
        let [da_dq, da_dv] = six;
        forward_accelerations(model, data, q, v, a).frame_acceleration_derivatives(frame, reference, da_dq, da_dv);
        AccelerationDerivatives { da_dq, da_dv }
    }

    /// Computes [`Accelerations::body_acceleration_derivatives`](crate::Accelerations::body_acceleration_derivatives)
    /// for each state: two matrices 6 × nv.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the body does not exist.
    fn body_acceleration_derivatives(model, data; q, v, a; body: usize, reference: ReferenceFrame)
    with six -> BatchAccelerationDerivatives<'_, T> {
        let [da_dq, da_dv] = six;
        forward_accelerations(model, data, q, v, a).body_acceleration_derivatives(body, reference, da_dq, da_dv);
        AccelerationDerivatives { da_dq, da_dv }
    }

    /// Computes
    /// [`frame_classical_acceleration_derivatives`](crate::Accelerations::frame_classical_acceleration_derivatives) for
    /// each state: two matrices 6 × nv.
    ///
    /// q: nq numbers per state; v and a: nv numbers per state.
    ///
    /// # Panics
    /// Panics in the same cases as [`rnea`](Self::rnea), or if the frame does not exist.
    fn frame_classical_acceleration_derivatives(model, data; q, v, a; frame: usize, reference: ReferenceFrame)
    with six -> BatchAccelerationDerivatives<'_, T> {
        let [da_dq, da_dv] = six;
        let placed = forward_accelerations(model, data, q, v, a);
        placed.frame_classical_acceleration_derivatives(frame, reference, da_dq, da_dv);
        AccelerationDerivatives { da_dq, da_dv }
    }
}
