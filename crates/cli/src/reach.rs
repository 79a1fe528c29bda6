//! Converts the task of reaching a point to an optimal control problem.

use crate::error::Error;
use crate::limits::{efforts_of, inside, limits_of};
use condyle::optimal::Problem;
use condyle::optimal::robot::{Activation, Actuation, Cost, FreeDynamics, Residual};
use condyle::{Data, Model, Vec3, difference, integrate, neutral, rnea, terms::gravity};
use std::sync::Arc;

/// Weight of an effort without a limit. This weight equals the weight of an effort with a limit of 100 N m or 100 N.
const WITHOUT_LIMIT: f64 = 1e-4;

/// Problem with a warm start: the problem, the initial states and the initial efforts.
pub(crate) type Posed = (Problem, Vec<f64>, Vec<f64>);

/// Returns the optimal control problem and a warm start. The warm start is a straight path to a posture that reaches
/// the target, with the efforts from inverse dynamics.
///
/// The running costs have two terms, each relative to its limit: the speed, and the difference between the efforts and
/// the efforts that hold the start. Barriers penalise positions, speeds and efforts outside of their limits. Terminal
/// costs are the distance to the target and the speed. If `held` is true, the limits are also constraints.
pub(crate) fn problem(
    model: &Arc<Model>,
    frame: usize,
    target: Vec3<f64>,
    (q0, q_end): (&[f64], &[f64]),
    (knots, dt): (usize, f64),
    held: bool,
) -> Result<Posed, Error> {
    let nv = model.nv();
    let limits = model.limits();
    let nu = Actuation::joints(model).nu();
    let driven = nv - nu..; // all degrees of freedom except a floating base's
    let rest = |q: &[f64]| [q, &vec![0.0; nv]].concat();
    let x0 = rest(q0);
    let state = || Residual::State { reference: rest(&neutral(model)) };
    let moving = |speed: f64| Activation::Weighted([vec![0.0; nv], vec![speed; nv]].concat());
    // The limits of joints with one coordinate are bounds on the tangent vector from the neutral position.
    let (mut lower, mut upper) = (vec![f64::NEG_INFINITY; 2 * nv], vec![f64::INFINITY; 2 * nv]);
    for body in model.bodies()[1..].iter().filter(|b| b.joint.nq() == 1) {
        (lower[body.idx_v], upper[body.idx_v]) = (limits.lower[body.idx_q], limits.upper[body.idx_q]);
    }
    for (k, &speed) in limits.velocity.iter().enumerate().filter(|(_, v)| **v > 0.0) {
        (lower[nv + k], upper[nv + k]) = (-speed, speed);
    }
    let within = || Activation::Barrier { lower: lower.clone(), upper: upper.clone() };
    let (least, most) = crate::limits::efforts(model, nu);
    let share = least.iter().zip(&most).map(|(least, most)| most.min(-least));
    let share = share.map(|e| if e.is_finite() { e.powi(-2) } else { WITHOUT_LIMIT }).collect();
    let efforts = Activation::Barrier { lower: least, upper: most };
    let hold = gravity(model, &mut Data::new(model), q0)[driven.clone()].to_vec();
    let position = Residual::FrameTranslation { frame: (&model.frames()[frame]).into(), target };
    let running = vec![
        Cost::new("speed", 1e-1, state(), moving(1.0)),
        Cost::new("effort", 1e0, Residual::Control { reference: hold }, Activation::Weighted(share)),
        Cost::new("limits", 1e2, state(), within()),
        Cost::new("effort limits", 1e1, Residual::Control { reference: vec![0.0; nu] }, efforts),
    ];
    let terminal = vec![
        Cost::new("target", 1e4, position, Activation::Quadratic),
        Cost::new("stop", 1e0, state(), moving(1.0)),
        Cost::new("limits", 1e2, state(), within()),
    ];
    // Compute the straight path with minimum jerk, q0 ⊕ s(t) way, with s = 10 r³ − 15 r⁴ + 6 r⁵ and r = t/T. T is the
    // duration, and `way` is the tangent vector from q0 to the final posture.
    let (mut data, mut q, mut way) = (Data::new(model), q0.to_vec(), vec![0.0; nv]);
    difference(model, q0, q_end, &mut way);
    let along = |s: f64| way.iter().map(|d| d * s).collect::<Vec<f64>>();
    let duration = knots as f64 * dt;
    let (mut xs, mut us) = (Vec::new(), Vec::new());
    for t in 0..=knots {
        let r = t as f64 / knots as f64;
        let v = along(30.0 * r * r * (1.0 - r) * (1.0 - r) / duration);
        let a = along(60.0 * r * (1.0 - r) * (1.0 - 2.0 * r) / (duration * duration));
        integrate(model, q0, &along(r * r * r * (10.0 + r * (6.0 * r - 15.0))), &mut q);
        if t < knots {
            us.extend(&rnea(model, &mut data, &q, &v, &a, &[])[driven.clone()]);
        }
        xs.extend(q.iter().chain(&v));
    }
    let (mut action, mut end) =
        (FreeDynamics::running(model.clone(), dt, running)?, FreeDynamics::terminal(model.clone(), terminal)?);
    if held {
        let state = limits_of(model, &inside(model, neutral(model)));
        end = end.with_limits(state.clone())?;
        action = action.with_limits([state, efforts_of(model, nu)].concat())?;
    }
    Ok((Problem::new(x0, vec![Box::new(action)], vec![0; knots], Box::new(end))?, xs, us))
}
