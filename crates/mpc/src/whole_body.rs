//! Controller of a walking robot: each tick renews a plan of whole-body motion and contact forces.

use crate::command::Command;
use crate::knots::{EFFORT, KnotMaker, STATE, solver_of, swing_name, tilt_name, write_times};
use crate::landing::change_swings;
use crate::policy::Policy;
use crate::references::{PlanarPose, Stand, Walk};
use crate::report::{Report, TickStatus};
use crate::schedule::FootSchedule;
use crate::{Error, Foot, Gait, Settings, Terrain};
use condyle_dynamics::{Data, Model, Vec3, forward_kinematics};
use condyle_optimal::robot::ContactDynamics;
use condyle_optimal::{ActionModel, InteriorPoint, PolicyPublisher, Problem, Schedule, Status};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time for which the robot stands before its first step (s).
const FIRST_STAND: f64 = 0.2;
/// Difference below which two times are equal (s).
const SAME_TIME: f64 = 1e-6;
/// Most feet of a robot: a stance has a bit for each.
const MOST_FEET: usize = 16;

/// Model predictive controller of a walking robot. A tick plans the motion of the whole body and the contact forces
/// over a horizon, under the limits of the robot and of friction. A [`Policy`] follows the plan at a higher rate, also
/// in another thread.
///
/// The plan is an optimal control problem with a knot for each time step. The schedule of the gait gives the contacts
/// of each knot. The costs are the deviations of the trunk from its path, of the joints from the stand, and of swinging
/// feet from their paths to the next footholds. The [interior point](InteriorPoint::tick) makes one linearisation in
/// each tick.
///
/// ```
/// use condyle_dynamics::robots;
/// use condyle_mpc::{Command, Foot, Gait, Pattern, Settings, WholeBodyMpc};
/// let quadruped = std::sync::Arc::new(robots::quadruped());
/// let feet = ["LF_foot", "RF_foot", "LH_foot", "RH_foot"].map(|name| Foot::point(name, 0.6, 0.0));
/// let mut mpc = WholeBodyMpc::new(quadruped, &feet, Gait::in_turn(Pattern::Trot, 0.24, 0.04), Settings::default())?;
/// let mut x = vec![0.0, 0.0, 0.5354, 0.0, 0.0, 0.0, 1.0]; // the pose of the trunk, then the joints
/// x.extend([0.0, 0.7, -1.4, 0.0, -0.7, 1.4, 0.0, 0.7, -1.4, 0.0, -0.7, 1.4]);
/// x.extend([0.0; 18]);
/// mpc.reset(0.0, &x)?;
/// mpc.command(Command { vx: 0.3, ..Command::default() })?;
/// let (mut policy, mut tau) = (mpc.policy(), [0.0; 12]);
/// assert!(mpc.update(0.02, &x)?.status.is_new());
/// policy.control(0.021, &x, &mut tau);
/// assert!(tau.iter().all(|tau| tau.is_finite()));
/// # Ok::<(), condyle_mpc::Error>(())
/// ```
///
/// Sources: Farshidian and others, *An efficient optimal planning and control framework for quadrupedal locomotion*
/// (2017), for schedules of contacts in time; Raibert, *Legged robots that balance* (1986), for footholds.
#[derive(Debug)]
pub struct WholeBodyMpc {
    model: Arc<Model>,
    data: Data<f64>,
    walk: Walk,
    gait: Gait,
    frames: Vec<usize>,
    /// Names of the costs of each foot: of its swing and its tilt.
    names: Vec<[String; 2]>,
    /// Stances, with one model of the problem for each.
    stances: Vec<u32>,
    /// Efforts that hold the robot still in each stance.
    still: Vec<Vec<f64>>,
    problem: Problem,
    solver: InteriorPoint,
    publisher: PolicyPublisher,
    schedule: FootSchedule,
    knots: Schedule,
    /// Time of knot 0 (s), and times of all knots.
    times: Vec<f64>,
    knot_models: Vec<usize>,
    durations: Vec<f64>,
    /// Rows of references, and positions of feet.
    rows: Vec<f64>,
    places: Vec<Vec3<f64>>,
    /// State with which the plan begins: the measured one, or its prediction.
    x: Vec<f64>,
    /// Whether there is a plan.
    is_started: bool,
    /// Times of the last change of the horizon, and of the last measurement; time between two measurements (s).
    last: f64,
    measured: f64,
    period: f64,
    /// Time of the measurement for which a tick is prepared (s).
    prepared: Option<f64>,
    /// Whether contacts are reported, so that the problem has models for early and late landings.
    is_touching: bool,
    /// Feet that touch the ground, one bit for each foot, as reported for the next tick.
    touching: Option<u32>,
    /// Feet that stood at the last tick, one bit for each foot.
    stood: u32,
    report: Report,
}

