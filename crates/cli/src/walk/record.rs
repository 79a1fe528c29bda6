//! Walk of a robot in the simulation: control, record, and what the record says.

use super::feet::FoundFoot;
use crate::error::Error;
use crate::watch;
use condyle::mpc::{Command, Gait, Report, Settings, WholeBodyMpc};
use condyle::simulation::{Ground, Settings as SimulationSettings, Simulation};
use condyle::spatial::Quaternion;
use condyle::{Data, Force, Model, Vec3, forward_kinematics};
use std::sync::Arc;
use std::time::Instant;

/// Time step of the simulation and of the policy (s), and its inverse (Hz).
pub(crate) const STEP: f64 = 1e-3;
/// Number of time steps between two recorded states.
const EVERY: usize = 20;
/// Limits that define a fall: the tilt of the trunk (rad), and its height relative to the stand.
const TILTED: f64 = 0.8;
const LOW: f64 = 0.55;
/// Speed of a joint beyond which the simulated motion has no meaning (rad/s, m/s).
const RUNAWAY: f64 = 1e4;
/// Duration of a push (s).
const PUSH_TIME: f64 = 0.1;
/// Time after the command has reached its final value, from which mean velocities are computed (s).
const SETTLING: f64 = 1.0;

/// Horizontal push of the trunk, with a constant force for 0.1 s.
#[derive(Clone, Copy)]
pub(crate) struct Push {
    /// Impulse (N s).
    pub impulse: f64,
    /// Direction (degrees): 0 is along the axis x of the world, 90 along y.
    pub angle: f64,
    /// Time at which the push begins (s).
    pub at: f64,
}

impl Push {
    /// Returns the force at the time t, along the axes of the world (N).
    fn force(&self, t: f64) -> Vec3<f64> {
        let is_on = t >= self.at && t < self.at + PUSH_TIME;
        let (sin, cos) = self.angle.to_radians().sin_cos();
        Vec3::new(cos, sin, 0.0).scale(if is_on { self.impulse / PUSH_TIME } else { 0.0 })
    }
}

/// Request: robot, feet, stand, and how it walks.
pub(crate) struct Request<'a> {
    pub model: &'a Arc<Model>,
    pub feet: &'a [FoundFoot],
    /// Position in which the walk begins, nq numbers.
    pub q: &'a [f64],
    pub gait: Gait,
    pub settings: Settings,
    pub command: Command,
    pub seconds: f64,
    /// Number of ticks per second.
    pub rate: f64,
    /// Coefficient of friction of the ground.
    pub ground_friction: f64,
    pub push: Option<Push>,
}

/// Computing time of a tick.
pub(crate) struct Tick {
    pub time: f64,
    /// Time of the whole tick, of its references, and of the solver (ms).
    pub total_ms: f64,
    pub references_ms: f64,
    pub solve_ms: f64,
}

/// Record of a walk: N + 1 states, and the intervals between them.
pub(crate) struct Walk {
    pub times: Vec<f64>,
    pub states: Vec<Vec<f64>>,
    /// Efforts at the beginning of each interval, nv numbers (N m, N).
    pub efforts: Vec<Vec<f64>>,
    /// Mean force of the ground on each foot in each interval, along the axes of the world (N).
    pub forces: Vec<Vec<Vec3<f64>>>,
    /// Mean velocity of the trunk in each interval, along its heading: forwards, to the left (m/s), turning (rad/s).
    pub velocities: Vec<[f64; 3]>,
    /// Commanded velocity in each interval, which approaches the request with limited accelerations.
    pub commands: Vec<[f64; 3]>,
    pub ticks: Vec<Tick>,
    /// Largest tilt of the trunk (rad).
    pub tilt: f64,
    /// Time and description of a fall.
    pub fall: Option<(f64, String)>,
}

/// Velocity and tilt of the trunk.
struct Trunk {
    /// Velocity along the heading: forwards, to the left (m/s), turning (rad/s).
    velocity: [f64; 3],
    /// Angle between the axes z of the trunk and of the world (rad).
    tilt: f64,
}

impl Trunk {
    fn new(q: &[f64], v: &[f64]) -> Self {
        let rotation = Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation();
        let [ahead, _, up] = rotation.columns();
        let linear = rotation * Vec3::new(v[0], v[1], v[2]);
        let angular = rotation * Vec3::new(v[3], v[4], v[5]);
        let (sin, cos) = ahead.y.atan2(ahead.x).sin_cos();
        let velocity = [cos * linear.x + sin * linear.y, cos * linear.y - sin * linear.x, angular.z];
        Self { velocity, tilt: up.z.clamp(-1.0, 1.0).acos() }
    }
}

