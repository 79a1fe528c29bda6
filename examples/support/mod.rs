//! Walking as an optimal control problem. The examples `trot.rs`, `walk.rs` and `wholebody_trot.rs` share this code.

use condyle::optimal::robot::{
    Activation, Contact, ContactDynamics, Cost, FreeDynamics, FrictionCone, ImpulseDynamics, Residual, WrenchCone,
};
use condyle::optimal::{ActionModel, Error, Fddp, Iteration, Problem, Solution};
use condyle::{ContactConstraint, Data, Model, ReferenceFrame, Se3, Vec3, forward_kinematics, spatial::Mat3};
use std::sync::Arc;

const FRICTION: f64 = 0.7;
/// Rate at which the slip of a foot decays (1/s).
const HOLD: f64 = 40.0;

/// Tolerance of the solver. The cost of a gait is several hundred, so the tolerance is less than a millionth of the
/// cost.
const TOLERANCE: f64 = 1e-4;

/// Shape of the feet.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Foot {
    /// The feet are points.
    Point,
    /// The feet are soles with these side lengths along x and y (m).
    #[allow(dead_code)] // the quadruped does not use it
    Sole([f64; 2]),
}

/// Builder of a gait. It contains the knots so far, and the positions of the feet and of the centre of mass at the last
/// knot.
pub(crate) struct Gait {
    model: Arc<Model>,
    x0: Vec<f64>,
    dt: f64,
    foot: Foot,
    feet: Vec<(usize, Vec3<f64>)>,
    com: Vec3<f64>,
    models: Vec<Box<dyn ActionModel>>,
    knot_models: Vec<usize>,
    us: Vec<f64>,
    times: Vec<f64>,
    /// Whether each foot touches the ground, for each knot.
    touches: Vec<bool>,
}

impl Gait {
    /// Starts a gait at the posture q, in which the robot stands on its feet. The time between knots is dt (s).
    pub(crate) fn new(model: Arc<Model>, q: &[f64], foot: Foot, names: &[&str], dt: f64) -> Self {
        let mut data = Data::new(&model);
        let placements = forward_kinematics(&model, &mut data, q);
        let frames = names.iter().map(|name| model.frame(name).expect("the robot has these feet"));
        let mut feet: Vec<_> = frames.map(|frame| (frame, placements.frame(frame).translation)).collect();
        let (mut com, mut x0) = (placements.com(), [q, &vec![0.0; model.nv()]].concat());
        let ground = feet[0].1.z;
        feet.iter_mut().for_each(|foot| foot.1.z -= ground); // the robot stands at height 0
        (com.z, x0[2]) = (com.z - ground, x0[2] - ground);
        let (models, knot_models, us) = (Vec::new(), Vec::new(), Vec::new());
        Self { x0, dt, foot, feet, com, models, knot_models, us, times: vec![0.0], touches: Vec::new(), model }
    }

    fn contacts(&self, frames: &[usize], kd: f64) -> Vec<Contact> {
        let make = if self.foot == Foot::Point { ContactConstraint::point } else { ContactConstraint::rigid };
        let reference = ReferenceFrame::LocalWorldAligned;
        let contact =
            |&frame: &usize| Contact::new(&self.name(frame), ContactConstraint { kd, reference, ..make(frame) });
        frames.iter().map(contact).collect()
    }

    fn name(&self, frame: usize) -> String {
        self.model.frames()[frame].name.clone()
    }

    /// Returns the cost of the deviation from the posture. The first three weights are for the position of the trunk,
    /// the rotation of the trunk, and the joint positions. The other three weights are for the corresponding
    /// velocities.
    fn rest(&self, weights: [f64; 6]) -> Cost {
        let counts = [3, 3, self.model.nv() - 6].repeat(2);
        let w = counts.iter().zip(weights).flat_map(|(&n, w)| vec![w; n]).collect();
        Cost::new("rest", 1e1, Residual::State { reference: self.x0.clone() }, Activation::Weighted(w))
    }

    /// Returns the cost of the distance between a foot and a point. For a sole, the cost also penalises the deviation
    /// from level.
    fn place(&self, frame: usize, target: Vec3<f64>, weight: f64) -> Cost {
        let moved = (&self.model.frames()[frame]).into();
        let residual = match self.foot {
            Foot::Point => Residual::FrameTranslation { frame: moved, target },
            Foot::Sole(_) => Residual::FramePlacement { frame: moved, target: Se3::new(Mat3::identity(), target) },
        };
        Cost::new(&format!("{} moves", self.name(frame)), weight, residual, Activation::Quadratic)
    }

    /// Returns the costs of a knot, for the feet in support and for the feet that move.
    fn costs(&self, support: &[usize], moving: &[(usize, Vec3<f64>)], com: Vec3<f64>) -> Vec<Cost> {
        let grip = |&frame: &usize| {
            let (contact, friction) = (self.name(frame), FrictionCone::new(FRICTION));
            let (residual, (lower, upper)) = match self.foot {
                Foot::Point => (Residual::FrictionCone { contact, cone: friction.clone() }, friction.bounds()),
                Foot::Sole(size) => {
                    let cone = WrenchCone { friction: FrictionCone { inner: true, ..friction }, size };
                    let bounds = cone.bounds();
                    (Residual::WrenchCone { contact, cone }, bounds)
                }
            };
            Cost::new(&format!("{} grips", self.name(frame)), 1e1, residual, Activation::Barrier { lower, upper })
        };
        let mut costs: Vec<Cost> = support.iter().map(grip).collect();
        costs.extend(moving.iter().map(|&(frame, target)| self.place(frame, target, 1e6)));
        costs.push(Cost::new("com", 1e5, Residual::CenterOfMass { target: com }, Activation::Quadratic));
        costs.push(self.rest([0.0, 1e3, 1e-1, 1e1, 1e1, 1e0]));
        let reference = vec![0.0; self.model.nv() - 6];
        costs.push(Cost::new("effort", 1e-1, Residual::Control { reference }, Activation::Quadratic));
        costs
    }