impl WholeBodyMpc {
    /// Creates a controller for a robot with a free-flyer at its root. Allocates.
    ///
    /// # Errors
    /// [`Error::Robot`] for a robot without a free-flyer; [`Error::Foot`] for a foot that does not fit the robot;
    /// [`Error::Gait`] for a gait that does not fit the feet; [`Error::Setting`] for an invalid setting.
    pub fn new(model: Arc<Model>, feet: &[Foot], gait: Gait, settings: Settings) -> Result<Self, Error> {
        settings.check()?;
        KnotMaker::check_root(&model)?;
        if feet.is_empty() || feet.len() > MOST_FEET {
            return Err(Error::Robot { what: format!("{} feet: expected 1 to {MOST_FEET}", feet.len()) });
        }
        let mut frames = Vec::new();
        for (k, foot) in feet.iter().enumerate() {
            foot.check()?;
            if feet[..k].iter().any(|other| other.frame == foot.frame) {
                return Err(Error::Foot { foot: foot.frame.clone(), what: "it is listed twice".to_owned() });
            }
            frames.push(foot.contact(&model, settings.knot)?.constraint.frame);
        }
        let x = [condyle_dynamics::neutral(&model), vec![0.0; model.nv()]].concat();
        let (count, horizon, nv) = (feet.len(), settings.knots(), model.nv());
        let stand = Stand { x: x.clone(), feet: vec![Vec3::zero(); count], height: 0.0 };
        let walk = Walk {
            stand,
            feet: feet.to_vec(),
            command: Command::default(),
            goal: Command::default(),
            raised: 0.0,
            pose: PlanarPose::default(),
            given_terrain: None,
            terrain: Terrain { height: 0.0, slope: [0.0; 2] },
            placed: vec![Vec3::zero(); count],
            lifted: vec![Vec3::zero(); count],
            stance: 0,
            lowered: vec![0.0; count],
            settings,
        };
        let full = (1 << count) - 1;
        let maker = KnotMaker { model: &model, feet, settings: &walk.settings };
        let problem = problem_of(&maker, &[full], &x)?;
        let cycle = Gait::Stand.cycle(feet, &walk.placed)?;
        Ok(Self {
            data: Data::new(&model),
            gait,
            frames,
            names: feet.iter().map(|foot| [swing_name(foot), tilt_name(foot)]).collect(),
            stances: vec![full],
            still: Vec::new(),
            solver: solver_of(&problem, walk.settings.threads, walk.settings.budget),
            publisher: PolicyPublisher::new(&problem)?,
            problem,
            schedule: FootSchedule::new(cycle, count, 0.0),
            knots: Schedule::new(walk.settings.knot, 0)?,
            times: vec![0.0; horizon + 1],
            knot_models: vec![0; horizon],
            durations: vec![walk.settings.knot; horizon],
            rows: vec![0.0; (horizon + 1) * (model.nq() + nv)],
            places: vec![Vec3::zero(); count],
            x,
            is_started: false,
            last: f64::NEG_INFINITY,
            measured: f64::NEG_INFINITY,
            period: walk.settings.knot,
            prepared: None,
            is_touching: false,
            touching: None,
            stood: full,
            report: Report::none(count),
            walk,
            model,
        })
    }