/// Returns the ground, with a point for each ball and four points for each sole, and the foot of each point. The ground
/// is level. A ball touches it when its centre is as high as its radius.
fn ground(request: &Request<'_>) -> (Ground, Vec<usize>) {
    let (model, feet) = (request.model, request.feet);
    let height = feet.iter().map(FoundFoot::height).fold(f64::INFINITY, f64::min);
    let mut data = Data::new(model);
    let placements = forward_kinematics(model, &mut data, request.q);
    let mut ground = Ground { friction: request.ground_friction, height, ..Ground::default() };
    let mut owners = Vec::new();
    for (k, foot) in feet.iter().enumerate() {
        let corners = match foot.sole() {
            Some([x, y]) => {
                let corners = [(0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5)];
                corners.map(|(a, b)| Vec3::new(a * x, b * y, height)).to_vec()
            }
            // With balls of several sizes, the points of larger balls are below their centres in the stand.
            None => {
                let down = Vec3::new(0.0, 0.0, height - foot.height());
                vec![placements.frame(foot.frame).rotation.transpose() * down]
            }
        };
        owners.extend(corners.iter().map(|_| k));
        ground = ground.with_sole(foot.frame, &corners);
    }
    (ground, owners)
}

/// Simulates a walk until its time is over, the robot falls, or the user presses Ctrl-C.
pub(crate) fn simulate(request: &Request<'_>) -> Result<Walk, Error> {
    let Request { model, feet, .. } = *request;
    let (nq, nv) = (model.nq(), model.nv());
    let list: Vec<_> = feet.iter().map(|foot| foot.foot.clone()).collect();
    let mut mpc = WholeBodyMpc::new(model.clone(), &list, request.gait.clone(), request.settings.clone())?;
    let mut x = [request.q, &vec![0.0; nv]].concat();
    mpc.reset(0.0, &x)?;
    mpc.command(request.command)?;
    let mut policy = mpc.policy();
    let settings = SimulationSettings { dt: STEP, ..SimulationSettings::default() };
    let mut simulation = Simulation::new(model.clone(), settings);
    let (ground, owners) = ground(request);
    simulation.set_ground(ground)?;
    simulation.set_state(request.q, &x[nq..])?;
    let (mut tau, mut pushed) = (vec![0.0; nv], vec![Force::zero(); model.nodes().len()]);
    let steps = (request.seconds / STEP).round() as usize;
    let bar = watch::bar(steps as u64, "walks");
    let mut walk = Walk::new();
    let mut interval = Interval::new(feet.len());
    for step in 0..steps {
        let t = step as f64 * STEP;
        x[..nq].copy_from_slice(simulation.q());
        x[nq..].copy_from_slice(simulation.v());
        let is_due = |step: usize| (step as f64 * STEP * request.rate + 1e-9).floor();
        if step > 0 && is_due(step) > is_due(step - 1) {
            walk.tick(t, &mut mpc, &x)?;
        }
        policy.control(t, &x, &mut tau[6..]);
        if step.is_multiple_of(EVERY) {
            if step > 0 {
                walk.close(&mut interval, mpc.report());
            }
            walk.open(t, &x, &tau);
            bar.set_position(step as u64);
            if watch::interrupted() {
                break;
            }
        }
        let trunk = Trunk::new(&x[..nq], &x[nq..]);
        walk.tilt = walk.tilt.max(trunk.tilt);
        if let Some(push) = &request.push {
            // The force acts at the centre of mass of the trunk, and its coordinates are along the axes of the trunk.
            let linear = Quaternion::new(x[3], x[4], x[5], x[6]).to_rotation().transpose_mul(push.force(t));
            let inertia = &model.bodies()[1].inertia;
            let angular = inertia.mass_com.scale(1.0 / inertia.mass.max(f64::MIN_POSITIVE)).cross(linear);
            pushed[1] = Force { linear, angular };
        }
        let status = simulation.step(&tau, if request.push.is_some() { &pushed } else { &[] });
        walk.fall = if !status.is_taken() {
            Some((t, format!("the simulation stopped: {status}")))
        } else if let Some(what) = runaway(model, simulation.v()) {
            Some((t, what))
        } else if trunk.tilt > TILTED {
            Some((t, format!("the trunk is tilted by {:.0}°", trunk.tilt.to_degrees())))
        } else if x[2] < LOW * request.q[2] {
            Some((t, format!("the trunk is {:.2} m above the ground", x[2])))
        } else {
            None
        };
        if walk.fall.is_some() {
            break;
        }
        interval.add(&trunk, simulation.contacts().iter().map(|contact| contact.force).zip(owners.iter().copied()));
    }
    if interval.steps > 0 || walk.states.len() == walk.forces.len() {
        walk.close(&mut interval, mpc.report());
        x[..nq].copy_from_slice(simulation.q());
        x[nq..].copy_from_slice(simulation.v());
        walk.end(simulation.time(), &x);
    }
    bar.finish_and_clear();
    Ok(walk)
}

