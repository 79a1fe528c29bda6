//! Controller of a walking robot: each tick renews a plan of whole-body motion and contact forces.

use crate::command::Command;
use crate::gait::Cycle;
use crate::guide::Guide;
use crate::knots::KnotMaker;
use crate::planner::Planner;
use crate::policy::Policy;
use crate::references::Walk;
use crate::report::{Report, TickStatus};
use crate::schedule::FootSchedule;
use crate::settings::PlanSettings;
use crate::{Error, Foot, Gait, Settings, Terrain};
use condyle_dynamics::Model;
use condyle_optimal::robot::ContactDynamics;
use condyle_optimal::{ActionModel, InteriorPoint, Problem, Schedule};
use std::sync::Arc;
use std::time::Instant;

/// Time for which the robot stands before its first step (s).
const FIRST_STAND: f64 = 0.2;
/// Difference below which two times are equal (s).
const SAME_TIME: f64 = 1e-6;
/// Longest time until a change of the gait (s).
const LATEST: f64 = 60.0;
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
    planner: Planner,
    guide: Guide,
    gait: Gait,
    /// Time between the last two measurements (s).
    period: f64,
    /// Time of the measurement for which a tick is prepared (s).
    prepared: Option<f64>,
    /// Whether contacts are reported, so that the problem has models for early and late landings.
    is_touching: bool,
    /// Feet that touch the ground, one bit for each foot, as reported for the next tick.
    touching: Option<u32>,
    /// Feet that stood at the last tick, one bit for each foot.
    stood: u32,
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
        let (knots, walk) = (PlanSettings::from(&settings), Walk::new(&x, feet, settings));
        let full = (1 << feet.len()) - 1;
        let maker = KnotMaker { model: &model, feet, settings: &walk.settings };
        let problem = problem_of(&maker, &[full], &x)?;
        let cycle = Gait::Stand.cycle(feet, &walk.placed)?;
        let (schedule, period) = (FootSchedule::new(cycle, feet.len(), 0.0), knots.knot);
        let guide = Guide::new(&model, walk, schedule, frames, problem.horizon());
        let planner = Planner::new(model, problem, knots, feet.len())?;
        let (prepared, is_touching, touching, stood) = (None, false, None, full);
        Ok(Self { planner, guide, gait, period, prepared, is_touching, touching, stood })
    }

    /// Begins anew at the time t (s) with a robot that stands in the state x = (q, v). This state defines the stand:
    /// its joints are the posture to which the robot returns, and its feet are on the ground. Solves the first problem.
    /// Allocates, and takes as long as several ticks.
    ///
    /// # Errors
    /// [`Error::Argument`] for a state or a time that is not finite; [`Error::Gait`] if the gait does not fit the
    /// positions of the feet; [`Error::Robot`] if no plan is found.
    pub fn reset(&mut self, t: f64, x: &[f64]) -> Result<&Report, Error> {
        self.planner.begin(t, x)?;
        self.guide.begin(t, &self.planner);
        (self.touching, self.stood, self.prepared) = (None, self.guide.full(), None);
        let start = self.planner.times[0];
        let Guide { walk, still, .. } = &mut self.guide;
        let cycle = self.gait.cycle(&walk.feet, &walk.stand.feet)?;
        still.clear(); // they belong to the last stand
        self.add_stances(&cycle)?;
        self.planner.knots = Schedule::new(self.settings().knot, 0)?;
        self.guide.schedule = FootSchedule::new(cycle, self.count(), start + FIRST_STAND);
        self.guide.extend(start, &mut self.planner);
        self.planner.restart(start, TickStatus::Planned, |planner| self.guide.refer(planner))?;
        Ok(self.complete_report())
    }

    /// Returns the number of feet.
    fn count(&self) -> usize {
        self.guide.places.len()
    }

    /// Creates models for the stances of a gait that have none yet. If there are any, the problem is made anew, and the
    /// plan is moved to the new problem.
    fn add_stances(&mut self, cycle: &Cycle) -> Result<(), Error> {
        let (full, count) = (self.guide.full(), self.count());
        let Guide { walk, stances, still, .. } = &mut self.guide;
        let before = stances.len();
        let probe = FootSchedule::of_cycle(cycle.clone(), count);
        for t in probe.events() {
            let stance = probe.stance(t);
            // with reports of contacts, each foot in the air may stand
            let most = if self.is_touching { full } else { stance };
            for stance in (stance..=most).filter(|other| other & stance == stance) {
                if !stances.contains(&stance) {
                    stances.push(stance);
                }
            }
        }
        if stances.len() == before && !still.is_empty() {
            return Ok(());
        }
        let maker = KnotMaker { model: &self.planner.model, feet: &walk.feet, settings: &walk.settings };
        still.clear();
        for &stance in &*stances {
            still.push(maker.knot(stance)?.quasi_static(&walk.stand.x));
        }
        let problem = problem_of(&maker, stances, &walk.stand.x)?;
        self.guide.replace(problem, &mut self.planner)
    }

    /// Renews the plan for the measured state x = (q, v) at the time t (s). After [`prepare`](Self::prepare) for this
    /// time, only the part remains that depends on the state. Allocates nothing. A state that is not finite
    /// leaves the plan as it is, and the report says so. The first call is a [`reset`](Self::reset).
    ///
    /// # Errors
    /// [`Error::Argument`] for a state of another length or a time that is not finite; [`Error::Time`] if t is before
    /// the last call; at the first call, the errors of [`reset`](Self::reset).
    pub fn update(&mut self, t: f64, x: &[f64]) -> Result<&Report, Error> {
        self.planner.check_time(t)?;
        if !self.planner.is_started {
            return self.reset(t, x);
        }
        if !self.planner.accepts(x)? {
            self.touching = None;
            return Ok(&self.planner.report);
        }
        let (begin, start) = (Instant::now(), self.planner.start(t));
        let is_prepared = self.prepared.take().is_some_and(|prepared| (prepared - t).abs() < SAME_TIME);
        let is_prepared = !self.land(t, start) && is_prepared;
        self.planner.predict(t, start, x)?;
        if !is_prepared {
            self.guide.renew(t, start, &mut self.planner)?;
            self.planner.problem.set_x0(&self.planner.x)?;
        }
        self.period = t - self.planner.measured;
        (self.planner.measured, self.stood) = (t, self.guide.walk.stance);
        self.planner.tick(is_prepared, begin, |planner| self.guide.refer(planner))?;
        Ok(self.complete_report())
    }

    /// Changes the swings for the reported contacts, if there are any. Returns whether a swing was changed.
    fn land(&mut self, t: f64, start: f64) -> bool {
        let touching = self.touching.take();
        touching.is_some_and(|touching| self.guide.land(touching, self.stood, [t, start], &mut self.planner))
    }

    /// Makes the part of the next [`update`](Self::update) that does not depend on the measured state, before the state
    /// arrives: references and the first sweeps, along the predicted state. `t` is the time of the next measurement
    /// (s); with `None`, it follows after the last period. An update at another time makes the whole tick again.
    /// Allocates nothing.
    ///
    /// # Errors
    /// [`Error::Robot`] before the first plan; [`Error::Time`] for a time before the last call.
    pub fn prepare(&mut self, t: Option<f64>) -> Result<(), Error> {
        self.check_started()?;
        let t = t.unwrap_or(self.planner.measured + self.period);
        self.planner.check_time(t)?;
        let start = self.planner.start(t);
        self.planner.follow(start)?;
        self.guide.renew(t, start, &mut self.planner)?;
        self.planner.solver.prepare(&mut self.planner.problem, self.guide.walk.settings.sweeps)?;
        self.prepared = Some(t);
        Ok(())
    }

    fn check_started(&self) -> Result<(), Error> {
        match self.planner.is_started {
            true => Ok(()),
            false => Err(Error::Robot { what: "there is no plan yet".to_owned() }),
        }
    }

    /// Writes the command and the feet on the ground to the report, and returns it.
    fn complete_report(&mut self) -> &Report {
        let (report, walk) = (&mut self.planner.report, &self.guide.walk);
        report.command = walk.command.to_array();
        for (foot, stands) in report.stands.iter_mut().enumerate() {
            *stands = walk.stance & (1 << foot) != 0;
        }
        report
    }

    /// Sets the commanded velocity of the trunk. The velocity changes with at most the accelerations of the settings.
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite.
    pub fn command(&mut self, command: Command) -> Result<(), Error> {
        command.check()?;
        self.guide.walk.goal = command;
        Ok(())
    }

    /// Sets the height of the trunk, relative to the stand (m).
    ///
    /// # Errors
    /// [`Error::Argument`] for a number that is not finite.
    pub fn set_height(&mut self, raised: f64) -> Result<(), Error> {
        Error::check_array("height", &[raised], 1)?;
        self.guide.walk.raised = raised;
        Ok(())
    }

    /// Changes the gait as soon as all feet that are in the air have landed. No other foot leaves the ground before.
    /// Allocates if the gait has stances that no earlier gait had.
    ///
    /// # Errors
    /// [`Error::Gait`] for a gait that does not fit the feet.
    pub fn set_gait(&mut self, gait: Gait) -> Result<(), Error> {
        self.set_gait_at(gait, f64::NEG_INFINITY)
    }

    /// Changes the gait as [`set_gait`](Self::set_gait) does, but not before the time t (s), at most 60 s ahead. Until
    /// then the present gait goes on, and swings that have begun by then end as planned.
    ///
    /// # Errors
    /// [`Error::Gait`] for a gait that does not fit the feet; [`Error::Argument`] for a time that is too late or no
    /// number, and for a time before the first [`reset`](Self::reset).
    pub fn set_gait_at(&mut self, gait: Gait, t: f64) -> Result<(), Error> {
        if !self.planner.is_started && t.is_finite() {
            let what = "there is no plan yet: call `reset` first, or give no time".to_owned();
            return Err(Error::Argument { name: "t", what });
        }
        let now = self.guide.last() + self.settings().latency;
        if t.is_nan() || self.planner.is_started && t > now + LATEST {
            let what = format!("the time {t} s is not before {} s", now + LATEST);
            return Err(Error::Argument { name: "t", what });
        }
        if self.planner.is_started {
            let walk = &self.guide.walk;
            let cycle = gait.cycle(&walk.feet, &walk.stand.feet)?;
            self.add_stances(&cycle)?;
            self.guide.change_gait(cycle, now, t.max(now), &mut self.planner);
        }
        self.gait = gait;
        Ok(())
    }

    /// Reports which feet touch the ground, as measured at the time of the next [`update`](Self::update), one entry for
    /// each foot. Later updates need reports of their own. Without reports, feet land when the schedule says so.
    ///
    /// - A foot that touches after half of its swing has landed: it stands from then on, where it is.
    /// - A foot that does not touch at the end of its swing swings on, and its foothold is lowered at 0.8 m/s, by at
    ///   most 0.06 m. The foot counts as standing at once if fewer than two other feet
    ///   stand, or if these are no stance of the gait.
    ///
    /// Other swings stay as the schedule has them. The first call makes models for all stances that early landings can
    /// lead to, and allocates.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one entry for each foot.
    pub fn touch(&mut self, feet: &[bool]) -> Result<(), Error> {
        if feet.len() != self.count() {
            let what = format!("expected {} feet, found {}", self.count(), feet.len());
            return Err(Error::Argument { name: "feet", what });
        }
        let mask = feet.iter().enumerate().fold(0, |mask, (foot, &touches)| mask | u32::from(touches) << foot);
        if !std::mem::replace(&mut self.is_touching, true) && self.planner.is_started {
            let walk = &self.guide.walk;
            let cycle = self.gait.cycle(&walk.feet, &walk.stand.feet)?;
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
        let mut touching = vec![false; self.count()];
        for name in feet {
            let name = name.as_ref();
            match self.guide.walk.feet.iter().position(|foot| foot.frame == name) {
                Some(foot) => touching[foot] = true,
                None => return Err(Error::Argument { name: "feet", what: format!("`{name}` is not a foot") }),
            }
        }
        self.touch(&touching)
    }

    /// Sets the plane of the ground. With `None`, it is the plane through the last footholds.
    pub fn set_terrain(&mut self, terrain: Option<Terrain>) {
        self.guide.walk.given_terrain = terrain;
    }

    /// Returns a policy that follows the latest plan, for another thread. Allocates.
    pub fn policy(&self) -> Policy {
        self.planner.policy(&self.guide.walk.stand.x[..self.planner.nq()], 6)
    }

    /// Writes the planned forces of the ground on the feet, along the world's axes: for each knot, three numbers for
    /// each foot (N). The force of a foot in the air is 0. Allocates.
    ///
    /// # Errors
    /// [`Error::Robot`] without a plan.
    pub fn forces(&mut self) -> Result<Vec<f64>, Error> {
        self.check_started()?;
        let Planner { problem, solver, knot_models, .. } = &mut self.planner;
        let feet = &self.guide.walk.feet;
        let mut forces = vec![0.0; 3 * feet.len() * knot_models.len()];
        for (t, row) in forces.chunks_exact_mut(3 * feet.len()).enumerate() {
            let Some(motion) = problem.motion(solver.solution(), t) else { continue };
            for (foot, force) in feet.iter().zip(row.chunks_exact_mut(3)) {
                if let Some(contact) = motion.contact(&foot.frame) {
                    force.copy_from_slice(&contact.force.linear.to_array());
                }
            }
        }
        Ok(forces)
    }

    /// Returns the times of the knots of the plan: N + 1 times (s).
    pub fn times(&self) -> &[f64] {
        &self.planner.times
    }

    /// Returns which feet are on the ground in each knot, flat: one entry for each of N knots and each foot. Together
    /// with the solution and the [`times`](Self::times), these are the arguments of `condyle::plan_of`. It makes the
    /// plan that a whole-body controller tracks. Allocates.
    ///
    /// # Errors
    /// [`Error::Robot`] without a plan.
    pub fn touches(&self) -> Result<Vec<bool>, Error> {
        self.check_started()?;
        let stance = |&model: &usize| self.guide.stances[model];
        let stands = |stance: u32| (0..self.count()).map(move |foot| stance & (1 << foot) != 0);
        Ok(self.planner.knot_models.iter().map(stance).flat_map(stands).collect())
    }

    /// Returns the report of the last tick.
    pub fn report(&self) -> &Report {
        &self.planner.report
    }

    /// Returns the problem of the last tick.
    pub fn problem(&mut self) -> &mut Problem {
        &mut self.planner.problem
    }

    /// Returns the solver, with the plan and its multipliers.
    pub fn solver(&self) -> &InteriorPoint {
        &self.planner.solver
    }

    /// Returns the robot.
    pub fn model(&self) -> &Arc<Model> {
        &self.planner.model
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings {
        &self.guide.walk.settings
    }

    /// Returns the plane of the ground that the controller assumes.
    pub fn terrain(&self) -> Terrain {
        self.guide.walk.terrain
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