    /// Begins anew at the time t (s) with a robot that stands in the state x = (q, v). This state defines the stand:
    /// its joints are the posture to which the robot returns, and its feet are on the ground. Solves the first problem.
    /// Allocates, and takes as long as several ticks.
    ///
    /// # Errors
    /// [`Error::Argument`] for a state or a time that is not finite; [`Error::Gait`] if the gait does not fit the
    /// positions of the feet; [`Error::Robot`] if no plan is found.
    pub fn reset(&mut self, t: f64, x: &[f64]) -> Result<&Report, Error> {
        let (nq, nv) = (self.model.nq(), self.model.nv());
        Error::check_array("x", x, nq + nv)?;
        Error::check_array("t", &[t], 1)?;
        self.x.copy_from_slice(x);
        condyle_dynamics::normalize(&self.model, &mut self.x[..nq]);
        self.find_feet();
        let pose = PlanarPose::of(&self.x);
        let back = PlanarPose { heading: -pose.heading, ..pose };
        let walk = &mut self.walk;
        walk.stand.x.copy_from_slice(&self.x);
        walk.stand.x[nq..].fill(0.0);
        for (foot, place) in self.places.iter().enumerate() {
            let [dx, dy] = back.turned([place.x - pose.x, place.y - pose.y]);
            walk.stand.feet[foot] = Vec3::new(dx, dy, place.z - self.x[2]);
        }
        let below: f64 = walk.stand.feet.iter().zip(&walk.feet).map(|(p, foot)| p.z - foot.height()).sum();
        walk.stand.height = -below / self.places.len() as f64;
        walk.placed.copy_from_slice(&self.places);
        walk.lifted.copy_from_slice(&self.places);
        (walk.command, walk.pose, walk.raised) = (Command::default(), pose, 0.0);
        walk.stance = (1 << self.places.len()) - 1;
        walk.lowered.fill(0.0);
        (self.touching, self.stood) = (None, walk.stance);
        let start = t + self.walk.settings.latency;
        self.start_schedule(start)?;
        self.is_started = false;
        self.plan_anew(start)?;
        (self.last, self.measured, self.prepared) = (t, t, None);
        Ok(&self.report)
    }

    /// Starts the schedule with a short stand, followed by the gait.
    fn start_schedule(&mut self, start: f64) -> Result<(), Error> {
        let cycle = self.gait.cycle(&self.walk.feet, &self.walk.stand.feet)?;
        self.add_stances(&cycle)?;
        self.knots = Schedule::new(self.walk.settings.knot, 0)?;
        self.schedule = FootSchedule::new(cycle, self.places.len(), start + FIRST_STAND);
        Ok(())
    }

    /// Creates models for the stances of a gait that have none yet. If there are any, the problem is made anew, and the
    /// plan is moved to the new problem.
    fn add_stances(&mut self, cycle: &crate::gait::Cycle) -> Result<(), Error> {
        let before = self.stances.len();
        let probe = FootSchedule::of_cycle(cycle.clone(), self.places.len());
        for t in probe.events() {
            let stance = probe.stance(t);
            // with reports of contacts, each foot in the air may stand
            let (full, stances) = ((1 << self.places.len()) - 1, &mut self.stances);
            let most = if self.is_touching { full } else { stance };
            for stance in (stance..=most).filter(|other| other & stance == stance) {
                if !stances.contains(&stance) {
                    stances.push(stance);
                }
            }
        }
        if self.stances.len() == before && !self.still.is_empty() {
            return Ok(());
        }
        let maker = KnotMaker { model: &self.model, feet: &self.walk.feet, settings: &self.walk.settings };
        let stand = &self.walk.stand.x;
        self.still.clear();
        for &stance in &self.stances {
            self.still.push(maker.knot(stance)?.quasi_static(stand));
        }
        let mut problem = problem_of(&maker, &self.stances, stand)?;
        if self.is_started {
            problem.set_knots(&self.knot_models, &self.durations)?;
            problem.set_x0(self.problem.x0())?;
        }
        let mut solver = solver_of(&problem, self.walk.settings.threads, self.walk.settings.budget);
        if self.is_started {
            let plan = self.solver.solution();
            let (xs, us) = (plan.xs.clone(), plan.us.clone());
            solver.settings.max_iterations = 0;
            solver.solve(&mut problem, &xs, &us)?;
            solver.settings.max_iterations = self.solver.settings.max_iterations;
        }
        (self.problem, self.solver) = (problem, solver);
        Ok(())
    }

