//! Accelerations that keep joints within their limits of position and velocity.

use crate::settings::JointLimits;
use condyle_dynamics::{Joint, Model};

/// Minimum width of an interval of accelerations (rad/s²). A narrower interval is widened, because the solver needs an
/// interior.
const WIDTH: f64 = 1e-3;

/// A joint with a limit of position or velocity.
struct Limited {
    coordinate: usize,
    /// Index of the joint's position in q; `None` if the position has no limit.
    position: Option<usize>,
    lower: f64,
    upper: f64,
    speed: f64,
}

/// All joints with limits.
pub(crate) struct AccelerationBounds {
    look_ahead: f64,
    most: f64,
    joints: Vec<Limited>,
    /// Coordinate, lower bound and upper bound of each joint in `joints`.
    pub bounds: Vec<(usize, f64, f64)>,
}

impl AccelerationBounds {
    pub(crate) fn new(model: &Model, settings: Option<&JointLimits>) -> Self {
        let Some(settings) = settings else {
            return Self { look_ahead: 1.0, most: 0.0, joints: Vec::new(), bounds: Vec::new() };
        };
        let lower = settings.lower.as_deref().unwrap_or(&model.limits().lower);
        let upper = settings.upper.as_deref().unwrap_or(&model.limits().upper);
        let velocity = settings.velocity.as_deref().unwrap_or(&model.limits().velocity);
        let mut joints = Vec::new();
        for body in model.bodies().iter().skip(1).filter(|body| body.mimic.is_none()) {
            let (nq, nv) = (body.joint.nq(), body.joint.nv());
            if body.joint == Joint::FreeFlyer {
                continue;
            }
            for k in 0..nv {
                let (i, coordinate) = (body.idx_q + k, body.idx_v + k);
                let position = (nq == nv && (lower[i].is_finite() || upper[i].is_finite())).then_some(i);
                let [lower, upper] = position.map_or([0.0; 2], |i| [lower[i], upper[i]]);
                if position.is_some() || velocity[coordinate].is_finite() {
                    joints.push(Limited { coordinate, position, lower, upper, speed: velocity[coordinate] });
                }
            }
        }
        let bounds = joints.iter().map(|joint| (joint.coordinate, 0.0, 0.0)).collect();
        Self { look_ahead: settings.look_ahead, most: settings.max_acceleration, joints, bounds }
    }

    /// Computes the bounds at the state (q, v).
    pub(crate) fn update(&mut self, q: &[f64], v: &[f64]) {
        let (T, most) = (self.look_ahead, self.most);
        for (joint, bound) in self.joints.iter().zip(&mut self.bounds) {
            let v = v[joint.coordinate];
            // bounds of the velocity: (±v_max − v) / T
            let (mut lower, mut upper) = (((-joint.speed - v) / T).min(most), ((joint.speed - v) / T).max(-most));
            if let Some(i) = joint.position {
                let bound = |limit: f64| (limit - q[i]) / (T * T) - 2.0 * v / T;
                let (l, u) = (bound(joint.lower).min(most), bound(joint.upper).max(-most));
                // The bounds of the position have priority over the bounds of the velocity.
                (lower, upper) = (lower.max(l).min(u), upper.min(u).max(l));
                if l > u {
                    (lower, upper) = (0.5 * (l + u), 0.5 * (l + u));
                }
            }
            let narrow = (0.5 * (WIDTH - (upper - lower))).max(0.0);
            *bound = (joint.coordinate, lower - narrow, upper + narrow);
        }
    }
}
