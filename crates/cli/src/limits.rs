//! Limits of a robot's joints: counts the limits, finds initial positions within the limits, and converts limits to
//! constraints of a problem.

use crate::error::Error;
use crate::robot::Robot;
use condyle::optimal::robot::{Limit, Residual};
use condyle::{Model, neutral};
use serde::Serialize;
use std::fmt;

/// Names of the limits that become constraints: of the state, and of the efforts.
pub(crate) const STATES: &str = "positions and speeds";
pub(crate) const EFFORTS: &str = "efforts";

/// Limited quantity of a joint coordinate, with the limits.
pub(crate) struct Limited<'a> {
    /// Limited quantity: `position`, `velocity` or `torque`.
    pub what: &'static str,
    /// Name of the joint.
    pub joint: &'a str,
    /// Index in q for a position; index in v for a velocity or a torque.
    pub index: usize,
    /// Index in v of the same coordinate.
    pub index_v: usize,
    pub lower: f64,
    pub upper: f64,
}

/// Lists the limited positions, velocities and efforts of a robot, joint by joint. Positions are listed only for joints
/// with equal numbers of positions and velocities. A limit of 0 for a velocity or an effort counts as no limit.
pub(crate) fn limited(model: &Model) -> Vec<Limited<'_>> {
    let limits = model.limits();
    let mut all = Vec::new();
    for body in model.bodies()[1..].iter().filter(|b| b.mimic.is_none()) {
        let joint = &*body.joint_name;
        for index in (body.idx_q..body.idx_q + body.joint.nq()).filter(|_| body.joint.nq() == body.joint.nv()) {
            let (lower, upper) = (limits.lower[index], limits.upper[index]);
            if lower.is_finite() || upper.is_finite() {
                let index_v = index - body.idx_q + body.idx_v;
                all.push(Limited { what: "position", joint, index, index_v, lower, upper });
            }
        }
        for index in body.idx_v..body.idx_v + body.joint.nv() {
            let speed = limits.velocity[index];
            let (least, most) = (limits.effort_lower[index], limits.effort_upper[index]);
            for (what, lower, upper) in [("velocity", -speed, speed), ("torque", least, most)] {
                if lower < upper && (lower.is_finite() || upper.is_finite()) {
                    all.push(Limited { what, joint, index, index_v: index, lower, upper });
                }
            }
        }
    }
    all
}

/// Numbers of a robot's limited coordinates, and the source of the limits.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct LimitCounts {
    /// Source of all limits: path of the robot's file, or name of a built-in robot.
    pub source: String,
    pub positions: usize,
    pub velocities: usize,
    pub efforts: usize,
    /// Number of all degrees of freedom of the robot (nv).
    pub of: usize,
}

impl LimitCounts {
    /// Counts the limits of a robot.
    pub(crate) fn new(robot: &Robot) -> Self {
        let all = limited(&robot.model);
        let count = |what| all.iter().filter(|limit| limit.what == what).count();
        Self {
            source: robot.source.clone(),
            positions: count("position"),
            velocities: count("velocity"),
            efforts: count("torque"),
            of: robot.model.nv(),
        }
    }

    /// Returns the total number of limited positions, velocities and efforts.
    pub(crate) fn total(&self) -> usize {
        self.positions + self.velocities + self.efforts
    }
}

impl fmt::Display for LimitCounts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { source, positions, velocities, efforts, of } = self;
        match self.total() {
            0 => write!(f, "{source} limits no position, velocity or effort"),
            _ => write!(
                f,
                "{source} limits {positions} of {of} positions, {velocities} of {of} velocities, {efforts} of {of} efforts"
            ),
        }
    }
}