    /// Writes the positions of the feet in the state `self.x`.
    fn find_feet(&mut self) {
        let placements = forward_kinematics(&self.model, &mut self.data, &self.x[..self.model.nq()]);
        for (place, &frame) in self.places.iter_mut().zip(&self.frames) {
            *place = placements.frame(frame).translation;
        }
    }

    /// Solves the problem at the time `start` from the state `self.x` alone: the robot stands still on the feet of the
    /// schedule.
    fn plan_anew(&mut self, start: f64) -> Result<(), Error> {
        let begin = Instant::now();
        self.arrange(start);
        self.problem.set_knots(&self.knot_models, &self.durations)?;
        self.refer()?;
        self.problem.set_x0(&self.x)?;
        let xs = self.x.repeat(self.knot_models.len() + 1);
        let us = self.problem.quasi_static(&xs)?;
        let references = begin.elapsed();
        let plan = self.solver.solve(&mut self.problem, &xs, &us)?;
        let (status, is_finite) = (plan.status, plan.status != Status::NotFinite);
        let solve = begin.elapsed() - references;
        if !is_finite {
            return Err(Error::Robot { what: format!("no plan from this state: {status:?}") });
        }
        self.publisher.publish(&self.problem, self.solver.solution(), start)?;
        self.write_report(TickStatus::Restarted, start, [references, solve]);
        self.is_started = true;
        Ok(())
    }

    /// Extends the schedule, and writes the knots of a horizon that begins at the time `start`.
    fn arrange(&mut self, start: f64) {
        let until = start + self.walk.settings.horizon + 2.0 * self.walk.settings.knot;
        let stances = &self.stances;
        let index = |stance: u32| stances.iter().position(|other| *other == stance).unwrap_or(0);
        self.schedule.extend(start, until, &mut self.knots, index);
        self.knots.write_knots(start, &mut self.knot_models, &mut self.durations);
        write_times(start, &self.durations, &mut self.times);
    }

    /// Writes all references.
    fn refer(&mut self) -> Result<(), Error> {
        let (nq, nx) = (self.model.nq(), self.model.nq() + self.model.nv());
        let begin = self.times[0];
        let rows = &mut self.rows[..(self.times.len()) * nx];
        for (t, row) in self.times.iter().zip(rows.chunks_exact_mut(nx)) {
            self.walk.write_state(t - begin, nq, row);
        }
        self.problem.set_references(STATE, rows)?;
        let nu = self.model.nv() - 6;
        let rows = &mut self.rows[..self.times.len() * nu];
        for (&model, row) in self.knot_models.iter().zip(rows.chunks_exact_mut(nu)) {
            row.copy_from_slice(&self.still[model]);
        }
        self.problem.set_references(EFFORT, rows)?;
        let velocity = self.velocity();
        let rows = &mut self.rows[..self.times.len() * 3];
        for foot in 0..self.places.len() {
            let [swing, tilt] = &self.names[foot];
            if !self.walk.write_swing(foot, &self.schedule, &self.times, &self.x, velocity, rows) {
                continue;
            }
            self.problem.set_references(swing, rows)?;
            if self.walk.feet[foot].is_sole() {
                for (t, row) in self.times.iter().zip(rows.chunks_exact_mut(3)) {
                    self.walk.write_vertical(t - begin, row);
                }
                self.problem.set_references(tilt, rows)?;
            }
        }
        Ok(())
    }

