//! Controller of an arm: a frame follows poses in time, under the limits of the arm.

use crate::Error;
use crate::knots::{EFFORT, effort_limits, joint_limits};
use crate::planner::Planner;
use crate::policy::Policy;
use crate::report::{Report, TickStatus};
use crate::settings::{PlanLimits, PlanSettings, check_at_least};
use condyle_dynamics::{Joint, Model, Motion, Se3, lie};
use condyle_optimal::robot::{Activation, Cost, FreeDynamics, GeometryPair, Limit, Residual, Target};
use condyle_optimal::{InteriorPoint, Problem};
use std::sync::Arc;
use std::time::Instant;

/// Name of the cost of the pose.
const POSE: &str = "pose";
/// Weights of the limit of distances: for each m, and for each m², by which a distance is too small. The first one is
/// the gradient of the pose's cost at an error of 1 m, so that no error of the pose makes an obstacle give way.
const DISTANCE_WEIGHTS: (f64, f64) = (1e5, 1e6);
/// Numbers of a pose: the homogeneous matrix.
const POSE_SIZE: usize = 16;

/// Settings of an [`ArmMpc`].
#[derive(Clone, Debug, PartialEq)]
pub struct ArmSettings {
    /// Duration of the horizon (s).
    pub horizon: f64,
    /// Duration of a knot (s).
    pub knot: f64,
    /// Weights of the costs.
    pub weights: ArmWeights,
    /// Limits that the plan keeps.
    pub limits: PlanLimits,
    /// Pairs of geometries that stay apart: the arm and obstacles, or two parts of the arm.
    pub obstacles: Vec<GeometryPair>,
    /// Smallest distance of each pair at each knot (m). It may give way at a high cost, because a measured state can be
    /// nearer.
    pub clearance: f64,
    /// Number of sweeps for the quadratic program of each linearisation.
    pub sweeps: usize,
    /// Least and largest number of linearisations in a tick. Further ones after the least number are made
    /// only if the budget has time left for one more.
    pub iterations: [usize; 2],
    /// Time budget of a tick (s); infinite without a budget. One sweep is always made.
    pub budget: f64,
    /// Time between the measurement of a state and the use of the plan that is computed from it (s).
    pub latency: f64,
    /// Number of threads of a tick.
    pub threads: usize,
}

impl Default for ArmSettings {
    fn default() -> Self {
        Self {
            horizon: 0.5,
            knot: 0.02,
            weights: ArmWeights::default(),
            limits: PlanLimits::default(),
            obstacles: Vec::new(),
            clearance: 0.02,
            sweeps: 2,
            iterations: [1, 1],
            budget: f64::INFINITY,
            latency: 0.0,
            threads: 1,
        }
    }
}

/// Weights of the costs of an [`ArmMpc`]. Errors are squared: a weight w costs ½ w e² per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ArmWeights {
    /// Weight of the frame's position (m).
    pub position: f64,
    /// Weight of the frame's rotation (rad).
    pub rotation: f64,
    /// Weight of the deviation from the posture (rad).
    pub posture: f64,
    /// Weight of the velocities of the joints (rad/s).
    pub velocity: f64,
    /// Weight of the effort beyond gravity, relative to its limit.
    pub effort: f64,
}

impl Default for ArmWeights {
    fn default() -> Self {
        Self { position: 1e5, rotation: 1e3, posture: 0.1, velocity: 0.1, effort: 1.0 }
    }
}

/// Model predictive controller of an arm. A frame of the arm follows poses in time, and the plan keeps the limits of
/// positions, velocities and efforts.
///
/// ```
/// use condyle_dynamics::{Data, Se3, Vec3, forward_kinematics, robots};
/// use condyle_mpc::{ArmMpc, ArmSettings};
/// let arm = std::sync::Arc::new(robots::arm7());
/// let x = [vec![0.0, 0.4, 0.0, 1.2, 0.0, 0.8, 0.0], vec![0.0; 7]].concat();
/// let begin = forward_kinematics(&arm, &mut Data::new(&arm), &x[..7]).frame(arm.frame("tool")?);
/// let path = |t: f64| Se3 { translation: begin.translation + Vec3::new(0.0, 0.1 * t, 0.0), ..begin };
/// let mut mpc = ArmMpc::new(arm.clone(), "tool", ArmSettings::default())?;
/// mpc.reset(0.0, &x, path)?;
/// let (mut policy, mut tau) = (mpc.policy(), [0.0; 7]);
/// assert!(mpc.update(0.02, &x, path)?.status.is_new());
/// policy.control(0.021, &x, &mut tau);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct ArmMpc {
    planner: Planner,
    poses: Vec<f64>,
    moving: Vec<Moving>,
    /// Scratch: placements of an obstacle at all knots.
    placements: Vec<Se3<f64>>,
}

/// Obstacle that moves with a constant velocity.
#[derive(Clone, Debug)]
struct Moving {
    name: String,
    /// Time at which the obstacle has its placement (s).
    time: f64,
    placement: Se3<f64>,
    /// Velocity of the origin of the placement, and angular velocity, along the world's axes.
    velocity: Motion<f64>,
}