    /// Adds knots with the feet `support` on the ground. Knot k has the costs `costs(k)`. All these knots share one
    /// action model.
    fn phase(
        &mut self,
        support: &[usize],
        knots: usize,
        costs: impl Fn(&Self, usize) -> Vec<Cost>,
    ) -> Result<(), Error> {
        let contacts = self.contacts(support, HOLD);
        let mut action = ContactDynamics::running(self.model.clone(), &contacts, self.dt, costs(self, 0))?;
        let hold = action.quasi_static(&self.x0);
        for k in 0..knots {
            action.set_costs(self.knot_models.len() + k, costs(self, k))?;
        }
        self.us.extend(hold.repeat(knots));
        self.knot_models.extend(vec![self.models.len(); knots]);
        let touching: Vec<bool> = self.feet.iter().map(|foot| support.contains(&foot.0)).collect();
        self.touches.extend(touching.repeat(knots));
        let last = self.times.last().copied().unwrap_or(0.0);
        self.times.extend((1..=knots).map(|k| last + k as f64 * self.dt));
        self.models.push(Box::new(action));
        Ok(())
    }

    /// Stands on all feet for a number of knots.
    pub(crate) fn stand(&mut self, knots: usize) -> Result<(), Error> {
        let feet: Vec<_> = self.feet.iter().map(|foot| foot.0).collect();
        self.phase(&feet, knots, |gait, _| gait.costs(&feet, &[], gait.com))
    }

    /// Swings the feet with these indices ahead by `length`, along an arc of height `height`, and sets them down.
    pub(crate) fn step(&mut self, swinging: &[usize], length: f64, height: f64, knots: usize) -> Result<(), Error> {
        let swings = |k: &usize| swinging.contains(k);
        let support: Vec<_> = (0..self.feet.len()).filter(|k| !swings(k)).map(|k| self.feet[k].0).collect();
        let share = swinging.len() as f64 / self.feet.len() as f64;
        let ahead = |s: f64| Vec3::new(length * s, 0.0, 0.0);
        self.phase(&support, knots, |gait, k| {
            let s = (k + 1) as f64 / knots as f64;
            let lift = Vec3::new(0.0, 0.0, height * (core::f64::consts::PI * s).sin());
            let moving: Vec<_> = swinging.iter().map(|&k| (gait.feet[k].0, gait.feet[k].1 + ahead(s) + lift)).collect();
            gait.costs(&support, &moving, gait.com + ahead(share * s))
        })?;
        self.com += ahead(share);
        let mut costs = vec![self.rest([1e0, 1e1, 1e0, 1e1, 1e1, 1e1])];
        let mut landing = Vec::new();
        for &k in swinging {
            self.feet[k].1 += ahead(1.0);
            landing.push(self.feet[k].0);
            costs.push(self.place(self.feet[k].0, self.feet[k].1, 1e7));
        }
        let contacts = self.contacts(&landing, 0.0);
        self.models.push(Box::new(ImpulseDynamics::instant(self.model.clone(), &contacts, 0.0, 1e-12, costs)?));
        self.knot_models.push(self.models.len() - 1);
        self.touches.extend(vec![true; self.feet.len()]);
        self.times.push(self.times.last().copied().unwrap_or(0.0)); // an impact takes no time
        Ok(())
    }

    /// Returns whether each foot touches, for each interval between knots, in the order of the feet's names.
    #[allow(dead_code)] // only examples with tracking use it
    pub(crate) fn touches(&self) -> Vec<bool> {
        self.touches.clone()
    }

    /// Solves the problem, printing a line for each iteration; returns the solution and the time of each knot.
    pub(crate) fn solve(self) -> Result<(Solution, Vec<f64>), Error> {
        let terminal = vec![self.rest([0.0, 1e3, 1e-1, 1e2, 1e2, 1e2])];
        let end = FreeDynamics::terminal(self.model.clone(), terminal)?;
        let xs = self.x0.repeat(self.knot_models.len() + 1);
        let mut problem = Problem::new(self.x0, self.models, self.knot_models, Box::new(end))?;
        let mut solver = Fddp::new(&problem);
        solver.settings.tolerance = TOLERANCE;
        let solution = solver.solve_with(&mut problem, &xs, &self.us, |i: &Iteration| {
            println!("iteration {:2}   cost {:14.6}   step {:.3}   gap {:.1e}", i.iteration, i.cost, i.step, i.gap);
        })?;
        let knots = xs.len() / solution.x(0).len() - 1;
        let per_iteration = 1e3 * solution.timings.total.as_secs_f64() / solution.trace.len() as f64;
        println!(
            "{:?} after {} iterations of {per_iteration:.2} ms, {knots} knots",
            solution.status,
            solution.trace.len()
        );
        Ok((solution.clone(), self.times))
    }
}