    /// Returns the horizontal velocity of the trunk in the state `self.x`, along the world's axes (m/s).
    fn velocity(&self) -> [f64; 2] {
        let (q, v) = self.x.split_at(self.model.nq());
        let quaternion = condyle_dynamics::Quaternion::new(q[3], q[4], q[5], q[6]);
        let velocity = quaternion.to_rotation() * Vec3::new(v[0], v[1], v[2]);
        [velocity.x, velocity.y]
    }

    /// Renews the plan for the measured state x = (q, v) at the time t (s). After [`prepare`](Self::prepare) for this
    /// time, only the part remains that depends on the state. Allocates nothing. A state that is not finite
    /// leaves the plan as it is, and the report says so. The first call is a [`reset`](Self::reset).
    ///
    /// # Errors
    /// [`Error::Argument`] for a state of another length or a time that is not finite; [`Error::Time`] if t is before
    /// the last call; at the first call, the errors of [`reset`](Self::reset).
    pub fn update(&mut self, t: f64, x: &[f64]) -> Result<&Report, Error> {
        Error::check_array("t", &[t], 1)?;
        if t < self.measured {
            return Err(Error::Time { t, last: self.measured });
        }
        if !self.is_started {
            return self.reset(t, x);
        }
        if x.len() == self.x.len() && x.iter().any(|x| !x.is_finite()) {
            self.report.status = TickStatus::InvalidState;
            return Ok(&self.report);
        }
        Error::check_array("x", x, self.x.len())?;
        let begin = Instant::now();
        let start = (t + self.walk.settings.latency).max(self.times[0]);
        let is_prepared = self.prepared.take().is_some_and(|prepared| (prepared - t).abs() < SAME_TIME);
        let is_prepared = !self.change_swings(t, start) && is_prepared;
        self.predict(t, start, x)?;
        if !is_prepared {
            self.renew(t, start)?;
            self.problem.set_x0(&self.x)?;
        }
        self.period = t - self.measured;
        (self.measured, self.stood) = (t, self.walk.stance);
        let references = begin.elapsed();
        let plan = match is_prepared {
            true => self.solver.feedback(&mut self.problem, &self.x)?,
            false => self.solver.tick(&mut self.problem, self.walk.settings.sweeps)?,
        };
        if !plan.is_executable() {
            if self.plan_anew(start).is_err() {
                self.report.status = TickStatus::Failed;
            }
            return Ok(&self.report);
        }
        let status = if plan.fallback.is_none() { TickStatus::Planned } else { TickStatus::Fallback };
        self.publisher.publish(&self.problem, self.solver.solution(), start)?;
        let solve = begin.elapsed() - references;
        self.write_report(status, start, [references, solve]);
        Ok(&self.report)
    }

    /// Makes the part of the next [`update`](Self::update) that does not depend on the measured state, before the state
    /// arrives: references and the first sweeps, along the predicted state. `t` is the time of the next measurement
    /// (s); with `None`, it follows after the last period. An update at another time makes the whole tick again.
    /// Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Robot`] before the first plan; [`Error::Time`] for a time before the last call.
    pub fn prepare(&mut self, t: Option<f64>) -> Result<(), Error> {
        if !self.is_started {
            return Err(Error::Robot { what: "there is no plan yet".to_owned() });
        }
        let t = t.unwrap_or(self.measured + self.period);
        Error::check_array("t", &[t], 1)?;
        if t < self.measured {
            return Err(Error::Time { t, last: self.measured });
        }
        let start = (t + self.walk.settings.latency).max(self.times[0]);
        let begin = self.times[0];
        let plan = self.solver.solution();
        plan.predict(&mut self.problem, plan.x(0), 0.0, start - begin, &mut self.x)?;
        self.renew(t, start)?;
        self.solver.prepare(&mut self.problem, self.walk.settings.sweeps)?;
        self.prepared = Some(t);
        Ok(())
    }

