//! Models of the knots: one for each stance, with its contacts, costs and limits.

use crate::{Error, Foot, PlanLimits, Settings};
use condyle_dynamics::{Joint, Model, Vec3};
use condyle_optimal::ActionModel;
use condyle_optimal::robot::{Activation, ContactDynamics, Cost, FreeDynamics, Limit, Residual};
use std::sync::Arc;

/// Name of the cost of the state.
pub(crate) const STATE: &str = "state";
/// Name of the cost of the efforts.
pub(crate) const EFFORT: &str = "effort";
/// Least normal force of a foot on the ground, relative to the weight of the robot.
const LEAST_FORCE: f64 = 0.03;
/// Costs of a violated limit of a joint: linear and quadratic weights (rad, rad/s).
const POSITION_WEIGHTS: (f64, f64) = (10.0, 1e3);
const VELOCITY_WEIGHTS: (f64, f64) = (0.1, 1.0);
/// Acceleration of gravity to which efforts of joints without limits are compared (m/s²).
const GRAVITY: f64 = 9.81;

/// Returns the name of the cost of a swinging foot.
pub(crate) fn swing_name(foot: &Foot) -> String {
    format!("{} swings", foot.frame)
}

/// Returns the name of the cost of the tilt of a swinging sole.
pub(crate) fn tilt_name(foot: &Foot) -> String {
    format!("{} tilts", foot.frame)
}

/// Maker of the models of knots.
pub(crate) struct KnotMaker<'a> {
    pub model: &'a Arc<Model>,
    pub feet: &'a [Foot],
    pub settings: &'a Settings,
}

impl KnotMaker<'_> {
    /// Checks that the robot has a free-flyer at its root.
    pub(crate) fn check_root(model: &Model) -> Result<(), Error> {
        match model.bodies().get(1).map(|body| body.joint) {
            Some(Joint::FreeFlyer) => Ok(()),
            _ => {
                let what = format!("`{}` has no free-flyer at its root: read it with a floating base", model.name());
                Err(Error::Robot { what })
            }
        }
    }

    /// Returns the cost of the state, with its weight relative to `Weights`.
    fn state(&self, weight: f64) -> Cost {
        let (model, w) = (self.model, &self.settings.weights);
        let is_leg = leg_coordinates(model, self.feet);
        let joint = |k: usize, kind: usize| if is_leg[k] { w.legs[kind] } else { w.upper_body[kind] };
        let mut weights = vec![w.place, w.place, w.height, w.tilt, w.tilt, w.heading];
        weights.extend((6..model.nv()).map(|k| joint(k, 0)));
        weights.extend([w.forwards, w.sideways, w.vertical, w.rotation, w.rotation, w.rotation]);
        weights.extend((6..model.nv()).map(|k| joint(k, 1)));
        let reference = [condyle_dynamics::neutral(model), vec![0.0; model.nv()]].concat();
        Cost::new(STATE, weight, Residual::State { reference }, Activation::Weighted(weights))
    }

    /// Returns the costs of a swinging foot.
    fn swing(&self, foot: &Foot) -> Vec<Cost> {
        let w = &self.settings.weights;
        let residual = Residual::FrameTranslation { frame: foot.frame.as_str().into(), target: Vec3::zero() };
        let weights = vec![w.swing[0], w.swing[0], w.swing[1]];
        let mut costs = vec![Cost::new(&swing_name(foot), 1.0, residual, Activation::Weighted(weights))];
        if foot.is_sole() {
            let tilt = Residual::Tilt { frame: foot.frame.as_str().into(), up: Vec3::new(0.0, 0.0, 1.0) };
            costs.push(Cost::new(&tilt_name(foot), w.level, tilt, Activation::Quadratic));
        }
        costs
    }

    /// Returns the cost of the efforts.
    fn effort(&self) -> Cost {
        let limits = effort_limits(self.model, 6);
        let weights = limits.iter().map(|limit| self.settings.weights.effort / (limit * limit)).collect();
        let reference = vec![0.0; limits.len()];
        Cost::new(EFFORT, 1.0, Residual::Control { reference }, Activation::Weighted(weights))
    }

    /// Returns the model of a stance, in which the feet of the mask are on the ground.
    pub(crate) fn knot(&self, stance: u32) -> Result<ContactDynamics, Error> {
        let (model, dt) = (self.model, self.settings.knot);
        let stands = |foot: &usize| stance & (1 << foot) != 0;
        let (mut contacts, mut limits) = (Vec::new(), joint_limits(model, 6, self.settings.limits, true));
        let mut costs = vec![self.state(1.0), self.effort()];
        let least = LEAST_FORCE * GRAVITY * model.total_mass();
        for k in 0..self.feet.len() {
            let foot = &self.feet[k];
            if stands(&k) {
                contacts.push(foot.contact(model, dt)?);
                limits.push(foot.grip(least, self.settings.used_sole));
            } else {
                costs.extend(self.swing(foot));
            }
        }
        Ok(ContactDynamics::running(model.clone(), &contacts, dt, costs)?.with_limits(limits)?)
    }

    /// Returns the terminal model.
    pub(crate) fn end(&self) -> Result<Box<dyn ActionModel>, Error> {
        let costs = vec![self.state(self.settings.weights.end)];
        Ok(Box::new(FreeDynamics::terminal(self.model.clone(), costs)?))
    }
}

