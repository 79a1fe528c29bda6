//! Settings of the controllers.

use crate::Error;
use condyle_optimal::{InteriorPoint, Problem};
use std::time::Duration;

/// Settings of a [`WholeBodyMpc`](crate::WholeBodyMpc). The defaults fit legged robots of 10 to 100 kg.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Duration of the horizon (s).
    pub horizon: f64,
    /// Duration of a knot (s).
    pub knot: f64,
    /// Weights of the costs.
    pub weights: Weights,
    /// Limits that the plan keeps, in addition to friction cones.
    pub limits: PlanLimits,
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
    /// Largest accelerations of the command: forwards and to the left (m/s²), and of turning (rad/s²).
    pub accelerations: [f64; 3],
    /// Height of a swing above the line from lift-off to landing (m).
    pub swing_height: f64,
    /// Distance by which a foothold moves for each m/s of deviation from the commanded velocity (s).
    pub capture: f64,
    /// Fraction of a sole in which the plan keeps the centre of pressure.
    pub used_sole: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            horizon: 0.5,
            knot: 0.02,
            weights: Weights::default(),
            limits: PlanLimits::default(),
            sweeps: 2,
            iterations: [1, 1],
            budget: f64::INFINITY,
            latency: 0.0,
            threads: 1,
            accelerations: [1.0, 1.0, 2.0],
            swing_height: 0.06,
            capture: 0.1,
            used_sole: 0.85,
        }
    }
}

/// Limits of the robot that the plan keeps. Friction cones are always kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlanLimits {
    /// Limits of the joints' efforts.
    pub efforts: bool,
    /// Limits of the joints' positions. They may give way at a high cost, because a measured position can be outside.
    pub positions: bool,
    /// Limits of the joints' velocities. They may give way like limits of positions.
    pub velocities: bool,
}

impl Default for PlanLimits {
    fn default() -> Self {
        Self { efforts: true, positions: true, velocities: true }
    }
}

/// Weights of the costs. Errors are squared: a weight w costs ½ w e² per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Weight of the trunk's horizontal position (m).
    pub place: f64,
    /// Weight of the trunk's height (m).
    pub height: f64,
    /// Weight of the trunk's roll and pitch (rad).
    pub tilt: f64,
    /// Weight of the trunk's heading (rad).
    pub heading: f64,
    /// Weight of the velocity forwards (m/s).
    pub forwards: f64,
    /// Weight of the velocity to the left (m/s).
    pub sideways: f64,
    /// Weight of the vertical velocity (m/s).
    pub vertical: f64,
    /// Weight of the trunk's rates of rotation (rad/s).
    pub rotation: f64,
    /// Weights of the joints of legs: position (rad) and velocity (rad/s).
    pub legs: [f64; 2],
    /// Weights of the other joints: position (rad) and velocity (rad/s).
    pub upper_body: [f64; 2],
    /// Weight of an effort, relative to its limit.
    pub effort: f64,
    /// Weights of the position of a swinging foot: horizontal and vertical (m).
    pub swing: [f64; 2],
    /// Weight of the tilt of a swinging sole (sine).
    pub level: f64,
    /// Weight of the state at the end of the horizon, in seconds of a knot's cost.
    pub end: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            place: 50.0,
            height: 2000.0,
            tilt: 400.0,
            heading: 100.0,
            forwards: 100.0,
            sideways: 100.0,
            vertical: 50.0,
            rotation: 3.0,
            legs: [2.0, 0.02],
            upper_body: [20.0, 0.3],
            effort: 1.5,
            swing: [300.0, 3e4],
            level: 1e3,
            end: 0.1,
        }
    }
}

impl Settings {
    /// Returns the number of knots of the horizon.
    pub fn knots(&self) -> usize {
        (self.horizon / self.knot).round().max(1.0) as usize
    }

    /// Checks all numbers. [`WholeBodyMpc::new`](crate::WholeBodyMpc::new) makes this check too.
    ///
    /// # Errors
    /// [`Error::Setting`] for a number outside its range.
    pub fn check(&self) -> Result<(), Error> {
        PlanSettings::from(self).check(self.horizon)?;
        for value in self.accelerations {
            check_above("accelerations", value)?;
        }
        check_at_least("swing_height", self.swing_height)?;
        check_at_least("capture", self.capture)?;
        let is_part = self.used_sole > 0.0 && self.used_sole <= 1.0;
        Error::check("used_sole", self.used_sole, is_part, "above 0 and at most 1")?;
        let w = &self.weights;
        let pairs = [w.legs, w.upper_body, w.swing].into_iter().flatten();
        let others = [
            w.place, w.height, w.tilt, w.heading, w.forwards, w.sideways, w.vertical, w.rotation, w.effort, w.level,
            w.end,
        ];
        pairs.chain(others).try_for_each(|value| check_at_least("weights", value))
    }
}

/// Settings of a plan, which all controllers have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlanSettings {
    pub knot: f64,
    pub sweeps: usize,
    pub iterations: [usize; 2],
    pub budget: f64,
    pub latency: f64,
    pub threads: usize,
}

impl From<&Settings> for PlanSettings {
    fn from(settings: &Settings) -> Self {
        let &Settings { knot, sweeps, iterations, budget, latency, threads, .. } = settings;
        Self { knot, sweeps, iterations, budget, latency, threads }
    }
}

impl PlanSettings {
    /// Checks the settings, for a horizon of `horizon` seconds.
    pub(crate) fn check(&self, horizon: f64) -> Result<(), Error> {
        check_above("knot", self.knot)?;
        let is_valid = horizon >= self.knot && horizon / self.knot <= MOST_KNOTS;
        Error::check("horizon", horizon, is_valid, "at least a knot, and at most 1000 knots")?;
        Error::check("threads", self.threads as f64, (1..=MOST_THREADS).contains(&self.threads), "from 1 to 1024")?;
        Error::check("sweeps", self.sweeps as f64, self.sweeps > 0, "at least 1")?;
        let [least, most] = self.iterations;
        Error::check("iterations", least as f64, least > 0, "at least 1")?;
        Error::check("iterations", most as f64, most >= least, "at least the least number")?;
        Error::check("budget", self.budget, self.budget > 0.0, "above 0")?;
        check_at_least("latency", self.latency)
    }

    /// Returns the solver of a problem.
    pub(crate) fn solver_of(&self, problem: &Problem) -> InteriorPoint {
        let mut solver = InteriorPoint::new(problem);
        solver.settings.tolerance = TOLERANCE;
        solver.settings.threads = self.threads;
        solver.settings.time_budget = self.budget.is_finite().then(|| Duration::from_secs_f64(self.budget));
        solver
    }
}

/// Most threads of a solver.
const MOST_THREADS: usize = 1024;
/// Most knots of a horizon.
const MOST_KNOTS: f64 = 1000.0;
/// Tolerance of the first solve.
const TOLERANCE: f64 = 1e-4;

pub(crate) fn check_above(name: &'static str, value: f64) -> Result<(), Error> {
    Error::check(name, value, value > 0.0 && value.is_finite(), "above 0")
}

pub(crate) fn check_at_least(name: &'static str, value: f64) -> Result<(), Error> {
    Error::check(name, value, value >= 0.0 && value.is_finite(), "at least 0")
}
