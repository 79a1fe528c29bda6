//! Where a robot may be: starts within the limits of its joints, and these limits as constraints of a problem.

use crate::error::Error;
use condyle::optimal::robot::{Limit, Residual};
use condyle::{Model, neutral};

/// Refuses a start outside of the limits, with the joint's name.
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

/// The last frame on the body that is farthest from the root: the tip of an arm.
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

/// Neutral, but mid-range for the coordinates whose limits exclude it.
pub(crate) fn start(model: &Model) -> Vec<f64> {
    inside(model, neutral(model))
}

/// A position, but mid-range for the coordinates whose limits exclude it.
pub(crate) fn inside(model: &Model, q: Vec<f64>) -> Vec<f64> {
    let limits = model.limits();
    let inside = |(k, q): (usize, f64)| {
        let (lower, upper) = (limits.lower[k], limits.upper[k]);
        if (lower..=upper).contains(&q) { q } else { 0.5 * (lower + upper) }
    };
    q.into_iter().enumerate().map(inside).collect()
}

/// The limits of positions and speeds, for the joints that have some; none where no joint has.
pub(crate) fn limits_of(model: &Model, q: &[f64]) -> Vec<Limit> {
    let (nv, limits) = (model.nv(), model.limits());
    let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; 2 * nv], vec![f64::INFINITY; 2 * nv]);
    for body in model.bodies()[1..].iter().filter(|b| b.joint.nq() == 1 && b.mimic.is_none()) {
        // x ⊖ x_ref of such a joint is q − q_ref
        (lower[body.idx_v], upper[body.idx_v]) =
            (limits.lower[body.idx_q] - q[body.idx_q], limits.upper[body.idx_q] - q[body.idx_q]);
    }
    for (k, &speed) in limits.velocity.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        (lower[nv + k], upper[nv + k]) = (-speed, speed);
    }
    let reference = [q, &vec![0.0; nv]].concat();
    bounded("positions and speeds", Residual::State { reference }, lower, upper)
}

/// The limits of the efforts of the last nu degrees of freedom.
pub(crate) fn efforts_of(model: &Model, nu: usize) -> Vec<Limit> {
    let effort = |e: &f64| if *e > 0.0 { *e } else { f64::INFINITY };
    let upper: Vec<f64> = model.limits().effort[model.nv() - nu..].iter().map(effort).collect();
    let lower = upper.iter().map(|e| -e).collect();
    bounded("efforts", Residual::Control { reference: vec![0.0; nu] }, lower, upper)
}

fn bounded(name: &str, residual: Residual, lower: Vec<f64>, upper: Vec<f64>) -> Vec<Limit> {
    match lower.iter().chain(&upper).any(|x| x.is_finite()) {
        true => vec![Limit::new(name, residual, lower, upper)],
        false => Vec::new(),
    }
}