    /// Moves the horizon to the time `start`, and writes references for the state `self.x` then. `t` is the time of the
    /// measurement.
    fn renew(&mut self, t: f64, start: f64) -> Result<(), Error> {
        self.find_feet();
        self.walk.observe(&self.places, self.schedule.stance(start), &self.x, (t - self.last).max(0.0));
        self.last = t;
        let elapsed = start - self.times[0];
        self.arrange(start);
        self.solver.retime(&mut self.problem, elapsed, &self.knot_models, &self.durations)?;
        self.refer()
    }

    /// Changes the swings for the reported contacts, if there are any. Returns whether a swing was changed.
    fn change_swings(&mut self, t: f64, start: f64) -> bool {
        let Some(touching) = self.touching.take() else { return false };
        let (stances, knot) = (&self.stances, self.walk.settings.knot);
        let times = [start, t - self.measured, knot];
        let is_stance = |stance| stances.contains(&stance);
        let changed = change_swings(&mut self.walk, &mut self.schedule, [touching, self.stood], times, is_stance);
        if changed {
            let index = |stance: u32| stances.iter().position(|other| *other == stance).unwrap_or(0);
            self.schedule.rewrite(start, &mut self.knots, index);
        }
        changed
    }

    /// Writes the state at the time `start` to `self.x`: the measured state x at the time t, moved by the dynamics
    /// under the plan until then.
    fn predict(&mut self, t: f64, start: f64, x: &[f64]) -> Result<(), Error> {
        self.x.copy_from_slice(x);
        let nq = self.model.nq();
        condyle_dynamics::normalize(&self.model, &mut self.x[..nq]);
        if start > t {
            let (plan, begin) = (self.solver.solution(), self.times[0]);
            plan.predict(&mut self.problem, x, t - begin, start - begin, &mut self.x)?;
        }
        Ok(())
    }

    fn write_report(&mut self, status: TickStatus, time: f64, durations: [Duration; 2]) {
        let report = &mut self.report;
        report.write(status, time, self.solver.solution(), durations);
        report.command = self.walk.command.to_array();
        for (foot, stands) in report.stands.iter_mut().enumerate() {
            *stands = self.walk.stance & (1 << foot) != 0;
        }
    }

    /// Sets the commanded velocity of the trunk. The velocity changes with at most the accelerations of the settings.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite.
    pub fn command(&mut self, command: Command) -> Result<(), Error> {
        command.check()?;
        self.walk.goal = command;
        Ok(())
    }

    /// Sets the height of the trunk, relative to the stand (m).
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite.
    pub fn set_height(&mut self, raised: f64) -> Result<(), Error> {
        Error::check_array("height", &[raised], 1)?;
        self.walk.raised = raised;
        Ok(())
    }

    /// Changes the gait as soon as all feet that are in the air have landed. No other foot leaves the ground before.
    /// Allocates if the gait has stances that no earlier gait had.
    ///
    /// # Errors
    /// [`Error::Gait`] for a gait that does not fit the feet.
    pub fn set_gait(&mut self, gait: Gait) -> Result<(), Error> {
        if self.is_started {
            let cycle = gait.cycle(&self.walk.feet, &self.walk.stand.feet)?;
            self.add_stances(&cycle)?;
            let now = self.last + self.walk.settings.latency;
            let stances = &self.stances;
            let index = |stance: u32| stances.iter().position(|other| *other == stance).unwrap_or(0);
            self.schedule.change(cycle, now, &mut self.knots, index);
        }
        self.gait = gait;
        Ok(())
    }

