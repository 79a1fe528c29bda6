//! Guide of a walking robot: it follows the feet and the schedule, and writes the references of the plan.

use crate::gait::Cycle;
use crate::knots::{EFFORT, STATE, swing_name, tilt_name};
use crate::landing::change_swings;
use crate::planner::Planner;
use crate::references::Walk;
use crate::schedule::FootSchedule;
use crate::{Error, Foot, Terrain};
use condyle_dynamics::{Data, Model, Quaternion, Vec3, forward_kinematics};
use condyle_optimal::Problem;

/// Normal of level ground.
const UP: Vec3<f64> = Vec3 { x: 0.0, y: 0.0, z: 1.0 };

/// Walk, schedule of the feet, and stances of a robot.
#[derive(Debug)]
pub(crate) struct Guide {
    pub walk: Walk,
    pub schedule: FootSchedule,
    /// Stances, with one model of the problem for each: one bit for each foot.
    pub stances: Vec<u32>,
    /// Efforts that hold the robot still in each stance.
    pub still: Vec<Vec<f64>>,
    /// Positions of the feet (m).
    pub places: Vec<Vec3<f64>>,
    frames: Vec<usize>,
    /// Names of the costs of each foot: of its swing and its tilt.
    names: Vec<[String; 2]>,
    data: Data<f64>,
    /// Rows of references.
    rows: Vec<f64>,
    /// Normal of the ground to which the friction cones of the problem are turned.
    normal: Vec3<f64>,
    /// Time of the last observation (s).
    last: f64,
}

impl Guide {
    /// Creates the guide of a robot, with the frames of its feet, for a plan of a number of knots.
    pub(crate) fn new(model: &Model, walk: Walk, schedule: FootSchedule, frames: Vec<usize>, knots: usize) -> Self {
        let places = vec![Vec3::zero(); frames.len()];
        let names = walk.feet.iter().map(|foot: &Foot| [swing_name(foot), tilt_name(foot)]).collect();
        let rows = vec![0.0; (knots + 1) * (model.nq() + model.nv())];
        let (data, stances) = (Data::new(model), vec![(1 << frames.len()) - 1]);
        let (normal, last) = (UP, f64::NEG_INFINITY);
        Self { walk, schedule, stances, still: Vec::new(), places, frames, names, data, rows, normal, last }
    }

    /// Returns the stance in which all feet are on the ground.
    pub(crate) fn full(&self) -> u32 {
        (1 << self.frames.len()) - 1
    }

    /// Begins at the time t (s): the feet stand where they are in the state of the plan.
    pub(crate) fn begin(&mut self, t: f64, planner: &Planner) {
        self.find_feet(planner);
        self.walk.begin(&planner.x, planner.nq(), &self.places);
        self.last = t;
    }

    /// Writes the positions of the feet in the state of the plan.
    fn find_feet(&mut self, planner: &Planner) {
        let placements = forward_kinematics(&planner.model, &mut self.data, &planner.x[..planner.nq()]);
        for (place, &frame) in self.places.iter_mut().zip(&self.frames) {
            *place = placements.frame(frame).translation;
        }
    }

    /// Extends the schedule to the end of a horizon that begins at the time `start`.
    pub(crate) fn extend(&mut self, start: f64, planner: &mut Planner) {
        let settings = &self.walk.settings;
        let until = start + settings.horizon + 2.0 * settings.knot;
        self.schedule.extend(start, until, &mut planner.knots, index_in(&self.stances));
    }

    /// Returns the time of the last observation (s).
    pub(crate) fn last(&self) -> f64 {
        self.last
    }

    /// Changes the gait as soon as all feet that are in the air at the time `at` have landed. `now` is the present
    /// time.
    pub(crate) fn change_gait(&mut self, cycle: Cycle, now: f64, at: f64, planner: &mut Planner) {
        self.schedule.extend(now, at, &mut planner.knots, index_in(&self.stances));
        self.schedule.change(cycle, at, &mut planner.knots, index_in(&self.stances));
    }