impl Moving {
    /// Returns the placement at the time t.
    fn at(&self, t: f64) -> Se3<f64> {
        let dt = t - self.time;
        let turn = lie::exp3(self.velocity.angular.scale(dt)).to_rotation();
        Se3::new(turn * self.placement.rotation, self.placement.translation + self.velocity.linear.scale(dt))
    }
}

impl ArmMpc {
    /// Creates a controller for a robot with a fixed base, whose frame `frame` follows poses. Allocates.
    ///
    /// # Errors
    /// [`Error::Robot`] for a robot with a free-flyer; [`Error::Optimal`] for a frame that does not exist, an invalid
    /// pair of geometries, or a robot with joints that move no mass; [`Error::Setting`] for an invalid setting.
    pub fn new(model: Arc<Model>, frame: &str, settings: ArmSettings) -> Result<Self, Error> {
        settings.check()?;
        if model.bodies().iter().any(|body| body.joint == Joint::FreeFlyer) {
            let what = format!("`{}` has a free-flyer; expected a fixed base", model.name());
            return Err(Error::Robot { what });
        }
        let (nv, w) = (model.nv(), settings.weights);
        let knots = (settings.horizon / settings.knot).round().max(1.0) as usize;
        let neutral = [condyle_dynamics::neutral(&model), vec![0.0; nv]].concat();
        let weights = [vec![w.position; 3], vec![w.rotation; 3]].concat();
        let pose = Residual::FramePlacement { frame: frame.into(), target: Se3::identity() };
        let pose = Cost::new(POSE, 1.0, pose, Activation::Weighted(weights));
        let weights = [vec![w.posture; nv], vec![w.velocity; nv]].concat();
        let state = Residual::State { reference: neutral.clone() };
        let state = Cost::new("state", 1.0, state, Activation::Weighted(weights));
        let weights = effort_limits(&model, 0).iter().map(|limit| w.effort / (limit * limit)).collect();
        let effort = Cost::new(EFFORT, 1.0, Residual::ControlGravity, Activation::Weighted(weights));
        let mut limits = joint_limits(&model, 0, settings.limits, false);
        limits.extend(apart(&settings));
        let knot = FreeDynamics::running(model.clone(), settings.knot, vec![pose.clone(), state.clone(), effort])?;
        let of_states: Vec<_> = limits.iter().filter(|limit| limit.name != EFFORT).cloned().collect();
        let knot = Box::new(knot.with_limits(limits)?);
        let scaled = |cost: Cost| Cost { weight: settings.knot * cost.weight, ..cost };
        let end = FreeDynamics::terminal(model.clone(), vec![scaled(pose), scaled(state)])?;
        let end = end.with_limits(of_states)?;
        let problem = Problem::new(neutral, vec![knot], vec![0; knots], Box::new(end))?;
        let poses = vec![0.0; POSE_SIZE * (knots + 1)];
        let planner = Planner::new(model, problem, PlanSettings::from(&settings), 0)?;
        Ok(Self { planner, poses, moving: Vec::new(), placements: Vec::new() })
    }

    /// Sets the placement of the obstacle called `name` at the time t (s), and its velocity: of the origin of the
    /// placement, and its angular velocity, along the world's axes. Later ticks plan with the motion at constant
    /// velocity. A call for each measurement of the obstacle corrects it.
    ///
    /// ```
    /// use condyle_dynamics::{Mat3, Motion, Se3, Vec3, robots};
    /// use condyle_mpc::{ArmMpc, ArmSettings};
    /// use condyle_optimal::robot::{Geometry, GeometryPair, Shape};
    /// let tool = Geometry::on("tool", Shape::sphere([0.0; 3], 0.05));
    /// let ball = Geometry::in_world(Shape::sphere([0.0; 3], 0.1)).named("ball");
    /// let settings = ArmSettings { obstacles: vec![GeometryPair::new(tool, ball)], ..ArmSettings::default() };
    /// let mut mpc = ArmMpc::new(std::sync::Arc::new(robots::arm7()), "tool", settings)?;
    /// let at = Se3::new(Mat3::identity(), Vec3::new(0.8, 0.5, 0.4));
    /// mpc.place("ball", 0.0, at, Motion::new(Vec3::new(0.0, -0.3, 0.0), Vec3::zero()))?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite; [`Error::Optimal`] for a matrix that is not a rotation;
    /// [`Error::Robot`] if no pair of the settings has this obstacle.
    pub fn place(&mut self, name: &str, t: f64, placement: Se3<f64>, velocity: Motion<f64>) -> Result<(), Error> {
        Error::check_array("t", &[t], 1)?;
        Error::check_array("velocity", &velocity.to_array(), 6)?;
        let all = vec![placement; self.planner.problem.horizon() + 1];
        if !self.planner.problem.set_placements(name, &all)? {
            return Err(Error::Robot { what: format!("no pair of the obstacles has a geometry called `{name}`") });
        }
        let moving = Moving { name: name.to_owned(), time: t, placement, velocity };
        match self.moving.iter_mut().find(|moving| moving.name == name) {
            Some(old) => *old = moving,
            None => self.moving.push(moving),
        }
        Ok(())
    }