/// Returns the limits of the joints' efforts, positions and velocities. The first `root` coordinates of v are left out;
/// they belong to a free-flyer without motors.
/// If `soft` is true, limits of positions and velocities may give way.
pub(crate) fn joint_limits(model: &Model, root: usize, asked: PlanLimits, soft: bool) -> Vec<Limit> {
    let (given, nv) = (model.limits(), model.nv());
    let finite = |bounds: &[f64]| bounds.iter().any(|bound| bound.is_finite());
    let mut limits = Vec::new();
    let (lowest, highest) = (&given.effort_lower[root..], &given.effort_upper[root..]);
    if asked.efforts && (finite(lowest) || finite(highest)) {
        let residual = Residual::Control { reference: vec![0.0; nv - root] };
        limits.push(Limit::new(EFFORT, residual, lowest.to_vec(), highest.to_vec()));
    }
    let reference = [condyle_dynamics::neutral(model), vec![0.0; nv]].concat();
    let mut add = |name: &str, lower: Vec<f64>, upper: Vec<f64>, (linear, quadratic): (f64, f64)| {
        if finite(&lower) || finite(&upper) {
            let state = Residual::State { reference: reference.clone() };
            let limit = Limit::new(name, state, lower, upper);
            limits.push(if soft { limit.softened(linear, quadratic) } else { limit });
        }
    };
    let free = [vec![f64::NEG_INFINITY; 2 * nv], vec![f64::INFINITY; 2 * nv]];
    if asked.positions {
        let [mut lower, mut upper] = free.clone();
        for body in model.bodies().iter().skip(1).filter(|body| body.joint.nq() == 1 && body.joint.nv() == 1) {
            let (v, q) = (body.idx_v, body.idx_q);
            // the residual is the difference to the neutral position
            (lower[v], upper[v]) = (given.lower[q] - reference[q], given.upper[q] - reference[q]);
        }
        add("positions", lower, upper, POSITION_WEIGHTS);
    }
    if asked.velocities {
        let [mut lower, mut upper] = free;
        for k in root..nv {
            (lower[nv + k], upper[nv + k]) = (-given.velocity[k], given.velocity[k]);
        }
        add("velocities", lower, upper, VELOCITY_WEIGHTS);
    }
    limits
}

/// Returns the largest efforts of all joints, without the first `root` coordinates of v. A joint without a limit gets
/// the effort that lifts half of the robot at a lever of 0.2 m.
pub(crate) fn effort_limits(model: &Model, root: usize) -> Vec<f64> {
    let others = 0.5 * 0.2 * GRAVITY * model.total_mass();
    let limit = |&limit: &f64| if limit.is_finite() && limit > 0.0 { limit } else { others };
    model.limits().effort()[root..].iter().map(limit).collect()
}

/// Returns for each coordinate of v whether it belongs to a joint between the root and a foot.
fn leg_coordinates(model: &Model, feet: &[Foot]) -> Vec<bool> {
    let mut is_leg = vec![false; model.nv()];
    for foot in feet {
        let mut body = model.frame(&foot.frame).map_or(0, |frame| model.frames()[frame].body);
        while body > 1 {
            let joint = &model.bodies()[body];
            is_leg[joint.idx_v..joint.idx_v + joint.joint.nv()].fill(true);
            body = joint.parent;
        }
    }
    is_leg
}