    /// Observes the feet and the trunk for a horizon that begins at the time `start`, and moves the horizon there. `t`
    /// is the time of the measurement.
    pub(crate) fn renew(&mut self, t: f64, start: f64, planner: &mut Planner) -> Result<(), Error> {
        self.find_feet(planner);
        self.walk.observe(&self.places, self.schedule.stance(start), &planner.x, (t - self.last).max(0.0));
        self.last = t;
        self.extend(start, planner);
        planner.move_to(start)?;
        self.refer(planner)
    }

    /// Changes the swings at the time `start` for the feet of the mask `touching`, which touch the ground at the time
    /// t. `stood` has the feet that stood at the last tick. Returns whether a swing was changed.
    pub(crate) fn land(&mut self, touching: u32, stood: u32, [t, start]: [f64; 2], planner: &mut Planner) -> bool {
        let times = [start, t - planner.measured, self.walk.settings.knot];
        let stances = &self.stances;
        let is_stance = |stance| stances.contains(&stance);
        let changed = change_swings(&mut self.walk, &mut self.schedule, [touching, stood], times, is_stance);
        if changed {
            self.schedule.rewrite(start, &mut planner.knots, index_in(stances));
        }
        changed
    }

    /// Turns the friction cones of the feet that are balls to the normal of the ground. The cones of soles have the
    /// axes of the soles.
    fn turn_cones(&mut self, problem: &mut Problem) -> Result<(), Error> {
        let normal = self.walk.terrain.normal();
        if normal != self.normal {
            self.normal = normal;
            for foot in self.walk.feet.iter().filter(|foot| !foot.is_sole()) {
                problem.turn_cones(&foot.frame, Terrain::turn_to(normal))?;
            }
        }
        Ok(())
    }

    /// Replaces the problem of the plan by one for all stances.
    pub(crate) fn replace(&mut self, problem: Problem, planner: &mut Planner) -> Result<(), Error> {
        self.normal = UP;
        planner.replace(problem)
    }

    /// Writes all references of the plan.
    pub(crate) fn refer(&mut self, planner: &mut Planner) -> Result<(), Error> {
        let Planner { model, problem, times, knot_models, x, .. } = planner;
        self.turn_cones(problem)?;
        let (nq, nx, nu, begin) = (model.nq(), x.len(), model.nv() - 6, times[0]);
        let rows = &mut self.rows[..times.len() * nx];
        for (t, row) in times.iter().zip(rows.chunks_exact_mut(nx)) {
            self.walk.write_state(t - begin, nq, row);
        }
        problem.set_references(STATE, rows)?;
        let rows = &mut self.rows[..times.len() * nu];
        for (&model, row) in knot_models.iter().zip(rows.chunks_exact_mut(nu)) {
            row.copy_from_slice(&self.still[model]);
        }
        problem.set_references(EFFORT, rows)?;
        let velocity = velocity(x, nq);
        let rows = &mut self.rows[..times.len() * 3];
        for (foot, [swing, tilt]) in self.names.iter().enumerate() {
            if !self.walk.write_swing(foot, &self.schedule, times, x, velocity, rows) {
                continue;
            }
            problem.set_references(swing, rows)?;
            if self.walk.feet[foot].is_sole() {
                for (t, row) in times.iter().zip(rows.chunks_exact_mut(3)) {
                    self.walk.write_vertical(t - begin, row);
                }
                problem.set_references(tilt, rows)?;
            }
        }
        Ok(())
    }
}

/// Returns the function that gives the model of a stance.
fn index_in(stances: &[u32]) -> impl Fn(u32) -> usize + '_ {
    |stance| stances.iter().position(|other| *other == stance).unwrap_or(0)
}

/// Returns the horizontal velocity of the trunk in the state x, along the world's axes (m/s).
fn velocity(x: &[f64], nq: usize) -> [f64; 2] {
    let (q, v) = x.split_at(nq);
    let velocity = Quaternion::new(q[3], q[4], q[5], q[6]).to_rotation() * Vec3::new(v[0], v[1], v[2]);
    [velocity.x, velocity.y]
}