/// Returns an error with the joint's name if an initial position is outside the limits.
pub(crate) fn check_start(model: &Model, q: &[f64]) -> Result<(), Error> {
    model.check_position(q)?;
    for body in model.bodies()[1..].iter().filter(|b| b.joint.nq() == 1 && b.mimic.is_none()) {
        let (x, limits) = (q[body.idx_q], model.limits());
        let (lower, upper) = (limits.lower[body.idx_q], limits.upper[body.idx_q]);
        if !(lower..=upper).contains(&x) {
            let what = format!("joint `{}` is at {x}, outside of its limits [{lower}, {upper}]", body.joint_name);
            return Err(Error::Option { option: "q0", what });
        }
    }
    Ok(())
}

/// Returns the last frame on the body with the most joints between it and the root. For an arm, this frame is the tip.
pub(crate) fn last_frame(model: &Model) -> usize {
    let depth = |mut body: usize| {
        let mut depth = 0;
        while body > 0 {
            body = model.bodies()[body].parent;
            depth += 1;
        }
        depth
    };
    (0..model.frames().len()).max_by_key(|&f| depth(model.frames()[f].body)).unwrap_or(0)
}

/// Returns the neutral position. If limits exclude a neutral coordinate, this coordinate gets the middle of its range.
pub(crate) fn start(model: &Model) -> Vec<f64> {
    inside(model, neutral(model))
}

/// Returns the position q, changed to respect the limits. A coordinate outside its limits gets the middle of its range.
pub(crate) fn inside(model: &Model, q: Vec<f64>) -> Vec<f64> {
    let limits = model.limits();
    let inside = |(k, q): (usize, f64)| {
        let (lower, upper) = (limits.lower[k], limits.upper[k]);
        if (lower..=upper).contains(&q) { q } else { 0.5 * (lower + upper) }
    };
    q.into_iter().enumerate().map(inside).collect()
}

/// Returns the limits of positions and speeds as constraints. The list is empty if no joint has such limits.
pub(crate) fn limits_of(model: &Model, q: &[f64]) -> Vec<Limit> {
    let (nv, limits) = (model.nv(), model.limits());
    let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; 2 * nv], vec![f64::INFINITY; 2 * nv]);
    for body in model.bodies()[1..].iter().filter(|b| b.joint.nq() == 1 && b.mimic.is_none()) {
        // For a joint with one coordinate, x ⊖ x_ref equals q − q_ref.
        (lower[body.idx_v], upper[body.idx_v]) =
            (limits.lower[body.idx_q] - q[body.idx_q], limits.upper[body.idx_q] - q[body.idx_q]);
    }
    for (k, &speed) in limits.velocity.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        (lower[nv + k], upper[nv + k]) = (-speed, speed);
    }
    let reference = [q, &vec![0.0; nv]].concat();
    bounded(STATES, Residual::State { reference }, lower, upper)
}

/// Returns the lower and upper effort limits of the last nu degrees of freedom. An empty range, such as an effort limit
/// of 0, counts as no limit.
pub(crate) fn efforts(model: &Model, nu: usize) -> (Vec<f64>, Vec<f64>) {
    let (limits, first) = (model.limits(), model.nv() - nu);
    let range = |(&lower, &upper): (&f64, &f64)| {
        if lower < upper { (lower, upper) } else { (f64::NEG_INFINITY, f64::INFINITY) }
    };
    limits.effort_lower[first..].iter().zip(&limits.effort_upper[first..]).map(range).unzip()
}

/// Returns the effort limits of the last nu degrees of freedom as constraints.
pub(crate) fn efforts_of(model: &Model, nu: usize) -> Vec<Limit> {
    let (lower, upper) = efforts(model, nu);
    bounded(EFFORTS, Residual::Control { reference: vec![0.0; nu] }, lower, upper)
}

fn bounded(name: &str, residual: Residual, lower: Vec<f64>, upper: Vec<f64>) -> Vec<Limit> {
    match lower.iter().chain(&upper).any(|x| x.is_finite()) {
        true => vec![Limit::new(name, residual, lower, upper)],
        false => Vec::new(),
    }
}