    /// Reports which feet touch the ground, as measured at the time of the next [`update`](Self::update), one entry for
    /// each foot. Later updates need reports of their own. Without reports, feet land when the schedule says so.
    ///
    /// - A foot that touches after half of its swing has landed: it stands from then on, where it is.
    /// - A foot that does not touch at the end of its swing swings on, and its foothold is lowered at 0.8 m/s, by at
    ///   most 0.06 m. The foot counts as standing before that if the other feet are no stance of the gait.
    ///
    /// Other swings stay as the schedule has them. The first call makes models for all stances that early landings can
    /// lead to, and allocates.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one entry for each foot.
    pub fn touch(&mut self, feet: &[bool]) -> Result<(), Error> {
        if feet.len() != self.places.len() {
            let what = format!("expected {} feet, found {}", self.places.len(), feet.len());
            return Err(Error::Argument { name: "feet", what });
        }
        let mask = feet.iter().enumerate().fold(0, |mask, (foot, &touches)| mask | u32::from(touches) << foot);
        if !std::mem::replace(&mut self.is_touching, true) && self.is_started {
            let cycle = self.gait.cycle(&self.walk.feet, &self.walk.stand.feet)?;
            self.add_stances(&cycle)?;
        }
        self.touching = Some(mask);
        Ok(())
    }

    /// Reports the feet that touch the ground by the names of their frames, like [`touch`](Self::touch).
    ///
    /// # Errors
    /// [`Error::Argument`] for a name that is not a foot.
    pub fn touch_named<S: AsRef<str>>(&mut self, feet: &[S]) -> Result<(), Error> {
        let mut touching = vec![false; self.places.len()];
        for name in feet {
            let name = name.as_ref();
            match self.walk.feet.iter().position(|foot| foot.frame == name) {
                Some(foot) => touching[foot] = true,
                None => return Err(Error::Argument { name: "feet", what: format!("`{name}` is not a foot") }),
            }
        }
        self.touch(&touching)
    }

    /// Sets the plane of the ground. With `None`, it is the plane through the last footholds.
    pub fn set_terrain(&mut self, terrain: Option<Terrain>) {
        self.walk.given_terrain = terrain;
    }

    /// Returns a policy that follows the latest plan, for another thread. Allocates.
    pub fn policy(&self) -> Policy {
        Policy::new(&self.publisher, &self.model, &self.walk.stand.x[..self.model.nq()], 6)
    }

    /// Writes the planned forces of the ground on the feet, along the world's axes: for each knot, three numbers for
    /// each foot (N). The force of a foot in the air is 0. Allocates.
    ///
    /// # Errors
    /// [`Error::Robot`] without a plan.
    pub fn forces(&mut self) -> Result<Vec<f64>, Error> {
        if !self.is_started {
            return Err(Error::Robot { what: "there is no plan yet".to_owned() });
        }
        let count = self.places.len();
        let mut forces = vec![0.0; 3 * count * self.knot_models.len()];
        for (t, row) in forces.chunks_exact_mut(3 * count).enumerate() {
            let Some(motion) = self.problem.motion(self.solver.solution(), t) else { continue };
            for (foot, force) in self.walk.feet.iter().zip(row.chunks_exact_mut(3)) {
                if let Some(contact) = motion.contact(&foot.frame) {
                    force.copy_from_slice(&contact.force.linear.to_array());
                }
            }
        }
        Ok(forces)
    }

    /// Returns the report of the last tick.
    pub fn report(&self) -> &Report {
        &self.report
    }

    /// Returns the problem of the last tick.
    pub fn problem(&mut self) -> &mut Problem {
        &mut self.problem
    }

    /// Returns the solver, with the plan and its multipliers.
    pub fn solver(&self) -> &InteriorPoint {
        &self.solver
    }

    /// Returns the robot.
    pub fn model(&self) -> &Arc<Model> {
        &self.model
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.walk.settings
    }

    /// Returns the plane of the ground that the controller assumes.
    pub fn terrain(&self) -> Terrain {
        self.walk.terrain
    }
}

/// Returns the problem with a model for each stance.
fn problem_of(maker: &KnotMaker<'_>, stances: &[u32], x0: &[f64]) -> Result<Problem, Error> {
    let models = stances.iter().map(|&stance| maker.knot(stance).map(boxed)).collect::<Result<Vec<_>, _>>()?;
    Ok(Problem::new(x0.to_vec(), models, vec![0; maker.settings.knots()], maker.end()?)?)
}

fn boxed(knot: ContactDynamics) -> Box<dyn ActionModel> {
    Box::new(knot)
}