/// Describes a joint whose speed has no meaning, if there is one.
fn runaway(model: &Model, v: &[f64]) -> Option<String> {
    let fastest = (6..v.len()).max_by(|&a, &b| v[a].abs().total_cmp(&v[b].abs()))?;
    let body = model.bodies().iter().find(|body| (body.idx_v..body.idx_v + body.joint.nv()).contains(&fastest))?;
    let (name, speed) = (&body.joint_name, v[fastest].abs());
    let what = format!("joint `{name}` moves at {speed:.0e} rad/s: check the inertias and effort limits of its links");
    (speed >= RUNAWAY || speed.is_nan()).then_some(what)
}

/// Sums over the time steps since the last recorded state.
struct Interval {
    steps: usize,
    forces: Vec<Vec3<f64>>,
    velocity: [f64; 3],
}

impl Interval {
    fn new(feet: usize) -> Self {
        Self { steps: 0, forces: vec![Vec3::zero(); feet], velocity: [0.0; 3] }
    }

    /// Adds a time step. `forces` are the forces of points, each with the index of its foot.
    fn add(&mut self, trunk: &Trunk, forces: impl Iterator<Item = (Vec3<f64>, usize)>) {
        self.steps += 1;
        forces.for_each(|(force, foot)| self.forces[foot] += force);
        self.velocity.iter_mut().zip(trunk.velocity).for_each(|(sum, v)| *sum += v);
    }
}

impl Walk {
    fn new() -> Self {
        Self {
            times: vec![],
            states: vec![],
            efforts: vec![],
            forces: vec![],
            velocities: vec![],
            commands: vec![],
            ticks: vec![],
            tilt: 0.0,
            fall: None,
        }
    }

    /// Renews the plan, and records the computing time.
    fn tick(&mut self, time: f64, mpc: &mut WholeBodyMpc, x: &[f64]) -> Result<(), Error> {
        let begin = Instant::now();
        let report = mpc.update(time, x)?;
        let [references_ms, solve_ms] = [report.references, report.solve].map(|part| 1e3 * part.as_secs_f64());
        let total_ms = 1e3 * begin.elapsed().as_secs_f64();
        self.ticks.push(Tick { time, total_ms, references_ms, solve_ms });
        Ok(())
    }

    /// Begins an interval.
    fn open(&mut self, time: f64, x: &[f64], tau: &[f64]) {
        self.times.push(time);
        self.states.push(x.to_vec());
        self.efforts.push(tau.to_vec());
    }

    /// Ends an interval: writes its mean values, and clears the sums.
    fn close(&mut self, interval: &mut Interval, report: &Report) {
        let mean = 1.0 / interval.steps.max(1) as f64;
        self.forces.push(interval.forces.iter().map(|force| force.scale(mean)).collect());
        self.velocities.push(interval.velocity.map(|sum| mean * sum));
        self.commands.push(report.command);
        *interval = Interval::new(interval.forces.len());
    }

    /// Writes the state at the end of the walk, after the last interval.
    fn end(&mut self, time: f64, x: &[f64]) {
        self.times.push(time);
        self.states.push(x.to_vec());
    }

    /// Returns the number of intervals.
    pub(crate) fn intervals(&self) -> usize {
        self.forces.len()
    }

    /// Returns the duration of the walk (s).
    pub(crate) fn duration(&self) -> f64 {
        self.times.last().copied().unwrap_or(0.0)
    }

    /// Returns the mean velocity along the heading, and the time since which it is computed (s): 1 s after the command
    /// has reached its final value, or the second half of a shorter walk.
    pub(crate) fn mean_velocity(&self, command: Command) -> ([f64; 3], f64) {
        let reached = self.commands.iter().position(|now| *now == command.to_array());
        let settled = reached.map(|k| self.times[k] + SETTLING).filter(|t| t + SETTLING <= self.duration());
        let since = settled.unwrap_or(0.5 * self.duration());
        let first = self.times.partition_point(|t| *t < since - 1e-9).min(self.velocities.len());
        let chosen = &self.velocities[first..];
        let mean = |k: usize| chosen.iter().map(|v| v[k]).sum::<f64>() / chosen.len().max(1) as f64;
        ([mean(0), mean(1), mean(2)], since)
    }

    /// Returns the median and the 99th percentile of the ticks' times (ms), and the number of ticks above the budget.
    pub(crate) fn tick_times(&self, budget_ms: f64) -> (f64, f64, usize) {
        let mut times: Vec<f64> = self.ticks.iter().map(|tick| tick.total_ms).collect();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times.get((share * times.len() as f64) as usize).or(times.last()).copied().unwrap_or(0.0);
        (at(0.5), at(0.99), times.iter().filter(|time| **time > budget_ms).count())
    }
}
