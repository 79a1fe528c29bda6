//! Inverse kinematics: computes the final posture of a motion before the motion is planned.

use condyle::{Data, Model, ReferenceFrame, Vec3, difference, forward_kinematics, integrate, random_configuration};
use nalgebra::{DMatrix, Matrix3, Vector3};
use rand::{SeedableRng, rngs::StdRng};

/// Number of random postures from which the search starts, besides the given posture.
const STARTS: usize = 40;
/// Maximum number of steps from each starting posture.
const STEPS: usize = 100;
/// Damping of a step (m). It is small compared with the size of an arm, and large compared with rounding errors.
const DAMPING: f64 = 0.02;
/// Maximum distance (m) at which the target counts as reached. The planner then reduces the remaining distance.
const REACHED: f64 = 1e-4;

/// Returns a posture within the limits in which `frame` is at the target, and the distance (m) between frame and
/// target. If several postures reach the target, returns the posture nearest to `q0`. If no posture reaches the target,
/// returns the posture with the smallest distance.
///
/// The method is damped least squares (Nakamura and Hanafusa 1986): q becomes q ⊕ Jᵀ(J Jᵀ + λ²)⁻¹ (target − p), with
/// the frame's position p, its Jacobian J and the damping λ. Coordinates are clamped to their limits.
pub(crate) fn reaching(model: &Model, frame: usize, target: Vec3<f64>, q0: &[f64]) -> (Vec<f64>, f64) {
    let mut data = Data::new(model);
    let mut rng = StdRng::seed_from_u64(0);
    let mut J = DMatrix::zeros(6, model.nv());
    let mut best: Option<(f64, f64, Vec<f64>)> = None;
    for start in 0..=STARTS {
        let mut q = if start == 0 { q0.to_vec() } else { random_configuration(model, &mut rng) };
        let mut miss = f64::INFINITY;
        for _ in 0..STEPS {
            let placements = forward_kinematics(model, &mut data, &q);
            let e = target - placements.frame(frame).translation;
            miss = e.norm_squared().sqrt();
            if miss < REACHED {
                break;
            }
            placements.frame_jacobian(frame, ReferenceFrame::LocalWorldAligned, &mut J);
            let J = J.rows(0, 3);
            let damped = J * J.transpose() + DAMPING * DAMPING * Matrix3::identity();
            let Some(x) = damped.try_inverse() else { break };
            let step = J.transpose() * (x * Vector3::new(e.x, e.y, e.z));
            let mut moved = q.clone();
            integrate(model, &q, step.as_slice(), &mut moved);
            q = within_limits(model, moved);
        }
        let mut d = vec![0.0; model.nv()];
        difference(model, q0, &q, &mut d);
        let distance: f64 = d.iter().map(|x| x * x).sum();
        let rank = (miss.max(REACHED), distance);
        if best.as_ref().is_none_or(|(m, d, _)| rank < (*m, *d)) {
            best = Some((rank.0, rank.1, q));
        }
    }
    best.map_or((q0.to_vec(), f64::INFINITY), |(miss, _, q)| (q, miss))
}

/// Clamps each coordinate to its limits.
fn within_limits(model: &Model, mut q: Vec<f64>) -> Vec<f64> {
    for ((q, lower), upper) in q.iter_mut().zip(&model.limits().lower).zip(&model.limits().upper) {
        *q = q.clamp(*lower, *upper);
    }
    q
}