    /// Begins anew at the time t (s) in the state x = (q, v), whose joints are the posture from which the arm deviates
    /// as little as the path allows. `path` returns the pose of the frame at a time (s). Solves the first problem.
    /// Allocates.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite; [`Error::Robot`] if no plan is found.
    pub fn reset(&mut self, t: f64, x: &[f64], path: impl FnMut(f64) -> Se3<f64>) -> Result<&Report, Error> {
        let Self { planner, poses, moving, placements } = self;
        planner.begin(t, x)?;
        let mut posture = planner.x.clone();
        posture[planner.nq()..].fill(0.0);
        planner.problem.set_references("state", &posture.repeat(planner.times.len()))?;
        planner.restart(planner.times[0], TickStatus::Planned, |planner| {
            refer(planner, poses, path)?;
            place(planner, moving, placements)
        })?;
        Ok(&self.planner.report)
    }

    /// Renews the plan for the measured state x = (q, v) at the time t (s). `path` returns the pose of the frame at a
    /// time (s); it is called for each knot. A state that is not finite leaves the plan as it is, and the report says
    /// so. The first call is a [`reset`](Self::reset).
    ///
    /// # Errors
    /// [`Error::Argument`] for a state of another length or a time that is not finite; [`Error::Optimal`] for a pose
    /// that is invalid; [`Error::Time`] if t is before the last call.
    pub fn update(&mut self, t: f64, x: &[f64], mut path: impl FnMut(f64) -> Se3<f64>) -> Result<&Report, Error> {
        let Self { planner, poses, moving, placements } = self;
        planner.check_time(t)?;
        if !planner.is_started {
            return self.reset(t, x, path);
        }
        if planner.accepts(x)? {
            let (begin, start) = (Instant::now(), planner.start(t));
            planner.predict(t, start, x)?;
            planner.measured = t;
            planner.move_to(start)?;
            refer(planner, poses, &mut path)?;
            place(planner, moving, placements)?;
            planner.problem.set_x0(&planner.x)?;
            planner.tick(false, begin, |planner| {
                refer(planner, poses, path)?;
                place(planner, moving, placements)
            })?;
        }
        Ok(&self.planner.report)
    }

    /// Returns a policy that follows the latest plan, for another thread. Allocates.
    pub fn policy(&self) -> Policy {
        self.planner.policy(&self.planner.x[..self.planner.nq()], 0)
    }

    /// Returns the report of the last tick.
    pub fn report(&self) -> &Report {
        &self.planner.report
    }

    /// Returns the solver, with the plan and its multipliers.
    pub fn solver(&self) -> &InteriorPoint {
        &self.planner.solver
    }

    /// Returns the robot.
    pub fn model(&self) -> &Arc<Model> {
        &self.planner.model
    }
}

/// Distance beyond the clearance up to which pairs have derivatives (m); longer than the motion in a step of a plan.
const RANGE: f64 = 0.3;

/// Returns the limit of the distances to obstacles, if there are obstacles.
fn apart(settings: &ArmSettings) -> Option<Limit> {
    let ArmSettings { obstacles: pairs, clearance, .. } = settings;
    let (count, (linear, quadratic)) = (pairs.len(), DISTANCE_WEIGHTS);
    let (lower, upper) = (vec![*clearance; count], vec![f64::INFINITY; count]);
    let limit = || {
        Limit::new("obstacles", Residual::Distances { pairs: pairs.clone(), range: clearance + RANGE }, lower, upper)
    };
    (count > 0).then(|| limit().softened(linear, quadratic))
}

/// Writes the poses of a path at all knots.
fn refer(planner: &mut Planner, poses: &mut [f64], mut path: impl FnMut(f64) -> Se3<f64>) -> Result<(), Error> {
    for (&t, row) in planner.times.iter().zip(poses.chunks_exact_mut(POSE_SIZE)) {
        Target::Placement(path(t)).write(row);
    }
    planner.problem.set_references(POSE, poses)?;
    Ok(())
}

/// Writes the placements of moving obstacles at all knots.
fn place(planner: &mut Planner, moving: &[Moving], placements: &mut Vec<Se3<f64>>) -> Result<(), Error> {
    for obstacle in moving {
        placements.clear();
        placements.extend(planner.times.iter().map(|&t| obstacle.at(t)));
        planner.problem.set_placements(&obstacle.name, placements)?;
    }
    Ok(())
}

impl From<&ArmSettings> for PlanSettings {
    fn from(settings: &ArmSettings) -> Self {
        let &ArmSettings { knot, sweeps, iterations, budget, latency, threads, .. } = settings;
        Self { knot, sweeps, iterations, budget, latency, threads }
    }
}

impl ArmSettings {
    fn check(&self) -> Result<(), Error> {
        PlanSettings::from(self).check(self.horizon)?;
        check_at_least("clearance", self.clearance)?;
        let w = &self.weights;
        let weights = [w.position, w.rotation, w.posture, w.velocity, w.effort];
        weights.into_iter().try_for_each(|weight| check_at_least("weights", weight))
    }
}
