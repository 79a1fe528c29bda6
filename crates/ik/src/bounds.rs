//! Bounds on the displacement of one step, from the limits of the joints.

use crate::error::Error;
use crate::settings::JointLimits;
use condyle_dynamics::{Joint, Model};

/// Index in q of a limited position, and its lower and upper limit.
pub(crate) type PositionLimit = (usize, f64, f64);

/// Limits of a coordinate in v.
#[derive(Clone, Copy, Debug)]
struct Limited {
    position: Option<PositionLimit>,
    velocity: f64,
    acceleration: f64,
}

/// Limits of all coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Bounds {
    gain: f64,
    joints: Vec<Limited>,
    /// Limits that the lower and the upper bound of each coordinate came from, at the last step.
    causes: Vec<[Cause; 2]>,
}

/// Limit of a joint from which a bound comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Cause {
    Velocity,
    Position,
    Acceleration,
}

impl Cause {
    /// Returns the limited quantity in words.
    pub(crate) fn quantity(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Position => "position",
            Self::Acceleration => "acceleration",
        }
    }
}

/// Returns the position limits of each coordinate in v: its index in q, and its limits. Free-flyers and joints on a
/// circle or sphere have none.
///
/// # Errors
/// [`Error::Limits`] if a lower limit is above the upper one. [`Error::Unlimited`] for a finite limit of a joint that
/// has none, unless it is the model's own number.
pub(crate) fn position_limits(
    model: &Model,
    lower: &[f64],
    upper: &[f64],
) -> Result<Vec<Option<PositionLimit>>, Error> {
    let mut limits = vec![None; model.nv()];
    for body in model.bodies().iter().skip(1).filter(|body| body.mimic.is_none()) {
        let (nq, nv) = (body.joint.nq(), body.joint.nv());
        if nq != nv || body.joint == Joint::FreeFlyer {
            let own = model.limits();
            let is_given = |i: usize| {
                (lower[i].is_finite() && lower[i] != own.lower[i]) || (upper[i].is_finite() && upper[i] != own.upper[i])
            };
            if let Some(index) = (body.idx_q..body.idx_q + nq).find(|i| is_given(*i)) {
                return Err(Error::Unlimited { joint: body.joint_name.clone(), index });
            }
            continue;
        }
        for k in 0..nv {
            let (i, v) = (body.idx_q + k, body.idx_v + k);
            if lower[i] > upper[i] {
                let joint = body.joint_name.clone();
                return Err(Error::Limits { joint, lower: lower[i], upper: upper[i] });
            }
            if lower[i].is_finite() || upper[i].is_finite() {
                limits[v] = Some((i, lower[i], upper[i]));
            }
        }
    }
    Ok(limits)
}

impl Bounds {
    pub(crate) fn new(model: &Model, settings: Option<&JointLimits>) -> Result<Self, Error> {
        let free = Limited { position: None, velocity: f64::INFINITY, acceleration: f64::INFINITY };
        let Some(settings) = settings else {
            let causes = vec![[Cause::Velocity; 2]; model.nv()];
            return Ok(Self { gain: 1.0, joints: vec![free; model.nv()], causes });
        };
        let limits = model.limits();
        let lower = settings.lower.as_deref().unwrap_or(&limits.lower);
        let upper = settings.upper.as_deref().unwrap_or(&limits.upper);
        let velocity = settings.velocity.as_deref().unwrap_or(&limits.velocity);
        let position = position_limits(model, lower, upper)?;
        let joint = |i: usize| Limited {
            position: position[i],
            velocity: velocity[i],
            acceleration: settings.acceleration.as_ref().map_or(f64::INFINITY, |a| a[i]),
        };
        let causes = vec![[Cause::Velocity; 2]; model.nv()];
        Ok(Self { gain: settings.gain, joints: (0..model.nv()).map(joint).collect(), causes })
    }

    /// Returns the limit from which a bound of a coordinate came at the last step. side: 0 for the lower bound, 1 for
    /// the upper one.
    pub(crate) fn cause(&self, coordinate: usize, side: usize) -> Option<Cause> {
        self.causes.get(coordinate).map(|causes| causes[side])
    }

    /// Writes the bounds at q, for a step of duration `dt` after the velocity v₀.
    pub(crate) fn write(&mut self, q: &[f64], v0: &[f64], dt: f64, lower: &mut [f64], upper: &mut [f64]) {
        for (i, (joint, causes)) in self.joints.iter().zip(&mut self.causes).enumerate() {
            let reach = dt * joint.velocity;
            let mut interval = [-reach, reach];
            *causes = [Cause::Velocity; 2];
            let mut narrow = |with: [f64; 2], cause: Cause| {
                let next = nearest(interval, with);
                (0..2).filter(|&side| next[side] != interval[side]).for_each(|side| causes[side] = cause);
                interval = next;
            };
            let mut below_above = [f64::INFINITY; 2];
            if let Some((k, least, most)) = joint.position {
                below_above = [q[k] - least, most - q[k]];
                narrow([-self.gain * below_above[0], self.gain * below_above[1]], Cause::Position);
            }
            if joint.acceleration.is_finite() {
                let (from, change) = (dt * v0[i], dt * dt * joint.acceleration);
                // v T + v² / (2 a) ≤ d: after this step, the joint can still stop before its limit
                let stop =
                    |d: f64| if d.is_finite() { (change * (change + 2.0 * d.max(0.0))).sqrt() - change } else { d };
                let [below, above] = below_above.map(stop);
                narrow([-below, above], Cause::Position);
                narrow([from - change, from + change], Cause::Acceleration);
            }
            [lower[i], upper[i]] = interval;
        }
    }
}

/// Returns the intersection of two intervals. If it is empty, returns the point of `first` that is nearest to `second`.
fn nearest(first: [f64; 2], second: [f64; 2]) -> [f64; 2] {
    [second[0].max(first[0]).min(first[1]), second[1].min(first[1]).max(first[0])]
}

#[cfg(test)]
mod tests {
    use super::nearest;

    #[test]
    fn an_empty_intersection_becomes_the_nearest_point() {
        assert_eq!(nearest([-1.0, 1.0], [-0.5, 2.0]), [-0.5, 1.0]);
        assert_eq!(nearest([-1.0, 1.0], [2.0, 3.0]), [1.0, 1.0]);
        assert_eq!(nearest([-1.0, 1.0], [-3.0, -2.0]), [-1.0, -1.0]);
        assert_eq!(nearest([f64::NEG_INFINITY, f64::INFINITY], [0.0, 1.0]), [0.0, 1.0]);
    }
}
