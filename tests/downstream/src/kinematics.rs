//! Tests frames and points of a robot, forces that act at points, and the types of these values.

use condyle::nalgebra::{DMatrix, DVector, Vector3};
use condyle::{Batch, Data, Error, Force, Model, Se3, Vec3, aba, aba_derivatives, forward_velocities};

/// Returns the arm with an additional frame at the tip of a pen that the arm holds.
pub fn with_pen(arm: &Model) -> Result<Model, Error> {
    let tip = Se3 { translation: Vec3::new(0.0, 0.0, 0.12), ..Se3::identity() };
    Ok(arm.with_frame("pen", "tool", tip)?)
}

/// Returns the Jacobian of the pen's tip, and the tip's velocity, computed by the Jacobian and by forward kinematics.
pub fn velocity_of_the_tip(arm: &Model, q: &[f64], v: &[f64]) -> Result<(DMatrix<f64>, [Vector3<f64>; 2]), Error> {
    let (pen, mut data, mut jacobian) = (arm.frame("pen")?, Data::new(arm), DMatrix::zeros(3, arm.nv()));
    let motion = forward_velocities(arm, &mut data, q, v);
    motion.frame_point_jacobian(pen, Vec3::zero(), &mut jacobian);
    let by_jacobian = Vector3::from_iterator((&jacobian * DVector::from_column_slice(v)).iter().copied());
    Ok((jacobian, [by_jacobian, motion.frame_point_velocity(pen, Vec3::zero()).into()]))
}

/// Returns the accelerations of an arm at rest, if a force in world coordinates acts on its pen.
pub fn pushed(arm: &Model, q: &[f64], tau: &[f64], push: Vec3<f64>) -> Result<Vec<f64>, Error> {
    let (pen, mut data) = (arm.frame("pen")?, Data::new(arm));
    let (body, rest) = (arm.frames()[pen].body, vec![0.0; arm.nv()]);
    let placements = condyle::forward_kinematics(arm, &mut data, q);
    let mut f_ext = vec![Force::zero(); arm.bodies().len()];
    f_ext[body] += placements.force_on_body(body, placements.frame(pen).translation, push);
    Ok(aba(arm, &mut data, q, &rest, tau, &f_ext).to_vec())
}

/// Returns ∂q̈/∂τ times τ for the last state of a batch, computed by the batch and by a single call.
pub fn last_of_a_batch(arm: &Model, states: usize) -> [DVector<f64>; 2] {
    let (q, v, tau) = (vec![0.3; states * arm.nv()], vec![0.1; states * arm.nv()], vec![0.2; states * arm.nv()]);
    let mut batch = Batch::new(arm, states, 1);
    let (x, n) = (DVector::from_element(arm.nv(), 1.0), arm.nv());
    let many = &batch.clone().aba_derivatives(arm, &q, &v, &tau, &[]).da_dq.at(states - 1) * &x;
    let by_columns = batch.aba_derivatives(arm, &q, &v, &tau, &[]).da_dq.at(states - 1).to_owned() * &x;
    assert_eq!(many, by_columns);
    let mut data = Data::new(arm);
    [many, aba_derivatives(arm, &mut data, &q[..n], &v[..n], &tau[..n], &[]).da_dq * &x]
}

#[cfg(test)]
mod tests {
    use super::*;
    use condyle::spatial::Act;
    use condyle::{ModelBuilder, Motion, robots};

    #[test]
    fn points_move_as_their_jacobians_say() -> Result<(), Error> {
        let arm = with_pen(&robots::arm7())?;
        let (jacobian, [a, b]) = velocity_of_the_tip(&arm, &[0.3; 7], &[0.5; 7])?;
        assert!((a - b).norm() < 1e-13 && jacobian.norm() > 0.1);
        Ok(())
    }

    /// Checks M (q̈₁ − q̈₀) = Jᵀ f, where q̈₁ is the acceleration with the force f, and q̈₀ the acceleration without
    /// it.
    #[test]
    fn forces_at_points_act_by_the_jacobian() -> Result<(), Error> {
        let (arm, q, tau, push) = (with_pen(&robots::arm7())?, [0.3; 7], [0.0; 7], Vec3::new(1.0, -2.0, 3.0));
        let change = DVector::from_vec(pushed(&arm, &q, &tau, push)?)
            - DVector::from_vec(pushed(&arm, &q, &tau, Vec3::default())?);
        let (jacobian, _) = velocity_of_the_tip(&arm, &q, &[0.0; 7])?;
        let mut data = Data::new(&arm);
        let effort = condyle::crba(&arm, &mut data, &q) * change;
        assert!((effort - jacobian.transpose() * Vector3::from(push)).norm() < 1e-10);
        Ok(())
    }

    #[test]
    fn batches_multiply_as_single_calls_do() {
        for states in [1, 5, 100] {
            let [many, one] = last_of_a_batch(&robots::arm7(), states);
            assert!((&many - &one).norm() < 1e-9 * one.norm());
        }
    }

    #[test]
    fn vectors_have_operators_and_conversions() {
        let a = Vec3::new(1.0, 2.0, 2.0) * 2.0;
        assert_eq!((a.norm(), a[2], Vec3::from(Vector3::from(a))), (6.0, 4.0, a));
        let (motion, force) = (Motion::new(a, Vec3::default()) * 0.5, Force::new(Vec3::default(), a) * 0.5);
        assert_eq!((motion[0], force[5]), (1.0, 2.0));
        let turned = Se3::<f64>::identity().act(motion);
        assert_eq!(turned, motion);
    }

    #[test]
    fn types_are_copied_compared_and_shared() -> Result<(), Error> {
        fn shared<T: Clone + Send + Sync>(_: &T) {}
        let arm = robots::arm7();
        shared(&arm);
        shared(&Batch::<f64>::new(&arm, 2, 1));
        shared(&ModelBuilder::new("robot"));
        assert!(arm == arm.clone() && arm != with_pen(&arm)?);
        Ok(())
    }

    #[test]
    fn dual_numbers_and_random_positions_are_those_of_the_library() {
        use condyle::num_dual::Dual64;
        use condyle::rand::{SeedableRng, rngs::StdRng};
        let arm = robots::arm7();
        let q = condyle::random_configuration(&arm, &mut StdRng::seed_from_u64(1));
        let mut dual: Vec<Dual64> = q.iter().map(|&x| Dual64::from(x)).collect();
        dual[3] = dual[3].derivative();
        let tool = arm.frame("tool").unwrap();
        let moved = condyle::forward_kinematics(&arm, &mut Data::new(&arm), &dual).frame(tool).translation;
        assert!(moved.z.eps != 0.0);
    }
}
