//! Converts a gait to an optimal control problem. In a gait, a robot stands, steps and jumps.

use crate::budget::held;
use crate::error::Error;
use crate::limits::{efforts_of, inside, limits_of};
use crate::task::{Phase, PhaseKind, Task};
use condyle::optimal::robot::{
    Activation, Contact, ContactDynamics, Cost, FreeDynamics, FrictionCone, ImpulseDynamics, Limit, Residual,
    WrenchCone,
};
use condyle::optimal::{ActionModel, Problem};
use condyle::{ContactConstraint, Data, Joint, Model, Se3, Vec3, forward_kinematics, neutral, spatial::Mat3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Builder of a gait. It contains the knots so far, and the positions of the feet and of the centre of mass at the last
/// knot.
pub(crate) struct Gait {
    model: Arc<Model>,
    /// State to which the robot returns. (The next field is the initial state.)
    rest: Vec<f64>,
    x0: Vec<f64>,
    dt: f64,
    friction: f64,
    sole: Option<[f64; 2]>,
    feet: Vec<(usize, Vec3<f64>)>,
    com: Vec3<f64>,
    models: Vec<Box<dyn ActionModel>>,
    knot_models: Vec<usize>,
    us: Vec<f64>,
    times: Vec<f64>,
    touches: Vec<Vec<bool>>,
    /// Limits of positions and speeds that become constraints. (The next field has the limits of efforts.) Both lists
    /// are empty if the problem has no limits as constraints.
    limits: Vec<Limit>,
    efforts: Vec<Limit>,
}

/// Optimal control problem of a gait, with a warm start.
pub(crate) struct Posed {
    pub problem: Problem,
    pub xs: Vec<f64>,
    pub us: Vec<f64>,
    /// Time of each knot (s); an impact has no duration.
    pub times: Vec<f64>,
    /// Whether each foot touches the ground, for each knot.
    pub touches: Vec<Vec<bool>>,
    pub feet: Vec<usize>,
}

impl Gait {
    /// Creates a gait from the posture of a task, with the feet at an average height of 0. If `held` is true, the
    /// limits of the robot become constraints.
    pub(crate) fn new(model: Arc<Model>, task: &Task, dt: f64, held: bool) -> Result<Self, Error> {
        let floats = model.bodies().get(1).is_some_and(|b| b.joint == Joint::FreeFlyer);
        if !floats {
            let what = "a robot with feet needs a floating base: set root = \"free\"".to_owned();
            return Err(task.place.wrong("robot", what));
        }
        let mut frames = Vec::new();
        for name in &task.feet {
            frames.push(model.frame(name).map_err(|error| task.place.wrong(name, error.to_string()))?);
        }
        let rest = posture(&model, &task.posture, task)?;
        let begin = match &task.start {
            Some(start) => posture(&model, start, task)?,
            None => rest.clone(),
        };
        // Shift the posture and the initial position of the robot. In both, the average position of the feet must be
        // the same, at height 0.
        let middle = |q: &[f64]| {
            let feet = feet_at(&model, q, &frames);
            feet.iter().fold(Vec3::zero(), |sum, foot| sum + foot.1).scale(1.0 / feet.len() as f64)
        };
        let ground = Vec3 { z: 0.0, ..middle(&rest) };
        let placed = |q: &[f64]| {
            let by = ground - middle(q);
            let mut x = [q, &vec![0.0; model.nv()]].concat();
            (x[0], x[1], x[2]) = (x[0] + by.x, x[1] + by.y, x[2] + by.z);
            x
        };
        let (rest, x0) = (placed(&rest), placed(&begin));
        let feet = feet_at(&model, &x0[..model.nq()], &frames);
        let com = forward_kinematics(&model, &mut Data::new(&model), &rest[..model.nq()]).com();
        let limits = if held { limits_of(&model, &rest[..model.nq()]) } else { Vec::new() };
        let efforts = if held { efforts_of(&model, model.nv() - 6) } else { Vec::new() };
        Ok(Self {
            rest,
            x0,
            dt,
            friction: task.friction,
            sole: task.sole,
            feet,
            com,
            models: Vec::new(),
            knot_models: Vec::new(),
            us: Vec::new(),
            times: vec![0.0],
            touches: Vec::new(),
            limits,
            efforts,
            model,
        })
    }

    fn name(&self, frame: usize) -> String {
        self.model.frames()[frame].name.clone()
    }

    fn contacts(&self, frames: &[usize]) -> Vec<Contact> {
        let make = if self.sole.is_some() { ContactConstraint::rigid } else { ContactConstraint::point };
        frames.iter().map(|&frame| Contact::new(&self.name(frame), held(make(frame)))).collect()
    }

    /// Returns the cost of the deviation from the posture. The first three weights are for the position of the trunk,
    /// the rotation of the trunk, and the joint positions. The other three weights are for the corresponding
    /// velocities.
    fn rest(&self, weights: [f64; 6]) -> Cost {
        let counts = [3, 3, self.model.nv() - 6].repeat(2);
        let w = counts.iter().zip(weights).flat_map(|(&n, w)| vec![w; n]).collect();
        Cost::new("rest", 1e1, Residual::State { reference: self.rest.clone() }, Activation::Weighted(w))
    }

    /// Returns the cost of the distance between a foot and a point. For a sole, the cost also penalises the deviation
    /// from level.
    fn place(&self, frame: usize, target: Vec3<f64>, weight: f64) -> Cost {
        let named = (&self.model.frames()[frame]).into();
        let residual = match self.sole {
            None => Residual::FrameTranslation { frame: named, target },
            Some(_) => Residual::FramePlacement { frame: named, target: Se3::new(Mat3::identity(), target) },
        };
        Cost::new(&format!("{} moves", self.name(frame)), weight, residual, Activation::Quadratic)
    }

    /// Returns the costs of a knot, for the feet in support and for the feet that move.
    fn costs(&self, support: &[usize], moving: &[(usize, Vec3<f64>)], com: Option<Vec3<f64>>) -> Vec<Cost> {
        let grip = |&frame: &usize| {
            let (contact, friction) = (self.name(frame), FrictionCone::new(self.friction));
            let (residual, (lower, upper)) = match self.sole {
                None => (Residual::FrictionCone { contact, cone: friction.clone() }, friction.bounds()),
                Some(size) => {
                    let cone = WrenchCone { friction: FrictionCone { inner: true, ..friction }, size };
                    let bounds = cone.bounds();
                    (Residual::WrenchCone { contact, cone }, bounds)
                }
            };
            Cost::new(&format!("{} grips", self.name(frame)), 1e1, residual, Activation::Barrier { lower, upper })
        };
        let mut costs: Vec<Cost> = support.iter().map(grip).collect();
        costs.extend(moving.iter().map(|&(frame, target)| self.place(frame, target, 1e6)));
        costs.extend(com.map(|target| Cost::new("com", 1e5, Residual::CenterOfMass { target }, Activation::Quadratic)));
        costs.push(self.rest([0.0, 1e3, 1e-1, 1e1, 1e1, 1e0]));
        let reference = vec![0.0; self.model.nv() - 6];
        costs.push(Cost::new("effort", 1e-1, Residual::Control { reference }, Activation::Quadratic));
        costs
    }

    /// Adds `count` knots with the feet `support` on the ground. All these knots share one action model. `costs`
    /// returns the costs of knot k.
    fn knots(
        &mut self,
        support: &[usize],
        count: usize,
        costs: &dyn Fn(&Self, usize) -> Vec<Cost>,
    ) -> Result<(), Error> {
        let first = self.knot_models.len();
        let limits = [self.limits.clone(), self.efforts.clone()].concat();
        let (action, hold): (Box<dyn ActionModel>, Vec<f64>) = if support.is_empty() {
            let mut action = FreeDynamics::running(self.model.clone(), self.dt, costs(self, 0))?.with_limits(limits)?;
            for k in 0..count {
                action.set_costs(first + k, costs(self, k))?;
            }
            (Box::new(action), vec![0.0; self.model.nv() - 6])
        } else {
            let contacts = self.contacts(support);
            let action = ContactDynamics::running(self.model.clone(), &contacts, self.dt, costs(self, 0))?;
            let mut action = action.with_limits(limits)?;
            let hold = action.quasi_static(&self.x0);
            for k in 0..count {
                action.set_costs(first + k, costs(self, k))?;
            }
            (Box::new(action), hold)
        };
        self.us.extend(hold.repeat(count));
        self.knot_models.extend(vec![self.models.len(); count]);
        let touching: Vec<bool> = self.feet.iter().map(|foot| support.contains(&foot.0)).collect();
        self.touches.extend(vec![touching; count]);
        let last = self.times.last().copied().unwrap_or(0.0);
        self.times.extend((1..=count).map(|k| last + k as f64 * self.dt));
        self.models.push(action);
        Ok(())
    }

    /// Adds an impact, in which feet land at their current positions.
    fn land(&mut self, landing: &[usize]) -> Result<(), Error> {
        let mut costs = vec![self.rest([1e0, 1e1, 1e0, 1e1, 1e1, 1e1])];
        // The trunk has moved horizontally from the posture. So do not penalise its position.
        if let Activation::Weighted(w) = &mut costs[0].activation {
            w[..3].fill(0.0);
        }
        for &k in landing {
            costs.push(self.place(self.feet[k].0, self.feet[k].1, 1e7));
        }
        let frames: Vec<usize> = landing.iter().map(|&k| self.feet[k].0).collect();
        let contacts = self.contacts(&frames);
        self.models.push(Box::new(ImpulseDynamics::instant(self.model.clone(), &contacts, 0.0, 1e-12, costs)?));
        self.knot_models.push(self.models.len() - 1);
        let all = self.touches.last().cloned().unwrap_or_default();
        self.touches.push(all.iter().enumerate().map(|(k, &touches)| touches || landing.contains(&k)).collect());
        self.times.push(self.times.last().copied().unwrap_or(0.0)); // an impact has no duration
        Ok(())
    }

    /// Adds the knots of a phase of the gait.
    pub(crate) fn add(&mut self, phase: &Phase, next: Option<&Phase>) -> Result<(), Error> {
        let all: Vec<usize> = (0..self.feet.len()).collect();
        let swinging = match &phase.kind {
            PhaseKind::Stand => {
                let feet: Vec<_> = self.feet.iter().map(|foot| foot.0).collect();
                // Before a jump, no cost acts on the centre of mass, so the robot can crouch.
                let free = next.is_some_and(|next| next.kind == PhaseKind::Jump);
                return self.knots(&feet, phase.knots, &|gait, _| gait.costs(&feet, &[], (!free).then_some(gait.com)));
            }
            PhaseKind::Step(swinging) => swinging,
            PhaseKind::Jump => &all,
        };
        let jumps = phase.kind == PhaseKind::Jump;
        let support: Vec<_> = all.iter().filter(|k| !swinging.contains(k)).map(|&k| self.feet[k].0).collect();
        let share = swinging.len() as f64 / self.feet.len() as f64;
        let Phase { knots, length, side, height, .. } = *phase;
        let ahead = |s: f64| Vec3::new(length * s, side * s, 0.0);
        self.knots(&support, knots, &|gait, k| {
            let s = (k + 1) as f64 / knots as f64;
            let lift = Vec3::new(0.0, 0.0, height * (core::f64::consts::PI * s).sin());
            if jumps {
                // A cost moves the centre of mass along its arc. No cost acts on the positions of the feet, except the
                // cost of the posture.
                return gait.costs(&[], &[], Some(gait.com + ahead(s) + lift));
            }
            let moving: Vec<_> = swinging.iter().map(|&k| (gait.feet[k].0, gait.feet[k].1 + ahead(s) + lift)).collect();
            gait.costs(&support, &moving, Some(gait.com + ahead(share * s)))
        })?;
        self.com += ahead(share);
        for &k in swinging {
            self.feet[k].1 += ahead(1.0);
        }
        let landing = swinging.clone();
        self.land(&landing)
    }

    /// Returns the gait as an optimal control problem. In the warm start, the robot stands still.
    pub(crate) fn pose(self) -> Result<Posed, Error> {
        let terminal = vec![self.rest([0.0, 1e3, 1e-1, 1e2, 1e2, 1e2])];
        let end = FreeDynamics::terminal(self.model.clone(), terminal)?.with_limits(self.limits.clone())?;
        let xs = self.x0.repeat(self.knot_models.len() + 1);
        let problem = Problem::new(self.x0, self.models, self.knot_models, Box::new(end))?;
        let feet = self.feet.iter().map(|foot| foot.0).collect();
        Ok(Posed { problem, xs, us: self.us, times: self.times, touches: self.touches, feet })
    }
}

/// Returns the frames, each with its position at q.
fn feet_at(model: &Model, q: &[f64], frames: &[usize]) -> Vec<(usize, Vec3<f64>)> {
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, q);
    frames.iter().map(|&frame| (frame, placements.frame(frame).translation)).collect()
}

/// Returns the position with the given joint values. The other coordinates are neutral. If limits exclude a neutral
/// value, the coordinate gets the middle of its range.
pub(crate) fn posture(model: &Model, joints: &BTreeMap<String, f64>, task: &Task) -> Result<Vec<f64>, Error> {
    let mut q = inside(model, neutral(model));
    for (name, &value) in joints {
        let body = model.joint(name).map_err(|error| task.place.wrong(name, error.to_string()))?;
        let body = &model.bodies()[body];
        match body.joint {
            Joint::Continuous { .. } => (q[body.idx_q], q[body.idx_q + 1]) = (value.cos(), value.sin()),
            _ if body.joint.nq() == 1 => q[body.idx_q] = value,
            _ => return Err(task.place.wrong(name, format!("joint `{name}` has several coordinates"))),
        }
        if body.joint.nq() == 1 {
            let (lower, upper) = (model.limits().lower[body.idx_q], model.limits().upper[body.idx_q]);
            if !(lower..=upper).contains(&value) {
                let what = format!("joint `{name}` is at {value}, outside of its limits [{lower}, {upper}]");
                return Err(task.place.wrong(name, what));
            }
        }
    }
    Ok(q)
}
